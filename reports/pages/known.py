"""What is known of engines and explains their deviations: once an engine, not once a row."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from crossbody.reports.figures.section import Kind, Section, Table, columns
from crossbody.reports.judging.told import share
from crossbody.reports.judging.verdict import Row, Word

COLUMNS = columns(
    who="Engine", why=("What is known of it", Kind.LONG), metrics="Metrics", cases=("Cases", Kind.NUMBER),
    rows=("Rows", Kind.NUMBER), most=("Farthest [limits]", Kind.NUMBER), where="On",
)  # fmt: skip


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
        name="known", title="Known deviations",
        text="Known properties of engines, with an explanation and bounds on both sides.",
        tables=(Table(title="Known deviations", columns=COLUMNS, rows=lines),),
    )]  # fmt: skip


def _line(who: str, why: str, rows: list[Row]) -> dict[str, Any]:
    farthest = max((row for row in rows if math.isfinite(share(row))), key=share, default=rows[0])
    return {
        "who": who, "why": why, "metrics": ", ".join(dict.fromkeys(row["metric"] for row in rows)),
        "cases": len({row["label"] for row in rows}), "rows": len(rows), "most": share(farthest),
        "where": f"{farthest['label']}, {farthest['metric']}",
    }  # fmt: skip
