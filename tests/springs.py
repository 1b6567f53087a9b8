"""Random springs and walls as plain systems, from the numbers of the stress suite."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import crossbody.reports.suites
from crossbody.cases import Law, load
from crossbody.cases._load import module

CASE = str(Path(next(iter(crossbody.reports.suites.__path__))) / "_springs_and_walls.py")


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
    return module(CASE).system(case.parameters, case.law)


def beside(x: Any, a0: float, a1: float, order: Any) -> Any:
    """The system of `Numbers` with its rows in another order."""
    kernels, rows = module(CASE), len(x.H)
    parts = (x.M, x.K, x.g, x.c[order], x.H[order])
    law = Law(a0=np.full(rows, a0), a1=np.full(rows, a1), a2=np.zeros(rows), unilateral=np.ones(rows, dtype=bool))
    return kernels.from_numbers(np.concatenate([np.ravel(part) for part in parts]), len(x.M), law)


def inside(seed: int) -> tuple[Any, float, float]:
    """Numbers of a start inside two or three walls at once, and their law."""
    rng = np.random.default_rng([15, seed])
    given = {"n": 3, "walls": int(rng.integers(2, 4)), "draw": int(rng.integers(2**32)), "stiffness": 5.0}
    x = module(CASE).numbers(given)
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
    x = module(CASE).Numbers(block(), 5.0 * block(), g, H, -np.r_[deep, deep] - H @ q0, q0, v0)
    return x, a0, 2.0 * rng.uniform(0.0, 1.0) * np.sqrt(a0)
