"""A case drawn at random: masses on springs near walls, M q'' = g - K q with gaps H q + c, started outside of all.

M, K and H are constant, so that its truth needs no integrator (`_linear_arcs`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from crossbody.cases import Case, Coordinate, Law, Parameter, Value
from crossbody.cases.arrays import Floats
from crossbody.reference import System, kernels
from crossbody.reports.suites._linear_arcs import LinearArcs

PARAMETERS = {
    "n": Parameter(default=2, doc="number of coordinates", low=1, high=3),
    "walls": Parameter(default=1, doc="number of walls; the first n exist", low=1, high=3),
    "draw": Parameter(default=0, doc="seed of everything that is not given here", low=0, high=2**32 - 1),
    "a0": Parameter(default=1e4, unit="1/s^2", doc="stiffness of the walls", low=0.0, open_low=True),
    "zeta": Parameter(default=0.1, doc="damping ratio of the walls", low=0.0),
    "stiffness": Parameter(default=5.0, unit="N/m", doc="scale of the springs", low=0.0, open_low=True),
    "t_end": Parameter(default=1.0, unit="s", doc="horizon", low=0.0, open_low=True),
}
VARIANTS: dict[str, dict[str, Value]] = {"outside": {}}


class Numbers(NamedTuple):
    """M (n, n) kg, K (n, n) N/m, g (n,) N, H (nc, n), c (nc,) m, q0 and v0 (n,)."""

    M: Floats
    K: Floats
    g: Floats
    H: Floats
    c: Floats
    q0: Floats
    v0: Floats


def numbers(parameters: Mapping[str, Value]) -> Numbers:
    """The system that a seed stands for."""
    n, walls = int(parameters["n"]), int(parameters["walls"])
    rng = np.random.default_rng(int(parameters["draw"]))
    A, B = rng.normal(size=(n, n)), rng.normal(size=(n, n))
    M = 0.3 * A @ A.T + np.diag(rng.uniform(0.5, 3.0, n))
    K = float(parameters["stiffness"]) * (B @ B.T + np.diag(rng.uniform(0.2, 1.0, n)))
    g, q0, v0 = 10.0 * rng.normal(size=n), 0.2 * rng.normal(size=n), 2.0 * rng.normal(size=n)
    H = rng.normal(size=(min(walls, n), n))  # more than n would be dependent where all touch
    H /= np.linalg.norm(H, axis=1)[:, None]
    return Numbers(M, K, g, H, rng.uniform(1e-3, 0.3, len(H)) - H @ q0, q0, v0)


# p = (M row by row, K row by row, g, c, H row by row)


@kernels.dynamics
def _dynamics(t: float, q: Any, v: Any, u: Any, p: Any, M: Any, f: Any, w: Any) -> None:
    n = len(q)
    for i in range(n):
        f[i] = p[2 * n * n + i]
        for j in range(n):
            M[i, j] = p[i * n + j]
            f[i] -= p[n * n + i * n + j] * q[j]


@kernels.gaps
def _gaps(t: float, q: Any, v: Any, p: Any, h: Any, hd: Any) -> None:
    n, nc = len(q), len(h)
    first = 2 * n * n + n
    for i in range(nc):
        h[i], hd[i] = p[first + i], 0.0
        for j in range(n):
            h[i] += p[first + nc + i * n + j] * q[j]
            hd[i] += p[first + nc + i * n + j] * v[j]


@kernels.rows
def _rows(t: float, q: Any, v: Any, p: Any, w: Any, idx: Any, na: int, H: Any, h: Any, Hdv: Any) -> None:
    n = len(q)
    first = 2 * n * n + n
    nc = (len(p) - first) // (n + 1)
    for k in range(na):
        i = idx[k]
        h[k], Hdv[k] = p[first + i], 0.0
        for j in range(n):
            H[k, j] = p[first + nc + i * n + j]
            h[k] += H[k, j] * q[j]


@kernels.energy
def _energy(q: Any, v: Any, p: Any, e: Any) -> None:
    n = len(q)
    e[0], e[1] = 0.0, 0.0
    for i in range(n):
        e[1] -= p[2 * n * n + i] * q[i]
        for j in range(n):
            e[0] += 0.5 * v[i] * p[i * n + j] * v[j]
            e[1] += 0.5 * q[i] * p[n * n + i * n + j] * q[j]


def from_numbers(p: Floats, n: int, law: Law) -> System:
    """The equations of n coordinates; every number is a parameter, so that one compilation serves all."""
    named = {f"p{i}": float(value) for i, value in enumerate(p)}
    return System(
        n=n, parameters=named, a0=law.a0, a1=law.a1, constant_mass=True,
        dynamics=_dynamics, gaps=_gaps, rows=_rows, energy=_energy,
    )  # fmt: skip


def system(parameters: Mapping[str, Value], law: Law) -> System:
    """The equations of a case."""
    x = numbers(parameters)
    return from_numbers(np.concatenate([np.ravel(part) for part in (x.M, x.K, x.g, x.c, x.H)]), len(x.M), law)


def build(variant: str, parameters: Mapping[str, Value]) -> Case:
    """The scene with its truth."""
    x = numbers(parameters)
    a0 = np.full(len(x.H), float(parameters["a0"]))
    a1 = 2.0 * float(parameters["zeta"]) * np.sqrt(a0)
    law = Law(a0=a0, a1=a1, a2=np.zeros(len(a0)), unilateral=np.ones(len(a0), dtype=np.bool_))
    t_end = float(parameters["t_end"])
    return Case(
        name="springs_and_walls", variant=variant, title="masses on springs near walls", mechanism=__file__,
        parameters=parameters, coordinates=tuple(Coordinate(name=f"q{i}", unit="m") for i in range(len(x.M))),
        contacts=tuple(f"wall {i}" for i in range(len(a0))), q0=x.q0, v0=x.v0, t_end=t_end, law=law,
        closed_form=LinearArcs(x.M, x.K, x.g, x.H, x.c, x.q0, x.v0, a0, a1, t_end),
    )  # fmt: skip
