"""Rows of an audit as others read them: SARIF for code scanning, Markdown for a pull request."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any
from urllib.parse import quote

from crossbody.reports.importers.causes import advice
from crossbody.reports.importers.compare import FAILED, QUANTITIES, UNSEEN, UNSUPPORTED, WRONG, Row

LEVELS = {WRONG: "error", FAILED: "error", UNSUPPORTED: "note"}
MARK = "Written by crossbody audit"  # what says that a file may be written over
SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"


def sentence(row: Row) -> str:
    """Return what is wrong, in one sentence."""
    if row.verdict in (FAILED, UNSUPPORTED, UNSEEN):
        return f"{row.engine}: {row.quantity} {row.verdict}: {row.why}"
    if row.value is None or row.expected is None:
        return f"{row.engine}: {row.quantity}: {row.where}."
    if row.where.endswith((" missing", " more", " joints", " touch")):  # then they are numbers of parts
        return f"{row.engine}: {row.quantity}: {row.where}: {row.value:g} of them, and {row.expected:g} in the file."
    digits = next((n for n in (6, 9, 12) if f"{row.value:.{n}g}" != f"{row.expected:.{n}g}"), 17)
    value, expected = (f"{one:.{digits}g}" for one in (row.value, row.expected))
    return f"{row.engine}: {row.quantity}: {row.where} is {value}, and {expected} in the file."


NAMED = 3  # quantities that are named of an engine in the first sentence


WAYS = {
    "": ("reads the robot that the file describes", "read the robot that the file describes"),
    "partly": (("reads it, except for features that it lacks or does "
        "not show"), "read it, except for features that they lack or do not show"),
    "another": ("reads another robot", "read another robot"), "failed": ("fails on it", "fail on it"),
    "unread": ("does not read such a file", "do not read such a file"),
}  # fmt: skip
"""What is said of one engine, and of several."""


def verdict(rows: Sequence[Row]) -> str:
    """Return in one sentence which engines read the robot of the file, and which do not, and in what."""
    of: dict[str, list[Row]] = {}
    for row in rows:
        of.setdefault(row.engine, []).append(row)
    groups: dict[str, list[str]] = {"": [], "partly": [], "another": [], "failed": [], "unread": []}
    for name, own in of.items():
        off = [row.quantity for row in own if row.verdict in (WRONG, FAILED)]
        lacks = any(row.verdict in (UNSUPPORTED, UNSEEN) for row in own)
        kind = "another" if off else "partly" if lacks else ""
        if own[0].verdict in (FAILED, UNSUPPORTED):
            kind = "failed" if off else "unread"
        more = [f"{len(off) - NAMED} more"] if len(off) > NAMED + 1 else off[NAMED:]
        groups[kind].append(f"{name} ({_listed([*off[:NAMED], *more])})" if kind == "another" else name)
    told = [f"{_listed(names)} {WAYS[key][len(names) > 1]}" for key, names in groups.items() if names]
    return "; ".join(told)


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def cell(row: Row | None) -> str:
    """Return a row in a few letters: the largest difference where it is wrong."""
    if row is None:
        return ""
    if row.verdict == WRONG:
        return f"{row.difference:.1e}" if row.difference is not None and row.difference < 1e300 else WRONG
    return "unsupp." if row.verdict == UNSUPPORTED else row.verdict


def grid(rows: Sequence[Row]) -> list[list[str]]:
    """Return heading, versions and lines: quantities down, engines across."""
    engines = list(dict.fromkeys(row.engine for row in rows))
    cells = {(row.quantity, row.engine): row for row in rows}
    versions = {row.engine: row.version for row in rows if row.version}
    lines = [["", *engines], ["", *(versions.get(name, "") for name in engines)]]
    for quantity in QUANTITIES:
        own = [cells.get((quantity, name)) for name in engines]
        if any(own):
            lines.append([quantity, *map(cell, own)])
    return lines


def markdown(path: Path, rows: Sequence[Row]) -> str:
    """Return a summary of one file."""
    heading, versions, *lines = grid(rows)
    names = [f"{name} {number}".strip() for name, number in zip(heading, versions, strict=True)]
    table = [names, ["---"] * len(names), *lines]
    told = [f"- {sentence(row)}{_where(row)}" for row in rows if row.verdict in (WRONG, FAILED)]
    return (
        f"### {path.name}\n\n{verdict(rows)}.\n\n"
        + "\n".join(f"| {' | '.join(line)} |" for line in table)
        + "\n\n"
        + "\n".join(told)
        + f"\n\n<!-- {MARK} -->\n"
    )


def _where(row: Row) -> str:
    place = f"Line {row.line} of {Path(row.file).name}"
    return f" {place}: {row.doubt} {row.cause}. {advice(row.cause)}".replace("  ", " ") if row.cause else ""


def sarif(path: Path, rows: Sequence[Row]) -> str:
    """Return the findings on one file as SARIF 2.1.0."""
    off = [row for row in rows if row.verdict in LEVELS]
    rules = {_rule(row): advice(row.cause) or f"How readers differ in {row.quantity}." for row in off}
    driver = {
        "name": "crossbody", "version": version("crossbody"),
        "rules": [{"id": k, "shortDescription": {"text": k}, "help": {"text": text}} for k, text in rules.items()],
    }  # fmt: skip
    run = {"properties": {"comment": MARK}, "tool": {"driver": driver}, "results": [_result(path, row) for row in off]}
    return json.dumps({"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}, indent=1)


def _rule(row: Row) -> str:
    return row.cause or row.quantity


def _result(path: Path, row: Row) -> dict[str, Any]:
    uri = quote(row.file or path.as_posix())
    place: dict[str, Any] = {"artifactLocation": {"uri": uri}, "region": {"startLine": row.line or 1}}
    return {
        "ruleId": _rule(row), "level": LEVELS[row.verdict], "message": {"text": sentence(row)},
        "locations": [{"physicalLocation": place}],
    }  # fmt: skip


def alike(rows: Sequence[Row]) -> bool:
    """Return whether nothing is wrong, and no reader fails."""
    return all(row.verdict not in (WRONG, FAILED) for row in rows)
