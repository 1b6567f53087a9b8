"""Linear algebra of the constrained step: block-diagonal mass matrix, Schur complement of the active rows.

The mass matrix is stored as M (n, k): row i holds row i of its own k x k block on the diagonal. `above` (n,) is the
nearest lower coordinate of the block that each one is coupled to, -1 for none: the one before it in a full block, the
parent in a tree. M is factored as L^T D L from the last coordinate to the first, which fills nothing in (Featherstone,
Rigid Body Dynamics Algorithms, 2008, section 6.5): the cost is the tree's depth, not its size.
"""

from __future__ import annotations

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.kinds import Array, Bytes, Floats, Index

ULP = 2.3e-16
ROUNDING = 1e-13  # part of the largest term of a sum that rounding may make of the sum
RANK = 1e-14  # a pivot below this part of its diagonal is a lost rank
DEPENDENT = 1e-10  # a pivot below it is that of a row which depends on the rows before, where that may be


@compiled
def copy(source: Array, target: Array) -> None:
    """Target := source, without the test for overlap that an assignment of slices makes."""
    for i in range(len(target)):
        target[i] = source[i]


@compiled
def all_finite(x: Array) -> bool:
    """Whether no entry is NaN or infinite: one such makes the sum of x - x, else 0, NaN.

    Four sums side by side: one alone waits for itself at every entry.
    """
    a, b, c, d, whole = 0.0, 0.0, 0.0, 0.0, len(x) // 4
    for k in range(whole):
        i = 4 * k
        a += x[i] - x[i]
        b += x[i + 1] - x[i + 1]
        c += x[i + 2] - x[i + 2]
        d += x[i + 3] - x[i + 3]
    for i in range(4 * whole, len(x)):
        a += x[i] - x[i]
    return a + b + c + d == 0.0


@compiled
def factor_mass(M: Floats, L: Floats, above: Index, n: int, k: int) -> int:
    """Fill L with the factors of every block, 1/D on its diagonal; 1 if one is not positive definite."""
    for b in range(0, n, k):
        for i in range(b, b + k):
            c = i
            while c >= 0:
                L[i, c - b] = M[i, c - b]
                c = above[c]
        for i in range(b + k - 1, b - 1, -1):
            if not L[i, i - b] > RANK * M[i, i - b]:  # so that NaN fails too
                return 1
            inverse = 1.0 / L[i, i - b]
            L[i, i - b] = inverse
            c = above[i]
            while c >= 0:
                part = L[i, c - b] * inverse
                a = c
                while a >= 0:
                    L[c, a - b] -= part * L[i, a - b]
                    a = above[a]
                L[i, c - b] = part
                c = above[c]
    return 0


@compiled
def solve_mass(L: Floats, x: Array, above: Index, k: int, first: int, last: int) -> None:
    """X := M^-1 x, in place, for the blocks from coordinate `first` up to `last`."""
    for b in range(first, last, k):
        for i in range(b + k - 1, b - 1, -1):
            value = x[i]
            if value != 0.0:  # most entries of a row are
                c = above[i]
                while c >= 0:
                    x[c] -= L[i, c - b] * value
                    c = above[c]
        for i in range(b, b + k):
            value = x[i] * L[i, i - b]
            c = above[i]
            while c >= 0:
                value -= L[i, c - b] * x[c]
                c = above[c]
            x[i] = value


@compiled
def _subtract_row(X: Floats, a: int, part: float, b: int, count: int) -> None:
    """Row a of X less `part` times its row b, in the first `count` columns."""
    for j in range(count):
        X[a, j] -= part * X[b, j]


