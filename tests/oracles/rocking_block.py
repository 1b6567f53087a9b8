"""A rigid block on the floor: two corners that strike and press, and two rows that hold them against sliding."""

import numpy as np

from crossbody.reference import System, kernels

WIDTH, HEIGHT = 0.1, 0.2  # m, half of the block's sides


@kernels.dynamics
def dynamics(t, q, v, u, p, M, f, w):
    M[0, 0] = M[1, 0] = p[0]
    M[2, 0] = p[1]
    f[0] = p[3] * np.sin(p[4] * t) - p[5] * v[0]
    f[1] = -p[0] * p[2]
    f[2] = p[6] * np.cos(p[4] * t) - p[7] * v[2] * v[2] * v[2]


@kernels.gaps
def gaps(t, q, v, p, h, hd):
    s, c = np.sin(q[2]), np.cos(q[2])
    for i in range(2):
        x = (2.0 * i - 1.0) * p[8]
        h[i] = q[1] + x * s - p[9] * c
        hd[i] = v[1] + (x * c + p[9] * s) * v[2]
        h[i + 2] = q[0] + x * c + p[9] * s
        hd[i + 2] = v[0] + (-x * s + p[9] * c) * v[2]


@kernels.rows
def rows(t, q, v, p, w, idx, na, H, h, Hdv):
    s, c = np.sin(q[2]), np.cos(q[2])
    for j in range(na):
        i = idx[j] % 2
        x = (2.0 * i - 1.0) * p[8]
        if idx[j] < 2:
            H[j, 1] = 1.0
            H[j, 2] = x * c + p[9] * s
            h[j] = q[1] + x * s - p[9] * c
            Hdv[j] = (-x * s + p[9] * c) * v[2] * v[2]
        else:
            H[j, 0] = 1.0
            H[j, 2] = -x * s + p[9] * c
            h[j] = q[0] + x * c + p[9] * s
            Hdv[j] = (-x * c - p[9] * s) * v[2] * v[2]


@kernels.energy
def energy(q, v, p, e):
    e[0] = 0.5 * p[0] * (v[0] * v[0] + v[1] * v[1]) + 0.5 * p[1] * v[2] * v[2]
    e[1] = p[0] * p[2] * q[1]


def block(
    slip=1e5, a0=1e4, a1=200.0, b0=1e8, b1=2e3, force=0.0, torque=0.0, rate=10.0, drag=0.0, damping=0.0, width=WIDTH
):
    """The block; a corner's slip row (slip 1/s) follows its normal row."""
    mass = 1.0
    inertia = mass * (width**2 + HEIGHT**2) / 3.0
    return System(
        n=3, mass_block=1, dynamics=dynamics, gaps=gaps, rows=rows, energy=energy,
        parameters=[mass, inertia, 9.81, force, rate, drag, torque, damping, width, HEIGHT],
        a0=[a0, a0, 0.0, 0.0], a1=[a1, a1, slip, slip], b0=[b0, b0, 0.0, 0.0], b1=[b1, b1, 0.0, 0.0],
        follows=[-1, -1, 0, 1],
    )  # fmt: skip
