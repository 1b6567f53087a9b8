"""Files made to cost gigabytes or to never end: a clear error, within the stated memory and ten seconds each."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import log_bombs
import log_damage
import log_files
import numpy as np
import pytest

from crossbody import hw
from crossbody.cases import InvalidValue, LogFormatError
from crossbody.hw import formats
from crossbody.hw.formats import _messages

BOMBS = {bomb.name: bomb for bomb in log_bombs.bombs()}
QUICK = (
    "csv-columns",
    "mat-deep",
    "hdf5-deep",
    "mcap-hides",
    "ros2-yaml-quoted",
    "ros1-empties",
    "mdf-formula",
    "tdms-rows",
)
SECONDS = 10.0  # of processor time

# Resetting the kernel's high-water mark before every file makes its peak that of this file alone.
CHILD = """
import json, sys, time
from pathlib import Path
from crossbody import hw
from crossbody.cases import CrossbodyError

def status(key):
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) * 1024 for line in file if line.startswith(key))

for clean in sys.argv[2:]:
    hw.survey(clean)  # the libraries are there before anything is counted
for name in json.loads(sys.argv[1]):
    path, told = Path(name), "was read"
    columns = path.parent / "map.toml"
    with open("/proc/self/clear_refs", "w") as file:
        file.write("5")
    before, begin = status("VmRSS"), time.process_time()
    try:
        if columns.exists():
            hw.read(path, columns, repair=("fill_dropped",))
        else:
            hw.survey(path)
    except CrossbodyError:
        told = ""
    print(json.dumps([name, told, status("VmHWM") - before, time.process_time() - begin]), flush=True)
