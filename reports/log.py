"""What `crossbody log` prints."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from crossbody import hw

if TYPE_CHECKING:
    from collections.abc import Sequence

    from crossbody.hw import Finding, GroupSurvey

WIDTH = 120  # of the tables in a file or a pipe


def info(path: Path, columns: str | None, part: int | None, draft_only: bool) -> int:
    """Say what is in a log and what is wrong with it.

    Args:
        path: the log.
        columns: a column map to check it by; if not given, one is drafted.
        part: number of the run, where the map tells several apart.
        draft_only: whether to print the drafted map and nothing else.

    Raises:
        CrossbodyError: if the log cannot be read, or a check refuses it (after everything else was printed).
    """
    found = hw.survey(path)
    if draft_only:
        print(hw.draft_text(found))
        found.refuse()
        return 0
    print(f"{printable(str(path))}: {found.format}, read by {found.library}")
    for group in found.groups:
        _show_group(group)
    for name, why in found.refused.items():
        print(f"not read: {printable(name)} {printable(why)}")
    if columns is None:
        _show_findings(found.findings)
        print("\nDraft of a column map:\n")
        print(hw.draft_text(found))
        found.refuse()
        return 0
    told = hw.check(path, columns, part)
    _show_findings(told)
    for finding in told:
        if finding.fault:
            raise finding.error(path)
    return 0


def printable(text: str) -> str:
    """Text out of a file, without what would steer a terminal."""
    return text if text.isprintable() else repr(text)[1:-1]


def _show_group(group: GroupSurvey) -> None:
    title = f"\n{printable(group.group.name)}: " if group.group.name else "\n"
    if math.isfinite(group.step) and group.step > 0:
        clock = printable(group.clock.column) if group.clock else "the file's own steps"
        print(
            f"{title}{group.rows} rows over {group.duration:.6g} s by {clock}: {1 / group.step:.6g} Hz, longest step "
            f"{group.longest:.3g} s, {group.lost} samples missing, jitter {group.jitter:.2g} s"
        )
    else:
        print(f"{title}{group.rows} rows, no column of times found")
    _print(_table(group))


def _table(group: GroupSurvey) -> Any:
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in ("channel", "unit", "type"):
        table.add_column(name, overflow="fold")
    for name in ("smallest", "largest", "not finite"):
        table.add_column(name, justify="right", no_wrap=True)
    for one in group.columns:
        words = (one.column.name, one.column.unit or "-", one.column.type)
        numbers = (f"{one.low:.6g}", f"{one.high:.6g}", str(one.missing))
        table.add_row(*(Text(printable(word)) for word in words), *numbers)
    return table


def _show_findings(findings: Sequence[Finding]) -> None:
    print("\nFindings:" if findings else "\nNothing is wrong with it.")
    for one in findings:
        kind = "fault" if one.fault else "note"
        when = f", t = {one.t:.9g} s" if math.isfinite(one.t) else ""
        print(f"  {kind}: {one.check}: {printable(one.channel)}, row {one.row}{when}: {printable(one.text)}")


def _print(table: Any) -> None:
    from rich.console import Console

    (Console() if sys.stdout.isatty() else Console(width=WIDTH)).print(table)
