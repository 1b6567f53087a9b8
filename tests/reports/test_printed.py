"""What `run` prints is read again: nothing is told of what is right, and what is another one is."""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crossbody.cases.errors import OwnFault
from crossbody.reports import layout
from crossbody.reports.commands import printed, run_shown
from crossbody.reports.judging import told
from crossbody.reports.judging.parts import PARTS, part_of
from crossbody.reports.judging.verdict import Row, Verdict, Word

POSITIONS = ("position", *(part_of("position", part) for part in PARTS))
Shown = Callable[[list[Row], Any], str]


def row(who: str, metric: str, value: float, verdict: Word, limit: float = math.nan, known: float = math.nan) -> Row:
    engine, profile = who.split(":")
    return Verdict(
        case="ball", variant=f"v{len(engine) % 2}", engine=engine, profile=profile, metric=metric, value=value,
        unit="m", limit=limit, tier="A", verdict=verdict, why="the limit of a law", known=known,
    ).row()  # fmt: skip


def drawn(seed: int) -> tuple[list[Row], dict[tuple[str, str], tuple[float, float | None]]]:
    """Rows of some runs, of every verdict, with distinct numbers of any size; and their times."""
    rng = np.random.default_rng(seed)
    words, rows, times = list(Word), list[Row](), {}
    for k in range(rng.integers(1, 6)):
        who = f"engine{'s' * k}:p"
        kinds = rng.choice([word for word in words if word != Word.SKIPPED], 8)
        for metric in POSITIONS[: rng.integers(1, 5)]:
            value, known = 10.0 ** rng.uniform(-300.0, 5.0), 10.0 ** rng.uniform(-12.0, -9.0)
            rows.append(row(who, metric, value, Word.INFO, known=known if metric != "position" else math.nan))
        for i, word in enumerate(kinds):
            limit = float(rng.choice([math.nan, 0.0, 10.0 ** rng.uniform(-9.0, 0.0)]))
            value = math.nan if rng.random() < 0.1 else float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-14.0, 9.0))
            rows.append(row(who, f"metric_{i}", value, Word(word), limit))
        if rng.random() < 0.2:
            rows.append(row(who, "finished", 0.0, Word.OUTSIDE, 0.0))
        label = f"ball:{rows[-1]['variant']}"
        times[label, who] = (
            10.0 ** rng.uniform(-6.0, 4.0),
            None if rng.random() < 0.2 else 10.0 ** rng.uniform(-3.0, 4.0),
        )
    rows.append(row("absent:*", "run", math.nan, Word.SKIPPED))
    return rows, times


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shown:
    """What is printed of rows and times, to a terminal of 160 columns."""
    monkeypatch.setattr(shutil, "get_terminal_size", lambda *_: os.terminal_size((160, 24)))

    def show(rows: list[Row], times: Any) -> str:
        run_shown.show(rows, times)
        return capsys.readouterr().out

    return show


@pytest.mark.parametrize("width", [40, 62, 80, 100, 120, 200])
@pytest.mark.parametrize("seed", range(12))
def test_what_is_right_is_not_told(seed: int, width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "get_terminal_size", lambda *_: os.terminal_size((width, 24)))
    for k in range(5):
        run_shown.show(*drawn(100 * seed + k))


@given(st.lists(st.tuples(st.floats(), st.floats(allow_nan=False), st.floats(1e-9, 1e9)), min_size=1, max_size=4))
def test_numbers_of_any_size_are_read_as_they_are(given_: list[tuple[float, float, float]]) -> None:
    rows, times = list[Row](), {}
    for i, (error, step, wall) in enumerate(given_):
        rows += [row(f"e{i}:p", "position", error, Word.INFO), row(f"e{i}:p", POSITIONS[3], step, Word.INFO)]
        times["ball:v0", f"e{i}:p"] = wall, wall
    run_shown.show(rows, times)


def test_nothing_is_told_where_nothing_has_run() -> None:
    run_shown.show([row(who, "run", math.nan, Word.SKIPPED) for who in ("absent:*", "other:p")], {})


def _of_table(change: Callable[[dict[str, list[str]]], object]) -> Callable[[pytest.MonkeyPatch], None]:
    """Return a fault in the cells of the table before they are laid out."""
    own = layout.laid_out

    def plant(patch: pytest.MonkeyPatch) -> None:
        def laid_out(names: Any, cells: dict[str, list[str]], *given: Any, **more: Any) -> str:
            cells = {name: list(column) for name, column in cells.items()}
            change(cells)
            return own(names, cells, *given, **more)

        patch.setattr(layout, "laid_out", laid_out)

    return plant


