"""What each engine's own reader makes of each feature of robot files."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from crossbody.reports.figures.section import Kind, Section, Table, columns, records
from crossbody.reports.runs.study import read_json

TITLE = "Readers of robot files"
TEXT = (
    "One feature a file, each read by the engine's own reader in a process of its own, and compared with a scene that "
    "was written by hand: coordinates, inertias, M, gravity, bias, energy and frames at random states, or what the "
    "feature is about. ok: alike to 1e-9 (to 2e-4 for a reader in single precision). unsupported: the engine says that "
    "it leaves it out, or has no such thing. wrong: it reads something else without a word. failed: it gives up."
)
DETAILS = columns(
    feature="Feature", engine="Engine", version="Version", verdict=("Verdict", Kind.VERDICT), quantity="Quantity",
    where="Where", value=("Value", Kind.NUMBER), expected=("Expected", Kind.NUMBER), why=("It says", Kind.LONG),
    rule=("Rule of the format", Kind.LONG), rewrite=("How all agree", Kind.LONG), text=("File", Kind.CODE),
)  # fmt: skip


def sections(out: Path) -> tuple[Section, ...]:
    """One section, if importers were asked."""
    if not (out / "conformance.json").is_file():
        return ()
    rows = pd.DataFrame(read_json(out / "conformance.json")["rows"])
    engines = list(dict.fromkeys(rows["engine"]))
    versions = {name: max(own["version"]) for name, own in rows.groupby("engine")}
    wide = [
        {"feature": name} | dict(zip(own["engine"], own["verdict"], strict=True))
        for name, own in rows.groupby("feature", sort=False)
    ]
    across = columns(feature="Feature", **{name: (f"{name} {versions[name]}", Kind.VERDICT) for name in engines})
    off = rows[~rows["verdict"].isin(["ok", "-"])]
    tables = (
        Table(title="Features", columns=across, rows=[{name: "" for name in engines} | row for row in wide]),
        Table(title="What is not ok", columns=DETAILS, rows=records(off), file="conformance.csv", folded=True),
    )
    return (Section(name="conformance", title=TITLE, text=TEXT, tables=tables),)
