"""Random springs and walls as plain systems, from the numbers of the stress suite."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import crossbody.reports.suites
from crossbody.cases import Law, load
from crossbody.cases.loading import module

CASE = str(Path(next(iter(crossbody.reports.suites.__path__))) / "_springs_and_walls.py")


@cache
def suite() -> Any:
    """The suite's module: its kernels are loaded once, not for every draw."""
    return module(CASE)


def parameters_outside(seed: int, stream: int = 14) -> dict[str, Any]:
    """Parameters of a case started outside of all its walls."""
    rng = np.random.default_rng([stream, seed])
    return {
        "n": int(rng.integers(1, 4)), "walls": int(rng.integers(1, 4)), "draw": int(rng.integers(2**32)),
        "a0": 10.0 ** rng.uniform(2.0, 5.0), "zeta": rng.uniform(0.0, 1.0) * rng.choice([0, 1, 1]),
        "stiffness": 10.0 ** rng.uniform(0.0, 1.5),
    }  # fmt: skip


def outside(seed: int, stream: int = 14) -> Any:
    """Such a case, with its exact truth."""
    return load(CASE, "outside", **parameters_outside(seed, stream))


def system_of(case: Any) -> Any:
    """The equations of a case."""
    return suite().system(case.parameters, case.law)


def springs(M: Any, K: Any, g: Any, H: Any, c: Any, a0: float, a1: float) -> Any:
    """The system M q'' = g - K q beside walls h = H q + c that all have the same constants."""
    rows = len(H)
    law = Law(a0=np.full(rows, a0), a1=np.full(rows, a1), a2=np.zeros(rows), unilateral=np.ones(rows, dtype=bool))
    return suite().from_numbers(np.concatenate([np.ravel(part) for part in (M, K, g, c, H)]), len(M), law)


def beside(x: Any, a0: float, a1: float, order: Any) -> Any:
    """The system of `Numbers` with its rows in another order."""
    return springs(x.M, x.K, x.g, x.H[order], x.c[order], a0, a1)


def inside(seed: int) -> tuple[Any, float, float]:
    """Numbers of a start inside two or three walls at once, and their law."""
    rng = np.random.default_rng([15, seed])
    given = {"n": 3, "walls": int(rng.integers(2, 4)), "draw": int(rng.integers(2**32)), "stiffness": 5.0}
    x = suite().numbers(given)
    deep = 10.0 ** rng.uniform(-4.0, -1.0, len(x.H))
    a0 = 10.0 ** rng.uniform(2.0, 5.0)
    return x._replace(c=-deep - x.H @ x.q0), a0, 2.0 * rng.uniform(0.0, 1.0) * np.sqrt(a0)


def mirrored(seed: int) -> tuple[Any, float, float]:
    """The same of two pairs of walls, mirrored at the space in which the motion starts."""
    rng = np.random.default_rng([17, seed])
    zero = np.zeros((2, 2))

    def block() -> Any:
        parts = [A @ A.T + np.diag(rng.uniform(0.3, 2.0, 2)) for A in rng.normal(size=(2, 2, 2))]
        return np.block([[parts[0], zero], [zero, parts[1]]])

    along, across = rng.normal(size=(2, 2, 2))
    H = np.block([[along, across], [along, -across]])
    q0, v0, g = (np.r_[scale * rng.normal(size=2), 0.0, 0.0] for scale in (0.2, 2.0, 10.0))
    deep, a0 = 10.0 ** rng.uniform(-4.0, -1.0, 2), 10.0 ** rng.uniform(2.0, 5.0)
    x = suite().Numbers(block(), 5.0 * block(), g, H, -np.r_[deep, deep] - H @ q0, q0, v0)
    return x, a0, 2.0 * rng.uniform(0.0, 1.0) * np.sqrt(a0)


def known() -> tuple[Any, list[float], list[float]]:
    """A wall that is left below its surface, and catches again for a moment between the nodes of a step; its start."""
    x = suite().Numbers(
        M=np.array([[2.4391139709528056, -0.004530601845406151], [-0.004530601845406151, 2.2658772052392204]]),
        K=np.array([[5.136513058901176, -4.760670286514174], [-4.760670286514174, 20.084126160464503]]),
        g=np.array([21.20470166161674, -9.417156246292292]), H=np.array([[0.7088735823598663, -0.39017693281020477]]),
        c=np.array([0.2688827215161717]), q0=np.array([-0.057749456753125546, 0.20910899512972803]),
        v0=np.array([-1.9686455140418901, 0.6577546379401609]),
    )  # fmt: skip
    return beside(x, 9326.338848429898, 19.31459432494496, [0]), x.q0.tolist(), x.v0.tolist()


def drawn(seed: int) -> tuple[Any, list[float], list[float]]:
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
    return beside(suite().Numbers(M, K, g, H, c, q0, v0), a0, a1, slice(None)), q0.tolist(), v0.tolist()
