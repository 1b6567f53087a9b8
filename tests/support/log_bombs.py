"""Small files that would unfold to gigabytes, recurse without an end, or go in circles: makers, several a format."""

from __future__ import annotations

import sqlite3
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import log_damage
import log_files
import numpy as np

GIGA = 3_000_000_000


@dataclass(frozen=True)
class Bomb:
    """One file: its name, how it is made in a folder, and the package that is needed to make or read it."""

    name: str
    make: Callable[[Path], Path]
    needs: str = ""


def deflated(size: int, level: int = 9) -> bytes:
    """So many zeros, in deflate: a thousandth of them."""
    squeeze, piece = zlib.compressobj(level), bytes(1 << 20)
    found = [squeeze.compress(piece) for _ in range(size >> 20)]
    return b"".join([*found, squeeze.compress(bytes(size & 0xFFFFF)), squeeze.flush()])


# Text.


def _csv_columns(folder: Path) -> Path:
    path = folder / "log.csv"
    path.write_text(",".join(f"c{i}" for i in range(100_000)) + "\n" + ",".join("0" * 100_000) + "\n")
    return path


def _csv_codec(folder: Path) -> Path:
    import bz2

    (folder / "log.csv").write_bytes(b"t,a\n0,1\n1,2\n")
    (folder / "log.csv.bz2").write_bytes(bz2.compress(bytes(GIGA // 100)))
    (folder / "map.toml").write_text('format = "csv"\noptions = {encoding = "bz2_codec"}\n[time]\ncolumn = "t"\n'
                                     '[sensors.a]\ncolumn = "a"\nunit = "1"\n')  # fmt: skip
    return folder / "log.csv"


def _csv_late_fault(folder: Path) -> Path:
    path = folder / "log.csv"
    with path.open("wb") as file:
        file.write(b"t,a\n")
        file.writelines(b"%d,1\n" % i for i in range(2_000_000))
        file.write(b"oops,1\n")
    (folder / "map.toml").write_text('[time]\ncolumn = "t"\nunit = "s"\n[sensors.a]\ncolumn = "a"\nunit = "1"\n')
    return path


def _csv_gaps(folder: Path) -> Path:
    """Every step lacks 900 samples: filled, a megabyte becomes a gigabyte."""
    path = folder / "log.csv"
    path.write_text("t,a\n" + "".join(f"{i if i < 2000 else 900 * i},1\n" for i in range(200_000)))
    (folder / "map.toml").write_text(
        '[time]\ncolumn = "t"\nunit = "s"\nsample_time = 1\n[sensors.a]\ncolumn = "a"\nunit = "1"\n'
    )
    return path


# Columnar files.


def _parquet_runs(folder: Path) -> Path:
    """Equal numbers are one run of a few bytes, however many there are."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table({"t": np.zeros(1 << 22, np.int8), "a": np.zeros(1 << 22, np.int8)})
    with pq.ParquetWriter(folder / "log.parquet", table.schema, compression="zstd") as writer:
        for _ in range(200):
            writer.write_table(table)
    return folder / "log.parquet"


def _parquet_page(folder: Path) -> Path:
    """One page of 1.6 GB, compressed."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    column = pa.array(np.zeros(200_000_000))
    large = {"data_page_size": 1 << 31, "row_group_size": 1 << 31, "write_batch_size": 1 << 28}
    path = folder / "log.parquet"
    pq.write_table(pa.table({"t": column}), path, compression="zstd", use_dictionary=False, **large)
    return folder / "log.parquet"


def _parquet_columns(folder: Path) -> Path:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table({f"c{i}": [0.0] for i in range(30_000)}), folder / "log.parquet")
    return folder / "log.parquet"


def _hdf(make: Callable[[object], None], folder: Path) -> Path:
    import h5py

    with h5py.File(folder / "log.h5", "w", libver="latest") as file:
        make(file)
    return folder / "log.h5"


def _hdf_big_chunk(file: object) -> None:
    shape = (GIGA // 8,)
    item = file.create_dataset("t", shape=shape, dtype="f8", chunks=shape, compression="gzip")  # type: ignore[attr-defined]
    item.id.write_direct_chunk((0,), deflated(shape[0] * 8))


def _hdf_small_chunk_unfolds(file: object) -> None:
    item = file.create_dataset("t", shape=(1000,), dtype="f8", chunks=(1000,), compression="gzip")  # type: ignore[attr-defined]
    item.id.write_direct_chunk((0,), deflated(GIGA))


def _hdf_many_chunks(file: object) -> None:
    rows = 1 << 20
    item = file.create_dataset("t", shape=(400 * rows,), dtype="f8", chunks=(rows,), compression="gzip")  # type: ignore[attr-defined]
    raw = deflated(8 * rows)
    for i in range(400):
        item.id.write_direct_chunk((i * rows,), raw)


def _hdf_tiny_chunks(file: object) -> None:
    file.create_dataset("t", data=np.arange(200_000.0), chunks=(1,))  # type: ignore[attr-defined]


def _hdf_deep(file: object) -> None:
    for _ in range(5000):
        file = file.create_group("g")  # type: ignore[attr-defined]


def _hdf_many(file: object) -> None:
    for i in range(25_000):
        file.create_group(f"g{i}")  # type: ignore[attr-defined]


def _hdf_links(file: object) -> None:
    """One dataset under many names."""
    file["t"] = np.arange(10.0)  # type: ignore[index]
    for i in range(25_000):
        file[f"t{i}"] = file["t"]  # type: ignore[index]


def _hdf_cycle(file: object) -> None:
    """Groups that contain themselves, by hard and by soft links, and no numbers."""
    one = file.create_group("one")  # type: ignore[attr-defined]
    one["again"], file["one/up"] = one, file["/"]  # type: ignore[index]
    import h5py

    one["soft"] = h5py.SoftLink("/one/soft")


def _hdf_attribute(file: object) -> None:
    item = file.create_dataset("t", data=np.zeros(10))  # type: ignore[attr-defined]
    item.attrs.create("unit", np.zeros(200_000, "S100"))
    file["a"] = np.zeros((3, 3, 3))  # type: ignore[index]
    del file["t"]  # type: ignore[attr-defined]


def _mat73(make: Callable[[object], None], folder: Path) -> Path:
    import h5py

    path = folder / "log.mat"
    with h5py.File(path, "w", userblock_size=512, libver="latest") as file:
        make(file)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


# MATLAB 5.


def element(kind: int, data: bytes) -> bytes:
    """An element of a MAT file."""
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def matrix_head(kind: int, shape: tuple[int, ...], name: bytes) -> bytes:
    """What stands in front of a matrix's contents."""
    flags = element(6, struct.pack("<II", kind, 0))
    return flags + element(5, struct.pack(f"<{len(shape)}i", *shape)) + element(1, name)


def mat(folder: Path, *elements: bytes) -> Path:
    """A MAT v5 file of these elements."""
    header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    (folder / "log.mat").write_bytes(header + b"".join(elements))
    return folder / "log.mat"


def folded(begin: bytes, zeros: int) -> bytes:
    """A compressed element: some bytes, then zeros."""
    squeeze = zlib.compressobj(9)
    raw = squeeze.compress(begin) + b"".join(squeeze.compress(bytes(1 << 20)) for _ in range(zeros >> 20))
    raw += squeeze.flush()
    return struct.pack("<II", 15, len(raw)) + raw


def _mat_zeros(folder: Path) -> Path:
    count = GIGA // 8
    head = matrix_head(6, (count, 1), b"t") + struct.pack("<II", 9, 8 * count)
    return mat(folder, folded(struct.pack("<II", 14, len(head) + 8 * count) + head, 8 * count))


def _mat_name(folder: Path) -> Path:
    head = element(6, struct.pack("<II", 6, 0)) + element(5, struct.pack("<2i", 1, 1)) + struct.pack("<II", 1, GIGA)
    return mat(folder, folded(struct.pack("<II", 14, GIGA + len(head)) + head, GIGA))


def _mat_struct(folder: Path) -> Path:
    count = GIGA // 8
    inner = matrix_head(6, (count, 1), b"") + struct.pack("<II", 9, 8 * count)
    fields = element(5, struct.pack("<i", 8)) + element(1, b"a".ljust(8, b"\0"))
    head = matrix_head(2, (1, 1), b"s") + fields + struct.pack("<II", 14, len(inner) + 8 * count) + inner
    return mat(folder, folded(struct.pack("<II", 14, len(head) + 8 * count) + head, 8 * count))


def _mat_deep(folder: Path) -> Path:
    inner = element(14, matrix_head(6, (1, 1), b"") + element(9, bytes(8)))
    fields = element(5, struct.pack("<i", 8)) + element(1, b"a".ljust(8, b"\0"))
    heads = []
    head = matrix_head(2, (1, 1), b"s") + fields
    size = len(inner)
    for _ in range(50_000):
        heads.append(struct.pack("<II", 14, size + len(head)) + head)
        size += len(head) + 8
    raw = zlib.compress(b"".join(reversed(heads)) + inner, 9)
    return mat(folder, struct.pack("<II", 15, len(raw)) + raw)


def _mat_announces(folder: Path) -> Path:
    return mat(folder, element(14, matrix_head(6, (1 << 30, 1), b"t") + struct.pack("<II", 9, 1 << 31)))


def _mat_many(folder: Path) -> Path:
    one = element(14, matrix_head(6, (1, 1), b"t") + element(9, bytes(8)))
    return mat(folder, *[one.replace(b"t" + bytes(7), b"t%07d" % i) for i in range(25_000)])


# MCAP.


def record(opcode: int, data: bytes) -> bytes:
    """A record of an MCAP file."""
    return struct.pack("<BQ", opcode, len(data)) + data


def text(value: str | bytes) -> bytes:
    """A string with its length before it."""
    raw = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(raw)) + raw


def schema(key: int, definition: str) -> bytes:
    """A schema of ROS 2."""
    return record(3, struct.pack("<H", key) + text("rig/T") + text("ros2msg") + text(definition))


def channel(key: int, topic: str, encoding: str = "cdr") -> bytes:
    """A channel of the first schema."""
    return record(4, struct.pack("<HH", key, 1) + text(topic) + text(encoding) + struct.pack("<I", 0))


def message(key: int, data: bytes) -> bytes:
    """A message."""
    return record(5, struct.pack("<HIQQ", key, 0, 0, 0) + data)


def chunk(whole: bytes | int, declared: int | None = None, compression: str = "zstd") -> bytes:
    """A chunk; a number stands for so many zeros."""
    import lz4.frame
    import zstandard

    if compression == "zstd":
        squeeze = zstandard.ZstdCompressor(level=19).compressobj()
        pieces = [whole] if isinstance(whole, bytes) else [bytes(1 << 20)] * (whole >> 20)
        raw = b"".join([*(squeeze.compress(piece) for piece in pieces), squeeze.flush()])
    else:
        frame = lz4.frame.LZ4FrameCompressor()
        pieces = [whole] if isinstance(whole, bytes) else [bytes(1 << 20)] * (whole >> 20)
        raw = b"".join([frame.begin(), *(frame.compress(piece) for piece in pieces), frame.flush()])
    size = declared if declared is not None else whole if isinstance(whole, int) else len(whole)
    return record(6, struct.pack("<QQQI", 0, 0, size, 0) + text(compression) + struct.pack("<Q", len(raw)) + raw)


MAGIC = b"\x89MCAP0\r\n"
FOOTER = 29  # bytes of the record


def mcap(folder: Path, *records: bytes) -> Path:
    """An MCAP file of these records."""
    end = record(15, struct.pack("<I", 0)) + record(2, struct.pack("<QQI", 0, 0, 0))
    (folder / "log.mcap").write_bytes(MAGIC + record(1, text("ros2") + text("")) + b"".join(records) + end + MAGIC)
    return folder / "log.mcap"


DEFINED = schema(1, "float64 a\n") + channel(1, "/rig")
CDR = b"\x00\x01\x00\x00"


def _mcap_declares(folder: Path) -> Path:
    return mcap(folder, DEFINED, chunk(GIGA))


def _mcap_hides(folder: Path) -> Path:
    return mcap(folder, DEFINED, chunk(GIGA, declared=1000))


def _mcap_lz4(folder: Path) -> Path:
    return mcap(folder, DEFINED, chunk(GIGA, declared=1000, compression="lz4"))


def _mcap_lz4_declares(folder: Path) -> Path:
    return mcap(folder, DEFINED, chunk(GIGA, compression="lz4"))


def _mcap_many(compression: str, folder: Path) -> Path:
    """Chunks that tell the truth and are each within the memory: together they unfold to 6 GB."""
    return mcap(folder, DEFINED, chunk(400 << 20, compression=compression) * 15)


def _mcap_empties(folder: Path) -> Path:
    """Millions of records of nothing, which every reader may skip, and has to."""
    return mcap(folder, DEFINED, chunk(record(0x80, b"") * 20_000_000))


def _mcap_exact(compression: str, folder: Path) -> Path:
    """A chunk that tells the most that is held, and unfolds to six times that."""
    return mcap(folder, DEFINED, chunk(GIGA, declared=500 << 20, compression=compression))


def _mcap_objects(folder: Path) -> Path:
    """Messages of lists of one-byte structures: every byte becomes an object."""
    definition = "P[] a\nbool b\n" + "=" * 80 + "\nMSG: rig/P\nbool b\n"
    body = CDR + struct.pack("<I", 900_000) + bytes(900_001)
    whole = b"".join(message(1, body) for _ in range(200))
    return mcap(folder, schema(1, definition), channel(1, "/rig"), chunk(whole))


def _mcap_nested(folder: Path) -> Path:
    """Ten levels of ten fields, each of the next type."""
    parts = ["".join(f"T{i + 1} f{k}\n" for k in range(10)) for i in range(10)] + ["bool b\n"]
    definition = parts[0] + "".join("=" * 80 + f"\nMSG: rig/T{i}\n{parts[i]}" for i in range(1, 11))
    return mcap(folder, schema(1, definition), channel(1, "/rig"), chunk(message(1, CDR + bytes(1000))))


def _mcap_array(folder: Path) -> Path:
    return mcap(folder, schema(1, "float64[2000000000] a\n"), channel(1, "/rig"), message(1, CDR + bytes(64)))


def _mcap_itself(folder: Path) -> Path:
    definition = "T a\n" + "=" * 80 + "\nMSG: rig/T\nT a\n"
    return mcap(folder, schema(1, definition), channel(1, "/rig"), message(1, CDR + bytes(64)))


def _mcap_topics(folder: Path) -> Path:
    """A chunk that every one of many topics is looked for in."""
    many = range(1, 3000)
    whole = b"".join(message(key, CDR + bytes(8)) for key in many) + message(1, CDR + bytes(8)) * 200_000
    channels = b"".join(channel(key, f"/t{key}") for key in many)
    return mcap(folder, schema(1, "float64 a\n"), channels, chunk(whole))


def _mcap_json(folder: Path) -> Path:
    nested = b'{"a":' * 100_000 + b"1" + b"}" * 100_000
    return mcap(folder, schema(1, ""), channel(1, "/rig", "json"), message(1, nested))


def mcap_summary(content: Callable[[], bytes], folder: Path) -> Path:
    """What a summary has no use for, where a reader looks that wants to know how many messages there are."""
    path = mcap(folder, DEFINED, message(1, CDR + bytes(8)), message(1, CDR + bytes(8)))
    raw = path.read_bytes()
    end = len(raw) - len(MAGIC) - FOOTER
    footer = record(2, struct.pack("<QQI", end, 0, 0))
    path.write_bytes(raw[:end] + content() + footer + MAGIC)
    return path


def _summary_chunk(compression: str) -> bytes:
    return chunk(800 << 20, compression=compression)


def _summary_chunks(compression: str) -> bytes:
    return chunk(record(0x90, bytes(400 << 20)), compression=compression) * 30


def _summary_messages() -> bytes:
    return chunk(message(1, b"") * 10_000_000)


def _mcap_empty_chunks(folder: Path) -> Path:
    return mcap(folder, DEFINED, chunk(b"") * 200_000)


def _mcap_schema(folder: Path) -> Path:
    definition = "".join(f"float64 x{i}\n" for i in range(200_000))
    return mcap(folder, schema(1, definition), channel(1, "/rig"), message(1, CDR + bytes(1_000_000)))


# Bags.


def _ros2(change: Callable[[Path, Path], None], folder: Path) -> Path:
    path = log_files.write("ros2", folder, log_damage.motion(30))
    change(path, log_damage.bytes_of(path))
    return path


def _sql(statement: str, path: Path, file: Path) -> None:
    with sqlite3.connect(file) as link:
        link.executescript(statement)
    link.close()


VIEW = """ALTER TABLE messages RENAME TO kept;
CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)
SELECT i AS id, 1 AS topic_id, i AS timestamp, zeroblob(1000000) AS data FROM n;"""
GENERATED = """ALTER TABLE messages RENAME TO kept;
CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,
data BLOB GENERATED ALWAYS AS (zeroblob(900000000)) VIRTUAL);
INSERT INTO messages(id, topic_id, timestamp) SELECT id, topic_id, timestamp FROM kept;"""


def _yaml(path: Path, file: Path) -> None:
    laughs = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 60))
    (path / "metadata.yaml").write_text(laughs + (path / "metadata.yaml").read_text())


