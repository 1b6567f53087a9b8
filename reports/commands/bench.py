"""What the command `bench` does: time, compare, write, show."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import click
import pandas as pd
from pyarrow import ArrowException

from crossbody.cases import CrossbodyError, InvalidValue, OutputError
from crossbody.reports import layout, voice
from crossbody.reports.bench import against as bench_against
from crossbody.reports.bench import measure, scenes, skip, throughput
from crossbody.reports.bench.headline import headline, summary
from crossbody.reports.commands.shared import check_answers, identity, key, print_rows, publish, where
from crossbody.reports.runs import choice, files, output
from crossbody.reports.runs.parts import Parts
from crossbody.reports.runs.provenance import provenance
from crossbody.reports.runs.watch import LIMIT
from crossbody.reports.voice import progress

SHOWN = {
    "bench": ["case", "engine", "profile", "knob", "setting", "error", "median_ms", "call_ms", "native_ms", "honesty",
              "error_between", "iqr_ms", "control_ms", "outcome"],
    "orders": ["case", "engine", "profile", "knob", "order", "promised", "says"],
    "headline": ["case", "engine", "profile", "best_error", "engine_ms", "reference_ms", "ratio", "ratio_native",
                 "least_ratio", "ahead", "tier", "says"],
}  # fmt: skip
"""Columns that are printed; where they are too wide the last ones go."""
UNSAID = {"", "converges"}  # what is said of a row as a rule


def run(
    names: Sequence[str], wanted: Sequence[str], variant: str | None, pairs: Sequence[str], out: Path,
    repeats: int | None, full: bool, against: Path | None, command: str, limit: float = LIMIT,
    minutes: float | None = None,
) -> int:  # fmt: skip
    """Time engines against their error; writes tables and page, and compares with an earlier folder; the exit code."""
    cases, picks = scenes.chosen(names, variant, choice.parse_settings(pairs), full), scenes.picks(wanted)
    base = None if against is None else bench_against.read(against)
    if base is not None:
        bench_against.check_common(base[0], [case.label for case in cases])
    each = math.inf if minutes is None else 60.0 * minutes / max(1, len(cases) * len(picks))
    effort = scenes.effort(full, every_rung=bool(names or variant or pairs), repeats=repeats, each=each)
    output.check(out, "bench")
    check_answers("bench")
    with Parts(out, command, identity("bench", cases, names, picks=picks, effort=effort)) as parts:
        with progress(len(cases) * len(picks)) as tell:
            for i, case in enumerate(cases):
                if not parts.has(key(i, case)) and len(rows := measure.bench(case, picks, effort, tell, limit)):
                    with parts.put(key(i, case)) as made:
                        rows.to_parquet(made / "bench.parquet")
        done = [parts.part(key(i, case)) for i, case in enumerate(cases) if parts.has(key(i, case))]
        rows, orders = measure.joined([_part(path) for path in done])
        if not len(rows):
            absent = " ".join(pick.skipped for pick in picks if pick.skipped)
            raise InvalidValue(f"None of the selected engines can run any of the selected cases. {absent}".strip())
        tables = {"bench": rows, "orders": orders, "headline": headline(rows)}
        losses = {} if base is None else {"lost": bench_against.lost(rows, tables["headline"], *base)}
        publish(out, "bench", tables | losses, provenance(command, repeats=effort.repeats))
    show(tables | (losses if voice.as_json() else {}), out)
    return tell_losses(losses["lost"], against) if losses else 0


def _part(path: Path) -> pd.DataFrame:
    """The rows of one case that is complete."""
    try:
        with files.open_inside(path, "bench.parquet") as file:
            return pd.read_parquet(file)[list(measure.COLUMNS)]
    except (OSError, ValueError, KeyError, ArrowException):
        raise OutputError(f"{path} is not part of a benchmark; remove {path.parent}.") from None


def show(tables: Mapping[str, pd.DataFrame], out: Path) -> None:
    """What the comparison comes to, the tables in the terminal, and where the page is."""
    if len(tables.get("headline", ())) and not voice.as_json() and not voice.quiet():
        click.echo(layout.told(summary(tables["headline"])))
    for name, table in tables.items() if not voice.told_as_json(tables) and not voice.quiet() else ():
        shown = table[SHOWN[name]] if name in SHOWN else table
        above = "case" if "case" in shown else ""
        print_rows(shown.drop(columns="says", errors="ignore"), digits=3, title=f"\n{name}\n", above=above)
        for sentence in _said(shown):
            click.echo(layout.told(sentence))
    where(out)


def _said(rows: pd.DataFrame) -> Iterator[str]:
    """What a table says of some of its rows, once for all of an engine."""
    if "says" not in rows:
        return
    for says in (says for says in rows["says"].unique() if says not in UNSAID):
        own = rows[rows["says"] == says]
        who = own["case"] + " " + own["engine"] + ":" + own["profile"]
        yield f"{', '.join(who)}: {says.removesuffix('.')}."


def tell_losses(losses: pd.DataFrame, against: Path | None) -> int:
    """Every loss with its reason; 1 if there is one."""
    for loss in losses.to_dict(orient="records") if not voice.as_json() else ():
        run = f"{loss['case']} {loss['engine']}:{loss['profile']}"
        click.echo(layout.told(f"lost {loss['what']}: {run}: {loss['why']}."))
    if not voice.silent():
        print(f"Against {against}: {len(losses)} lost.")
    return int(len(losses) > 0)


def table(name: str, rows: pd.DataFrame, out: Path, command: str, failed: Sequence[str] = ()) -> int:
    """Write and show one table of its own; 1 if something in it failed."""
    if not len(rows):
        raise CrossbodyError(f"The table {name} has no rows.")
    publish(out, name, {name: rows}, provenance(command))
    show({name: rows}, out)
    for line in failed if not voice.as_json() else ():
        click.echo(layout.told(f"outside: {line}"))
    return int(bool(failed))


def alone(what: str, repeats: int | None, out: Path, command: str, limit: float = LIMIT, **asked: object) -> int:
    """The table of what is skipped, or of the throughput of many runs; the exit code."""
    if any(asked.values()):
        raise InvalidValue(f"--{what} has its own scenes; only --out and --repeats can be combined with it.")
    output.check(out, what)
    check_answers("bench")
    rows = (skip if what == "skip" else throughput).measure(repeats or 5)
    beyond = rows[~rows["held"].astype(bool)]
    return table(what, rows, out, command, [str(text) for text in beyond["what"]])
