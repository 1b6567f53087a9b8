"""What has changed between two sets of verdicts: words first, then values by how far they moved."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from crossbody.reports.figures.section import Kind, Section, Table, columns
from crossbody.reports.judging.verdict import Row

KEY = ("case", "variant", "engine", "profile", "metric")
MOVED = 0.1  # share of its limit by which a value must move to be listed
WORDS = columns(
    label="Case", who="Engine", metric="Metric", verdict_before=("Before", Kind.VERDICT),
    verdict=("Now", Kind.VERDICT), value_before=("Value before", Kind.NUMBER),
    value=("Value now", Kind.NUMBER), limit=("Limit", Kind.NUMBER), unit="Unit",
)  # fmt: skip
VALUES = columns(
    label="Case", who="Engine", metric="Metric", value_before=("Before", Kind.NUMBER),
    value=("Now", Kind.NUMBER), limit=("Limit", Kind.NUMBER), unit="Unit",
    moved=("Moved by, of the limit", Kind.NUMBER),
)  # fmt: skip


def changes(now: Sequence[Row], before: Sequence[Row], name: str) -> Section:
    """The section that says what changed in verdicts, with `label` and `who`, since a run of that name."""
    known, here = _by_key(before), _by_key(now)
    kept = [
        row | {f"{field}_before": known[key][field] for field in ("verdict", "value")}
        for key, row in here.items()
        if key in known
    ]
    words = [row for row in kept if row["verdict"] != row["verdict_before"]]
    moved = moves(row for row in kept if row["verdict"] == row["verdict_before"])
    text = (
        f"Against {name}: {len(words)} of {len(kept)} verdicts changed, {len(moved)} values "
        f"moved by more than {MOVED:.0%} of their limit, {len(here.keys() - known)} rows are "
        f"new, {len(known.keys() - here)} are gone."
    )
    tables = (
        Table(title="Verdicts that changed", columns=WORDS, rows=words),
        Table(title="Values that moved", columns=VALUES, rows=moved),
    )
    return Section(name="changes", title="What changed", text=text, tables=[t for t in tables if t.rows])


def _by_key(rows: Sequence[Row]) -> dict[tuple[str, ...], Row]:
    return {tuple(row[name] for name in KEY): row for row in rows}


def moves(rows: Iterator[Row]) -> list[dict[str, Any]]:
    """Rows whose value moved by more than `MOVED` of their limit, the largest first."""
    found = [row | {"moved": _share(row)} for row in rows]
    return sorted((row for row in found if row["moved"] > MOVED), key=lambda row: -row["moved"])


def _share(row: Row) -> float:
    """By how much of its limit a value moved; infinite where that is 0, nothing without numbers."""
    value, before, limit = (row[name] for name in ("value", "value_before", "limit"))
    if value is None or before is None or limit is None:
        return 0.0
    apart = abs(value - before)
    return apart / limit if limit else math.inf if apart else 0.0
