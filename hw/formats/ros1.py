"""ROS 1 bags, by rosbags."""

from __future__ import annotations

from pathlib import Path

import msgspec

from crossbody.hw.formats._rosbag import RosbagReader

SUFFIXES = (".bag",)


class Options(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Nothing to choose."""


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as a ROS 1 bag does."""
    return head.startswith(b"#ROSBAG V")


def open_log(path: Path, options: Options) -> RosbagReader:
    """Open a ROS 1 bag; columns are named `/topic.field.element[0]`."""
    return RosbagReader(path, "ROS 1 bag")
