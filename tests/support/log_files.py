"""The same table in every log format, written by the library that owns the format."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from numpy.typing import NDArray

Table = Mapping[str, NDArray[Any]]
"""Columns by name; "t" is the time, s."""

UNITS = {"t": "s", "angle": "rad", "torque": "N m", "count": "1", "touch": "1"}
STEADY = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # other work may share the machine
MILLI = 1_000_000  # ns


def table(rows: int = 1000, seed: int = 7) -> dict[str, NDArray[Any]]:
    """Full mantissas, a float32 and whole numbers, on an exact time base of 1 ms."""
    random = np.random.default_rng(seed)
    return {
        "t": np.arange(rows) / 1000.0,
        "angle": random.standard_normal(rows) * np.exp2(random.integers(-40, 40, rows)),
        "torque": random.standard_normal(rows).astype(np.float32),
        "count": random.integers(-(2**31), 2**31, rows, dtype=np.int32),
        "touch": random.integers(0, 2, rows, dtype=np.uint8),
    }


def write_csv(path: Path, data: Table) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(data)
        rows.writerows(zip(*(values.tolist() for values in data.values()), strict=True))


def write_parquet(path: Path, data: Table) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table(dict(data)), path, row_group_size=300)


def write_mat(path: Path, data: Table) -> None:
    from scipy.io import savemat

    savemat(path, {"log": dict(data)}, do_compression=True)


def write_mat73(path: Path, data: Table) -> None:
    import h5py

    classes = {"float64": "double", "float32": "single"}
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in data.items():
            item = file.create_dataset(
                name, data=values[None, :], chunks=(1, min(256, len(values))), compression="gzip"
            )
            item.attrs["MATLAB_class"] = np.bytes_(classes.get(values.dtype.name, values.dtype.name))
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def write_hdf5(path: Path, data: Table) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for name, values in data.items():
            file.create_dataset(
                f"rig/{name}", data=values, chunks=(min(256, len(values)),), shuffle=True, compression="gzip"
            )


def write_mcap(path: Path, data: Table, late: Any = None) -> None:
    from mcap_ros2.writer import Writer

    definition = _definition(data)
    with path.open("wb") as file, Writer(file, chunk_size=4096) as writer:
        schema = writer.register_msgdef("rig_msgs/msg/State", definition)
        for i in range(len(data["t"])):
            message = {name: values[i].item() for name, values in data.items()}
            when, sent = _stamps(i, late)
            writer.write_message("/rig", schema, message, log_time=when, publish_time=sent)


def write_mcap_json(path: Path, data: Table, late: Any = None) -> None:
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("state", "jsonschema", b'{"type": "object"}')
        channel = writer.register_channel("/rig", "json", schema)
        for i in range(len(data["t"])):
            text = json.dumps({name: values[i].item() for name, values in data.items()}).encode()
            when, sent = _stamps(i, late)
            writer.add_message(channel, log_time=when, publish_time=sent, data=text)
        writer.finish()


def _stamps(i: int, late: Any) -> tuple[int, int]:
    """When message i was written and when it was sent, ns; `late` of each is what lies between."""
    when = (i + 1) * MILLI if late is not None else i * MILLI
    return when, when - (0 if late is None else int(late[i]))


def _definition(data: Table) -> str:
    return "".join(f"{values.dtype.name} {name}\n" for name, values in data.items())


def _ros_type(store: Any, data: Table) -> Any:
    from rosbags.typesys import get_types_from_msg

    store.register(get_types_from_msg(_definition(data), "rig_msgs/msg/State"))
    return store.types["rig_msgs/msg/State"]


def write_ros1(path: Path, data: Table) -> None:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    kind = _ros_type(store, data)
    with Writer(path) as bag:
        link = bag.add_connection("/rig", kind.__msgtype__, typestore=store)
        for i in range(len(data["t"])):
            message = kind(**{name: values[i] for name, values in data.items()})
            raw = store.serialize_ros1(message, kind.__msgtype__)
            bag.write(link, i * MILLI, raw)


def write_ros2(path: Path, data: Table, storage: str = "sqlite3") -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kind = _ros_type(store, data)
    with Writer(path, version=9, storage_plugin=StoragePlugin[storage.upper()]) as bag:
        link = bag.add_connection("/rig", kind.__msgtype__, typestore=store)
        for i in range(len(data["t"])):
            message = kind(**{name: values[i] for name, values in data.items()})
            raw = store.serialize_cdr(message, kind.__msgtype__)
            bag.write(link, i * MILLI, raw)


def write_ros2_mcap(path: Path, data: Table) -> None:
    write_ros2(path, data, "mcap")


def write_mdf(path: Path, data: Table) -> None:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        units = [
            Signal(values, data["t"], unit=UNITS.get(name, ""), name=name)
            for name, values in data.items()
            if name != "t"
        ]
        file.append(units)
        file.save(path, overwrite=True)


def write_tdms(path: Path, data: Table) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        for part in np.array_split(np.arange(len(data["t"])), 3):
            units = {name: {"unit_string": UNITS[name]} for name in data if name in UNITS}
            writer.write_segment(
                [ChannelObject("rig", name, values[part], units.get(name, {})) for name, values in data.items()]
            )


WRITERS: dict[str, tuple[str, str, Callable[[Path, Table], None], str, str]] = {
    # case: format, file name, writer, what stands before a column's name, name of the time column
    "csv": ("csv", "log.csv", write_csv, "", "t"),
    "parquet": ("parquet", "log.parquet", write_parquet, "", "t"),
    "mat": ("mat", "log.mat", write_mat, "log.", "log.t"),
    "mat73": ("mat73", "log.mat", write_mat73, "", "t"),
    "hdf5": ("hdf5", "log.h5", write_hdf5, "rig/", "rig/t"),
    "mcap": ("mcap", "log.mcap", write_mcap, "/rig.", "/rig.t"),
    "mcap-json": ("mcap", "log.mcap", write_mcap_json, "/rig.", "/rig.t"),
    "ros1": ("ros1", "log.bag", write_ros1, "/rig.", "/rig.t"),
    "ros2": ("ros2", "bag", write_ros2, "/rig.", "/rig.t"),
    "ros2-mcap": ("ros2", "bag", write_ros2_mcap, "/rig.", "/rig.t"),
    "mdf": ("mdf", "log.mf4", write_mdf, "", "time"),
    "tdms": ("tdms", "log.tdms", write_tdms, "rig/", "rig/t"),
}
NEEDS = {"mat73": "h5py", "hdf5": "h5py", "mcap": "mcap", "mcap-json": "mcap", "ros1": "rosbags", "ros2": "rosbags",
         "ros2-mcap": "rosbags", "mdf": "asammdf", "tdms": "nptdms"}  # fmt: skip


def write(case: str, folder: Path, data: Table) -> Path:
    """Write the table in one format; the test is skipped where its library is not installed."""
    if case in NEEDS:
        pytest.importorskip(NEEDS[case], reason=f"{NEEDS[case]} is not installed: pip install 'crossbody[logs]'")
    _, name, writer, _, _ = WRITERS[case]
    writer(folder / name, data)
    return folder / name
