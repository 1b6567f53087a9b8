"""H' v of contacts, strings and bounds of ball joints, which MuJoCo leaves out.

It has J v' = -a1 h' - a0 h there, where the law has h'' = H v' + H' v.

By a difference of H along the motion, in a second set of data; MuJoCo has the term of `connect` and `weld`.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from crossbody.cases._arrays import Floats
from crossbody.cases.scene import Joint, Scene, Tendon
from crossbody.engines._contacts import Contacts, drift, gradient
from crossbody.engines._scene import angle_of, places
from crossbody.engines.mujoco._observe import numbers, pose_of


class Drift:
    """H' v of the contacts of a scene, of the distances of its tendons between points, and of angles of ball joints.

    Args:
        scene: whose.
        model: built from it.
        contacts: of the scene.
    """

    def __init__(self, scene: Scene, model: Any, contacts: Contacts) -> None:
        self.model, self.data, self.contacts = model, mujoco.MjData(model), contacts
        self.numbers = numbers(scene)
        self.pose = pose_of(self.data, self.numbers)
        self.bounded, self.at, self.place = scene.bounded, *places(scene)

    def __call__(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Return that of all that may have bounds, 0 of what is a sum of joints, and of every row of the contacts."""

        def rates(t: float) -> Floats:
            self.data.qpos[:] = q
            mujoco.mj_integratePos(self.model, self.data.qpos, v, t)
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            touching = [gradient(touch, self._carried) @ v for touch in self.contacts.touches(self.pose)]
            return np.array([*(self._rate(part, v) for part in self.bounded), *touching])

        lengths, touches = np.split(drift(rates, v), [len(self.bounded)])
        return lengths, touches

    def _rate(self, part: Joint | Tendon, v: Floats) -> float:
        """Return how fast an angle of a ball joint or a distance of points changes, 0 of anything else."""
        if isinstance(part, Joint):
            return self._angle_rate(part, v) if part.type == "ball" and part.limited else 0.0
        return self._length_rate(part, v) if part.bodies else 0.0

    def _angle_rate(self, joint: Joint, v: Floats) -> float:
        first, turn = self.place[joint.name], angle_of(self.data.qpos[self.at[joint.name] :][:4])
        return float(turn @ v[first : first + 3] / np.linalg.norm(turn))

    def _length_rate(self, tendon: Tendon, v: Floats) -> float:
        at = []
        for body, position in zip(tendon.bodies, tendon.positions, strict=True):
            R, p = self.pose(body)
            at.append(p + R @ np.array(position))
        one, two = (self._carried(body, point) @ v for body, point in zip(tendon.bodies, at, strict=True))
        apart = at[1] - at[0]
        return float(apart @ (two - one) / np.linalg.norm(apart))

    def _carried(self, body: str, point: Floats) -> Floats:
        J = np.zeros((3, self.model.nv))
        mujoco.mj_jac(self.model, self.data, J, None, point, self.numbers[body])
        return J
