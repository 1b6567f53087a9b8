"""What the commands `gapmap` and `stability` do."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from crossbody import engines
from crossbody.reports import voice
from crossbody.reports.pages import site
from crossbody.reports.runs import jobs, output, study
from crossbody.reports.runs.provenance import provenance
from crossbody.reports.voice import progress

if TYPE_CHECKING:
    import pandas as pd

from crossbody.reports.commands.shared import where

GAP_MAP = ("reference:compiled", "mujoco", "pinocchio")


def gap_map(counts: Sequence[int], wanted: Sequence[str], points: int, out: Path, command: str) -> int:
    """Run the sliders over all gaps; writes the table and the page."""
    from crossbody.reports.maps import gapmap

    picks = jobs.picks(wanted or [name for name in GAP_MAP if name.partition(":")[0] in engines.names()])
    output.check(out, "gapmap")
    with progress(len(counts) * len(gapmap.lines(picks))) as tell:
        rows = gapmap.gap_map(counts, picks, points, tell)
    told = provenance(command, points=points)
    with output.folder(out, "gapmap") as made:
        study.write(made, [], study.judge([], {}), told)
        study.write_table(made / "gapmap", rows, told)
        site.write(made)
    if not voice.told_as_json({"gapmap": rows, "summary": gapmap.summary(rows)}):
        show_gap_map(gapmap.summary(rows), out)
    return 0


def stability_map(wanted: Sequence[str], out: Path, command: str) -> int:
    """Run the closed-loop maze with one thing changed at a time; writes the table and the page."""
    from crossbody.reports.maps import stability

    picks = jobs.picks(wanted) if wanted else (stability.DEFAULT,)
    output.check(out, "stability")
    with progress(len(picks) * len(stability.POINTS)) as tell:
        rows = stability.stability_map(picks, stability.POINTS, tell)
    told = provenance(command, rtol=stability.RTOL)
    with output.folder(out, "stability") as made:
        study.write(made, [], study.judge([], {}), told)
        study.write_table(made / "stability", rows, told)
        site.write(made)
    surprises = stability.surprises(rows)
    if not voice.told_as_json({"stability": rows, "surprises": surprises}):
        show_stability(rows, surprises, out)
    return int(len(surprises) > 0)


def show_gap_map(lines: pd.DataFrame, out: Path) -> None:
    """One line an engine in the terminal, then what those say that failed or were skipped."""
    if not voice.quiet():
        print(lines.drop(columns="why").to_string(index=False, float_format=lambda x: f"{x:.4g}"))
    for line in lines[lines["why"] != ""].to_dict(orient="records"):
        print(f"{line['n']} balls, {line['engine']}:{line['profile']}, {line['machine']}: {line['why']}")
    where(out)


def show_stability(rows: pd.DataFrame, surprises: pd.DataFrame, out: Path) -> None:
    """One line a scene in the terminal, then those that ended otherwise than published."""
    if not voice.quiet():
        table = rows.drop(columns=["change", "why"])
        print(table.to_string(index=False, float_format=lambda x: f"{x:.4g}"))
    for row in surprises.to_dict(orient="records"):
        print(f"outside: {row['engine']}:{row['profile']} {row['scene']}: {row['expected']} expected. {row['why']}")
    where(out)
