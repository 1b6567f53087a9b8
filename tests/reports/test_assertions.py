"""The assertions for tests of one's own: they hold where they should, and name the first offending time else."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from crossbody import cases, engines
from crossbody.cases import InvalidValue, Outcome, Trajectory
from crossbody.reports.measuring.truth import sample_times
from crossbody.reports.testing import Baseline, assert_agrees, assert_energy
from crossbody.reports.testing._baseline import place

Floats = NDArray[np.float64]
BALL = cases.load("bouncing_ball", variant="linear", t_end=1.5)
assert BALL.closed_form is not None
CLOSED = BALL.closed_form
MOTION = CLOSED(sample_times(CLOSED(np.zeros(1)), BALL.t_end))
TOUCH = MOTION.events[0].t


def edited(change: Callable[[Floats, Floats], Floats], signal: str = "q") -> Trajectory:
    return replace(MOTION, **{signal: change(MOTION.t[:, None], getattr(MOTION, signal))})


@pytest.fixture(scope="module")
def integrated() -> Trajectory:
    return engines.load("reference").prepare(BALL, "compiled", rtol=1e-10, samples=2001).run()


def test_the_reference_agrees_with_the_closed_form(integrated: Trajectory) -> None:
    assert_agrees(integrated, MOTION, of=("q", "v", "gap"), rtol=1e-6)
    assert_agrees(MOTION, MOTION, of=("q", "v", "gap", "lam", "energy"), rtol=1e-14)


@pytest.mark.parametrize("onset", [0.1, 0.7, 1.4])
def test_the_first_offending_time_is_named(onset: float) -> None:
    wrong = edited(lambda t, q: q + np.where(t >= onset, 1e-3 * (1.0 + t), 0.0))
    with pytest.raises(AssertionError, match=r"q\[0\] is off first at t = ") as told:
        assert_agrees(wrong, MOTION, of=("q",), rtol=1e-6)
    named = re.findall(r"at t = ([\d.]+) s", str(told.value))
    first = MOTION.t[MOTION.t >= onset][0]
    assert float(named[0]) == pytest.approx(first, rel=1e-8)
    assert float(named[1]) == pytest.approx(BALL.t_end)
    assert f"{int((MOTION.t >= onset).sum())} of {len(MOTION.t)} samples" in str(told.value)


def test_a_late_touch_is_an_error_in_time_not_in_speed() -> None:
    late = replace(MOTION, events=tuple(replace(e, t=e.t + 1e-3) for e in MOTION.events), t=np.array(MOTION.t) + 0.0)
    with pytest.raises(AssertionError, match=rf"Touch 0 is of row 0 at t = {TOUCH + 1e-3:.7f}.* 1.5e-06 s are allowed"):
        assert_agrees(late, MOTION)


def test_a_touch_at_the_right_instant_of_another_row_is_named() -> None:
    case = cases.load("newtons_cradle", t_end=0.6)
    run = engines.load("reference").prepare(case).run()
    rows = len(case.contacts)
    other = replace(run, events=tuple(replace(e, contact=rows - 1 - e.contact) for e in run.events))
    assert_agrees(run, run, of=("q",))
    with pytest.raises(AssertionError, match=r"Touch 0 is of row (\d) at (t = [\d.]+) s where row (?!\1)\d at \2 s is"):
        assert_agrees(other, run, of=("q",))


def test_a_touch_too_many_or_too_few_is_named() -> None:
    fewer = replace(MOTION, events=MOTION.events[:1])
    with pytest.raises(
        AssertionError, match=r"The touch of row 0 at t = .* is missing: 1 touches where \d are expected"
    ):
        assert_agrees(fewer, MOTION)
    with pytest.raises(AssertionError, match=r"has no counterpart: \d touches where 1 are expected"):
        assert_agrees(MOTION, fewer)


def test_not_a_number_is_off_and_a_resting_column_needs_atol() -> None:
    with pytest.raises(AssertionError, match=r"v\[0\] is off first at t = 0.7"):
        assert_agrees(edited(lambda t, v: np.where(t > 0.7, np.nan, v), "v"), MOTION)
    rest = edited(lambda t, q: 0.0 * q)
    with pytest.raises(AssertionError, match="where 0 is allowed"):
        assert_agrees(edited(lambda t, q: 0.0 * q + 1e-12), rest, of=("q",))
    assert_agrees(edited(lambda t, q: 0.0 * q + 1e-12), rest, of=("q",), atol=1e-11)


def test_a_run_that_did_not_finish_agrees_with_nothing() -> None:
    ended = replace(MOTION, outcome=Outcome.STEP_LIMIT, message="after 7 steps")
    with pytest.raises(
        AssertionError, match=r"The run ended at t = 1\.5 s with step_limit: after 7 steps Raise max_steps"
    ):
        assert_agrees(ended, MOTION)
    short = engines.load("reference").prepare(cases.load("bouncing_ball", variant="linear", t_end=1.0)).run()
    with pytest.raises(AssertionError, match=r"ends at t = 1 s, what it is held against at t = 1\.5 s"):
        assert_agrees(short, MOTION)


def test_wrong_use_is_no_failed_assertion(integrated: Trajectory) -> None:
    with pytest.raises(InvalidValue, match="no signal 'force'; valid: q, v, gap, lam, energy"):
        assert_agrees(MOTION, MOTION, of=("force",))
    two = replace(MOTION, q=np.repeat(MOTION.q, 2, axis=1))
    with pytest.raises(InvalidValue, match="q has 2 columns here and 1 there"):
        assert_agrees(two, MOTION)
    with pytest.raises(InvalidValue, match="keeps no energy account"):
        assert_energy(replace(integrated, ledger=None))


def test_energy_is_held_against_its_account(integrated: Trajectory) -> None:
    assert_energy(integrated, rtol=1e-8)
    with pytest.raises(AssertionError, match=r"is off first at t = 0\.4"):  # damping takes some at the first touch
        assert_energy(integrated, conserved=True)
    made = np.array(integrated.energy)
    made[integrated.t > 1.0, 1] += 1e-3
    with pytest.raises(AssertionError, match=r"is off first at t = 1.0\d+ s: .*largest kinetic energy, 9.81 J"):
        assert_energy(replace(integrated, energy=made))


@pytest.mark.parametrize(
    ("case", "part"),
    [
        (cases.load("delta_free", t_end=0.1), "dissipated"),
        (cases.load("delta_impulse", t_end=0.1, start=0.02), "input"),
    ],
)
def test_the_account_holds_what_dampers_take_and_inputs_bring(case: cases.Case, part: str) -> None:
    run = engines.load("reference").prepare(case, "compiled", ledger=True).run()
    assert run.ledger is not None
    book = getattr(run.ledger, part)
    assert np.ptp(book) > 1e-5 * run.energy[:, 0].max()
    assert_energy(run)
    with pytest.raises(AssertionError, match="is off first"):
        assert_energy(replace(run, ledger=replace(run.ledger, **{part: -book})))


def test_baselines_hold_every_number_and_name_what_moved(tmp_path: Path) -> None:
    path = tmp_path / "kept" / "one.json"
    values = {"drift": 1e-7, "none": math.nan, "far": -math.inf}
    Baseline(path, update=True).check(values)
    Baseline(path).check(values)
    with pytest.raises(AssertionError) as told:
        Baseline(path).check({"drift": 2e-7, "none": 1.0, "new": 3.0})
    first = str(told.value).splitlines()
    assert first[:-1] == [
        "drift was 1e-07 and is 2e-07, a difference of 1e-07.",
        "far is missing: it was -inf.",
        "new is new: 3.",
        "none was nan and is 1, a difference of nan.",
    ]
    path.write_text("[1]")
    with pytest.raises(InvalidValue, match="is not a JSON object of numbers"):
        Baseline(path).check(values)


@pytest.mark.parametrize("name", ["../../etc", "a/b", "a:b", "x" * 300, "<script>", ".."])
def test_the_name_of_a_test_cannot_leave_the_folder(tmp_path: Path, name: str) -> None:
    found = place(tmp_path / "test_it.py", name)
    assert found.resolve().parent == tmp_path / "baselines" / "test_it"
    assert len(found.name) < 130
    assert found != place(tmp_path / "test_it.py", name + "?")
