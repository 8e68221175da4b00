#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Compares pkmkins with MuJoCo and Pinocchio, which know bodies, joints and loops but none of its formulas.

    tests/simulators/oracle.py PKM [--poses 1000] [--random FOLDER] [--only TEXT] [--out FOLDER]

`pkm export` writes a model of every shipped machine and of random ones. At random poses, given the joint values of
`pkm joints --passive`, the loops must be closed, and given the values of the driven joints alone, the engine must
assemble the machine to our pose. Joint speeds are compared with our Jacobian, and the forces of the drives under a load
on the tool with virtual work. Models with a planted error must be noticed. One table of the worst differences; exit
code 1 if one exceeds its tolerance.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import engines
import machines
import mujoco
import numpy as np

# Residuals of the loops at our joint values, in sizes of the machine: rounding, amplified a thousand times by the leverage
# of rods and by universal joints. The largest seen is 1e-13.
LOOP = 1e-12
# Pose to which an engine assembles from our values of the driven joints: rounding, amplified by the leverage of the worst
# pose.
POSE_M, POSE_RAD = 1e-12, 1e-12
# Pose of MuJoCo's simulation, whose loops are soft springs.
SOFT_M, SOFT_RAD = 1e-6, 1e-4
# Seconds of that: many periods of the drives, of some 50 Hz.
SETTLED = 1.0
# Joint speeds and forces, as a share of the largest: both are solutions of linear equations that the conditioning of the
# pose amplifies.
LINEAR = 1e-11
# Poses on which Newton's method runs.
ASSEMBLED = 40
# Poses on which planted errors are looked for; pose differences above these count as noticed.
PLANTED = 5
NOTICED_M, NOTICED_RAD = 1e-8, 1e-8
# Displacement of the start of Newton's method, meters and radians: too small to reach another assembly.
AWAY = 1e-3


def pose_difference(engine, row, other):
    """Returns the largest difference of a platform's coordinates: meters, radians."""
    off = np.abs(row - other)
    angles = np.array([name.rsplit("_", 1)[1] in "abc" for name in engine.names])
    most = [off[engine.coordinates & chosen].max(initial=0) for chosen in (~angles, angles)]
    return np.array(most)


def assembly(engine, states, poses, random):
    """Returns the worst difference between our poses and those to which the engine assembles."""
    worst = np.zeros(2)
    for n in range(poses):
        row = engine.row(states, n)
        start = row + np.where(engine.driven, 0, AWAY * random.uniform(-1, 1, len(row)))
        worst = np.maximum(worst, pose_difference(engine, engine.assembled(start), row))
    return worst


def tips(machine, engine, poses, states, many):
    """Returns the worst distance of the tool tip on the work from the programmed one."""
    worst = 0
    for n in range(min(many, len(poses))):
        engine.place(engine.row(states, n))
        tool, _ = engine.site("tool")
        work, turned = engine.site("work")
        expected = (poses[n, :3] - [0, 0, machine.spindle]) * machine.meters
        worst = max(worst, np.abs(turned.T @ (tool - work) - expected).max())
    return worst