@compiled
def solve_columns(L: Floats, X: Floats, above: Index, first: int, shift: int, n: int, count: int) -> None:
    """X := M^-1 X, in place, for `count` columns of X, of which row 0 belongs to coordinate `first`.

    Args:
        L: factors of M.
        X: right-hand sides, overwritten.
        above: nearest lower coordinate that M couples each one to.
        first: first of the coordinates, which are whole trees in one block.
        shift: which one of its block that is.
        n: how many coordinates.
        count: how many columns.
    """
    for i in range(n - 1, -1, -1):
        c = above[first + i] - first
        while c >= 0:
            _subtract_row(X, c, L[first + i, shift + c], i, count)
            c = above[first + c] - first
    for i in range(n):
        part = L[first + i, shift + i]
        for j in range(count):
            X[i, j] *= part
        c = above[first + i] - first
        while c >= 0:
            _subtract_row(X, i, L[first + i, shift + c], c, count)
            c = above[first + c] - first


@compiled
def factor_schur(G: Floats, na: int, reach: Index, idx: Index, shares: Bytes) -> int:
    """Cholesky factor of the Schur complement in its lower triangle.

    Row i begins at column reach[i]: what stands before is zero and stays zero, so a chain's factor is a band. A row
    that depends on those before it, and may, has an infinite pivot: whatever is solved for gives it no multiplier.

    Args:
        G: the Schur complement, overwritten.
        na: its size.
        reach: first column of every row.
        idx: which row of the system stands where.
        shares: whether a row of the system may depend on others.

    Returns:
        Number of rows that depend on those before them; -1 if one does that may not.
    """
    dependent = 0
    for i in range(na):
        for j in range(reach[i], i + 1):
            total = G[i, j]
            for m in range(max(reach[i], reach[j]), j):
                total -= G[i, m] * G[j, m]
            if i == j:
                if not total > DEPENDENT * G[i, i]:
                    if shares[idx[i]] and abs(total) <= DEPENDENT * G[i, i]:
                        total = np.inf
                        dependent += 1
                    elif not total > RANK * G[i, i]:
                        return -1
                G[i, i] = np.sqrt(total)
            else:
                G[i, j] = total / G[j, j]
    return dependent


@compiled
def solve_schur(G: Floats, na: int, reach: Index, r: Array, x: Array) -> None:
    """X = G^-1 r from the factor of `factor_schur`."""
    for i in range(na):
        total = r[i]
        for m in range(reach[i], i):
            total -= G[i, m] * x[m]
        x[i] = total / G[i, i]
    for i in range(na - 1, -1, -1):
        x[i] /= G[i, i]
        for m in range(reach[i], i):
            x[m] -= G[i, m] * x[i]


@compiled
def inverse_diagonal(G: Floats, na: int, reach: Index, i: int, x: Array) -> float:
    """(G^-1)_ii from the factor of `factor_schur`; x is scratch."""
    total = 0.0
    for j in range(i, na):
        part = 1.0 if j == i else 0.0
        for m in range(max(i, reach[j]), j):
            part -= G[j, m] * x[m]
        x[j] = part / G[j, j]
        total += x[j] * x[j]
    return total


@compiled
def factor_lu(A: Floats, n: int, pivot: Index) -> int:
    """LU factors with partial pivoting, in place; 1 if singular."""
    for c in range(n):
        best = c
        for i in range(c + 1, n):
            if abs(A[i, c]) > abs(A[best, c]):
                best = i
        pivot[c] = best
        if not abs(A[best, c]) > 0.0:
            return 1
        if best != c:
            for j in range(n):
                A[c, j], A[best, j] = A[best, j], A[c, j]
        for i in range(c + 1, n):
            A[i, c] /= A[c, c]
            for j in range(c + 1, n):
                A[i, j] -= A[i, c] * A[c, j]
    return 0


@compiled
def solve_lu(A: Floats, n: int, pivot: Index, x: Array) -> None:
    """X := A^-1 x, in place; rows were exchanged with all that stood in them, so that every exchange comes first."""
    for c in range(n):
        x[c], x[pivot[c]] = x[pivot[c]], x[c]
    substitute(A, n, x)


@compiled
def substitute(A: Floats, n: int, x: Array) -> None:
    """X := (L U)^-1 x, in place, of both factors in A, of which L has ones on its diagonal."""
    for c in range(n):
        for i in range(c + 1, n):
            x[i] -= A[i, c] * x[c]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            x[i] -= A[i, j] * x[j]
        x[i] /= A[i, i]
