"""ROS 2 bags (a folder with metadata.yaml, or its SQLite file), by rosbags."""

from __future__ import annotations

from pathlib import Path

import msgspec

from crossbody.hw.formats._bag_folder import check_bag
from crossbody.hw.formats._rosbag import RosbagReader

SUFFIXES = (".db3",)


class Options(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Nothing to choose."""


def recognises(path: Path, head: bytes) -> bool:
    """Whether it is a bag's folder or SQLite file."""
    return (path / "metadata.yaml").is_file() if not head else head.startswith(b"SQLite format 3\x00")


def open_log(path: Path, options: Options) -> RosbagReader:
    """Open a ROS 2 bag; columns are named `/topic.field.element[0]`."""
    check_bag(path)
    return RosbagReader(path, "ROS 2 bag")
