"""What `run` prints: who is off and why, in a table that fits and loses no digit."""

from __future__ import annotations

import math
from itertools import pairwise

import click
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crossbody.reports import layout, voice
from crossbody.reports.commands import run_shown
from crossbody.reports.judging.parts import part_of
from crossbody.reports.judging.told import runs_of, sentence
from crossbody.reports.judging.verdict import Row, Verdict, Word
from crossbody.reports.runs.choice import DEFAULT_ENGINES

NARROW = 62
"""Width that the errors of the longest name need."""


def row(engine: str, metric: str, value: float, verdict: Word, limit: float = math.nan, case: str = "ball") -> Row:
    return Verdict(
        case=case, variant="v", engine=engine, profile="matched", metric=metric, value=value, unit="1", limit=limit,
        tier="A", verdict=verdict, why="the reason",
    ).row()  # fmt: skip


@given(
    st.lists(st.tuples(st.floats(), st.floats(), st.floats(1e-6, 1e5)), min_size=1, max_size=4),
    st.integers(NARROW, 200),
)
def test_the_table_fits_and_loses_no_digit(given_: list[tuple[float, float, float]], width: int) -> None:
    rows, times = [], {}
    for i, (error, step, wall) in enumerate(given_):
        rows += [row(f"engine{i}", "position", error, Word.WITHIN),
                 row(f"engine{i}", part_of("position", "step"), step, Word.INFO)]  # fmt: skip
        times["ball:v", f"engine{i}:matched"] = wall, 2.0 * wall
    heads, _, *lines = click.unstyle(run_shown.table(runs_of(rows), times, width)).splitlines()
    assert max(map(len, (heads, *lines))) <= width
    names = [head for head in heads.replace("in all", "all").split() if head[0] != "["]
    for line, (error, step, _) in zip(lines, given_, strict=True):
        shown = dict(zip(names, line.split()[1:], strict=True))
        for name, value in (("position", error), ("step", step)):
            if name in shown and value == value:
                assert shown[name] == f"{value:.1e}"


def test_a_run_that_nothing_judges_is_not_counted_as_within() -> None:
    rows = [
        row("a", "position", 1e-9, Word.WITHIN, 1e-6),
        row("b", "finished", 1.0, Word.WITHIN, 0.0),
        row("b", "position", 1.0, Word.INFO),
    ]
    text = sentence(runs_of(rows))
    assert text.startswith("The run is within all limits.")
    assert "Without a limit: b:matched on ball:v." in text
    assert sentence(runs_of(rows[1:])) == "Nothing is judged, since no number has a limit."


def test_a_number_beyond_its_limit_that_is_not_judged_is_named_and_not_counted_as_within() -> None:
    rows = [
        row("a", "position", 1e-9, Word.WITHIN, 1e-6),
        row("b", "velocity", 1e-1, Word.INFO, 1e-6),
        row("b", "position", 2.4e-5, Word.INFO, 1e-6),
        row("b", part_of("position", "importer"), 0.0, Word.INFO),
        row("c", "penetration", 1e-3, Word.INFO),  # without a limit
    ]
    text = sentence(runs_of(rows))
    assert text.splitlines() == [
        "1 of 2 runs is within all limits, 1 is beyond a limit and not judged (position up to 24 times its limit).",
        "- Beyond, not judged: b:matched on ball:v (position 2.4e-05, 24 times its limit): The reason.",
        "- Without a limit: c:matched on ball:v.",
    ]
    shown = click.unstyle(run_shown.table(runs_of(rows), {}, 200)).splitlines()
    assert [shown[0].split()[-2:], *(line.split()[-2:] for line in shown[2:])] == [
        ["beyond", "outside"], ["0", "0"], ["2", "0"], ["0", "0"]
    ]  # fmt: skip
    assert run_shown.counted(rows) == "4 not judged (2 beyond a limit), 1 within"
    step = row("b", part_of("position", "step"), 2.0e-5, Word.INFO)
    assert "24 times its limit, mostly its step" in sentence(runs_of([*rows, step]))


@pytest.mark.parametrize("seed", range(20))
def test_an_exit_code_that_is_0_names_what_it_does_not_count(seed: int, capsys: pytest.CaptureFixture[str]) -> None:
    draw = np.random.default_rng(seed)
    known, loose, within = (int(n) for n in draw.integers(0, 3, 3))
    rows = [row("a", f"x{k}", 1.0, Word.EXPECTED, 1e-3) for k in range(known)]
    rows += [row("a", f"y{k}", 1.0, Word.INFO, 1e-3) for k in range(loose)]
    rows += [row("a", f"z{k}", 1.0, Word.WITHIN, 2.0) for k in range(within)]
    run_shown.show_code(rows, 0)
    said = " ".join(capsys.readouterr().out.split())
    assert (f"{known} expected-outside" in said, f"{loose} beyond a limit" in said) == (known > 0, loose > 0)
    assert said.startswith("Exit code 0: nothing is outside." if known + loose else "")
    run_shown.show_code(rows, 1)
    assert not capsys.readouterr().out


