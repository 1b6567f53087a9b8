"""What `crossbody analyse` and `bode` do: equilibria, linear models, tables, figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import click
import numpy as np
import pandas as pd

from crossbody import cases
from crossbody.cases import InvalidValue
from crossbody.cases.files.case import rubbing
from crossbody.reports import layout, voice
from crossbody.reports.analysis import bode as curves
from crossbody.reports.analysis import numbers as work
from crossbody.reports.analysis import summary as told
from crossbody.reports.analysis.counterparts import counterparts
from crossbody.reports.analysis.loci import Family, limits, root_locus
from crossbody.reports.analysis.places import places
from crossbody.reports.commands.shared import check_answers, print_rows, publish, where
from crossbody.reports.judging.verdict import exit_code
from crossbody.reports.runs import choice, output
from crossbody.reports.runs.provenance import provenance

OMEGA = np.geomspace(1e-2, 1e4, 301)
LOCUS_POINTS = 61
PREFIX = "analysis-"  # how the names of the tables begin
SHOWN = 40  # rows of a table that are printed
UNITS = {"real": "real [1/s]", "imag": "imag [rad/s]", "frequency": "frequency [rad/s]", "growth": "growth [1/s]"}
BY = {
    "ranks": {},
    "poles": {"above": "place", "names": "led_by"},
    "equilibria": {"above": "place", "names": "variable"},
}
"""How the lines of tables are named, and what stands above them."""
TITLES = {"equilibria": "values at the operating points"}  # of which some may be instants of a motion
SHARED = "How these share their load the equations leave open, and multipliers of least norm are shown"
BESIDE = ["place", "way", "slope", "poles", "verdict"]
"""Columns that are printed of the differences of engines."""


def parse_range(text: str) -> tuple[str, list[float]]:
    """PARAM=a..b as the parameter and its values."""
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
    """Where to look, from k=v."""
    found = choice.parse_settings(pairs, "--at")
    for name, value in found.items():
        if isinstance(value, str):
            raise InvalidValue(f"--at {name} is {value!r}; it must be a number.")
    return {name: float(value) for name, value in found.items()}


def analyse(
    name: str, variant: str | None, pairs: Sequence[str], at: Sequence[str], *, bode: bool, locus: str | None,
    mapped: bool, out: Path | None, command: str,
) -> int:  # fmt: skip
    """Analyse one case; 1 if an engine's model is outside its limit without a known reason, else 0.

    Pairs K=V are parameters to change, or where to look; locus is PARAM=a..b; without a folder
    nothing is written.
    """
    overrides, place = choice.parse_settings(pairs), parse_place(at)
    case = cases.load(name, variant, **overrides)
    check_answers("analyse")
    case = rubbing(case) or case  # an equilibrium may rest on contacts that slide
    found = places(case, place)
    for text in dict.fromkeys(text for one in found for text in one.system.findings):
        voice.note(text)
    engines, engine_poles = counterparts(found)
    tables = {
        "summary": told.summary(found, case),
        "equilibria": work.equilibria(found, case), "poles": work.poles(found), "ranks": work.ranks(found),
        "engines": engines, "engine-poles": engine_poles,
    }  # fmt: skip
    for key, more in (("coefficients", work.coefficients(found)), ("refusals", work.refusals(found))):
        if len(more):
            tables[key] = more
    if bode and len(rows := work.responses(found, OMEGA)):
        tables["responses"] = rows
    says = told.sentence(case.label, tables["summary"], len(found))
    if locus:
        parameter, values = parse_range(locus)
        family = Family(name, variant, overrides, place, parameter)
        tables["locus"], tables["limits"] = root_locus(family, values), limits(family, values)
        says = f"{told.over(parameter, (values[0], values[-1]), tables['limits'])} {says}"
    tables = {"says": pd.DataFrame({"case": [case.label], "says": [says]}), **tables}
    if mapped:
        tables["map"] = work.workspace(case)
    if out is not None:
        output.check(out, "analyse")
        publish(out, "analyse", {f"{PREFIX}{key}": rows for key, rows in tables.items()}, provenance(command))
    if not voice.told_as_json(tables) and not voice.quiet():
        click.echo(layout.told(says) + "\n")
        _show(case.label, tables)
        if out is not None:
            where(out)
    return exit_code(engines["verdict"])


def bode(pairs: Sequence[str], out: Path, command: str) -> int:
    """Frequency responses in the grasp, poles in every mode set; parameters k* are the figure's own."""
    parameters = choice.parse_settings(pairs)
    if "kstar" in parameters:
        raise InvalidValue(f"kstar is what the curves differ in: {', '.join(f'{k:g}' for k in curves.GAINS)}.")
    output.check(out, "bode")
    check_answers("analyse")
    found = [curves.soft_contact(k, mode, **parameters) for mode in curves.MODES for k in curves.GAINS]
    held = [curve for curve in found if curve.mode == "grasp"]
    tables = {"bode": curves.table(held, curves.FREQUENCIES), "poles": curves.poles(found)}
    publish(out, "bode", tables, provenance(command))
    growths = curves.growths(tables["poles"])
    if not voice.told_as_json(tables | {"growths": growths}):
        print_rows(growths, heads=UNITS, above="mode")
        where(out)
    return 0


def _show(label: str, tables: Mapping[str, pd.DataFrame]) -> None:
    for key in ("equilibria", "poles", "ranks", "coefficients", "limits"):
        if not len(tables.get(key, ())):
            continue
        shown = tables[key].head(SHOWN).drop(columns="shared", errors="ignore")
        print_rows(shown, 6, f"{label}: {TITLES.get(key, key)}\n", heads=UNITS, **BY.get(key, {"above": "place"}))
        if len(tables[key]) > SHOWN:
            click.echo(f"... {len(tables[key]) - SHOWN} more rows; --out DIR keeps all.")
        if "shared" in tables[key] and tables[key]["shared"].any():
            open_ = ", ".join(tables[key].loc[tables[key]["shared"], "variable"].unique())
            click.echo(
                layout.told(f"The equations leave open how these share their load, and the least are shown: {open_}.")
            )
        click.echo()
    for place, why in tables["refusals"].itertuples(index=False) if "refusals" in tables else ():
        click.echo(layout.told(f"{place}: {why}"))
    engines = tables["engines"]
    ways = [f"{who}: {way}" if isinstance(way, str) else who for who, way in engines[["engine", "way"]].to_numpy()]
    beside = engines.assign(way=ways)[BESIDE].head(SHOWN)
    print_rows(beside, 2, f"{label}: differences of engines\n", above="place")
    for why in engines["why"].dropna().unique():
        if why:
            who = ", ".join(engines.loc[engines["why"] == why, "engine"].unique())
            click.echo(layout.told(f"{who}: {why}"))
