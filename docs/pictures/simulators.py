#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Renders the exported models of all shipped machines on one sheet; without a display, with MUJOCO_GL=egl.

    docs/pictures/simulators.py PKM SHEET.png
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import mujoco
from PIL import Image, ImageDraw

WIDTH, HEIGHT, ACROSS = 320, 260, 6


def picture(pkm, ini, folder):
    """Returns the picture of a machine at home."""
    subprocess.run([pkm, "export", ini, "--mjcf", folder], check=True, stdout=subprocess.DEVNULL)
    model = mujoco.MjModel.from_xml_path(f"{folder}/scene.xml")
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, camera)
    camera.elevation, camera.azimuth, camera.distance = -20, 125, 2.8 * model.stat.extent
    camera.lookat[:] = model.stat.center
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        renderer.update_scene(data, camera)
        return Image.fromarray(renderer.render())


def main():
    pkm, sheet = sys.argv[1:]
    files = sorted(Path(__file__).resolve().parents[2].glob("configs/*/*.ini"))
    rows = -(-len(files) // ACROSS)
    whole = Image.new("RGB", (ACROSS * WIDTH, rows * HEIGHT), "white")
    draw = ImageDraw.Draw(whole)
    for n, ini in enumerate(files):
        with tempfile.TemporaryDirectory() as folder:
            place = (n % ACROSS * WIDTH, n // ACROSS * HEIGHT)
            whole.paste(picture(pkm, ini, folder), place)
            draw.text((place[0] + 8, place[1] + 6), ini.stem, fill="black", font_size=16)
    # Few colors: flat surfaces.
    whole.quantize(128).save(sheet, optimize=True)


if __name__ == "__main__":
    main()
