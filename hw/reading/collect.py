"""All rows of a log in memory, within a limit."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import LogFormatError
from crossbody.hw.formats import Group
from crossbody.hw.reading.plan import Plan
from crossbody.hw.reading.rows import Rows

FIRST = 65536  # rows, where nobody tells how many there will be


def collect(blocks: Iterable[Rows], plan: Plan, group: Group, limit: int) -> Rows:
    """Join blocks, filling arrays in place: little more than the result is ever in memory.

    Args:
        blocks: the rows of one group.
        plan: whose rows they are.
        group: the group.
        limit: largest size, bytes.

    Raises:
        LogFormatError: if there are no rows, or more than the limit admits; the announced number is refused at once.
    """
    announced = 0 if plan.columns.part else group.rows or 0
    held: tuple[NDArray[Any], ...] = ()
    size = 0
    for block in blocks:
        parts = (block.rows, block.time, *block.values)
        width = sum(part.itemsize for part in parts)
        need = max(announced, size + len(block.time))
        if need * width > limit:
            text = f"needs {need * width / 1e9:.3g} GB in memory, above the limit of {limit / 1e9:.3g} GB; `scan` it."
            raise LogFormatError(plan.path, text)
        if not held or need > len(held[0]):
            room = max(need, limit // width - size)  # while rows are moved, the old arrays are there too
            held = _grown(held, parts, size, max(need, min(room, max(2 * size, 0 if announced else FIRST))))
        for whole, part in zip(held, parts, strict=True):
            whole[size : size + len(part)] = part
        size += len(block.time)
    if not size:
        raise LogFormatError(plan.path, "holds no samples.")
    rows, time, *values = (whole[:size] for whole in held)
    return Rows(rows=rows, time=time, values=tuple(values))


def _grown(
    held: tuple[NDArray[Any], ...], parts: tuple[NDArray[Any], ...], size: int, rows: int
) -> tuple[NDArray[Any], ...]:
    grown = tuple(np.empty(rows, part.dtype) for part in parts)
    for new, old in zip(grown, held, strict=False):
        new[:size] = old[:size]
    return grown
