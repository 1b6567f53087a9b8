"""The saddle matrix of a mechanism by the blocks of its mass matrix, compiled: inverses and solves in place."""

from __future__ import annotations

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.kinds import Array, Floats

RANK = 1e-14  # a pivot below this part of its diagonal is a lost rank


@compiled
def invert(A: Floats, n: int) -> int:
    """The inverse of a symmetric positive definite matrix in its place; 1 if it is not one."""
    for c in range(n):
        A_cc = A[c, c]
        if not A_cc > 0.0:
            return 1
        inverse = 1.0 / A_cc
        A[c, c] = 1.0
        for j in range(n):
            A[c, j] *= inverse
        for i in range(n):
            if i != c:
                factor = A[i, c]
                A[i, c] = 0.0
                for j in range(n):
                    A[i, j] -= factor * A[c, j]
    return 0


@compiled
def invert_mass(M: Array, W: Floats, k: int) -> int:
    """Inverses W (n, k) of the real parts of the blocks of M; 1 if one has none."""
    n = len(W)
    for b in range(0, n, k):
        for i in range(k):
            for j in range(k):
                W[b + i, j] = M[b + i, j].real
        if invert(W[b : b + k], k) != 0:
            return 1
    for i in range(n):
        if not W[i, i % k] * M[i, i % k].real < 1.0 / RANK:
            return 1
    return 0


@compiled
def add(factor: float, x: Floats, out: Floats) -> None:
    """Out += factor x, without temporaries."""
    for j in range(len(x)):
        out[j] += factor * x[j]


@compiled
def divide(W: Floats, k: int, x: Floats, out: Floats) -> None:
    """Out (n, m) = M^-1 x by blocks."""
    for i in range(len(x)):
        b = i - i % k
        for j in range(x.shape[1]):
            out[i, j] = W[i, 0] * x[b, j]
        for c in range(1, k):
            add(W[i, c], x[b + c], out[i])


@compiled
def mobility(H: Array, W: Floats, k: int, G: Floats) -> int:
    """G = (H M^-1 H^T)^-1; 1 if the rows are dependent."""
    na, n = H.shape
    row = np.empty(n)
    size = np.empty(na)
    for a in range(na):
        for i in range(n):
            b, total = i - i % k, 0.0
            for c in range(k):
                total += W[i, c] * H[a, b + c].real
            row[i] = total
        for b in range(a + 1):
            total = 0.0
            for i in range(n):
                total += row[i] * H[b, i].real
            G[a, b] = total
            G[b, a] = total
        size[a] = G[a, a]
    if invert(G, na) != 0:
        return 1
    for a in range(na):
        if not G[a, a] * size[a] < 1.0 / RANK:
            return 1
    return 0


@compiled
def resolve(W: Floats, G: Floats, H: Array, k: int, S: Floats, sign: float, free: Floats) -> None:
    """S (n + na, m) := sign K^-1 S with K = [[M, -H^T], [H, 0]], M^-1 = W, (H M^-1 H^T)^-1 = G; free is scratch."""
    na, n = H.shape
    divide(W, k, S[:n], free[:n])
    for a in range(na):
        for i in range(n):
            if H[a, i].real != 0.0:
                add(-H[a, i].real, free[i], S[n + a])
    for a in range(na):
        lam = free[n + a]
        for j in range(len(lam)):
            lam[j] = G[a, 0] * S[n, j]
        for b in range(1, na):
            add(G[a, b], S[n + b], lam)
    for a in range(na):
        for i in range(n):
            if H[a, i].real != 0.0:
                add(H[a, i].real, free[n + a], S[i])
    divide(W, k, S[:n], free[:n])
    for i in range(n + na):
        for j in range(S.shape[1]):
            S[i, j] = sign * free[i, j]