def _yaml_quoted(path: Path, file: Path) -> None:
    """Laughs behind quoted keys, which a fault of the format of the bag would spell out."""
    laughs = '"a0": &a0 ["x", "x"]\n' + "".join(f'"a{i}": &a{i} [*a{i - 1}, *a{i - 1}]\n' for i in range(1, 40))
    told = (path / "metadata.yaml").read_text()
    told = told.replace("compression_format: ''", '"compression_format": *a39')
    (path / "metadata.yaml").write_text(laughs + told.replace("compression_mode: ''", "compression_mode: 'FILE'"))


def _yaml_deep(path: Path, file: Path) -> None:
    (path / "metadata.yaml").write_text("a: " + "[" * 400_000)


TOPICS = """WITH RECURSIVE n(i) AS (SELECT 100 UNION ALL SELECT i + 1 FROM n LIMIT 60000)
INSERT INTO topics(id, name, type, serialization_format, offered_qos_profiles, type_description_hash)
SELECT i, '/t' || i, 'std_msgs/msg/Float64', 'cdr', '', '' FROM n;"""


def _zstd_file(path: Path, file: Path) -> None:
    import zstandard

    squeeze = zstandard.ZstdCompressor().compressobj()
    raw = b"".join([*(squeeze.compress(bytes(1 << 20)) for _ in range(GIGA >> 20)), squeeze.flush()])
    (path / (file.name + ".zstd")).write_bytes(raw)
    text_ = (path / "metadata.yaml").read_text().replace(file.name, file.name + ".zstd")
    text_ = text_.replace("compression_format: ''", "compression_format: 'zstd'")
    (path / "metadata.yaml").write_text(text_.replace("compression_mode: ''", "compression_mode: 'FILE'"))


