"""PyBullet's reader of URDF files: `pybullet.loadURDF` with the inertias of the file and a fixed base."""

from __future__ import annotations

from typing import Any

import numpy as np

FORMATS, PACKAGE, MODULE = ("urdf",), "pybullet", "pybullet"
KINDS = {0: "hinge", 1: "slide", 2: "ball"}
FIXED = 4


class _Robot:
    free, ball = "p, xyzw; world, world", "xyzw; body"
    hidden = {  # noqa: RUF012
        "armature": "PyBullet's joints have no armature.", "stiffness": "PyBullet's joints have no springs.",
        "rest": "PyBullet's joints have no springs.", "actuators": "PyBullet drives joints, not actuators of a file.",
        "energy": "PyBullet tells no energy.",
    }  # fmt: skip
    precision = 1e-5
    loops = 0

    def __init__(self, path: str) -> None:
        from importlib.metadata import version

        import pybullet

        self._lib, self.version = pybullet, version("pybullet")
        pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(0.0, 0.0, -9.81)
        self._id = pybullet.loadURDF(
            path, useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_MAINTAIN_LINK_ORDER
        )
        infos = [pybullet.getJointInfo(self._id, i) for i in range(pybullet.getNumJoints(self._id))]
        self._links = [info[12].decode() for info in infos]
        self._infos = infos
        self.joints = [
            (info[1].decode(), info[12].decode(), KINDS.get(info[2], f"of type {info[2]}"), info[3] - 7, info[4] - 6)
            for info in infos if info[2] != FIXED
        ]  # fmt: skip
        self._moving = [info[0] for info in infos if info[2] != FIXED]
        self.nq = self.nv = len(self.joints)
        self.actuators: dict[str, list[str]] = {}
        self.numbers = self._numbers()

    def _numbers(self) -> dict[str, dict[str, Any]]:
        told: dict[str, dict[str, Any]] = {}
        for info in (self._infos[i] for i in self._moving):
            bounded = info[8] <= info[9]
            values = {
                "damping": info[6], "friction": info[7],
                "lower": info[8] if bounded else -np.inf, "upper": info[9] if bounded else np.inf,
            }  # fmt: skip
            for key, value in values.items():
                told.setdefault(key, {})[info[1].decode()] = [float(value)]
        return told

    def place(self, q: Any, v: Any) -> None:
        self._q, self._v = q.tolist(), v.tolist()
        for i, q_i, v_i in zip(self._moving, self._q, self._v, strict=True):
            self._lib.resetJointState(self._id, i, q_i, v_i)

    def mass_matrix(self) -> Any:
        return np.array(self._lib.calculateMassMatrix(self._id, self._q))

    def bias(self) -> Any:
        return np.array(self._lib.calculateInverseDynamics(self._id, self._q, self._v, [0.0] * self.nv))

    def energy(self) -> float:
        return float("nan")

    def frames(self) -> Any:
        told = {}
        for i, name in enumerate(self._links):
            state = self._lib.getLinkState(self._id, i, computeForwardKinematics=True)
            told[name] = (np.array(state[4]), np.array(self._lib.getMatrixFromQuaternion(state[5])).reshape(3, 3))
        return told

    def inertias(self) -> Any:
        told = []
        for i in range(len(self._infos)):
            up = i
            while up >= 0 and self._infos[up][2] == FIXED:
                up = self._infos[up][16]
            if up >= 0:
                state = self._lib.getLinkState(self._id, i, computeForwardKinematics=True)
                mass, _, J, *_ = self._lib.getDynamicsInfo(self._id, i)
                R = np.array(self._lib.getMatrixFromQuaternion(state[1])).reshape(3, 3)
                told.append((self._infos[up][1].decode(), float(mass), np.array(state[0]), R @ np.diag(J) @ R.T))
        return told


def open_robot(path: str, urdf: bool) -> _Robot:
    """Return what PyBullet makes of a file."""
    return _Robot(path)
