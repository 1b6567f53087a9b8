"""Bodies on a line as engines need them: a ball above a floor, or the sliders of a cradle (spec 2.1, 2.2).

h_0 = q_0 above a floor; h_i = gap + q_(i+1) - q_i between neighbours. Every row alone follows the case's law,

    lam = m (w - a1 h' - a0 h - a2 h^3),    1/m = H M^-1 H^T,    w = -H M^-1 f: what presses without the row, m/s^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Mode
from crossbody.cases.arrays import Bytes, Floats
from crossbody.engines import _ball_scale
from crossbody.engines._cradle import in_real_time, one_set, sliders
from crossbody.engines._log import Observe

MECHANISMS = ("ball", "sliders")
FREE, CONTACT, BALLISTIC = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BALLISTIC)


@dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """A scene on a line.

    Attributes:
        masses (n,): kg.
        gravity: towards smaller q, m/s^2.
        floor: whether there is one below body 0; else neighbours collide with each other.
        radius, gap: of every body, and between neighbours at q = 0, m.
        q0, v0 (n,): start.
        a0, a1, a2 (nc,): constants of each row: the fast ones where it has two sets.
        unilateral (nc,): rows that can open.
        sizes: how far things move and how fast, m and m/s.
        observe: gaps and energies of many states.
    """

    masses: Floats
    gravity: float
    floor: bool
    radius: float
    gap: float
    q0: Floats
    v0: Floats
    a0: Floats
    a1: Floats
    a2: Floats
    unilateral: NDArray[np.bool_]
    sizes: tuple[float, float]
    observe: Observe

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """(left, right) of every row; the floor is -1."""
        return ((-1, 0),) if self.floor else tuple((i, i + 1) for i in range(len(self.masses) - 1))

    @property
    def reduced(self) -> Floats:
        """M of every row (nc,), kg."""
        inverse = 1.0 / self.masses
        found: Floats = inverse if self.floor else inverse[:-1] + inverse[1:]
        return 1.0 / found

    @property
    def presses(self) -> float:
        """W of every row, m/s^2."""
        return self.gravity if self.floor else 0.0

    def spring(self, q: Floats, v: Floats) -> Floats:
        """Lam of every row as if it were alone and active (..., nc), N."""
        h = self.gaps(q)
        found: Floats = self.reduced * (self.presses - self.a1 * self.rates(v) - self.a0 * h - self.a2 * h**3)
        return found

    def gaps(self, q: Floats) -> Floats:
        """Gaps (..., nc), m."""
        return q if self.floor else self.gap + np.diff(q, axis=-1)

    def rates(self, v: Floats) -> Floats:
        """H v (..., nc), m/s."""
        return v if self.floor else np.diff(v, axis=-1)

    def acceleration(self, q: Floats, v: Floats) -> Floats:
        """V' under `memoryless` (n,), m/s^2."""
        push: Floats = np.zeros(len(self.masses))
        for (left, right), lam in zip(self.pairs, self.memoryless(q, v), strict=True):
            push[right] += lam
            if left >= 0:
                push[left] -= lam
        return push / self.masses - self.gravity

    def transmitted(self, change: Floats) -> Floats:
        """What each row passes on (..., nc), from change (..., n) of velocity (or of it a second) beside gravity's."""
        p: Floats = self.masses * change
        return p if self.floor else -np.cumsum(p, axis=-1)[..., :-1]

    def memoryless(self, q: Floats, v: Floats, h: Floats | None = None) -> Floats:
        """max(0, lam) of every row whose gap h, of q if not given, is closed, lam where it cannot open (..., nc), N."""
        lam = self.spring(q, v)
        closed = np.where((self.gaps(q) if h is None else h) <= 0.0, np.maximum(lam, 0.0), 0.0)
        found: Floats = np.where(self.unilateral, closed, lam)
        return found

    def modes(self, h: Floats, rates: Floats, lam: Floats) -> Bytes:
        """Free above; below in contact while it pushes, or as it touches (..., nc)."""
        below = np.where((lam > 0.0) | ((h == 0.0) & (rates < 0.0)), CONTACT, BALLISTIC)
        found: Bytes = np.where(self.unilateral, np.where(h > 0.0, FREE, below), int(Mode.BILATERAL)).astype(np.int8)
        return found


def line(case: Case) -> Line:
    """Read a case of the mechanism "ball" or "sliders"."""
    return _ball(case) if case.mechanism == "ball" else _sliders(case)


def followed(case: Case) -> Case | None:
    """The same rows without ballistic memory; None where several rows are not those of the law (`spring`)."""
    alone = len(case.contacts) == 1 and bool(case.law.unilateral[0])
    return in_real_time(case, "memoryless") if alone else None


def law_name(case: Case) -> str:
    """What `Line.memoryless` is: the machine of that name for one row, a chain of springs for several."""
    return "memoryless" if len(case.contacts) == 1 else "springs"


def _ball(case: Case) -> Line:
    mass, gravity, law = case.number("mass"), case.number("gravity"), case.law

    def observe(q: Floats, v: Floats) -> tuple[Floats, Floats]:
        return q, np.column_stack((0.5 * mass * v[:, 0] ** 2, mass * gravity * q[:, 0]))

    return Line(
        masses=np.array([mass]), gravity=gravity, floor=True, radius=0.05, gap=0.0, q0=case.q0, v0=case.v0, a0=law.a0,
        a1=law.a1, a2=law.a2, unilateral=law.unilateral, sizes=_ball_scale.sizes(case), observe=observe,
    )  # fmt: skip


def _sliders(case: Case) -> Line:
    chain, law = sliders(case), one_set(case.law)
    return Line(
        masses=chain.masses, gravity=0.0, floor=False, radius=chain.radius, gap=chain.gap, q0=case.q0, v0=case.v0,
        a0=law.a0, a1=law.a1, a2=law.a2, unilateral=law.unilateral, sizes=chain.sizes(law), observe=chain.observe,
    )  # fmt: skip
