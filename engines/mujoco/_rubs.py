"""Contacts with friction as MuJoCo has them, in the frames of a scene's tangential rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.scene_contacts import WAYS, Contact
from crossbody.engines.nearest import across

ELLIPTIC = int(mujoco.mjtCone.mjCONE_ELLIPTIC)
EDGES = 4  # of the pyramid of friction of a contact with two tangents
AT_BOUND = 1e-6
"""Part of its bound, mu times the normal force, that sliding friction may be off: what solvers leave."""


@dataclass(frozen=True, slots=True)
class Rub:
    """One contact with friction at a state.

    Attributes:
        row: its normal row.
        normal: force, N.
        across (2,): force on the second shape along its tangential rows, N.
        slides: whether friction is at the bound that the model has: of the pyramid along its own
            axes, or of the cone.
    """

    row: int
    normal: float
    across: Floats
    slides: bool


@dataclass(slots=True)
class Rubs:
    """The contacts with friction of a model.

    Attributes:
        model, data: MuJoCo's.
        geoms: number of every shape.
        tangents: first of the two tangential rows of every normal row that has friction.
    """

    model: Any
    data: Any
    geoms: Mapping[str, int]
    tangents: Mapping[int, int]
    _known: tuple[tuple[float, bytes], Sequence[Rub]] = field(default=((-1.0, b""), ()))

    def at(self, rows: Callable[[], Mapping[int, tuple[Contact, int]]]) -> Sequence[Rub]:
        """Return those that MuJoCo has now; of one state it is asked for forces and for modes.

        Args:
            rows: gives, of contacts in MuJoCo's list, which of the scene's each is, and its row.
        """
        now = self.data.time, self.data.efc_force.tobytes()
        if self._known[0] != now:
            self._known = now, list(self._found(rows()))
        return self._known[1]

    def _found(self, rows: Mapping[int, tuple[Contact, int]]) -> Iterator[Rub]:
        met = self.data.contact
        firsts, seconds, mus = met.efc_address.tolist(), met.geom[:, 1].tolist(), met.friction[:, :2].tolist()
        for i, (contact, row) in rows.items():
            normal, force, slides = self._force(firsts[i], mus[i])
            frame: Floats = met.frame[i].reshape(3, 3)
            if seconds[i] != self.geoms[contact.second.name]:
                frame = -frame
            one, two = (
                self.data.geom_xmat[self.geoms[shape.name]].reshape(3, 3) for shape in (contact.first, contact.second)
            )
            ways = across(contact.first.type, one, two, frame[0])
            yield Rub(row, normal, ways @ (frame[1:].T @ force), slides)

    def _force(self, first: int, mu: Sequence[float]) -> tuple[float, Floats, bool]:
        """Return normal and tangential force along the contact's own axes, by its rows from `first` on."""
        if self.model.opt.cone == ELLIPTIC:
            normal, *force = self.data.efc_force[first : first + 1 + len(WAYS)].tolist()
            used = np.hypot(force[0] / mu[0], force[1] / mu[1])
        else:
            a, b, c, d = self.data.efc_force[first : first + EDGES].tolist()
            normal, force, used = a + b + c + d, [mu[0] * (a - b), mu[1] * (c - d)], abs(a - b) + abs(c - d)
        return normal, np.array(force), bool(used >= (1.0 - AT_BOUND) * normal)
