"""Rank that rows which are always on lose along the motion, by singular values: the check on the compiled test.

With A = H L^-T, M = L L^T, rows scaled by their lengths at the start, the run is ill posed where the smallest singular
value of A falls below a thousandth of its first one, or where det(A_0 A_1^T) < 0 over a step: it has turned over, and
the motion came out of the fold on one branch by chance. A long step may turn it that far without a fold, or pass two:
it is looked at in parts, over each of which the rows turn little.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from crossbody.cases import Outcome
from crossbody.reference.kinds import Floats
from crossbody.reference.sundials.equations import DEPENDENT, Ended, Equations

FLAT = 1e-3  # part of its value at the start below which a singular value has vanished
PROBE = 1.0 / 64.0  # part of a step over which the rate of turning is taken
TURN, MOST = 0.25, 64  # of rows of length one between two looks; looks at one step


def _turned_over(before: Floats, after: Floats) -> bool:
    """Whether det(A_0 A_1^T) is negative."""
    return bool(np.linalg.slogdet(before @ after.T)[0] < 0.0)


class Folds:
    """Watches the rows of one run that are always on.

    Args:
        equations: of the run.
    """

    def __init__(self, equations: Equations) -> None:
        self.equations = equations
        system = equations.system
        rows = np.flatnonzero(system.held & (np.asarray(system.follows) < 0)).tolist()
        self.rows: list[int] = rows if len(rows) > 1 else []  # one row alone has no other to fold onto
        self._before: Floats = np.zeros((0, 0))
        self._rate: float | None = None
        self._lengths, self._first = np.ones(len(rows)), 0.0

    def _spanned(self, t: float, q: Floats, v: Floats) -> Floats:
        """A (m, n) at a state."""
        M, H = self.equations.held(t, q, v, self.rows)
        try:
            A: Floats = np.linalg.solve(np.linalg.cholesky(M), H.T).T
        except np.linalg.LinAlgError:
            raise Ended(Outcome.ILL_POSED, self.rows) from None
        if not np.isfinite(A).all():
            raise Ended(Outcome.ILL_POSED, self.rows)
        return A / self._lengths[:, None]

    def begin(self, t: float, q: Floats, v: Floats) -> None:
        """Take the rows of this state as those of the start.

        Raises:
            Ended: ILL_POSED if they are dependent.
        """
        if not self.rows:
            return
        A = self._spanned(t, q, v)
        self._lengths = np.linalg.norm(A, axis=1)
        if not (self._lengths > 0.0).all():
            raise Ended(Outcome.ILL_POSED, self.rows)
        self._before = A / self._lengths[:, None]
        values = np.linalg.svd(self._before, compute_uv=False)
        self._first = float(values[-1])
        if len(values) < len(self.rows) or values[-1] ** 2 < DEPENDENT * values[0] ** 2:
            raise Ended(Outcome.ILL_POSED, self.rows)

    def check(self, t0: float, t: float, state: Callable[[float], tuple[Floats, Floats]]) -> None:
        """Compare the end of a step with its start.

        Args:
            t0: start of the step, s.
            t: its end, s.
            state: q and v at an instant of the step.

        Raises:
            Ended: ILL_POSED naming the rows that are always on, if they have lost rank on the way.
        """
        if self.rows and t > t0:
            self._follow(t0, t, self._parts(t0, t, state), state)

    def _parts(self, t0: float, t: float, state: Callable[[float], tuple[Floats, Floats]]) -> int:
        """Number of parts of a step, by the rate at which the rows turned last; of the first step, where it begins."""
        if self._rate is None:
            early = self._spanned(t0 + PROBE * (t - t0), *state(t0 + PROBE * (t - t0)))
            self._rate = float(np.linalg.norm(early - self._before)) / (PROBE * (t - t0))
        return int(np.clip(np.ceil(self._rate * (t - t0) / TURN), 1, MOST))

    def _follow(self, t0: float, t: float, parts: int, state: Callable[[float], tuple[Floats, Floats]]) -> None:
        start = before = self._before
        for instant in np.linspace(t0, t, parts + 1)[1:].tolist():
            now = self._spanned(instant, *state(instant))
            flat = np.linalg.svd(now, compute_uv=False)[-1] < FLAT * self._first
            over = _turned_over(before, now)
            turned = float(np.linalg.norm(now - before))
            if (over or turned > 2.0 * TURN) and not flat and parts < MOST:
                self._before = start
                return self._follow(t0, t, MOST, state)
            if flat or over:
                raise Ended(Outcome.ILL_POSED, self.rows)
            before = now
        self._before, self._rate = before, turned * parts / (t - t0)
        return None
