"""What tables at a glance, scatters and sketches must say of made-up rows: words, heat, errors and run times."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from crossbody.reports.figures.styles import look
from crossbody.reports.judging.verdict import Word
from crossbody.reports.pages import grid, index_page, precision, summary
from crossbody.reports.pages.known_figures import drawn
from crossbody.reports.pages.made_up_traces import Said, axis

SEED, WHO, LABELS = 7, ("one:p", "two:q", "three:p"), ("first:a", "second:b", "third:c")
OFF = (3.7, -250.0, 9e4)
"""Multiples of its limit that each engine's error of velocity is off by from what is claimed of it."""
NEAR = 1.2
"""The same of its error of force, nearer."""
SHORT, ROUGH = 0.05, 0.5
"""Parts of a number by which it may be rounded in a cell of two digits, and of one."""


def row(who: str, label: str, metric: str, value: float, limit: float | None, word: Word, **more: Any) -> Any:
    """Return a row as tables have them."""
    engine, _, profile = who.partition(":")
    case, _, variant = label.partition(":")
    return {
        "who": who, "engine": engine, "profile": profile, "label": label, "case": case, "variant": variant,
        "metric": metric, "value": value, "limit": limit, "expected": math.nan, "verdict": word.value, "why": "",
        "unit": "1", "known": None, "where": "",
    } | more  # fmt: skip


class MadeUp:
    """Errors of position and run times (cases, engines), s, and the rows with errors of velocity that are claimed."""

    def __init__(self) -> None:
        draw = np.random.default_rng(SEED)
        self.errors, self.walls = 10.0 ** draw.uniform(-9.0, -2.0, (3, 3)), 10.0 ** draw.uniform(-4.0, 1.0, (3, 3))
        self.limits, self.claims = 10.0 ** draw.uniform(-1.0, 0.0, 3), draw.normal(size=(3, 3))
        self.base = 10.0 ** draw.uniform(-3.0, 0.0, 3)
        self.rows = {label: self._rows(c, label) for c, label in enumerate(LABELS)}
        walls = {(label, who): float(self.walls[c, e]) for c, label in enumerate(LABELS) for e, who in enumerate(WHO)}
        self.times = walls | {(label, summary.REFERENCE): float(self.base[c]) for c, label in enumerate(LABELS)}
        every = [one for rows in self.rows.values() for one in rows]
        found = SimpleNamespace(
            rows=self.rows, verdicts=every, walls=self.times, engines=WHO, cases=LABELS,
            out=Path("/nonexistent"), told={},
        )  # fmt: skip
        self.results: Any = found

    def _rows(self, c: int, label: str) -> list[Any]:
        found = []
        for e, who in enumerate(WHO):
            limit, claim = float(self.limits[c]), float(self.claims[c, e])
            off = {"expected": claim, "why": f"reason of {who}"}
            found += [
                row(who, label, "position", float(self.errors[c, e]), limit, Word.WITHIN),
                row(who, label, "lam_error", claim + NEAR * limit, limit, Word.EXPECTED, **off),
                row(who, label, "velocity", claim + (OFF[e] + c) * limit, limit, Word.EXPECTED, **off),
            ]
        return found


def _number(text: str) -> float:
    """Return a number with its unit of time in s, or with "times"."""
    number, _, unit = text.partition(" ")
    return float(number) * {"": 1.0, "s": 1.0, "ms": 1e-3, "times": 1.0}[unit]


def _near(drawn_: Sequence[float], wanted: Any, part: float) -> bool:
    right = np.asarray(wanted, dtype=np.float64)
    mine = np.asarray(drawn_, dtype=np.float64)
    return mine.shape == right.shape and bool(np.all(np.abs(mine - right) <= part * np.abs(right)))


def _heat() -> Iterator[Said]:
    """Yield how many decades numbers are beyond their limit, from what is claimed; and within, of a millionth."""
    draw = np.random.default_rng(SEED)
    for k in range(-8, 15):
        limit = float(10.0 ** draw.uniform(-3.0, 0.0))
        times = float(10.0 ** (k + draw.uniform(0.2, 0.8)))
        claim = float(draw.normal()) * max(times * limit, 1.0)
        word = Word.WITHIN if k < 0 else Word.EXPECTED
        for value, given in ((claim - times * limit, claim), (-times * limit, math.nan)):
            sure = abs(value) * 1e-12 < times * limit  # beside a claim that is larger, little is left of it
            one = row("one:p", "a:b", "m", value, limit, word, expected=given)
            wanted = min(max(k + 6, 0), 6) if k < 0 else min(k, 12)
            if sure:
                yield (
                    f"heat of {'what is claimed' if given == given else 'a number'}, 1e{k} limits",
                    (float(grid.heat_of(one))),
                    float(wanted),
                )
    unjudged = row("one:p", "a:b", "m", 37.0, 1.0, Word.INFO)
    yield "heat of what is not judged", float(grid.heat_of(unjudged)), 1.0
    yield "heat of what has no limit", float(grid.heat_of(unjudged | {"limit": None})), -1.0


