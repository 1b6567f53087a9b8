"""Flywheels on three links whose chain is closed: a planar four-bar that folds flat where its lengths allow it."""

import numpy as np

from crossbody.reference import System, kernels


@kernels.dynamics
def dynamics(t, q, v, u, p, M, f, w):
    for i in range(3):
        M[i, 0] = p[4 + i]
        f[i] = 0.0
    f[0] = p[7]


@kernels.gaps
def gaps(t, q, v, p, h, hd):
    h[0], h[1] = -p[3], 0.0
    hd[0] = hd[1] = 0.0
    for i in range(3):
        h[0] += p[i] * np.cos(q[i])
        h[1] += p[i] * np.sin(q[i])
        hd[0] -= p[i] * np.sin(q[i]) * v[i]
        hd[1] += p[i] * np.cos(q[i]) * v[i]


@kernels.rows
def rows(t, q, v, p, w, idx, na, H, h, Hdv):
    for j in range(na):
        h[j] = -p[3] if idx[j] == 0 else 0.0
        Hdv[j] = 0.0
        for i in range(3):
            s, c = p[i] * np.sin(q[i]), p[i] * np.cos(q[i])
            if idx[j] == 0:
                H[j, i] = -s
                h[j] += c
                Hdv[j] -= c * v[i] * v[i]
            else:
                H[j, i] = c
                h[j] += s
                Hdv[j] -= s * v[i] * v[i]


@kernels.energy
def energy(q, v, p, e):
    e[0], e[1] = 0.0, 0.0
    for i in range(3):
        e[0] += 0.5 * p[4 + i] * v[i] * v[i]
    e[1] = -p[7] * q[0]


def four_bar(lengths=(1.0, 2.0, 1.0), ground=2.0, inertia=(1.0, 0.7, 1.3), torque=0.0, pole=20.0):
    """Links of these lengths, the last of which ends at (ground, 0); angles are absolute."""
    return System(
        n=3, mass_block=1, dynamics=dynamics, gaps=gaps, rows=rows, energy=energy, unilateral=False,
        parameters=[*lengths, ground, *inertia, torque], a0=[pole**2] * 2, a1=2.0 * pole,
    )  # fmt: skip


def assembled(system, crank, guess=(0.0, 0.0)):
    """Angles with the first link at `crank`, by Newton from a guess of the others, and rates for a unit rate of it."""
    q = np.array([crank, *guess])
    for _ in range(50):
        H, h, _ = system.constraint(q)
        q[1:] -= np.linalg.solve(H[:, 1:], h)
    H = system.constraint(q)[0]
    return q, np.array([1.0, *np.linalg.solve(H[:, 1:], -H[:, 0])])