def _ros2_mcap(folder: Path) -> Path:
    path = log_files.write("ros2-mcap", folder, log_damage.motion(30))
    file = log_damage.bytes_of(path)
    file.write_bytes(mcap(folder, DEFINED, chunk(GIGA)).read_bytes())
    (folder / "log.mcap").unlink()
    return path


def _header(**fields: bytes) -> bytes:
    raw = b"".join(text(name.encode() + b"=" + value) for name, value in fields.items())
    return text(raw)


def bag(folder: Path, definition: str, compression: str, whole: bytes, body: bytes | None = None) -> Path:
    """A ROS 1 bag of one chunk of one connection with one message."""
    word = struct.Struct("<I").pack
    stamp = bytes(8)
    about = _header(topic=b"/rig", type=b"rig/T", md5sum=b"", message_definition=definition.encode())
    connection = _header(op=b"\x07", conn=word(0), topic=b"/rig") + about
    chunk_ = _header(op=b"\x05", compression=compression.encode(), size=word(len(whole) & 0xFFFFFFFF))
    index = _header(op=b"\x04", ver=word(1), conn=word(0), count=word(1)) + text(stamp + word(0))
    magic = b"#ROSBAG V2.0\n"
    start = len(magic) + 4096
    chunks = chunk_ + text(whole if body is None else body) + index
    head = _header(
        op=b"\x03", index_pos=struct.pack("<Q", start + len(chunks)), conn_count=word(1), chunk_count=word(1)
    )
    info = _header(op=b"\x06", ver=word(1), chunk_pos=struct.pack("<Q", start), start_time=stamp, end_time=stamp,
                   count=word(1)) + text(word(0) + word(1))  # fmt: skip
    padding = 4096 - len(head) - 4
    path = folder / "log.bag"
    path.write_bytes(magic + head + text(b" " * padding) + chunks + connection + info)
    return path


