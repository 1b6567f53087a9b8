"""MCAP with ROS 2 (CDR) or JSON messages, by mcap and mcap-ros2-support."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from crossbody.hw.formats._contract import Block, Group
from crossbody.hw.formats._guard import library, parsing
from crossbody.hw.formats._messages import Leaf, rows_of, topic_group

SUFFIXES = (".mcap",)
MAGIC = b"\x89MCAP0\r\n"
WHAT = "MCAP file"
CLOCKS = ("log_time", "publish_time")


class Options(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Nothing to choose."""


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as MCAP does."""
    return head.startswith(MAGIC)


def open_log(path: Path, options: Options) -> McapReader:
    """Open an MCAP file; columns are named `/topic.field.element[0]`."""
    return McapReader(path)


class McapReader:
    """Numbers in the messages of every topic, chunk by chunk, with their checksums checked."""

    def __init__(self, path: Path) -> None:
        from mcap_ros2.decoder import DecoderFactory

        self._path = path
        self._ros2 = DecoderFactory()
        self.library = library("mcap")
        self.refused: dict[str, str] = {}
        self._leaves: dict[str, Mapping[str, Leaf]] = {}
        self._file = path.open("rb")
        try:
            with parsing(path, "MCAP file (cut off? `mcap recover` saves what is whole)"):
                self.groups = tuple(self._topics())
        except BaseException:
            self._file.close()
            raise

    def _topics(self) -> Iterator[Group]:
        for topic, count in sorted(self._counts().items()):
            schema, channel, message = next(self._messages(topic))
            decode = self._decoder(schema, channel)
            if decode is None:
                kind = channel.message_encoding or "nothing"
                self.refused[topic] = f"is encoded as {kind}; what can be read is cdr (ROS 2) and json"
                continue
            group, leaves = topic_group(topic, count, decode(message.data), CLOCKS)
            self._leaves[topic] = leaves
            yield group

    def _counts(self) -> dict[str, int]:
        """Messages of every topic: from the summary, or by going through the file where it has none."""
        counts: dict[str, int] = {}
        summary = self._open().get_summary()
        if summary is not None and summary.statistics is not None and summary.channels:
            for key, count in summary.statistics.channel_message_counts.items():
                topic = summary.channels[key].topic
                counts[topic] = counts.get(topic, 0) + count
        else:
            for _, channel, _ in self._open().iter_messages():
                counts[channel.topic] = counts.get(channel.topic, 0) + 1
        return {topic: count for topic, count in counts.items() if count}

    def _open(self) -> Any:
        from mcap.reader import make_reader

        self._file.seek(0)
        return make_reader(self._file, validate_crcs=True)

    def _messages(self, topic: str) -> Iterator[tuple[Any, Any, Any]]:
        found: Iterator[tuple[Any, Any, Any]] = self._open().iter_messages(topics=[topic], log_time_order=False)
        return found

    def _decoder(self, schema: Any, channel: Any) -> Callable[[bytes], Any] | None:
        if channel.message_encoding == "json":
            return msgspec.json.decode
        found: Callable[[bytes], Any] | None = self._ros2.decoder_for(channel.message_encoding, schema)
        return found

    def blocks(self, group: Group, columns: Sequence[str]) -> Iterator[Block]:
        """See `Reader`."""
        found = rows_of(self._path, WHAT, self._rows(group.name), group, self._leaves[group.name], columns)
        while True:
            with parsing(self._path, WHAT):
                block = next(found, None)
            if block is None:
                return
            yield block

    def _rows(self, topic: str) -> Iterator[tuple[Mapping[str, int], Callable[[], Any]]]:
        for schema, channel, message in self._messages(topic):
            decode = self._decoder(schema, channel) or msgspec.json.decode
            clocks = {f"{topic}.log_time": message.log_time, f"{topic}.publish_time": message.publish_time}
            yield clocks, lambda decode=decode, data=message.data: decode(data)  # type: ignore[misc]

    def close(self) -> None:
        """See `Reader`."""
        self._file.close()
