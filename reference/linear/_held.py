"""Small motions about many held poses, compiled: inputs and multipliers of equilibrium, then the reduced model.

At rest, f(q, 0, u) + H^T lam = 0 with as many inputs as freedoms gives u and lam. With T (n, m) a
basis of the motions that the rows admit, dq = T y, the small motions about it are (all
derivatives of f + H^T lam at fixed u and lam)

    (T^T M T) y'' - (T^T d(f + H^T lam)/dv T) y' - (T^T d(f + H^T lam)/dq T) y = 0

since what T changes multiplies f + H^T lam = 0. The rows' own law does not appear: this is the
minimal realisation.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from crossbody.reference import kernels
from crossbody.reference.cache import compiled
from crossbody.reference.kinds import Array, Bytes, Floats, Index
from crossbody.reference.linear._compiled import FOUND, ILL_POSED, MISSED, STEP, agrees, spread, steps
from crossbody.reference.linear._elimination import admitted, eliminate, first_order


@compiled
def rows_at(rows: Any, t: float, x: Array, p: Array, w: Array, idx: Index, H: Array, h: Array, drift: Array) -> None:
    """H, h and H' v of the active rows at x = (q, v)."""
    n = H.shape[1]
    H[:] = 0.0
    rows(t, x[:n], x[n:], p, w, idx, len(idx), H, h, drift)


@compiled
def pushed(
    dynamics: Any, t: float, x: Array, p: Array, M: Array, f: Array, w: Array, u: Floats, hold: Index, K: Floats
) -> None:
    """First m columns of K: df/du of the inputs that hold; its last one: -f without them."""
    n = len(f)
    inputs = u.astype(np.complex128)
    for c in range(len(hold)):
        for other in range(len(hold)):
            inputs[hold[other]] = 1j * STEP if other == c else 0.0
        dynamics(t, x[:n], x[n:], inputs, p, M, f, w)
        for i in range(n):
            K[i, c], K[i, n] = f[i].imag / STEP, -f[i].real


@compiled
def balanced(H: Array, K: Floats, hold: Index, u: Floats, lam: Floats) -> int:
    """The inputs and multipliers of equilibrium into u and lam; 1 if they are not determined."""
    n, m = H.shape[1], len(hold)
    order = np.empty(n, np.int64)
    for a in range(n - m):
        for i in range(n):
            K[i, m + a] = H[a, i].real
    if eliminate(K, n, order) != 0:
        return 1
    for c in range(m):
        u[hold[c]] = K[order[c], n]
    for a in range(n - m):
        lam[a] = K[order[m + a], n]
    return 0


@compiled
def force_slope(f: Array, H: Array, lam: Floats, out: Floats) -> None:
    """Out (n,): the imaginary part of f + H^T lam over STEP."""
    for i in range(len(f)):
        total = f[i].imag
        for a in range(len(lam)):
            total += H[a, i].imag * lam[a]
        out[i] = total / STEP


@compiled
def unpacked(M: Array, k: int, mass: Floats) -> None:
    """The real block-diagonal matrix (n, n) of blocks (n, k)."""
    for i in range(len(M)):
        for j in range(k):
            mass[i, i - i % k + j] = M[i, j].real


def held(
    dynamics: Any, rows: Any, k: int, t: float, Q: Floats, P: Array, w: Array, idx: Index,
    hold: Index, colours: Index, count: int, pattern: Bytes, probe: Floats, u: Floats,
    lam: Floats, basis: Floats, A: Floats, codes: Index,
) -> None:  # fmt: skip
    """Inputs, multipliers and the reduced first-order model at every line of Q, at rest.

    Args:
        dynamics: kernel, for complex numbers.
        rows: kernel, for complex numbers.
        k: size of the mass blocks.
        t: time, s.
        Q: positions (N, n).
        P: parameters (1, np), or a line a point.
        w: scratch of the kernels.
        idx: the active rows (na,).
        hold: the inputs that hold (m,), m = n - na; f is affine in them.
        colours: which step each of the 2 n columns (q, v) belongs to.
        count: number of steps.
        pattern: (n, 2 n), where d(f + H^T lam)/d(q, v) may differ from 0.
        probe: (2 n,), direction of the check.
        u: the inputs (N, nu), of which those in `hold` are found.
        lam: receives the multipliers (N, na).
        basis: receives T (N, n, m).
        A: receives the matrix (N, 2 m, 2 m) of (y, y').
        codes: receives FOUND, ILL_POSED or MISSED (N,).
    """
    n, na = Q.shape[1], len(idx)
    x, p = np.zeros(2 * n, np.complex128), np.zeros(P.shape[1], np.complex128)
    M, f = np.zeros((n, k), np.complex128), np.zeros(n, np.complex128)
    H, h, drift = np.zeros((na, n), np.complex128), np.zeros(na, np.complex128), np.zeros(na, np.complex128)
    K, F, mass = np.zeros((n, n + 1)), np.zeros((n, 2 * n)), np.zeros((n, n))
    packed, seeds, _ = steps(colours, count, probe, n, 0)
    for s in range(len(Q)):
        p[:] = P[min(s, len(P) - 1)]
        x[:n], x[n:] = Q[s], 0.0
        pushed(dynamics, t, x, p, M, f, w, u[s], hold, K)
        rows_at(rows, t, x, p, w, idx, H, h, drift)
        if balanced(H, K, hold, u[s], lam[s]) != 0 or admitted(H, basis[s]) != 0:
            codes[s] = ILL_POSED
            continue
        unpacked(M, k, mass)
        inputs = u[s].astype(np.complex128)
        for c in range(count + 1):
            x[:n], x[n:] = Q[s] + seeds[c, :n], seeds[c, n:]
            dynamics(t, x[:n], x[n:], inputs, p, M, f, w)
            rows_at(rows, t, x, p, w, idx, H, h, drift)
            force_slope(f, H, lam[s], packed[c])
        spread(packed, colours, pattern, F)
        codes[s] = FOUND if agrees(F, probe, packed[count]) else MISSED
        if first_order(basis[s], mass, F, A[s]) != 0:
            codes[s] = ILL_POSED


_F, _F2, _F3 = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]
_I, _B2 = types.int64[::1], types.int8[:, ::1]
_C, _C2 = types.complex128[::1], types.complex128[:, ::1]
_KERNELS = tuple(types.FunctionType(kernels.COMPLEX[name]) for name in ("dynamics", "rows"))
_ARGUMENTS = (
    types.int64, types.float64, _F2, _C2, _C, _I, _I, _I, types.int64, _B2, _F, _F2, _F2, _F3, _F3, _I,
)  # fmt: skip
held = compiled(held, [types.void(*_KERNELS, *_ARGUMENTS)], nogil=True)
