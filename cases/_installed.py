"""Cases that other distributions bring: modules named by entry points of the group `crossbody.cases`.

Its pyproject.toml says `gripper = "my_package.gripper"` under `[project.entry-points."crossbody.cases"]`.
"""

from __future__ import annotations

import importlib
from types import ModuleType

GROUP = "crossbody.cases"


def installed() -> dict[str, str]:
    """Name of a case -> its module, sorted; nothing is imported."""
    from importlib.metadata import entry_points  # reads what is installed: only where a name is not one of ours

    return {point.name: point.module for point in sorted(entry_points(group=GROUP), key=lambda x: x.name)}


def load(name: str) -> ModuleType | None:
    """The module of an installed case; None if there is none of that name."""
    found = installed().get(name)
    return None if found is None else importlib.import_module(found)
