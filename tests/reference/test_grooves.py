"""What another contact bears may vanish while a slip turns before its stop, however slow that is by then."""

from __future__ import annotations

import numpy as np
import pytest
from friction_scenes import pair

from crossbody.cases import Outcome
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, RowLaw, Scene, Shape
from crossbody.reference import simulate
from crossbody.reference.tree.system import system

RADIUS, LASTS = 0.1, 0.4  # m, s


def groove(seed: int) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Draw a ball that falls into a groove of two planes, one rougher than the other."""
    rng = np.random.default_rng([seed, 58])
    law = RowLaw(a0=10.0 ** rng.uniform(4, 5), a1=10.0 ** rng.uniform(1, 2))
    half, frictions = 0.5 * rng.uniform(0.5, 1.1), (rng.uniform(0.05, 0.3), rng.uniform(0.8, 1.5))
    shapes = (
        *(Shape(name=name, type="plane", orientation=(float(np.cos(half)), sign * float(np.sin(half)), 0.0, 0.0))
          for name, sign in (("left", 1.0), ("right", -1.0))),
        Shape(name="ball", body="ball", type="sphere", size=(RADIUS, 0, 0)),
    )  # fmt: skip
    pairs = tuple(pair(name, "ball", float(mu), law) for name, mu in zip(("left", "right"), frictions, strict=True))
    mass = float(rng.uniform(0.5, 2.0))
    body = Body(name="ball", mass=mass, inertia=(*(0.4 * mass * RADIUS**2,) * 3, 0, 0, 0))
    scene = Scene(
        bodies=(body,), joints=(Joint(name="free", body="ball", type="free"),), shapes=shapes, pairs=pairs,
        gravity=(2.0, 0.0, -9.6),
    )  # fmt: skip
    q = np.array([0.0, 0.0, RADIUS / np.cos(2.0 * half) + 0.01, 1.0, 0.0, 0.0, 0.0])
    return scene, q, np.r_[rng.normal(size=3) * 0.5, rng.normal(size=3) * 3.0]


SLOW = [pytest.param(seed, marks=pytest.mark.slow) for seed in range(4, 120) if seed != 44]


@pytest.mark.parametrize("seed", [*range(4), 44, *SLOW])
def test_what_lets_go_before_a_stop_does_so_at_every_tolerance(seed: int) -> None:
    scene, q, v = groove(seed)
    made = system(scene, case_of(scene).law, q)
    found = [simulate(made, q, v, LASTS, rtol=rtol, samples=[LASTS]) for rtol in (1e-7, 1e-9, 1e-11)]
    assert all(one.outcome is Outcome.FINISHED for one in found), [one.message for one in found]
    for one, rtol in zip(found[:2], (1e-7, 1e-9), strict=True):
        until = min(one.unique_until, one.determined_until)
        if until >= LASTS:
            assert np.abs(one.v[-1] - found[2].v[-1]).max() <= 2e5 * rtol, (rtol, len(one.events), len(found[2].events))
