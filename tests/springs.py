"""Random springs and walls as plain systems, from the numbers of the stress suite."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import crossbody.reports.suites
from crossbody.cases import Law, load
from crossbody.cases._load import module

CASE = str(Path(next(iter(crossbody.reports.suites.__path__))) / "_springs_and_walls.py")


def outside(seed: int) -> Any:
    """A case started outside of all its walls, with its exact truth."""
    rng = np.random.default_rng([14, seed])
    return load(
        CASE, "outside", n=int(rng.integers(1, 4)), walls=int(rng.integers(1, 4)), draw=int(rng.integers(2**32)),
        a0=10.0 ** rng.uniform(2.0, 5.0), zeta=rng.uniform(0.0, 1.0) * rng.choice([0, 1, 1]),
        stiffness=10.0 ** rng.uniform(0.0, 1.5),
    )  # fmt: skip


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
