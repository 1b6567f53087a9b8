"""A mass on springs beside a rippled wall, h = c + H q + s sin(k q): far sharper than the steps of its free motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import System, kernels

# p = (spring, force x, force y, c, H x, H y, s, k x, k y)


@kernels.dynamics
def _dynamics(t: float, q: Any, v: Any, u: Any, p: Any, M: Any, f: Any, w: Any) -> None:
    for i in range(2):
        M[i, 0], f[i] = 1.0, p[1 + i] - p[0] * q[i]


@kernels.gaps
def _gaps(t: float, q: Any, v: Any, p: Any, h: Any, hd: Any) -> None:
    angle, slope = p[7] * q[0] + p[8] * q[1], p[7] * v[0] + p[8] * v[1]
    h[0] = p[3] + p[4] * q[0] + p[5] * q[1] + p[6] * np.sin(angle)
    hd[0] = p[4] * v[0] + p[5] * v[1] + p[6] * np.cos(angle) * slope


@kernels.rows
def _rows(t: float, q: Any, v: Any, p: Any, w: Any, idx: Any, na: int, H: Any, h: Any, Hdv: Any) -> None:
    angle, slope = p[7] * q[0] + p[8] * q[1], p[7] * v[0] + p[8] * v[1]
    for j in range(na):
        for i in range(2):
            H[j, i] = p[4 + i] + p[6] * np.cos(angle) * p[7 + i]
        h[j] = p[3] + p[4] * q[0] + p[5] * q[1] + p[6] * np.sin(angle)
        Hdv[j] = -p[6] * np.sin(angle) * slope * slope


def rippled(seed: int) -> tuple[System, Any, Any]:
    """A random one, started outside."""
    rng = np.random.default_rng([19, seed])
    q0, v0 = 0.2 * rng.normal(size=2), 10.0 ** rng.uniform(0.0, 1.0) * rng.normal(size=2)
    H, k, s = rng.normal(size=2), rng.uniform(2.0, 40.0) * rng.normal(size=2), rng.uniform(0.02, 0.3)
    c = rng.uniform(0.01, 0.3) - H @ q0 - s * np.sin(k @ q0)
    parameters = [10.0 ** rng.uniform(0.0, 2.0), *(10.0 * rng.normal(size=2)), c, *H, s, *k]
    a0 = 10.0 ** rng.uniform(2.0, 5.0)
    system = System(
        n=2, mass_block=1, parameters=parameters, a0=[a0], a1=2.0 * rng.uniform(0.0, 0.5) * a0**0.5,
        dynamics=_dynamics, gaps=_gaps, rows=_rows,
    )  # fmt: skip
    return system, q0, v0
