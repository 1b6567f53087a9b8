"""What a system's kernels give at one state."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import SceneError
from crossbody.reference import kernels as kernel_types
from crossbody.reference._guarded import entry
from crossbody.reference._system import System, initial_modes
from crossbody.reference.kinds import Bytes, Floats, Index

NOISE = 1e-3
"""Of the largest row's size: a row that no motion moves (the end of a capsule on its hinge) has
no size of its own, and is off by the rounding of positions as the others are."""


class State:
    """One state of a system and what its kernels give there.

    Attributes:
        M, f, w: of dynamics.
        H, h, Hdv: of rows, all of them.
        gap, rate: of gaps.
    """

    def __init__(self, system: System, t: float, q: Floats, v: Floats, p: Floats) -> None:
        self.system, self.t, self.q, self.v, self.p = system, t, q, v, p
        self.u = np.zeros(system.inputs)
        self.M, self.f, self.w = self.dynamics(q, v)
        self.H, self.h, self.Hdv = self.rows(q, v)
        self.gap, self.rate = self.gaps(q, v)

    def dynamics(self, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        """M, f and the scratch at another place."""
        s = self.system
        M, f, w = np.zeros((s.n, s.mass_block)), np.zeros(s.n), np.zeros(s.scratch)
        s.dynamics(self.t, q, v, self.u, self.p, M, f, w)
        return M, f, w

    def rows(self, q: Floats, v: Floats, idx: Index | None = None) -> tuple[Floats, Floats, Floats]:
        """H, h and H'v of all rows or of those asked for, after dynamics as in a run; the other lines are zero."""
        s = self.system
        H, h, Hdv = np.zeros((s.nc, s.n)), np.zeros(s.nc), np.zeros(s.nc)
        if s.nc:
            asked = np.arange(s.nc) if idx is None else np.append(idx, np.zeros(s.nc - len(idx), np.int64))
            w = self.dynamics(q, v)[2] if s.scratch else np.zeros(0)
            s.rows(self.t, q, v, self.p, w, asked, s.nc if idx is None else len(idx), H, h, Hdv)
        return H, h, Hdv

    def gaps(self, q: Floats, v: Floats, t: float | None = None) -> tuple[Floats, Floats]:
        """Gaps and rates of all rows at another place, or time."""
        h, hd = np.zeros(self.system.nc), np.zeros(self.system.nc)
        self.system.gaps(self.t if t is None else t, q, v, self.p, h, hd)
        return h, hd

    def mass_matrix(self) -> Floats:
        """M as one matrix (n, n)."""
        k, n = self.system.mass_block, self.system.n
        M = np.zeros((n, n))
        for b in range(0, n, k):
            M[b : b + k, b : b + k] = self.M[b : b + k]
        return M

    def finite(self) -> bool:
        """Whether the state lies where the kernels are defined."""
        given = (self.M, self.f, self.H, self.h, self.Hdv, self.gap, self.rate)
        return all(bool(np.isfinite(array).all()) for array in given)

    def evaluated(self) -> NDArray[np.bool_]:
        """Which rows there are: one that cannot be touched in the present discrete state has a gap and no rate."""
        there: NDArray[np.bool_] = (self.gap <= 0.0) | (self.rate != 0.0) | (not self.system.jumps)
        return there

    def sizes(self) -> Floats:
        """Sizes of the positions (n,) that the columns of H belong to: of all of them where q' is not v."""
        size: Floats = np.abs(self.q)
        return size if self.system.velocity is None else np.full(self.system.n, size.max())

    def reach(self) -> Floats:
        """The size of the terms that a gap (nc,) is made of, as far as its derivatives tell."""
        size: Floats = np.abs(self.H) @ (1.0 + self.sizes())
        size += NOISE * size.max(initial=0.0)
        return size

    def where(self) -> str:
        """The state, for a message."""
        return f" at t = {self.t:g} s, q = {self.q.tolist()}, v = {self.v.tolist()}"


def started(system: System, q: Floats, v: Floats, given: Floats | None = None) -> tuple[Floats, Bytes]:
    """Return the parameters with their discrete state, and the modes of all rows, as `switch` leaves them at the start.

    Args:
        system: the mechanism.
        q: positions (n,).
        v: velocities (n,).
        given: parameters before that; those of the system if not given.
    """
    p, mode = np.array(system.p if given is None else given), initial_modes(system, q, v)
    if system.switch is not None:
        constants = len(p) - np.size(system.discrete) - system.latched
        system.switch(0.0, q, v, p, mode, int(kernel_types.START))
        changed = p[:constants] != np.asarray(system.p if given is None else given)[:constants]
        if np.any(changed):
            raise SceneError(f"Kernel switch writes {entry('p', changed)}, which is not a discrete variable.")
    return p, mode
