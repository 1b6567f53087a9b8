"""Whose fault it is that something cannot be shown: crossbody's, where this version wrote it as it stands there."""

from __future__ import annotations

import json
from collections.abc import Iterator, Set
from contextlib import contextmanager
from pathlib import Path

from jinja2 import TemplateError

from crossbody.cases import CrossbodyError, installed
from crossbody.cases.errors import OwnFault
from crossbody.reports.runs import files, manifest, output

BROKEN = (KeyError, TypeError, ValueError, AttributeError, IndexError, ArithmeticError, RecursionError, TemplateError)
"""What making a page of tables raises that are not what they should be."""


@contextmanager
def blamed(folder: Path, against: Path | None = None) -> Iterator[None]:
    """Let what showing a folder raises be a fault of crossbody's own, unless somebody else had a hand in what is shown.

    Args:
        folder: of results, or of a study that is being written.
        against: an earlier folder that is shown beside it.

    Raises:
        OwnFault: in the place of what is raised.
    """
    try:
        yield
    except (*BROKEN, CrossbodyError) as error:
        if installed.sentence(error) not in (None, str(error)):  # in a file of the user's own
            raise
        if not _as_written(folder) or not (against is None or _untouched(against, _written(against))):
            raise
        said = " ".join(f"{type(error).__name__}: {error}".split())
        raise OwnFault(f"What was written into {output.home(folder)} cannot be shown: {said}") from error


def _written(folder: Path) -> set[str]:
    """Return the names of the tables and motions of a folder."""
    return {name for name in files.walked(folder) if manifest.is_result(name)}


def _as_written(folder: Path) -> bool:
    """Return whether nobody else had a hand in a folder, or in what a study has not written itself."""
    names = _written(folder)
    return _untouched(output.home(folder), names & output.others(folder) if output.is_staged(folder) else names)


def _untouched(folder: Path, names: Set[str]) -> bool:
    """Return whether files of a folder are as they were written there, by this version."""
    if not names <= manifest.intact(folder):
        return False
    return all(written_by(folder / name) == installed.version("crossbody") for name in names if name.endswith(".json"))


def written_by(path: Path) -> str:
    """Return the version of crossbody in the provenance of a table, or that provenance.json gives; empty without."""
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        return str(told.get("provenance", told)["versions"]["crossbody"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return ""
