"""Small dense eliminations, compiled: what rows admit, and small motions projected on it."""

from __future__ import annotations

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.kinds import Array, Floats, Index

LOST = 1e-10  # a pivot below this part of the largest is a lost rank


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
        if not best > LOST * largest:
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
def projected(T: Floats, F: Floats, first: int, out: Floats, place: int) -> None:
    """Columns place.. of out (m, ...) = T^T F T, F the n columns of the given ones from `first` on."""
    n, m = T.shape
    out[:, place : place + m] = 0.0
    for i in range(n):
        for b in range(m):
            total = 0.0
            for j in range(n):
                total += F[i, first + j] * T[j, b]
            for a in range(m):
                out[a, place + b] += T[i, a] * total


@compiled
def first_order(T: Floats, mass: Floats, F: Floats, A: Floats) -> int:
    """A (2 m, 2 m) of (y, y') from (T^T M T) y'' = (T^T F T) (y, y'), F (n, 2 n); 1 if T^T M T has no inverse."""
    n, m = T.shape
    R, order = np.zeros((m, 3 * m)), np.empty(m, np.int64)
    projected(T, mass, 0, R, 0)
    projected(T, F, 0, R, m)
    projected(T, F, n, R, 2 * m)
    if eliminate(R, m, order) != 0:
        return 1
    for a in range(m):
        A[a, m + a] = 1.0
        for b in range(2 * m):
            A[m + a, b] = R[order[a], m + b]
    return 0
