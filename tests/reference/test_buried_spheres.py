"""A sphere whose centre is inside a solid: a run that ends by it says which pair it is and what to do."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody.cases import Outcome, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape
from crossbody.reference import simulate
from crossbody.reference._blame import STUCK
from crossbody.reference.tree.system import system

SOLIDS = {"box": (0.5, 0.4, 0.3), "cylinder": (0.4, 0.3, 0.0)}


def shot(kind: str, v: list[float], margin: float, **given: object) -> Trajectory:
    """Return the motion of a ball that falls on a solid at a velocity, m/s, with a law so soft that it sinks in."""
    pair = Pair(name="hit", first="ball", second="solid", margin=margin, friction=(0.6, 0.6, 0, 0, 0), dimension=3,
                law=RowLaw(a0=100.0, a1=10.0))  # fmt: skip
    scene = Scene(
        bodies=(Body(name="ball", mass=1.0, inertia=(0.01, 0.01, 0.01, 0.0, 0.0, 0.0)),),
        joints=(Joint(name="free", body="ball", type="free"),),
        shapes=(Shape(name="solid", type=kind, size=SOLIDS[kind]), Shape(name="ball", body="ball", size=(0.1, 0, 0))),
        pairs=(pair,), gravity=(0.0, 0.0, 0.0),
    )  # fmt: skip
    q0 = [0.03, 0.02, 0.45 + margin, 1.0, 0.0, 0.0, 0.0]
    return simulate(system(scene, case_of(scene).law), q0, [*v, 0, 0, 0], 1.0, rtol=1e-7, time_limit=20.0, **given)


def inside(kind: str, at: np.ndarray) -> bool:
    """Return whether a point is inside a solid, or no farther from it than rounding."""
    a, b, c = SOLIDS[kind]
    if kind == "box":
        return bool((np.abs(at) <= np.array(SOLIDS[kind]) + 1e-10).all())
    return bool(np.hypot(*at[:2]) <= a + 1e-10 and abs(at[2]) <= b + 1e-10 and c == 0.0)


@pytest.mark.parametrize("solver", ["compiled", "cvode"])
@pytest.mark.parametrize("seed", range(15))
@pytest.mark.parametrize("kind", SOLIDS)
def test_a_run_that_ends_with_a_sphere_in_a_solid_says_so(kind: str, seed: int, solver: str) -> None:
    """Some end by themselves, where the side that is nearest changes, others after a few steps; only these say so."""
    rng = np.random.default_rng(seed)
    v, margin = [*rng.uniform(-5.0, 5.0, 2), -rng.uniform(1.0, 8.0)], rng.choice([0.0, 0.05])
    given = {} if solver == "compiled" else {"solver": solver}
    run = shot(kind, v, margin, max_steps=int(rng.integers(10, 4000)), **given)
    told = "the centre of the sphere of pair 'hit' (row 0) is inside the solid" in run.message
    assert told == (run.outcome in STUCK and inside(kind, run.q[-1, :3]) and bool(run.lam[-1, 0]))
    assert told == ("a stiffer law of the pair (a0, a1)" in run.message)
    assert not (told and "loosen" in run.message)


def test_a_step_that_falls_to_nothing_in_a_solid_does() -> None:
    run = shot("cylinder", [4.431, 0.113, -7.881], 0.0)
    assert run.outcome is Outcome.STEP_TOO_SMALL
    assert "No tolerance helps: keep the centre outside" in run.message
