"""A parameter of a case of the library that is changed changes what engines are given, and where it says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import Case, CrossbodyError
from crossbody.cases.loading import module
from crossbody.engines.equations import system_of

NUMBERS = [
    (name, key)
    for name in cases.names()
    for key, one in module(name).PARAMETERS.items()
    if isinstance(one.default, float)
]
CONTROLLED = {("ball_maze", "sample"): {"controller": "sampled"}}
"""What must be asked for besides, for a parameter that nothing else depends on."""


def given(case: Case) -> list[Any]:
    """All that a motion follows from."""
    system = system_of(case)
    rows = (system.p, system.alpha, system.beta, system.b0, system.friction, system.drift)
    return [
        repr(case.scene), case.q0.tolist(), case.v0.tolist(), case.t_end, repr(case.inputs), case.fsm, case.collisions,
        repr(case.law), *(np.asarray(one).tolist() for one in rows), system.tick,
    ]  # fmt: skip


@pytest.mark.parametrize(("name", "key"), NUMBERS)
def test_a_number_that_is_asked_for_is_given_to_engines(name: str, key: str) -> None:
    for variant in cases.variants(name):
        more = CONTROLLED.get((name, key), {})
        value = float(cases.load(name, variant, **more).parameters[key])
        for other in (1.01 * value + 1e-3, 0.99 * value - 1e-3, -value):
            try:
                pair = [given(cases.load(name, variant, **more, **{key: one})) for one in (value, other)]
            except CrossbodyError:  # beyond what is valid
                continue
            if pair[0] != pair[1]:
                return
    pytest.fail(f"Nothing depends on {key} of {name}.")


@pytest.mark.parametrize("off", [-0.01, 0.005, 0.02])
def test_the_load_of_a_tossed_cube_is_along_its_first_axis(off: float) -> None:
    """As the case says: its corners at x are lighter by what those at -x are heavier."""
    scene = cases.load("tossed_cube", "loaded", off=off).scene
    assert scene is not None
    (cube,) = (body for body in scene.bodies if body.mass)
    np.testing.assert_array_equal(cube.com, (off, 0.0, 0.0))
