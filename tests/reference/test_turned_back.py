"""A row that was let go below its surface turns back there, where nothing holds it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Mode

GRAVITY = 9.81
DAMPING, IMPACT = 0.9775, 24.85
"""Ratio of the damping, and the speed of impact over gravity's in 1/omega, by which the ball does not get free."""


@pytest.mark.parametrize("fsm", ["level", "edge"])
@pytest.mark.parametrize("shortcuts", [True, False])
@pytest.mark.parametrize("omega", [12.0, 96.0, 310.0])
def test_a_ball_that_is_let_go_deep_turns_at_the_top_of_its_parabola(omega: float, shortcuts: bool, fsm: str) -> None:
    """The floor's damper would pull the ball: without it the ball rises freely, and is caught where it falls again."""
    speed = IMPACT * GRAVITY / omega
    case = cases.load(
        "bouncing_ball", "linear",
        a0=omega**2, a1=2.0 * DAMPING * omega, height=speed**2 / (2.0 * GRAVITY), t_end=speed / GRAVITY + 20.0 / omega,
    )  # fmt: skip
    run = engines.load("reference").prepare(case, "compiled", shortcuts=shortcuts, fsm=fsm).run()
    let_go = next(event.t for event in run.events if event.after == Mode.BALLISTIC)
    caught = next(event for event in run.events if event.before == Mode.BALLISTIC)
    i = int(np.searchsorted(run.t, let_go, side="right")) - 1
    assert run.t[i] == let_go
    rise = float(run.v[i, 0])
    assert run.gap[i, 0] + rise**2 / (2.0 * GRAVITY) < 0.0 < rise, "it stays below the surface"
    assert caught.after == Mode.CONTACT
    assert math.isclose(caught.t, let_go + rise / GRAVITY, abs_tol=1e-7 / omega)
