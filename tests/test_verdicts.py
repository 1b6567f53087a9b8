"""Numbers, limits and claims become words; words become the exit code."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from crossbody.cases import Case, Claim, Limit, Outcome, Tier, Trajectory, load
from crossbody.reports.judging.audit import audit, difference
from crossbody.reports.judging.comparison import Entry, compare
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.verdict import Word, exit_code, judge, limit_for

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


def test_model_error_stands_apart_from_discretisation(case: Case, motion: Trajectory) -> None:
    refined = replace(motion, q=motion.q + 1e-3)
    entry = Entry(engine="fake", profile="stepper", run=motion, refined=refined, settings={"dt": 1e-3})
    rows = compare(case, [entry])
    values = rows.set_index("metric")["value"]
    assert values["position (model)"] == pytest.approx(1e-3, rel=1e-6)
    assert values["position (discretisation)"] == pytest.approx(1e-3, rel=1e-2)
