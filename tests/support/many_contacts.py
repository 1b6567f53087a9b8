"""Mechanisms with several contacts and with discrete variables, for the tests of many contacts."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import System, kernels

# Balls on a vertical line above a floor: p = (gravity m/s^2, masses kg); row i between ball i and what is below it.


@kernels.dynamics
def _tower_dynamics(t: float, q: Any, v: Any, u: Any, p: Any, M: Any, f: Any, w: Any) -> None:
    for i in range(len(q)):
        M[i, 0] = p[1 + i]
        f[i] = -p[1 + i] * p[0]


@kernels.gaps
def _tower_gaps(t: float, q: Any, v: Any, p: Any, h: Any, hd: Any) -> None:
    h[0], hd[0] = q[0], v[0]
    for i in range(1, len(q)):
        h[i], hd[i] = q[i] - q[i - 1], v[i] - v[i - 1]


@kernels.rows
def _tower_rows(t: float, q: Any, v: Any, p: Any, w: Any, idx: Any, na: int, H: Any, h: Any, Hdv: Any) -> None:
    for j in range(na):
        i = idx[j]
        H[j, :] = 0.0
        H[j, i] = 1.0
        h[j], Hdv[j] = q[i], 0.0
        if i > 0:
            H[j, i - 1] = -1.0
            h[j] = q[i] - q[i - 1]


@kernels.rows
def _few_entries(t: float, q: Any, v: Any, p: Any, w: Any, idx: Any, na: int, H: Any, h: Any, Hdv: Any) -> None:
    """As `_tower_rows`, without the zeros."""
    for j in range(na):
        i = idx[j]
        H[j, i] = 1.0
        h[j], Hdv[j] = q[i], 0.0
        if i > 0:
            H[j, i - 1] = -1.0
            h[j] = q[i] - q[i - 1]


@kernels.energy
def _tower_energy(q: Any, v: Any, p: Any, e: Any) -> None:
    e[0], e[1] = 0.0, 0.0
    for i in range(len(q)):
        e[0] = e[0] + 0.5 * p[1 + i] * v[i] * v[i]
        e[1] = e[1] + p[1 + i] * p[0] * q[i]


def tower(masses: list[float], gravity: float = 9.81, b0: float = 1e6, zeta: float = 0.1, zeros: bool = True) -> System:
    """Balls of no size above each other and a floor at 0; every contact bounces. `zeros`: whether rows write theirs."""
    n = len(masses)
    return System(
        n=n, mass_block=1, parameters=[gravity, *masses], a0=np.ones(n), a1=1.0, b0=b0, b1=2.0 * zeta * b0**0.5,
        dynamics=_tower_dynamics, gaps=_tower_gaps, rows=_tower_rows if zeros else _few_entries, energy=_tower_energy,
        constant_mass=True,
    )  # fmt: skip


# A box on a floor: q = (x, y, th), p = (mass kg, inertia kg m^2, half width a, half height b m, gravity m/s^2).


@kernels.dynamics
def _box_dynamics(t: float, q: Any, v: Any, u: Any, p: Any, M: Any, f: Any, w: Any) -> None:
    M[0, 0], M[1, 0], M[2, 0] = p[0], p[0], p[1]
    f[0], f[1], f[2] = 0.0, -p[0] * p[4], 0.0


@kernels.gaps
def _box_gaps(t: float, q: Any, v: Any, p: Any, h: Any, hd: Any) -> None:
    s, c = np.sin(q[2]), np.cos(q[2])
    for i in range(2):
        a = p[2] * (2 * i - 1)
        h[i] = q[1] + a * s - p[3] * c
        hd[i] = v[1] + (a * c + p[3] * s) * v[2]


@kernels.rows
def _box_rows(t: float, q: Any, v: Any, p: Any, w: Any, idx: Any, na: int, H: Any, h: Any, Hdv: Any) -> None:
    s, c = np.sin(q[2]), np.cos(q[2])
    for j in range(na):
        a = p[2] * (2 * idx[j] - 1)
        H[j, 0], H[j, 1], H[j, 2] = 0.0, 1.0, a * c + p[3] * s
        h[j] = q[1] + a * s - p[3] * c
        Hdv[j] = (p[3] * c - a * s) * v[2] * v[2]


@kernels.energy
def _box_energy(q: Any, v: Any, p: Any, e: Any) -> None:
    e[0] = 0.5 * (p[0] * (v[0] * v[0] + v[1] * v[1]) + p[1] * v[2] * v[2])
    e[1] = p[0] * p[4] * q[1]


def box(half_height: float, *, zeta: float, b0: float = 1e6, gravity: float = 9.81) -> System:
    """A uniform box of 1 kg and half width 0.1 m whose two lower corners touch the floor y = 0."""
    inertia = (0.1**2 + half_height**2) / 3.0
    return System(
        n=3, mass_block=1, parameters=[1.0, inertia, 0.1, half_height, gravity], a0=[1.0, 1.0], a1=1.0, b0=b0,
        b1=2.0 * zeta * b0**0.5, dynamics=_box_dynamics, gaps=_box_gaps, rows=_box_rows, energy=_box_energy,
        constant_mass=True,
    )  # fmt: skip


# A mass between two marks: p = (force N, low, high m, bound m; direction, passages; speed m/s at the last passage). At
# a mark the force turns round, and a drag pulls towards the speed kept; beyond the bound the run is lost.


@kernels.dynamics
def _shuttle_dynamics(t: float, q: Any, v: Any, u: Any, p: Any, M: Any, f: Any, w: Any) -> None:
    M[0, 0] = 1.0
    f[0] = p[0] * p[4] - 0.1 * (v[0] - p[6])


@kernels.watch
def _shuttle_watch(t: float, q: Any, v: Any, p: Any, g: Any) -> None:
    g[0] = p[2] - q[0]
    g[1] = q[0] - p[1]
    g[2] = p[3] - q[0]


@kernels.switch
def _shuttle_switch(t: float, q: Any, v: Any, p: Any, mode: Any, fired: int) -> int:
    if fired == 2:
        return 2
    direction = p[4]
    if fired == kernels.START:
        p[4] = 1.0
    elif fired == 0:
        p[4] = -1.0
    elif fired == 1:
        p[4] = 1.0
    if fired >= 0:
        p[5] += 1.0
        p[6] = v[0]
    return 1 if p[4] != direction or fired >= 0 else 0


@kernels.energy
def _shuttle_energy(q: Any, v: Any, p: Any, e: Any) -> None:
    e[0], e[1] = 0.5 * v[0] * v[0], 0.0


def shuttle(bound: float = 1e3) -> System:
    """A unit mass driven to and fro between marks at -0.2 and 0.3 m; beyond `bound` it is lost."""
    return System(
        n=1, parameters=[1.0, -0.2, 0.3, bound], discrete=[0.0, 0.0], latched=1, guards=3,
        dynamics=_shuttle_dynamics, energy=_shuttle_energy, watch=_shuttle_watch, switch=_shuttle_switch,
    )  # fmt: skip


# A mass above two floors of which one is there: p = (gravity m/s^2, height of the lower m; which, changes; speed).


@kernels.dynamics
def _trapdoor_dynamics(t: float, q: Any, v: Any, u: Any, p: Any, M: Any, f: Any, w: Any) -> None:
    M[0, 0] = 1.0
    f[0] = -p[0]


@kernels.gaps
def _trapdoor_gaps(t: float, q: Any, v: Any, p: Any, h: Any, hd: Any) -> None:
    for i in range(2):
        h[i], hd[i] = 1.0, 0.0
    if p[2] == 0.0:
        h[0], hd[0] = q[0], v[0]
    else:
        h[1], hd[1] = q[0] - p[1], v[0]


@kernels.rows
def _trapdoor_rows(t: float, q: Any, v: Any, p: Any, w: Any, idx: Any, na: int, H: Any, h: Any, Hdv: Any) -> None:
    for j in range(na):
        H[j, 0], Hdv[j] = 1.0, 0.0
        h[j] = q[0] if idx[j] == 0 else q[0] - p[1]


@kernels.energy
def _trapdoor_energy(q: Any, v: Any, p: Any, e: Any) -> None:
    e[0], e[1] = 0.5 * v[0] * v[0], p[0] * q[0]


@kernels.switch
def _trapdoor_switch(t: float, q: Any, v: Any, p: Any, mode: Any, fired: int) -> int:
    """Count what rows do to the speed since the count before; at the fourth time the upper floor is gone."""
    if fired != kernels.TOUCHED or p[2] != 0.0 or abs(v[0] - p[4]) < 0.1:
        return 0
    p[3] += 1.0
    p[4] = v[0]
    if p[3] >= 4.0:
        p[2] = 1.0
        mode[0] = 0
    return 1


def trapdoor(b0: float = 0.0) -> System:
    """A ball bounces on a floor that opens at the fourth change of its speed, and falls on the one below."""
    return System(
        n=1, parameters=[9.81, -0.5], discrete=[0.0, 0.0], latched=1, a0=[1e4, 1e4], a1=20.0, b0=b0, b1=0.2 * b0**0.5,
        dynamics=_trapdoor_dynamics, gaps=_trapdoor_gaps, rows=_trapdoor_rows, energy=_trapdoor_energy,
        switch=_trapdoor_switch,
    )  # fmt: skip


# Two floors at one place that exchange roles whenever a row switches: nothing ever settles.


@kernels.switch
def _restless_switch(t: float, q: Any, v: Any, p: Any, mode: Any, fired: int) -> int:
    if fired != kernels.TOUCHED:
        return 0
    p[2] = 1.0 - p[2]
    mode[:] = 0
    return 1


def restless() -> System:
    """A ball that falls on floors of which the one it touches vanishes and the other appears."""
    return System(
        n=1, parameters=[9.81, 0.0], discrete=[0.0, 0.0], latched=1, a0=[1e4, 1e4], a1=20.0,
        dynamics=_trapdoor_dynamics, gaps=_trapdoor_gaps, rows=_trapdoor_rows, energy=_trapdoor_energy,
        switch=_restless_switch,
    )  # fmt: skip


# Constant M and H: p = (M row by row, H row by row, gap offsets, force).


@kernels.dynamics
def _constant_dynamics(t: float, q: Any, v: Any, u: Any, p: Any, M: Any, f: Any, w: Any) -> None:
    n = len(q)
    for i in range(n):
        for j in range(n):
            M[i, j] = p[i * n + j]
        f[i] = p[len(p) - n + i]


@kernels.gaps
def _constant_gaps(t: float, q: Any, v: Any, p: Any, h: Any, hd: Any) -> None:
    n, nc = len(q), len(h)
    for i in range(nc):
        h[i] = p[n * n + nc * n + i]
        hd[i] = 0.0
        for j in range(n):
            h[i] = h[i] + p[n * n + i * n + j] * q[j]
            hd[i] = hd[i] + p[n * n + i * n + j] * v[j]


@kernels.rows
def _constant_rows(t: float, q: Any, v: Any, p: Any, w: Any, idx: Any, na: int, H: Any, h: Any, Hdv: Any) -> None:
    n = len(q)
    nc = (len(p) - n * n - n) // (n + 1)
    for k in range(na):
        i = idx[k]
        h[k], Hdv[k] = p[n * n + nc * n + i], 0.0
        for j in range(n):
            H[k, j] = p[n * n + i * n + j]
            h[k] = h[k] + H[k, j] * q[j]


@kernels.energy
def _constant_energy(q: Any, v: Any, p: Any, e: Any) -> None:
    n = len(q)
    e[0], e[1] = 0.0, 0.0
    for i in range(n):
        for j in range(n):
            e[0] = e[0] + 0.5 * v[i] * p[i * n + j] * v[j]
        e[1] = e[1] - p[len(p) - n + i] * q[i]


def constant(M: Any, H: Any, offsets: Any, force: Any, *, zeta: float, b0: float = 1e6) -> System:
    """M q'' = force beside planes H q + offsets >= 0; every row bounces."""
    return System(
        n=len(M), parameters=np.concatenate([np.ravel(M), np.ravel(H), offsets, force]), a0=np.ones(len(H)), a1=1.0,
        b0=b0, b1=2.0 * zeta * b0**0.5, dynamics=_constant_dynamics, gaps=_constant_gaps, rows=_constant_rows,
        energy=_constant_energy,
    )  # fmt: skip