"""


def _explode(names: list[str], folder: Path) -> None:
    """Make the bombs, read them all in one process of their own, and hold each against its bounds."""
    made: dict[str, str] = {}
    for name in names:
        (folder / name).mkdir()
        made[str(BOMBS[name].make(folder / name))] = name
    clean = []
    for case in ("csv", "parquet", "mat", *sorted({"hdf5", "mcap", "ros2", "mdf", "tdms"})):
        (folder / f"clean-{case}").mkdir()
        clean.append(str(log_files.write(case, folder / f"clean-{case}", log_damage.motion())))
    done = subprocess.run(
        [sys.executable, "-c", CHILD, json.dumps(list(made)), *clean], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert [row[0] for row in found] == list(made)
    for path, told, memory, seconds in found:
        size = sum(one.stat().st_size for one in Path(path).parent.rglob("*") if one.is_file())
        assert not told, f"{made[path]} {told}"
        assert memory <= formats.MEMORY + size, f"{made[path]} took {memory / 1e6:.0f} MB"
        assert seconds < SECONDS, f"{made[path]} took {seconds:.1f} s"


def _available(names: list[str]) -> list[str]:
    for package in sorted({BOMBS[name].needs for name in names} - {""}):
        pytest.importorskip(package)
    return names


def test_there_are_at_least_forty() -> None:
    assert len(BOMBS) >= 40
    assert set(QUICK) <= set(BOMBS)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="the peak memory is read from /proc")
def test_bombs_end_with_an_error_within_memory_and_time(tmp_path: Path) -> None:
    _explode(_available(list(QUICK)), tmp_path)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="the peak memory is read from /proc")
@pytest.mark.parametrize("name", sorted(set(BOMBS) - set(QUICK)))
def test_large_bombs_end_with_an_error_within_memory_and_time(name: str, tmp_path: Path) -> None:
    _explode(_available([name]), tmp_path)


@pytest.mark.parametrize("inside", [log_bombs.chunk, lambda zeros: log_bombs.message(1, bytes(zeros))])
def test_a_summary_is_not_unfolded(inside: Callable[[int], bytes], tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    path = log_bombs.mcap_summary(lambda: inside(1 << 20), tmp_path)
    with pytest.raises(LogFormatError, match="summary"):
        hw.survey(path)


@pytest.mark.parametrize(
    ("message", "refused"),
    [
        ({"a": 1.0, "joints": [{"q": 1.0, "v": 2.0}] * 40}, False),
        ({"a": 1.0, "cells": [0] * 500_000}, False),
        ({"a": 1.0, "parts": [{"q": 1.0}] * 20_000}, True),
        ({"a": 1.0, "parts": [{}] * 20_000}, True),
        ({"a": 1.0, "parts": [[{"q": 1.0}] * 200] * 200}, True),
    ],
)
def test_messages_full_of_messages_are_refused(message: dict[str, object], refused: bool) -> None:
    assert bool(_messages.crowded(message)) == refused


@pytest.mark.parametrize("many", ["variables", pytest.param("structs", marks=pytest.mark.slow)])
def test_many_variables_take_their_number_of_steps(many: str, tmp_path: Path) -> None:
    """Four times the variables of a MAT file: four times the calls, not sixteen times."""
    import cProfile
    import pstats

    from scipy.io import savemat

    calls = []
    for count in (300, 1200):
        one = np.zeros(5) if many == "variables" else {"a": np.zeros(5)}
        savemat(tmp_path / "log.mat", {f"v{i}": one for i in range(count)})
        watch = cProfile.Profile()
        watch.runcall(hw.survey, tmp_path / "log.mat")
        calls.append(pstats.Stats(watch).total_calls)  # type: ignore[attr-defined]
    assert calls[1] < 6 * calls[0]


def _columns(names: tuple[str, ...]) -> hw.Columns:
    signals = "".join(f'[sensors.{name}]\ncolumn = "{name}"\nunit = "rad"\n' for name in names)
    return hw.parse_columns(f'[time]\ncolumn = "t"\nunit = "s"\n{signals}')


def test_the_stated_memory_decides(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = 300_000
    data = {"t": np.arange(rows) / 1000.0, "a": np.zeros(rows), "b": np.zeros(rows)}
    pq.write_table(pa.table(data), tmp_path / "log.parquet", compression="zstd")
    assert len(hw.read(tmp_path / "log.parquet", _columns(("a", "b")), memory=50_000_000)) == rows
    with pytest.raises(LogFormatError, match="limit"):
        hw.read(tmp_path / "log.parquet", _columns(("a", "b")), memory=1_000_000)
    with pytest.raises(InvalidValue, match="from 1 on"):
        hw.read(tmp_path / "log.parquet", _columns(("a", "b")), memory=0)


@pytest.mark.parametrize("case", log_files.WRITERS)
def test_legal_logs_need_little_more_than_their_numbers(case: str, tmp_path: Path) -> None:
    path = log_files.write(case, tmp_path, log_files.table(3000))
    found = hw.survey(path, memory=32_000_000)
    assert max(group.rows for group in found.groups) == 3000


@pytest.mark.slow
@pytest.mark.parametrize("case", ["parquet", "hdf5", "mat", "mat73", "mdf", "tdms"])
def test_large_logs_are_read(case: str, tmp_path: Path) -> None:
    """Two million rows of noise, 40 MB: nothing that is legal meets a bound."""
    path = log_files.write(case, tmp_path, log_files.table(2_000_000))
    before, clock = log_files.WRITERS[case][3:]
    columns = hw.parse_columns(f'[time]\ncolumn = "{clock}"\n[sensors.a]\ncolumn = "{before}angle"\nunit = "rad"\n')
    assert len(hw.read(path, columns)) == 2_000_000


@pytest.mark.parametrize("kind", ["h5py"])
def test_a_chunk_is_decoded_once(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A chunk of many blocks of rows: its rows come one block after another, and its bytes once."""
    h5py = pytest.importorskip(kind)
    rows = 40 * formats.BLOCK_ROWS
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file.create_dataset("a", data=np.zeros(rows), chunks=(rows,), compression="gzip")
    reader = formats.open_log(tmp_path / "log.h5")
    blocks = reader.blocks(reader.groups[0], ["a"])
    cost = []
    for block in blocks:
        assert len(block["a"]) == formats.BLOCK_ROWS
        cost.append(reader.budget.taken)
    reader.close()
    first, rest = cost[0], cost[-1] - cost[0]
    assert rest < 8.0 * first, "forty times, if every block decoded the whole chunk"


def test_chunks_of_messages_are_decoded_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mcap")
    from crossbody.hw.formats import _bounded

    count: list[int] = []
    monkeypatch.setitem(_bounded.UNFOLD, "zstd", lambda raw, most, was=_bounded.zstd: count.append(1) or was(raw, most))
    path = log_files.write("mcap", tmp_path, log_files.table(3000))
    hw.survey(path)
    import mcap.reader

    with path.open("rb") as file:
        summary = mcap.reader.make_reader(file).get_summary()
    assert summary is not None
    assert len(count) == len(summary.chunk_indexes) > 10


