"""Random springs beside random walls: M q'' = g - K q, h = H q + c, for the searches of events."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import System, kernels

# p = (M row by row, K row by row, g, H row by row, c)


@kernels.dynamics
def _dynamics(t: float, q: Any, v: Any, u: Any, p: Any, M: Any, f: Any, w: Any) -> None:
    n = len(q)
    for i in range(n):
        f[i] = p[2 * n * n + i]
        for j in range(n):
            M[i, j] = p[i * n + j]
            f[i] = f[i] - p[n * n + i * n + j] * q[j]


@kernels.gaps
def _gaps(t: float, q: Any, v: Any, p: Any, h: Any, hd: Any) -> None:
    n, nc = len(q), len(h)
    first = 2 * n * n + n
    for i in range(nc):
        h[i], hd[i] = p[first + nc * n + i], 0.0
        for j in range(n):
            h[i] = h[i] + p[first + i * n + j] * q[j]
            hd[i] = hd[i] + p[first + i * n + j] * v[j]


@kernels.rows
def _rows(t: float, q: Any, v: Any, p: Any, w: Any, idx: Any, na: int, H: Any, h: Any, Hdv: Any) -> None:
    n = len(q)
    first = 2 * n * n + n
    nc = (len(p) - first) // (n + 1)
    for k in range(na):
        h[k], Hdv[k] = p[first + nc * n + idx[k]], 0.0
        for j in range(n):
            H[k, j] = p[first + idx[k] * n + j]
            h[k] = h[k] + H[k, j] * q[j]


@kernels.energy
def _energy(q: Any, v: Any, p: Any, e: Any) -> None:
    n = len(q)
    e[0], e[1] = 0.0, 0.0
    for i in range(n):
        e[1] = e[1] - p[2 * n * n + i] * q[i]
        for j in range(n):
            e[0] = e[0] + 0.5 * v[i] * p[i * n + j] * v[j]
            e[1] = e[1] + 0.5 * q[i] * p[n * n + i * n + j] * q[j]


def springs(M: Any, K: Any, g: Any, H: Any, c: Any, a0: float, a1: float) -> System:
    """One system; all walls have the same constants."""
    H = np.atleast_2d(H)
    parameters = np.concatenate([np.ravel(M), np.ravel(K), np.ravel(g), np.ravel(H), np.ravel(c)])
    return System(
        n=len(np.ravel(g)), parameters=parameters, a0=np.full(len(H), a0), a1=a1, constant_mass=True,
        dynamics=_dynamics, gaps=_gaps, rows=_rows, energy=_energy,
    )  # fmt: skip


def drawn(seed: int) -> tuple[System, list[float], list[float]]:
    """A random system and a start outside of its walls: up to three coordinates and as many walls."""
    rng = np.random.default_rng([14, seed])
    n = int(rng.integers(1, 4))
    nc = int(rng.integers(1, n + 1))  # no more than coordinates: all of them may press at once
    root, spring = rng.normal(size=(n, n)), rng.normal(size=(n, n))
    M, K = root @ root.T + np.eye(n), 10.0 ** rng.uniform(0.0, 2.0) * (spring @ spring.T / n + 0.1 * np.eye(n))
    g, H, c = 10.0 * rng.normal(size=n), rng.normal(size=(nc, n)), rng.uniform(0.02, 0.5, nc)
    a0 = 10.0 ** rng.uniform(2.0, 5.0)
    a1 = 10.0 ** rng.uniform(-2.0, 0.3) * a0**0.5
    q0, v0 = 0.2 * rng.normal(size=n), 2.0 * rng.normal(size=n)
    while (H @ q0 + c <= 0.0).any():
        q0 *= 0.5
    return springs(M, K, g, H, c, a0, a1), q0.tolist(), v0.tolist()


def known() -> tuple[System, list[float], list[float]]:
    """A wall that is left below its surface and met again in a window between the nodes of one long step."""
    M = [[2.4391139709528056, -0.004530601845406151], [-0.004530601845406151, 2.2658772052392204]]
    K = [[5.136513058901176, -4.760670286514174], [-4.760670286514174, 20.084126160464503]]
    system = springs(
        M, K, [21.20470166161674, -9.417156246292292], [0.7088735823598663, -0.39017693281020477], [0.2688827215161717],
        9326.338848429898, 19.31459432494496,
    )  # fmt: skip
    return system, [-0.057749456753125546, 0.20910899512972803], [-1.9686455140418901, 0.6577546379401609]