def test_columns_go_before_digits_and_errors_go_last() -> None:
    rows = [row("mujoco", name, 1.23e-4, Word.INFO) for name in run_shown.SHOWN.values()]
    rows += [row("mujoco", "velocity", 1.0, Word.EXPECTED), row("mujoco", "gap_error", 1.0, Word.INFO, 1e-6)]
    times = {("ball:v", "mujoco:matched"): (12.5, 80.0)}
    shown = [
        [head for head in (*run_shown.LEFT_OUT, "position", "outside") if head.split()[0] in table.splitlines()[0]]
        for table in (run_shown.table(runs_of(rows), times, width) for width in range(200, 20, -1))
    ]
    assert "position" in shown[-1]
    assert len(shown[0]) == len(run_shown.LEFT_OUT) + 1, "nothing is within: the column says nothing"
    assert all(set(after) <= set(before) for before, after in pairwise(shown))


def test_the_sentence_names_who_is_off_by_how_much_and_by_which_part() -> None:
    rows = [
        row("reference", "position", 1e-9, Word.WITHIN, 1e-6), row("mujoco", "velocity", 2e-3, Word.OUTSIDE, 1e-3),
        row("mujoco", "position", 5e-3, Word.OUTSIDE, 1e-4),
        row("mujoco", part_of("position", "model"), -4.9e-3, Word.INFO),
        row("mujoco", part_of("position", "step"), 1e-4, Word.INFO),
    ]  # fmt: skip
    text = sentence(runs_of(rows))
    assert text.startswith("1 of 2 runs is within all limits, 1 is outside.")
    assert "mujoco:matched on ball:v (position 0.005, 50 times its limit, mostly its model)" in text


@pytest.mark.parametrize("metric", ["restitution_error", "largest position (step)", "audit", "start_error"])
@pytest.mark.parametrize("position", [Word.WITHIN, Word.OUTSIDE])
def test_a_number_without_parts_is_blamed_on_what_is_wrong_in_the_motion(metric: str, position: Word) -> None:
    """But not what an engine was given, and not where the motion is right."""
    rows = [
        row("b", metric, 5e-4, Word.OUTSIDE, 1e-6), row("b", "position", 5e-5, position, 1e-5),
        row("b", part_of("position", "model"), 3e-6, Word.INFO), row("b", part_of("position", "step"), 5e-5, Word.INFO),
    ]  # fmt: skip
    blamed = position == Word.OUTSIDE and metric not in ("audit", "start_error")
    said = "; its error of position: mostly the step" if blamed else ""
    assert f"b:matched on ball:v ({metric} 0.0005, 500 times its limit{said})." in sentence(runs_of(rows))


def test_a_share_of_the_whole_is_no_multiple_of_its_limit() -> None:
    fit = row("a", "fit th1", -4.5e4, Word.OUTSIDE, 10.0) | {"unit": "%", "expected": 100.0}
    assert "(fit th1 -4.5e+04 %, where at least 90 % is valid)." in sentence(runs_of([fit]))


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_has_no_number_is_off_the_farthest(value: float) -> None:
    rows = [row("a", "position", 1.0, Word.OUTSIDE, 1e-9), row("b", "lam_impulse", value, Word.OUTSIDE, 1.0)]
    assert "- Outside: b:matched on ball:v (lam_impulse outside).\n- Outside: a:matched" in sentence(runs_of(rows))


def test_an_engine_that_is_absent_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    rows = [row("drake", "run", math.nan, Word.SKIPPED, case=f"case{i}") for i in range(5)]
    run_shown.show([*rows, row("reference", "position", 1e-9, Word.WITHIN, 1e-6)], {})
    said = capsys.readouterr().out
    assert said.count("drake") == 1
    assert "skipped: drake:matched on 5 cases. the reason" in said


def test_a_row_without_a_unit_has_none(capsys: pytest.CaptureFixture[str]) -> None:
    run_shown.show([row("mujoco", "position", 2.0, Word.OUTSIDE, 1.0)], {})
    assert "outside: ball:v mujoco:matched position 2, limit 1. the reason" in capsys.readouterr().out


