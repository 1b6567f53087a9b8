"""Frequency responses of the soft contact, with and without tactile feedback."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from crossbody.reports.figures.section import Kind, Plot, Section, Table, columns, records
from crossbody.reports.runs.study import read_json

TITLE = "Frequency responses"
CASES = ("soft_contact",)
TEXT = (
    "The block held by both fingers, about the grasp: from the velocity of the fingers to the difference of the "
    "contact forces and to the velocity of the block. Derivatives of the model are exact in the modes of the grasp. "
    "The table has the largest real part of the poles, but for the two that stand at 0: the fingers' own shift, and "
    "what the tactile loop keeps. Below 0 the loop is stable about an equilibrium; whether an approach is, only a run "
    "tells."
)
COLUMNS = columns(mode="Modes", kstar=("k* [cm/(s N)]", Kind.NUMBER), growth=("Growth [1/s]", Kind.NUMBER))


def sections(out: Path) -> tuple[Section, ...]:
    """One section, if there are responses."""
    if not (out / "bode.json").is_file():
        return ()
    from crossbody.reports.analysis.bode import growths
    from crossbody.reports.analysis.bode_figure import bode

    rows, poles = (pd.DataFrame(read_json(out / f"{name}.json")["rows"]) for name in ("bode", "poles"))
    table = Table(title="Poles of the soft contact", columns=COLUMNS, rows=records(growths(poles)), file="poles.csv")
    plot = Plot(name="bode-soft-contact", figure=bode(rows))
    title = "Frequency responses of the soft contact"
    return (Section(name="bode", title=title, text=TEXT, plots=(plot,), tables=(table,)),)
