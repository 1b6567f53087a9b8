"""What an engine says that it leaves out: of its consequences it is held to the file without that."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from crossbody.reports.importers.compare import FAILED, NONE, OK, SAID, UNSUPPORTED, WRONG, Row, rows
from crossbody.reports.importers.forms import Forms, Node, Place, removed

ATTRIBUTE = re.compile(r"attribute '(\w+)' found in an? '(\w+)' tag", re.I)
CHILD = re.compile(r"tag '(\w+)' found as a child of '(\w+)'", re.I)
PART = re.compile(r":(\d+):.*?\b(geom|mesh|motor|general|joint|site|body|link)\b.*\bignored", re.I)
"""How one says that it leaves out a part of a line."""
MOST = 16  # lines that are tried alone, for the one that is to blame
OF_MASS = ("inertia", "M", "gravity", "bias", "energy")
"""What there is nothing to compare with where what is left is no robot."""


def excused(told: Sequence[Row], answer: Mapping[str, Any], audit: Any, forms: Forms) -> list[Row]:
    """Return rows, those unsupported that differ by no more than what the engine says that it leaves out.

    Forms of the file are opened at the states of its audit where they have its joints.
    """
    lines = [line for line in answer["told"] if SAID.search(line) and any(
        pattern.search(line) for pattern in (ATTRIBUTE, CHILD, PART))]  # fmt: skip
    if not lines or all(row.verdict not in (WRONG, FAILED) for row in told):
        return list(told)
    if answer["status"] != "read":  # what the compiler was to do may be why it fails
        lines = [line for line in lines if "'compiler'" in line]
    of_line = [_fine(told[0], answer, audit, _form(forms, [line])) for line in lines[:MOST]]
    fine = _fine(told[0], answer, audit, _form(forms, lines)) if lines else set()

    def why(row: Row) -> str:
        alone = [line for line, own in zip(lines, of_line, strict=False) if row.quantity in own]
        return (alone or lines)[0] if alone or len(lines) == 1 else f"{lines[0]} (and {len(lines) - 1} more)"

    return [
        replace(row, verdict=UNSUPPORTED, why=row.why or why(row))
        if row.verdict in (WRONG, FAILED) and row.quantity in fine.union(*of_line) else row for row in told
    ]  # fmt: skip


def _form(forms: Forms, lines: Sequence[str]) -> Any:
    return forms.opened(("declared", *lines), lambda root, places: _leave_out(root, places, lines))


def _fine(first: Row, answer: Mapping[str, Any], audit: Any, form: Any) -> set[str]:
    """Return the quantities in which an importer reads what a form says."""
    if answer["status"] != "read":  # it had to fail where the form is no robot
        return {"reading"} if form is None else set()
    if form is None:  # as where a body would be left without mass
        return set(OF_MASS)
    ours, theirs = ({name for name, *_ in one.job["joints"]} for one in (audit, form))
    if ours != theirs:
        return {"coordinates"} if ours - theirs == set(answer["missing"]) and not answer["extra"] else set()
    told = rows(first.engine, answer, form.wanted, audit.job["joints"], audit.named)
    return {row.quantity for row in told if row.verdict in (OK, NONE, UNSUPPORTED)}


def _leave_out(root: Node, places: Mapping[Node, Place], lines: Sequence[str]) -> None:
    """Take out of a file the attributes and elements that lines speak of."""
    around = {child: node for node in root.iter() for child in node}
    for line in lines:
        here = {int(number) for number in re.findall(r":(\d+):", line)}
        for key, tag in ATTRIBUTE.findall(line):
            named = [node for node in root.iter(tag) if key in node.attrib]
            for node in [node for node in named if places[node][1] in here] or named:
                node.attrib.pop(key)
        for tag, parent in CHILD.findall(line):
            for node in [node for node in root.iter(tag) if node in around and around[node].tag == parent]:
                removed(root, node)
        for number, tag in PART.findall(line) if not ATTRIBUTE.search(line) and not CHILD.search(line) else ():
            for node in [node for node in root.iter(tag.lower()) if places[node][1] == int(number)]:
                removed(root, node)
