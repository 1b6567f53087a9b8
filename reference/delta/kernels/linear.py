"""Linear algebra on 3 x 3 blocks held as tuples of rows: nothing is allocated.

The 6 x 6 system [[A, X], [X^T, B]] is factorised by blocks, A = L D L^T, Z = L^-1 X, B - Z^T D^-1
Z = L' D' L'^T.
"""

from __future__ import annotations

from typing import Any

from crossbody.reference import kernels

CONDITION = 1e10  # above this condition of H M^-1 H^T (1-norm) the multipliers are ill posed
_SUSPECT = 1e6


@kernels.helper
def dot(a: Any, b: Any) -> Any:
    """Scalar product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernels.helper
def times(M: Any, a: Any) -> Any:
    """M a."""
    return dot(M[0], a), dot(M[1], a), dot(M[2], a)


@kernels.helper
def transposed(M: Any) -> Any:
    """M^T."""
    return (M[0][0], M[1][0], M[2][0]), (M[0][1], M[1][1], M[2][1]), (M[0][2], M[1][2], M[2][2])


@kernels.helper
def plus(M: Any, N: Any, c: Any) -> Any:
    """M + c N."""
    return (
        (M[0][0] + c * N[0][0], M[0][1] + c * N[0][1], M[0][2] + c * N[0][2]),
        (M[1][0] + c * N[1][0], M[1][1] + c * N[1][1], M[1][2] + c * N[1][2]),
        (M[2][0] + c * N[2][0], M[2][1] + c * N[2][1], M[2][2] + c * N[2][2]),
    )


@kernels.helper
def diagonal(a: Any, b: Any, c: Any) -> Any:
    """Diag(a, b, c)."""
    z = 0.0 * a
    return (a, z, z), (z, b, z), (z, z, c)


@kernels.helper
def outer(a: Any, b: Any, c: Any) -> Any:
    """C a b^T."""
    x, y, z = c * a[0], c * a[1], c * a[2]
    return (x * b[0], x * b[1], x * b[2]), (y * b[0], y * b[1], y * b[2]), (z * b[0], z * b[1], z * b[2])


@kernels.helper
def cross(a: Any, b: Any) -> Any:
    """Vector product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernels.helper
def factor3(M: Any) -> Any:
    """L D L^T of a symmetric M: (l21, l31, l32), D, 1/D."""
    d1 = M[0][0]
    i1 = 1.0 / d1
    l21, l31 = M[1][0] * i1, M[2][0] * i1
    d2 = M[1][1] - l21 * M[1][0]
    i2 = 1.0 / d2
    below = M[2][1] - l31 * M[1][0]
    l32 = below * i2
    d3 = M[2][2] - l31 * M[2][0] - l32 * below
    return (l21, l31, l32), (d1, d2, d3), (i1, i2, 1.0 / d3)


@kernels.helper
def down(L: Any, b: Any) -> Any:
    """L^-1 b."""
    y = b[1] - L[0] * b[0]
    return b[0], y, b[2] - L[1] * b[0] - L[2] * y


@kernels.helper
def up(L: Any, b: Any) -> Any:
    """L^-T b."""
    y = b[1] - L[2] * b[2]
    return b[0] - L[0] * y - L[1] * b[2], y, b[2]


@kernels.helper
def scaled(i: Any, b: Any) -> Any:
    """Diag(i) b."""
    return i[0] * b[0], i[1] * b[1], i[2] * b[2]


@kernels.helper
def factor6(A: Any, X: Any, B: Any) -> Any:
    """Factors of [[A, X], [X^T, B]]: those of A, the rows of Z^T, those of the Schur complement."""
    F = factor3(A)
    columns = transposed(X)
    Zt = down(F[0], columns[0]), down(F[0], columns[1]), down(F[0], columns[2])
    x, y, z = scaled(F[2], Zt[0]), scaled(F[2], Zt[1]), scaled(F[2], Zt[2])
    return F, Zt, factor3(plus(B, (times(Zt, x), times(Zt, y), times(Zt, z)), -1.0))


@kernels.helper
def solve6(F6: Any, a: Any, b: Any) -> Any:
    """The two halves of the solution for the right-hand side (a, b)."""
    F, Zt, S = F6
    y = scaled(F[2], down(F[0], a))
    x2 = up(S[0], scaled(S[2], down(S[0], _minus(b, times(Zt, y)))))
    back = scaled(F[2], times(transposed(Zt), x2))
    return up(F[0], _minus(y, back)), x2


@kernels.helper
def _minus(a: Any, b: Any) -> Any:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernels.helper
def _size(a: Any) -> Any:
    return abs(a[0]) + abs(a[1]) + abs(a[2])


@kernels.helper
def ill_posed(F6: Any, A: Any, X: Any, B: Any) -> bool:
    """Whether the condition exceeds CONDITION. The pivots tell at once unless they are far apart."""
    d, e = F6[0][1], F6[2][1]
    low = min(d[0], d[1], d[2], e[0], e[1], e[2])
    total = d[0] + d[1] + d[2] + e[0] + e[1] + e[2]
    if not (low > 0.0 and total < 1e300):  # written so that NaN is ill posed
        return True
    return low * _SUSPECT < total and not condition6(F6, A, X, B) <= CONDITION


@kernels.helper
def condition6(F6: Any, A: Any, X: Any, B: Any) -> float:
    """Condition in the 1-norm, from the six columns of the matrix and of its inverse."""
    norm, inverse = 0.0, 0.0
    columns = transposed(X)
    for j in range(3):
        e = (1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2))
        norm = max(norm, _size(A[j]) + _size(X[j]), _size(columns[j]) + _size(B[j]))
        x, y = solve6(F6, e, (0.0, 0.0, 0.0))
        inverse = max(inverse, _size(x) + _size(y))
        x, y = solve6(F6, (0.0, 0.0, 0.0), e)
        inverse = max(inverse, _size(x) + _size(y))
    return norm * inverse
