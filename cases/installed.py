"""Plug-ins that other distributions bring: modules named by entry points, in a group called like our package.

The pyproject.toml of one says, for example,

    [project.entry-points."crossbody.cases"]
    gripper = "my_package.gripper"

and likewise for "crossbody.engines", "crossbody.reports.metrics", "crossbody.hw.formats" and every other folder of
plug-ins.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache


@cache
def modules(group: str) -> Mapping[str, str]:
    """Name of a plug-in -> its module; nothing is imported."""
    from importlib.metadata import entry_points  # reads what is installed: once a process and group

    return {point.name: point.module for point in entry_points(group=group)}
