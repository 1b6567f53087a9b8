"""Rows with fast constants (COLLISION) beside slow ones, and rows that follow another."""

import numpy as np
import pytest
from mechanisms import sliders
from wall_pendulum import wall_pendulum

from crossbody.cases import Mode
from crossbody.reference import System, simulate


def _with(base, **changes):
    """The same mechanism with other constants."""
    kernels = {name: getattr(base, name) for name in ("dynamics", "gaps", "rows", "energy")}
    fields = {"n": base.n, "mass_block": 1, "parameters": base.p, "a0": base.a0, "a1": base.a1}
    return System(**{**fields, **kernels, **changes})


def test_a_row_without_fast_constants_keeps_its_own_while_the_row_it_follows_collides():
    # Three masses; the second row is a damper (a0 = 0) that lives while the first collides.
    system = _with(sliders(3), a0=[1.0, 0.0], a1=[1.0, 1000.0], b0=[1e4, 0.0], b1=[0.0, 0.0], follows=[-1, 0])
    run = simulate(system, [0.0, 0.0, 0.5], [1.0, 0.0, -0.5], 0.02, rtol=1e-9, collisions="resolved")
    assert run.events[0].after is Mode.COLLISION
    assert abs(run.v[-1, 2] - run.v[-1, 1]) < 0.5 * np.exp(-10.0)


def test_collision_hands_over_when_the_elastic_part_is_spent():
    # max(b1, sqrt(b0)) |h'| + b0 |h| = eps lam / (G_A^-1)_ii; the rod is active too, so (G_A^-1)_ii is not 1 / G_ii.
    angle = np.arcsin(0.9)
    system = wall_pendulum(0.9, a0=1.0, a1=2.0, b0=[0.0, 1e6], b1=[0.0, 2e3])
    start = [0.9, -np.cos(angle)], [1e-3, 1e-3 * np.tan(angle)]
    ours, independent = (
        simulate(system, *start, 0.02, rtol=1e-10, solver=solver, collisions="resolved", inputs=([0.0], [[100.0]]))
        for solver in ("compiled", "cvode")
    )
    assert [e.after for e in ours.events] == [e.after for e in independent.events]
    assert Mode.CONTACT in [e.after for e in ours.events]
    assert [e.t for e in ours.events] == pytest.approx([e.t for e in independent.events], abs=1e-8)
