"""Masses and springs of any size with linear rows: M v' = g - K q - D v + B u, h = H q + c, all constant."""

import numpy as np

from crossbody.reference import System, kernels


@kernels.dynamics
def dynamics(t, q, v, u, p, M, f, w):
    n, nu = len(q), len(u)
    first = 1 + int(p[0].real) * (n + 1)
    for i in range(n):
        f[i] = p[first + i]
        for j in range(n):
            M[i, j] = p[first + n + i * n + j]
            f[i] -= p[first + n + n * n + i * n + j] * q[j] + p[first + n + 2 * n * n + i * n + j] * v[j]
        for j in range(nu):
            f[i] += p[first + n + 3 * n * n + i * nu + j] * u[j]


@kernels.gaps
def gaps(t, q, v, p, h, hd):
    n, nc = len(q), len(h)
    for i in range(nc):
        h[i], hd[i] = p[1 + nc * n + i], 0.0
        for j in range(n):
            h[i] += p[1 + i * n + j] * q[j]
            hd[i] += p[1 + i * n + j] * v[j]


@kernels.rows
def rows(t, q, v, p, w, idx, na, H, h, Hdv):
    n, nc = len(q), int(p[0].real)
    for a in range(na):
        i = idx[a]
        h[a], Hdv[a] = p[1 + nc * n + i], 0.0
        for j in range(n):
            H[a, j] = p[1 + i * n + j]
            h[a] += p[1 + i * n + j] * q[j]


def linear_rows(M, H, c, a0, a1, *, g=None, K=None, D=None, B=None, **more):
    """The system of these matrices; what is not given is zero."""
    n, nc = len(M), len(H)
    g, K, D = (np.zeros(shape) if given is None else given for given, shape in ((g, n), (K, (n, n)), (D, (n, n))))
    B = np.zeros((n, 0)) if B is None else np.asarray(B)
    parts = (H, c, g, M, K, D, B)
    return System(
        n=n, inputs=B.shape[1], dynamics=dynamics, gaps=gaps, rows=rows, a0=np.full(nc, a0), a1=a1,
        parameters=np.concatenate([[nc], *(np.ravel(part) for part in parts)]), **more,
    )  # fmt: skip
