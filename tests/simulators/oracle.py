#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Compares pkmkins with MuJoCo and Pinocchio, which know bodies, joints and loops but none of its formulas.

    tests/simulators/oracle.py PKM [--poses 1000] [--random FOLDER] [--only TEXT] [--out FOLDER]

`pkm export` writes a model of every shipped machine and of random ones. At random poses, given the joint values of
`pkm joints --passive`, the loops must be closed, and given the values of the driven joints alone, the engine must
assemble the machine to our pose. Joint speeds are compared with our Jacobian, and the forces of the drives under a load
on the tool with virtual work, and with those of `pkm cut`. Models with a planted error must be noticed. One table of the worst differences; exit
code 1 if one exceeds its tolerance.
"""

import argparse
import json
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
# of rods and by universal joints: the largest seen is 1e-13. With constraints, corrections of dependent coordinates stop
# earlier at one of a thousand poses: 3e-12 was seen.
LOOP = 1e-11
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
# Loads by `pkm cut`, as a share of the largest: 1e-3 kg weigh 1e-2 N beside 6e7 N. Its chip is the distance of positions
# 1e-3 mm apart, with a rounding of 1e-13 mm.
CUT = 1e-8
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


class Motions:
    """Motions of a mechanism at a row of joint values: of its joints and of the control point on its platform."""

    def __init__(self, mechanism, engine, row):
        machine, own = mechanism.machine, mechanism.own
        self.numbers = [engine.names.index(name) for name in mechanism.joints]
        loops = engine.jacobian(row)
        # The other joints stay.
        still = [k for k, name in enumerate(engine.names) if name.startswith("joint_") and name not in mechanism.joints]
        self.constraint = np.vstack([loops, np.eye(len(row))[still]])
        platform = mujoco.mj_name2id(engine.model, mujoco.mjtObj.mjOBJ_BODY, f"{mechanism.prefix}platform")
        # The control point on the platform, o from its origin.
        o = np.array([0, 0, 0 if mechanism.is_bare else mechanism.spindle * machine.meters])
        spot = engine.data.xpos[platform] - engine.data.xmat[platform].reshape(3, 3) @ o
        self.slide, self.turn = np.zeros((3, len(row))), np.zeros((3, len(row)))
        mujoco.mj_jac(engine.model, engine.data, self.slide, self.turn, spot, platform)
        # Table axes move the work, not the platform.
        for k, name in enumerate(own.joints):
            if name.startswith("table"):
                self.slide["XYZ".index(name[-1]), self.numbers[k]] += 1

    def free(self):
        """Returns all motions that the loops allow."""
        _, sizes, motions = np.linalg.svd(self.constraint)
        rank = (sizes > 1e-9 * sizes[0]).sum()
        return motions[rank:].T

    def forces(self, force, moment):
        """Returns the forces of the drives that carry a load on the tool with those of the loops: J' f + Jc' l = 0."""
        load = self.slide.T @ force + self.turn.T @ moment
        drives = np.zeros((len(load), len(self.numbers)))
        drives[self.numbers, range(len(self.numbers))] = 1
        both = np.hstack([drives, self.constraint.T])
        return np.linalg.lstsq(both, -load, rcond=1e-12)[0][:len(self.numbers)]


def linear(mechanism, engine, poses, states, random):
    """Returns the worst difference of joint speeds from our Jacobian, and of drive forces from virtual work, as shares."""
    worst = np.zeros(2)
    own = mechanism.own_poses(poses)
    # With the angles that constraints determine.
    full = mechanism.own.full_poses(own).values
    jacobians = mechanism.own.jacobian(own).values
    letters = mechanism.own.coordinates
    active = ["XYZABC".index(letter) for letter in letters]
    meters = mechanism.machine.meters
    unit = np.array([np.radians(1) if "arm" in name else meters for name in mechanism.own.joints])
    per = np.array([meters] * 3 + [np.radians(1)] * 3)
    for n in range(len(own)):
        # SI units: joint by coordinate of the control point.
        expected = (jacobians[n] * unit[:, None] / per)[:, active]
        motions = Motions(mechanism, engine, engine.row(states, n))
        free = motions.free()
        a, b, c = np.radians(full[n, 3:])
        rates = np.array([[np.cos(c) * np.cos(b), -np.sin(c), 0], [np.sin(c) * np.cos(b), np.cos(c), 0],
                          [-np.sin(b), 0, 1]])
        # Rates of X Y Z A B C for each motion.
        coordinates = np.vstack([motions.slide @ free, np.linalg.solve(rates, motions.turn @ free)])
        per_active = np.linalg.inv(coordinates[active])
        speeds = free[motions.numbers] @ per_active
        # Not `max`, which ignores NaN.
        worst[0] = np.maximum(worst[0], np.abs(speeds - expected).max() / np.abs(expected).max())
        force, moment = random.normal(size=3), 0.3 * random.normal(size=3)
        # Of a platform that only turns about its center, the control point moves too.
        given = (coordinates @ per_active).T @ np.concatenate([force, rates.T @ moment])
        off = expected.T @ motions.forces(force, moment) + given
        worst[1] = np.maximum(worst[1], np.abs(off).max() / np.abs(given).max())
    return worst


def cut(machine, engine, folder, random):
    """Returns the worst difference of the drive loads of `pkm cut` from the engine's, as a share of the largest: a lathe
    tool under a constant force."""
    mechanism = machine.mechanisms[0]
    home = dict(zip(machines.LETTERS, machine.home(), strict=True))
    millimeter = 1e-3 / machine.meters
    # Slow, and near home, where every machine has room: at most 1 mm or degree.
    by = {letter: random.uniform(0.5, 1) * (1 if letter in "ABC" else millimeter)
          for letter in mechanism.own.coordinates}
    words = " ".join(f"{letter}{home[letter] + step}" for letter, step in by.items())
    program, study = folder / "cut.ngc", folder / "cut.toml"
    program.write_text(f"G90 G94 M3 S1000\nG1 {words} F{60 * millimeter}\nM2\n")
    direction = random.normal(size=3)
    direction /= np.linalg.norm(direction)
    # So light and so soft that neither weight nor inertia shows, and that no mode is too fast for the edge.
    springs = "stiffness_n_per_um = 1e-5\ndamping_ratio = 0.1\n"
    has_table = any(name.startswith("table") for name in mechanism.own.joints)
    table = f"[table]\nmass_kg = 1e-3\n{springs}" if has_table else ""
    study.write_text(f"""[platform]
