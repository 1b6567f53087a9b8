"""Small mechanisms for the tests, each with closed-form answers."""

import numpy as np

from crossbody.reference import System, kernels
from crossbody.reference.systems import ball as ball_kernels


def ball(a0=100.0, a1=20.0, a2=1e6, gravity=9.81, mass=1.0, **more):
    """The bouncing ball of the spec; `listing` by default."""
    return System(
        n=1, parameters=[mass, gravity], a0=[a0], a1=[a1], a2=a2, constant_mass=True,
        affine=True, **more, **ball_kernels.KERNELS,
    )  # fmt: skip


@kernels.dynamics
def _oscillator_dynamics(t, q, v, u, p, M, f, w):
    M[0, 0] = 1.0
    f[0] = -p[0] * q[0]


@kernels.gaps
def _oscillator_gaps(t, q, v, p, h, hd):
    h[0] = q[0] - p[1]
    hd[0] = v[0]


@kernels.rows
def _oscillator_rows(t, q, v, p, w, idx, na, H, h, Hdv):
    for j in range(na):
        H[j, 0] = 1.0
        h[j] = q[0] - p[1]
        Hdv[j] = 0.0


@kernels.energy
def _oscillator_energy(q, v, p, e):
    e[0] = 0.5 * v[0] * v[0]
    e[1] = 0.5 * p[0] * q[0] * q[0]


def oscillator(wall, stiffness=1.0, a0=1e4, a1=20.0):
    """q'' = -stiffness q beside a wall at q = wall: gap q - wall."""
    return System(
        n=1, parameters=[stiffness, wall], a0=[a0], a1=[a1], dynamics=_oscillator_dynamics,
        gaps=_oscillator_gaps, rows=_oscillator_rows, energy=_oscillator_energy,
    )  # fmt: skip


@kernels.dynamics
def _flyby_dynamics(t, q, v, u, p, M, f, w):
    M[0, 0] = 1.0
    M[1, 0] = 1.0
    f[0] = 0.0
    f[1] = -p[1]


@kernels.gaps
def _flyby_gaps(t, q, v, p, h, hd):
    rho = np.sqrt(q[0] * q[0] + q[1] * q[1])
    h[0] = rho - p[0]
    hd[0] = (q[0] * v[0] + q[1] * v[1]) / rho


@kernels.rows
def _flyby_rows(t, q, v, p, w, idx, na, H, h, Hdv):
    rho = np.sqrt(q[0] * q[0] + q[1] * q[1])
    rate = (q[0] * v[0] + q[1] * v[1]) / rho
    for j in range(na):
        H[j, 0] = q[0] / rho
        H[j, 1] = q[1] / rho
        h[j] = rho - p[0]
        Hdv[j] = (v[0] * v[0] + v[1] * v[1] - rate * rate) / rho


@kernels.energy
def _flyby_energy(q, v, p, e):
    e[0] = 0.5 * (v[0] * v[0] + v[1] * v[1])
    e[1] = p[1] * q[1]


def flyby(radius, gravity=0.0, a0=1e4, a1=20.0, unilateral=True):
    """A planar point mass past a circle about the origin; bilateral, it is a pendulum."""
    return System(
        n=2, mass_block=1, parameters=[radius, gravity], a0=[a0], a1=[a1], unilateral=unilateral,
        dynamics=_flyby_dynamics, gaps=_flyby_gaps, rows=_flyby_rows, energy=_flyby_energy,
    )  # fmt: skip


@kernels.dynamics
def _sliders_dynamics(t, q, v, u, p, M, f, w):
    for i in range(len(q)):
        M[i, 0] = p[i]
        f[i] = 0.0


@kernels.gaps
def _sliders_gaps(t, q, v, p, h, hd):
    for i in range(len(q) - 1):
        h[i] = q[i + 1] - q[i]
        hd[i] = v[i + 1] - v[i]


@kernels.rows
def _sliders_rows(t, q, v, p, w, idx, na, H, h, Hdv):
    for j in range(na):
        i = idx[j]
        H[j, i] = -1.0
        H[j, i + 1] = 1.0
        h[j] = q[i + 1] - q[i]
        Hdv[j] = 0.0


@kernels.energy
def _sliders_energy(q, v, p, e):
    e[0] = 0.0
    for i in range(len(q)):
        e[0] = e[0] + 0.5 * p[i] * v[i] * v[i]
    e[1] = 0.0


def sliders(n, a0=1e6, a1=0.0, masses=None):
    """Point masses on a line, gap i between i and i + 1."""
    return System(
        n=n, mass_block=1, parameters=np.ones(n) if masses is None else masses,
        a0=np.full(n - 1, a0), a1=a1, constant_mass=True, affine=True,
        dynamics=_sliders_dynamics, gaps=_sliders_gaps, rows=_sliders_rows, energy=_sliders_energy,
    )  # fmt: skip
