"""What the mass matrix couples, and the columns that each constraint row may touch."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import SceneError
from crossbody.cases.arrays import frozen
from crossbody.reference.kinds import Index


def given_spans(given: Any, n: int, nc: int) -> Index:
    """Columns [first, last) that each row may touch (nc, 2); all n where none are given.

    Raises:
        SceneError: if a span is empty or beyond the columns.
    """
    whole = [[0, n]] * nc if given is None else given
    spans: Index = frozen("System", "span", whole if nc else np.zeros((0, 2)), (nc, 2), np.int64)
    if np.any(spans[:, 0] < 0) or np.any(spans[:, 1] > n) or np.any(spans[:, 0] >= spans[:, 1]):
        raise SceneError(f"System.span is {spans.tolist()}; each row needs 0 <= first < last <= {n}.")
    return spans


def whole_blocks(spans: Index, k: int) -> Index:
    """Widen spans (nc, 2) to whole blocks of the mass matrix, k columns each."""
    blocks = np.column_stack([spans[:, 0] // k * k, -(-spans[:, 1] // k) * k])
    wide: Index = frozen("System", "span", blocks, spans.shape, np.int64)
    return wide


def whole_trees(spans: Index, above: Index) -> Index:
    """Widen spans (nc, 2) to whole trees of what M couples, by the parent (n,) of every coordinate."""
    n = len(above)
    first, last = np.arange(n), np.arange(1, n + 1)  # of the tree of every coordinate
    for i, parent in enumerate(above.tolist()):
        if parent >= 0:
            first[i] = first[parent]
    np.maximum.at(last, first, np.arange(1, n + 1))
    wide = [(first[a:b].min(), last[first[a:b]].max()) for a, b in spans]
    trees: Index = frozen("System", "trees", np.reshape(wide, spans.shape), spans.shape, np.int64)
    return trees


def parents(given: Any, n: int, k: int) -> Index:
    """Coordinates (n,) that M couples each one to, the nearest lower one; those before it in its block if not given.

    Raises:
        SceneError: if one is not lower, or of another block.
    """
    own = np.arange(n)
    chain = np.where(own % k == 0, -1, own - 1)
    above: Index = frozen("System", "above", chain if given is None else given, (n,), np.int64)
    wrong = (above >= own) | ((above < own // k * k) & (above != -1))
    if np.any(wrong):
        i = int(np.flatnonzero(wrong)[0])
        raise SceneError(
            f"System.above[{i}] is {above[i]}; valid: -1, or a lower coordinate of its block, {i // k * k} to {i - 1}."
        )
    return above


def coupled(above: Index, k: int) -> NDArray[np.bool_]:
    """Whether M, as it is stored (n, k), may have an entry: one coordinate is above the other, or the same."""
    n = len(above)
    below = np.eye(k, dtype=bool)[np.arange(n) % k]
    for i, c in enumerate(above):
        if c >= 0:
            below[i] |= below[c]
    blocks = below.reshape(-1, k, k)
    return (blocks | blocks.swapaxes(1, 2)).reshape(n, k)