def bag_message(data: bytes) -> bytes:
    """A message of a ROS 1 bag."""
    return _header(op=b"\x02", conn=bytes(4), time=bytes(8)) + text(data)


def _bag_bz2(folder: Path) -> Path:
    import bz2

    squeeze = bz2.BZ2Compressor()
    raw = squeeze.compress(bag_message(bytes(8)))
    raw += b"".join(squeeze.compress(bytes(1 << 20)) for _ in range(700)) + squeeze.flush()
    return bag(folder, "float64 a\n", "bz2", b"", raw)


def _bag_nested(folder: Path) -> Path:
    parts = ["".join(f"T{i + 1} f{k}\n" for k in range(10)) for i in range(10)] + ["\n"]
    definition = parts[0] + "".join("=" * 80 + f"\nMSG: rig/T{i}\n{parts[i]}" for i in range(1, 11))
    return bag(folder, definition, "none", bag_message(bytes(64)))


def _bag_empties(folder: Path) -> Path:
    definition = "E[] a\n" + "=" * 80 + "\nMSG: rig/E\n\n"
    return bag(folder, definition, "none", bag_message(struct.pack("<I", 4_000_000_000)))


def _bag_array(folder: Path) -> Path:
    definition = "E[2000000000] a\n" + "=" * 80 + "\nMSG: rig/E\nbool b\n"
    return bag(folder, definition, "none", bag_message(bytes(64)))