def linear(machine, engine, poses, states, many, random):
    """Returns the worst difference of joint speeds from our Jacobian, and of drive forces from virtual work, as shares."""
    worst = np.zeros(2)
    if machine.own is None:
        return worst * np.nan
    own = machine.own_poses(poses[:many])
    jacobians = machine.own.jacobian(own).values
    letters = machine.own.coordinates
    active = ["XYZABC".index(letter) for letter in letters]
    joints = [f"joint_{n}" for n in range(len(machine.own.joints))]
    numbers = [engine.names.index(name) for name in joints]
    unit = np.array([np.radians(1) if "arm" in name else machine.meters for name in machine.own.joints])
    per = np.array([machine.meters] * 3 + [np.radians(1)] * 3)
    platform = mujoco.mj_name2id(engine.model, mujoco.mjtObj.mjOBJ_BODY, "platform")
    for n in range(min(many, len(own))):
        # SI units: joint by coordinate of the control point.
        expected = (jacobians[n] * unit[:, None] / per)[:, active]
        row = engine.row(states, n)
        constraint = engine.jacobian(row)
        # Motions of the mechanism: the others stay.
        still = [k for k, name in enumerate(engine.names) if name.startswith("joint_") and name not in joints]
        constraint = np.vstack([constraint, np.eye(len(row))[still]])
        # The control point on the platform, o from its origin.
        o = np.array([0, 0, 0 if machine.is_bare else machine.spindle * machine.meters])
        spot = engine.data.xpos[platform] - engine.data.xmat[platform].reshape(3, 3) @ o
        slide, turn = np.zeros((3, len(row))), np.zeros((3, len(row)))
        mujoco.mj_jac(engine.model, engine.data, slide, turn, spot, platform)
        # Table axes move the work, not the platform.
        table = [k for k, name in enumerate(machine.own.joints) if name.startswith("table")]
        for k in table:
            slide["XYZ".index(machine.own.joints[k][-1]), numbers[k]] += 1
        null = np.linalg.svd(constraint)
        rank = (null[1] > 1e-9 * null[1][0]).sum()
        motions = null[2][rank:].T
        a, b, c = np.radians(own[n, 3:])
        rates = np.array([[np.cos(c) * np.cos(b), -np.sin(c), 0], [np.sin(c) * np.cos(b), np.cos(c), 0],
                          [-np.sin(b), 0, 1]])
        # Rates of X Y Z A B C for each motion.
        coordinates = np.vstack([slide @ motions, np.linalg.solve(rates, turn @ motions)])[active]
        speeds = motions[numbers] @ np.linalg.inv(coordinates)
        # Not `max`, which ignores NaN.
        worst[0] = np.maximum(worst[0], np.abs(speeds - expected).max() / np.abs(expected).max())
        # A load on the tool, and the forces of loops and drives that carry it: J' f + Jc' l = 0.
        force, moment = random.normal(size=3), 0.3 * random.normal(size=3)
        load = slide.T @ force + turn.T @ moment
        drives = np.zeros((len(row), len(numbers)))
        drives[numbers, range(len(numbers))] = 1
        solved = np.linalg.lstsq(np.hstack([drives, constraint.T]), -load, rcond=1e-12)[0][:len(numbers)]
        given = np.concatenate([force, rates.T @ moment])[active]
        off = expected.T @ solved + given
        worst[1] = np.maximum(worst[1], np.abs(off).max() / np.abs(given).max())
    return worst


def export(machine, folder, ini=None):
    machine.run("export", ini or machine.ini, "--mjcf", folder, "--urdf", folder)


def noticed(machine, folder, poses):
    """Returns the number of planted errors, and the names of those that the assembled pose does not show."""
    missed = []
    all_planted = machines.planted(machine)
    for name, text in all_planted.items():
        ini = folder / f"{machine.name}.ini"
        ini.write_text(text)
        try:
            export(machine, folder / "model", ini)
        except machines.subprocess.CalledProcessError as error:
            if error.returncode != 2:
                raise
            # No machine at all.
            continue
        engine = engines.MuJoCo(folder / "model" / f"{machine.name}.xml")
        _, states = poses
        most = np.zeros(2)
        for n in range(PLANTED):
            row = engine.row(states, n)
            most = np.maximum(most, pose_difference(engine, engine.assembled(row), row))
        if not (most[0] > NOTICED_M or most[1] > NOTICED_RAD):
            missed.append(f"{name} ({most[0]:.1e} m, {most[1]:.1e} rad)")
    return len(all_planted), missed


