"""What `crossbody audit` does: a robot file through every importer, told as a table, and what is wrong beneath it."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from crossbody.cases import EngineUnavailable, UnknownName
from crossbody.engines import importers
from crossbody.reports import voice
from crossbody.reports.importers.audit import Audit, audited
from crossbody.reports.importers.compare import FAILED, NONE, OK, QUANTITIES, UNSUPPORTED, WRONG, Row

WIDTH = 80
SHORT = {UNSUPPORTED: "unsupp.", FAILED: FAILED, NONE: NONE, OK: OK}


def audit(path: Path, engines: Sequence[str], without: str, seconds: float) -> int:
    """Audit one file.

    Args:
        path: of the file.
        engines: names of importers; all of them if there are none.
        without: what is left out of the yardstick.
        seconds: what an importer may take.

    Returns:
        1 if a reader makes something else of the file or fails, else 0.

    Raises:
        CrossbodyError: for wrong use, a file that is none, engines none of which is there.
    """
    if not path.is_file():
        raise UnknownName("robot file", str(path), ())
    wanted = importers.known(engines)
    found: Audit | None = None
    rows: list[Row] = []
    for audit_of, name, own in audited(path, wanted, without, seconds):
        found = audit_of
        rows += own
        if len(wanted) > 1:
            voice.note(f"{name}: {summary(own)}")
    if found is None:
        asked = ", ".join(wanted)
        raise EngineUnavailable(f"None of these is installed: {asked}; pip install 'crossbody[engines]' brings two.")
    rows.sort(key=lambda row: (wanted.index(row.engine), QUANTITIES.index(row.quantity)))
    if voice.as_json():
        print(json.dumps([asdict(row) for row in rows]))
    else:
        _show(found, rows)
    return int(any(row.verdict in (WRONG, FAILED) for row in rows))


def summary(rows: Sequence[Row]) -> str:
    """Return in a few words what one importer makes of a file."""
    if rows[0].verdict != OK:
        return f"{rows[0].verdict}: {rows[0].why}"
    wrong = [row.quantity for row in rows if row.verdict == WRONG]
    return f"reads {', '.join(wrong)} differently" if wrong else "reads the same robot"


def _show(found: Audit, rows: Sequence[Row]) -> None:
    if not voice.quiet():
        scene = found.scene
        counts = {"joints": len(scene.joints), "degrees of freedom": scene.nv, "loops": len(scene.loops),
                  "actuators": len(scene.actuators), "states": len(found.job["states"])}  # fmt: skip
        print(f"{found.path.name}: {', '.join(f'{count} {name}' for name, count in counts.items())}")
        for text in found.findings:
            _say(text)
        print("\n".join(table(rows)))
    for row in rows:
        if row.verdict in (WRONG, FAILED) or (row.verdict == UNSUPPORTED and not voice.quiet()):
            _say(sentence(row))
    for name, why in sorted(found.absent.items()):
        if not voice.quiet():
            _say(f"{name} is not there: {why}")


def _say(text: str) -> None:
    print(textwrap.fill(text, WIDTH, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False))


def table(rows: Sequence[Row]) -> list[str]:
    """Return lines of 80 columns: quantities down, engines across."""
    engines = list(dict.fromkeys(row.engine for row in rows))
    cells = {(row.quantity, row.engine): row for row in rows}
    versions = {row.engine: row.version for row in rows if row.version}
    width = min((WIDTH - 13) // max(len(engines), 1), 16)
    lines = ["", "".join([" " * 13, *(name[: width - 1].rjust(width) for name in engines)]).rstrip()]
    lines.append("".join([" " * 13, *(versions.get(name, "")[: width - 1].rjust(width) for name in engines)]).rstrip())
    for quantity in QUANTITIES:
        own = [cells.get((quantity, name)) for name in engines]
        if any(own):
            lines.append("".join([quantity.ljust(13), *(_cell(row).rjust(width) for row in own)]).rstrip())
    return [*lines, ""]


def _cell(row: Row | None) -> str:
    if row is None:
        return ""
    if row.verdict == WRONG:
        return f"{row.difference:.1e}" if row.difference is not None and row.difference < 1e300 else WRONG
    return SHORT[row.verdict]


def sentence(row: Row) -> str:
    """Return what is wrong, in one sentence."""
    if row.verdict == FAILED:
        return f"{row.engine}: {row.quantity} failed: {row.why}"
    if row.verdict == UNSUPPORTED:
        return f"{row.engine}: {row.quantity} unsupported: {row.why}"
    values = f" is {row.value:.6g}, and {row.expected:.6g} in the file" if None not in (row.value, row.expected) else ""
    at = f" ({Path(row.file).name}:{row.line})" if row.line else ""
    return f"{row.engine}: {row.quantity}: {row.where}{values}{at}.{' ' + row.why if row.why else ''}"
