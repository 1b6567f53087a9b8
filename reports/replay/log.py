"""What `crossbody log` prints."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from crossbody import hw
from crossbody.cases import InvalidValue
from crossbody.reports import layout, voice

if TYPE_CHECKING:
    from collections.abc import Sequence

    from crossbody.hw import Finding, GroupSurvey, Survey


def info(path: Path, columns: str | None, part: int | None, draft_only: bool, memory: int = 1000) -> int:
    """Say what is in a log and what is wrong with it, by a column map or, without one, by its draft.

    Reading may take so many MB over the file's own size.
    """
    if part is not None and columns is None:
        raise InvalidValue(f"--part {part}: only a column map separates runs; valid: --part with --columns MAP.")
    room = memory * 1_000_000
    found = hw.survey(path, columns, memory=room)
    if draft_only:
        print(hw.draft_text(found))
        found.refuse()
        return 0
    if not voice.silent():
        _show(found)
    told = found.findings if columns is None else hw.check(path, columns, part, memory=room)
    if voice.as_json():
        voice.result(json.dumps(plain(found, told), indent=1, allow_nan=False))
    else:
        _show_findings([one for one in told if one.fault or not voice.quiet()])
    if columns is None:
        if not voice.silent():
            print(f"\nDraft of a column map:\n\n{hw.draft_text(found)}")
        found.refuse()
        return 0
    for finding in told:
        if finding.fault:
            raise finding.error(path)
    return 0


def plain(found: Survey, told: Sequence[Finding]) -> dict[str, Any]:
    """A survey and what is doubtful about it in plain values, None for what is not finite."""
    groups = [
        {
            "name": group.group.name, "rows": group.rows,
            "clock": group.clock.column if group.clock else None, "duration": group.duration,
            "step": group.step, "longest": group.longest, "lost": group.lost, "jitter": group.jitter,
            "channels": [
                {"name": one.column.name, "unit": one.column.unit, "type": one.column.type, "smallest": one.low,
                 "largest": one.high, "not_finite": one.missing}
                for one in group.columns
            ],
        }
        for group in found.groups
    ]  # fmt: skip
    findings = [asdict(one) for one in told]
    known = {"path": str(found.path), "format": found.format, "library": found.library, "refused": found.refused}
    finite: dict[str, Any] = _finite(known | {"groups": groups, "findings": findings})
    return finite


def _finite(value: Any) -> Any:
    """Plain values with None where a number is not finite, which JSON cannot say."""
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(one) for one in value]
    if isinstance(value, (str, bool, int)) or value is None:
        return value
    return float(value) if math.isfinite(value) else None


def _show(found: Survey) -> None:
    print(f"{printable(str(found.path))}: {found.format}, read by {found.library}")
    for group in found.groups:
        _show_group(group)
    for name, why in found.refused.items():
        print(f"not read: {printable(name)} {printable(why)}")


def printable(text: str) -> str:
    """Text out of a file, without what would steer a terminal."""
    return text if text.isprintable() else repr(text)[1:-1]


def _show_group(group: GroupSurvey) -> None:
    title = f"{printable(group.group.name)}: " if group.group.name else ""
    if math.isfinite(group.step) and group.step > 0:
        clock = printable(group.clock.column) if group.clock else "the file's own steps"
        text = (
            f"{title}{group.rows} rows over {group.duration:.6g} s by {clock}: {1 / group.step:.6g} Hz, "
            f"longest step {group.longest:.3g} s, {group.lost} samples missing, jitter {group.jitter:.2g} s"
        )
    else:
        text = f"{title}{group.rows} rows, no column of times found"
    print("\n" + layout.told(text))
    print(_table(group))


def _table(group: GroupSurvey) -> str:
    columns = {
        "unit": [printable(one.column.unit or "-") for one in group.columns],
        "type": [printable(one.column.type) for one in group.columns],
        "smallest": [f"{one.low:.6g}" for one in group.columns],
        "largest": [f"{one.high:.6g}" for one in group.columns],
        "not finite": [str(one.missing) for one in group.columns],
    }
    names = [printable(one.column.name) for one in group.columns]
    return layout.laid_out(names, columns, layout.columns(), head="channel", left_out=("type",))


def _show_findings(findings: Sequence[Finding]) -> None:
    if not voice.quiet():
        print("\nFindings:" if findings else "\nNo faults were found.")
    for one in findings:
        kind = "fault" if one.fault else "note"
        when = f", t = {one.t:.9g} s" if math.isfinite(one.t) else ""
        where = f"{printable(one.channel)}, row {one.row}{when}"
        print(layout.told(f"  {kind}: {one.check}: {where}: {printable(one.text)}"))
