"""A corner that bears nothing rests at the surface: rounding must not have it open and touch for ever."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody.cases import Outcome
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Pair, Push, RowLaw, Scene, Shape
from crossbody.reference import simulate
from crossbody.reference.tree.system import system

HALF, GRAVITY, AT = (0.15, 0.12, 0.1), 9.81, 0.15
MOST = 2  # switches of a contact at one instant: to touch, and to let go


@pytest.mark.parametrize("seed", [*range(30), *(pytest.param(k, marks=pytest.mark.slow) for k in range(30, 120))])
def test_a_pushed_box_that_stays_where_it_is_switches_finitely_often(seed: int) -> None:
    draw = np.random.default_rng([seed, 3])
    mu, angle, heading = draw.uniform(1.5, 2.0), draw.uniform(0.0, 6.0), draw.uniform(0.0, 2.0 * np.pi)
    law = RowLaw(a0=float(10 ** draw.uniform(3.0, 5.0)), a1=float(10 ** draw.uniform(0.7, 2.6)))
    a, b, c = HALF
    inertia = ((b * b + c * c) / 3, (a * a + c * c) / 3, (a * a + b * b) / 3, 0.0, 0.0, 0.0)
    pair = Pair(name="pair", first="floor", second="box", friction=(mu, mu, 0, 0, 0), dimension=3, law=law)
    scene = Scene(
        bodies=(Body(name="body", mass=1.0, inertia=inertia),), joints=(Joint(name="free", body="body", type="free"),),
        shapes=(Shape(name="floor", type="plane"), Shape(name="box", body="body", type="box", size=HALF)),
        pairs=(pair,), pushes=(Push(name="push", body="body"),),
    )  # fmt: skip
    push = draw.uniform(0.9, 1.6) * GRAVITY * np.array([np.cos(heading), np.sin(heading), 0.0])
    inputs = (np.array([0.0, AT]), np.array([[0.0, 0.0, 0.0], push]))
    q = np.array([0.0, 0.0, c, np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])
    for rtol in (1e-5, 1e-6, 1e-7, 1e-8, 1e-9):
        found = simulate(system(scene, case_of(scene).law), q, np.zeros(6), 0.3, rtol=rtol, inputs=inputs)
        assert found.outcome is Outcome.FINISHED, (rtol, found.message)
        instants = [(e.t, e.contact) for e in found.events]
        assert max((instants.count(one) for one in instants), default=0) <= MOST, rtol
