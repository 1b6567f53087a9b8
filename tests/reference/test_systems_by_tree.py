"""Kernels written by hand against those of every scene: the same equations, and the same motion."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import Case, Mode
from crossbody.cases.scene_contacts import law_of
from crossbody.engines.equations import builder
from crossbody.reference import System, simulate
from crossbody.reference.tree.system import system

CASES = ("bouncing_ball", "newtons_cradle", "red_body")
KNOWN = [(name, variant) for name in CASES for variant in cases.variants(name)]
ROUNDING = 1e-12
"""Of sums of products, over the largest of their terms."""
each_variant = pytest.mark.parametrize(("name", "variant"), KNOWN)


def both(case: Case) -> tuple[System, System]:
    build = builder(case.mechanism)
    assert build is not None
    assert case.scene is not None
    return build(case.parameters, case.law), system(case.scene, case.law, case.q0)


def close(mine: Any, theirs: Any, size: float = 1.0) -> bool:
    return bool(
        np.abs(np.asarray(mine) - theirs).max(initial=0.0) <= ROUNDING * max(size, np.abs(theirs).max(initial=0))
    )


@each_variant
def test_equations_are_those_of_the_scene_at_random_states(name: str, variant: str) -> None:
    case = cases.load(name, variant=variant)
    own, tree = both(case)
    draw, n = np.random.default_rng(5), len(case.q0)
    for _ in range(20):
        q, v = case.q0 + draw.uniform(-0.5, 0.5, n), draw.uniform(-2.0, 2.0, n)
        for mine, theirs in zip(own.terms(q, v), tree.terms(q, v), strict=True):  # M, and forces less bias
            assert close(mine, theirs)
        for mine, theirs in zip(own.constraint(q, v), tree.constraint(q, v), strict=True):  # H, h, H' v
            assert close(mine, theirs)
        assert close(own.gap(q)[0], tree.gap(q)[0])


@each_variant
def test_rows_of_the_scene_have_the_law_of_the_case(name: str, variant: str) -> None:
    case = cases.load(name, variant=variant)
    assert case.scene is not None
    for field in ("a0", "a1", "a2", "b0", "b1", "unilateral"):
        np.testing.assert_array_equal(getattr(law_of(case.scene), field), getattr(case.law, field))


@each_variant
def test_motion_is_that_of_the_scene(name: str, variant: str) -> None:
    case = cases.load(name, variant=variant)
    own, tree = (
        simulate(
            one,
            case.q0,
            case.v0,
            case.t_end,
            fsm=case.fsm,
            collisions=case.collisions,
            rtol=1e-11,
            consistent=case.consistent,
        )
        for one in both(case)
    )
    assert own.outcome.ok
    assert tree.outcome.ok
    # A rebound without damping ends where its multiplier and its gap are 0 at once: BALLISTIC in between, or not.
    met = [[e for e in run.events if Mode.FREE in (e.before, e.after)] for run in (own, tree)]
    assert [(e.contact, e.before == Mode.FREE) for e in met[0]] == [(e.contact, e.before == Mode.FREE) for e in met[1]]
    np.testing.assert_allclose(*([e.t for e in events] for events in met), atol=1e-8 * case.t_end)
    np.testing.assert_allclose(own.q[-1], tree.q[-1], atol=1e-7)
    drift = [run.total_energy - run.total_energy[0] for run in (own, tree)]
    np.testing.assert_allclose(drift[0][-1], drift[1][-1], atol=1e-8 * max(1.0, np.abs(own.total_energy).max()))
