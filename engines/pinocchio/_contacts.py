"""Contacts of a scene's shapes by Pinocchio's kinematics: gaps, gradients and, by differences, H' v."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases._arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.engines._contacts import Contacts, Pose, Poses, Touch, drift, gradient
from crossbody.engines.pinocchio._rows import point_jacobian

CLEAR = 0.02
"""m: H of shapes that are further apart is left zero while a motion is computed, which does not ask for it."""


class ContactRows:
    """Rows of the contacts; no second derivative of a gap is written anywhere here.

    Attributes:
        count: number of rows.
        clear: of shapes further apart, m, rows of H are left zero.
    """

    def __init__(self, scene: Scene, model: Any, placed: Mapping[str, tuple[int, Any]]) -> None:
        self.contacts = Contacts(scene)
        self.count = self.contacts.count
        self.model, self.data, self.placed = model, model.createData(), placed
        self._moved = model.createData()
        self.clear = CLEAR
        self._at: Floats = np.full(model.nq, np.nan)
        self._found: list[Touch] = []
        self._H: Floats | None = None

    def heights(self, q: Floats) -> Floats:
        """Return h (n,)."""
        return np.array([touch.gap for touch in self._touches(q)])

    def forget(self) -> None:
        """Compute anew at the next call, wherever it is."""
        self._at = np.full(self.model.nq, np.nan)

    def jacobian(self, q: Floats) -> Floats:
        """Return H (n, nv)."""
        if not self.count:
            return np.zeros((0, self.model.nv))
        touches = self._touches(q)
        if self._H is None:
            pin.computeJointJacobians(self.model, self.data, q)
            none = np.zeros(self.model.nv)
            self._H = np.array([gradient(touch, self._velocity) if touch.normal.any() else none for touch in touches])
        return self._H

    def drift(self, q: Floats, v: Floats, rows: Sequence[int]) -> Floats:
        """Return H' v of some rows."""
        if not len(rows):
            return np.zeros(0)
        data = self._moved
        along, turn = self.contacts.lying(self._now(q), rows)

        def rates(t: float) -> Floats:
            pin.forwardKinematics(self.model, data, pin.integrate(self.model, q, t * v), v)
            touches = self.contacts.touches(lambda body: self._pose(body, data), rows, along)
            points, normals = (np.array([getattr(touch, name) for touch in touches]) for name in ("point", "normal"))
            moving, held = (
                self._carried([self.placed[body][0] for body in bodies], points)
                for bodies in ([touch.second for touch in touches], [touch.first for touch in touches])
            )
            total: Floats = np.sum(normals * (moving - held), axis=1)
            return total

        return drift(rates, v, turn)

    def _touches(self, q: Floats) -> list[Touch]:
        """Return the contacts at q; those of the last one are kept, for a step asks several times."""
        if not np.array_equal(q, self._at):
            self._found = self.contacts.touches(self._now(q), clear=self.clear)
            self._at, self._H = q.copy(), None
        return self._found

    def _now(self, q: Floats) -> Poses:
        """Return what gives the poses of bodies at q."""
        pin.forwardKinematics(self.model, self.data, q)
        return lambda body: self._pose(body, self.data)

    def _pose(self, body: str, data: Any) -> Pose:
        carrier, pose = self.placed[body]
        world = data.oMi[carrier] * pose
        return world.rotation, world.translation

    def _velocity(self, body: str, point: Floats) -> Floats:
        return point_jacobian(self.model, self.data, self.placed[body][0], point)

    def _carried(self, joints: list[int], points: Floats) -> Floats:
        """Return the velocities (n, 3) of points that joints carry, where `drift` has moved them."""
        data, frame = self._moved, pin.LOCAL_WORLD_ALIGNED
        twists = np.array([pin.getVelocity(self.model, data, joint, frame).vector for joint in joints])
        (x, y, z), (a, b, c) = (points - [data.oMi[joint].translation for joint in joints]).T, twists[:, 3:].T
        velocities: Floats = twists[:, :3] + np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=1)
        return velocities
