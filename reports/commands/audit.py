"""What `crossbody audit` does: a robot file through every importer, as a table, what is wrong beneath."""

from __future__ import annotations

import json
import os
import shutil
import textwrap
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from crossbody.cases import EngineUnavailable, OutputError
from crossbody.cases.arguments import shown
from crossbody.cases.files.reading import existing, is_urdf
from crossbody.engines import importers
from crossbody.reports import voice
from crossbody.reports.importers import told
from crossbody.reports.importers.audit import Audit, audited
from crossbody.reports.importers.causes import advice, explained, parts
from crossbody.reports.importers.compare import FAILED, QUANTITIES, UNSEEN, UNSUPPORTED, WRONG, Row
from crossbody.reports.importers.fix import MARK, fixed
from crossbody.reports.importers.forms import files_of

WIDTH, FIRST, COLUMN = 80, 13, 11
"""Columns of a page at most, of the names of quantities, and of an engine at least."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ask:
    """What is asked for.

    Attributes:
        path: of the file.
        engines: names of importers; all of them if there are none.
        without: what is left out of the yardstick.
        seconds: what an importer may take.
        explain: whether causes are looked for.
        fix, sarif, markdown: files to write.
        force: whether these may be written over what was not written so.
    """

    path: Path
    engines: Sequence[str] = ()
    without: str = ""
    seconds: float = importers.SECONDS
    explain: bool = False
    fix: Path | None = None
    force: bool = False
    sarif: Path | None = None
    markdown: Path | None = None


def audit(ask: Ask) -> int:
    """Audit one file; 1 if a reader makes something else of the file or fails, else 0."""
    existing(ask.path)
    _check_out(ask)
    found, rows = read_by_all(ask)
    if ask.explain or ask.sarif or ask.markdown:
        rows = explained(ask.path, is_urdf(ask.path), rows, ask.seconds, os.cpu_count() or 1, ask.without)
    for file, text in ((ask.sarif, told.sarif), (ask.markdown, told.markdown)):
        if file is not None:
            _write(file, text(ask.path, rows))
    if voice.as_json():
        if ask.fix is not None:  # one document: that of the new file
            return _fix(ask, ask.fix)
        voice.result(json.dumps([asdict(row) for row in rows]))
    else:
        _show(found, rows)
        if ask.explain:
            _explain(ask.path, rows)
    return int(not told.alike(rows)) if ask.fix is None else _fix(ask, ask.fix)


def _check_out(ask: Ask) -> None:
    """Check that nothing is written over what is read, and no file of somebody's over."""
    read = files_of(ask.path)
    options = (("--fix", ask.fix, MARK), ("--sarif", ask.sarif, told.MARK), ("--markdown", ask.markdown, told.MARK))
    for option, out, mark in ((option, out, mark) for option, out, mark in options if out is not None):
        here = f"{option} {shown(str(out))}"
        if out.resolve() in read:
            raise OutputError(f"{here}: it must differ from {ask.path}, the files that it reads and the other outputs.")
        if not out.parent.is_dir():
            raise OutputError(f"{here} cannot be written: there is no folder {shown(str(out.parent))}.")
        if out.exists() and not ask.force and not (out.is_file() and mark in out.read_text("utf-8", "replace")):
            raise OutputError(f"{here}: there is such a file, which was not written by {option}; valid: another name, "
                              "or --force, which overwrites it.")  # fmt: skip
        read.add(out.resolve())


def _fix(ask: Ask, out: Path) -> int:
    """Write the file in plainer words, and audit that: its exit code."""
    fixed(ask.path, out, ask.without)
    voice.note(f"{out} is equivalent to {ask.path}; this is how it is read:")
    return audit(replace(ask, path=out, fix=None, sarif=None, markdown=None))


def read_by_all(ask: Ask) -> tuple[Audit, list[Row]]:
    """Return the audit of a file and the rows of every importer that is there, in the order asked for."""
    wanted, found, rows = importers.known(ask.engines), None, list[Row]()
    for audit_of, _, own in audited(ask.path, wanted, ask.without, ask.seconds):
        found = audit_of
        rows += own
        if len(wanted) > 1:
            voice.note(textwrap.shorten(told.verdict(own), _width() - len("crossbody: "), placeholder=" ..."))
    if found is None:
        raise EngineUnavailable(importers.missing(wanted))
    if all(row.quantity == "reading" and row.verdict == UNSUPPORTED for row in rows):
        why = " ".join(told.sentence(row) for row in rows)
        raise EngineUnavailable(f"No selected and installed reader reads {ask.path}. {why}")
    rows.sort(key=lambda row: (wanted.index(row.engine), QUANTITIES.index(row.quantity)))
    return found, rows


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror}.") from None


def _show(found: Audit, rows: Sequence[Row]) -> None:
    if not voice.quiet():
        scene = found.scene
        counts = {"Joints": len(scene.joints), "degrees of freedom": scene.nv, "loops": len(scene.loops),
                  "actuators": len(scene.actuators), "states": len(found.job["states"])}  # fmt: skip
        _say(f"{found.path.name}: {told.verdict(rows)}.")
        _say(", ".join(f"{name}: {count}" for name, count in counts.items()))
        for text in (*found.findings, *filter(None, found.strange.values())):
            _say(text)
        print("\n".join(table(rows, _width())))
    for row in rows:
        if row.verdict in (WRONG, FAILED) or (row.verdict in (UNSUPPORTED, UNSEEN) and not voice.quiet()):
            _say(told.sentence(row))
    if found.absent and not voice.quiet():
        _say(importers.missing(sorted(found.absent)))


def _explain(path: Path, rows: Sequence[Row]) -> None:
    """Say once for every engine and cause what it is, where, what the format says and how to write it."""
    causes: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        if row.verdict in (WRONG, FAILED):
            causes.setdefault((row.engine, row.cause, row.doubt), []).append(row)
    for (engine, cause, doubt), own in causes.items():
        what = ", ".join(row.quantity for row in own)
        print()
        if cause:
            _say(f"{Path(own[0].file).name}:{own[0].line}: {doubt} {cause} ({engine}: {what})")
            _say(advice(cause))
            for one in parts(cause):
                _say(f"    The smallest file that shows it: crossbody conformance --feature '{one}' -e {engine}")
        else:
            _say(f"{engine}: {what}: no feature of the table that this file uses explains it.")


def _width() -> int:
    """Return the columns that a page has."""
    return min(WIDTH, max(shutil.get_terminal_size((WIDTH, 24)).columns, FIRST + COLUMN))


def _say(text: str) -> None:
    text = " ".join("".join(one if one.isprintable() else "?" for one in word) for word in text.split())
    print(textwrap.fill(text, _width(), subsequent_indent="    ", break_on_hyphens=False))


def table(rows: Sequence[Row], columns: int = WIDTH) -> list[str]:
    """Return lines of so many columns: quantities down, engines across, in several tables if need be."""
    lines, made = told.grid(rows), list[str]()
    most = max((columns - FIRST) // COLUMN, 1)
    for k in range(1, len(lines[0]), most):
        part = [[first, *rest[k - 1 : k - 1 + most]] for first, *rest in lines]
        width = min((columns - FIRST) // (len(part[0]) - 1), 16)
        made.append("")
        made += ["".join([first.ljust(FIRST), *(text[: width - 1].rjust(width) for text in rest)]).rstrip()
                 for first, *rest in part]  # fmt: skip
    return [*made, ""]
