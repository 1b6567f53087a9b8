"""The red body's order of modes: the inequalities behind it, and what keeps it."""

from __future__ import annotations

import numpy as np
import pytest
from red_body_scene import ALL, numbers, run

from crossbody.cases import Mode, load
from crossbody.cases.mechanisms.red_body.order import LEFT, RIGHT, Fall, inequalities, stages_in_order

ONE_AT_A_TIME = [
    *(("b0", value, True) for value in (3e5, 1e6, 3e6)),
    ("b0", 1e5, False),  # the right corner lands before the left one has settled
    ("b0", 1e7, False),  # the left corner bounces
    *(("zeta3", value, False) for value in (1.0, 1.5)),
    *(("zeta3", value, True) for value in (2.0, 3.0, 4.0)),
    *(("zeta4", value, True) for value in (0.0, 0.05, 0.1, 0.2)),
    *(("half_height", value, False) for value in (0.13, 0.142)),
    *(("half_height", value, True) for value in (0.145, 0.15, 0.2)),
]


@pytest.mark.parametrize(("name", "value", "kept"), ONE_AT_A_TIME)
def test_one_parameter_at_a_time(name: str, value: float, kept: bool) -> None:
    """The order is kept exactly where the case says that its inequalities hold."""
    case = load("red_body", **{name: value}, t_end=0.14)
    assert (not inequalities(numbers(case), frozen=False)) is kept
    assert ("mode_order" in {claim.metric for claim in case.claims}) is kept
    assert ("the order is not claimed" in case.title) is not kept
    assert (stages_in_order(run(case).events) == ALL) is kept


FEW, MANY = 15, 200
DRAWN = [
    {"zeta3": 0.45, "drop": 1e-4},
    {"zeta3": 0.48, "drop": 1.1434e-4, "tilt": 0.204, "b0": 1.3806e6},
    {"zeta3": 0.8671668617928205, "drop": 0.0019470880781292344, "tilt": 0.23957871413661627, "b0": 493184.95369313157},
]


def test_a_corner_that_still_comes_down_is_struck_again() -> None:
    """Its collision swings to and fro, and may be handed over on the way down: the blow of the other finds it there."""
    draw, found = np.random.default_rng(1), set()
    drawn = [{"zeta3": draw.uniform(0.4, 0.6), "drop": 1e-4, "b0": 10.0 ** draw.uniform(5.7, 6.3)} for _ in range(FEW)]
    for changes in (*DRAWN, *drawn):
        case = load("red_body", **changes)
        kept = not inequalities(numbers(case), frozen=False)
        assert kept == ("mode_order" in {claim.metric for claim in case.claims})
        assert (stages_in_order(run(case).events) == ALL) is kept, changes
        found.add(kept)
    assert found == {True, False}


PAIRED = [(3e5, 1.52), (1e6, 1.95), (1e7, 3.05), (1e8, 4.64), (1e9, 6.94)]


@pytest.mark.parametrize(("b0", "zeta3"), PAIRED)
def test_other_stiffness_with_the_damping_that_catches(b0: float, zeta3: float) -> None:
    """v*(zeta3) = 2 v3."""
    case = load("red_body", b0=b0, zeta3=zeta3)
    fall = Fall(numbers(case))
    e = np.exp(-2.0 * zeta3 * np.arccosh(zeta3) / np.sqrt(zeta3**2 - 1.0))
    threshold = fall.press(fall.tilt, 0.0) / (np.sqrt(b0) * e**1.5)
    assert threshold == pytest.approx(2.0 * fall.speed, rel=0.02)
    assert stages_in_order(run(case).events) == ALL


def test_a_strong_damper_lets_go_at_the_instant_of_the_blow() -> None:
    """2 zeta4 w v4 > K g': the left corner is released when the right one is entered."""
    found = run(load("red_body", zeta4=0.2))
    landed = next(e.t for e in found.events if (e.contact, e.after) == (RIGHT, Mode.COLLISION))
    let_go = next(e.t for e in found.events if e.contact == LEFT and e.before is Mode.CONTACT)
    assert let_go == landed


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"b0": 1e7}, "bounces"), ({"zeta3": 1.0}, "bounces"), ({"b0": 1e5}, "settled"),
        ({"half_height": 0.13}, "flat"), ({"half_height": 0.142}, "weak"), ({"tilt": -0.2}, "lean"),
        ({"tilt": 0.7}, "lean"), ({"spin": 100.0}, "lean"), ({"spin": -20.0}, "rolls over"),
        ({"spin": -7.9, "speed_y": -0.9, "drop": 1e-3}, "takes off"),
    ],
)  # fmt: skip
def test_the_broken_inequality_is_named(changes: dict[str, float], word: str) -> None:
    assert word in load("red_body", **changes).title


def perturbed(draw: np.random.Generator, part: float, extras: bool) -> dict[str, float]:
    """Drop and tilt off by up to a part of themselves; with extras, everything else off a little too."""
    found = {"drop": 0.01 * (1 + draw.uniform(-part, part)), "tilt": 0.2 * (1 + draw.uniform(-part, part))}
    if extras:
        widths = {"speed_x": 0.05, "speed_y": 0.05, "spin": 0.1, "x": 0.02, "slab_tilt": 1e-4, "slab_height": 2e-5}
        found |= {name: draw.uniform(-width, width) for name, width in widths.items()}
    return found


@pytest.mark.parametrize("count", [FEW, pytest.param(MANY, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("part", "extras"), [(0.05, False), (0.05, True), (0.2, True)])
def test_order_is_kept_under_perturbations(part: float, extras: bool, count: int) -> None:
    draw = np.random.default_rng(5)
    for _ in range(count):
        changes = perturbed(draw, part, extras)
        found = run(load("red_body", **changes, t_end=0.14))
        assert stages_in_order(found.events) == ALL, changes
        feet = found.lam[:, :2][(found.mode[:, :2] == Mode.CONTACT).all(axis=1)]
        assert feet.min() > 19.619, changes


def test_anything_else_in_between_is_not_the_order() -> None:
    """A corner that bounces on its way is noticed, and a late row that comes up to the surface is not."""
    events = list(run(load("red_body")).events)
    assert stages_in_order(events) == ALL
    assert stages_in_order(events[:-2]) == ALL - 1
    assert stages_in_order([e for e in events if e.contact != RIGHT]) == 2
    assert stages_in_order([e for e in events if e.after is not Mode.CONTACT]) == 1
    assert stages_in_order([]) == 0
