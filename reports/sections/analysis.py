"""Equilibria of a case: poles, root loci, frequency responses, stability over a workspace."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from crossbody.reports.figures.section import Kind, Plot, Section, Table, columns, records
from crossbody.reports.runs.study import read_json

TITLE = "Equilibria and linear models"
TEXT = (
    "Linear models about the equilibria of the case, in the modes named, by exact derivatives of the equations. Rows "
    "that are held are eliminated, so the law that holds them adds no poles, unless it is what is looked at. A pole to "
    "the right of 0 grows; to the left it decays. Linear stability says nothing about how an equilibrium is reached. "
    "Engines are judged by their largest difference from the reference: of the derivatives of the accelerations, each "
    "row as a part of its largest entry, and of the poles as a part of their modulus."
)
COLUMNS = columns(
    place="Equilibrium", states=("States", Kind.NUMBER), controllable=("Controllable", Kind.NUMBER),
    observable=("Observable", Kind.NUMBER), growth=("Growth [1/s]", Kind.NUMBER),
)  # fmt: skip
ENGINES = columns(
    place="Equilibrium", engine="Engine", way="Way", slope=("Slope", Kind.NUMBER), poles=("Poles", Kind.NUMBER),
    unexplained=("Unexplained", Kind.NUMBER), limit=("Limit", Kind.NUMBER), verdict=("Verdict", Kind.VERDICT),
    why=("Why", Kind.LONG),
)  # fmt: skip
COEFFICIENTS = columns(
    place="Equilibrium", axis="Axis", **{"s^2": ("s^2 [1/s]", Kind.NUMBER), "s": ("s [1/s^2]", Kind.NUMBER)},
    **{"1": ("1 [1/s^3]", Kind.NUMBER)}, coupling=("Coupling", Kind.NUMBER),
)  # fmt: skip
LIMITS = columns(
    place="Equilibrium", parameter="Parameter", value=("Limit of stability", Kind.NUMBER), unstable="Unstable",
    frequency=("Frequency [rad/s]", Kind.NUMBER),
)  # fmt: skip
PREFIX = "analysis-"


def sections(out: Path) -> tuple[Section, ...]:
    """One section, if there is an analysis."""
    if not (out / f"{PREFIX}ranks.json").is_file():
        return ()
    from crossbody.reports.analysis import figure as draw

    drawn = {
        "poles": draw.pole_figure, "locus": draw.locus_figure, "responses": draw.response_figure,
        "map": draw.map_figure,
    }  # fmt: skip
    plots = tuple(
        Plot(name=f"{PREFIX}{name}", figure=figure(_rows(out, name)))
        for name, figure in drawn.items()
        if (out / f"{PREFIX}{name}.json").is_file()
    )
    shown = (
        ("Linear models", COLUMNS, "ranks"), ("Characteristic polynomials", COEFFICIENTS, "coefficients"),
        ("Limits of stability", LIMITS, "limits"), ("Linear models of engines", ENGINES, "engines"),
    )  # fmt: skip
    tables = tuple(
        Table(title=title, columns=known, rows=records(_rows(out, name)), file=f"{PREFIX}{name}.csv")
        for title, known, name in shown
        if (out / f"{PREFIX}{name}.json").is_file()
    )
    return (Section(name="analysis", title=TITLE, text=TEXT, plots=plots, tables=tables),)


def _rows(out: Path, name: str) -> pd.DataFrame:
    return pd.DataFrame(read_json(out / f"{PREFIX}{name}.json")["rows"])
