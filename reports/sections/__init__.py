"""Studies beside the verdicts of cases: a module here turns the tables of a folder into sections of a page.

A module has a docstring whose first line says what it shows, and the public names

    TITLE                           heading of its page and of the link to it
    sections(out)                   tuple of `Section`; empty where the folder has no such data

It reads tables only (`crossbody.reports.runs.study.read_json`), never an engine: a page can be made again years later.
"""

from __future__ import annotations

from pathlib import Path
from typing import Protocol, cast

from crossbody.cases import _registry
from crossbody.reports.pages.section import Section


class Study(Protocol):
    """What every module offers."""

    TITLE: str

    def sections(self, out: Path) -> tuple[Section, ...]:
        """The sections of a folder's page."""
        ...


def names() -> tuple[str, ...]:
    """Names of all studies; imports none of them."""
    return _registry.plugin_names(__name__, list(__path__))


def load(name: str) -> Study:
    """Import a study.

    Raises:
        UnknownName: if there is no such study; the message lists the names.
    """
    return cast("Study", _registry.load_plugin("study", __name__, list(__path__), name))