# MDF and TDMS.


def _mdf_circle(what: bytes, folder: Path) -> Path:
    """The first block of a kind names itself as the next one."""
    path = log_files.write("mdf", folder, log_damage.motion(30))
    raw = bytearray(path.read_bytes())
    at = raw.index(b"##" + what)
    raw[at + 24 : at + 32] = struct.pack("<Q", at)
    path.write_bytes(bytes(raw))
    return path


def _mdf_formula(folder: Path) -> Path:
    from asammdf import MDF, Signal

    path = folder / "log.mf4"
    with MDF(version="4.10") as file:
        formula = {"formula": "X1**9**9**9"}
        file.append([Signal(np.ones(10), np.arange(10.0), name="a", conversion=formula)])
        file.save(path, overwrite=True)
    (folder / "map.toml").write_text('[time]\ncolumn = "time"\n[sensors.a]\ncolumn = "a"\nunit = "1"\n')
    return path


def _mdf_zipped(folder: Path) -> Path:
    """A compressed block that unfolds to gigabytes for each of many channels."""
    from asammdf import MDF, Signal

    path, kept = folder / "log.mf4", folder / "kept.mf4"
    rows = 2000
    with MDF(version="4.10") as file:
        file.append([Signal(np.zeros(rows), np.arange(rows) * 1.0, name=f"a{i}") for i in range(3)])
        file.save(kept, overwrite=True, compression=1)
    raw = bytearray(kept.read_bytes())
    at = raw.index(b"##DZ")
    squeezed = deflated(GIGA)
    block = (
        struct.pack("<4sIQQ2sBBIQQ", b"##DZ", 0, 48 + len(squeezed), 0, b"DT", 0, 0, 0, GIGA, len(squeezed)) + squeezed
    )
    while len(raw) % 8:
        raw += b"\0"
    old, new = struct.pack("<Q", at), struct.pack("<Q", len(raw))
    group = raw.index(b"##CG")
    record_size = 8 * 4
    raw[group + 24 + 48 + 8 : group + 24 + 48 + 16] = struct.pack("<Q", GIGA // record_size)
    path.write_bytes(bytes(raw).replace(old, new) + block)
    kept.unlink()
    return path


TDMS_TOC = {"meta": 2, "raw": 8, "new": 4}


def tdms(folder: Path, *segments: tuple[int, bytes, bytes]) -> Path:
    """A TDMS file: flags, metadata and raw data of every segment."""
    raw = b""
    for flags, meta, data in segments:
        raw += b"TDSm" + struct.pack("<iIQQ", flags, 4713, len(meta) + len(data), len(meta)) + meta + data
    (folder / "log.tdms").write_bytes(raw)
    return folder / "log.tdms"


def tdms_object(path: str, rows: int, kind: int = 10) -> bytes:
    """A channel of so many doubles a chunk."""
    return text(path) + struct.pack("<IIIQI", 20, kind, 1, rows, 0)


def _tdms_objects(folder: Path) -> Path:
    return tdms(folder, (14, struct.pack("<I", 0xFFFFFFFF) + tdms_object("/'a'/'t'", 1), bytes(8)))


def _tdms_string(folder: Path) -> Path:
    return tdms(folder, (14, struct.pack("<II", 1, 0xFFFFFFF0) + b"/'a'", bytes(8)))


def _tdms_rows(folder: Path) -> Path:
    return tdms(folder, (14, struct.pack("<I", 1) + tdms_object("/'a'/'t'", 1 << 60), bytes(64)))


def _tdms_segments(folder: Path) -> Path:
    """Every one of many segments repeats one of many channels."""
    many = b"".join(tdms_object(f"/'a'/'c{i}'", 1) for i in range(8000))
    first = (14, struct.pack("<I", 8000) + many, bytes(8 * 8000))
    again = (2, struct.pack("<I", 1) + text("/'a'/'c0'") + struct.pack("<II", 0, 0), b"")
    return tdms(folder, first, *[again] * 8000)


def tdms_ones(folder: Path, channels: int, chunks: int) -> Path:
    """Chunks of one value a channel: to read a channel, all before it are gone through in every chunk."""
    many = b"".join(tdms_object(f"/'a'/'c{i}'", 1) for i in range(channels))
    values = np.repeat(np.arange(float(chunks)), channels).tobytes()
    return tdms(folder, (14, struct.pack("<I", channels) + many, values))


def _tdms_channels(folder: Path) -> Path:
    many = b"".join(tdms_object(f"/'a'/'c{i}'", 1) for i in range(25_000))
    return tdms(folder, (14, struct.pack("<I", 25_000) + many, bytes(8 * 25_000)))


def bombs() -> Iterator[Bomb]:
    """All of them."""
    makers: dict[str, dict[str, Callable[[Path], Path]]] = {
        "": {
            "csv-columns": _csv_columns, "csv-codec": _csv_codec, "csv-late-fault": _csv_late_fault,
            "csv-gaps": _csv_gaps, "parquet-runs": _parquet_runs, "parquet-page": _parquet_page,
            "parquet-columns": _parquet_columns, "mat-zeros": _mat_zeros, "mat-name": _mat_name,
            "mat-struct": _mat_struct, "mat-deep": _mat_deep, "mat-announces": _mat_announces, "mat-many": _mat_many,
        },
        "h5py": {
            **{f"hdf5-{name}": partial(_hdf, make) for name, make in HDF.items()},
            **{f"mat73-{name}": partial(_mat73, make) for name, make in HDF.items()},
        },
        "mcap": {
            "mcap-declares": _mcap_declares, "mcap-hides": _mcap_hides, "mcap-lz4": _mcap_lz4,
            "mcap-lz4-declares": _mcap_lz4_declares, "mcap-empties": _mcap_empties,
            **{f"mcap-many-{kind}": partial(_mcap_many, kind) for kind in ("zstd", "lz4")},
            **{f"mcap-exact-{kind}": partial(_mcap_exact, kind) for kind in ("zstd", "lz4")},
            "mcap-objects": _mcap_objects, "mcap-nested": _mcap_nested, "mcap-array": _mcap_array,
            "mcap-summary-zstd": partial(mcap_summary, partial(_summary_chunk, "zstd")),
            "mcap-summary-lz4": partial(mcap_summary, partial(_summary_chunk, "lz4")),
            "mcap-summary-many": partial(mcap_summary, partial(_summary_chunks, "zstd")),
            "mcap-summary-messages": partial(mcap_summary, _summary_messages),
            "mcap-empty-chunks": _mcap_empty_chunks, "mcap-schema": _mcap_schema,
            "mcap-itself": _mcap_itself, "mcap-topics": _mcap_topics, "mcap-json": _mcap_json,
        },
        "rosbags": {
            "ros2-view": partial(_ros2, partial(_sql, VIEW)),
            "ros2-generated": partial(_ros2, partial(_sql, GENERATED)),
            "ros2-yaml": partial(_ros2, _yaml), "ros2-yaml-quoted": partial(_ros2, _yaml_quoted),
            "ros2-yaml-deep": partial(_ros2, _yaml_deep), "ros2-topics": partial(_ros2, partial(_sql, TOPICS)),
            "ros2-zstd": partial(_ros2, _zstd_file), "ros2-mcap": _ros2_mcap,
            "ros1-bz2": _bag_bz2,
            "ros1-nested": _bag_nested, "ros1-empties": _bag_empties, "ros1-array": _bag_array,
        },
        "asammdf": {
            **{f"mdf-circle-{what.decode()}": partial(_mdf_circle, what) for what in (b"DG", b"CG", b"CN", b"FH")},
            "mdf-formula": _mdf_formula, "mdf-zipped": _mdf_zipped,
        },
        "nptdms": {
            "tdms-objects": _tdms_objects, "tdms-string": _tdms_string, "tdms-rows": _tdms_rows,
            "tdms-segments": _tdms_segments, "tdms-channels": _tdms_channels,
            "tdms-ones": partial(tdms_ones, channels=2400, chunks=200),
        },
    }  # fmt: skip
    for needs, found in makers.items():
        for name, make in found.items():
            yield Bomb(name, make, needs)


HDF: dict[str, Callable[[object], None]] = {
    "big-chunk": _hdf_big_chunk, "small-chunk-unfolds": _hdf_small_chunk_unfolds, "many-chunks": _hdf_many_chunks,
    "deep": _hdf_deep, "many": _hdf_many, "tiny-chunks": _hdf_tiny_chunks,
    "links": _hdf_links, "cycle": _hdf_cycle, "attribute": _hdf_attribute,
}  # fmt: skip
