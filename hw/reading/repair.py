"""Repairs of a log's rows: only those that were asked for, and each is told."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import InvalidValue, UnknownName
from crossbody.hw.checks.clock import GAP
from crossbody.hw.checks.smooth import unwrapped
from crossbody.hw.reading.columns import Role
from crossbody.hw.reading.log import Repair
from crossbody.hw.reading.stream import Rows

REPAIRS = ("drop_duplicates", "fill_dropped", "unwrap")
MOST = 10  # samples that are filled for each that is there
LONGEST = 1000  # samples that are filled in one place: more is no dropout but a pause


def check_names(asked: Collection[str]) -> None:
    """Refuse a repair that does not exist."""
    for name in asked:
        if not isinstance(name, str) or name not in REPAIRS:
            raise UnknownName("repair", name, REPAIRS)


def drop_duplicates(block: Rows) -> tuple[Rows, tuple[Repair, ...]]:
    """Keep the first of rows with the same time."""
    again = np.diff(block.time, prepend=np.nan) == 0.0
    if not (count := int(np.count_nonzero(again))):
        return block, ()
    i = int(np.argmax(again))
    told = Repair(name="drop_duplicates", rows=count, row=int(block.rows[i]), t=float(block.time[i]))
    return block.take(~again), (told,)


def unwrap(block: Rows, angles: Collection[int]) -> tuple[Rows, tuple[Repair, ...]]:
    """Take whole turns off angles (indices of coordinates in rad) of a whole log from where they wrap on."""
    values, told = list(block.values), list[NDArray[np.int64]]()
    for i in angles:
        values[i], wraps = unwrapped(block.time, block.values[i])
        told.append(wraps)
    wraps = np.unique(np.concatenate(told)) if told else np.zeros(0, np.int64)
    if not len(wraps):
        return block, ()
    first = int(wraps[0])
    repair = Repair(name="unwrap", rows=len(wraps), row=int(block.rows[first]), t=float(block.time[first]))
    return Rows(rows=block.rows, time=block.time, values=tuple(values)), (repair,)


def fill_dropped(
    block: Rows, roles: Collection[Role], step: float
) -> tuple[Rows, tuple[Repair, ...], NDArray[np.int64]]:
    """Put rows where samples are missing, evenly between their neighbours.

    What is measured is interpolated linearly there, what is commanded holds. Longer gaps than
    1000 samples stay.

    Args:
        block: the whole log; time strictly increasing.
        roles: of every signal of the block.
        step: sample time, s.

    Returns:
        The rows, what was done, and the indices of the rows that were made up.
    """
    steps = np.diff(block.time)
    missing = np.where(steps > GAP * step, np.rint(steps / step) - 1, 0).astype(np.int64)
    missing[missing > LONGEST] = 0
    if not missing.any():
        return block, (), np.zeros(0, np.int64)
    if missing.sum() > MOST * len(steps):
        text = f"lacks {missing.sum()} samples and has {len(steps) + 1}: these are not dropouts, but another rate."
        raise InvalidValue(f"fill_dropped: the log {text}")
    before = np.repeat(np.arange(len(steps)), missing)  # the row before each new one
    inside = np.arange(len(before)) - np.repeat(np.cumsum(missing) - missing, missing) + 1
    share = inside / (missing[before] + 1.0)
    place = before + 1
    time = np.insert(block.time, place, block.time[before] + share * steps[before])
    values = tuple(
        np.insert(v, place, v[before] + share * (v[before + 1] - v[before]) if role.measured else v[before])
        for v, role in zip(block.values, roles, strict=True)
    )
    i = int(np.argmax(missing > 0))
    told = Repair(name="fill_dropped", rows=len(before), row=int(block.rows[i + 1]), t=float(block.time[i + 1]))
    rows = np.insert(block.rows, place, block.rows[before])
    made = place + np.arange(len(place))
    return Rows(rows=rows, time=time, values=values), (told,), made