def judge(machine, folder, arguments, random):
    """Returns the row of the table, and what exceeds its tolerance."""
    started = time.monotonic()
    export(machine, folder / "model")
    exported = time.monotonic() - started
    poses, states = machine.poses(arguments.poses, random)
    physics = engines.MuJoCo(folder / "model" / f"{machine.name}.xml")
    tree = engines.Pinocchio(folder / "model" / f"{machine.name}.urdf")
    size = machine.size
    found = {}

    def loops(engine):
        return max(np.abs(engine.residual(engine.row(states, n))).max() for n in range(len(poses))) / size
    found["loops"] = (loops(physics), LOOP)
    found["loops_p"] = (loops(tree), LOOP)
    found["tip"] = (tips(machine, physics, poses, states, len(poses)), POSE_M)
    few = min(ASSEMBLED, len(poses))
    for name, engine in ("pose", physics), ("pose_p", tree):
        off = assembly(engine, states, few, random)
        found[f"{name}_m"], found[f"{name}_rad"] = (off[0], POSE_M), (off[1], POSE_RAD)
    speed, force = linear(machine, physics, poses, states, few, random)
    found["speed"], found["force"] = (speed, LINEAR), (force, LINEAR)
    row = physics.nearest([physics.row(states, n) for n in range(len(poses))])
    off = pose_difference(physics, physics.settled(row, SETTLED), row)
    found["soft_m"], found["soft_rad"] = (off[0], SOFT_M), (off[1], SOFT_RAD)
    planted, missed = noticed(machine, folder, (poses, states)) if arguments.planted else (0, [])
    wrong = [f"{name} {value:.1e} > {most:.0e}" for name, (value, most) in found.items() if not value <= most and
             not (machine.has_two and name in ("speed", "force"))]
    if len(poses) < arguments.poses:
        wrong.append(f"only {len(poses)} poses within reach")
    if exported > 2:
        wrong.append(f"the export took {exported:.1f} s")
    wrong += [f"not noticed: {name}" for name in missed]
    # A machine with two mechanisms has no Jacobian in the Python package.
    shown = {name: "-" if np.isnan(value) else f"{value:.1e}" for name, (value, _) in found.items()}
    shown["noticed"] = f"{planted - len(missed)} of {planted}"
    return len(poses), shown, wrong


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("pkm")
    parser.add_argument("--poses", type=int, default=1000)
    parser.add_argument("--random", type=Path, help="folder with folders of more machines")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--no-planted", dest="planted", action="store_false")
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    arguments.pkm = str(Path(arguments.pkm).resolve())
    out = arguments.out and arguments.out.resolve()
    files = machines.shipped()
    if arguments.random:
        files += sorted(arguments.random.resolve().glob("*/*.ini"))
    random = np.random.default_rng(arguments.seed)
    lines, failed = [], 0
    with tempfile.TemporaryDirectory() as scratch:
        # MuJoCo writes its log into the current folder.
        os.chdir(scratch)
        for file in files:
            if arguments.only not in file.stem:
                continue
            folder = Path(scratch) / f"{file.stem}-folder"
            folder.mkdir()
            machine = machines.Machine(arguments.pkm, file)
            count, row, wrong = judge(machine, folder, arguments, random)
            if not lines:
                lines = ["| machine | legs | poses | " + " | ".join(row) + " |", "| --- " * (len(row) + 3) + "|"]
                print("\n".join(lines))
            lines.append(f"| {machine.name} | {' '.join(machine.kinds)} | {count} | " +
                         " | ".join(row.values()) + " |")
            print(lines[-1], flush=True)
            for text in wrong:
                failed += 1
                print(f"{machine.name}: {text}", flush=True)
        os.chdir("/")
    if out:
        out.mkdir(parents=True, exist_ok=True)
        (out / "oracle.md").write_text("\n".join(lines) + "\n")
    print(f"{len(lines) - 2} machines, {failed} differences")
    return 1 if failed or len(lines) < 3 else 0


if __name__ == "__main__":
    sys.exit(main())
