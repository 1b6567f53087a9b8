"""What the tests of the red body share."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody import engines
from crossbody.cases import Case, Mode, Trajectory, load
from crossbody.cases.mechanisms.red_body.order import STAGES, stages_in_order
from crossbody.reference import System
from crossbody.reference.systems import red_body as kernels

REFERENCE = engines.load("reference")
ALL = len(STAGES)


def numbers(case: Case) -> dict[str, float]:
    return {k: float(v) for k, v in case.parameters.items()}


def system_of(case: Case) -> System:
    return kernels.build(case.parameters, case.law)


def run(case: Case, **settings: Any) -> Trajectory:
    found: Trajectory = REFERENCE.prepare(case, "compiled", **settings).run()
    assert found.outcome.ok, found.message
    return found


def order(variant: str = "resolved", **changes: float) -> int:
    return stages_in_order(run(load("red_body", variant, **changes)).events)


def instants(found: Trajectory) -> list[tuple[int, Mode, float]]:
    return [(e.contact, e.after, e.t) for e in found.events]


def random_states() -> list[tuple[np.ndarray, np.ndarray]]:
    """Positions and velocities (6,) of any size and turn."""
    draw = np.random.default_rng(4)
    return [(draw.normal(size=6), draw.normal(size=6)) for _ in range(20)]
