"""Stress: how every engine's runs of the suites ended, the stability map, and the smallest scenes that fail."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from crossbody.reports.figures.section import Kind, Plot, Section, Table, columns, records
from crossbody.reports.runs.study import read_json

TITLE = "Stress"
TEXT = (
    "Quasi-random and gridded scenes up to their extremes, each bounded in steps and time. A run is outside if it "
    "threw, leaked a warning or returned what is not a number; the reference also if it is further from a truth of "
    "tier A to C, or leaves more of its energy account open, than its limit. Failures of engines are shown with their "
    "outcome."
)
MAPPED = "Worst error over damping ratios 0 to 10, by stiffness and by tolerance or step; a cross where a run failed."
SMALL = (
    "The first failure of every kind, its parameters moved to the case's own as long as it fails in the same way; the "
    "command repeats it."
)
SUITES = columns(
    suite="Suite", who="Engine", runs=("Runs", Kind.NUMBER), finished=("Finished", Kind.NUMBER),
    not_run=("Not run", Kind.NUMBER), outside=("Outside", Kind.NUMBER), with_truth=("With truth", Kind.NUMBER),
    worst_error=("Worst error", Kind.NUMBER), worst_residual=("Worst energy residual", Kind.NUMBER),
    seconds=("Time [s]", Kind.NUMBER), outcomes="Other ends",
)  # fmt: skip
CELLS = columns(
    who="Engine", a0=("a0 [1/s²]", Kind.NUMBER), knob="Knob", setting=("Setting", Kind.NUMBER),
    runs=("Runs", Kind.NUMBER), finished=("Finished", Kind.NUMBER), worst_error=("Worst error", Kind.NUMBER),
    outcomes="Other ends",
)  # fmt: skip
FAILED = columns(
    verdict=("Verdict", Kind.VERDICT), outcome="Outcome", who="Engine", suite="Suite", count=("Times", Kind.NUMBER),
    why=("Says", Kind.LONG), command=("Command", Kind.CODE),
)  # fmt: skip


def sections(out: Path) -> tuple[Section, ...]:
    """The suites, the stability map and the reproducers, if a sweep is there."""
    if not (out / "stress_summary.json").is_file():
        return ()
    return tuple(_sections(out))


def _sections(out: Path) -> Iterator[Section]:
    table = Table(title="Runs by suite", columns=SUITES, rows=records(_rows(out, "stress_summary")), file="stress.csv")
    yield Section(name="stress", title="Stress runs by suite", text=TEXT, tables=(table,))
    cells = _rows(out, "stress_map")
    if len(cells):
        from crossbody.reports.sweep.figure import stress_map

        plot = Plot(name="stress-map", figure=stress_map(cells))
        table = Table(
            title="Stability map of the engines", columns=CELLS, rows=records(cells), file="stress_map.csv", folded=True
        )
        yield Section(name="stress-map", title="Stability map", text=MAPPED, plots=(plot,), tables=(table,))
    small = _rows(out, "reproducers")
    if len(small):
        table = Table(title="Reproducers", columns=FAILED, rows=records(small), file="reproducers.csv")
        yield Section(name="reproducers", title="Smallest scenes that fail", text=SMALL, tables=(table,))


def _rows(out: Path, name: str) -> pd.DataFrame:
    rows = pd.DataFrame(read_json(out / f"{name}.json")["rows"])
    return rows.assign(who=rows["engine"] + ":" + rows["profile"]) if len(rows) else rows
