"""ROS 1 bags, and what they share with those of ROS 2: topics as groups, by rosbags."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from crossbody.hw.budget import current
from crossbody.hw.formats._bounded import Chunks
from crossbody.hw.formats._contract import Block, Group
from crossbody.hw.formats._messages import Leaf, crowded, refuse_large, rows_of, too_large, topic_group
from crossbody.hw.formats._tables import NoOptions as Options
from crossbody.hw.guard import closing, library, parsed, parsing, words

SUFFIXES = (".bag",)
CLOCKS = ("log_time",)
MOST = 100_000  # values that a message of a type holds whatever its bytes say
DEEPEST = 32  # types inside one another
FILLER = "structure_needs_at_least_one_member"  # what stands for nothing in ROS 2, and is not there in ROS 1


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as a ROS 1 bag does."""
    return head.startswith(b"#ROSBAG V")


def open_log(path: Path, options: Options) -> RosbagReader:
    """Open a ROS 1 bag; columns are named `/topic.field.element[0]`."""
    return RosbagReader(path, "ROS 1 bag")


class RosbagReader:
    """Numbers in the messages of every topic whose type is known.

    A ROS 1 bag and most ROS 2 bags carry the definitions of their messages; where one does not,
    those of ROS 2 Humble are taken, and a topic of an unknown type is refused.
    """

    def __init__(self, path: Path, what: str) -> None:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        self._path, self._what = path, what
        self._budget = current(path)
        self.library = library("rosbags")
        self.refused: dict[str, str] = {}
        self._leaves: dict[str, Mapping[str, Leaf]] = {}
        with parsing(path, what):
            self._bag = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
            self._bag.open()
        with closing(self._bag), parsing(path, what):
            self._bound_chunks()
            self.groups = tuple(self._topics())

    def _bound_chunks(self) -> None:
        """Let the chunks of a ROS 1 bag be unfolded by us: rosbags does so anew wherever two overlap."""
        from rosbags.rosbag1.reader import decompressors

        names = {function: name for name, function in decompressors.items()}
        chunks = Chunks(self._path, self._budget)
        for reader in self._bag.readers:
            for at, chunk in getattr(reader, "chunks", {}).items():
                name = names[chunk.decompressor]

                def unfold(raw: bytes, at: int = at, name: str = name) -> bytes:
                    return chunks.unfold(at, name, raw)

                reader.chunks[at] = chunk._replace(decompressor=unfold)

    def _topics(self) -> Iterator[Group]:
        for topic, about in sorted(self._bag.topics.items()):
            if not about.msgcount:
                continue
            connection, _, data = next(self._bag.messages(self._of(topic)))
            why = too_large(data) or fault_of(self._bag.typestore.fielddefs, connection.msgtype)
            if why:
                self.refused[topic] = why
                continue
            try:
                message = self._bag.deserialize(data, connection.msgtype)
            except KeyError as error:
                self.refused[topic] = f"has messages of a type that the bag does not define ({words(error)})"
                continue
            if why := crowded(message):
                self.refused[topic] = why
                continue
            group, self._leaves[topic] = topic_group(topic, about.msgcount, message, CLOCKS)
            yield group

    def _of(self, topic: str) -> list[Any]:
        return [connection for connection in self._bag.connections if connection.topic == topic]

    def blocks(self, group: Group, columns: Sequence[str]) -> Iterator[Block]:
        """See `Reader`."""
        found = rows_of(self._path, self._what, self._rows(group.name), group, self._leaves[group.name], columns)
        return parsed(self._path, self._what, found)

    def _rows(self, topic: str) -> Iterator[tuple[Mapping[str, int], Callable[[], Any]]]:
        connections = self._of(topic)
        faults = {one.msgtype: fault_of(self._bag.typestore.fielddefs, one.msgtype) for one in connections}
        for connection, time, data in self._bag.messages(connections):
            kind = connection.msgtype
            self._budget.spend(len(data))
            refuse_large(self._path, topic, data)
            if faults[kind]:
                raise ValueError(faults[kind])
            yield (
                {f"{topic}.log_time": time},
                lambda data=data, kind=kind: self._bag.deserialize(data, kind),  # type: ignore[misc]
            )

    def close(self) -> None:
        """See `Reader`."""
        self._bag.close()


def fault_of(types: Mapping[str, Any], name: str) -> str:
    """What is wrong with a message type; empty if nothing is, or if it is not known.

    Types inside types multiply: ten levels of ten make 1e10 values out of a kilobyte of
    definitions, and a list of empty messages takes no bytes however long it is.

    Args:
        types: fields of every known type, as rosbags lists them.
        name: the type.
    """
    try:
        _least(types, name, 0, {})
    except ValueError as error:
        return str(error)
    return ""


def _least(types: Mapping[str, Any], name: str, depth: int, known: dict[str, int]) -> int:
    """Number of values that a message of a type holds at least; lists without a fixed length have none."""
    if name in known or name not in types:
        return known.get(name, 1)
    if depth > DEEPEST:
        raise ValueError(f"has messages of a type that is nested deeper than {DEEPEST} levels")
    count = sum(_values(types, field, depth, known) for _, field in types[name][1])
    if count > MOST:
        raise ValueError(f"has messages of a type of more than {MOST} values")
    known[name] = count
    return count


def _values(types: Mapping[str, Any], field: Any, depth: int, known: dict[str, int]) -> int:
    from rosbags.interfaces import Nodetype

    kind, about = field
    if kind == Nodetype.BASE:
        return 1
    if kind == Nodetype.NAME:
        return _least(types, about, depth + 1, known)
    one = _values(types, about[0], depth, known)
    if about[0][0] == Nodetype.NAME and _empty(types, about[0][1]):
        raise ValueError("has messages with lists of empty messages")
    return one * about[1] if kind == Nodetype.ARRAY else 0


def _empty(types: Mapping[str, Any], name: Any) -> bool:
    """Whether a message of a type takes no bytes."""
    from rosbags.interfaces import Nodetype

    fields = types[name][1] if name in types else [("", (Nodetype.BASE, None))]
    return all(field == FILLER or (kind == Nodetype.NAME and _empty(types, about)) for field, (kind, about) in fields)
