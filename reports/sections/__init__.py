"""Studies beside the verdicts of cases: what turns the tables of a folder into sections of a page.

Ours are in `_own`; those of logs, and any of a user's own, are a module each, with a docstring
whose first line says what it shows, and the public names

    TITLE                           heading of its page and of the link to it
    sections(out)                   tuple of `Section`; empty where the folder has no such data

and, if it is about some cases, CASES, their names: its figures then stand on their pages too.

It reads tables only (`crossbody.reports.runs.study.read_json`), never an engine: a page can be
made again years later. What it must know besides stands in the `provenance` of its tables, since
a folder may hold several studies.
"""

from __future__ import annotations

from pathlib import Path
from typing import cast

from crossbody.cases import installed
from crossbody.cases.registry import Registry
from crossbody.reports.figures.section import Section
from crossbody.reports.runs.origin import BROKEN, blamed, written_by
from crossbody.reports.sections._own import STUDIES, Study

OWN = tuple(STUDIES)  # names that no plug-in can take
_REGISTRY = Registry("study", __name__)


def names(out: Path | None = None) -> tuple[str, ...]:
    """Names of all studies; of a folder without those of ours that have no table in it."""
    known = {*STUDIES, *_REGISTRY.names()}
    absent = [name for name in (*STUDIES, *_REGISTRY.own()) if out is not None and not any(out.glob(f"{name}*.json"))]
    return tuple(sorted(known.difference(absent)))


def load(name: str) -> Study:
    """Return a study.

    Raises:
        UnknownName: if there is no such study; the message lists the names.
    """
    return STUDIES[name] if name in STUDIES else cast("Study", _REGISTRY.load(name))


def shown(name: str, out: Path) -> tuple[Section, ...]:
    """Sections of a study in a folder; one that says so where its tables are not as this version wrote them.

    Raises:
        OwnFault: if they are.
    """
    study = load(name)
    try:
        with blamed(out):
            return study.sections(out)
    except BROKEN as error:
        wrote, mine = written_by(out / "provenance.json"), installed.version("crossbody")
        told = (
            f"These tables cannot be shown ({type(error).__name__}: {error}): they were changed since this version "
            "wrote them. Run the study again."
            if wrote == mine
            else f"Another version of crossbody wrote these tables ({wrote or 'unknown'}; {error} is not as "
            "expected): run the study again."
        )
        return (Section(name=name, title=study.TITLE, text=told),)
