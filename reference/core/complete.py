"""LU factors with complete pivoting, and solutions of least squares and least norm by them."""

from __future__ import annotations

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.algebra import substitute
from crossbody.reference.kinds import Array, Floats, Index

RANK = 1e-10  # part of a contact's own size below which a pivot is that of a row which depends on others


@compiled
def factor_complete(A: Floats, rows: int, columns: int, down: Index, across: Index, most: int) -> int:
    """LU factors with complete pivoting, in place; how many pivots are above RANK of the size 1 that rows have.

    Args:
        A: the matrix, overwritten by both factors; rows and columns as exchanged.
        rows: how many it has.
        columns: how many it has.
        down: which row stands where.
        across: which column stands where.
        most: pivots that are taken.
    """
    for a in range(rows):
        down[a] = a
    for b in range(columns):
        across[b] = b
    for c in range(min(rows, columns, most)):
        best, most_a, most_b = RANK, -1, -1
        for a in range(c, rows):
            for b in range(c, columns):
                if abs(A[a, b]) > best:
                    best, most_a, most_b = abs(A[a, b]), a, b
        if most_a < 0:
            return c
        if most_a != c:
            for b in range(columns):
                A[c, b], A[most_a, b] = A[most_a, b], A[c, b]
            down[c], down[most_a] = down[most_a], down[c]
        if most_b != c:
            for a in range(rows):
                A[a, c], A[a, most_b] = A[a, most_b], A[a, c]
            across[c], across[most_b] = across[most_b], across[c]
        for a in range(c + 1, rows):
            if A[a, c] != 0.0:
                A[a, c] /= A[c, c]
                for b in range(c + 1, columns):
                    A[a, b] -= A[a, c] * A[c, b]
    return min(rows, columns, most)


@compiled
def largest_left(A: Floats, rank: int, n: int) -> float:
    """Return the largest pivot that could be taken next of n rows, of which `factor_complete` has taken `rank`."""
    largest = 0.0
    for a in range(rank, n):
        for b in range(rank, n):
            largest = max(largest, abs(A[a, b]))
    return largest


@compiled
def factor_normal(B: Floats, n: int) -> None:
    """Overwrite a symmetric positive definite B, of which the lower triangle is given, by its Cholesky factor."""
    for i in range(n):
        for j in range(i + 1):
            total = B[i, j]
            for c in range(j):
                total -= B[i, c] * B[j, c]
            B[i, j] = np.sqrt(total) if i == j else total / B[j, j]


@compiled
def solve_normal(B: Floats, n: int, x: Array) -> None:
    """X := B^-1 x from the factor of `factor_normal`."""
    for i in range(n):
        for c in range(i):
            x[i] -= B[i, c] * x[c]
        x[i] /= B[i, i]
    for i in range(n - 1, -1, -1):
        for c in range(i + 1, n):
            x[i] -= B[c, i] * x[c]
        x[i] /= B[i, i]


@compiled
def solve_complete(
    A: Floats, n: int, rank: int, down: Index, across: Index, weight: Array, B: Floats, y: Array, x: Array
) -> None:
    """X := the solution of the system that `factor_complete` has factored, of least squares and of least norm.

    Args:
        A: the factors.
        n: size of the system.
        rank: of it.
        down: which row stands where.
        across: which column stands where.
        weight: (n,) squares of entries count over these.
        B: (n, n) scratch.
        y: (n,) scratch.
        x: right-hand side, overwritten.
    """
    for a in range(n):
        y[a] = x[down[a]]
    if rank == n:
        substitute(A, n, y)
        for c in range(n):
            x[across[c]] = y[c]
        return
    for a in range(rank):  # L^T L
        for b in range(a + 1):
            total = 0.0
            for c in range(a, n):
                total += (1.0 if c == a else A[c, a]) * (1.0 if c == b else A[c, b])
            B[a, b] = total
    for a in range(rank):  # L^T y, from above: what is still needed stands below
        total = y[a]
        for c in range(a + 1, n):
            total += A[c, a] * y[c]
        y[a] = total
    factor_normal(B, rank)
    solve_normal(B, rank, y)
    _least_norm(A, n, rank, across, weight, B, y)
    for c in range(n):
        total = 0.0
        for a in range(rank):
            total += B[a, c] * y[a]
        x[across[c]] = np.sqrt(weight[across[c]]) * total


@compiled
def _least_norm(A: Floats, n: int, rank: int, across: Index, weight: Array, Q: Floats, y: Array) -> None:
    """Leave x of U x = y with the least sum x^2 / W as sqrt(W) Q^T y, with the rows of U sqrt(W) made orthonormal in Q.

    The weights reach over twelve decades: the normal equations U W U^T have no digit for the lightest, and once leaves
    in what is light rounding of what is heavy.
    """
    for a in range(rank):
        for c in range(n):
            Q[a, c] = A[a, c] * np.sqrt(weight[across[c]]) if c >= a else 0.0
    orthonormalise(Q, rank, n, y)


@compiled
def orthonormalise(Q: Floats, rank: int, n: int, y: Array) -> None:
    """Make `rank` rows of Q orthonormal by Gram and Schmidt, twice, y with them: Q x = y has the same solutions."""
    for a in range(rank):
        for _ in range(2):
            for b in range(a):
                along = 0.0
                for c in range(n):
                    along += Q[a, c] * Q[b, c]
                for c in range(n):
                    Q[a, c] -= along * Q[b, c]
                y[a] -= along * y[b]
            size = 0.0
            for c in range(n):
                size += Q[a, c] * Q[a, c]
            size = np.sqrt(size)
            for c in range(n):
                Q[a, c] /= size
            y[a] /= size
