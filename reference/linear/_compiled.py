"""Derivatives at many points, compiled: complex steps through the kernels, several columns at a time.

The residual r of `_derivatives` depends on few coordinates in each of its components. Columns of dr/dx
that share no component are stepped together (Curtis, Powell and Reid 1974), so an arm of a robot costs
as much as all its arms. One more step, along a direction in which all columns differ, tells whether the
pattern held: the product with what was found must agree with it, or the point is given back as MISSED.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from crossbody.reference import kernels
from crossbody.reference.cache import compiled
from crossbody.reference.kinds import Array, Bytes, Floats, Index
from crossbody.reference.linear._blocks import invert_mass, mobility, resolve

STEP = 1e-30
AGREE = 1e-9  # part of the terms by which the product may differ
NOISE = 1e-13  # part of the largest row that rounding may leave in another
FOUND, ILL_POSED, MISSED = np.arange(3)


@compiled
def residual(
    M: Array, f: Array, H: Array, h: Array, drift: Array, v: Array, law: Floats, vd: Floats,
    lam: Floats, k: int, moves: bool, out: Floats,
) -> None:  # fmt: skip
    """Out (n + na,): imaginary parts of (M v' - f - H^T lam; H v' + H' v + a1 H v + (a0 + a2 h^2) h) over STEP.

    Where the inputs alone move, what depends on q and v has no such part: H, h and drift are not read.
    """
    na, n = H.shape
    for i in range(n):
        out[i] = -f[i].imag / STEP
    for a in range(na):
        out[n + a] = 0.0
    if not moves:
        return
    for i in range(n):
        b, total = i - i % k, -f[i].imag
        for c in range(k):
            total += M[i, c].imag * vd[b + c]
        for a in range(na):
            total -= H[a, i].imag * lam[a]
        out[i] = total / STEP
    for a in range(na):
        value = drift[a].imag + (law[a, 0] + 3.0 * law[a, 2] * h[a].real * h[a].real) * h[a].imag
        for i in range(n):
            value += H[a, i].imag * (vd[i] + law[a, 1] * v[i].real) + law[a, 1] * H[a, i].real * v[i].imag
        out[n + a] = value / STEP


@compiled
def spread(packed: Floats, colours: Index, pattern: Bytes, out: Floats) -> None:
    """Out (size, columns) from the columns that were stepped together."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = packed[colours[j], i] if pattern[i, j] else 0.0


@compiled
def agrees(J: Floats, probe: Floats, product: Floats) -> bool:
    """Whether J probe is the product, to AGREE of a row's terms; NOISE of the largest row is rounding in any."""
    largest = 0.0
    for i in range(len(product)):
        largest = max(largest, abs(product[i]))
    for i in range(J.shape[0]):
        total, size = 0.0, 0.0
        for j in range(J.shape[1]):
            term = J[i, j] * probe[j]
            total += term
            size += abs(term)
        if not abs(total - product[i]) <= AGREE * (size + abs(product[i])) + NOISE * largest:
            return False
    return True


@compiled
def steps(colours: Index, count: int, probe: Floats, n: int, na: int) -> tuple[Floats, Array, Array]:
    """Room for the residuals, the imaginary steps (count + 1, columns), and whether q or v move in them."""
    seeds = np.zeros((count + 1, len(colours)), np.complex128)
    for j in range(len(colours)):
        seeds[colours[j], j] = 1j * STEP
        seeds[count, j] = 1j * STEP * probe[j]
    moves = np.ones(count + 1, np.bool_)
    for c in range(1, count):
        moves[c] = np.any(seeds[c, : 2 * n] != 0.0)
    return np.zeros((count + 1, n + na)), seeds, moves


def tangents(
    dynamics: Any, rows: Any, k: int, t: float, X: Floats, P: Array, w: Array, law: Floats,
    idx: Index, colours: Index, count: int, pattern: Bytes, probe: Floats, vd: Floats,
    lam: Floats, out: Floats, codes: Index,
) -> None:  # fmt: skip
    """Accelerations, multipliers and their derivatives at every line of X.

    Args:
        dynamics: kernel, for complex numbers.
        rows: kernel, for complex numbers.
        k: size of the mass blocks.
        t: time, s.
        X: (N, 2 n + nu), q, v and u.
        P: parameters (1, np), or a line a point.
        w: scratch of the kernels.
        law: a0, a1, a2 of the active rows (na, 3).
        idx: the active rows.
        colours: which step each column of X belongs to.
        count: number of steps.
        pattern: (n + na, 2 n + nu), where dr/dx may differ from 0.
        probe: (2 n + nu,), direction of the check.
        vd: receives v' (N, n).
        lam: receives the multipliers (N, na).
        out: receives the derivatives of both (N, n + na, 2 n + nu).
        codes: receives FOUND, ILL_POSED or MISSED (N,).
    """
    n, na, columns = vd.shape[1], len(idx), X.shape[1]
    x, p = np.zeros(columns, np.complex128), np.zeros(P.shape[1], np.complex128)
    M, f = np.zeros((n, k), np.complex128), np.zeros(n, np.complex128)
    H, h, drift = np.zeros((na, n), np.complex128), np.zeros(na, np.complex128), np.zeros(na, np.complex128)
    W, G, right = np.zeros((n, k)), np.zeros((na, na)), np.zeros((n + na, 1))
    thin, free = np.zeros((n + na, 1)), np.zeros((n + na, columns))
    packed, seeds, moves = steps(colours, count, probe, n, na)
    q, v, u = x[:n], x[n : 2 * n], x[2 * n :]
    for s in range(len(X)):
        codes[s] = FOUND
        p[:] = P[min(s, len(P) - 1)]
        for c in range(count + 1):
            for j in range(columns):
                x[j] = X[s, j] + seeds[c, j]
            dynamics(t, q, v, u, p, M, f, w)
            if moves[c]:
                for a in range(na):
                    for i in range(n):
                        H[a, i] = 0.0
                rows(t, q, v, p, w, idx, na, H, h, drift)
            if c == 0:
                if invert_mass(M, W, k) != 0 or (na > 0 and mobility(H, W, k, G) != 0):
                    codes[s] = ILL_POSED
                    break
                right[:n, 0] = f.real
                for a in range(na):
                    value = drift[a] + (law[a, 0] + law[a, 2] * h[a] * h[a]) * h[a]
                    for i in range(n):
                        value += law[a, 1] * H[a, i] * v[i]
                    right[n + a, 0] = -value.real
                resolve(W, G, H, k, right, 1.0, thin)
                vd[s], lam[s] = right[:n, 0], right[n:, 0]
            residual(M, f, H, h, drift, v, law, vd[s], lam[s], k, moves[c], packed[c])
        if codes[s] == FOUND:
            spread(packed, colours, pattern, out[s])
            if not agrees(out[s], probe, packed[count]):
                codes[s] = MISSED
            resolve(W, G, H, k, out[s], -1.0, free)


_F, _F2, _F3 = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]
_I, _B2 = types.int64[::1], types.int8[:, ::1]
_C, _C2 = types.complex128[::1], types.complex128[:, ::1]
_KERNELS = tuple(types.FunctionType(kernels.COMPLEX[name]) for name in ("dynamics", "rows"))
_ARGUMENTS = (
    types.int64, types.float64, _F2, _C2, _C, _F2, _I, _I, types.int64, _B2, _F, _F2, _F2, _F3, _I,
)  # fmt: skip
tangents = compiled(tangents, [types.void(*_KERNELS, *_ARGUMENTS)], nogil=True)
