"""Contacts of a scene's shapes by Pinocchio's kinematics: gaps, gradients and, by differences, H' v."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases._arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.engines._contacts import Contacts, Pose, Touch, drift, gradient
from crossbody.engines.pinocchio._rows import point_jacobian


class ContactRows:
    """Rows of the contacts; no second derivative of a gap is written anywhere here.

    Attributes:
        count: number of rows.
    """

    def __init__(self, scene: Scene, model: Any, placed: Mapping[str, tuple[int, Any]]) -> None:
        self.contacts = Contacts(scene)
        self.count = self.contacts.count
        self.model, self.data, self.placed = model, model.createData(), placed
        self._at: Floats = np.full(model.nq, np.nan)
        self._found: list[Touch] = []
        self._H: Floats | None = None

    def heights(self, q: Floats) -> Floats:
        """Return h (n,)."""
        return np.array([touch.gap for touch in self._touches(q)])

    def jacobian(self, q: Floats) -> Floats:
        """Return H (n, nv)."""
        if not self.count:
            return np.zeros((0, self.model.nv))
        touches = self._touches(q)
        if self._H is None:
            pin.computeJointJacobians(self.model, self.data, q)
            self._H = np.array([gradient(touch, self._velocity) for touch in touches])
        return self._H

    def drift(self, q: Floats, v: Floats) -> Floats:
        """Return H' v (n,)."""
        if not self.count:
            return np.zeros(0)
        return drift(lambda t: self.jacobian(pin.integrate(self.model, q, t * v)) @ v, v)

    def _touches(self, q: Floats) -> list[Touch]:
        """Return the contacts at q; those of the last one are kept, for a step asks several times."""
        if not np.array_equal(q, self._at):
            pin.forwardKinematics(self.model, self.data, q)
            self._at, self._H, self._found = q.copy(), None, self.contacts.touches(self._pose)
        return self._found

    def _pose(self, body: str) -> Pose:
        carrier, pose = self.placed[body]
        world = self.data.oMi[carrier] * pose
        return world.rotation, world.translation

    def _velocity(self, body: str, point: Floats) -> Floats:
        return point_jacobian(self.model, self.data, self.placed[body][0], point)
