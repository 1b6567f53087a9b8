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

import json
from pathlib import Path
from typing import cast

from crossbody.cases import installed
from crossbody.cases.registry import Registry
from crossbody.reports.figures.section import Section
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
    """Sections of a study in a folder; one that says so where another version wrote its tables.

    A fault in making a section from tables of this version stays loud.
    """
    study = load(name)
    try:
        return study.sections(out)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, ArithmeticError) as error:
        wrote, mine = _written_by(out), installed.version("crossbody")
        told = (
            f"These tables cannot be shown ({type(error).__name__}: {error}), although this "
            "version wrote them: they were changed, or this is a fault of crossbody. Run the "
            "study again, and report it if it persists."
            if wrote == mine
            else f"Another version of crossbody wrote these tables ({wrote or 'unknown'}; {error} is not as "
            "expected): run the study again."
        )
        return (Section(name=name, title=study.TITLE, text=told),)


def _written_by(out: Path) -> str:
    """Version of crossbody in the provenance of a folder; empty where it is not given."""
    try:
        told = json.loads((out / "provenance.json").read_text(encoding="utf-8"))
        return str(told["versions"]["crossbody"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""
