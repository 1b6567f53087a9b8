"""Which files of a folder are whose: every study lists its own, and nothing else is ever replaced or removed.

A folder may come from a stranger: a name that only crossbody gives is enough to make a file ours,
any other name needs the content that was written.
"""

from __future__ import annotations

import json
import os
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from crossbody.cases import OutputError
from crossbody.reports.runs import files

MARKER = ".crossbody"  # holds the manifest; stands in every folder that crossbody wrote
PAGES, EARLIER = "pages", "earlier"
INDEX = "index"
PAGE = f"{INDEX}.html"
"""Where a reader begins."""
"""What is made from the tables of all studies; what a version without manifests wrote."""
JUDGED = frozenset({"run", "replay", "identify"})
"""Studies with verdicts: a folder holds those of one of them."""
ASSETS = frozenset({"plotly.min.js", "crossbody.css", "crossbody.js"})
_TABLE = re.compile(r"[a-z][a-z_-]*\.(json|csv|parquet)")
_MOTION = re.compile(r"traces/[0-9]{4,}\.parquet")
_BASE = re.compile(r"(verdicts|audit|provenance)\.(json|csv|parquet)")


def is_page(name: str) -> bool:
    """Whether a file is made from tables and can be made again."""
    return name.endswith(".html") or name in ASSETS


def is_table(name: str) -> bool:
    """Whether a file may be a table of a study."""
    return _TABLE.fullmatch(name) is not None


def is_result(name: str) -> bool:
    """Whether a file may be a table or a motion of a study."""
    return is_table(name) or _MOTION.fullmatch(name) is not None


def is_base(name: str) -> bool:
    """Whether every folder has this file: a study without verdicts writes it only where nobody has."""
    return _BASE.fullmatch(name) is not None


@dataclass(frozen=True, slots=True)
class Manifest:
    """What crossbody wrote into a folder.

    Attributes:
        studies: name of a study -> relative names of its files.
    """

    studies: Mapping[str, frozenset[str]] = field(default_factory=dict)

    @property
    def files(self) -> frozenset[str]:
        """All files that are crossbody's."""
        return frozenset().union(*self.studies.values())

    def owner(self, name: str) -> str:
        """The study that a file belongs to; empty if it is the user's."""
        return next((study for study, names in self.studies.items() if name in names), "")

    def judged(self) -> str:
        """The study whose verdicts the folder holds; empty if there is none."""
        return next((study for study in self.studies if study in JUDGED), "")

    def updated(self, study: str, names: Iterable[str], adds: bool = False) -> Manifest:
        """The manifest after a study has been written.

        Args:
            study: its name.
            names: its files, pages among them.
            adds: whether the study keeps the files that it had.
        """
        given = frozenset(names)
        pages, own = frozenset(filter(is_page, given)), frozenset(name for name in given if not is_page(name))
        gone = set() if adds else {study} | ({EARLIER} if study in JUDGED else set())
        left = {key: value - own for key, value in self.studies.items() if key not in {*gone, PAGES}}
        kept = self.studies.get(PAGES, frozenset()) if "index.html" not in pages else frozenset()
        merged = {**left, study: left.get(study, frozenset()) | own, PAGES: kept | pages}
        return Manifest({key: value for key, value in merged.items() if value})


def read(folder: Path) -> Manifest:
    """Read the manifest of a folder, less what has been written by others since.

    Of what an earlier version wrote, that is ours which is recognised.

    Raises:
        OutputError: if the manifest is none.
    """
    try:
        text = files.read_inside(folder, MARKER).decode("utf-8", errors="replace")
    except FileNotFoundError:
        return Manifest()
    except NotADirectoryError:
        raise OutputError(f"{folder} is not a folder; name one that crossbody wrote.") from None
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"{folder / MARKER} cannot be read: {error.strerror}.") from None
    if not text.lstrip().startswith("{"):
        return Manifest({EARLIER: frozenset(_recognised(folder))})
    told = _studies(folder / MARKER, text)
    return Manifest({study: frozenset(_unchanged(folder, sums)) for study, sums in told.items()})


def _studies(path: Path, text: str) -> dict[str, dict[str, str]]:
    """Studies of a manifest, and the digest of every file; an earlier version gave none."""
    try:
        found: Any = files.decoded(text.encode())["studies"]
        told = {
            str(study): dict(names) if isinstance(names, dict) else dict.fromkeys(names, "")
            for study, names in found.items()
        }
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise OutputError(f"{path} is not a manifest of crossbody: it has no table `studies` of tables.") from None
    for study, names in told.items():
        if wrong := [name for name in names if not files.is_plain(name)]:
            raise OutputError(f"{path}: studies.{study} names {wrong[0]!r}, which is not a file of this folder.")
    return told


def _unchanged(folder: Path, sums: Mapping[str, str]) -> Iterator[str]:
    """Yield the files that are not there, or are as they were written."""
    plain = [name for name, told in sums.items() if not told and not is_table(name)]
    known = {name for name in plain if os.path.lexists(folder / name) and _is_generated(folder, name)}
    for name, told in sums.items():
        try:
            own = is_base(name) or _MOTION.fullmatch(name) is not None or name in ASSETS or name == "index.html"
            if own or name in known or files.digest(folder, name) == told:
                yield name
        except FileNotFoundError:
            yield name
        except OutputError:
            continue  # a link or a folder stands there
        except OSError as error:
            raise OutputError(f"{folder / name} cannot be read: {error.strerror}.") from None


def intact(folder: Path) -> frozenset[str]:
    """Return the files of a folder that are, byte by byte, as crossbody wrote them there; none without a manifest."""
    try:
        text = files.read_inside(folder, MARKER).decode("utf-8", errors="replace")
        sums = [one for study in _studies(folder / MARKER, text).values() for one in study.items()]
        return frozenset(name for name, told in sums if files.digest(folder, name) == told)
    except OSError:
        return frozenset()


def _recognised(folder: Path) -> list[str]:
    found = files.walked(folder)
    tables = set(filter(is_table, found))
    whole = {n for n in tables if n == "provenance.json" or {Path(n).with_suffix(s).name for s in SUFFIXES} <= tables}
    return [n for n in found if n in whole or _MOTION.fullmatch(n) or n in ASSETS or _is_generated(folder, n)]


SUFFIXES = (".json", ".csv", ".parquet")


def _is_generated(folder: Path, name: str) -> bool:
    if not name.endswith(".html") or "/" in name:
        return False
    with files.open_inside(folder, name) as file:
        return b'<meta name="generator" content="crossbody">' in file.read(400)


def write(folder: Path, manifest: Manifest) -> None:
    """Write the manifest of a folder, whole or not at all."""
    sums = {
        study: {name: files.digest(folder, name) for name in sorted(names) if os.path.lexists(folder / name)}
        for study, names in manifest.studies.items()
    }
    told = {"written by": "crossbody", "studies": sums}
    replace_text(folder / MARKER, json.dumps(told, indent=1) + "\n")


def replace_text(path: Path, text: str | bytes) -> None:
    """Write one file of a folder of ours, whole or not at all; a link there is replaced, not followed."""
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(text.encode("utf-8") if isinstance(text, str) else text)
            os.fchmod(file.fileno(), 0o644)
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise
