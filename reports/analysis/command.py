"""What `crossbody analyse` does: find the equilibria, linearise, show tables, write them with their figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from crossbody import cases
from crossbody.cases import InvalidValue
from crossbody.reports import voice
from crossbody.reports.analysis import numbers as work
from crossbody.reports.pages import site as page
from crossbody.reports.runs import jobs, output, study
from crossbody.reports.runs.provenance import provenance
from crossbody.reports.sections.analysis import PREFIX

OMEGA = np.geomspace(1e-2, 1e4, 301)
LOCUS_POINTS = 61
SHOWN = 40
"""Rows of a table that are printed."""


def parse_range(text: str) -> tuple[str, list[float]]:
    """PARAM=a..b as the parameter and its values.

    Raises:
        InvalidValue: for a text of another form.
    """
    name, _, ends = text.partition("=")
    low, dots, high = ends.partition("..")
    try:
        first, last = float(low), float(high)
    except ValueError:
        dots = ""
    if not name or not dots or not (np.isfinite(first) and np.isfinite(last)):
        raise InvalidValue(f"--locus {text!r} is not PARAM=a..b, for example --locus kstar=0..20.")
    return name.strip(), np.linspace(first, last, LOCUS_POINTS).tolist()


def parse_place(pairs: Sequence[str]) -> dict[str, float]:
    """Where to look, from k=v.

    Raises:
        InvalidValue: for what is not a number.
    """
    found = jobs.parse_settings(pairs)
    for name, value in found.items():
        if isinstance(value, str):
            raise InvalidValue(f"--at {name} is {value!r}; it must be a number.")
    return {name: float(value) for name, value in found.items()}


def analyse(
    name: str, variant: str | None, pairs: Sequence[str], at: Sequence[str], *, bode: bool, locus: str | None,
    mapped: bool, out: Path | None, command: str,
) -> int:  # fmt: skip
    """Analyse one case.

    Args:
        name: of the case.
        variant: its first if not given.
        pairs: K=V, parameters to change.
        at: K=V, where to look.
        bode: frequency responses too.
        locus: PARAM=a..b, poles over that parameter.
        mapped: stability over the workspace.
        out: folder to write; nothing is written without it.
        command: what was typed, for provenance.

    Raises:
        CrossbodyError: for wrong use, before anything is written.
    """
    overrides, place = jobs.parse_settings(pairs), parse_place(at)
    case = cases.load(name, variant, **overrides)
    found = work.places(case, place)
    tables = {
        "equilibria": work.equilibria(found, case), "poles": work.poles(found), "ranks": work.ranks(found)
    }  # fmt: skip
    if bode and len(rows := work.responses(found, OMEGA)):
        tables["responses"] = rows
    if locus:
        parameter, values = parse_range(locus)
        tables["locus"] = work.root_locus(name, variant, overrides, place, parameter, values)
    if mapped:
        tables["map"] = work.workspace(case)
    if out is not None:
        _write(out, tables, command)
    if not voice.told_as_json(tables) and not voice.quiet():
        _show(case.label, tables)
        if out is not None:
            print(f"Report: {(out / page.PAGE).absolute()}")
    return 0


def _write(out: Path, tables: Mapping[str, pd.DataFrame], command: str) -> None:
    """Every table, and the page."""
    told = provenance(command)
    output.check(out)
    with output.folder(out) as made:
        study.write(made, [], study.judge([], {}), told)
        for key, rows in tables.items():
            study.write_table(made / f"{PREFIX}{key}", rows, told)
        page.write(made)


def _show(label: str, tables: Mapping[str, pd.DataFrame]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    for key in ("equilibria", "poles", "ranks"):
        rows = tables[key]
        table = Table(title=f"{label}: {key}", title_justify="left")
        for column in rows.columns:
            table.add_column(column, justify="left" if rows[column].dtype == object else "right")
        for record in rows.head(SHOWN).itertuples(index=False):
            table.add_row(*(f"{x:.6g}" if isinstance(x, float) else str(x) for x in record))
        console.print(table)
        if len(rows) > SHOWN:
            console.print(f"... {len(rows) - SHOWN} more rows; --out DIR keeps all.")