mass_kg = 1e-3
centre_mm = [0, 0, 0]
inertia_kg_m2 = [[1e-3, 0, 0], [0, 1e-3, 0], [0, 0, 1e-3]]
[legs]
{springs}
{table}
[turning]
depth_mm = 1
kf_n_per_mm2 = 1e9
thicker = {[by.get(letter, 0) for letter in 'XYZ']}
force = {direction.tolist()}
""")
    # Without ratings, the verdict is open.
    done = machine.run("cut", machine.ini, program, "--study", study, "--format", "json", check=False)
    if "force_n" not in done.stdout:
        raise RuntimeError(f"{machine.ini}: {done.stderr or done.stdout}")
    report = json.loads(done.stdout)
    size = report["force_n"]["value"]
    worst, largest = 0, 0
    for k, drive in enumerate(report["drives"]):
        pose = np.array([*drive["pose"], 0, 0, 0])
        _, states = machine.states(pose[None])
        motions = Motions(mechanism, engine, engine.row(states, 0))
        load = motions.forces(direction * size, np.zeros(3))[k]
        largest = max(largest, abs(load))
        worst = np.maximum(worst, abs(drive["load"] - load))
    return worst / largest


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


def judge(machine, folder, arguments, random, with_cut):
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
    each = [linear(mechanism, physics, poses[:few], states, random) for mechanism in machine.mechanisms]
    # Not `max`, which ignores NaN.
    speed, force = np.maximum.reduce(each)
    found["speed"], found["force"] = (speed, LINEAR), (force, LINEAR)
    found["cut"] = (cut(machine, physics, folder, random), CUT) if with_cut else None
    row = physics.nearest([physics.row(states, n) for n in range(len(poses))])
    off = pose_difference(physics, physics.settled(row, SETTLED), row)
    found["soft_m"], found["soft_rad"] = (off[0], SOFT_M), (off[1], SOFT_RAD)
    planted, missed = noticed(machine, folder, (poses, states)) if arguments.planted else (0, [])
    judged = {name: pair for name, pair in found.items() if pair}
    wrong = [f"{name} {value:.1e} > {most:.0e}" for name, (value, most) in judged.items() if not value <= most]
    if len(poses) < arguments.poses:
        wrong.append(f"only {len(poses)} poses within reach")
    if exported > 2:
        wrong.append(f"the export took {exported:.1f} s")
    wrong += [f"not noticed: {name}" for name in missed]
    shown = {name: f"{pair[0]:.1e}" if pair else "-" for name, pair in found.items()}
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
    shipped = machines.shipped()
    files = list(shipped)
    if arguments.random:
        files += sorted(arguments.random.resolve().glob("*/*.ini"))
    random = np.random.default_rng(arguments.seed)
    lines, failed, cut_by = [], 0, set()
    with tempfile.TemporaryDirectory() as scratch:
        # MuJoCo writes its log into the current folder.
        os.chdir(scratch)
        for file in files:
            if arguments.only not in file.stem:
                continue
            folder = Path(scratch) / f"{file.stem}-folder"
            folder.mkdir()
            machine = machines.Machine(arguments.pkm, file)
            # A run of LinuxCNC takes a second: once for every kind of leg, without constraints, and every kind of constraint.
            # Springs share the load of spare legs.
            is_plain = not (machine.is_carried or machine.has_two or machine.has_spare)
            kinds = set(machine.constraints or machine.kinds)
            with_cut = file in shipped and is_plain and not cut_by.issuperset(kinds)
            cut_by |= kinds if with_cut else set()
            count, row, wrong = judge(machine, folder, arguments, random, with_cut)
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
