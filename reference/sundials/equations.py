"""The reduced equations in plain Python, one evaluation a call: slow, and independent of the compiled loop.

    [ M   -H_A^T ] [ v'  ]   [ f                                          ]
    [ H_A    0   ] [ lam ] = [ -(H_A' v + a1 h' + a0 h + a2 h^3)_A        ]

The mechanism's kernels are called from Python, but not its own `solve`: the whole matrix is solved by LU with partial
pivoting.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from math import isfinite

import numpy as np

from crossbody.cases import Mode, Outcome
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats

ACTIVE = frozenset({Mode.CONTACT, Mode.COLLISION, Mode.BILATERAL})
ROUNDING = 1e-13  # part of a sum's terms that rounding may make of the sum
ULP = float(np.finfo(np.float64).eps)
PROJECTIONS = 2  # Newton steps from a drift of the size of the tolerance
DEPENDENT = 1e-13  # ratio of singular values of the scaled rows below which the multipliers are not unique


def _solved(matrix: Floats, right: Floats) -> Floats | None:
    """Return the solution of linear equations; None where the matrix is singular."""
    try:
        found: Floats = np.linalg.solve(matrix, right).astype(np.float64, copy=False)
    except np.linalg.LinAlgError:
        return None
    return found


class Ended(Exception):  # noqa: N818 - an end, not an error: it is caught where the run is driven
    """A run ends here.

    Args:
        outcome: how.
        rows: the rows concerned.
    """

    def __init__(self, outcome: Outcome, rows: Sequence[int] = ()) -> None:
        self.outcome, self.rows = outcome, list(rows)
        super().__init__(outcome.advice)


class Equations:
    """Evaluates a mechanism for a list of active rows.

    Attributes:
        u (nu,): inputs in force. memory: state of the controller.
        active: indices of the active rows.
        law (nc, 3): a0, a1, a2 in force for every row.
        beside: rows that depend on the active ones and share their load; None where no row depends on others.
        evaluations: right-hand sides so far.
    """

    def __init__(self, system: System, rigid: bool = False) -> None:
        n, nc = system.n, system.nc
        self.system = system
        self.slow, self.fast = np.array(system.alpha), np.array(system.beta)
        self.has_fast: list[bool] = np.any(self.fast, axis=1).tolist()
        if rigid:  # h = 0 itself holds a bilateral row: on it the law has nothing to add
            self.slow[~np.asarray(system.unilateral, dtype=bool)] = 0.0
        self.law = self.slow.copy()
        self.p, self.u, self.memory = np.array(system.p), np.zeros(system.inputs), np.zeros(system.memory)
        self.active: list[int] = []
        self.beside: list[int] | None = None
        self.evaluations = 0
        self._blocks, self._f, self._w = np.zeros((n, system.mass_block)), np.zeros(n), np.zeros(system.scratch)
        self._H, self._h, self._Hdv = np.zeros((nc, n)), np.zeros(nc), np.zeros(nc)
        self._gap, self._rate, self._two = np.zeros(nc), np.zeros(nc), np.zeros(2)
        self._M = self._blocks if system.mass_block == n else np.zeros((n, n))
        self._index = np.zeros(nc, dtype=np.int64)
        self.activate([])

    def activate(self, modes: Sequence[int], without: Collection[int] = ()) -> None:
        """List the active rows of a mode set, less those that others hold, and put their constants in force."""
        self.active = [i for i, mode in enumerate(modes) if mode in ACTIVE and i not in without]
        self.beside = None
        self._index[: len(self.active)] = self.active
        self._H[:] = 0.0  # kernels need not write the zeros
        for i, mode in enumerate(modes):
            self.law[i] = self.fast[i] if mode == Mode.COLLISION and self.has_fast[i] else self.slow[i]
        self._law = self.law[self.active].T.copy()
        size = self.system.n + len(self.active)
        self._matrix, self._right = np.zeros((size, size), order="F"), np.zeros(size)

    def terms(self, t: float, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """M (n, n) and f (n,); both are views that the next call overwrites."""
        s = self.system
        self.evaluations += 1
        s.dynamics(t, q, v, self.u, self.p, self._blocks, self._f, self._w)
        k = s.mass_block
        if k != s.n:
            for b in range(0, s.n, k):
                self._M[b : b + k, b : b + k] = self._blocks[b : b + k]
        return self._M, self._f

    def rows(self, t: float, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        """H_A (na, n), h_A (na,) and H_A' v (na,); `terms` must have been called at this state."""
        na = len(self.active)
        if na:
            self.system.rows(t, q, v, self.p, self._w, self._index, na, self._H, self._h, self._Hdv)
        return self._H[:na], self._h[:na], self._Hdv[:na]

    def drive(self, h: Floats, rate: Floats) -> Floats:
        """a1 h' + a0 h + a2 h^3 of the active rows."""
        a0, a1, a2 = self._law
        value: Floats = a1 * rate + (a0 + a2 * h * h) * h
        return value

    def accelerate(self, t: float, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Acceleration v' (n,) and lam of all rows (nc,).

        Raises:
            Ended: ILL_POSED if the matrix is singular, NOT_FINITE if the kernels return what is not finite.
        """
        n, matrix, right = self.system.n, self._matrix, self._right
        matrix[:n, :n], right[:n] = self.terms(t, q, v)
        if self.active:
            H, h, Hdv = self.rows(t, q, v)
            matrix[:n, n:], matrix[n:, :n] = -H.T, H
            right[n:] = -(Hdv + self.drive(h, H @ v))
        solved = _solved(matrix, right)  # by numpy: scipy's, which takes 6 us less, takes .2 s to import
        if solved is None or not isfinite(solved.dot(solved)):
            good = np.isfinite(right).all() and np.isfinite(matrix).all()
            raise Ended(Outcome.ILL_POSED if good else Outcome.NOT_FINITE, self.active)
        lam = np.zeros(self.system.nc)
        if self.active:
            lam[self.active] = solved[n:]
        return solved[:n], lam

    def share(self, t: float, q: Floats, v: Floats, lam: Floats) -> Floats:
        """Multipliers (nc,) of all rows, the least that exert the forces of those of the active ones alone (nc,)."""
        if not self.beside:
            return lam
        every = [*self.active, *self.beside]
        H = self.held(t, q, v, every)[1]
        C = np.linalg.lstsq(H[: len(self.active)].T, H[len(self.active) :].T, rcond=None)[0]
        shared = lam.copy()
        shared[every] = np.linalg.lstsq(np.hstack([np.eye(len(C)), C]), lam[self.active], rcond=None)[0]
        return shared

    def gaps(self, t: float, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Gaps h and rates h' of all rows (nc,); views that the next call overwrites."""
        self.system.gaps(t, q, v, self.p, self._gap, self._rate)
        return self._gap, self._rate

    def energy(self, q: Floats, v: Floats) -> Floats:
        """Kinetic and potential energy (2,), J."""
        self.system.energy(q, v, self.p, self._two)
        return self._two.copy()

    def powers(self, t: float, q: Floats, v: Floats, lam: Floats) -> Floats:
        """Power of every row's multiplier, of the inputs, and dissipated (nc + 2,), W."""
        _, rate = self.gaps(t, q, v)
        self.system.power(t, q, v, self.u, self.p, self._two)
        return np.concatenate([lam * rate, self._two])

    def control(self, t: float, q: Floats, v: Floats) -> None:
        """Let the sampled controller set the inputs."""
        self.system.control(t, q, v, self.u, self.memory, self.p)

    def noise(self, t: float, q: Floats, v: Floats, speed: float = 0.0, error: float = 0.0) -> tuple[Floats, Floats]:
        """What rounding may make of each active multiplier, and the size that it has or may take (nc,), N.

        Args:
            t: instant, s.
            q: positions (nq,).
            v: velocities (n,).
            speed: rate at which gaps may close, m/s.
            error: of positions and velocities, beside their rounding.

        Raises:
            Ended: ILL_POSED if the active rows are dependent.
        """
        noise, size = np.zeros(self.system.nc), np.zeros(self.system.nc)
        if not self.active:
            return noise, size
        M, f = self.terms(t, q, v)
        H, h, Hdv = self.rows(t, q, v)
        X = np.linalg.solve(M, np.column_stack([H.T, f]))
        G = H @ X[:, :-1]
        self._check_rank(G)
        law, rate = self.law[self.active], H @ v
        spring = np.abs((law[:, 0] + law[:, 2] * h * h) * h)
        terms = np.abs(H @ X[:, -1]) + np.abs(Hdv) + law[:, 1] * np.abs(rate) + spring
        off_q, off_v = (error + 8.0 * ULP * float(np.abs(x).max()) for x in (q, v))
        state = law[:, 0] * off_q + law[:, 1] * off_v
        inverse, lam = np.linalg.inv(G), np.abs(np.linalg.solve(G, self.drive(h, rate) + Hdv + H @ X[:, -1]))
        H, X = np.abs(H), np.abs(X[:, :-1])
        pushed = H @ (X @ lam) + X.T @ (H.T @ lam)  # what is zero by symmetry is so but for the rounding of its terms
        noise[self.active] = np.abs(inverse) @ (ROUNDING * (terms + pushed) + state)
        size[self.active] = (terms + np.sqrt(law[:, 0]) * np.maximum(np.abs(rate), speed)) / np.diag(G)
        return noise, size

    def _check_rank(self, G: Floats) -> None:
        scale = np.sqrt(np.diag(G))
        if not (np.isfinite(G).all() and (scale > 0.0).all()):
            raise Ended(Outcome.ILL_POSED, self.active)
        values = np.linalg.svd(G / np.outer(scale, scale), compute_uv=False)
        if values[-1] < DEPENDENT * values[0]:
            raise Ended(Outcome.ILL_POSED, self.active)

    def project(
        self, q: Floats, v: Floats, rows: list[int], h: Floats | None = None, rate: Floats | None = None
    ) -> None:
        """Move q and v to where the given rows have these gaps and rates, by the least change in the metric of M.

        Args:
            q: positions (n,), changed in place.
            v: velocities (n,), likewise.
            rows: m of the rows, active or not.
            h: gaps (m,), m; NaN where a row's gap may stay as it is, none for zero.
            rate: rates (m,), m/s; none for zero.

        Raises:
            Ended: ILL_POSED if these rows are dependent.
        """
        gap, speed = (np.zeros(len(rows)) if x is None else x for x in (h, rate))
        with self._selected(rows):
            for _ in range(PROJECTIONS):
                off = self._least(q, v, lambda H, h: np.where(np.isnan(gap), 0.0, h - gap))
                q -= self.system.displacement(q, off, self.p)
            v -= self._least(q, v, lambda H, h: H @ v - speed)

    @contextmanager
    def _selected(self, rows: list[int]) -> Iterator[None]:
        """Let `rows` give these rows, whatever is active."""
        active = self.active
        self.active, self._index[: len(rows)] = rows, rows
        self._H[:] = 0.0
        try:
            yield
        finally:
            self.active, self._index[: len(active)] = active, active
            self._H[:] = 0.0

    def held(self, t: float, q: Floats, v: Floats, rows: list[int]) -> tuple[Floats, Floats]:
        """M (n, n), a view that the next call overwrites, and H (m, n) of the given rows, active or not."""
        with self._selected(rows):
            M, _ = self.terms(t, q, v)
            return M, self.rows(t, q, v)[0].copy()

    def mobility(self, t: float, q: Floats, v: Floats, rows: list[int]) -> tuple[Floats, Floats]:
        """H (m, n) of the given rows, active or not, and M^-1 H^T (n, m).

        Raises:
            Ended: ILL_POSED if these rows are dependent.
        """
        with self._selected(rows):
            M, _ = self.terms(t, q, v)
            H = self.rows(t, q, v)[0].copy()
            X = np.linalg.solve(M, H.T)
            self._check_rank(H @ X)
        return H, np.asarray(X, dtype=np.float64)

    def row_acceleration(self, t: float, q: Floats, v: Floats, i: int) -> float:
        """h_i'' under the active rows, m/s^2."""
        vd, _ = self.accelerate(t, q, v)
        with self._selected([i]):
            H, _, Hdv = self.rows(t, q, v)
            return float(H[0] @ vd + Hdv[0])

    def strongest(self, t: float, q: Floats, v: Floats, rows: list[int]) -> float:
        """Largest h_i'' of these rows that forces and motion alone may make, without cancellation, m/s^2."""
        with self._selected(rows):
            M, f = self.terms(t, q, v)
            H, _, Hdv = self.rows(t, q, v)
            sizes = np.abs(H) @ np.abs(np.linalg.solve(M, f)) + np.abs(Hdv)
        return float(sizes[np.isfinite(sizes)].max(initial=0.0))

    def _least(self, q: Floats, v: Floats, error: Callable[[Floats, Floats], Floats]) -> Floats:
        """The smallest x with H x = error."""
        M, _ = self.terms(0.0, q, v)
        H, h, _ = self.rows(0.0, q, v)
        X = np.linalg.solve(M, H.T)
        G = H @ X
        self._check_rank(G)
        x: Floats = X @ np.linalg.solve(G, error(H, h))
        return x
