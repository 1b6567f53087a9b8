"""What every log format that can be read here must give back of a table that the format's own library has written.

A format whose library is not installed is not asked: it reads no log either.
"""

from __future__ import annotations

import csv
import json
import math
import tempfile
from collections.abc import Callable, Iterator
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from crossbody import hw
from crossbody.cases.arrays import Floats
from crossbody.hw.reading.columns import parse_columns
from crossbody.reports.judging.asked import Found, rows_of

Table = dict[str, Floats]
ROWS, SEED, SCALE = 40, 11, -2.5
"""Of the table; by which its signal is scaled as it is read."""
MS = 1_000_000  # ns


def table() -> Table:
    """Return instants, s, and a signal whose numbers have all their digits."""
    draw = np.random.default_rng(SEED)
    return {"t": np.arange(ROWS) / 1024.0, "angle": draw.standard_normal(ROWS) * np.exp2(draw.integers(-20, 20, ROWS))}


def _csv(path: Path, data: Table) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(data)
        rows.writerows(zip(*(values.tolist() for values in data.values()), strict=True))


def _parquet(path: Path, data: Table) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table(dict(data)), path, row_group_size=ROWS // 3)


def _mat(path: Path, data: Table) -> None:
    from scipy.io import savemat

    savemat(path, {"log": dict(data)}, do_compression=True)


def _matrix(path: Path, data: Table, *, rows: bool) -> None:
    """Write one matrix whose rows, or columns, are signals."""
    from scipy.io import savemat

    signals = np.stack([*data.values()])
    savemat(path, {"M": signals if rows else signals.T})


def _hdf5(path: Path, data: Table) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for name, values in data.items():
            file.create_dataset(f"rig/{name}", data=values)


def _mcap(path: Path, data: Table) -> None:
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("state", "jsonschema", b'{"type": "object"}')
        channel = writer.register_channel("/rig", "json", schema)
        for i in range(ROWS):
            said = json.dumps({name: values[i].item() for name, values in data.items()}).encode()
            writer.add_message(channel, log_time=i * MS, publish_time=i * MS, data=said)
        writer.finish()


def _ros(path: Path, data: Table) -> None:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    definition = "".join(f"float64 {name}\n" for name in data)
    store.register(get_types_from_msg(definition, "rig_msgs/msg/State"))
    kind: Any = store.types["rig_msgs/msg/State"]
    with Writer(path) as bag:
        link = bag.add_connection("/rig", kind.__msgtype__, typestore=store)
        for i in range(ROWS):
            said = kind(**{name: values[i] for name, values in data.items()})
            bag.write(link, i * MS, store.serialize_ros1(said, kind.__msgtype__))


def _tdms(path: Path, data: Table) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        for part in np.array_split(np.arange(ROWS), 3):
            writer.write_segment([ChannelObject("rig", name, values[part]) for name, values in data.items()])


WRITERS: dict[str, tuple[str, str, Callable[[Path, Table], None], str]] = {
    "log.csv": ("csv", "csv", _csv, "{name}"), "log.parquet": ("parquet", "pyarrow", _parquet, "{name}"),
    "log.mat": ("mat", "scipy", _mat, "log.{name}"), "log.h5": ("hdf5", "h5py", _hdf5, "rig/{name}"),
    "wide.mat": ("mat", "scipy", partial(_matrix, rows=True), "M[{place}]"),
    "tall.mat": ("mat", "scipy", partial(_matrix, rows=False), "M[{place}]"),
    "log.mcap": ("mcap", "mcap", _mcap, "/rig.{name}"), "log.bag": ("ros1", "rosbags", _ros, "/rig.{name}"),
    "log.tdms": ("tdms", "nptdms", _tdms, "rig/{name}"),
}  # fmt: skip
"""File -> its format, the library that writes it, what does, and how it calls a column by its name or place."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return what, number, least and most, and of which file, where a log is read as another one."""
    return tuple(
        found
        for name, (_, library, *_) in WRITERS.items()
        if find_spec(library) is not None
        for found in rows_of(partial(_read, name), partial(_failed, name))
    )


def _failed(name: str, why: str) -> Found:
    return "log", math.nan, (0.0, 0.0), f"{name}, which ends in {why}"


def _read(name: str) -> Iterator[Found]:
    """Yield the number of rows, and the first time and value, that are others than were written."""
    kind, _, write, called = WRITERS[name]
    data = table()
    t, angle = (called.format(name=one, place=i) for i, one in enumerate(data))
    columns = parse_columns(
        f'format = "{kind}"\n[time]\ncolumn = "{t}"\nunit = "s"\n'
        f'[sensors.angle]\ncolumn = "{angle}"\nunit = "mrad"\nscale = {SCALE}\n'
    )
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / name, data)
        log = hw.read(Path(folder) / name, columns)
    if len(log.time) != ROWS:
        yield "rows of a log", float(len(log.time)), (ROWS, ROWS), name
        return
    values = log.channel("sensors", "angle").values
    for what, found, wanted in (("time", log.time, data["t"]), ("value", values, 1e-3 * SCALE * data["angle"])):
        worst = int(np.argmax(np.abs(found - wanted)))
        if not np.allclose(found, wanted, rtol=1e-14, atol=0.0):
            yield f"{what} of a log", float(found[worst]), (float(wanted[worst]),) * 2, name
