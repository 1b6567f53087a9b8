"""MCAP with ROS 2 (CDR) or JSON messages, by mcap and mcap-ros2-support."""

from __future__ import annotations

import itertools
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import msgspec

from crossbody.cases import LogFormatError
from crossbody.hw.budget import Budget, current
from crossbody.hw.formats._bounded import Chunks, MeteredFile
from crossbody.hw.formats._contract import Block, Group
from crossbody.hw.formats._messages import Leaf, crowded, refuse_large, rows_of, too_large, topic_group
from crossbody.hw.formats._tables import NoOptions as Options
from crossbody.hw.guard import closing, library, parsed, parsing

SUFFIXES = (".mcap",)
MAGIC = b"\x89MCAP0\r\n"
WHAT = "MCAP file"
CLOCKS = ("log_time", "publish_time")
FOOTING, SCHEMA, CHANNEL, MESSAGE, CHUNK, STATISTICS = 2, 3, 4, 5, 6, 11  # opcodes
RECORD = struct.Struct("<BQ")  # opcode and length of every record
STAMPED = struct.Struct("<HIQQ")  # channel, sequence number, log time and publish time of a message
LONGEST = 64  # bytes of the name of a compression
SOME = 1 << 10  # records of a file between two looks at the clock
LOOK = 1 << 16  # records of a chunk between two looks at the clock
SIZES = struct.Struct("<QQQ")  # first and last time of a chunk, and its size when unfolded
CHUNKED = struct.Struct("<QQQII")  # those, its checksum, and the length of the name of its compression
FOOTER = struct.Struct("<BQQQI")  # as every record, then where summary and its offsets begin, and a checksum
LARGEST_SCHEMA = 1 << 18  # bytes: a hundred thousand describe all messages of a robot


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as MCAP does."""
    return head.startswith(MAGIC)


def open_log(path: Path, options: Options) -> McapReader:
    """Open an MCAP file; columns are named `/topic.field.element[0]`."""
    return McapReader(path)


class McapReader:
    """Numbers in the messages of every topic, chunk by chunk, with their checksums checked.

    Chunks are read in the order of the file, whatever its indices say, and unfolded to the size
    that they tell.
    """

    def __init__(self, path: Path) -> None:
        from mcap_ros2.decoder import DecoderFactory

        self._path = path
        self._budget = current(path)
        self._chunks = Chunks(path, self._budget)
        self._ros2 = DecoderFactory()
        self.library = library("mcap")
        self.refused: dict[str, str] = {}
        self._leaves: dict[str, Mapping[str, Leaf]] = {}
        self._file = MeteredFile(path, self._budget)
        with closing(self._file), parsing(path, "MCAP file (cut off? `mcap recover` saves what is whole)"):
            self.groups = tuple(self._topics())
        self._file.metered = False

    def _topics(self) -> Iterator[Group]:
        counts, first = self._counts()
        for topic, count in sorted(counts.items()):
            schema, channel, data = first[topic]
            why = too_large(data)
            decode = None if why else self._decoder(schema, channel)
            if decode is None:
                kind = (
                    f"is encoded as {channel.message_encoding or 'nothing'}; what can be read is cdr (ROS 2) and json"
                )
                self.refused[topic] = why or kind
                continue
            message = decode(data)
            if why := crowded(message):
                self.refused[topic] = why
                continue
            group, self._leaves[topic] = topic_group(topic, count, message, CLOCKS)
            yield group

    def _counts(self) -> tuple[dict[str, int], dict[str, tuple[Any, Any, bytes]]]:
        """Messages of every topic, by the summary or the whole file, and the first message of each."""
        told = self._told()
        counts: dict[str, int] = {}
        first: dict[str, tuple[Any, Any, bytes]] = {}
        for schema, channel, _, _, data in self._messages(None):
            topic = channel.topic
            counts[topic] = counts.get(topic, 0) + 1
            if topic not in first:
                first[topic] = schema, channel, data
                if told and first.keys() >= told.keys():
                    return told, first
        for topic in told.keys() - first.keys():
            raise LogFormatError(
                self._path, f"announces {told[topic]} messages on {topic!r} and holds none: truncated?"
            )
        return counts, first

    def _told(self) -> dict[str, int]:
        """Messages of every topic by the file's summary; empty if it has none."""
        from mcap.data_stream import ReadDataStream
        from mcap.records import Channel, Statistics

        topics: dict[int, str] = {}
        told: dict[int, int] = {}
        start = self._summary_start()
        for _, opcode, length in records(self._file, self._path, self._budget, start) if start else ():
            if opcode in (CHUNK, MESSAGE):
                raise LogFormatError(self._path, "has messages in its summary, where no recorder writes any.")
            if opcode == CHANNEL:
                channel = Channel.read(ReadDataStream(BytesIO(self._file.read(length))))
                topics[channel.id] = channel.topic
            elif opcode == STATISTICS:
                told = Statistics.read(ReadDataStream(BytesIO(self._file.read(length)))).channel_message_counts
        counts: dict[str, int] = {}
        for key, count in told.items() if topics else ():
            counts[topics[key]] = counts.get(topics[key], 0) + count
        return {topic: count for topic, count in counts.items() if count}

    def _summary_start(self) -> int:
        """Where the summary begins; 0 if there is none."""
        self._file.seek(-FOOTER.size - len(MAGIC), 2)
        opcode, length, start, _, _ = FOOTER.unpack(self._file.read(FOOTER.size))
        if (opcode, length) != (FOOTING, FOOTER.size - RECORD.size):
            raise ValueError("it does not end with a footer")
        return int(start)

    def _messages(self, topic: str | None) -> Iterator[tuple[Any, Any, int, int, bytes]]:
        """Schema, channel, both times and data of messages of a topic, or of all, as they stand."""
        from mcap.data_stream import ReadDataStream
        from mcap.records import Channel, Schema

        schemas: dict[int, Any] = {}
        channels: dict[int, Any] = {}
        for opcode, raw in self._records():
            if opcode == MESSAGE:
                key, _, log_time, publish_time = STAMPED.unpack_from(raw)
                channel = channels[key]
                if topic is None or channel.topic == topic:
                    yield schemas.get(channel.schema_id), channel, log_time, publish_time, bytes(raw[STAMPED.size :])
            elif opcode == SCHEMA:
                if len(raw) > LARGEST_SCHEMA:
                    text = f"has a schema of {len(raw)} bytes; no message of a rig needs {LARGEST_SCHEMA}."
                    raise LogFormatError(self._path, text)
                schema = Schema.read(ReadDataStream(BytesIO(raw)))
                schemas[schema.id] = schema
            elif opcode == CHANNEL:
                found = Channel.read(ReadDataStream(BytesIO(raw)))
                channels[found.id] = found

    def _records(self) -> Iterator[tuple[int, memoryview]]:
        """Records of the data section, those inside of chunks too."""
        for at, opcode, length in records(self._file, self._path, self._budget):
            if opcode == CHUNK:
                yield from _inside(memoryview(self._unfolded(at, self._file.read(length))), self._budget)
            elif opcode in (SCHEMA, CHANNEL, MESSAGE):
                yield opcode, memoryview(self._file.read(length))

    def _unfolded(self, at: int, raw: bytes) -> bytes:
        """What a chunk holds; one of nothing costs nothing."""
        _, _, size, checksum, length = CHUNKED.unpack_from(raw)
        begin = CHUNKED.size + length + 8
        if not size:
            return b""
        name = raw[CHUNKED.size : CHUNKED.size + min(length, LONGEST)].decode()
        (stored,) = struct.unpack_from("<Q", raw, begin - 8)
        if stored > len(raw) - begin:
            raise ValueError("a chunk extends beyond its record")
        whole = self._chunks.unfold(at, name, raw[begin : begin + stored], size)
        if checksum and zlib.crc32(whole) != checksum:
            raise LogFormatError(self._path, "has a chunk whose checksum is wrong: damaged.")
        return whole

    def _decoder(self, schema: Any, channel: Any) -> Callable[[bytes], Any] | None:
        if channel.message_encoding == "json":
            return msgspec.json.decode
        found: Callable[[bytes], Any] | None = self._ros2.decoder_for(channel.message_encoding, schema)
        return found

    def blocks(self, group: Group, columns: Sequence[str]) -> Iterator[Block]:
        """See `Reader`."""
        found = rows_of(self._path, WHAT, self._rows(group.name), group, self._leaves[group.name], columns)
        return parsed(self._path, WHAT, found)

    def _rows(self, topic: str) -> Iterator[tuple[Mapping[str, int], Callable[[], Any]]]:
        for schema, channel, log_time, publish_time, data in self._messages(topic):
            self._budget.spend(len(data))
            refuse_large(self._path, topic, data)
            decode = self._decoder(schema, channel) or msgspec.json.decode
            clocks = {f"{topic}.log_time": log_time, f"{topic}.publish_time": publish_time}
            yield clocks, lambda decode=decode, data=data: decode(data)  # type: ignore[misc]

    def close(self) -> None:
        """See `Reader`."""
        self._file.close()


