"""H' v of contacts and strings: MuJoCo has J v' = -a1 h' - a0 h there, where the law has h'' = H v' + H' v.

By a central difference of H along the motion, in a second set of data; MuJoCo has the term of `connect` and `weld`.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from crossbody.cases._arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.engines._contacts import Contacts, Pose, gradient

TURN = 1e-3
"""Angle or length over which H is differenced: the fourth power and rounding leave 1e-12 of it."""


class Drift:
    """H' v of the contacts of a scene, or of the distances of its tendons between points.

    Args:
        scene: whose.
        model: built from it.
    """

    def __init__(self, scene: Scene, model: Any) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self.contacts = Contacts(scene)
        self.numbers = {"": 0, **{body.name: i for i, body in enumerate(scene.bodies, start=1)}}
        self.strings = {i: tendon for i, tendon in enumerate(scene.tendons) if tendon.bodies}

    def touches(self, q: Floats, v: Floats) -> Floats:
        """Return that of every row of the contacts, m/s^2."""
        return self._difference(q, v, self._normal_rates)

    def lengths(self, q: Floats, v: Floats) -> Floats:
        """Return that of the length of every tendon, 0 for sums of joints, m/s^2."""
        return self._difference(q, v, self._length_rates)

    def _difference(self, q: Floats, v: Floats, rates: Any) -> Floats:
        step = TURN / max(float(np.abs(v).max()), 1e-12)
        found = []
        for k in (-2, -1, 1, 2):
            self.data.qpos[:] = q
            mujoco.mj_integratePos(self.model, self.data.qpos, v, k * step)
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            found.append(rates(v))
        total: Floats = (found[0] - 8.0 * found[1] + 8.0 * found[2] - found[3]) / (12.0 * step)
        return total

    def _normal_rates(self, v: Floats) -> Floats:
        return np.array([gradient(touch, self._carried) @ v for touch in self.contacts.touches(self._pose)])

    def _length_rates(self, v: Floats) -> Floats:
        rates = np.zeros(self.model.ntendon)
        for i, tendon in self.strings.items():
            ends = []
            for body, position in zip(tendon.bodies, tendon.positions, strict=True):
                R, p = self._pose(body)
                at = p + R @ np.array(position)
                ends.append((at, self._carried(body, at) @ v))
            apart = ends[1][0] - ends[0][0]
            rates[i] = apart @ (ends[1][1] - ends[0][1]) / np.linalg.norm(apart)
        return rates

    def _pose(self, body: str) -> Pose:
        i = self.numbers[body]
        return self.data.xmat[i].reshape(3, 3), self.data.xpos[i]

    def _carried(self, body: str, point: Floats) -> Floats:
        J = np.zeros((3, self.model.nv))
        mujoco.mj_jac(self.model, self.data, J, None, point, self.numbers[body])
        return J
