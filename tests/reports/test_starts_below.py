"""A scene that starts beyond a bound, or below a surface, is told so: its first motion is the push back."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody.cases import Case, from_scene
from crossbody.cases.scene import Body, Joint, Pair, Scene, Shape
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.truth_row import start_below

EVEN = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)


def started(turn: float, height: float) -> Case:
    """A link with a bound of .5 rad and a ball of radius .1 above a floor."""
    return from_scene(
        Scene(
            bodies=(Body(name="link", mass=1.0, inertia=EVEN), Body(name="ball", mass=1.0, inertia=EVEN)),
            joints=(Joint(name="turn", body="link", type="hinge", range=(-0.5, 0.5)),
                    Joint(name="fall", body="ball", type="slide", axis=(0.0, 0.0, 1.0))),
            shapes=(Shape(name="floor", type="plane", size=(1.0, 1.0, 1.0)),
                    Shape(name="ball", body="ball", size=(0.1, 0.0, 0.0))),
            pairs=(Pair(name="touch", first="floor", second="ball"),),
        ),
        q0=[turn, height], t_end=0.01,
    )  # fmt: skip


@pytest.mark.parametrize(("turn", "height"), [(0.0, 0.2), (0.5, 0.1), (0.5 + 1e-12, 0.1 - 1e-12)])
def test_a_start_above_its_surfaces_is_not_remarked(turn: float, height: float) -> None:
    case = started(turn, height)
    assert start_below(case, truth_of(case)) == ""


@pytest.mark.parametrize("seed", range(3))
def test_what_is_beyond_is_named_with_how_far_the_deepest_first(seed: int) -> None:
    over, deep = np.random.default_rng(seed).uniform(0.01, 0.04, 2)
    case = started(0.5 + over, 0.1 - deep)
    told = start_below(case, truth_of(case))
    angle, depth = f"by {over:.2g} rad", f"by {deep:.2g} m"
    assert angle in told
    assert f"touch {depth}" in told
    assert (told.index(angle) < told.index(depth)) == (over > deep)