def _words() -> Iterator[Said]:
    """Yield the worst of some words, and how many have it of how many that are judged."""
    words = [Word.WITHIN] * 5 + [Word.EXPECTED] * 3 + [Word.OUTSIDE] * 2 + [Word.CRASHED]
    more = [row("one:p", "a:b", f"i{k}", 1.0, None, Word.INFO) for k in range(4)]
    for n, said in ((5, "5"), (8, "3 of 8"), (10, "2 of 10"), (11, "1 of 11")):
        rows = [row("one:p", "a:b", f"m{k}", 1.0, 2.0, word) for k, word in enumerate(words[:n])]
        yield f"the worst of {n} words", grid.worst([*rows, *more]), (words[n - 1].value, said)
    runs = [row(f"e{k}:p", "a:b", "m", 1.0, 2.0, word) for k, word in enumerate(words)]
    for n, said in ((5, "all within"), (8, "3 expected-outside"), (10, "2 outside"), (11, "1 crashed")):
        yield f"the worst of {n} runs", grid.verdict(runs[:n]), said


def _cells() -> Iterator[Said]:
    """Yield the cells of engines: errors, run times, heat and words."""
    made = MadeUp()
    for c, label in enumerate(LABELS):
        rows, walls = made.rows[label], {who: float(made.walls[c, e]) for e, who in enumerate(WHO)}
        for e, who in enumerate(WHO):
            cell = grid.whole(label, "page", who, [one for one in rows if one["who"] == who], walls[who])
            error, time = cell.small.split(" · ")
            yield f"error of {who}", _near([float(error)], [made.errors[c, e]], ROUGH), 1.0
            yield f"run time of {who}", _near([_number(time)], [walls[who]], SHORT), 1.0
            yield f"word of {who}", (cell.word, cell.text), ("expected-outside", "2 of 3")
            yield f"heat of {who}", float(cell.heat), float(int(math.log10(abs(OFF[e] + c))))
        told = {line.text: line.cells for line in grid.of_case(rows, "page", label, walls)}
        costs = told["run time"]
        least = min(walls.values())
        yield "run times of a case", _near([_number(cell.text) for cell in costs], [*walls.values()], SHORT), 1.0
        times = [wall / least for wall in walls.values()]
        yield "run times over the least", _near([_number(cell.small) for cell in costs], times, SHORT), 1.0
        for metric in ("position", "velocity"):
            values = [one["value"] for one in rows if one["metric"] == metric]
            yield f"{metric} of a case", _near([float(cell.text) for cell in told[metric]], values, SHORT), 1.0


def _bounded() -> Iterator[Said]:
    """Yield that of a number below what it is known to only that is said."""
    for value, said in ((2e-5, "< 0.04"), (-0.07, "-0.07")):
        lines = grid.of_case([row("one:p", "a:b", "m", value, 1.0, Word.WITHIN, known=0.04)], "page", "a:b", {})
        (cell,) = next(line.cells for line in lines if line.text == "m")
        yield f"{value:g} that is known to .04", cell.text, said


def _marks(figure: Any) -> dict[str, list[tuple[float, float]]]:
    """Return error and run time of each mark by engine, on axes of an error and of ms."""
    for kind, title in (("x", "error"), ("y", "[ms]")):
        axis(figure, title, kind=kind)
    yields = {line["meta"]: sorted(zip(line["x"], line["y"], strict=True)) for line in figure["data"]}
    return yields


def _precision() -> Iterator[Said]:
    """Yield marks at errors and run times in ms; limits; a run without an error, at the right edge."""
    made, walls = MadeUp(), dict(zip(WHO, MadeUp().walls[0].tolist(), strict=True))
    (section,) = precision.precision(made.results.out, LABELS[0], made.rows[LABELS[0]], walls)
    figures = [(section, (0,)), *((one, tuple(range(3))) for one in precision.overview(made.results))]
    alone = SimpleNamespace(**{**vars(made.results), "rows": {LABELS[0]: made.rows[LABELS[0]]}})
    figures += [(one, (0,)) for one in precision.overview(alone)]  # type: ignore[arg-type]
    for one, cases in figures:
        figure: Any = one.plots[0].figure
        marks = _marks(figure)
        yield "engines", tuple(sorted(marks)), tuple(sorted(WHO))
        for e, who in enumerate(WHO):
            wanted = sorted((made.errors[c, e], 1e3 * made.walls[c, e]) for c in cases)
            yield f"error and run time of {who}, ms", marks[who], wanted
        yield (
            "colours",
            tuple((one["meta"], one["marker"]["color"]) for one in figure["data"]),
            tuple((one["meta"], look(one["meta"])["color"]) for one in figure["data"]),
        )
        if len(cases) == 1:
            shapes = [(s["x0"], s["x1"]) for s in figure["layout"]["shapes"]]
            yield "limit", shapes, [(made.limits[0], made.limits[0])]
    (lost,) = precision.scatter([("one:p", math.inf, 3.0)])["data"]
    yield "mark of a run without an error", lost["marker"]["symbol"], "x"
    known, lost = precision.scatter([("one:p", 0.7, 2.0), ("two:q", math.inf, 3.0)])["data"]
    yield "the edge with a run without an error", lost["x"][0] > known["x"][0], 1.0


