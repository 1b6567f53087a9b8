"""PyBullet's reader of URDF files: `pybullet.loadURDF` with the inertias of the file and a fixed base."""

from __future__ import annotations

from typing import Any

import numpy as np

FORMATS, PACKAGE, MODULE = ("urdf",), "pybullet", "pybullet"
TRIED = ("3.2", "3.2")
KINDS = {0: "hinge", 1: "slide", 2: "ball"}
FIXED = 4
SHAPES = {2: "sphere", 3: "box", 4: "cylinder", 5: "mesh", 6: "plane", 7: "capsule"}


class _Robot:
    free, ball = "p, xyzw; world, world", "xyzw; body"
    hidden = {  # noqa: RUF012
        "armature": "PyBullet's joints have no armature.", "stiffness": "PyBullet's joints have no springs.",
        "rest": "PyBullet's joints have no springs.", "actuators": "PyBullet drives joints, not actuators of a file.",
        "damping v|v|": "PyBullet's dampers are linear.", "damping v^3": "PyBullet's dampers are linear.",
        "stiffness x^2": "PyBullet's joints have no springs.", "stiffness x^3": "PyBullet's joints have no springs.",
        "tendons": "PyBullet has no tendons.", "softness": "PyBullet's rows have no solref.",
    }  # fmt: skip
    unseen = {  # noqa: RUF012
        "energy": "PyBullet does not report energy.",
        "contacts": "PyBullet does not report which of its shapes may touch.",
        "surfaces": "PyBullet does not report which of its shapes may touch.",
    }  # fmt: skip
    precision = 1e-5

    def __init__(self, path: str) -> None:
        from importlib.metadata import version

        import pybullet

        self._lib, self.version = pybullet, version("pybullet")
        if pybullet.isConnected():
            pybullet.disconnect()
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
        self.numbers = self._numbers()
        if any(SHAPES.get(one[2], "") in ("", "mesh") for i in range(-1, len(infos)) for one in self._solids(i)):
            self.unseen = self.unseen | {"shapes": "PyBullet does not show the corners of meshes."}

    def _numbers(self) -> dict[str, dict[str, Any]]:
        told: dict[str, dict[str, Any]] = {}
        for info in (self._infos[i] for i in self._moving):
            bounded = info[8] <= info[9]
            values = {
                "damping": info[6], "friction": info[7],
                "lower": info[8] if bounded else -np.inf, "upper": info[9] if bounded else np.inf,
                "least force": -info[10], "most force": info[10],
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

    def frames(self) -> Any:
        told = {self._lib.getBodyInfo(self._id)[0].decode(): (np.zeros(3), np.eye(3))}  # it is fixed where it is loaded
        for i, name in enumerate(self._links):
            state = self._lib.getLinkState(self._id, i, computeForwardKinematics=True)
            told[name] = (np.array(state[4]), np.array(self._lib.getMatrixFromQuaternion(state[5])).reshape(3, 3))
        return told

    def _solids(self, link: int) -> Any:
        return self._lib.getCollisionShapeData(self._id, link)

    def _centre(self, link: int) -> Any:
        """Return where the centre of mass of a link stands: its shapes are placed there."""
        if link < 0:
            return self._lib.getBasePositionAndOrientation(self._id)
        return self._lib.getLinkState(self._id, link, computeForwardKinematics=True)[:2]

    def shapes(self) -> Any:
        told = []
        for link in range(-1, len(self._infos)):
            for k, one in enumerate(self._solids(link)):
                kind, (a, b, c) = SHAPES[one[2]], one[3]
                size = {"box": (a / 2, b / 2, c / 2), "sphere": (a,)}.get(kind, (b, a / 2))
                p, turn = self._lib.multiplyTransforms(*self._centre(link), one[5], one[6])
                R = np.array(self._lib.getMatrixFromQuaternion(turn)).reshape(3, 3)
                name = f"{self._links[link] if link >= 0 else 'base'} {k}"
                told.append((name, kind, self._mover(link), size, (), np.array(p), R))
        return told

    def _mover(self, link: int) -> str:
        """Return the joint that moves a link; none of what stands on the world."""
        while link >= 0 and self._infos[link][2] == FIXED:
            link = self._infos[link][16]
        return str(self._infos[link][1].decode()) if link >= 0 else ""

    def inertias(self) -> Any:
        told = []
        for i in range(len(self._infos)):
            if joint := self._mover(i):
                state = self._lib.getLinkState(self._id, i, computeForwardKinematics=True)
                mass, _, J, *_ = self._lib.getDynamicsInfo(self._id, i)
                R = np.array(self._lib.getMatrixFromQuaternion(state[1])).reshape(3, 3)
                told.append((joint, float(mass), np.array(state[0]), R @ np.diag(J) @ R.T))
        return told


def open_robot(path: str, urdf: bool) -> _Robot:
    """Return what PyBullet makes of a file."""
    return _Robot(path)
