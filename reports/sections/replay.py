"""A log replayed: what each engine leaves over of the measurement, and whether that is noise."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from crossbody.reports.figures.section import Kind, Plot, Section, Table, columns, records
from crossbody.reports.runs.study import read_json

TITLE = "Replay"
TEXT = (
    "The model starts in each window from what was measured there and runs on recorded inputs, held between their "
    "recorded times. Residuals are averaged over a twelfth of the motion's period; where what is left is noise, and an "
    "error no larger than that of one sample, 99 of 100 correlations lie within the band."
)
METRICS = columns(
    who="Engine", metric="Metric", channel="Channel", value=("Value", Kind.NUMBER), unit="Unit",
    expected=("At best", Kind.NUMBER), limit=("May be off by", Kind.NUMBER), verdict="Verdict",
)  # fmt: skip
FINDINGS = columns(
    what="Check", channel="Channel", row=("Row", Kind.NUMBER), t=("Time [s]", Kind.NUMBER), text=("Says", Kind.LONG)
)


def sections(out: Path) -> tuple[Section, ...]:
    """One section, if a log was replayed."""
    if not (out / "replay.json").is_file():
        return ()
    from crossbody.reports.replay.figure import correlation, residual

    metrics, found, left, correlated = (
        pd.DataFrame(read_json(out / f"{name}.json")["rows"])
        for name in ("replay", "findings", "residuals", "correlations")
    )
    metrics = metrics.reindex(columns=[column.key for column in METRICS])  # an earlier run judged nothing
    plots = [Plot(name="replay-residual", figure=residual(left))] if len(left) else []
    plots += [Plot(name="replay-correlation", figure=correlation(correlated))] if len(correlated) else []
    tables = [Table(title="Metrics of the replay", columns=METRICS, rows=records(metrics), file="replay.csv")]
    if len(found):
        tables.append(Table(title="Findings about the log", columns=FINDINGS, rows=records(found), file="findings.csv"))
    about = read_json(out / "replay.json")["provenance"]["log"]
    origin = "SYNTHETIC, no measurement." if about["synthetic"] else "A measurement."
    text = f"{origin} {about['file']}: {about['about']} {TEXT}"
    return (Section(name="replay", title="Log and model", text=text, plots=plots, tables=tables),)
