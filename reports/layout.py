"""Tables of the command line: they fit the terminal by leaving columns out, never digits, and no line is wrapped."""

from __future__ import annotations

import math
import shutil
import sys
import textwrap
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    import pandas as pd

WIDTH, SENTENCE = 120, 80  # of a table and of sentences in a file or a pipe
NO_BREAK = "\u00a0"
NOTHING = {"-", ""}
"""Cells that say nothing."""
UNITS = {"ms": "[ms]", "s": "[s]"}
"""Ends of the names of columns, and how a head says them."""


def columns() -> int:
    """Return how many columns there are for a table."""
    return shutil.get_terminal_size((WIDTH, 24)).columns


def told(text: str, indent: int = 4) -> str:
    """Return a sentence in lines that fit the terminal, else 80 columns, indented from the second; no word is cut.

    What `NO_BREAK` joins stays in one line.
    """
    width = columns() if sys.stdout.isatty() else SENTENCE
    lines = textwrap.fill(text, width, subsequent_indent=" " * indent, break_on_hyphens=False, break_long_words=False)
    return lines.replace(NO_BREAK, " ")


def unit_text(unit: str, form: str = " {}") -> str:
    """How a unit stands beside its number; nothing for ratios and counts."""
    return "" if unit in ("", "1") else form.format(unit)


def valid(best: float, most: float) -> str:
    """Return what a limit on the distance from the best number admits, in words; nothing without a limit."""
    if most != most:
        return ""
    return f"at least {best - most:.6g}" if best else f"at most {most:.4g}"


def laid_out(
    names: Sequence[str], cells: Mapping[str, Sequence[str]], width: int, *, head: str = "",
    above: Sequence[str] = (), left_out: Sequence[str] = (), colours: Mapping[str, str] | None = None,
) -> str:  # fmt: skip
    """Lay out a table.

    Args:
        names: of the lines, which stay; cut where they take more than half the width and columns need the room.
        cells: columns by their heads, of one line or two. Those that say nothing are left out.
        width: columns that no line exceeds.
        head: of the names.
        above: what stands above lines of the same, once; nothing where it is empty.
        left_out: columns that go first, in this order, where it is too wide; then go the last ones.
        colours: of columns, where a cell is not "0".
    """
    cells = {one: column for one, column in cells.items() if set(column) - NOTHING}
    indent = "  " if above else ""
    lines = [indent + one for one in (head, *names)]
    whole = max(map(len, lines))
    first = whole if whole + _beside(cells) <= width else min(whole, width // 2)
    for one in [*left_out, *reversed([one for one in cells if one not in left_out])]:
        if first + _beside(cells) > width and len(cells) > 1:
            cells.pop(one, None)
    first = min(whole, max(width - _beside(cells), len(indent) + 1))
    lines = [_cut(line, first).ljust(first) for line in lines]
    below = " " * first  # second lines of heads
    for one, column in cells.items():
        texts = _aligned(one, column)
        colour = (colours or {}).get(one)
        lines[0] += f"  {texts[0]}"
        below += f"  {texts[1]}"
        for i, text in enumerate(texts[2:]):
            lines[i + 1] += "  " + (click.style(text, fg=colour) if colour and column[i] != "0" else text)
    for i in reversed(range(len(above))):
        if i == 0 or above[i] != above[i - 1]:
            lines.insert(i + 1, click.style(_cut(above[i], width), bold=True))
    if below.strip():
        lines.insert(1, below)
    return "\n".join(line.rstrip() for line in lines)


def split(names: Sequence[str], cells: Mapping[str, Sequence[str]], width: int, **more: Any) -> str:
    """Lay out a table whose columns are all needed: those that do not fit stand in another one below it."""
    left, parts = dict(cells), list[str]()
    room = width - max(map(len, names), default=0)
    while left:
        ends = list(accumulate(2 + _wide(one, column) for one, column in left.items()))
        mine = list(left)[: max(bisect_right(ends, room), 1)]
        parts.append(laid_out(names, {one: left.pop(one) for one in mine}, width, **more))
    return "\n\n".join(parts)


def frame(
    rows: pd.DataFrame, width: int, *, digits: int = 4, heads: Mapping[str, str] | None = None, names: str = "",
    above: str = "", left_out: Sequence[str] = (),
) -> str:  # fmt: skip
    """Lay out a table of pandas, with the columns `engine` and `profile` as one.

    Args:
        rows: the table.
        width: columns that no line exceeds.
        digits: of numbers.
        heads: of columns whose names do not say it.
        names: the column of the lines' names; engines if there are some, else the first.
        above: the column that stands above lines of the same; none if not given.
        left_out: columns that go first.
    """
    texts = {str(one): [_text(value, digits) for value in rows[one]] for one in rows.columns}
    if "unit" in texts:
        texts["unit"] = [unit_text(unit, "{}") for unit in texts["unit"]]
    if {"engine", "profile"} <= set(texts):
        who = zip(texts["engine"], texts.pop("profile"), strict=True)
        texts["engine"] = [":".join(one) for one in who]
    names = names or next((one for one in texts if one == "engine"), next(one for one in texts if one != above))
    groups, lines = texts.pop(above) if above else [], texts.pop(names)
    said = {one: (heads or {}).get(one) or _head(one) for one in (names, *texts)}
    return laid_out(
        lines, {said[one]: column for one, column in texts.items()}, width, head=said[names], above=groups,
        left_out=[said[one] for one in left_out if one in texts],
    )  # fmt: skip


def _head(name: str) -> str:
    """A name of a column with spaces, and its unit in brackets."""
    words = name.split("_")
    return " ".join([*words[:-1], UNITS.get(words[-1], words[-1])] if len(words) > 1 else words)


def _text(value: Any, digits: int) -> str:
    if isinstance(value, float):
        return "-" if math.isnan(value) else f"{value:.{digits}g}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "-" if value is None else str(value)


def _cut(text: str, room: int) -> str:
    return text if len(text) <= room else text[: max(room - 1, 0)] + "…"


def _wide(head: str, column: Sequence[str]) -> int:
    return max(map(len, (*head.split("\n"), *column)))


def _beside(cells: Mapping[str, Sequence[str]]) -> int:
    return sum(2 + _wide(head, column) for head, column in cells.items())


def _aligned(head: str, column: Sequence[str]) -> list[str]:
    """Both lines of a head and the cells of a column in one width: words at the left, numbers at the right."""
    words = any(cell[:1].isalpha() and cell not in ("nan", "inf") for cell in column)
    wide = _wide(head, column)
    return [text.ljust(wide) if words else text.rjust(wide) for text in (*_two_lines(head), *column)]


def _two_lines(head: str) -> tuple[str, str]:
    first, _, second = head.partition("\n")
    return first, second


def bounded(value: float | None, known: float | None) -> tuple[str, float]:
    """Return a sign and what a number is known to where it is below that, else nothing and the number."""
    number, limit = (math.nan if x is None else x for x in (value, known))
    return ("< ", limit) if abs(number) < limit else ("", number)
