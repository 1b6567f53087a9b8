"""Forces of MuJoCo's own contacts between ball and walls, as multipliers of the case's rows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.engines._maze.edges import SOLID, wrapped
from crossbody.engines._maze.memory import angle
from crossbody.engines._maze.rows import ABOVE, BELOW, SLIP_OF, Place
from crossbody.engines._maze.scene import BallMaze

State = tuple[float, ...]


class ContactForces:
    """Reads the contacts of a model of segments.

    Args:
        maze: geometry.
        model, data: MuJoCo's, evaluated.
        rings: index of the ring that each geom belongs to, -1 for the ball.
    """

    def __init__(self, maze: BallMaze, model: Any, data: Any, rings: Sequence[int]) -> None:
        self.maze, self.model, self.data, self.rings = maze, model, data, rings
        self.wrench = np.zeros(6)

    def multipliers(self, q: State, place: Place) -> Floats:
        """Lam (nc,), N: what a ring does goes to its face where it is solid, to the nearer tip in a gap.

        A ring that the ball has no business with (it went through a wall) goes into no row.
        """
        lam, rho = np.zeros(self.maze.nc), math.hypot(q[1], q[2])
        for i in range(self.data.ncon):
            contact = self.data.contact[i]
            first, second = self.rings[contact.geom1], self.rings[contact.geom2]
            slot = self._slot(max(first, second), place, q)
            if slot is None:
                continue
            mujoco.mj_contactForce(self.model, self.data, i, self.wrench)
            on_second = np.reshape(contact.frame, (3, 3)).T @ self.wrench[:3]
            force = on_second if second < 0 else -on_second
            lam[slot] += self.wrench[0]
            if slot in SLIP_OF and self.maze.rows.rolling:
                lam[SLIP_OF[slot]] += (force[1] * q[1] - force[0] * q[2]) / rho
        return lam

    def _slot(self, ring: int, place: Place, q: State) -> int | None:
        if ring == place.channel:
            face, gap = ABOVE, place.above
        elif ring == place.channel - 1:
            face, gap = BELOW, place.below
        else:
            return None
        if gap == SOLID:
            return face
        return face + 1 + (wrapped(angle(q) - self.maze.rings[ring].centre(gap)) > 0.0)
