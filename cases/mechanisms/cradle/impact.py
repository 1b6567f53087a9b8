"""What touching balls on a line do at one instant, under the two frozen rules (docs/explanation/model.md).

    sequential     the most approaching contact collides alone, then the next, until none approaches
    simultaneous   all at once: impulses J >= 0, h'+ + e h'- >= 0, and J is 0 where that is not 0 (Newton's law of
                   impact as a linear complementarity problem; Moreau 1988)

Both are exact: a collision that takes no time moves nothing. Touching balls of small restitution
collide without end at one instant, each time slower (Bernu and Mazighi 1990): by the law's own
measure (`STILL`) there is a last one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import nnls

from crossbody.cases.arrays import Floats

Touching = NDArray[np.bool_]
Impulses = dict[int, float]  # row -> impulse, N s, of all rows that act at once
Impact = Callable[[Floats, Floats, Touching, float, float], Iterator[Impulses]]

TIE = 1e-12  # rates are equal within this part of the fastest ball
STILL = 1e-9  # a gap whose rate is below this part of the fastest one seen so far stands still


def sequential(masses: Floats, v: Floats, touching: Touching, e: float, slow: float) -> Iterator[Impulses]:
    """The impulse of each collision in turn; v (n,) is moved on in place before each is told.

    Args:
        masses (n,): kg.
        v (n,): speeds, m/s.
        touching (n - 1,): which neighbours touch.
        e: restitution.
        slow: rate below which a gap stands still, m/s.
    """
    tie = TIE * float(np.max(np.abs(v), initial=0.0))
    rates, last = np.where(touching, np.diff(v), np.inf), len(touching) - 1
    while True:
        worst = float(rates.min())
        if worst >= -slow:
            return
        row = int(np.argmax(rates <= worst + tie))
        a, b = masses[row : row + 2]
        yield _push(masses, v, {row: float((1.0 + e) * a * b / (a + b) * (v[row] - v[row + 1]))})
        for i in range(max(row - 1, 0), min(row + 1, last) + 1):  # no other has changed
            if touching[i]:
                rates[i] = v[i + 1] - v[i]


def _push(masses: Floats, v: Floats, impulses: Impulses) -> Impulses:
    """Let impulses act on the speeds."""
    for row, impulse in impulses.items():
        v[row] -= impulse / masses[row]
        v[row + 1] += impulse / masses[row + 1]
    return impulses


def simultaneous(masses: Floats, v: Floats, touching: Touching, e: float, slow: float) -> Iterator[Impulses]:
    """All impulses of what touches and stays, again if some then approach; arguments as of `sequential`."""
    while (touching & (np.diff(v) < -slow)).any():
        rows = np.flatnonzero(touching & (np.diff(v) <= slow))
        impulses = pushes(delassus(masses)[np.ix_(rows, rows)], (1.0 + e) * np.diff(v)[rows])
        yield _push(masses, v, dict(zip(rows.tolist(), impulses.tolist(), strict=True)))


def delassus(masses: Floats) -> Floats:
    """G = H M^-1 H^T (n - 1, n - 1) of a row of balls, 1/kg: tridiagonal."""
    inverse = 1.0 / masses
    off = np.diag(-inverse[1:-1], 1)
    return np.diag(inverse[:-1] + inverse[1:]) + off + off.T


def pushes(G: Floats, b: Floats) -> Floats:
    """The solution x (k,) of 0 <= x, G x + b >= 0, x . (G x + b) = 0, G (k, k) positive definite.

    If not all push, the set that does is found by non-negative least squares on the Cholesky
    factor, in finitely many steps.
    """
    x: Floats = np.asarray(np.linalg.solve(G, -b), dtype=np.float64)
    if x.min() >= 0.0:
        return x
    R = cholesky(G)
    active = nnls(R, solve_triangular(R, -b, trans="T"))[0] > 0.0
    x[:] = 0.0
    if active.any():
        x[active] = np.linalg.solve(G[np.ix_(active, active)], -b[active])
    return x


RULES: dict[str, Impact] = {"sequential": sequential, "simultaneous": simultaneous}
