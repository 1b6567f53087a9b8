"""Messages as rows: the numbers in a message become the columns of its topic."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from crossbody.cases import LogFormatError
from crossbody.hw.formats._contract import Block, Column, Group
from crossbody.hw.formats._tables import WIDEST
from crossbody.hw.guard import fault

BLOCK_MESSAGES = 8192
DEEPEST = 12  # levels of nesting
LARGEST = 1 << 20  # bytes of a message that is decoded
MOST_PARTS = 10_000  # messages inside one message: each is an object that takes its time
STAMP = ({"sec", "nanosec"}, {"sec", "nsec"}, {"secs", "nsecs"})
Way = tuple[str | int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Leaf:
    """One number in a message.

    Attributes:
        name: name of the column, `joints.position[2]`.
        path: keys and indices that lead there.
        type: numpy name of its type; a stamp of seconds and nanoseconds is one int64.
        stamp: whether it is such a stamp.
    """

    name: str
    path: Way
    type: str
    stamp: bool = False

    @property
    def column(self) -> Column:
        """The column that it gives."""
        return Column(name=self.name, type=self.type, unit="ns" if self.stamp else "")


def topic_group(topic: str, rows: int, message: Any, clocks: Sequence[str]) -> tuple[Group, dict[str, Leaf]]:
    """The columns of a topic, from its first message, and the leaf of every column but the clocks.

    Clocks are times that the file keeps beside each message, ns, for example ("log_time",).
    """
    leaves = {leaf.name: leaf for leaf in _leaves(message, topic, ())}
    times = tuple(Column(name=f"{topic}.{clock}", type="int64", unit="ns") for clock in clocks)
    return Group(name=topic, rows=rows, columns=(*times, *(leaf.column for leaf in leaves.values()))), leaves


def too_large(data: bytes) -> str:
    """Why a message is not decoded; empty if it is: every byte of it may become an object of hundreds."""
    if len(data) <= LARGEST:
        return ""
    return f"has messages of {len(data)} bytes; pictures and clouds (more than {LARGEST}) are not read"


def crowded(message: Any) -> str:
    """Why no more messages like a decoded one are decoded; empty if they are."""
    left, count = [message], 0
    while left:
        value = left.pop()
        if (members := _members(value)) is not None:
            count += 1
            left.extend(members.values())
        elif (
            isinstance(value, (list, tuple))
            and value
            and (isinstance(value[0], (list, tuple)) or _members(value[0]) is not None)
        ):
            left.extend(value[: MOST_PARTS + 1])
        if count > MOST_PARTS or len(left) > 10 * MOST_PARTS:
            return f"has messages with more than {MOST_PARTS} messages inside; pictures and clouds are not read"
    return ""


def refuse_large(path: Path, topic: str, data: bytes) -> None:
    """Refuse a message that is not decoded among ones that are."""
    if why := too_large(data):
        raise LogFormatError(path, f"{topic!r} {why}.")


def _members(value: Any) -> Mapping[str, Any] | None:
    """The named members of a decoded message of any of the libraries; None if it has none."""
    if isinstance(value, Mapping):
        return value
    names = getattr(value, "__slots__", None) or getattr(value, "__dict__", None)
    if names is None or isinstance(value, (str, bytes, np.ndarray, np.generic, int, float)):
        return None
    return {name: getattr(value, name) for name in names if not str(name).startswith("_")}


def _leaves(value: Any, name: str, path: Way) -> Iterator[Leaf]:
    if len(path) > DEEPEST:
        return
    kind = _number(value)
    members = None if kind else _members(value)
    if kind:
        yield Leaf(name=name, path=path, type=kind)
    elif members is not None and set(members) in STAMP:
        yield Leaf(name=name, path=path, type="int64", stamp=True)
    elif members is not None:
        for key, member in members.items():
            yield from _leaves(member, f"{name}.{key}", (*path, str(key)))
    elif isinstance(value, (list, tuple, np.ndarray)) and len(value) <= WIDEST:
        for i, member in enumerate(value):
            yield from _leaves(member, f"{name}[{i}]", (*path, i))


def _number(value: Any) -> str:
    """Numpy name of a number's type; empty if it is none."""
    if isinstance(value, (bool, np.bool_)):
        return "bool"
    if isinstance(value, np.generic):
        return value.dtype.name if value.dtype.kind in "fiu" else ""
    return "int64" if isinstance(value, int) else "float64" if isinstance(value, float) else ""


def _at(message: Any, leaf: Leaf) -> Any:
    value = message
    for key in leaf.path:
        value = value[key] if isinstance(key, int) or isinstance(value, Mapping) else getattr(value, key)
    if leaf.stamp:
        whole, part = (_members(value) or {}).values()
        return int(whole) * 1_000_000_000 + int(part)
    return value if value is not None else math.nan


def rows_of(
    path: Path, what: str, messages: Iterable[tuple[Mapping[str, int], Callable[[], Any]]], group: Group,
    leaves: Mapping[str, Leaf], columns: Sequence[str],
) -> Iterator[Block]:  # fmt: skip
    """Blocks out of a topic's messages: of each its clocks (column -> ns) and a function that decodes it."""
    types = {column.name: column.type for column in group.columns}
    row = 0
    kept: dict[str, list[Any]] = {name: [] for name in columns}
    fields = [name for name in columns if name in leaves]
    for clocks, decode in messages:
        try:
            message = decode() if fields else None
        except Exception as error:  # see `parsing`, which is too slow to be entered for every message
            raise fault(path, what, error, row) from error
        for name in columns:
            kept[name].append(_value(path, row, message, leaves[name]) if name in leaves else clocks[name])
        row += 1
        if row % BLOCK_MESSAGES == 0:
            yield _arrays(path, kept, types, row)
            kept = {name: [] for name in columns}
    if row % BLOCK_MESSAGES:
        yield _arrays(path, kept, types, row)
    if group.rows is not None and row != group.rows:
        raise LogFormatError(
            path, f"announces {group.rows} messages on {group.name!r} and holds {row}: truncated?", row
        )


def _value(path: Path, row: int, message: Any, leaf: Leaf) -> Any:
    try:
        return _at(message, leaf)
    except (AttributeError, KeyError, IndexError, TypeError, ValueError):
        raise LogFormatError(path, "this number is missing in the message.", row, leaf.name) from None


def _arrays(path: Path, kept: dict[str, list[Any]], types: Mapping[str, str], row: int) -> Block:
    block: Block = {}
    for name, values in kept.items():
        try:
            whole = types[name].startswith(("int", "uint")) and all(isinstance(v, (int, np.integer)) for v in values)
            block[name] = np.array(values, dtype=types[name] if whole else np.float64)
        except (TypeError, ValueError, OverflowError):
            first = next(i for i, v in enumerate(values) if not _number(v))
            raise LogFormatError(path, "the message has no number here.", row - len(values) + first, name) from None
    return block
