#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Plays the joint values of `pkm joints --passive` on a model of `pkm export --mjcf`.

    play.py MODEL.xml STATES.csv [--period 0.001] [--picture FILE.png] [--show]

STATES.csv has one row per period. The drives follow it; the script prints how far the platform is from its own columns.
Needs the Python package mujoco. A picture without a display: MUJOCO_GL=egl or osmesa.
"""

import argparse
import csv
import time

import mujoco
import numpy as np


def picture(model, data, file):
    """Renders the model as a PPM or, with Pillow, a PNG file."""
    camera = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, camera)
    camera.elevation, camera.azimuth, camera.distance = -15, 120, 2.5 * model.stat.extent
    camera.lookat[:] = model.stat.center
    with mujoco.Renderer(model, 960, 1280) as renderer:
        renderer.update_scene(data, camera)
        pixels = renderer.render()
    if file.endswith(".ppm"):
        with open(file, "wb") as out:
            out.write(b"P6 1280 960 255\n" + pixels.tobytes())
    else:
        from PIL import Image
        Image.fromarray(pixels).save(file)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model")
    parser.add_argument("states")
    parser.add_argument("--period", type=float, default=0.001, help="seconds between rows")
    parser.add_argument("--picture", help="render the last pose")
    parser.add_argument("--show", action="store_true", help="show the motion on a display")
    arguments = parser.parse_args()
    model = mujoco.MjModel.from_xml_path(arguments.model)
    data = mujoco.MjData(model)
    with open(arguments.states, newline="") as file:
        names, *rows = csv.reader(file)
    values = np.array([[float(cell) for cell in row] for row in rows])
    joint = {name: model.joint(name) for name in names}
    platform = [k for k, name in enumerate(names) if name.startswith("platform_")]
    for name, value in zip(names, values[0], strict=True):
        data.qpos[joint[name].qposadr[0]] = value
    steps = max(1, round(arguments.period / model.opt.timestep))
    viewer = None
    if arguments.show:
        from mujoco import viewer as display
        viewer = display.launch_passive(model, data)
    worst = np.zeros(len(platform))
    for row in values:
        started = time.monotonic()
        for n in range(model.nu):
            data.ctrl[n] = row[names.index(model.actuator(n).name)]
        for _ in range(steps):
            mujoco.mj_step(model, data)
        off = [data.qpos[joint[names[k]].qposadr[0]] - row[k] for k in platform]
        worst = np.maximum(worst, np.abs(off))
        if viewer:
            viewer.sync()
            time.sleep(max(0.0, arguments.period - (time.monotonic() - started)))
    for k, value in zip(platform, worst, strict=True):
        print(f"{names[k]}: largest lag {value:.3e}")
    if arguments.picture:
        mujoco.mj_forward(model, data)
        picture(model, data, arguments.picture)


if __name__ == "__main__":
    main()
