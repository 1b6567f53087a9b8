"""Names of columns: the unit that a header holds, the elements of a vector."""

from __future__ import annotations

import re
from collections.abc import Sequence

HEADER_UNIT = re.compile(r"[\[(]\s*([^\[\]()]*[^\[\]()\d\s][^\[\]()]*?)\s*[\])]\s*$")
WIDEST = 64  # elements of a vector that are columns; wider ones are pictures or clouds


def header_unit(name: str) -> str:
    """The unit in a header like `angle [deg]` or `force (N)`; empty if there is none."""
    found = HEADER_UNIT.search(name)
    return found.group(1) if found else ""


def elements(name: str, width: int) -> Sequence[str]:
    """Names of the elements of a vector of that width: `name[0]`, `name[1]`, ..."""
    return [f"{name}[{i}]" for i in range(width)]
