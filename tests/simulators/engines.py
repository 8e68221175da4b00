# SPDX-License-Identifier: GPL-2.0-or-later
"""The exported models in MuJoCo and in Pinocchio: residuals of the loops, and the pose to which they assemble."""

import json
from pathlib import Path

import mujoco
import numpy as np
import pinocchio

# Steps of Newton's method until the loops are closed to rounding: it doubles the digits with each.
MOST_STEPS = 25


class Engine:
    """A model with `driven` joints, and residuals of its loops with their derivatives."""

    def assembled(self, row):
        """Returns the row with the loops closed by the joints that no drive moves: by Newton's method, where legs
        contradict each other by that of Gauss and Newton."""
        free = ~self.driven
        at = row.copy()
        for _ in range(MOST_STEPS):
            off = self.residual(at)
            step = np.linalg.lstsq(self.jacobian(at)[:, free], -off, rcond=1e-12)[0]
            at[free] += step
            # Rounding of lengths near 1 m and angles near 1 rad.
            if np.abs(step).max(initial=0) < 1e-14:
                break
        return at


class MuJoCo(Engine):
    def __init__(self, file):
        warnings = []
        mujoco.set_mju_user_warning(warnings.append)
        self.model = mujoco.MjModel.from_xml_path(str(file))
        self.model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        if warnings:
            raise RuntimeError(f"{file}: {warnings}")
        joint = mujoco.mjtObj.mjOBJ_JOINT
        self.names = [mujoco.mj_id2name(self.model, joint, n) for n in range(self.model.njnt)]
        # Joints have one degree of freedom each, so that qpos, qvel and names have the same order.
        if not self.model.njnt == self.model.nq == self.model.nv:
            raise RuntimeError(f"{file}: a joint with more than one degree of freedom")
        driven = {self.names[self.model.actuator_trnid[n, 0]] for n in range(self.model.nu)}
        self.driven = np.array([name in driven for name in self.names])
        self.coordinates = np.array(["platform_" in name and not name.startswith("leg_") for name in self.names])

    def row(self, states, n):
        return np.array([states[name][n] for name in self.names])

    def place(self, row):
        self.data.qpos[:] = row
        mujoco.mj_fwdPosition(self.model, self.data)

    def equality(self, field):
        return field[self.data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY]

    def residual(self, row):
        """Returns the residuals of loops and threads, meters and radians."""
        self.place(row)
        return self.equality(self.data.efc_pos).copy()

    def jacobian(self, row):
        self.place(row)
        return self.equality(self.data.efc_J.reshape(-1, self.model.nv)).copy()

    def site(self, name):
        n = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SITE, name)
        return self.data.site_xpos[n].copy(), self.data.site_xmat[n].reshape(3, 3).copy()

    def nearest(self, rows):
        """Returns the row nearest to home that keeps the limits of all joints."""
        limited = self.model.jnt_limited.astype(bool)
        low, high = self.model.jnt_range.T
        kept = [row for row in rows if np.all(~limited | (low <= row) & (row <= high))]
        return min(kept, key=lambda row: np.abs(row - self.model.qpos0).max())

    def settled(self, row, seconds):
        """Returns the values after the drives have moved from home to those of the row, without weight."""
        self.model.opt.gravity[:] = 0
        mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
        joints = [self.names[self.model.actuator_trnid[n, 0]] for n in range(self.model.nu)]
        self.data.ctrl[:] = [row[self.names.index(name)] for name in joints]
        for _ in range(int(seconds / self.model.opt.timestep)):
            mujoco.mj_step(self.model, self.data)
        return self.data.qpos.copy()


class Pinocchio(Engine):
    def __init__(self, file):
        self.model = pinocchio.buildModelFromUrdf(str(file))
        self.data = self.model.createData()
        beside = json.loads(Path(file).with_suffix(".loops.json").read_text())
        self.loops = [(loop["kind"], [self.model.getFrameId(link) for link in loop["links"]],
                       [np.array(point) for point in loop["points"]]) for loop in beside["loops"]]
        self.home = {joint["name"]: joint["home"] for joint in beside["joints"]}
        self.names = [self.model.names[n] for n in range(1, self.model.njoints)]
        if set(self.names) != set(self.home):
            raise RuntimeError(f"{file}: joints differ from those of the loops")
        role = {joint["name"]: joint["role"] for joint in beside["joints"]}
        self.driven = np.array([role[name] == "driven" for name in self.names])
        self.coordinates = np.array([role[name] == "coordinate" for name in self.names])
        self.screws = [(self.names.index(s["slide"]), self.names.index(s["turn"]), s["meters_per_radian"])
                       for s in beside["screws"]]

    def row(self, states, n):
        """Returns one value for each joint, 0 at home."""
        return np.array([states[name][n] - self.home[name] for name in self.names])

    def configuration(self, row):
        q = pinocchio.neutral(self.model)
        for value, joint in zip(row, list(self.model.joints)[1:], strict=True):
            # A joint without limits has cosine and sine of its angle.
            q[joint.idx_q:joint.idx_q + joint.nq] = value if joint.nq == 1 else (np.cos(value), np.sin(value))
        return q

    def residual(self, row):
        pinocchio.framesForwardKinematics(self.model, self.data, self.configuration(row))
        off = []
        for kind, frames, points in self.loops:
            first, second = (self.data.oMf[frame] for frame in frames)
            off.append(first.act(points[0]) - second.act(points[1]))
            if kind == "rigid":
                off.append(pinocchio.log3(second.rotation.T @ first.rotation))
        off.append([row[slide] - ratio * row[turn] for slide, turn, ratio in self.screws])
        return np.concatenate(off)

    def jacobian(self, row):
        pinocchio.computeJointJacobians(self.model, self.data, self.configuration(row))
        pinocchio.updateFramePlacements(self.model, self.data)
        rows = []
        for kind, frames, points in self.loops:
            moved = []
            for frame, point in zip(frames, points, strict=True):
                of = pinocchio.getFrameJacobian(self.model, self.data, frame, pinocchio.LOCAL_WORLD_ALIGNED)
                arm = self.data.oMf[frame].rotation @ point
                moved.append((of[:3] - pinocchio.skew(arm) @ of[3:], of[3:]))
            rows.append(moved[0][0] - moved[1][0])
            if kind == "rigid":
                rows.append(self.data.oMf[frames[1]].rotation.T @ (moved[0][1] - moved[1][1]))
        threads = np.zeros((len(self.screws), self.model.nv))
        for n, (slide, turn, ratio) in enumerate(self.screws):
            threads[n, slide], threads[n, turn] = 1, -ratio
        return np.concatenate([*rows, threads])
