"""ROS 2 bags (a folder with metadata.yaml, or its SQLite file), by rosbags: looked at before it follows them."""

from __future__ import annotations

import re
import sqlite3
from pathlib import Path

from crossbody.cases import LogFormatError
from crossbody.hw.budget import Budget, current
from crossbody.hw.formats._tables import NoOptions as Options
from crossbody.hw.formats.mcap import records
from crossbody.hw.formats.ros1 import RosbagReader
from crossbody.hw.guard import fault, parsing

SUFFIXES = (".db3",)
LARGEST_YAML = 1 << 19  # bytes of metadata.yaml, which is read at some 400 kB/s: a topic takes 300
DEEPEST_YAML = 32  # levels
MOST_TOPICS = 2000  # of a bag: each is looked for among all definitions, and gone through of its own
MESSAGES = re.compile(rb"^\s*compression_mode:\s*['\"]?message", re.MULTILINE | re.IGNORECASE)
PIECE = 1 << 20  # bytes that are unfolded at a time
FEW = ("topics", "message_definitions")  # tables of a bag that are read whole
KINDS = ("table", "index")  # of the entries of a database that hold what they show


def recognises(path: Path, head: bytes) -> bool:
    """Whether it is a bag's folder or SQLite file."""
    return (path / "metadata.yaml").is_file() if not head else head.startswith(b"SQLite format 3\x00")


def open_log(path: Path, options: Options) -> RosbagReader:
    """Open a ROS 2 bag; columns are named `/topic.field.element[0]`."""
    check_bag(path)
    return RosbagReader(path, "ROS 2 bag")


def check_bag(path: Path) -> None:
    """Refuse a bag whose files would unfold to more than its budget, or whose tables compute what they show."""
    budget = current(path)
    files = sorted(one for one in path.iterdir() if one.is_file()) if path.is_dir() else [path]
    for file in files:
        if file.name == "metadata.yaml":
            _check_metadata(path, file)
        elif file.suffix == ".db3":
            _check_database(path, file)
        elif file.suffix == ".mcap":
            with file.open("rb") as stream:
                for _ in records(stream, path, budget):
                    pass
        elif file.suffix == ".zstd":
            _check_unfolded(file, budget)


def _check_metadata(path: Path, file: Path) -> None:
    """Refuse what no recorder writes by the events of the YAML, before anything is made of them."""
    if file.stat().st_size > LARGEST_YAML:
        raise LogFormatError(path, f"has a metadata.yaml of more than {LARGEST_YAML} bytes.")
    text = file.read_bytes()
    with parsing(path, "ROS 2 bag"):
        _check_events(path, text)
    if MESSAGES.search(text):
        text_ = "is compressed message by message, which is not read: `ros2 bag convert` unpacks it."
        raise LogFormatError(path, text_)


def _check_events(path: Path, text: bytes) -> None:
    """Refuse anchors and aliases, which unfold, and levels without an end, however keys are written."""
    from ruamel.yaml import YAML
    from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent

    depth = 0
    for event in YAML(typ="safe", pure=True).parse(text.decode()):
        if isinstance(event, AliasEvent) or getattr(event, "anchor", None):
            raise LogFormatError(path, "has a metadata.yaml with anchors, which no recorder writes.")
        depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
        if depth > DEEPEST_YAML:
            raise LogFormatError(path, f"has a metadata.yaml of more than {DEEPEST_YAML} levels.")


def _check_database(path: Path, file: Path) -> None:
    """Refuse views, virtual tables and generated columns: a query of a few bytes may show any number of rows."""
    try:
        link = sqlite3.connect(f"{file.absolute().as_uri()}?immutable=1", uri=True)
    except sqlite3.Error as error:
        raise fault(path, "ROS 2 bag", error) from error
    try:
        for kind, name, text in link.execute("SELECT type, name, sql FROM sqlite_master").fetchall():
            shown = str(name)[:40]
            if kind not in KINDS or "VIRTUAL" in str(text).upper().split("(")[0]:
                raise LogFormatError(path, f"has a {kind} {shown!r} whose content is computed.")
            if kind == "table" and any(row[6] for row in link.execute("SELECT * FROM pragma_table_xinfo(?)", (name,))):
                raise LogFormatError(path, f"has a table {shown!r} with columns that are computed.")
            if kind == "table" and name in FEW:
                query = f"SELECT count(*) FROM (SELECT 1 FROM {name} LIMIT {MOST_TOPICS + 1})"
                if link.execute(query).fetchone()[0] > MOST_TOPICS:
                    raise LogFormatError(path, f"has more than {MOST_TOPICS} {name.replace('_', ' ')}.")
    except sqlite3.Error as error:
        raise fault(path, "ROS 2 bag", error) from error
    finally:
        link.close()


def _check_unfolded(file: Path, budget: Budget) -> None:
    """Unfold a compressed file once to see how large it is: the library writes it to the disk whole."""
    import zstandard

    with file.open("rb") as raw, zstandard.ZstdDecompressor().stream_reader(raw) as stream:
        while piece := stream.read(PIECE):
            budget.spend(len(piece))
