"""The one sentence about a run: its counts add up, and whom it names is farthest off."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases.defaults import limits_of
from crossbody.reports.importers.compare import OK, QUANTITIES, Row
from crossbody.reports.importers.told import grid
from crossbody.reports.judging.parts import part_of
from crossbody.reports.judging.remedies import remedy
from crossbody.reports.judging.told import NAMED, in_times, known_until, runs_of, sentence
from crossbody.reports.judging.verdict import UNMEASURED, Word
from crossbody.reports.pages import grid as pages_grid

CAUSE = "soft contacts, of a step: and what follows"
KINDS = ("within", "expected", "outside", "unbounded", "unlimited", "skipped", "mixed")


def row(who: str, verdict: Word, metric: str = "position", **more: Any) -> dict[str, Any]:
    engine, _, profile = who.partition(":")
    return {
        "case": "ball", "variant": "hard", "engine": engine, "profile": profile, "metric": metric, "verdict": verdict,
        "value": 1e-4, "expected": None, "limit": 1e-3, "why": "", "compared": 1.0,
    } | more  # fmt: skip


def rows_of(who: str, kind: str, times: float) -> list[dict[str, Any]]:
    """What a run of some kind says; `times` is by how many times it is beyond its limit, where it is."""
    if kind == "skipped":
        return [row(who, Word.SKIPPED, "run", value=None, limit=None)]
    finished = row(who, Word.WITHIN, "finished", value=1.0, expected=1.0, limit=0.0)
    beyond = {"value": times * 1e-3}
    return [finished, *{
        "within": [row(who, Word.WITHIN), row(who, Word.INFO, "speed", value=7.0, limit=None)],
        "expected": [row(who, Word.EXPECTED, "velocity", value=1.0), row(who, Word.EXPECTED, **beyond, why=CAUSE)],
        "outside": [row(who, Word.OUTSIDE, **beyond), row(who, Word.OUTSIDE, "velocity", value=1.5e-3)],
        "unbounded": [row(who, Word.INFO, **beyond), row(who, Word.WITHIN, "velocity")],
        "unlimited": [row(who, Word.INFO, limit=None)],
        "mixed": [
            row(who, Word.EXPECTED, "velocity", value=1.0), row(who, Word.INFO, **beyond, why=UNMEASURED + CAUSE),
        ],
    }[kind]]  # fmt: skip


def digits(times: float) -> str:
    """Two of a number below 1000, and no exponent."""
    return f"{round(times, -1):.0f}" if times >= 99.5 else f"{times:.0f}" if times >= 9.95 else f"{times:.2g}"


@pytest.mark.parametrize(
    ("factor", "said"),
    [(1.04, "1 times"), (1.66, "1.7 times"), (15.6, "16 times"), (1234.0, "1,200 times"), (15873.0, "16,000 times"),
     (2.5e6, "2,500,000 times"), (9e7, "9e+07 times")],
)  # fmt: skip
def test_a_factor_is_said_in_plain_digits(factor: float, said: str) -> None:
    assert in_times(factor) == said


def named(text: str, begin: str) -> tuple[list[str], int]:
    """Whom the lines of a sentence that begin so name, and how many more there are."""
    told = [line.removeprefix(f"- {begin}: ") for line in text.splitlines() if line.startswith(f"- {begin}: ")]
    more = [int(found[1]) for line in told if (found := re.fullmatch(r"and (\d+) more\.", line))]
    return [line.split(" ")[0] for line in told if not line.startswith("and ")], sum(more)


@pytest.mark.parametrize("seed", range(200))
def test_the_counts_of_a_sentence_add_up(seed: int) -> None:
    rng = np.random.default_rng(seed)
    kinds = rng.choice(KINDS, rng.integers(1, 16), p=[0.2, 0.2, 0.2, 0.15, 0.1, 0.05, 0.1])
    times = dict(zip((f"e{k}:p" for k in range(len(kinds))), rng.uniform(2.0, 900.0, len(kinds)), strict=True))
    kind_of = dict(zip(times, kinds, strict=True))
    kinds_of = {"unbounded": ("unbounded", "mixed")}  # what is expected beside what nobody measured is not judged
    by = {
        kind: [who for who, one in zip(times, kinds, strict=True) if one in kinds_of.get(kind, (kind,))]
        for kind in KINDS
    }
    truth = row("truth:", Word.WITHIN, "truth", compared=float(rng.choice([0.31, 1.0])))
    told = [truth, *(one for who, kind in zip(times, kinds, strict=True) for one in rows_of(who, kind, times[who]))]
    text = sentence(runs_of(told))
    judged = sum(len(by[kind]) for kind in ("within", "expected", "outside", "unbounded"))
    if not judged:
        why = "no number has a limit" if by["unlimited"] else "no engine has run"
        assert text.startswith(f"Nothing is judged, since {why}.")
        return
    first = text.splitlines()[0]
    count = re.match(r"(\d+) of (\d+) runs (is|are) within all limits|The run is (.*?)(?: \(.*\))?\.", first)
    assert count
    words = {"within": "within all limits", "expected": "expected-outside", "outside": "outside",
             "unbounded": "beyond a limit and not judged"}  # fmt: skip
    if judged == 1:
        assert count[4] == next(word for kind, word in words.items() if by[kind])
    else:
        assert (int(count[1]), int(count[2])) == (len(by["within"]), judged)
        assert count[3] == ("is" if len(by["within"]) == 1 else "are")
        told_of = {word: int(n) for n, word in re.findall(r", (\d+) (?:is|are) ([a-z -]*[a-z])", first)}
        assert told_of == {word: len(by[kind]) for kind, word in words.items() if by[kind] and kind != "within"}
    for kind in ("expected", "unbounded"):  # how far they are stands beside how many
        if most := max(by[kind], key=times.__getitem__, default=None):
            size = f"position up to {digits(times[most])} times its limit)"
            whom = f"{', '.join(by[kind])}; " if kind == "expected" else ""
            assert f"{words[kind]} ({whom}{size}" in first
            size = f"position {times[most] * 1e-3:.2g}, {digits(times[most])} times its limit"
            head = "Expected-outside, the largest" if kind == "expected" else "Beyond, not judged"
            assert f"- {head}: {most} on ball:hard ({size}): Soft contacts, of a step." in text or (
                kind == "unbounded" and "mixed" not in kind_of[most]
            )
    for kind, begin in (("outside", "Outside"), ("unbounded", "Beyond, not judged")):
        farthest = sorted(by[kind], key=lambda who: -times[who])
        assert named(text, begin) == (farthest[:NAMED], max(len(farthest) - NAMED, 0))
        for who in farthest[:NAMED]:
            assert f"{who} on ball:hard (position {times[who] * 1e-3:.2g}, {digits(times[who])} times its limit" in text
    assert named(text, "Without a limit") == (by["unlimited"][:NAMED], max(len(by["unlimited"]) - NAMED, 0))
    assert ("0.31 of the horizon" in text) == (truth["compared"] < 1.0)


def test_a_number_that_is_off_is_named_before_one_that_there_is_not() -> None:
    """A run without a touch has no instants of it; how far it is off says more."""
    lost = row("fake:one", Word.OUTSIDE, "mode_times", value=math.nan)
    off = row("fake:one", Word.OUTSIDE, "position", value=0.16)
    for rows in ((lost, off), (off, lost)):
        assert "- Outside: fake:one on ball:hard (position 0.16, " in sentence(runs_of(rows))
    assert "- Outside: fake:one on ball:hard (mode_times outside)." in sentence(runs_of([lost]))


@pytest.mark.parametrize(
    ("why", "said"),
    [
        ("Known up to 0.2 s: more than one set keeps the law. Compiled.", ("0.2 s", "more than one set keeps the law")),
        ("Compiled. Followed to 0.39 s of 1 s: more takes longer.", ("0.39 s", "more takes longer")),
        ("Compiled at 1e-12 agrees.", ("", "")),
    ],
)
def test_the_sentence_says_why_a_truth_is_known_in_part(why: str, said: tuple[str, str]) -> None:
    rows = [row("fake:one", Word.WITHIN), row("truth:", Word.WITHIN, "truth", why=why, compared=0.2)]
    until, reason = said
    part = f"{until}, 0.2 of the horizon ({reason})" if until else "0.2 of the horizon"
    assert f"ball:hard, {part}." in sentence(runs_of(rows))
    assert known_until(rows, 3.0) == (pytest.approx(0.6), reason)
    assert known_until(rows[:1], 3.0) == (3.0, "")


@pytest.mark.parametrize("seed", range(20))
def test_a_grid_has_every_quantity_that_any_engine_has_and_nothing_where_one_lacks_it(seed: int) -> None:
    rng, engines = np.random.default_rng(seed), ("one", "two", "three")
    rows = [
        Row(engine=engine, version="" if engine == "two" else "1.0", quantity=quantity)
        for engine in engines for quantity in QUANTITIES if rng.random() < 0.3
    ]  # fmt: skip
    told = {(row.engine, row.quantity) for row in rows}
    heading, versions, *lines = grid(rows)
    assert set(heading[1:]) == {engine for engine, _ in told}
    assert dict(zip(heading[1:], versions[1:], strict=True)) == {e: "" if e == "two" else "1.0" for e in heading[1:]}
    assert [line[0] for line in lines] == [one for one in QUANTITIES if any(one == quantity for _, quantity in told)]
    shown = {(heading[i], line[0]) for line in lines for i, cell in enumerate(line) if i and cell == OK}
    assert shown == told


@pytest.mark.parametrize("seed", range(100))
def test_the_sentence_and_the_pages_count_the_same_runs(seed: int) -> None:
    """A run that is not held to a limit that it is beyond is green nowhere."""
    rng = np.random.default_rng(seed)
    kinds = rng.choice(KINDS, rng.integers(2, 9))
    told = [{"who": f"e{k}:p"} | one for k, kind in enumerate(kinds) for one in rows_of(f"e{k}:p", kind, 7.0)]
    cells = [pages_grid.whole("ball:hard", "page", who, mine, None) for who, mine in pages_grid.by(told, "who").items()]
    within = sum(kind == "within" for kind in kinds)
    words = {"within": "within", "expected": "expected-outside", "outside": "outside", "unbounded": "not judged",
             "skipped": "skipped"}  # fmt: skip
    assert [(cell.word, "beyond" in cell.text) for cell, kind in zip(cells, kinds, strict=True) if kind in words] == [
        (words[kind], kind == "unbounded") for kind in kinds if kind in words
    ]
    text = sentence(runs_of(told))
    if count := re.match(r"(\d+) of \d+ runs", text):
        assert int(count[1]) == within
    if "all within" in pages_grid.verdict(told):
        assert not {"expected", "outside", "unbounded"} & set(kinds)


def test_the_sentence_says_of_what_the_largest_deviation_is_and_relative_to_what() -> None:
    rows = [
        row("one:p", Word.EXPECTED, "touch_count", value=231.0, limit=0.0, why=CAUSE),
        row("one:p", Word.EXPECTED, value=0.034, why=CAUSE, where="x by 0.0084 m at 1 s"),
        row("two:p", Word.OUTSIDE, "touch_count", value=3.0, limit=0.0),
        row("two:p", Word.OUTSIDE, "event_times", value=0.5, unit="s"),
    ]
    text = sentence(runs_of(rows))
    said = "one:p on ball:hard (position x by 0.0084 m at 1 s, 34 times its limit): Soft contacts, of a step."
    assert f"- Expected-outside, the largest: {said}" in text
    assert "- Outside: two:p on ball:hard (event_times 0.5 s, 500 times its limit)" in text


@pytest.mark.parametrize("seed", range(10))
def test_of_positions_the_largest_of_each_unit_is_said(seed: int) -> None:
    """Not the largest part of what a coordinate is: one that hardly moves is off by many times that."""
    draw = np.random.default_rng(seed)
    sizes = 10.0 ** draw.uniform(-6.0, 1.0, 6)
    units = draw.choice(["m", "rad"], 6).tolist()
    rows = [
        row(f"e{k}:p", Word.EXPECTED, value=float(10.0 ** draw.uniform(-3.0, 3.0)), why=CAUSE,
            where=f"x{k} by {size:.2g} {unit} at 1 s")
        for k, (size, unit) in enumerate(zip(sizes, units, strict=True))
    ]  # fmt: skip
    said = sentence(runs_of(rows))
    most = {max((k for k in range(6) if units[k] == unit), key=lambda k: float(f"{sizes[k]:.2g}")) for unit in units}
    assert {k for k in range(6) if f"(position x{k} by" in said} == most
    assert len(named(said, "Expected-outside, the largest")[0]) == len(most)


def test_a_truth_in_doubt_is_no_run_that_is_off() -> None:
    """What engines are held against stands apart from them: all may be within its limits."""
    rows = [row("reference:compiled", Word.WITHIN), row("truth:", Word.OUTSIDE, "truth", value=1.0)]
    said = sentence(runs_of(rows))
    assert said.startswith("The run is within all limits.\n- In doubt: truth on ")
    assert "utside" not in said


@pytest.mark.parametrize("name", cases.names())
def test_the_sentence_ends_with_a_whole_clause_of_a_known_cause(name: str) -> None:
    for cause in {limit.known for limit in limits_of(cases.load(name)) if limit.known}:
        finished, *others = rows_of("ball:hard", "expected", 20.0)
        said = sentence(runs_of([finished, *(one | {"why": cause} for one in others)])).removesuffix(".").split()
        assert said[-1] not in ("a", "an", "and", "but", "for", "in", "model", "of", "or", "the", "with"), said


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"model": (1e-6, 2e-4), "step": (1.7e-3, 2e-4)},
         "step 100 %, model below 11.8 %; a shorter step (--set-engine e.dt=0.0005) makes it smaller."),
        ({"importer": (0.0, 1e-12), "model": (1.6e-3, 1e-9), "step": (1e-4, 1e-9)},
         "model 94.1 %, step 5.88 %; no shorter step makes it smaller"),
        ({"importer": (1.7e-3, 1e-12), "model": (0.0, 1e-9)}, "importer 100 %; the engine reads the file"),
        ({"model": (math.nan, math.nan), "step": (None, None)}, "is not known: if a shorter step"),
    ],
)  # fmt: skip
def test_a_run_beyond_its_limit_is_told_what_makes_its_error_smaller(
    parts: dict[str, tuple[float | None, float | None]], said: str
) -> None:
    off = row("e:p", Word.INFO, value=1.7e-3, why=f"{UNMEASURED}steps")
    rows = [off | {"settings": "dt=0.002 solver=NEWTON"}]
    rows += [
        row("e:p", Word.INFO, part_of("position", part), value=value, known=known, limit=math.nan)
        for part, (value, known) in parts.items()
    ]
    text = sentence(runs_of(rows))
    assert said in text
    assert text.startswith("The run is beyond a limit and not judged (position up to 1.7 times its limit).")
    without = sentence(runs_of([rows[0] | {"settings": "tol=1e-9"}, *rows[1:]]))
    assert "makes it smaller" not in without


@pytest.mark.parametrize("seed", range(20))
def test_parts_keep_their_signs_and_a_step_makes_no_error_smaller_than_the_models_own(seed: int) -> None:
    rng = np.random.default_rng(seed)
    whole = float(10.0 ** rng.uniform(-3, 0))
    model = whole * float(rng.uniform(-0.4, 1.6))
    parts = {"position (model)": model, "position (step)": whole - model, "largest position (model)": 2.0 * abs(model)}
    more = {"settings": "dt=0.002", "known": 1e-9}
    rows = [row("mujoco:as_is", Word.INFO, "position", value=whole, **more)]
    rows += [row("mujoco:as_is", Word.INFO, name, value=value, **more) for name, value in parts.items()]
    said = remedy("mujoco:as_is", rows, "position")
    assert said.startswith("Its parts: ")
    told = {part: float(share) / 100.0 for part, share in re.findall(r"(model|step) (-?[\d.e+]+) %", said)}
    assert sum(told.values()) == pytest.approx(1.0, abs=0.01)
    if abs(model) > abs(whole - model):
        assert "no shorter step makes it smaller" in said
    elif 2.0 * abs(model) < whole:
        assert (
            f"makes it smaller, to {2.0 * abs(model):.2g} at best: by so much the model alone is off at another instant"
            in said
        )
    else:
        assert f"makes it smaller there, but elsewhere the model alone is off by {2.0 * abs(model):.2g}" in said
