"""Contacts with two sets of constants in MuJoCo: they collide with the fast ones and are handed over to the slow ones.

The rows follow the level machine (spec 1.2), and not MuJoCo's own rule, which drops a contact at h = 0: a closed row
exists until its multiplier vanishes. What solref says of a pair is changed where its row hands over, at the end of
the step in which the elastic part of lam is spent: later than the located instant by less than a step, when h and h'
are within 1 % of lam of zero.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Law, Mode
from crossbody.cases.arrays import Floats
from crossbody.engines._level_machine import EPS
from crossbody.engines._log import Modes
from crossbody.engines._machines import elastic_part
from crossbody.engines._real_time import one_set
from crossbody.engines.mujoco._direct import MAX_IMPEDANCE
from crossbody.engines.mujoco._globals import Hook
from crossbody.engines.mujoco._observe import mass_matrix
from crossbody.engines.mujoco._pairs import FAR, FREE, Pairs

CONTACT, COLLISION = int(Mode.CONTACT), int(Mode.COLLISION)
BALLISTIC, SEPARATED = int(Mode.BALLISTIC), int(Mode.COLLISION_SEPARATION)
CLOSED = -1.0
"""Gap that is told of a closed row, m: it is let go by its multiplier alone."""


class TwoSets(Pairs):
    """Pairs that know in which of their two sets of constants they are.

    Args:
        model: MjModel with one pair a row, in order, as of `add_pairs`.
        data: MjData.
        geoms: of every row, two names.
        law: constants of every row, linear.
        small: gap, m, and multiplier, N, that count as zero.
        gaps: -> gap of every row (nc,), m, at the present state.
        drift: -> H' v of every row (nc,), m/s^2; None where it is 0.
        jacobian: -> H (nc, nv).
        weights: diagonal of the mass matrix (nv,).
    """

    def __init__(
        self, model: Any, data: Any, geoms: Sequence[tuple[str, str]], law: Law, small: tuple[float, float],
        gaps: Callable[[], Floats], drift: Callable[[], Floats] | None, jacobian: Callable[[], Floats],
        weights: Floats,
    ) -> None:  # fmt: skip
        super().__init__(model, data, geoms, one_set(law), small, gaps, drift)
        self.jacobian, self.weights = jacobian, weights
        self.quick = law.b0 > 0.0
        entered = one_set(law)
        self.fast, self.slow = (np.column_stack((x.a0, x.a1)) for x in (entered, law))
        self.colliding = self.quick.copy()
        self.closed = np.zeros(self.nc, dtype=bool)

    def reset(self) -> None:
        """Every row open, and fast where it has two sets."""
        self.closed[:] = False
        self.colliding[:] = self.quick
        self._set()

    def after(self, restart: Callable[[], None]) -> Callable[[], None]:
        """The start of a scene, and then `reset`."""

        def start() -> None:
            restart()
            self.reset()

        return start

    def beside(self, forces: Hook) -> Hook:
        """Forces of every stage, and then the rows' own `hook`."""

        def hook(model: Any, data: Any) -> None:
            forces(model, data)
            self.hook(model, data)

        return hook

    def _set(self) -> None:
        """Put the constants of every row in force."""
        constants = np.where(self.colliding[:, None], self.fast, self.slow)
        self.a0 = constants[:, 0]
        self.model.pair_solref[self.order] = -MAX_IMPEDANCE * constants

    def constants(self) -> dict[str, Floats]:
        """Those in force, read back from the model."""
        a0, a1 = (-self.model.pair_solref[self.order] / MAX_IMPEDANCE).T
        return {"a0": a0, "a1": a1, "a2": np.zeros(self.nc)}

    def entries(self) -> tuple[Floats, Floats]:
        """H (nc, nv) of all rows as MuJoCo has them now, and the multipliers (nc,), N, without the bound lam >= 0."""
        d, nv = self.data, self.model.nv
        rows, at = self._there()
        where = np.array(at)[np.argsort(rows)]
        H, M = np.array(d.efc_J).reshape(-1, nv)[where], mass_matrix(self.model, d)
        lam: Floats = np.linalg.solve(H @ np.linalg.solve(M, H.T), d.efc_aref[where] - H @ d.qacc_smooth)
        return H, lam

    def modes(self) -> Modes:
        """By the multiplier of a row that is closed, by the gap of every other."""
        lam, h = self.lam(), self.gaps()
        pushing = lam > self.small[1]
        spent = self._spent(lam, pushing)
        return tuple(self._mode(i, float(h[i]), bool(pushing[i]), bool(spent[i])) for i in range(self.nc))

    def _mode(self, i: int, h: float, pushes: bool, spent: bool) -> int:
        if self.closed[i] and pushes:
            return COLLISION if self.colliding[i] and not spent else CONTACT
        if h > self.small[0]:
            return FREE
        return SEPARATED if self.colliding[i] else BALLISTIC

    def _spent(self, lam: Floats, pushing: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Rows whose elastic part max(b1, sqrt(b0)) |h'| + b0 |h| is below 1 % of lam_i/(G_A^-1)_ii (nc,)."""
        spent = np.zeros(self.nc, dtype=bool)
        if not (self.colliding & self.closed & pushing).any():
            return spent
        H, on = self.jacobian(), np.flatnonzero(self.closed & pushing)
        inverse = np.linalg.inv((H[on] / self.weights) @ H[on].T)
        h, hd = self.gaps(), H @ self.data.qvel
        elastic = elastic_part(self.fast.T, h, hd)
        spent[on] = elastic[on] <= EPS * lam[on] / np.diag(inverse)
        return spent

    def arm(self, reach: float) -> Callable[[Modes], None]:
        """See `Pairs`; a closed row whose elastic part is spent is handed over here."""

        def arm(modes: Modes) -> None:
            lam = self.lam()
            spent = self._spent(lam, lam > self.small[1])
            closed = np.array([mode != FREE for mode in modes])
            pushing = np.array([mode in (CONTACT, COLLISION) for mode in modes])
            # A row that was let go, open or below the surface, collides anew.
            self.colliding = self.quick & ~(pushing & (spent | ~self.colliding))
            self.closed = closed
            self._set()
            self.margin[self.order] = np.where(closed, reach, -FAR)

        return arm

    def margins(self) -> list[tuple[float, float]]:
        """See `Pairs`; a row that pushes is closed whatever its gap."""
        lam = self.lam()
        return [
            (CLOSED if self.closed[i] and lam[i] > 0.0 else h, push) for i, (h, push) in enumerate(super().margins())
        ]
