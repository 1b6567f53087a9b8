"""What ROS 1 and ROS 2 bags share: topics as groups, by rosbags."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from crossbody.hw.budget import current
from crossbody.hw.formats._contract import Block, Group
from crossbody.hw.formats._definitions import fault_of
from crossbody.hw.formats._messages import Leaf, crowded, refuse_large, rows_of, too_large, topic_group
from crossbody.hw.formats._unfold import Chunks
from crossbody.hw.guard import library, parsing, words

CLOCKS = ("log_time",)


class RosbagReader:
    """Numbers in the messages of every topic whose type is known.

    A ROS 1 bag and most ROS 2 bags carry the definitions of their messages; where one does not, those of ROS 2
    Humble are taken, and a topic of an unknown type is refused.

    Args:
        path: the bag.
        what: name of the format, for messages.
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
        try:
            with parsing(path, what):
                self._bound_chunks()
                self.groups = tuple(self._topics())
        except BaseException:
            self.close()
            raise

    def _bound_chunks(self) -> None:
        """Let the chunks of a ROS 1 bag be unfolded by us: rosbags does so again wherever two overlap in time."""
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
            why = crowded(message)
            if why:
                self.refused[topic] = why
                continue
            group, self._leaves[topic] = topic_group(topic, about.msgcount, message, CLOCKS)
            yield group

    def _of(self, topic: str) -> list[Any]:
        return [connection for connection in self._bag.connections if connection.topic == topic]

    def blocks(self, group: Group, columns: Sequence[str]) -> Iterator[Block]:
        """See `Reader`."""
        found = rows_of(self._path, self._what, self._rows(group.name), group, self._leaves[group.name], columns)
        while True:
            with parsing(self._path, self._what):
                block = next(found, None)
            if block is None:
                return
            yield block

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
