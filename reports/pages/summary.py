"""Engines at a glance: for how many cases each can be trusted, how far it is off and why, and what it costs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from crossbody.reports.figures.section import Kind, Section, Table, columns
from crossbody.reports.judging.told import share
from crossbody.reports.judging.verdict import Row, Word, by
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.pages import grid
from crossbody.reports.pages.html import BEYOND
from crossbody.reports.pages.results import Results
from crossbody.reports.runs.study import read_json

REFERENCE = "reference:compiled"
NAMED = 6  # metrics that are named of a deviation, those farthest out first
TEXT = (
    "An engine counts as trusted on a case if every judged number is within its limit. Errors are "
    "of position, relative to its largest value. Run times are relative to those of "
    "reference:compiled for the same case, each at its own setting and therefore at its own error; "
    "for the cost of the same error, run a benchmark (crossbody bench, then crossbody report --with)."
)
BENCH = (
    "At its best error: the run time of the engine relative to that of the cheapest run of "
    "the reference that is at least as accurate, median over the timed cases."
)
COLUMNS = columns(
    who="Engine", worst=("Worst", Kind.VERDICT), most=("Error, worst", Kind.NUMBER),
    cost=("Run time over the reference's, median", Kind.NUMBER), within=("Cases trusted", Kind.NUMBER),
    beyond=("Cases beyond a limit, not judged", Kind.NUMBER), outside=("Cases outside", Kind.NUMBER),
    expected=("Cases expected-outside", Kind.NUMBER), skipped=("Cases not run", Kind.NUMBER),
    error=("Error, median", Kind.NUMBER), ratio=("At its best error", Kind.NUMBER),
)  # fmt: skip
KNOWN = columns(
    who="Engine", most=("Farthest [limits]", Kind.NUMBER), why=("Known properties", Kind.LONG), where="On",
    cases=("Cases", Kind.NUMBER), rows=("Rows", Kind.NUMBER), metrics="Metrics",
)  # fmt: skip


def engines(found: Results) -> Section:
    """The section; with the ratios of a benchmark where one stands in the folder."""
    ratios = _ratios(found.out)
    cells = _cells(found)
    rows = [_row(found, who, mine) | {"ratio": ratios.get(who, math.nan)} for who, mine in cells.items()]
    shown = [column for column in COLUMNS if column.key != "ratio" or ratios]
    table = Table(title="Engines", columns=shown, rows=rows)
    return Section(name="engines", title="Engines", text=f"{TEXT} {BENCH if ratios else ''}".strip(), tables=(table,))


def _cells(found: Results) -> dict[str, dict[str, Sequence[Row]]]:
    """Rows of every engine and, of those, of every case."""
    cells: dict[str, dict[str, Sequence[Row]]] = {}
    for label, rows in found.rows.items():
        for who, mine in by((row for row in rows if row["engine"] != TRUTH), "who").items():
            cells.setdefault(who, {})[label] = mine
    return {who: cells[who] for who in grid.names({"who": who} for who in cells)}


def _row(found: Results, who: str, mine: Mapping[str, Sequence[Row]]) -> dict[str, Any]:
    told = [grid.worst(rows) for rows in mine.values()]
    words = Counter(word for word, text in told if text or word != Word.INFO)
    errors = [
        float(row["value"]) for rows in mine.values() for row in rows
        if row["metric"] == "position" and row["value"] is not None and math.isfinite(row["value"])
    ]  # fmt: skip
    costs = [cost for label in mine if (cost := _cost(found.walls, label, who))]
    worst = next((word for word in (*grid.RANKED, Word.SKIPPED.value) if words[word]), Word.INFO.value)
    return {
        "who": who.removesuffix(":"), "worst": BEYOND if worst == Word.INFO and words[worst] else worst,
        "within": words["within"], "expected": words["expected-outside"],
        "beyond": words["not judged"], "outside": words["outside"],
        "skipped": words["skipped"], "error": median(errors) if errors else math.nan,
        "most": max(errors, default=math.nan), "cost": median(costs) if costs else math.nan,
    }  # fmt: skip


def _cost(walls: Mapping[tuple[str, str], float], label: str, who: str) -> float:
    mine, theirs = walls.get((label, who)), walls.get((label, REFERENCE))
    return mine / theirs if mine and theirs else 0.0


def _ratios(out: Path) -> dict[str, float]:
    """Of a benchmark: time at the engine's best error over the reference's, median over cases."""
    if not (out / "headline.json").is_file():
        return {}
    found: dict[str, list[float]] = {}
    for row in read_json(out / "headline.json")["rows"]:
        if row.get("ratio") is not None:
            found.setdefault(f"{row['engine']}:{row['profile']}", []).append(row["ratio"])
    return {who: median(ratios) for who, ratios in found.items()}


def deviations(rows: Iterable[Row]) -> list[Section]:
    """The section, where some row is outside by a known property of its engine."""
    found: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if row["verdict"] == Word.EXPECTED:
            found.setdefault((row["who"], row["why"]), []).append(row)
    if not found:
        return []
    lines = [_line(who, why, mine) for (who, why), mine in sorted(found.items(), key=lambda one: one[0][0])]
    return [Section(
        name="known", title="Expected-outside",
        text="Numbers outside their limits, as far as a known property of the engine explains, on both sides.",
        tables=(Table(title="Expected-outside", columns=KNOWN, rows=lines),),
    )]  # fmt: skip


def _line(who: str, why: str, rows: list[Row]) -> dict[str, Any]:
    farthest = max((row for row in rows if math.isfinite(share(row))), key=share, default=rows[0])
    text = why[:1].upper() + why[1:]
    metrics = list(dict.fromkeys(row["metric"] for row in sorted(rows, key=share, reverse=True)))
    named, more = metrics[:NAMED], len(metrics) - NAMED
    return {
        "who": who, "why": text, "metrics": ", ".join(named) + (f" and {more} more" if more > 0 else ""),
        "cases": len({row["label"] for row in rows}), "rows": len(rows), "most": share(farthest),
        "where": f"{farthest['label']}, {farthest['metric']}",
    }  # fmt: skip
