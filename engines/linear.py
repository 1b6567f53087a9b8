"""Small motions about an equilibrium as engines give them: what they are asked, and what they answer.

An engine's coordinates y may be others than the case's q, with v = T y', or more (a clock, a ball that
stands still): T (n, ny) and its right inverse S (ny, n). At rest, where y'' = 0, a derivative J (ny, 2 ny)
of y'' by (y, y') is T J diag(S, S) in the case's coordinates, whatever the second derivatives of the chart.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from crossbody.cases import Case, Mode
from crossbody.cases.arrays import Floats
from crossbody.engines._log import Modes


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """An equilibrium of a case, in its coordinates.

    Attributes:
        q (nq,), v (n,): state.
        u (nu,): inputs of the mechanism, constant.
        rows: those that are on, with the constants of CONTACT.
        lam: their multipliers, N.
        t: time at which what depends on it is frozen, s.
        powered: whether the case's servos act beside u.
    """

    q: Floats
    v: Floats
    u: Floats
    rows: tuple[int, ...]
    lam: Floats
    t: float = 0.0
    powered: bool = True

    def modes(self, case: Case) -> Modes:
        """Mode of every row."""
        on = [Mode.CONTACT if u else Mode.BILATERAL for u in case.law.unilateral.tolist()]
        return tuple(int(on[i] if i in self.rows else Mode.FREE) for i in range(len(on)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Tangent:
    """One way in which an engine linearises.

    Attributes:
        way: how it was made, in the engine's own words.
        slope (n, 2 n): derivative of v' by (q, v), in the case's coordinates, or in those of its
            tangent space.
        known: a known property of the engine that takes it off; empty if it should be right.
        explained: what this property alone would make of the right derivative; None where it tells no number.
    """

    way: str
    slope: Floats
    known: str = ""
    explained: Floats | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """Derivatives in an engine's coordinates y -> in the case's.

    Attributes:
        T (n, ny): v = T y'.
        S (ny, n): y' = S v.
    """

    T: Floats
    S: Floats

    def slope(self, J: Floats) -> Floats:
        """The derivative (n, 2 n) of v' from that of y'' by (y, y') (ny, 2 ny)."""
        ny = len(self.S)
        return self.T @ np.hstack([J[:, :ny] @ self.S, J[:, ny:] @ self.S])

    def tangent(self, way: Tangent) -> Tangent:
        """The same way in the case's coordinates."""
        explained = None if way.explained is None else self.slope(way.explained)
        return replace(way, slope=self.slope(way.slope), explained=explained)


def in_contact(case: Case) -> Case:
    """The case with the constants of CONTACT as the only ones of its rows."""
    law = case.law
    return replace(case, law=replace(law, b0=0.0 * law.b0, b1=0.0 * law.b1), claims=())
