"""Numbers, limits and claims become words; words become the exit code."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from crossbody import cases as cases_
from crossbody import engines
from crossbody.cases import Case, Claim, Limit, Outcome, Tier, Trajectory, load
from crossbody.cases.defaults import limits_of
from crossbody.cases.files.case import AS_IT_STANDS
from crossbody.reports import metrics
from crossbody.reports.commands import bands
from crossbody.reports.judging import run_verdicts, stored, verdict
from crossbody.reports.judging.audit import AuditRow, audit, difference, states
from crossbody.reports.judging.comparison import compare, judged
from crossbody.reports.judging.parts import Split
from crossbody.reports.judging.run_verdicts import Entry, Judge
from crossbody.reports.judging.stored import deviations
from crossbody.reports.judging.truth import held_against, truth_of
from crossbody.reports.judging.truth_row import truth_row
from crossbody.reports.judging.verdict import (
    FACTOR,
    IDENTITIES,
    Regression,
    Word,
    as_stored,
    band,
    exit_code,
    judge,
    limit_for,
)
from crossbody.reports.measuring.truth import TRUTH, from_run
from crossbody.reports.runs import jobs
from crossbody.reports.runs.choice import picks

LIMIT = Limit(metric="position", value=1e-3, why="because")
KNOWN = replace(LIMIT, known="it is known to do that", known_size=1.0)
UNMEASURED = replace(KNOWN, known_size=math.inf)
CLAIM = Claim(metric="contacts", expected=3.0, tier=Tier.B, source="a figure")


@pytest.mark.parametrize(
    ("value", "limit", "claim", "word"),
    [
        (1e-4, LIMIT, None, Word.WITHIN),
        (-1e-4, LIMIT, None, Word.WITHIN),
        (1e-2, LIMIT, None, Word.OUTSIDE),
        (-1e-2, LIMIT, None, Word.OUTSIDE),
        (1e-2, KNOWN, None, Word.EXPECTED),
        (1.1, KNOWN, None, Word.OUTSIDE),
        (1e-2, UNMEASURED, None, Word.INFO),
        (1e-4, KNOWN, None, Word.WITHIN),
        (math.nan, LIMIT, None, Word.OUTSIDE),
        (math.inf, KNOWN, None, Word.OUTSIDE),
        (math.nan, None, None, Word.OUTSIDE),
        (1e9, None, None, Word.INFO),
        (3.0, None, CLAIM, Word.WITHIN),
        (4.0, None, CLAIM, Word.OUTSIDE),
        (3.0005, LIMIT, CLAIM, Word.WITHIN),
        (3.005, LIMIT, CLAIM, Word.OUTSIDE),
    ],
)
def test_judgement(value: float, limit: Limit | None, claim: Claim | None, word: Word) -> None:
    assert judge(value, limit, claim)[0] == word


@pytest.mark.parametrize("hidden", [False, True])
@pytest.mark.parametrize("stored", [None, math.nan, 1e-3])
@pytest.mark.parametrize("claimed", [False, True])
@pytest.mark.parametrize("limit", ["", "plain", "known", "covers none"])
def test_a_number_that_is_missing_has_one_word(
    limit: str, claimed: bool, stored: float | None, hidden: bool, case: Case, motion: Trajectory
) -> None:
    """Hidden by the engine; known to be none; stored as none; else outside, claimed or not."""
    claim = Claim(metric="contacts", expected=3.0, tier=Tier.B, source="a figure")
    given = {
        "plain": {},
        "known": {"known": "it has none"},
        "covers none": {"known": "it has none", "covers_none": True},
    }
    limits = () if not limit else (Limit(metric="contacts", value=1.0, why="because", **given[limit]),)
    entry = Entry(engine="fake", profile="good", run=motion, hidden={"lam": "not shown"} if hidden else {})
    judge_ = run_verdicts.Judge(replace(case, limits=limits, claims=(claim,) * claimed), entry, truth_of(case), "run")
    judge_.stored = {} if stored is None else {"contacts": stored}
    row = judge_.missing("contacts", "1", "There is no such number.", "lam")
    expected = 3.0 if claimed else math.nan
    assert (row.expected, row.value) == pytest.approx((expected, math.nan), nan_ok=True)
    if hidden:
        assert (row.verdict, row.why) == (Word.INFO, "not shown")
    elif limit == "covers none" and not claimed and stored is None:
        assert (row.verdict, row.why) == (Word.INFO, "There is no such number. Known: it has none.")
    elif limit in ("known", "covers none") and stored is not None and math.isnan(stored):
        assert (row.verdict, row.why) == (Word.EXPECTED, "it has none")
    else:
        assert row.verdict == Word.OUTSIDE
        assert row.why.startswith("There is no such number.")
        assert ("3 claimed: a figure" in row.why) == claimed
    if row.verdict != Word.INFO:
        assert row.tier == (Tier.B if claimed else Tier.A).value


def test_what_is_stored_of_a_run_that_fails_its_audit_is_all_that_is_measured(case: Case, motion: Trajectory) -> None:
    """Judged it ends there, as no size is known yet."""
    row = AuditRow(quantity="M", mine="1", theirs="2", difference=0.5, tolerance=1e-9)
    entry, true = Entry(engine="fake", profile="good", run=motion), truth_of(case)
    plain = run_verdicts.measured(case, entry, true)
    assert len(plain) > 5
    failed = replace(entry, audit=(row, replace(row, quantity="h", difference=0.0)))
    assert run_verdicts.measured(case, failed, true) == pytest.approx(plain | {"audit M": 0.5}, nan_ok=True)
    assert {one.metric for one in judged(case, [failed], true, "") if one.engine == "fake"} == {"finished", "audit"}


def test_a_number_of_the_stored_run_that_nobody_asks_for_any_more_is_outside(case: Case, motion: Trajectory) -> None:
    entry, true = Entry(engine="fake", profile="good", run=motion), truth_of(case)
    judge_ = run_verdicts.Judge(case, entry, true, "run")
    judge_.stored = {
        "contacts": 3.0,
        "bounces": math.nan,
        "transitions": 1.0,
        "audit M": 0.5,
        "largest position (x)": 1.0,
    }
    [row] = run_verdicts._vanished(judge_, {"transitions"})
    assert (row.metric, row.verdict) == ("contacts", Word.OUTSIDE)


@pytest.mark.parametrize("stored", [None, 0.02])
@pytest.mark.parametrize(("value", "word"), [(1e-4, Word.WITHIN), (0.03, Word.EXPECTED), (0.05, Word.OUTSIDE)])
@pytest.mark.parametrize("compared", [0.4, 0.6])
def test_a_small_part_says_as_much_of_a_deviation_as_that_of_the_stored_run(
    compared: float, value: float, word: Word, stored: float | None, case: Case, motion: Trajectory
) -> None:
    """A run by another law may share few events with the truth: what is within is not judged by them alone."""
    judge_ = run_verdicts.Judge(case, Entry(engine="fake", profile="good", run=motion), truth_of(case), "run")
    judge_.limits = (replace(LIMIT, metric="x", known="it is known to do that", known_size=0.04),)
    judge_.stored = {} if stored is None else {"x": stored}
    if stored is not None and value == 1e-4:
        word = Word.OUTSIDE  # no more as far off as stored
    elif stored is None and compared < 0.5 and word != Word.OUTSIDE:
        word = Word.INFO
    assert judge_.judged("x", value, "1", judge_.truth, compared).verdict == word


@given(
    parts=st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3), off=st.sampled_from([0.0, 1e-6, -1e-6, math.nan]),
    trusted=st.sampled_from([None, 0.5, 1.0]), missing=st.booleans(),
)  # fmt: skip
def test_parts_that_do_not_add_up_to_their_error_are_a_row(
    parts: list[float], off: float, trusted: float | None, missing: bool, case: Case, motion: Trajectory
) -> None:
    """Where both look as far, and no part is missing."""
    true = replace(from_run(motion, Tier.A, "itself"), trusted=1.0)
    own = None if trusted is None else replace(true, trusted=trusted)
    there = dict(zip(("importer", "step", "model"), parts, strict=True))
    if missing:
        del there["model"]
    told = Split(where="q", there=there, largest=there, known=there, says="", missing={})
    judge_ = run_verdicts.Judge(case, Entry(engine="fake", profile="good", own=own), true, "run")
    rows = list(run_verdicts._unlike(judge_, "position", told, sum(parts) + off))
    assert [row.verdict for row in rows] == [Word.OUTSIDE] * (abs(off) > 0.0 and trusted != 0.5 and not missing)


@given(
    value=st.sampled_from([None, math.nan, 0.5]), needs=st.sampled_from(["", "lam"]), hidden=st.booleans(),
    claimed=st.booleans(), limited=st.booleans(), shown=st.booleans(),
)  # fmt: skip
def test_a_number_that_is_none_is_told_if_it_is_asked_for_or_the_run_should_have_it(
    value: float | None,
    needs: str,
    hidden: bool,
    claimed: bool,
    limited: bool,
    shown: bool,
    case: Case,
    motion: Trajectory,
) -> None:
    """Not if nobody asks for it and the run lacks what it needs; nor of a limit that the truth itself lacks."""
    limit, claim = replace(LIMIT, metric="x"), replace(CLAIM, metric="x")
    untold = {"lam": "not shown"} if hidden else {}
    true = from_run(replace(motion), Tier.A, "itself")
    judge_ = run_verdicts.Judge(case, Entry(engine="fake", profile="good", hidden=untold), true, "run")
    judge_.limits, judge_.claims, judge_.stored = (limit,) * limited, {"x": claim} if claimed else {}, {}
    metric: Any = SimpleNamespace(
        UNIT="1", measure=lambda _, run, __: value if run is motion else 1.0 if shown else None
    )
    if needs:
        metric.NEEDS = needs
    row = run_verdicts._row(judge_, metric, "x", claimed or limited, true, motion)
    lacks = value is None or (math.isnan(value) and needs and (hidden or not (claimed or limited)))
    if lacks and not claimed and not (limited and shown):
        assert row is None
        return
    assert row is not None
    assert (row.value == 0.5) == (value == 0.5)
    if value != 0.5:
        assert row.verdict == (Word.INFO if lacks and needs and hidden else Word.OUTSIDE)


@given(
    value=st.sampled_from([0.0, 0.5, 0.99, 1.01, 1.9, 2.1, 3.9, 4.1, 19.0, 21.0, math.nan, math.inf]),
    sign=st.sampled_from([-1.0, 1.0]), known=st.booleans(), least=st.sampled_from([0.0, 2.0]),
    size=st.sampled_from([4.0, math.inf]), stored=st.sampled_from([None, 2.0 * FACTOR, 2.0 / FACTOR, 10.0]),
    claimed=st.booleans(), limited=st.booleans(),
)  # fmt: skip
def test_the_word_of_a_number_is_that_of_the_first_that_speaks(
    value: float,
    sign: float,
    known: bool,
    least: float,
    size: float,
    stored: float | None,
    claimed: bool,
    limited: bool,
) -> None:
    """A limit of 1 with a property that is known from `least` to `size`, else to a factor of what is stored."""
    limit = Limit(metric="x", value=1.0, known="known" if known else "", known_least=least * known, known_size=size)
    claim = replace(CLAIM, metric="x") if claimed else None
    said = sign * value + (3.0 if claimed else 0.0)
    sizes = (
        (least, size) if least and known else (stored / FACTOR, stored * FACTOR) if stored is not None else (0.0, size)
    )
    if not math.isfinite(value):
        wanted = Word.OUTSIDE
    elif not limited:
        wanted = Word.INFO if not claimed else Word.WITHIN if value == 0.0 else Word.OUTSIDE
    elif value <= 1.0 and not (known and sizes[0] > 1.0):
        wanted = Word.WITHIN
    elif not known:
        wanted = Word.OUTSIDE
    elif sizes == (0.0, math.inf):
        wanted = Word.INFO
    else:
        wanted = Word.EXPECTED if sizes[0] <= value <= sizes[1] else Word.OUTSIDE
    assert judge(said, limit if limited else None, claim, stored)[0] == wanted


@given(
    value=st.floats(-1.0, 1.0), shown=st.booleans(),
    stored=st.one_of(st.none(), st.just(math.nan), st.floats(0.0, 1.0), st.floats(0.0, 4.0 * verdict.NOUGHT)),
)  # fmt: skip
def test_a_number_without_a_limit_is_held_to_that_of_the_stored_run_where_a_property_shows_everywhere(
    value: float, stored: float | None, shown: bool
) -> None:
    """By half to twice of it, where half of it is more than nothing."""
    everywhere = Limit(metric="*", known="it is known to do that")
    if not shown or stored is None or not stored / FACTOR > verdict.NOUGHT:
        wanted = Word.INFO
    else:
        wanted = Word.EXPECTED if stored / FACTOR <= abs(value) <= stored * FACTOR else Word.OUTSIDE
    assert as_stored(value, everywhere if shown else None, stored)[0] == wanted


def test_the_reason_of_a_known_deviation_is_told() -> None:
    assert judge(1.0, KNOWN, None) == (Word.EXPECTED, "it is known to do that")


def test_the_most_precise_limit_speaks() -> None:
    limits = [
        Limit(metric="x", value=1.0),
        Limit(metric="x", value=2.0, engine="a"),
        Limit(metric="x", value=3.0, engine="a", profile="p"),
        Limit(metric="x", value=4.0, profile="q"),
        Limit(metric="y", value=5.0, engine="a", profile="p"),
    ]
    found = {(e, p): limit_for(limits, "x", e, p) for e in "ab" for p in "pr"}
    assert {k: v.value for k, v in found.items() if v} == {
        ("a", "p"): 3.0, ("a", "r"): 2.0, ("b", "p"): 1.0, ("b", "r"): 1.0,
    }  # fmt: skip
    assert limit_for(limits, "z", "a", "p") is None
    assert limit_for([*limits, Limit(metric="x", value=9.0, engine="a", profile="p")], "x", "a", "p").value == 9.0


def test_exit_codes() -> None:
    assert exit_code([Word.WITHIN, Word.EXPECTED, Word.INFO, Word.SKIPPED]) == 0
    assert exit_code([Word.WITHIN, Word.OUTSIDE]) == 1
    assert exit_code([]) == 0


@pytest.fixture(scope="module")
def case() -> Case:
    limits = (Limit(metric="position", value=1e-9), Limit(metric="event_times", value=1e-9))
    return replace(load("bouncing_ball", "linear"), limits=limits)


@pytest.fixture(scope="module")
def motion(case: Case) -> Trajectory:
    return truth_of(case).trajectory


def word(rows, metric: str) -> str:
    return rows.loc[rows["metric"] == metric, "verdict"].item()


def test_the_truth_is_within_and_named_in_every_row(case: Case, motion: Trajectory) -> None:
    rows = compare(case, [Entry(engine="fake", profile="good", run=motion)])
    assert word(rows, "position") == Word.WITHIN
    assert word(rows, "truth") == Word.WITHIN
    assert exit_code(rows["verdict"]) == 0
    assert set(rows["tier"]) == {Tier.A.value}
    assert rows["command"][rows["engine"] == "fake"].str.endswith("--engine fake:good").all()


def test_a_wrong_run_is_outside(case: Case, motion: Trajectory) -> None:
    bad = replace(motion, q=1.001 * motion.q)
    assert word(compare(case, [Entry(engine="fake", profile="bad", run=bad)]), "position") == Word.OUTSIDE


def test_nan_is_outside_even_where_nothing_is_judged(case: Case, motion: Trajectory) -> None:
    q = motion.q.copy()
    q[-1] = np.nan
    rows = compare(case, [Entry(engine="fake", profile="nan", run=replace(motion, q=q))])
    assert word(rows, "position") == Word.OUTSIDE


def test_a_run_that_did_not_finish_is_outside_with_advice(case: Case, motion: Trajectory) -> None:
    failed = replace(motion, outcome=Outcome.DIVERGED, message="at 3 s")
    rows = compare(case, [Entry(engine="fake", profile="short", run=failed)])
    assert word(rows, "finished") == Word.OUTSIDE
    assert "at 3 s" in rows["why"][0]
    assert Outcome.DIVERGED.advice in rows["why"][0]


@pytest.mark.parametrize(
    "who", ["reference:compiled", "reference:cvode", "mujoco:matched", "pinocchio:law", "pinocchio:admm"]
)
def test_what_did_not_finish_tells_where_it_was_first_and_what_to_do_last(
    who: str, case: Case, motion: Trajectory
) -> None:
    engine, profile = who.split(":")
    run = engines.load(engine).prepare(load("bouncing_ball", "linear"), profile, max_steps=20).run()
    failed = replace(motion, outcome=run.outcome, message=run.message)
    told = compare(case, [Entry(engine="fake", profile="short", run=failed)])["why"][0]
    assert told.startswith("step_limit: t = ")
    assert told.endswith(Outcome.STEP_LIMIT.advice)


def test_a_skipped_engine_is_a_row_with_its_sentence(case: Case) -> None:
    rows = compare(case, [Entry(engine="absent", profile="*", skipped="It is not installed.")])
    assert rows["verdict"][rows["engine"] == "absent"].tolist() == [Word.SKIPPED]
    assert rows["why"][0] == "It is not installed."
    assert exit_code(rows["verdict"]) == 0


PHYSICS = {
    "masses": [1.0], "gravity": 9.81, "constants": {"a0": [1e4], "a1": [20.0]}, "q0": [1.0], "v0": [0.0],
    "M": lambda q: np.array([[1.0]]), "bias": lambda q, v: np.array([9.81]), "H": lambda q: np.array([[1.0]]),
    "lam": lambda q, v: 9.81 - 20 * v - 1e4 * q,
}  # fmt: skip


def test_the_same_physics_passes_the_audit(case: Case) -> None:
    assert all(row.ok for row in audit(PHYSICS, PHYSICS, case))


@pytest.mark.parametrize("other", [0.2, 0.8])
def test_the_audit_shows_what_comes_nearest_to_its_own_tolerance(case: Case, motion: Trajectory, other: float) -> None:
    near = AuditRow(quantity="touches", mine="", theirs="", difference=other, tolerance=1.0)
    rows = (AuditRow(quantity="masses", mine="", theirs="", difference=5e-11, tolerance=1e-10), near)
    table = compare(case, [Entry(engine="fake", profile="other", run=motion, audit=rows)])
    shown = table[(table["engine"] == "fake") & (table["metric"] == "audit")].iloc[0]
    assert (shown["value"], shown["limit"]) == ((5e-11, 1e-10) if other < 0.5 else (0.8, 1.0))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("masses", [1.0 + 1e-9]),
        ("gravity", 9.80665),
        ("constants", {"a0": [1e4], "a1": [20.1]}),
        ("constants", {"solref": [0.02, 1.0]}),
        ("M", lambda q: np.array([[1.0 + 1e-9]])),
        ("bias", lambda q, v: np.array([9.81 + 1e-8])),
        ("lam", lambda q, v: np.array([np.nan])),
    ],
)
def test_other_physics_fails_the_audit_and_is_not_compared(
    case: Case, motion: Trajectory, key: str, value: object
) -> None:
    rows = audit({**PHYSICS, key: value}, PHYSICS, case)
    assert [row.quantity for row in rows if not row.ok] == [key]
    table = compare(case, [Entry(engine="fake", profile="other", run=motion, audit=rows)])
    assert table["metric"][table["engine"] == "fake"].tolist() == ["finished", "audit"]
    assert word(table, "audit") == Word.OUTSIDE
    assert key in table["why"][1]


def test_what_an_engine_does_not_show_is_wrong_unless_its_contract_says_so(case: Case) -> None:
    mine = {k: v for k, v in PHYSICS.items() if k != "H"}
    assert [row.quantity for row in audit(mine, PHYSICS, case) if not row.ok] == ["H"]
    rows = audit(mine, PHYSICS, case, {"H": "a reason"})
    assert all(row.ok for row in rows)
    assert next(row for row in rows if row.quantity == "H").mine == "not shown"


def test_difference_is_relative_to_the_larger_numbers() -> None:
    assert difference([1.0, 1e6], [1.0, 1e6 + 1.0]) == pytest.approx(1e-6)
    assert difference([0.0], [0.0]) == 0.0
    assert difference([1.0], [1.0, 2.0]) == math.inf


@pytest.mark.parametrize("unit", [1e-9, 1e-3, 1.0, 1e6])
def test_a_difference_of_the_audit_does_not_depend_on_the_unit(unit: float) -> None:
    """Inertias of small bodies are numbers far below 1."""
    mine, theirs = np.array([1.0, 2.0, 3.1]), np.array([1.0, 2.0, 3.0])
    assert difference(unit * mine, unit * theirs) == pytest.approx(0.1 / 3.0)
    assert difference(unit * mine, np.zeros(3)) == pytest.approx(3.1 * unit)


@pytest.mark.parametrize(
    ("off", "word"), [(0.4, Word.OUTSIDE), (0.6, Word.EXPECTED), (1.9, Word.EXPECTED), (2.1, Word.OUTSIDE)]
)
def test_a_stored_size_bounds_a_known_deviation_on_both_sides(off: float, word: Word) -> None:
    assert judge(off, KNOWN, None, stored=1.0)[0] == word


@pytest.mark.parametrize(("size", "word"), [(1.0, Word.EXPECTED), (0.5, Word.OUTSIDE), (math.inf, Word.INFO)])
def test_a_size_that_a_case_names_is_the_bound_where_none_is_stored(size: float, word: Word) -> None:
    assert judge(0.9, replace(KNOWN, known_size=size), None)[0] == word


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("limit", [True, False])
def test_what_is_nine_times_as_large_is_kept_and_what_is_eleven_times_is_lost(exact: bool, limit: bool) -> None:
    found = band(0.3, replace(LIMIT, value=0.0 if exact else 1.0) if limit else None)
    assert 9.0 * 0.3 < found < 11.0 * 0.3


def test_a_band_is_ten_times_what_was_stored() -> None:
    assert band(1.0, LIMIT) == 10.0
    assert band(0.0, LIMIT) == 1e-12
    assert band(0.0, replace(LIMIT, value=0.0)) == 0.0
    assert math.isnan(band(None, LIMIT))


def test_rounding_grows_with_what_is_claimed() -> None:
    claim = Claim(metric=LIMIT.metric, expected=-9810.0, tier=Tier.A, source="weight")
    assert band(0.0, LIMIT, claim) == pytest.approx(9.81e-9)


@pytest.mark.parametrize("word", [Word.OUTSIDE, Word.CRASHED])
def test_what_is_wrong_is_the_exit_code(word: Word) -> None:
    assert exit_code([Word.WITHIN, word]) == 1
    assert exit_code([Word.WITHIN], ["kept", "lost"]) == 1
    assert exit_code([Word.WITHIN], ["kept", ""]) == 0


@pytest.mark.parametrize(("share", "word"), [(0.3, Word.INFO), (0.7, Word.WITHIN)])
def test_the_part_that_was_compared_is_told_and_too_little_is_not_judged(
    share: float, word: Word, case: Case, motion: Trajectory
) -> None:
    truth = replace(truth_of(case), trusted=share * case.t_end)
    rows = {row.metric: row for row in judged(case, [Entry(engine="fake", profile="", run=motion)], truth, "")}
    assert rows["position"].verdict == word
    assert rows["position"].compared == pytest.approx(share, abs=0.02)
    assert rows["truth"].verdict == Word.OUTSIDE, "it must be trusted to the horizon"


@pytest.mark.parametrize(("off", "parts", "word"), [(1e-11, False, Word.WITHIN), (3e-7, False, Word.OUTSIDE),
                                                    (1e-3, True, Word.OUTSIDE)])  # fmt: skip
def test_two_truths_must_agree_to_a_multiple_of_the_tolerance(
    off: float, parts: bool, word: Word, case: Case, motion: Trajectory
) -> None:
    truth = truth_of(case)
    second = replace(motion, q=motion.q * (1.0 + off * motion.t / case.t_end)[:, None])
    found = held_against(replace(truth, trusted=math.inf), second, case, 1e-13)
    assert (found.trusted < case.t_end) == parts
    (row,) = truth_row(case, found, "")
    assert row.verdict == word


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.999])
def test_a_source_that_ended_early_agrees_as_far_as_it_went(share: float, case: Case, motion: Trajectory) -> None:
    at, ledger = motion.t <= share * case.t_end, motion.ledger
    short = replace(
        motion, ledger=None, outcome=Outcome.STEP_TOO_SMALL,
        **{name: getattr(motion, name)[at] for name in ("t", "q", "v", "gap", "lam", "energy", "mode")},
        events=tuple(event for event in motion.events if event.t <= share * case.t_end),
    )  # fmt: skip
    assert ledger is None or len(ledger.input) == len(motion.t)
    found = held_against(replace(truth_of(case), trusted=math.inf), short, case, 1e-9)
    assert found.trusted <= share * case.t_end
    (row,) = truth_row(case, found, "")
    assert row.verdict == Word.OUTSIDE
    assert row.compared <= share


@pytest.mark.parametrize(("end", "reached"), [(0.0, False), (0.5, False), (1.0 - 1e-6, False), (1.0 - 1e-12, True),
                                              (1.0 + 1e-12, True), (1.0 + 1e-6, False), (2.0, False)])  # fmt: skip
def test_a_record_ends_at_the_horizon_whatever_it_says_of_itself(
    end: float, reached: bool, case: Case, motion: Trajectory
) -> None:
    rows = compare(case, [Entry(engine="fake", profile="short", run=replace(motion, t=end * motion.t))])
    assert (word(rows, "finished") == Word.WITHIN) == reached


@pytest.mark.parametrize(("part", "lost"), [(1.0, False), (0.995, False), (0.9, True)])
def test_a_truth_that_is_known_less_far_than_when_runs_were_stored_is_worse(part: float, lost: bool) -> None:
    """What is not compared any more is no regression of an engine, and must not go unseen."""
    shipped = load("bouncing_ball", "linear")
    truth = replace(truth_of(shipped), trusted=part * shipped.t_end, allowed=1e-6, agreement={"position": 0.0})
    entry = Entry(
        engine="reference", profile="compiled", run=truth.trajectory,
        settings=engines.load("reference").prepare(shipped, "compiled").settings,
    )  # fmt: skip
    rows = judged(shipped, [entry], truth, "")
    (row,) = (each for each in rows if each.engine == TRUTH)
    assert (row.regression == Regression.LOST) == lost == ("stored runs" in row.why)
    assert all(math.isnan(each.band) == lost for each in rows if each.metric == "position")


@pytest.mark.parametrize("change", [{"parameters": {"height": 2.0}}, {"settings": {"rtol": 1e-3}}])
def test_what_was_stored_of_other_parameters_or_settings_is_not_taken(change: dict[str, Any]) -> None:
    engine = engines.load("reference")
    shipped = load("bouncing_ball", "linear")
    entry = Entry(engine="reference", profile="compiled", settings=engine.prepare(shipped, "compiled").settings)
    assert deviations(shipped, entry, shipped.t_end)
    other = load("bouncing_ball", "linear", **change.get("parameters", {}))
    settings = {**entry.settings, **change.get("settings", {})}
    assert deviations(other, replace(entry, settings=settings), other.t_end) == {}


@pytest.mark.parametrize(("default", "scale", "told"), [(True, 1.0, 0), (True, 2.0, 1), (False, 2.0, 0)])
def test_an_engine_whose_own_settings_have_changed_is_outside(default: bool, scale: float, told: int) -> None:
    shipped = load("bouncing_ball", "linear")
    run = engines.load("reference").prepare(shipped, "compiled")
    settings = {**run.settings, "rtol": scale * run.settings["rtol"]}
    entry = Entry(engine="reference", profile="compiled", run=run.run(), settings=settings, default=default)
    rows = [row for row in judged(shipped, [entry], truth_of(shipped), "") if row.metric == "settings"]
    assert [row.verdict for row in rows] == told * [Word.OUTSIDE]
    assert all("rtol=2e-09" in row.why for row in rows)


@pytest.mark.parametrize(
    ("asked", "own"),
    [({}, [True, True]), ({"reference:cvode.rtol": 1e-7}, [True, False])],
)
def test_settings_are_an_engines_own_unless_some_that_it_has_are_asked_for(
    asked: dict[str, float], own: list[bool], case: Case
) -> None:
    wanted = picks(["reference:compiled", "reference:cvode"])
    entries = jobs.run_case(case, wanted, settings=asked, refine=False).entries
    assert [entry.default for entry in entries] == own


@pytest.mark.parametrize("claimed", [False, True])
def test_events_that_a_run_does_not_have_are_outside_and_no_known_property_covers_them(
    claimed: bool, case: Case, motion: Trajectory
) -> None:
    claims = (Claim(metric="event_times", expected=0.0, tier=Tier.A, source="the truth"),) if claimed else ()
    known = replace(case, limits=(Limit(metric="*", known="it is known to do that"),), claims=claims)
    silent = replace(motion, events=(), mode=np.zeros_like(motion.mode))
    rows = {
        row.metric: row for row in judged(known, [Entry(engine="fake", profile="", run=silent)], truth_of(case), "")
    }
    assert math.isnan(rows["event_times"].value)
    assert rows["event_times"].verdict == Word.OUTSIDE


def test_whatever_is_claimed_or_limited_is_measured(case: Case, motion: Trajectory) -> None:
    """What only a claim asks for too; a number that the run does not have is told where it is claimed."""
    truth, entry = truth_of(case), Entry(engine="fake", profile="", run=motion)

    def values(**asked: Any) -> dict[str, float]:
        other = replace(case, **{"limits": (), "claims": (), **asked})
        return {row.metric: row.value for row in judged(other, [entry], truth, "")}

    own = {name: metric.measure(truth, motion, case) for name, metric in metrics.of(case).items() if metric.CLAIMED}
    known = {name: value for name, value in own.items() if value is not None}
    assert len(known) >= 5
    assert own.keys().isdisjoint(values())
    claimed = values(claims=tuple(Claim(metric=name, expected=1.0, tier=Tier.A, source="a book") for name in own))
    limited = values(limits=tuple(Limit(metric=name, value=1.0) for name in own))
    assert claimed.keys() >= own.keys()
    for found in (claimed, limited):
        assert {name: found[name] for name in known} == known


def test_a_number_that_is_missing_is_expected_only_where_it_was_missing_before(case: Case, motion: Trajectory) -> None:
    silent = replace(motion, ledger=None)
    known = replace(case, limits=(Limit(metric="*", known="it is known to do that"),))
    for each in (case, known):
        rows = judged(each, [Entry(engine="fake", profile="", run=silent)], truth_of(case), "")
        assert {row.metric: row.verdict for row in rows}["energy_integrator"] == Word.OUTSIDE


@pytest.mark.parametrize("name", ["bouncing_ball", "newtons_cradle", "soft_contact"])
def test_the_audit_looks_where_every_contact_is_entered(name: str) -> None:
    case = load(name)
    theirs = engines.load("reference").prepare(case, "compiled").audit()
    at = states(case, theirs)
    rows = case.law.unilateral
    assert len(at) == 20
    for q, v in at:
        assert (theirs["gap"](q)[rows] < 0.0).all()
        assert (theirs["H"](q)[rows] @ v < 0.0).all()


@pytest.mark.parametrize(("off", "same"), [(1e-12, True), (1e-8, False)])
def test_the_audit_allows_rounding_alone(off: float, same: bool, case: Case) -> None:
    mine = {**PHYSICS, "M": lambda q: np.array([[1.0 + off]])}
    assert all(row.ok for row in audit(mine, PHYSICS, case)) == same


@pytest.mark.parametrize(
    ("quantity", "factor", "word"),
    [
        ("lam", 1.0, Word.EXPECTED),
        ("lam", 3.0, Word.OUTSIDE),
        ("lam", 0.3, Word.OUTSIDE),
        ("masses", 1.0, Word.OUTSIDE),
    ],
)
def test_a_known_difference_of_the_audit_has_a_quantity_and_a_size(quantity: str, factor: float, word: Word) -> None:
    shipped = load("bouncing_ball", "linear")
    settings = engines.load("mujoco").prepare(shipped, "default").settings
    entry = Entry(engine="mujoco", profile="default", settings=settings, run=truth_of(shipped).trajectory)
    off = factor * deviations(shipped, entry, shipped.t_end)["audit lam"]
    row = AuditRow(quantity=quantity, mine="", theirs="", difference=off, tolerance=1e-10)
    found = {each.metric: each for each in judged(shipped, [replace(entry, audit=(row,))], truth_of(shipped), "")}
    assert found["audit"].verdict == word


def test_the_largest_difference_counts() -> None:
    assert difference([1.0, 2.0, 3.0], [1.0, 2.0, 4.0]) == 0.25


@pytest.mark.parametrize("metric", sorted(IDENTITIES))
def test_no_known_property_explains_what_a_run_says_of_itself(metric: str) -> None:
    for each in (load(name, variant) for name in cases_.names() for variant in cases_.variants(name)):
        limits = limits_of(each)
        for one in limits:
            found = limit_for(limits, metric, one.engine, one.profile)
            told = found is not None and found.known_least > 0.5 * found.known_size
            assert found is None or not found.known or told, (each.label, one.engine, one.profile)


@pytest.mark.parametrize("metric", ["energy_residual", "gap_residual"])
@pytest.mark.parametrize("label", ["tossed_cube:loaded", "newtons_cradle:pendulums", "held_weight:slips"])
def test_energies_and_gaps_beside_the_state_are_outside_at_parameters_that_are_not_stored(
    label: str, metric: str
) -> None:
    """DART's weight at a body's origin for its centre, an energy .05 off, was not judged for .2 s of a tossed cube."""
    each = replace(load(*label.split(":")), t_end=0.2)
    for engine in ("mujoco", "dart", "drake"):
        judge_ = Judge(each, Entry(engine=engine, profile="default"), truth_of(load("bouncing_ball", "linear")), "")
        assert judge_.judged(metric, 0.046, "1", judge_.truth, 1.0).verdict == Word.OUTSIDE


@pytest.mark.parametrize("radius", [0.02, 0.045])
def test_the_energy_by_which_spheres_turn_on_their_strings_is_known_on_both_sides(radius: float) -> None:
    each = load("newtons_cradle", "pendulums", radius=radius)
    judge_ = Judge(each, Entry(engine="mujoco", profile="default"), truth_of(load("bouncing_ball", "linear")), "")
    turning = 0.4 * (radius / each.number("length")) ** 2
    for times, word in ((1.0, Word.EXPECTED), (1.01, Word.OUTSIDE), (0.99, Word.OUTSIDE), (0.0, Word.OUTSIDE)):
        assert judge_.judged("energy_residual", times * turning, "1", judge_.truth, 1.0).verdict == word


def test_every_case_is_limited_in_all_that_it_has() -> None:
    every = {
        "start_error",
        "position",
        "velocity",
        "energy_drift",
        "energy_integrator",
        "energy_residual",
        "rate_residual",
    }
    rows = {"gap_residual", "mode_residual", "law_residual", "lam_impulse_path", "contact_work"}
    touch = {"gap_error", "event_gap", "complementarity", "event_times", "mode_times", "touch_count", "release_count"}
    for name in cases_.names():
        for variant in cases_.variants(name):
            each = load(name, variant)
            found = {
                limit.metric: limit.value for limit in limits_of(each) if (limit.engine, limit.profile) == ("*", "*")
            }
            wanted = every | (rows if each.contacts else set()) | (touch if each.law.touches.any() else set())
            assert wanted <= set(found), each.label
            assert found["position"] <= 1e-3, each.label
            assert found["velocity"] <= 1e-1, each.label


@pytest.mark.parametrize(("profile", "word"), [("as_is", Word.INFO), ("matched", Word.OUTSIDE)])
def test_a_file_as_it_stands_may_count_no_touches(profile: str, word: Word, case: Case, motion: Trajectory) -> None:
    """Its soft rows need not touch where the law's do: parts of its error tell how far they go."""
    silent = replace(motion, events=(), mode=np.zeros_like(motion.mode))
    entry = Entry(engine="mujoco", profile=profile, run=silent)
    rows = judged(replace(case, limits=AS_IT_STANDS), [entry], truth_of(case), "")
    assert {row.metric: row.verdict for row in rows}["event_times"] == word


