"""Many contacts in MuJoCo, each a pair of geoms: one row a pair, without friction the case's law exactly.

MuJoCo's row is J v' = -a1 h' - a0 (h - margin): the margin is taken out again, in `hook`; H' v is 0. A row must outlive
its gap by a step, or the stages of the step that leaves it see different equations: `reach` is how far above its gap it
still exists.

A gap and a multiplier count as zero below `small`: what rounding makes of balls that touch at rest is no event.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from crossbody.cases import Law, Mode
from crossbody.cases.arrays import Floats
from crossbody.engines._log import Modes
from crossbody.engines.mujoco._direct import IMPEDANCE, MAX_IMPEDANCE, direct_solref
from crossbody.engines.mujoco._globals import Hook
from crossbody.engines.mujoco._observe import mass_matrix

FREE, CONTACT, BALLISTIC = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BALLISTIC)
CLOSED = -1.0
"""Gap that is told of a closed row, m: it is let go by its multiplier alone."""
FAR = 1e10
"""Margin that no gap falls below: the pair is never a contact, m."""


class Pairs:
    """The rows of a compiled model whose contacts are its pairs, in order; the functions are those of a `Scene`.

    Args:
        model: MjModel; where it follows the case's law, with one pair a row, in order, as of `add_pairs`.
        data: MjData.
        geoms: of every row, two names.
        law: constants of every row, linear.
        small: gap, m, and multiplier, N, that count as zero.
        gaps: -> gap of every row (nc,), m, at the present state.
    """

    def __init__(
        self,
        model: Any,
        data: Any,
        geoms: Sequence[tuple[str, str]],
        law: Law,
        small: tuple[float, float],
        gaps: Callable[[], Floats],
    ) -> None:
        self.model, self.data, self.small, self.gaps = model, data, small, gaps
        self.nc, self.a0 = len(geoms), np.array(law.a0)
        self.margin: Floats = model.pair_margin
        # The compiler sorts pairs by the bodies that they join.
        self.order = np.array([model.pair(f"pair {i}").id for i in range(model.npair)])
        ids = [[model.geom(name).id for name in pair] for pair in geoms]
        self._row = {(a, b): i for i, pair in enumerate(ids) for a, b in (pair, pair[::-1])}

    def _there(self) -> tuple[list[int], list[int]]:
        """Rows that have a contact now, and where they stand among the constraints."""
        contacts, rows, at = self.data.contact, [], []
        for geoms, address in zip(contacts.geom.tolist(), contacts.efc_address.tolist(), strict=True):
            row = self._row.get((geoms[0], geoms[1]))
            if row is not None and address >= 0:
                rows.append(row)
                at.append(address)
        return rows, at

    def lam(self) -> Floats:
        """Multiplier of every row (nc,), N."""
        lam = np.zeros(self.nc)
        if self.data.nefc:
            rows, at = self._there()
            lam[rows] = self.data.efc_force[at]
        return lam

    def modes(self) -> Modes:
        """Free while the gap is open; closed, in contact while it pushes (MuJoCo keeps no memory)."""
        lam = self.lam()
        return tuple(
            FREE if h > self.small[0] else CONTACT if push > self.small[1] else BALLISTIC
            for h, push in zip(self.gaps().tolist(), lam.tolist(), strict=True)
        )

    def arm(self, reach: float) -> Callable[[Modes], None]:
        """What opens and closes rows to suit their modes; a closed one exists up to a gap of `reach`, m."""

        def arm(modes: Modes) -> None:
            self.margin[self.order] = [-FAR if mode == FREE else reach for mode in modes]

        return arm

    def margins(self) -> list[tuple[float, float]]:
        """Gap, m, and multiplier of every row, both less `small`; where it does not push, minus what is in excess."""
        d = self.data
        push = np.zeros(self.nc)
        if d.nefc:
            rows, at = self._there()
            lam = d.efc_force[at]
            excess = d.efc_aref[at] - d.efc_J.reshape(-1, self.model.nv)[at] @ d.qacc
            push[rows] = np.where(lam > 0.0, lam, np.minimum(excess, 0.0))
        h, push = self.gaps() - self.small[0], push - self.small[1]
        return list(zip(h.tolist(), push.tolist(), strict=True))

    def hook(self, _model: Any, d: Any) -> None:
        """Correct the reference accelerations: positions are counted from the margin."""
        if d.nefc:
            rows, at = self._there()
            d.efc_aref[at] -= self.a0[rows] * self.margin[self.order[rows]]


class LastingPairs(Pairs):
    """Pairs that follow the level machine: a closed row exists until its multiplier vanishes, also above its surface.

    MuJoCo's own rule drops a contact at h = 0.
    """

    def __init__(
        self, model: Any, data: Any, geoms: Sequence[tuple[str, str]], law: Law, small: tuple[float, float],
        gaps: Callable[[], Floats],
    ) -> None:  # fmt: skip
        super().__init__(model, data, geoms, law, small, gaps)
        self.closed = np.zeros(self.nc, dtype=bool)

    def after(self, restart: Callable[[], None]) -> Callable[[], None]:
        """Return the start of a scene with every row open."""

        def start() -> None:
            restart()
            self.closed[:] = False

        return start

    def beside(self, forces: Hook) -> Hook:
        """Return forces of every stage, and then the rows' own `hook`."""

        def hook(model: Any, data: Any) -> None:
            forces(model, data)
            self.hook(model, data)

        return hook

    def constants(self) -> dict[str, Floats]:
        """Return those of every row, read back from the model."""
        a0, a1 = (-self.model.pair_solref[self.order] / MAX_IMPEDANCE).T
        return {"a0": a0, "a1": a1, "a2": np.zeros(self.nc)}

    def entries(self) -> tuple[Floats, Floats]:
        """Return H (nc, nv) of all rows as MuJoCo has them, and their multipliers (nc,) without the bound lam >= 0."""
        d, nv = self.data, self.model.nv
        rows, at = self._there()
        where = np.array(at)[np.argsort(rows)]
        H, M = np.array(d.efc_J).reshape(-1, nv)[where], mass_matrix(self.model, d)
        lam: Floats = np.linalg.solve(H @ np.linalg.solve(M, H.T), d.efc_aref[where] - H @ d.qacc_smooth)
        return H, lam

    def modes(self) -> Modes:
        """Return the mode of every row, by the multiplier of one that is closed, by the gap of every other."""
        rows = zip(self.closed.tolist(), self.gaps().tolist(), self.lam().tolist(), strict=True)
        return tuple(
            CONTACT if closed and push > self.small[1] else FREE if h > self.small[0] else BALLISTIC
            for closed, h, push in rows
        )

    def arm(self, reach: float) -> Callable[[Modes], None]:
        """See `Pairs`; what is closed is kept."""
        put = super().arm(reach)

        def arm(modes: Modes) -> None:
            self.closed[:] = [mode != FREE for mode in modes]
            put(modes)

        return arm

    def margins(self) -> list[tuple[float, float]]:
        """See `Pairs`; a row that pushes is closed whatever its gap."""
        rows = zip(self.closed.tolist(), self.lam().tolist(), super().margins(), strict=True)
        return [(CLOSED if closed and lam > 0.0 else h, push) for closed, lam, (h, push) in rows]


def add_pairs(spec: Any, geoms: Sequence[tuple[str, str]], law: Law | None) -> None:
    """One frictionless pair a row, for geoms that collide with nothing else; None leaves MuJoCo's own softness."""
    for i, (left, right) in enumerate(geoms):
        for name in (left, right):
            spec.geom(name).contype = spec.geom(name).conaffinity = 0
        own = {} if law is None else {"solref": direct_solref(law, i), "solimp": IMPEDANCE}
        spec.add_pair(name=f"pair {i}", geomname1=left, geomname2=right, condim=1, **own)
