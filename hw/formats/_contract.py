"""What every log format offers. Structural: a reader inherits from nothing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from numpy.typing import NDArray

from crossbody.cases.arguments import whole
from crossbody.cases.public_names import TEXT, Public, function, maps_to_texts

Block = dict[str, NDArray[Any]]
BLOCK_ROWS = 65536  # rows of one block: half a megabyte a column


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One column of numbers.

    Attributes:
        name: name, unique in the file; an element of a vector ends in its index from 0, `force[2]`.
        type: numpy name of the stored type; "text" where a reader will find out whether the cells
            are numbers.
        unit: unit as the file tells it; empty if it does not.
    """

    name: str
    type: str = "float64"
    unit: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Columns whose rows belong together, sample by sample.

    Attributes:
        name: name in the file; empty where a file has one group only.
        rows: number of rows; None where only reading tells.
        columns: in the order of the file.
        step: time between samples where the file holds that instead of a column of times, s; 0 if
            it does not.
        start: time of the first sample then, s.
    """

    name: str
    rows: int | None
    columns: tuple[Column, ...]
    step: float = 0.0
    start: float = 0.0

    def __post_init__(self) -> None:
        """Check the number of rows, which memory is asked for."""
        if self.rows is not None:
            whole("Group.rows", self.rows, low=0)


class Reader(Protocol):
    """An open log.

    Attributes:
        groups: what can be read.
        refused: columns that cannot be read as numbers -> why, in one sentence.
        library: package that reads it, with its version.
    """

    groups: tuple[Group, ...]
    refused: Mapping[str, str]
    library: str

    def blocks(self, group: Group, columns: Sequence[str]) -> Iterator[Block]:
        """The rows of some columns of one group, in order, a bounded number at a time, in the stored types.

        A cell without a value is NaN.

        Raises:
            LogFormatError: with row and column where what is stored is no number or cannot be decoded.
        """
        ...

    def close(self) -> None:
        """Release the file; afterwards nothing can be read."""
        ...


def _groups(value: Any) -> bool:
    return isinstance(value, (tuple, list)) and all(isinstance(one, Group) for one in value)


READER = {
    "groups": Public("a tuple of Group", _groups),
    "refused": Public("a mapping from columns to reasons", maps_to_texts),
    "library": TEXT,
    "blocks": function("group", "columns"),
    "close": function(),
}
"""Names of a `Reader`, and what is valid for each."""
