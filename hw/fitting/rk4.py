"""Compiled Runge-Kutta 4 in complex arithmetic for a mechanism whose rows are all held on.

Every operation is analytic, so that a run from x + i s e_k carries the derivative of its own numbers by
x_k in its imaginary part: exact to rounding for the discrete motion, whose own error is that of the step.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.core import types as core_types

from crossbody.reference import kernels
from crossbody.reference.cache import compiled
from crossbody.reference.kinds import Array, Floats

_C, _CM = types.complex128[::1], types.complex128[:, ::1]
FUNCTIONS = tuple(core_types.FunctionType(kernels.COMPLEX[name]) for name in ("dynamics", "rows"))


@kernels.helper
def _factor(A: Array, n: int) -> None:
    """A = L D L^T in place: D on the diagonal, L below; without pivots, A is positive definite but for the step."""
    for j in range(n):
        for k in range(j):
            A[j, j] -= A[j, k] * A[j, k] * A[k, k]
        for i in range(j + 1, n):
            for k in range(j):
                A[i, j] -= A[i, k] * A[j, k] * A[k, k]
            A[i, j] /= A[j, j]


@kernels.helper
def _substitute(A: Array, n: int, x: Array) -> None:
    """X = A^-1 x for a factored A."""
    for i in range(n):
        for k in range(i):
            x[i] -= A[i, k] * x[k]
    for i in range(n):
        x[i] /= A[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= A[k, i] * x[k]


@kernels.helper
def _over_mass(M: Array, k: int, x: Array) -> None:
    """X = M^-1 x for factored blocks of size k."""
    for b in range(0, len(x), k):
        _substitute(M[b : b + k], k, x[b : b + k])


@kernels.helper
def _accelerate(
    dynamics: Any,
    rows: Any,
    t: float,
    y: Array,
    u: Array,
    p: Array,
    law: Floats,
    idx: Any,
    k: int,
    work: Any,
    out: Array,
) -> None:
    """Out = (v, M^-1 (f + H^T lam)), S lam = -(H M^-1 f + H' v + a1 h' + a0 h + a2 h^3), S = H M^-1 H^T."""
    M, f, w, H, h, drift, W, S, lam = work
    n, nc = len(f), len(h)
    q, v = y[:n], y[n:]
    dynamics(t, q, v, u, p, M, f, w)
    rows(t, q, v, p, w, idx, nc, H, h, drift)
    for b in range(0, n, k):
        _factor(M[b : b + k], k)
    _over_mass(M, k, f)
    for j in range(nc):
        for i in range(n):
            W[j, i] = H[j, i]
        _over_mass(M, k, W[j])
    for j in range(nc):
        rate = 0.0 * h[j]
        push = 0.0 * h[j]
        for i in range(n):
            rate += H[j, i] * v[i]
            push += H[j, i] * f[i]
        lam[j] = -(push + drift[j] + law[j, 1] * rate + (law[j, 0] + law[j, 2] * h[j] * h[j]) * h[j])
        for m in range(nc):
            S[j, m] = 0.0
            for i in range(n):
                S[j, m] += H[j, i] * W[m, i]
    _factor(S, nc)
    _substitute(S, nc, lam)
    for i in range(n):
        out[i] = v[i]
        out[n + i] = f[i]
        for j in range(nc):
            out[n + i] += W[j, i] * lam[j]


@kernels.helper
def _step(
    dynamics: Any, rows: Any, t: float, step: float, y: Array, u: Array, p: Array, law: Floats,
    idx: Any, k: int, work: Any, stages: Array,
) -> None:  # fmt: skip
    """Carry y on by one step in place; stages (3, 2 n) is scratch."""
    z, slope, total = stages[0], stages[1], stages[2]
    total[:] = 0.0
    slope[:] = 0.0
    for stage in range(4):
        reach = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
        weight = 1.0 if stage == 0 or stage == 3 else 2.0
        for i in range(len(y)):
            z[i] = y[i] + reach * step * slope[i]
        _accelerate(dynamics, rows, t + reach * step, z, u, p, law, idx, k, work, slope)
        for i in range(len(y)):
            total[i] += weight * slope[i]
    for i in range(len(y)):
        y[i] += step / 6.0 * total[i]


def march(
    dynamics: Any, rows: Any, times: Floats, parts: int, u: Array, p: Array, law: Floats,
    k: int, scratch: int, out: Array,
) -> None:  # fmt: skip
    """Fill out[1:] from out[0], `parts` steps between two times; u[i] acts from times[i] on.

    Args:
        dynamics: kernel.
        rows: kernel.
        times (m,): s.
        parts: steps between two times.
        u (m, nu): inputs.
        p: parameters.
        law (nc, 3): a0, a1, a2.
        k: size of the blocks of M.
        scratch: length of w.
        out (m, 2 n): positions and velocities; the first line is the start.
    """
    n, nc, c = out.shape[1] // 2, len(law), np.complex128
    work = (
        np.zeros((n, k), c), np.zeros(n, c), np.zeros(scratch, c), np.zeros((nc, n), c), np.zeros(nc, c),
        np.zeros(nc, c), np.zeros((nc, n), c), np.zeros((nc, nc), c), np.zeros(nc, c),
    )  # fmt: skip
    idx, y, stages = np.arange(nc), out[0].copy(), np.zeros((3, 2 * n), c)
    for m in range(len(times) - 1):
        step = (times[m + 1] - times[m]) / parts
        for part in range(parts):
            _step(dynamics, rows, times[m] + part * step, step, y, u[m], p, law, idx, k, work, stages)
        out[m + 1] = y


march = compiled(
    march,
    [
        types.void(
            *FUNCTIONS, types.float64[::1], types.int64, _CM, _C, types.float64[:, ::1], types.int64, types.int64, _CM
        )
    ],
)
