"""H' v of contacts and strings: MuJoCo has J v' = -a1 h' - a0 h there, where the law has h'' = H v' + H' v.

By a difference of H along the motion, in a second set of data; MuJoCo has the term of `connect` and `weld`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from crossbody.cases._arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.engines._contacts import Contacts, drift
from crossbody.engines.mujoco._observe import numbers, pose_of


class Drift:
    """H' v of the contacts of a scene, and of the distances of its tendons between points.

    Args:
        scene: whose.
        model: built from it.
        contacts: of the scene.
    """

    def __init__(self, scene: Scene, model: Any, contacts: Contacts) -> None:
        self.model, self.data, self.contacts = model, mujoco.MjData(model), contacts
        self.numbers = numbers(scene)
        self.pose = pose_of(self.data, self.numbers)
        self.tendons = scene.tendons

    def __call__(self, q: Floats, v: Floats, tendons: Sequence[int], rows: Sequence[int]) -> tuple[Floats, Floats]:
        """Return that of the lengths of some tendons, 0 for sums of joints, and of some rows of the contacts, m/s^2."""
        self.data.qvel[:] = v

        def rates(t: float) -> Floats:
            self.data.qpos[:] = q
            mujoco.mj_integratePos(self.model, self.data.qpos, v, t)
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            mujoco.mj_comVel(self.model, self.data)
            touches = self.contacts.touches(self.pose, rows)
            closing = [t.normal @ (self._carried(t.second, t.point) - self._carried(t.first, t.point)) for t in touches]
            return np.array([*map(self._length_rate, tendons), *closing])

        lengths, touches = np.split(drift(rates, v), [len(tendons)])
        return lengths, touches

    def _length_rate(self, i: int) -> float:
        tendon = self.tendons[i]
        if not tendon.bodies:
            return 0.0
        at = []
        for body, position in zip(tendon.bodies, tendon.positions, strict=True):
            R, p = self.pose(body)
            at.append(p + R @ np.array(position))
        one, two = (self._carried(body, point) for body, point in zip(tendon.bodies, at, strict=True))
        apart = at[1] - at[0]
        return float(apart @ (two - one) / np.linalg.norm(apart))

    def _carried(self, body: str, point: Floats) -> Floats:
        """Return the velocity of a point of a body; MuJoCo's twists are about a tree's centre of mass."""
        k = self.numbers[body]
        (a, b, c), linear = self.data.cvel[k, :3], self.data.cvel[k, 3:]
        x, y, z = point - self.data.subtree_com[self.model.body_rootid[k]]
        velocity: Floats = linear + np.array([b * z - c * y, c * x - a * z, a * y - b * x])
        return velocity
