#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Runs one program of one configuration under the real LinuxCNC and records it.

    tests/live/run_live.py --config configs/hexapod --program five-axis-surface.ngc --out FOLDER

--config is a folder of the repository whose INI file has the folder's name, or any INI file in its own folder.
Writes trace.csv, result.json and linuxcnc.log into FOLDER (see README.md). Exit code 0 if the
machine homed, ran the program to its end and gave no message.
"""

import argparse
import json
import re
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from session import Session  # noqa: E402
from unprivileged import REPOSITORY, is_unprivileged, only_one, rerun_unprivileged  # noqa: E402

MOTIONS = ("STRAIGHT_FEED", "STRAIGHT_TRAVERSE", "ARC_FEED")


def moves_in(session, program):
    """Returns LinuxCNC's number of motions for a program, without those of U V W alone: its stand-alone interpreter
    has only the other six letters."""
    known = session.copy / "known-letters.ngc"
    known.write_text(re.sub(r"(?m)^(?!;)(.*)$", lambda line: re.sub(r"[UVW]-?[\d.]+", "", line[1]),
                            program.read_text()))
    command = ["rs274", "-i", str(session.ini), "-t", f"{session.ini.stem}.tbl", "-g", str(known)]
    done = subprocess.run(command, cwd=session.copy, stdin=subprocess.DEVNULL, capture_output=True,
                          text=True, timeout=60)
    return sum(any(motion + "(" in line for motion in MOTIONS) for line in done.stdout.splitlines())


def run(config, program, out, seconds, text=None, scenario="program", ini_name=None, **arguments):
    """Returns the result of one program, the shipped one or `text`; also written to out/result.json."""
    with Session(REPOSITORY / config, ini_name) as session:
        path = session.copy / "programs" / program
        if text is not None:
            path.write_text(text)
        lines = len(path.read_text().splitlines())
        moves = moves_in(session, path)
        result = session.run(scenario, out, seconds, path=str(path), lines=lines, seconds=seconds,
                             **arguments)
    result = {"config": session.config.name, "program": program, "lines": lines, "moves": moves,
              **result}
    (out / "result.json").write_text(json.dumps(result, indent=1) + "\n")
    return result


def parsed():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--config", required=True, help="folder, as configs/hexapod, or INI file")
    arguments.add_argument("--program", required=True, help="file in the programs folder")
    arguments.add_argument("--out", required=True, help="folder for the results")
    arguments.add_argument("--seconds", type=float, default=120, help="time limit of the program")
    return arguments.parse_args()


def place_of(config):
    """Returns folder and name of the INI file."""
    path = REPOSITORY / config
    if path.suffix == ".ini":
        return path.parent, path.name
    return path, f"{path.name}.ini"


def refuse_bad_names(options):
    """Ends with an error before anything is started."""
    config, ini = place_of(options.config)
    if not (config / ini).is_file():
        sys.exit(f"run_live: {options.config} holds no {ini}")
    program = config / "programs" / options.program
    if Path(options.program).name != options.program or not program.is_file():
        names = " ".join(sorted(p.name for p in (config / "programs").glob("*.ngc")))
        sys.exit(f"run_live: {options.config} has no program {options.program}; there are: {names}")


def main():
    options = parsed()
    refuse_bad_names(options)
    if not is_unprivileged():
        out = Path(options.out).resolve()
        out.mkdir(parents=True, exist_ok=True)
        given, config = (), options.config
        if Path(config).suffix == ".ini":
            # The copy that runs has it in a readable place.
            ini = (REPOSITORY / config).resolve()
            given, config = (ini.parent,), f"given/{ini.parent.name}/{ini.name}"
        forwarded = ["--config", config, "--program", options.program, "--out", str(out),
                     "--seconds", str(options.seconds)]
        return rerun_unprivileged("tests/live/run_live.py", forwarded, options.seconds + 180, out, given)
    folder, ini = place_of(options.config)
    with only_one():
        result = run(folder, options.program, REPOSITORY / "out", options.seconds, ini_name=ini)
    if not result["ok"]:
        print(f"run_live: {result['error']}", file=sys.stderr)
    return 0 if result["ok"] else 1


if __name__ == "__main__":
    sys.exit(main())
