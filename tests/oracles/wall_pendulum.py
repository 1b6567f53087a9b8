"""A point mass on a rod of fixed length beside a wall: one bilateral row, one unilateral, a force and a drag."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import System, kernels

# p = (mass kg, gravity m/s^2, length m, wall m, drag N s/m)


@kernels.dynamics
def _dynamics(t: float, q: Any, v: Any, u: Any, p: Any, M: Any, f: Any, w: Any) -> None:
    M[0, 0] = p[0]
    M[1, 0] = p[0]
    f[0] = u[0] - p[4] * v[0]
    f[1] = -p[0] * p[1] - p[4] * v[1]


@kernels.gaps
def _gaps(t: float, q: Any, v: Any, p: Any, h: Any, hd: Any) -> None:
    rho = np.sqrt(q[0] * q[0] + q[1] * q[1])
    h[0], hd[0] = rho - p[2], (q[0] * v[0] + q[1] * v[1]) / rho
    h[1], hd[1] = p[3] - q[0], -v[0]


@kernels.rows
def _rows(t: float, q: Any, v: Any, p: Any, w: Any, idx: Any, na: int, H: Any, h: Any, Hdv: Any) -> None:
    rho = np.sqrt(q[0] * q[0] + q[1] * q[1])
    rate = (q[0] * v[0] + q[1] * v[1]) / rho
    for j in range(na):
        if idx[j] == 0:
            H[j, 0], H[j, 1] = q[0] / rho, q[1] / rho
            h[j], Hdv[j] = rho - p[2], (v[0] * v[0] + v[1] * v[1] - rate * rate) / rho
        else:
            H[j, 0], H[j, 1] = -1.0, 0.0
            h[j], Hdv[j] = p[3] - q[0], 0.0


@kernels.energy
def _energy(q: Any, v: Any, p: Any, e: Any) -> None:
    e[0] = 0.5 * p[0] * (v[0] * v[0] + v[1] * v[1])
    e[1] = p[0] * p[1] * q[1]


@kernels.power
def _power(t: float, q: Any, v: Any, u: Any, p: Any, e: Any) -> None:
    e[0] = u[0] * v[0]
    e[1] = p[4] * (v[0] * v[0] + v[1] * v[1])


def wall_pendulum(
    wall: float, *, pole: float = 20.0, a0: float = 1e4, a1: float = 40.0, drag: float = 0.0, **more: Any
) -> System:
    """A rod of 1 m, 2 kg at its end, the wall at x = wall; a force along x is the only input."""
    return System(
        n=2, mass_block=1, inputs=1, parameters=[2.0, 9.81, 1.0, wall, drag],
        a0=[pole**2, a0], a1=[2.0 * pole, a1], unilateral=[False, True],
        dynamics=_dynamics, gaps=_gaps, rows=_rows, energy=_energy, power=_power, **more,
    )  # fmt: skip
