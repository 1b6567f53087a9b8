"""Kernels of a bead on a line, as they should be."""

from __future__ import annotations

import numpy as np

from crossbody.reference import kernels


@kernels.dynamics
def _dynamics(t, q, v, u, p, M, f, w):
    for i in range(3):
        for j in range(3):
            M[i, j] = p[0] * (2.0 if i == j else 0.5 * np.cos(q[2]))
        f[i] = -p[1] * q[i] - 0.1 * v[i]


@kernels.gaps
def _gaps(t, q, v, p, h, hd):
    h[0] = p[1] - q[0] + p[2] * q[1] * q[1] + np.sin(q[2])
    hd[0] = -v[0] + 2.0 * p[2] * q[1] * v[1] + np.cos(q[2]) * v[2]


@kernels.rows
def _rows(t, q, v, p, w, idx, na, H, h, Hdv):
    for j in range(na):
        H[j, 0], H[j, 1], H[j, 2] = -1.0, 2.0 * p[2] * q[1], np.cos(q[2])
        h[j] = p[1] - q[0] + p[2] * q[1] * q[1] + np.sin(q[2])
        Hdv[j] = 2.0 * p[2] * v[1] * v[1] - np.sin(q[2]) * v[2] * v[2]


@kernels.energy
def _energy(q, v, p, e):
    e[0] = e[1] = 0.5 * v[0] * v[0]


GOOD = {"dynamics": _dynamics, "gaps": _gaps, "rows": _rows, "energy": _energy}
