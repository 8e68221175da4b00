#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Writes a machine as a model for the MuJoCo Menagerie, and checks it.

    tests/simulators/menagerie.py PKM MACHINE.ini FOLDER [--study STUDY.toml] [--license FILE] [--no-picture]

The folder gets what the Menagerie's contributing guide and its tests of folders ask for: NAME.xml, scene.xml, assets for
shapes, README.md, CHANGELOG.md, LICENSE and a picture of the scene, NAME.png. XML files have two spaces of indentation and
lines of at most 120 characters. The check is the Menagerie's own for models: random commands over the ranges of all
actuators for a second, without a warning of MuJoCo. Exit code 1 if it fails; the folder remains for a look.
"""

import argparse
import datetime
import importlib.util
import json
import re
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

import mujoco

REPOSITORY = Path(__file__).resolve().parents[2]
WIDTH = 120
SECONDS = 1.0

README = """\
# {name} Description (MJCF)

> [!IMPORTANT]
> Requires MuJoCo {tested} or later.

## Changelog

See [CHANGELOG.md](./CHANGELOG.md) for a full history of changes.

## Overview

A parallel-kinematic machine tool: `{name}` of pkmkins, a LinuxCNC kinematics module. {loops} equality constraints close
its loops and couple the threads of its screws.

<p float="left">
  <img src="{name}.png" width="400">
</p>

## MJCF derivation

1. `pkm export {ini} --mjcf FOLDER{study}` (pkmkins {version}).
2. Lines wrapped at {width} characters; folder of shapes renamed to `assets`.

{parameters}
## License

See [LICENSE](LICENSE).
"""


def styled(text):
    """Returns an XML file in the Menagerie's style."""
    text = re.sub(r" ?/>", "/>", text).replace('meshdir="meshes"', 'meshdir="assets"')
    lines = []
    for line in text.splitlines():
        indent = len(line) - len(line.lstrip())
        # Between attributes; only very long ones are divided.
        whole = re.sub(r'"[^"]{,90}"', lambda found: found[0].replace(" ", "\0"), line.lstrip())
        wrapped = textwrap.wrap(whole, WIDTH, initial_indent=" " * indent, subsequent_indent=" " * (indent + 2),
                                break_long_words=False, break_on_hyphens=False)
        lines += [part.replace("\0", " ") for part in wrapped]
    return "\n".join(lines) + "\n"


def write(pkm, ini, folder, study, license_file):
    """Writes all files except the picture, and returns the name of the model."""
    with tempfile.TemporaryDirectory() as scratch:
        words = ["--study", study] if study else []
        subprocess.run([pkm, "export", ini, "--mjcf", scratch, *words, "--quiet"], check=True, stdout=subprocess.DEVNULL)
        exported = Path(scratch)
        folder.mkdir(parents=True)
        name = next(file.stem for file in exported.glob("*.xml") if file.stem != "scene")
        for file in exported.glob("*.xml"):
            (folder / file.name).write_text(styled(file.read_text()))
        for shape in exported.glob("meshes/*"):
            (folder / "assets").mkdir(exist_ok=True)
            (folder / "assets" / shape.name).write_bytes(shape.read_bytes())
        # From the idealizations on; the head has this file's own words.
        own = (exported / "README.md").read_text()
    version = subprocess.run([pkm, "--version"], check=True, capture_output=True, text=True).stdout.split()[-1]
    model = mujoco.MjModel.from_xml_path(str(folder / f"{name}.xml"))
    (folder / "README.md").write_text(README.format(
        name=name, tested=mujoco.__version__, ini=ini.name, study=f" --study {study.name}" if study else "", version=version,
        loops=model.neq, width=WIDTH, parameters=own[own.index("## Idealizations"):]))
    (folder / "CHANGELOG.md").write_text(
        f"# Changelog – {name} Description\n\nAll notable changes to this model will be documented in this file.\n\n"
        f"## [{datetime.date.today()}]\n- Initial release.\n")
    (folder / "LICENSE").write_text(license_file.read_text())
    return name


def warnings(scene):
    """Returns MuJoCo's warnings under random commands."""
    model = mujoco.MjModel.from_xml_path(str(scene))
    data = mujoco.MjData(model)
    low, high = model.actuator_ctrlrange.T
    free = ~model.actuator_ctrllimited.astype(bool)
    low[free], high[free] = -1, 1
    # Without this, MuJoCo also writes them into a file of the current folder.
    mujoco.set_mju_user_warning(lambda text: None)
    n = 0
    while data.time < SECONDS and not data.warning.number.any():
        share = [mujoco.mju_Halton(n, k + 2) for k in range(model.nu)]
        data.ctrl[:] = low + (high - low) * share
        mujoco.mj_step(model, data)
        n += 1
    return [mujoco.mjtWarning(k).name for k, count in enumerate(data.warning.number) if count]


def picture(scene, file):
    """Renders the scene at home as play.py does."""
    spec = importlib.util.spec_from_file_location("play", REPOSITORY / "docs/studies/examples/play.py")
    play = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(play)
    model = mujoco.MjModel.from_xml_path(str(scene))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    play.picture(model, data, str(file))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pkm")
    parser.add_argument("ini", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--study", type=Path)
    parser.add_argument("--license", type=Path, default=REPOSITORY / "LICENSE", help="default: that of pkmkins")
    parser.add_argument("--no-picture", dest="picture", action="store_false")
    arguments = parser.parse_args()
    if arguments.folder.exists():
        sys.exit(f"{arguments.folder}: exists; remove it, or give another folder")
    name = write(arguments.pkm, arguments.ini, arguments.folder, arguments.study, arguments.license)
    scene = arguments.folder / "scene.xml"
    found = warnings(scene)
    if arguments.picture:
        picture(scene, arguments.folder / f"{name}.png")
    long = [file.name for file in arguments.folder.glob("*.xml") if max(map(len, file.read_text().splitlines())) > WIDTH]
    print(json.dumps({"folder": str(arguments.folder), "warnings": found, "long_lines": long}))
    return 1 if found or long else 0


if __name__ == "__main__":
    sys.exit(main())
