"""Touches are those of rows that have a gap: what rows of friction tell, or do not tell, is compared with nothing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from random_scenes import random_scene

from crossbody import cases
from crossbody.cases import Case, Event, Mode, SceneError, Tier, Trajectory, from_scene
from crossbody.cases.case import Law
from crossbody.cases.scene import Body, Joint, Pair, Scene, Shape
from crossbody.engines import equations
from crossbody.engines.equations import has_equations, system_of
from crossbody.reports import metrics
from crossbody.reports.judging.run_verdicts import limits_of
from crossbody.reports.measuring.truth import Truth, from_run

END, SAMPLES = 1.0, 401
Story = Sequence[tuple[int, float, float]]
"""Row, touch and release, s, of every contact."""


def thrown(frictions: Sequence[float], loss: float = 0.0) -> Case:
    """Balls that float above a floor, each with its own coefficient of friction, beside a hinge with dry friction."""
    names = [f"ball {k}" for k in range(len(frictions))]
    inertia = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    floor = Shape(name="floor", body="", type="plane", size=(0.0, 0.0, 0.0))
    shapes = (Shape(name=name, body=name, type="sphere", size=(0.1, 0.0, 0.0)) for name in names)
    pairs = (
        Pair(name=name, first="floor", second=name, friction=(mu, mu, 0.0, 0.0, 0.0), dimension=3)
        for name, mu in zip(names, frictions, strict=True)
    )
    return from_scene(Scene(
        bodies=tuple(Body(name=name, mass=1.0, inertia=inertia) for name in (*names, "crank")),
        joints=(*(Joint(name=name, body=name, type="free") for name in names),
                Joint(name="crank", body="crank", type="hinge", axis=(0.0, 1.0, 0.0), friction_loss=loss)),
        shapes=(floor, *shapes), pairs=tuple(pairs),
    ), q0=[*[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0] * len(names), 0.0], t_end=END)  # fmt: skip


def drawn(draw: np.random.Generator) -> Case:
    return thrown(draw.choice([0.0, 0.5, 2.0], draw.integers(1, 4)).tolist(), float(draw.choice([0.0, 0.3])))


def told(case: Case, story: Story, too: Iterable[int] = ()) -> Trajectory:
    """A motion with these contacts, of which rows of friction tell the same, at the same instants, as rows `too` do."""
    t = np.sort([*np.linspace(0.0, END, SAMPLES), *(x for _, *ends in story for x in ends if np.isfinite(x))])
    wide = np.zeros((len(t), len(case.contacts)))
    gap, lam, mode = (np.array(wide) for _ in range(3))
    gap[:, case.law.touches] = 0.1
    events = []
    for row, *ends in story:
        touch, release = ends
        inside = (t >= touch) & (t <= release)
        gap[inside, row], lam[inside, row] = -0.01, 1.0
        for k in (row, *too):
            mode[inside, k] = Mode.SLIP
            events += [Event(t=touch, contact=k, before=Mode.FREE, after=Mode.SLIP)]
            events += [Event(t=release, contact=k, before=Mode.SLIP, after=Mode.FREE)] * bool(np.isfinite(release))
    return Trajectory(
        t=t, q=np.ones((len(t), len(case.q0))), v=np.ones((len(t), len(case.v0))), gap=gap, lam=lam,
        energy=np.zeros((len(t), 2)), mode=mode.astype(np.int8), events=tuple(sorted(events, key=lambda e: e.t)),
    )  # fmt: skip


def judged_by(case: Case, run: Trajectory) -> Truth:
    return replace(from_run(run, Tier.A, "made up"), touches=case.law.touches, joined=case.general)


def measured(name: str, case: Case, exact: Trajectory, run: Trajectory) -> float | None:
    return metrics.load(name).measure(judged_by(case, exact), run, case)


@pytest.mark.parametrize("too", [(), (1, 2)], ids=["nothing", "events"])
def test_a_first_touch_that_is_a_millisecond_late_is_off_by_a_millisecond(too: Sequence[int]) -> None:
    """Whatever is told of the tangents, which are at their surface, with a gap of zero, from the start on."""
    case = thrown([0.5])
    exact, run = told(case, [(0, 0.1797, np.inf)]), told(case, [(0, 0.1807, np.inf)], too)
    assert measured("event_times", case, exact, run) == pytest.approx(1e-3, rel=1e-9)
    assert measured("touch_count", case, exact, run) == 0.0
    assert measured("touch_count", case, exact, told(case, [], too)) == -1.0
    assert measured("event_times", case, exact, told(case, [], too)) is None


@pytest.mark.parametrize("seed", range(20))
def test_touches_and_releases_are_off_by_what_those_of_rows_with_a_gap_are(seed: int) -> None:
    draw = np.random.default_rng(seed)
    case = drawn(draw)
    rows, rubs = (np.flatnonzero(one) for one in (case.law.touches, ~case.law.touches))
    ends = np.sort(draw.uniform(0.05, 0.95, 2 * draw.integers(1, 6))).reshape(-1, 2)
    late = draw.uniform(-1.0, 1.0, ends.shape) * 0.2 * np.min(np.diff([0.0, *ends.ravel(), END]))
    which = draw.choice(rows, len(ends)).tolist()
    too = draw.permutation(rubs)[: draw.integers(0, len(rubs) + 1)].tolist()
    exact, run = (
        told(case, [(row, *pair) for row, pair in zip(which, times.tolist(), strict=True)], also)
        for times, also in ((ends, ()), (ends + late, too))
    )
    assert measured("event_times", case, exact, run) == pytest.approx(np.max(np.abs(late)), rel=1e-9)
    for name in ("touch_count", "release_count"):
        assert measured(name, case, exact, run) == 0.0
        assert measured(name, case, exact, told(case, [], rubs.tolist())) == -len(ends)
    assert metrics.load("contacts").measure(judged_by(case, exact), run, case) == len(ends)


def of_friction(case: Case) -> np.ndarray:
    """Rows that the equations hold by friction: they follow others, or themselves."""
    system = system_of(case)
    return (np.asarray(system.follows) >= 0) | (np.asarray(system.friction_loss) > 0.0)


ALL = [(name, variant) for name in cases.names() for variant in cases.variants(name)]


@pytest.mark.parametrize(("name", "variant"), ALL, ids=":".join)
def test_rows_of_every_case_touch_that_open_and_are_not_of_friction(name: str, variant: str) -> None:
    case = cases.load(name, variant)
    assert has_equations(case)
    np.testing.assert_array_equal(case.law.touches, case.law.unilateral & ~of_friction(case))
    given = {limit.metric for limit in limits_of(case)}
    assert ({"event_times", "touch_count", "release_count", "gap_error"} <= given) == bool(case.law.touches.any())


@pytest.mark.parametrize("seed", range(30))
def test_rows_of_drawn_scenes_touch_that_open_and_are_not_of_friction(seed: int) -> None:
    case = drawn(np.random.default_rng(seed)) if seed % 2 else from_scene(random_scene(seed), t_end=0.1)
    np.testing.assert_array_equal(case.law.touches, case.law.unilateral & ~of_friction(case))


@pytest.mark.parametrize("name", ["event_times", "touch_count", "release_count", "gap_error", "event_gap"])
def test_what_never_touches_has_no_number_of_touches(name: str) -> None:
    case = cases.load("dry_oscillator", "stops")
    assert case.closed_form is not None
    run = case.closed_form(np.linspace(0.0, case.t_end, 21))
    assert measured(name, case, run, run) is None


def test_rows_of_friction_that_are_said_to_touch_are_refused() -> None:
    one, opens = np.ones(2), np.array([True, True])
    case = thrown([0.5])
    with pytest.raises(SceneError, match="always on"):
        Law(a0=one, a1=one, a2=0.0 * one, unilateral=~opens, touches=opens)
    with pytest.raises(SceneError, match=r"Rows \[1, 2\] are rows of friction"):
        equations._built(lambda *_: system_of(case), {}, replace(case.law, touches=case.law.unilateral))


@pytest.mark.parametrize("seed", range(20))
def test_one_that_lets_go_for_less_time_than_instants_are_judged_to_touches_once(seed: int) -> None:
    """Two rows that switch within nanoseconds do so in an order that no run tells: in the other one has not let go."""
    rng = np.random.default_rng(seed)
    case, touch, parted, end = thrown([0.5]), *np.sort(rng.uniform(0.0, END, 3)).tolist()
    apart = 1e-6 * 10.0 ** rng.uniform(-4.0, 4.0)
    once, twice = told(case, [(0, touch, end)]), told(case, [(0, touch, parted), (0, parted + apart, end)])
    for exact, run, sign in ((once, twice, 1.0), (twice, once, -1.0)):
        for name in ("touch_count", "release_count"):
            assert measured(name, case, exact, run) == (sign if apart > 1e-6 else 0.0)
        if apart < 1e-6:
            assert measured("event_times", case, exact, run) == pytest.approx(0.0, abs=1e-12)