def test_what_a_library_prints_about_a_file_is_dropped(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """It shows the line that it cannot read, which may hold what a terminal obeys."""
    pytest.importorskip("mcap")
    definition = log_bombs.schema(1, "float64 a\nint32 \x1b]0;title\x07 b\n")
    path = log_bombs.mcap(tmp_path, definition, log_bombs.channel(1, "/rig"), log_bombs.message(1, bytes(20)))
    with pytest.raises(LogFormatError):
        hw.survey(path)
    assert capfd.readouterr() == ("", "")


def test_a_tdms_file_looks_at_the_clock_before_every_channel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nptdms = pytest.importorskip("nptdms")
    count: list[int] = []
    read = nptdms.TdmsChannel.read_data
    monkeypatch.setattr(nptdms.TdmsChannel, "read_data", lambda *given: count.append(1) or read(*given))
    reader = formats.open_log(log_bombs.tdms_ones(tmp_path, channels=9, chunks=9))
    reader.budget.seconds = 0.0
    with pytest.raises(LogFormatError, match="takes more than"):
        next(reader.blocks(reader.groups[0], [column.name for column in reader.groups[0].columns]))
    reader.close()
    assert not count


@pytest.mark.parametrize("skip", [4, 2 * 10**9, 9 * 10**18])
def test_no_more_lines_are_left_out_than_there_are(skip: int, tmp_path: Path) -> None:
    path = tmp_path / "short.csv"
    path.write_text("t,x\n0,1\n1,2\n")
    columns = hw.parse_columns(
        f'options = {{skip = {skip}}}\n[time]\ncolumn = "t"\nunit = "s"\n[sensors]\nx = {{column = "x", unit = "1"}}'
    )
    with pytest.raises(LogFormatError, match="has 3 lines"):
        hw.read(path, columns)


WIDE = """
import sys
import h5py, pandas  # what is loaded already counts for nothing
import pyarrow as pa, pyarrow.parquet as pq
from crossbody import hw
from crossbody.cases import CrossbodyError
folder = sys.argv[1]
with open(folder + "/wide.csv", "w") as file:
    file.write(",".join(f"c{i}" for i in range(9_999)) + "\\n" + (",".join(["0"] * 9_999) + "\\n") * 60)
schema = pa.schema([(f"a{i}", pa.float64()) for i in range(4)])
with pq.ParquetWriter(folder + "/often.parquet", schema) as file:
    for i in range(500):
        file.write_table(pa.table({name: [float(i)] for name in schema.names}, schema=schema))
rows = [hw.survey(f"{folder}/{name}").groups[0].rows for name in ("wide.csv", "often.parquet")]
assert rows == [60, 500], rows
with open(folder + "/narrow.csv", "w") as file:
    file.write("t,x\\n0,1\\n1,2\\n")
for memory in (1, 1 << 20, 1 << 24, 1 << 27, 1 << 29):
    for name in ("wide.csv", "often.parquet", "narrow.csv"):
        try:
            hw.survey(f"{folder}/{name}", memory=memory)
        except CrossbodyError as error:
            print(memory, name, error)
"""


def test_a_wide_table_and_many_row_groups_are_read_within_the_usual_memory(tmp_path: Path) -> None:
    """With little memory they are refused; nothing ends the process."""
    done = subprocess.run([sys.executable, "-c", WIDE, str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


RESERVES = """
import sys
from pathlib import Path
import pandas, pyarrow as pa
from crossbody.hw import formats
from crossbody.hw.formats import _messages
if sys.argv[2] == "first":
    pa.allocate_buffer(1 << 20)
reader = formats.open_log(Path(sys.argv[1]))
with reader.budget.guard():  # as some of Arrow does while it reads
    held = pa.allocate_buffer(1 << 20, memory_pool=pa.mimalloc_memory_pool())
for block in reader.blocks(reader.groups[0], list("abcdefgh")):
    pass
"""


@pytest.mark.parametrize("when", ["first", "later"])
def test_what_arrow_reserves_does_not_count(when: str, tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    if "mimalloc" not in pa.supported_memory_backends():
        pytest.skip("Arrow is built without its own allocator.")
    noise = np.random.default_rng(0).standard_normal((8, 200_000))
    pq.write_table(pa.table({name: noise[i] for i, name in enumerate("abcdefgh")}), tmp_path / "log.parquet")
    ended = subprocess.run(
        [sys.executable, "-c", RESERVES, tmp_path / "log.parquet", when], capture_output=True, text=True
    )
    assert ended.returncode == 0, ended.stderr
