"""What commands share: what decides their result, how tables are written and shown, where the report is."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from crossbody.cases import Case, installed
from crossbody.cases.loading import OF_USERS, parted
from crossbody.reports import layout, voice
from crossbody.reports.judging import known
from crossbody.reports.runs import output, study, watch
from crossbody.reports.runs.manifest import PAGE
from crossbody.reports.sources import code

if TYPE_CHECKING:
    import pandas as pd


def identity(kind: str, cases: Sequence[Case], names: Sequence[str], **more: Any) -> dict[str, Any]:
    """What decides what a command computes: the sources too, and case files of one's own."""
    paths = [*(name for name, _ in map(parted, names) if name.endswith(OF_USERS)), *_acting(cases)]
    own = [hashlib.sha256(Path(name).read_bytes()).hexdigest() for name in paths]
    scenes = [[case.label, dict(case.parameters)] for case in cases]
    return {"kind": kind, "code": code(), "cases": scenes, "files": own, "plugins": installed.digests(), **more}


def _acting(cases: Sequence[Case]) -> list[str]:
    """Files that say what acts on the cases: tables of controls, controllers."""
    told = [(str(case.parameters.get("ctrl", "")), str(case.parameters.get("control", ""))) for case in cases]
    return sorted({name for table, control in told for name in (table, control.rpartition(":")[0]) if name})


def check_answers(command: str) -> None:
    """Ask for the known answers of a command before it says a number; see `known.check`."""
    known.once = watch.alone()
    known.check(command)


def key(number: int, case: Case) -> str:
    """What tells the part of a case from those of the others, which may have its name."""
    return f"{number} {case.label}"


def publish(out: Path, name: str, tables: Mapping[str, pd.DataFrame], told: Mapping[str, Any]) -> None:
    """Write the tables of a study without verdicts (Parquet, CSV, JSON) and its page, all or nothing."""
    from crossbody.reports.pages import site

    with output.folder(out, name) as made:
        study.write(made, [], study.judge([], {}), told)
        for stem, rows in tables.items():
            study.write_table(made / stem, rows, told)
        site.write(made)


def print_rows(rows: pd.DataFrame, digits: int = 4, title: str = "", **how: Any) -> None:
    """Print a table as `layout.frame` lays it out, unless nothing but what is wrong is to be said."""
    if not voice.quiet() and len(rows):
        click.echo(title + layout.frame(rows, layout.columns(), digits=digits, **how))


def where(out: Path) -> None:
    """The path of the report, unless nothing but what is wrong is to be said."""
    if not voice.silent():
        print(f"Report: {(out / PAGE).absolute()}")
