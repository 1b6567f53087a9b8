"""Logs that must be refused: in every format what can go wrong with it, and what can go wrong with a path."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import log_files
import numpy as np

ROWS = 400
STEP = 1e-3
RANGES = {"angle": (-3.2, 3.2), "rate": (-40.0, 40.0), "torque": (-50.0, 50.0), "touch": (0.0, 1.0)}
ROLES = {"angle": "coordinates.arm", "rate": "velocities.arm", "torque": "inputs.motor", "touch": "sensors.foot"}
UNITS = {"angle": "rad", "rate": "rad/s", "torque": "N m", "touch": "1"}


def motion(rows: int = ROWS) -> dict[str, np.ndarray]:
    """A swing with its rate, a torque and a touch sensor, at 1 kHz."""
    t = np.arange(rows) * STEP
    return {
        "t": t,
        "angle": 1.2 * np.sin(20.0 * t) + 0.2 * t,
        "rate": 24.0 * np.cos(20.0 * t) + 0.2,
        "torque": (20.0 + 9.0 * np.cos(3.0 * t)).astype(np.float32),
        "touch": (np.sin(40.0 * t) > 0.6).astype(np.uint8),
    }


def column_map(case: str) -> str:
    """The map that reads `motion` in one format."""
    _, _, _, before, clock = log_files.WRITERS[case]
    text = f'[time]\ncolumn = "{clock}"\nunit = "s"\nsample_time = {STEP}\n'
    for name, role in ROLES.items():
        low, high = RANGES[name]
        text += f'[{role}]\ncolumn = "{before}{name}"\nunit = "{UNITS[name]}"\nrange = [{low}, {high}]\n'
    return text


@dataclass(frozen=True)
class Damage:
    """One damaged log: how it is made in a folder, the map it is read by, and words that the error must say."""

    name: str
    case: str
    make: Callable[[Path], Path]
    says: str = ""
    row: int | None = None
    needs: str = ""


# What is wrong with the numbers: a change of the table, the channel, the row.


def _set(name: str, row: int, value: float, data: dict[str, np.ndarray]) -> None:
    data[name] = data[name].astype(np.float64)
    data[name][row] = value


def _swap(one: str, other: str, data: dict[str, np.ndarray]) -> None:
    data[one], data[other] = data[other], data[one]


def _scale(name: str, factor: float, data: dict[str, np.ndarray]) -> None:
    data[name] = data[name] * factor


def _back(data: dict[str, np.ndarray]) -> None:
    data["t"][200:] -= 0.05


def _still(data: dict[str, np.ndarray]) -> None:
    data["t"][120] = data["t"][119]


def _one_row(data: dict[str, np.ndarray]) -> None:
    for name in data:
        data[name] = data[name][:1]


def _without(name: str, data: dict[str, np.ndarray]) -> None:
    del data[name]


CONTENTS: dict[str, tuple[Callable[[dict[str, np.ndarray]], None], str, int | None]] = {
    "nan": (partial(_set, "angle", 37, np.nan), "not a finite number", 37),
    "inf": (partial(_set, "torque", 311, np.inf), "not a finite number", 311),
    "back": (_back, "time decreases", 200),
    "still": (_still, "does not advance", 120),
    "swapped": (partial(_swap, "angle", "torque"), "outside", 0),
    "swapped-rate": (partial(_swap, "angle", "rate"), "outside", None),
    "degrees": (partial(_scale, "angle", 180 / np.pi), "outside", None),
    "sign": (partial(_scale, "rate", -1.0), "velocity integrates", None),
    "milliseconds": (partial(_scale, "t", 1e3), "unit of time", None),
    "short": (_one_row, "samples", None),
    "without": (partial(_without, "torque"), "torque", None),
}


def _contents(case: str, change: Callable[[dict[str, np.ndarray]], None], folder: Path) -> Path:
    data = motion()
    change(data)
    return log_files.write(case, folder, data)


# What is wrong with the bytes.


def bytes_of(path: Path) -> Path:
    """The file that holds the numbers."""
    return next(p for p in path.iterdir() if p.suffix in (".db3", ".mcap")) if path.is_dir() else path


def _cut(case: str, share: float, folder: Path) -> Path:
    path = log_files.write(case, folder, motion())
    file = bytes_of(path)
    os.truncate(file, int(file.stat().st_size * share))
    return path


def _rubbish(case: str, keep: int, folder: Path) -> Path:
    path = log_files.write(case, folder, motion())
    file = bytes_of(path)
    noise = np.random.default_rng(5).bytes(file.stat().st_size)
    file.write_bytes(file.read_bytes()[:keep] + noise)
    return path


def _zeros(case: str, folder: Path) -> Path:
    path = log_files.write(case, folder, motion())
    file = bytes_of(path)
    file.write_bytes(bytes(file.stat().st_size))
    return path


def _empty(case: str, folder: Path) -> Path:
    path = log_files.write(case, folder, motion())
    bytes_of(path).write_bytes(b"")
    return path


def _sparse(case: str, keep: int, folder: Path) -> Path:
    """The beginning of a log, then a hole of 10 GB."""
    path = log_files.write(case, folder, motion())
    file = bytes_of(path)
    os.truncate(file, keep)
    os.truncate(file, 10_000_000_000)
    return path


# What is wrong with a path, or with text.


def _text(text: str | bytes, folder: Path, name: str = "log.csv") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def _csv(row: int, column: int, cell: str, folder: Path) -> Path:
    path = log_files.write("csv", folder, motion())
    lines = path.read_text().splitlines()
    cells = lines[row + 1].split(",")
    cells[column] = cell
    lines[row + 1] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")
    return path


def _line(row: int, line: bytes, folder: Path) -> Path:
    path = log_files.write("csv", folder, motion())
    lines = path.read_bytes().splitlines()
    lines[row + 1] = line
    path.write_bytes(b"\n".join(lines) + b"\n")
    return path


def _folder(folder: Path) -> Path:
    (folder / "log.csv").mkdir()
    return folder / "log.csv"


def _absent(folder: Path) -> Path:
    return folder / "log.csv"


def _pipe(folder: Path) -> Path:
    os.mkfifo(folder / "log.csv")
    return folder / "log.csv"


def _dangling(folder: Path) -> Path:
    (folder / "log.csv").symlink_to(folder / "gone.csv")
    return folder / "log.csv"


def _pickle(name: str, folder: Path) -> Path:
    """A pickle that leaves a file behind if anything loads it."""
    import pickle

    path = folder / name
    path.write_bytes(pickle.dumps(_Trap(str(folder / "executed"))))
    return path


class _Trap:
    def __init__(self, path: str) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Callable[..., object], tuple[str, str]]:
        return open, (self.path, "w")


def _mat_objects(folder: Path) -> Path:
    from scipy.io import savemat

    savemat(folder / "log.mat", {"log": np.array([motion(), "text"], dtype=object)})
    return folder / "log.mat"


def _hdf_never_written(folder: Path) -> Path:
    import h5py

    with h5py.File(folder / "log.h5", "w") as file:
        for name in motion():
            file.create_dataset(f"rig/{name}", shape=(10**12,), dtype="f8", chunks=(10**6,))
    return folder / "log.h5"


def _hdf_elsewhere(folder: Path) -> Path:
    import h5py

    with h5py.File(folder / "log.h5", "w") as file:
        for name in motion():
            file.create_dataset(f"rig/{name}", shape=(8,), dtype="f8", external=[("/etc/hostname", 0, 64)])
    return folder / "log.h5"


def _hdf_objects(folder: Path) -> Path:
    import h5py

    with h5py.File(folder / "log.h5", "w") as file:
        for name in motion():
            file.create_dataset(f"rig/{name}", data=["=1+1", "b"], dtype=h5py.string_dtype())
    return folder / "log.h5"


def _parquet_text(folder: Path) -> Path:
    import pyarrow as pa
    import pyarrow.parquet as pq

    data = {name: list(map(str, values)) for name, values in motion().items()}
    pq.write_table(pa.table(data), folder / "log.parquet")
    return folder / "log.parquet"


def _bag_without(name: str, folder: Path) -> Path:
    path = log_files.write("ros2", folder, motion())
    target = path / name if name else bytes_of(path)
    target.unlink()
    return path


def _bag_yaml(text: str, folder: Path) -> Path:
    path = log_files.write("ros2", folder, motion())
    (path / "metadata.yaml").write_text(text)
    return path


def _renamed(case: str, name: str, folder: Path) -> Path:
    path = log_files.write(case, folder, motion())
    shutil.move(path, folder / name)
    return folder / name


def _unfinished(folder: Path) -> Path:
    path = log_files.write("mdf", folder, motion())
    raw = path.read_bytes()
    path.write_bytes(b"UnFinMF " + raw[8:])
    return path


UNWRITABLE = {("mcap-json", "nan"), ("mcap-json", "inf")}  # JSON has no word for them
FORMULAS = ("=1+1", "=cmd|' /C calc'!A0", "+1+cmd", "-1-2", "@SUM(A1:A9)", '=HYPERLINK("http://x";"y")', "1_000")


def damages() -> Iterator[Damage]:
    """All of them."""
    for case in log_files.WRITERS:
        needs = log_files.NEEDS.get(case, "")
        for name, (change, says, row) in CONTENTS.items():
            if not (case == "mdf" and name == "without"):
                words = says if (case, name) not in UNWRITABLE else "malformed"
                yield Damage(f"{case}-{name}", case, partial(_contents, case, change), words, row, needs)
        for share in (0.2, 0.6, 0.97):
            yield Damage(f"{case}-cut-{share}", case, partial(_cut, case, share), needs=needs)
        if case != "csv":  # text with rubbish behind is a matter of its own, below
            yield Damage(f"{case}-rubbish-behind", case, partial(_rubbish, case, 32), needs=needs)
        yield Damage(f"{case}-rubbish", case, partial(_rubbish, case, 0), needs=needs)
        yield Damage(f"{case}-zeros", case, partial(_zeros, case), needs=needs)
        yield Damage(f"{case}-empty", case, partial(_empty, case), needs=needs)
        yield Damage(f"{case}-sparse", case, partial(_sparse, case, 2000), needs=needs)
    yield from _others()


def _others() -> Iterator[Damage]:
    for i, cell in enumerate(FORMULAS):
        yield Damage(f"formula-{i}", "csv", partial(_csv, 40 + i, 1, cell), "not a number", 40 + i)
    texts: dict[str, tuple[Callable[[Path], Path], str, int | None]] = {
        "word": (partial(_csv, 399, 2, "open"), "'open'", 399),
        "hole": (partial(_csv, 17, 3, ""), "not a finite number", 17),
        "fewer-cells": (partial(_line, 50, b"0.05,1,2"), "3 cells", 50),
        "more-cells": (partial(_line, 51, b"0.05,1,2,3,4,5"), "6 cells", 51),
        "nul": (partial(_line, 52, b"0.05,1,\0,3,4"), "", None),
        "long-line": (partial(_line, 53, b"1" * 3_000_000), "", 53),
        "latin": (partial(_line, 54, b"0.05,1,\xff,3,4"), "", None),
        "no-header": (partial(_text, "0,1,2,3,4\n0.001,1,2,3,4\n"), "options.header", None),
        "header-only": (partial(_text, "t,angle,rate,torque,touch\n"), "no samples", None),
        "same-names": (partial(_text, "t,angle,rate,torque,t\n0,1,2,3,4\n"), "two columns", None),
        "utf16": (partial(_text, "t,angle\n0,1\n".encode("utf-16")), "", None),
        "html": (partial(_text, "<html><body>404</body></html>\n"), "", None),
        "escape": (partial(_text, "t,\x1b[2Jangle\n0,1\n"), "", None),
        "folder": (_folder, "is a folder", None),
        "absent": (_absent, "No such file", None),
        "pipe": (_pipe, "a pipe", None),
        "dangling": (_dangling, "No such file", None),
    }  # fmt: skip
    for name, (make, says, row) in texts.items():
        yield Damage(name, "csv", make, says, row)
    for name in ("log.csv", "log.parquet", "log.mat", "log.h5", "log.npy", "log.pkl", "log"):
        yield Damage(f"pickle-{name}", "csv", partial(_pickle, name))
    others: dict[str, tuple[str, Callable[[Path], Path], str]] = {
        "mat-objects": ("mat", _mat_objects, "MATLAB"),
        "mat-is-csv": ("mat", partial(_renamed, "csv", "log.mat"), "log.t"),
        "hdf5-never-written": ("hdf5", _hdf_never_written, "truncated"),
        "hdf5-elsewhere": ("hdf5", _hdf_elsewhere, "another file"),
        "hdf5-objects": ("hdf5", _hdf_objects, "not numbers"),
        "parquet-text": ("parquet", _parquet_text, "not numbers"),
        "ros2-no-metadata": ("ros2", partial(_bag_without, "metadata.yaml"), "is a folder"),
        "ros2-no-file": ("ros2", partial(_bag_without, ""), "missing"),
        "ros2-yaml": ("ros2", partial(_bag_yaml, "rosbag2_bagfile_information: 7\n"), ""),
        "ros2-yaml-object": ("ros2", partial(_bag_yaml, "!!python/object/apply:os.system ['touch executed']\n"), ""),
        "mdf-unfinished": ("mdf", _unfinished, "never closed"),
    }  # fmt: skip
    for name, (case, make, says) in others.items():
        yield Damage(name, case, make, says, None, log_files.NEEDS.get(case, ""))