def records(file: Any, path: Path, budget: Budget, at: int = len(MAGIC)) -> Iterator[tuple[int, int, int]]:
    """Place, opcode and length of the records of an open MCAP file from one on, each before its content is read."""
    end = file.seek(0, 2) - len(MAGIC)
    for number in itertools.count():
        if at + RECORD.size > end:
            return
        if number % SOME == 0:
            budget.spend(0)
        file.seek(at)
        opcode, length = RECORD.unpack(file.read(RECORD.size))
        if opcode == 0 or length > end - at - RECORD.size:
            raise LogFormatError(
                path, "has an invalid record, or one that extends beyond its end: truncated? `mcap recover` helps."
            )
        if opcode == CHUNK and length >= SIZES.size:
            budget.hold(2 * SIZES.unpack(file.read(SIZES.size))[2], "a chunk and its messages")
            file.seek(at + RECORD.size)
        yield at, opcode, length
        at += RECORD.size + length


def _inside(whole: memoryview, budget: Budget) -> Iterator[tuple[int, memoryview]]:
    """The records in an unfolded chunk; slices of it are no copies."""
    at = 0
    for number in itertools.count():
        if at >= len(whole):
            return
        if number % LOOK == 0:
            budget.spend(0)  # millions of empty ones would take their time unseen
        opcode, length = RECORD.unpack_from(whole, at)
        at += RECORD.size
        if opcode == 0 or length > len(whole) - at:
            raise ValueError("a record is invalid, or extends beyond its chunk")
        yield opcode, whole[at : at + length]
        at += length