def _of_rows(name: str, module: Any = run_shown) -> Callable[[pytest.MonkeyPatch], None]:
    """Return a fault by which a function of rows gets the last one less."""
    own = getattr(module, name)
    return lambda patch: patch.setattr(module, name, lambda rows, *more: own(list(rows)[:-1], *more))


def swap(cells: dict[str, list[str]], one: str, other: str) -> None:
    cells[one], cells[other] = cells[other], cells[one]


PLANTED: dict[str, Callable[[pytest.MonkeyPatch], None]] = {
    "importer and step swapped": _of_table(lambda cells: swap(cells, "importer", "step")),
    "model and step swapped": _of_table(lambda cells: swap(cells, "model", "step")),
    "within and expected-outside swapped": _of_table(lambda cells: swap(cells, "within", run_shown.EXPECTED)),
    "seconds for milliseconds": _of_table(
        lambda cells: cells.update({"time [ms]": [str(1e-3 * float(x)) for x in cells["time [ms]"]]})
    ),
    "another exponent": _of_table(
        lambda cells: cells.update(position=[x.replace("e-", "e+") for x in cells["position"]])
    ),
    "a column less": _of_table(lambda cells: cells.pop("outside")),
    "runs in another order": _of_table(lambda cells: [column.reverse() for column in cells.values()]),
    "times of all for those of a run": _of_table(lambda cells: cells.update({"time [ms]": cells["in all [s]"]})),
    "a row less in the counts": _of_rows("counted"),
    "a run less in the sentence": _of_rows("sentence"),
    "the worst row is not told": lambda patch: patch.setattr(run_shown, "wrong", lambda run: _wrong(run)[1:]),
    "the limit of another": lambda patch: patch.setattr(
        run_shown, "_wrong", lambda run, row: _own_wrong(run, row | {"limit": 3.0 * row["limit"]})
    ),
    "no number beyond": lambda patch: patch.setattr(run_shown, "beyond", lambda row: False),
    "what is expected-outside counts as within": lambda patch: patch.setattr(told.EngineRun, "deviates", None),
}  # fmt: skip
_wrong, _own_wrong = run_shown.wrong, run_shown._wrong


@pytest.mark.parametrize("what", PLANTED)
def test_what_is_another_one_is_told(what: str, shown: Shown, monkeypatch: pytest.MonkeyPatch) -> None:
    rows, times = list[Row](), {}
    for k, who in enumerate(("a:p", "b:p")):
        rows += [row(who, name, (k + 2.0) * 10.0 ** -(i + 3), Word.INFO) for i, name in enumerate(POSITIONS)]
        rows += [row(who, f"known_{i}", 1.0, Word.EXPECTED, 0.1) for i in range(k + 2)]
        rows += [row(who, f"within_{i}", 0.01, Word.WITHIN, 0.1) for i in range(k + 4)]
        rows += [row(who, f"loose_{i}", 1.0, Word.INFO, 0.1) for i in range(k + 6)]
        times["ball:v1", who] = 0.0123 * (k + 1), 4.56 * (k + 1)
    rows += [row("b:p", "off", 7.0, Word.OUTSIDE, 0.1), row("c:p", "position", 0.5, Word.EXPECTED, 0.1)]
    times["ball:v1", "c:p"] = 0.5, 1.0
    assert "off 7 m, limit 0.1" in shown(rows, times)
    PLANTED[what](monkeypatch)
    with pytest.raises(OwnFault, match="What was printed"):
        run_shown.show(rows, times)


def test_a_fault_that_is_told_keeps_nothing_from_being_printed(shown: Shown, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(printed, "check", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        run_shown.show(*drawn(0))


TIMES = {("a:v", "one:p"): (9.0, 2.0), ("b:v", "one:q"): (9.0, 3.0), ("a:v", "two-d:p"): (9.0, 1.5)}
LINE = "Time: 14.5 s: runs 11.0 (one 5.0, two-d 1.5, truths 4.5), verdicts 0.5, pages 3.0"


def test_the_line_of_times_is_that_of_the_runs() -> None:
    printed.check_times(LINE, TIMES)
    printed.check_times("Time: 9.5 s: runs 6.0, verdicts 0.5,\n    pages 3.0", TIMES)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [("14.5", "11.0"), ("runs 11.0", "runs 9.2"), ("one 5.0", "one 3.0"), ("two-d 1.5", "two-d 9.0"),
     ("truths 4.5", "truths 6.0"), ("verdicts 0.5", "verdicts 1.5"), ("one 5.0, ", "")],
)  # fmt: skip
def test_a_time_that_is_none_of_the_runs_is_a_fault(right: str, wrong: str) -> None:
    with pytest.raises(OwnFault, match="times that were printed"):
        printed.check_times(LINE.replace(right, wrong), TIMES)
