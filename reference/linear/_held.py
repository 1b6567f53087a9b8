"""Small motions about many held poses, compiled: inputs and multipliers of equilibrium, then the reduced model.

At rest, f(q, 0, u) + H^T lam = 0 with as many inputs as freedoms gives u and lam. With T (n, m) a basis of the motions
that the rows admit, dq = T y, the small motions about it are (all derivatives of f + H^T lam at fixed u and lam)

    (T^T M T) y'' - (T^T d(f + H^T lam)/dv T) y' - (T^T d(f + H^T lam)/dq T) y = 0

since what T changes multiplies f + H^T lam = 0. The rows' own law does not appear: this is the minimal realisation.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from crossbody.reference import kernels
from crossbody.reference._cache import compiled
from crossbody.reference._kinds import Array, Bytes, Floats, Index
from crossbody.reference.linear._compiled import FOUND, ILL_POSED, MISSED, STEP, agrees, spread, steps


@compiled
def eliminate(A: Floats, n: int, rows: Index) -> int:
    """Reduce A (na, n + m) to the identity in na of its first n columns, rows[c] their row, -1 the others'.

    The largest element left is the pivot; 1 if the rank is less than na.
    """
    na, width = A.shape
    rows[:] = -1
    used = np.zeros(na, np.bool_)
    largest = 0.0
    for _ in range(na):
        best, r, c = 0.0, 0, 0
        for i in range(na):
            if not used[i]:
                for j in range(n):
                    if abs(A[i, j]) > best:
                        best, r, c = abs(A[i, j]), i, j
        largest = max(largest, best)
        if not best > 1e-10 * largest:
            return 1
        used[r], rows[c] = True, r
        inverse = 1.0 / A[r, c]
        for j in range(width):
            A[r, j] *= inverse
        for i in range(na):
            if i != r and A[i, c] != 0.0:
                factor = A[i, c]
                for j in range(width):
                    A[i, j] -= factor * A[r, j]
    return 0


@compiled
def admitted(H: Array, T: Floats) -> int:
    """T (n, m) with H T = 0, the identity in the coordinates that are free; 1 if H has not full rank."""
    n = H.shape[1]
    A, rows = H.real.copy(), np.empty(n, np.int64)
    if eliminate(A, n, rows) != 0:
        return 1
    k = 0
    for free in range(n):
        if rows[free] < 0:
            for c in range(n):
                T[c, k] = -A[rows[c], free] if rows[c] >= 0 else 0.0
            T[free, k] = 1.0
            k += 1
    return 0


@compiled
def projected(T: Floats, F: Floats, out: Floats) -> None:
    """Out (m, m) = T^T F T."""
    n, m = T.shape
    for a in range(m):
        for b in range(m):
            out[a, b] = 0.0
    for i in range(n):
        for b in range(m):
            total = 0.0
            for j in range(n):
                total += F[i, j] * T[j, b]
            for a in range(m):
                out[a, b] += T[i, a] * total


def held(
    dynamics: Any, rows: Any, k: int, t: float, Q: Floats, P: Array, w: Array, idx: Index, hold: Index,
    colours: Index, count: int, pattern: Bytes, probe: Floats, u: Floats, lam: Floats, basis: Floats, A: Floats,
    codes: Index,
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
    n, na, m = Q.shape[1], len(idx), len(hold)
    x, p, inputs = np.zeros(2 * n, np.complex128), np.zeros(P.shape[1], np.complex128), u[0].astype(np.complex128)
    M, f = np.zeros((n, k), np.complex128), np.zeros(n, np.complex128)
    H, h, drift = np.zeros((na, n), np.complex128), np.zeros(na, np.complex128), np.zeros(na, np.complex128)
    K, order, F, mass = np.zeros((n, n + 1)), np.empty(n, np.int64), np.zeros((n, 2 * n)), np.zeros((n, n))
    packed, seeds, _ = steps(colours, count, probe, n, 0)
    q, v = x[:n], x[n:]
    small, R = np.zeros((m, m)), np.zeros((m, 3 * m))
    for s in range(len(Q)):
        codes[s] = FOUND
        p[:] = P[min(s, len(P) - 1)]
        for i in range(n):
            x[i], x[n + i] = Q[s, i], 0.0
        for c in range(m):
            for j in range(len(inputs)):
                inputs[j] = u[s, j]
            inputs[hold[c]] = 1j * STEP
            for other in range(m):
                if other != c:
                    inputs[hold[other]] = 0.0
            dynamics(t, q, v, inputs, p, M, f, w)
            for i in range(n):
                K[i, c], K[i, n] = f[i].imag / STEP, -f[i].real
        for a in range(na):
            for i in range(n):
                H[a, i] = 0.0
        rows(t, q, v, p, w, idx, na, H, h, drift)
        for a in range(na):
            for i in range(n):
                K[i, m + a] = H[a, i].real
        T = basis[s]
        if eliminate(K, n, order) != 0 or admitted(H, T) != 0:
            codes[s] = ILL_POSED
            continue
        for j in range(len(inputs)):
            inputs[j] = u[s, j]
        for c in range(m):
            u[s, hold[c]] = K[order[c], n]
            inputs[hold[c]] = K[order[c], n]
        for a in range(na):
            lam[s, a] = K[order[m + a], n]
        for i in range(n):
            b = i - i % k
            for j in range(k):
                mass[i, b + j] = M[i, j].real
        for c in range(count + 1):
            for j in range(2 * n):
                x[j] = seeds[c, j] + (Q[s, j] if j < n else 0.0)
            dynamics(t, q, v, inputs, p, M, f, w)
            for a in range(na):
                for i in range(n):
                    H[a, i] = 0.0
            rows(t, q, v, p, w, idx, na, H, h, drift)
            for i in range(n):
                total = f[i].imag
                for a in range(na):
                    total += H[a, i].imag * lam[s, a]
                packed[c, i] = total / STEP
        spread(packed, colours, pattern, F)
        if not agrees(F, probe, packed[count]):
            codes[s] = MISSED
        for part in range(3):
            projected(T, mass if part == 0 else F[:, (part - 1) * n : part * n].copy(), small)
            for a in range(m):
                for b in range(m):
                    R[a, part * m + b] = small[a, b]
        if eliminate(R, m, order[:m]) != 0:
            codes[s] = ILL_POSED
            continue
        for a in range(m):
            A[s, a, m + a] = 1.0
            for b in range(m):
                A[s, m + a, b], A[s, m + a, m + b] = R[order[a], m + b], R[order[a], 2 * m + b]


_F, _F2, _F3 = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]
_I, _B2 = types.int64[::1], types.int8[:, ::1]
_C, _C2 = types.complex128[::1], types.complex128[:, ::1]
_KERNELS = tuple(types.FunctionType(kernels.COMPLEX[name]) for name in ("dynamics", "rows"))
_ARGUMENTS = (
    types.int64, types.float64, _F2, _C2, _C, _I, _I, _I, types.int64, _B2, _F, _F2, _F2, _F3, _F3, _I,
)  # fmt: skip
held = compiled(held, [types.void(*_KERNELS, *_ARGUMENTS)], nogil=True)