def test_a_known_deviation_is_stored_as_the_run_has_it_and_anything_else_at_its_largest() -> None:
    """By half to twice of it the run is judged: the largest of runs beside it would put that outside."""
    known = bands._known(load("newtons_cradle", "sliders"), Entry(engine="pinocchio", profile="law"))
    assert "touch_count" in known
    assert "start_error" not in known
    known = bands._known(load("newtons_cradle", "sliders"), Entry(engine="mujoco", profile="default"))
    assert "penetration" in known, "which nothing limits"
    found = bands._largest({"a": 1.0, "b": 1.0, "c": 1.0}, {"a": 3.0, "b": 3.0}, frozenset({"a"}))
    assert found == {"a": 1.0, "b": 3.0, "c": 1.0}


@pytest.mark.parametrize("behind", [1e-4, 1e-3, 1e-2])
def test_what_is_stored_of_a_truth_that_ends_soon_after_an_event_judges_the_same_run(
    behind: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Comparisons end between two events, so that their numbers can agree: not where the truth is no longer known."""
    shipped = load("bouncing_ball", "linear")
    whole = truth_of(shipped)
    late = next(event.t for event in whole.trajectory.events if event.t > 0.6 * shipped.t_end)
    truth = replace(whole, trusted=late + behind, allowed=1.0, agreement={"position": 0.0})
    run = engines.load("reference").prepare(shipped, "compiled").run()
    entry = Entry(engine="reference", profile="compiled", run=run)
    result = jobs.CaseResult(case=shipped, truth=truth, entries=(entry,))
    monkeypatch.setattr(stored, "FILE", tmp_path / "stored.json")
    monkeypatch.setattr(jobs, "run_case", lambda *_, **__: result)
    stored._table.cache_clear()
    stored.write(bands._measured("bouncing_ball", "linear"))
    rows = {each.metric: each for each in judged(shipped, [entry], truth, "")}
    stored._table.cache_clear()
    assert rows["position"].regression == Regression.KEPT
    assert rows["truth"].regression == ""
