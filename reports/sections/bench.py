"""Run time against error: the work-precision diagram, observed orders, timings."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from crossbody.reports.figures.section import Kind, Plot, Section, Table, columns, records
from crossbody.reports.runs.study import read_json

TITLE = "Run time"
TEXT = (
    "Models built and warmed before the clock, engines interleaved, median with interquartile range. A failed run is a "
    "cross, never dropped. An engine that follows another state machine is judged against that machine's truth. "
    "Compare ratios: seconds belong to one machine. The whole call is the run with the Python call and the trajectory "
    "that it builds."
)
ORDERS = columns(
    case="Case", who="Engine", knob="Setting", order=("Observed order", Kind.NUMBER),
    promised=("Promised order", Kind.NUMBER), says=("Says", Kind.LONG),
)  # fmt: skip
TIMINGS = columns(
    case="Case", who="Engine", knob="Setting", setting=("Value", Kind.NUMBER), against="Against the truth of",
    tier="Tier", error=("Error", Kind.NUMBER), error_q=("Position", Kind.NUMBER),
    error_v=("Velocity", Kind.NUMBER), error_impulse=("Impulse", Kind.NUMBER),
    error_energy=("Energy", Kind.NUMBER), error_times=("Event times [s]", Kind.NUMBER),
    error_between=("Position on one grid", Kind.NUMBER),
    honesty=("Error over tolerance", Kind.NUMBER), median_ms=("Median [ms]", Kind.NUMBER),
    iqr_ms=("IQR [ms]", Kind.NUMBER), call_ms=("Whole call [ms]", Kind.NUMBER),
    native_ms=("Its own loop [ms]", Kind.NUMBER), control_ms=("In the controller [ms]", Kind.NUMBER),
    interpreted=("Interpreted", Kind.LONG),
    cores=("Cores", Kind.NUMBER),
    repeats=("Repeats", Kind.NUMBER), outcome="Outcome",
)  # fmt: skip


def sections(out: Path) -> tuple[Section, ...]:
    """One section, if anything was timed."""
    if not (out / "bench.json").is_file():
        return ()
    from crossbody.reports.bench.figure import work_precision

    rows, orders = (_named(pd.DataFrame(read_json(out / f"{name}.json")["rows"])) for name in ("bench", "orders"))
    tables = (
        Table(title="Observed order", columns=ORDERS, rows=records(orders), file="orders.csv"),
        Table(title="Timings", columns=TIMINGS, rows=records(rows), file="bench.csv"),
    )
    plots = [
        Plot(name=f"work-precision-{i}", figure=work_precision(group))
        for i, (_, group) in enumerate(rows.groupby("case", sort=False))
    ]
    return (Section(name="bench", title="Run time against error", text=TEXT, plots=plots, tables=tables),)


def _named(rows: pd.DataFrame) -> pd.DataFrame:
    """With engine and profile in one column."""
    return rows.assign(who=rows["engine"] + ":" + rows["profile"]) if len(rows) else rows
