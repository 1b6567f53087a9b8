"""MuJoCo's compiler on a robot file, as `mujoco.MjModel.from_xml_path` has it."""

from __future__ import annotations

from typing import Any

import numpy as np

FORMATS, PACKAGE, MODULE = ("mjcf", "urdf"), "mujoco", "mujoco"
KINDS = ("free", "ball", "slide", "hinge")


class _Robot:
    free = ball = "mujoco"
    hidden: dict[str, str] = {}  # noqa: RUF012
    precision = 0.0

    def __init__(self, path: str) -> None:
        import mujoco

        self._lib = mujoco
        self.version = mujoco.__version__
        self._m = m = mujoco.MjModel.from_xml_path(path)
        self._d = mujoco.MjData(m)
        self.nq, self.nv = m.nq, m.nv
        self._bodies = [m.body(i).name or f"body{i}" for i in range(m.nbody)]
        names = [m.joint(i).name or f"joint{i}" for i in range(m.njnt)]
        self.joints = [
            (names[i], self._bodies[m.jnt_bodyid[i]], KINDS[m.jnt_type[i]], int(m.jnt_qposadr[i]), int(m.jnt_dofadr[i]))
            for i in range(m.njnt)
        ]
        self.numbers = self._numbers()
        self.actuators = {m.actuator(i).name or f"actuator{i}": self._moved(i) for i in range(m.nu)}
        self.loops = int(sum(m.eq_active0))

    def _numbers(self) -> dict[str, dict[str, Any]]:
        m, told = self._m, dict[str, dict[str, Any]]()
        for i, (name, _, kind, at, dof) in enumerate(self.joints):
            single = kind in ("slide", "hinge")
            bounds = m.jnt_range[i] if m.jnt_limited[i] else (-np.inf, np.inf)
            values = {
                "armature": m.dof_armature[dof], "damping": m.dof_damping[dof], "friction": m.dof_frictionloss[dof],
                "stiffness": m.jnt_stiffness[i], "rest": m.qpos_spring[at] if single and m.jnt_stiffness[i] else 0.0,
                "lower": bounds[0] if single else -np.inf, "upper": bounds[1],
            }  # fmt: skip
            for key, value in values.items():
                told.setdefault(key, {})[name] = [float(value)]
        return told

    def _moved(self, i: int) -> list[str]:
        m, kind, to = self._m, self._m.actuator_trntype[i], int(self._m.actuator_trnid[i, 0])
        if kind == self._lib.mjtTrn.mjTRN_TENDON:
            wrapped = range(m.tendon_adr[to], m.tendon_adr[to] + m.tendon_num[to])
            return [
                self.joints[m.wrap_objid[k]][0] for k in wrapped if m.wrap_type[k] == self._lib.mjtWrap.mjWRAP_JOINT
            ]
        return [self.joints[to][0]] if kind == self._lib.mjtTrn.mjTRN_JOINT else []

    def place(self, q: Any, v: Any) -> None:
        self._d.qpos[:], self._d.qvel[:] = q, v
        self._lib.mj_forward(self._m, self._d)
        self._lib.mj_energyPos(self._m, self._d)
        self._lib.mj_energyVel(self._m, self._d)

    def mass_matrix(self) -> Any:
        full = np.zeros((self.nv, self.nv))
        self._lib.mj_fullM(self._m, self._d, full)
        return full

    def bias(self) -> Any:
        return self._d.qfrc_bias - self._d.qfrc_gravcomp

    def energy(self) -> float:
        springs = self._m.jnt_stiffness.copy()  # the other readers tell of springs by their numbers alone
        off = self._m.opt.disableflags
        self._m.opt.disableflags |= int(self._lib.mjtDisableBit.mjDSBL_SPRING)
        self._lib.mj_energyPos(self._m, self._d)
        self._m.opt.disableflags = off
        self._m.jnt_stiffness[:] = springs
        return float(self._d.energy.sum())

    def frames(self) -> Any:
        d = self._d
        return {name: (np.array(d.xpos[i]), d.xmat[i].reshape(3, 3)) for i, name in enumerate(self._bodies) if i}

    def inertias(self) -> Any:
        m, d, told = self._m, self._d, []
        for i in range(1, m.nbody):
            moved = m.body_weldid[i]
            if m.body_jntnum[moved]:
                R = d.ximat[i].reshape(3, 3)
                joint = self.joints[m.body_jntadr[moved] + m.body_jntnum[moved] - 1][0]
                told.append((joint, float(m.body_mass[i]), np.array(d.xipos[i]), R @ np.diag(m.body_inertia[i]) @ R.T))
        return told


def open_robot(path: str, urdf: bool) -> _Robot:
    """Return what MuJoCo makes of a file; its compiler reads both formats."""
    return _Robot(path)
