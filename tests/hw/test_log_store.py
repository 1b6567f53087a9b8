"""The store gives a log back as it was, notices any change, and long logs are gone through in bounded memory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from crossbody import hw
from crossbody.cases import InvalidValue, LogFormatError, OutputError

TEXT = """about = "a rig"
synthetic = true
[time]
column = "t"
[coordinates.arm]
column = "q"
unit = "deg"
delay = 0.002
range = [-360, 360]
[sensors.foot]
column = "f"
unit = "kN"
"""


@pytest.fixture
def log(tmp_path: Path) -> hw.Log:
    t = np.delete(np.arange(500) * 1e-3, [40, 41])
    pq.write_table(pa.table({"t": t, "q": 90.0 * np.sin(t), "f": t * t}), tmp_path / "raw.parquet")
    return hw.read(tmp_path / "raw.parquet", hw.parse_columns(TEXT), repair=("fill_dropped",))


def test_a_stored_log_comes_back_without_a_map(log: hw.Log, tmp_path: Path) -> None:
    digest = hw.store(log, tmp_path / "log.parquet")
    back = hw.read(tmp_path / "log.parquet")
    assert back.time.tobytes() == log.time.tobytes()
    assert back.provenance == log.provenance
    assert back.provenance.synthetic
    assert back.sample_time == log.sample_time
    np.testing.assert_array_equal(back.filled, log.filled)
    for one, other in zip(back.channels, log.channels, strict=True):
        assert one.values.tobytes() == other.values.tobytes()
        assert vars_of(one) == vars_of(other)
    assert hw.store(back, tmp_path / "again.parquet") == digest


def vars_of(channel: hw.Channel) -> tuple[object, ...]:
    return channel.role, channel.name, channel.unit, channel.delay, channel.column, channel.range


def test_the_hash_is_of_the_numbers_not_of_the_file(log: hw.Log, tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    hw.store(log, path)
    pq.write_table(pq.read_table(path), path, compression="snappy", row_group_size=17)
    assert len(hw.read(path)) == len(log)


@pytest.mark.parametrize("row", [0, 250, 499])
def test_a_changed_number_is_noticed(log: hw.Log, row: int, tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    hw.store(log, path)
    table = pq.read_table(path)
    values = table["coordinates.arm"].to_numpy().copy()
    values[row] = np.nextafter(values[row], np.inf)
    pq.write_table(table.set_column(1, table.schema.field(1), pa.array(values)), path)
    with pytest.raises(LogFormatError, match="changed since it was stored"):
        hw.read(path)


def test_a_log_that_was_not_stored_needs_a_map(tmp_path: Path, log: hw.Log) -> None:
    with pytest.raises(LogFormatError, match="column map"):
        hw.read(tmp_path / "raw.parquet")


def test_a_stored_log_is_not_repaired(log: hw.Log, tmp_path: Path) -> None:
    hw.store(log, tmp_path / "log.parquet")
    with pytest.raises(InvalidValue, match=r"raw\.parquet"):
        hw.read(tmp_path / "log.parquet", repair=("fill_dropped",))


def test_nothing_half_written_is_left(log: hw.Log, tmp_path: Path) -> None:
    (tmp_path / "folder.parquet").mkdir()
    with pytest.raises(OutputError):
        hw.store(log, tmp_path / "folder.parquet")
    with pytest.raises(OutputError):
        hw.store(log, tmp_path / "nowhere" / "log.parquet")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder.parquet", "raw.parquet"]


def test_more_than_the_limit_is_refused_before_it_is_in_memory(log: hw.Log, tmp_path: Path) -> None:
    with pytest.raises(LogFormatError, match="above the limit"):
        hw.read(tmp_path / "raw.parquet", hw.parse_columns(TEXT), limit=10_000)


LONG = """
import resource, sys
import numpy as np, pyarrow as pa, pyarrow.parquet as pq
from crossbody import hw
path, rows = sys.argv[1], int(sys.argv[2])
schema = pa.schema([(name, pa.float64()) for name in "tqu"])
with pq.ParquetWriter(path, schema, use_dictionary=False) as file:
    for start in range(0, rows, 1 << 17):
        k = np.arange(start, min(start + (1 << 17), rows))
        file.write_table(pa.table({"t": k * 1e-3, "q": (k % 1000) / 9.0, "u": (k % 777) / 7.0}))
columns = hw.Columns(time=hw.Time(column="t"), sensors={n: hw.Signal(column=n, unit="1") for n in "qu"})
with hw.scan(path, columns) as scan:
    assert sum(len(block.time) for block in scan.rows()) == rows
assert not scan.checks.findings()
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.slow
def test_ten_million_rows_need_no_more_memory_than_a_hundred_thousand(tmp_path: Path) -> None:
    peaks = []
    for rows in (100_000, 10_000_000):
        done = subprocess.run(
            [sys.executable, "-c", LONG, str(tmp_path / "log.parquet"), str(rows)],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        peaks.append(int(done.stdout) / 1024)
    assert peaks[1] - peaks[0] < 100, f"{peaks} MB; the table itself is 240 MB"