@pytest.mark.parametrize(
    "why", ["not_finite: t = 0.00123456789 s, q = [nan]: " + "see the state named. " * 9, "short."]
)
def test_a_run_that_failed_is_one_sentence_and_one_entry(why: str, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [
        row("mujoco", "position", math.nan, Word.OUTSIDE, 1e-6),
        row("mujoco", "friction_power", math.nan, Word.OUTSIDE),
        row("mujoco", "finished", 0.0, Word.OUTSIDE, 0.0) | {"why": why},
        row("reference", "position", 1e-9, Word.WITHIN, 1e-6),
    ]
    run_shown.show(rows, {})
    said = capsys.readouterr().out
    folded = " ".join(said.split())
    assert said.count("outside: ") == 1
    assert f"outside: ball:v mujoco:matched did not finish. {' '.join(why.split())} The report" in folded
    assert "the 2 numbers that this makes wrong; a shorter --t-end" in folded
    assert "- Outside: mujoco:matched on ball:v (did not finish)." in folded
    assert "nan W" not in said
    assert "limit nan" not in said


def test_the_time_of_the_command_is_told_by_its_parts(capsys: pytest.CaptureFixture[str]) -> None:
    times = {
        ("a:v", "one:p"): (9.0, 2.0),
        ("b:v", "one:q"): (9.0, 3.0),
        ("a:v", "two:p"): (9.0, 1.5),
        ("a:v", "truth:"): (9.0, None),
    }
    run_shown.show_time([10.0, 21.0, 21.5, 24.5], times, compiling=1.25)
    said = capsys.readouterr().out.replace("\n   ", "")
    assert said.startswith("Time: 14.5 s: runs 11.0 (one 5.0, two 1.5, compiling 1.2, truths 3.2)")


def test_a_number_that_is_none_is_not_written_as_one(capsys: pytest.CaptureFixture[str]) -> None:
    rows = [row("mujoco", "friction_power", math.nan, Word.OUTSIDE), row("mujoco", "x", math.nan, Word.OUTSIDE, 1e-6)]
    run_shown.show(rows, {})
    said = " ".join(capsys.readouterr().out.split())
    assert "outside: ball:v mujoco:matched friction_power has no number outside:" in said
    assert "outside: ball:v mujoco:matched x has no number, limit 1e-06 The reason of these 2: the reason" in said


def test_a_statement_about_a_case_is_no_number_that_is_missing(capsys: pytest.CaptureFixture[str]) -> None:
    """Neither changed limits nor a claim that the truth contradicts is one."""
    about = row("truth", "limits", math.nan, Word.OUTSIDE) | {"profile": "", "why": "Limits are others."}
    run_shown.show([row("mujoco", "x", 1e-7, Word.WITHIN, 1e-6), about], {})
    said = " ".join(capsys.readouterr().out.split())
    assert "outside: ball:v truth: limits. Limits are others." in said
    assert "no number" not in said


@pytest.mark.parametrize("place", range(60))
def test_a_number_stays_with_its_unit_and_limit(place: int, capsys: pytest.CaptureFixture[str]) -> None:
    run_shown.show([row("mujoco", "x" * (place + 1), 4.56e-4, Word.OUTSIDE, 1e-5) | {"unit": "kg m^2/s"}], {})
    said = capsys.readouterr().out
    assert "0.000456 kg m^2/s" in said
    assert "limit 1e-05" in said
    assert layout.NO_BREAK not in said


@given(st.lists(st.text("abc:/_-.0123456789", min_size=1, max_size=100), min_size=1, max_size=60))
def test_sentences_fit_80_columns_and_keep_every_word(words: list[str]) -> None:
    """Beside what is one word, such as a path."""
    for lines in (layout.told(" ".join(words)).split("\n"), voice.folded(" ".join(words)).split("\n")):
        assert all(len(line) <= 80 or len(line.split()) == 1 for line in lines)
        assert " ".join(lines).split() == words
        assert all(line.startswith("    ") for line in lines[1:])


@pytest.mark.parametrize("seed", range(20))
def test_every_reason_is_told_once_behind_all_numbers_that_have_it(seed: int) -> None:
    draw = np.random.default_rng(seed)
    reasons = [f"because {k}." for k in range(3)]
    rows = [
        row(who, f"metric_{k}", draw.uniform(2.0, 9.0), Word.OUTSIDE, 1.0) | {"why": str(draw.choice(reasons))}
        for who in ("a", "b") for k in range(5)
    ]  # fmt: skip
    lines = run_shown.wrong(runs_of(rows))
    assert sum(line.startswith("outside: ") for line in lines) == len(rows)
    seen = list[str]()
    for line in lines:
        seen.append(" ".join(line.split(". because")[0].split()[2:4]))
        why = next((one for one in reasons if one in line), "")
        if not why:
            continue
        mine = [f"{one['engine']}:matched {one['metric']}" for one in rows if one["why"] == why]
        told = seen if line.startswith("outside") else seen[:-1]
        assert sorted(told) == sorted(mine)
        assert line.startswith("outside") or f"these {len(mine)}:" in line
        seen = []
    assert sum(line.count("because") for line in lines) == len({one["why"] for one in rows})


def test_engines_that_nobody_selected_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    run_shown.show_unselected(["reference"])
    assert not capsys.readouterr().out
    run_shown.show_unselected([])
    said = capsys.readouterr().out
    assert said.startswith("Not selected: ")
    assert all(name in said for name in ("dart", "drake", "exudyn", "pymunk"))
    assert not any(name in said for name in DEFAULT_ENGINES)


def test_a_dash_of_a_part_says_why_there_is_none(capsys: pytest.CaptureFixture[str]) -> None:
    off = row("mujoco", "position", 2.0, Word.OUTSIDE, 1.0)
    parts = [row("mujoco", part_of("position", one), math.nan, Word.INFO) for one in ("model", "step")]
    run_shown.show([off, *(one | {"why": "Not measured. No order."} for one in parts)], {})
    assert "not measured: model and step of mujoco:matched on ball:v. No order." in capsys.readouterr().out
