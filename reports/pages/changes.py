"""What has changed between two sets of verdicts: words first, then values by how much of their limit they moved."""

from __future__ import annotations

from typing import Any

import pandas as pd

from crossbody.reports.figures.section import Kind, Section, Table, columns, records

KEY = ["case", "variant", "engine", "profile", "metric"]
MOVED = 0.1
"""Share of its limit by which a value must move to be listed."""
WORDS = columns(
    label="Case", who="Engine", metric="Metric", verdict_before=("Before", Kind.VERDICT), verdict=("Now", Kind.VERDICT),
    value_before=("Value before", Kind.NUMBER), value=("Value now", Kind.NUMBER), limit=("Limit", Kind.NUMBER),
    unit="Unit",
)  # fmt: skip
VALUES = columns(
    label="Case", who="Engine", metric="Metric", value_before=("Before", Kind.NUMBER), value=("Now", Kind.NUMBER),
    limit=("Limit", Kind.NUMBER), unit="Unit", moved=("Moved by, of the limit [1]", Kind.NUMBER),
)  # fmt: skip


def changes(now: pd.DataFrame, before: pd.DataFrame, name: str) -> Section:
    """The section that says what changed since an earlier run.

    Args:
        now: verdicts with `label` and `who`.
        before: the earlier ones.
        name: folder of the earlier run.
    """
    both = now.merge(before, on=KEY, how="outer", suffixes=("", "_before"), indicator=True)
    kept = both[both["_merge"] == "both"]
    words = kept[kept["verdict"] != kept["verdict_before"]]
    moved = moves(kept[kept["verdict"] == kept["verdict_before"]])
    new, gone = (int((both["_merge"] == side).sum()) for side in ("left_only", "right_only"))
    text = (
        f"Against {name}: {len(words)} of {len(kept)} verdicts changed, {len(moved)} values moved by more than "
        f"{MOVED:.0%} of their limit, {new} rows are new, {gone} are gone."
    )
    tables = (
        Table(title="Verdicts that changed", columns=WORDS, rows=_rows(words)),
        Table(title="Values that moved", columns=VALUES, rows=_rows(moved)),
    )
    return Section(name="changes", title="What changed", text=text, tables=[t for t in tables if t.rows])


def moves(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows whose value moved by more than `MOVED` of their limit, the largest first."""
    apart = (rows["value"].astype(float) - rows["value_before"].astype(float)).abs()
    share = apart / rows["limit"].astype(float)
    return rows.assign(moved=share)[share > MOVED].sort_values("moved", ascending=False)


def _rows(rows: pd.DataFrame) -> list[dict[str, Any]]:
    return records(rows.drop(columns=["_merge"], errors="ignore"))
