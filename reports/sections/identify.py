"""Parameters identified from a log, with their intervals and what the data cannot tell."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from crossbody.reports.figures.section import Kind, Section, Table, columns, records
from crossbody.reports.runs.study import read_json

TITLE = "Identification"
ESTIMATES = columns(
    name="Parameter", value=("Estimate", Kind.NUMBER), low=("95 % from", Kind.NUMBER), high=("to", Kind.NUMBER),
    unit="Unit", start=("Start", Kind.NUMBER), identifiable="Identifiable",
    first_half=("First half of the data", Kind.NUMBER), second_half=("Second half", Kind.NUMBER),
)  # fmt: skip
HELD = columns(
    error="Error", fitted_before=("Fitted windows, start", Kind.NUMBER), fitted_after=("estimate", Kind.NUMBER),
    held_before=("Held-out windows, start", Kind.NUMBER), held_after=("estimate", Kind.NUMBER),
    change=("Change on held-out [%]", Kind.NUMBER), verdict="Verdict",
)  # fmt: skip


def sections(out: Path) -> tuple[Section, ...]:
    """One section, if parameters were identified."""
    if not (out / "identify.json").is_file():
        return ()
    estimates, held = (pd.DataFrame(read_json(out / f"{name}.json")["rows"]) for name in ("identify", "held_out"))
    estimates = estimates.reindex(columns=[column.key for column in ESTIMATES])
    held = held.reindex(columns=[column.key for column in HELD])
    told = read_json(out / "identify.json")["provenance"]["fit"]
    text = (
        f"Derivatives: {told['sensitivities']}. Intervals: {told['covariance']}. {' '.join(told['warnings'])} "
        "Held-out windows were not fitted; their errors say what the estimates are worth."
    )
    tables = (
        Table(title="Estimates", columns=ESTIMATES, rows=records(estimates), file="identify.csv"),
        Table(title="Errors before and after", columns=HELD, rows=records(held), file="held_out.csv"),
    )
    return (Section(name="identify", title="Identified parameters", text=text, tables=tables),)