def _engines() -> Iterator[Said]:
    """Yield medians and largest of errors, medians of run times over the reference's, and counts."""
    made = MadeUp()
    (table,) = summary.engines(made.results).tables
    for e, (one, who) in enumerate(zip(table.rows, WHO, strict=True)):
        yield "engine", one["who"], who
        errors, ratios = sorted(made.errors[:, e]), sorted(made.walls[:, e] / made.base)
        yield f"errors and cost of {who}", [one["error"], one["most"], one["cost"]], [errors[1], errors[2], ratios[1]]
        counts = [one[name] for name in ("within", "expected", "outside", "skipped")]
        yield f"counts of {who}", counts, [0.0, 3.0, 0.0, 0.0]
    (known,) = summary.deviations(made.results.verdicts)
    for one in known.tables[0].rows:
        e = WHO.index(one["who"])
        times = [abs(OFF[e] + c) for c in range(3)]
        most = times.index(max(times))
        yield f"farthest of {one['who']}", one["most"], times[most]
        yield f"where {one['who']} is farthest", one["where"], f"{LABELS[most]}, velocity"
        yield f"cases and rows of {one['who']}", [one["cases"], one["rows"]], [3, 6]


def _counts() -> Iterator[Said]:
    """Yield of how many cases each word is the worst of an engine, no two as often."""
    words = (Word.WITHIN, Word.EXPECTED, Word.OUTSIDE, Word.SKIPPED)
    every = [word for k, word in enumerate(words) for _ in range(k + 1)]
    rows = {f"case:{k}": [row(WHO[0], f"case:{k}", "m", 1.0, 2.0, word)] for k, word in enumerate(every)}
    found: Any = SimpleNamespace(rows=rows, walls={}, out=Path("/nonexistent"))
    (one,) = summary.engines(found).tables[0].rows
    yield "counts of words", [one[name] for name in ("within", "expected", "outside", "skipped")], [1, 2, 3, 4]
    yield "worst word", one["worst"], "outside"


def _index() -> Iterator[Said]:
    """Yield counts of verdicts, and the number of each case that is farthest from what is claimed of it."""
    made = MadeUp()
    tiles = {tile["title"]: tile["value"] for tile in index_page._tiles(made.results)["tiles"]}
    wanted = {"cases": 3, "engine profiles": 3, "within": 9, "expected-outside": 18, "outside": 0, "crashed": 0}
    yield "counts", [tiles[title] for title in wanted], [*wanted.values()]
    for c, label in enumerate(LABELS):
        times = [abs(off + c) for off in OFF]
        most = times.index(max(times))
        case: Any = SimpleNamespace(label=label)
        who, metric, number = index_page._worst(made.results, case).split()
        yield f"farthest of {label}", (who, metric), (f"{WHO[most]}:", "velocity")
        value = made.claims[c, most] + (OFF[most] + c) * made.limits[c]
        yield f"how far {label} is", _near([float(number)], [value], SHORT), 1.0


def _moved() -> Iterator[Said]:
    """Yield by how much of their limits values moved since another run, the largest first."""
    draw = np.random.default_rng(SEED)
    before, limit, by = draw.normal(size=3), 10.0 ** draw.uniform(-3.0, 0.0, 3), np.array([0.4, -3.0, 0.05])
    rows = [
        row("one:p", "a:b", f"m{k}", float(before[k] + by[k] * limit[k]), float(limit[k]), Word.WITHIN)
        | {"value_before": float(before[k])} for k in range(3)
    ]  # fmt: skip
    found = index_page.moves(iter(rows))
    yield "what moved", tuple(one["metric"] for one in found), ("m1", "m0")
    yield "by how much", [one["moved"] for one in found], [3.0, 0.4]


def _sketch() -> Iterator[Said]:
    """Yield that a sketch is the truth's first coordinate over time, and higher where that is larger."""
    trace = drawn().traces[0]
    points = [point.split(",") for point in index_page.sketched(trace.run).split()]
    x, y = np.array(points, dtype=np.float64).T
    t, q = trace.run.t, trace.run.q[:, 0]
    yield "samples", float(len(x)), float(len(t))
    yield "times", float(np.abs(x / 100.0 - (t - t[0]) / (t[-1] - t[0])).max() < 1e-3), 1.0
    low, high = y[np.argmin(q)], y[np.argmax(q)]
    yield "sides", float(0.0 <= high < low - 10.0 <= 10.0), 1.0
    heights = (q - q.min()) / (q.max() - q.min())
    yield "heights", float(np.abs((low - y) / (low - high) - heights).max() < 1e-2), 1.0


KINDS = {
    "heat": _heat, "worst words": _words, "cells": _cells, "error against run time": _precision,
    "table of engines": _engines, "numbers below what is known": _bounded,
    "counts of engines": _counts, "index": _index, "what changed": _moved, "sketch": _sketch,
}  # fmt: skip
