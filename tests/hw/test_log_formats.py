"""Every format gives back the same table, bit for bit as far as it keeps the bits."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import log_files
import numpy as np
import pytest

from crossbody import hw
from crossbody.cases import FormatUnavailable, LogFormatError, UnknownName
from crossbody.hw import formats
from crossbody.hw.formats._mat_elements import described, starts

CASES = list(log_files.WRITERS)
NASTY = np.array([5e-324, -0.0, 1.7976931348623157e308, 0.1, 1 / 3, -np.pi, 2.0**-1022, 1e22, 123456789.125, 0.0])


def map_of(case: str, names: tuple[str, ...] = ("angle", "torque", "count", "touch")) -> hw.Columns:
    _, _, _, before, clock = log_files.WRITERS[case]
    signals = "".join(f'[sensors.{n}]\ncolumn = "{before}{n}"\nunit = "{log_files.UNITS[n]}"\n' for n in names)
    return hw.parse_columns(f'[time]\ncolumn = "{clock}"\n{signals}')


@pytest.mark.parametrize("case", CASES)
def test_a_table_comes_back_to_the_last_bit(case: str, tmp_path: Path) -> None:
    data = log_files.table()
    data["angle"][:10] = NASTY
    path = log_files.write(case, tmp_path, data)
    log = hw.read(path, map_of(case))
    assert log.time.tobytes() == data["t"].tobytes()
    for name in ("angle", "torque", "count", "touch"):
        kept = log.channel("sensors", name).values
        assert kept.tobytes() == data[name].astype(np.float64).tobytes(), name
    assert log.provenance.format == log_files.WRITERS[case][0]
    assert log.provenance.rows == 1000


@pytest.mark.parametrize("seed", range(12))
def test_variables_of_a_mat_file_are_described_as_they_were_written(seed: int, tmp_path: Path) -> None:
    """Of names of any length, kinds and shapes, unfolded or not: small elements keep their data in their own tags."""
    from scipy.io import savemat, whosmat

    rng, kinds = np.random.default_rng(seed), ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "?")
    words = ["".join(rng.choice(list("abcxyz_9"), n - 1)) for n in rng.choice(np.arange(1, 32), 6, replace=False)]
    held = {f"v{word}": np.ones(rng.integers(0, 4, rng.integers(2, 4)), rng.choice(kinds)) for word in words}
    path = tmp_path / "log.mat"
    savemat(path, held | {"inside": {"a": np.eye(2)}}, do_compression=bool(seed % 2))
    found = [described(path, start) for start in starts(path)]
    assert found == [(name, tuple(shape), kind) for name, shape, kind in whosmat(path)]


@pytest.mark.parametrize("case", ["mcap", "mcap-json"])
def test_the_two_clocks_of_a_message_are_told_apart(case: str, tmp_path: Path) -> None:
    late = np.random.default_rng(5).integers(1, 900_000, 50)  # ns, from when it was sent to when it was written
    data = log_files.table(50)
    writer = {"mcap": log_files.write_mcap, "mcap-json": log_files.write_mcap_json}[case]
    writer(tmp_path / "log.mcap", data, late)
    signal = '[sensors.angle]\ncolumn = "/rig.angle"\nunit = "rad"\n'
    written, sent = (
        hw.read(tmp_path / "log.mcap", hw.parse_columns(f'[time]\ncolumn = "/rig.{clock}"\nunit = "ns"\n{signal}')).time
        for clock in ("log_time", "publish_time")
    )
    np.testing.assert_allclose(written - sent, 1e-9 * late, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("case", CASES)
def test_it_is_recognised_by_its_beginning_whatever_its_name(case: str, tmp_path: Path) -> None:
    path = log_files.write(case, tmp_path, log_files.table(50))
    other = path.rename(tmp_path / "run17")
    assert formats.recognise(other) == log_files.WRITERS[case][0]


@pytest.mark.parametrize("case", CASES)
def test_the_draft_of_a_map_reads_back_and_reads_the_log(case: str, tmp_path: Path) -> None:
    data = log_files.table(300)
    path = log_files.write(case, tmp_path, data)
    text = hw.draft_text(hw.survey(path))
    draft = hw.parse_columns(text)
    assert draft == hw.survey(path).draft()
    log = hw.read(path, draft)
    np.testing.assert_allclose(log.channel("coordinates", "angle").values, data["angle"], rtol=1e-15)
    np.testing.assert_array_equal(log.channel("inputs", "torque").values, data["torque"].astype(float))
    np.testing.assert_allclose(np.diff(log.time), 1e-3, rtol=1e-9)


@pytest.mark.parametrize("case", log_files.WRITERS)
def test_a_survey_tells_the_extent_of_what_a_file_holds(case: str, tmp_path: Path) -> None:
    data = log_files.table(300)
    data["t"] = 2.0 + data["t"] + 1e-3 * (np.arange(300) >= 200)  # one sample is lost
    data["angle"][7] = 0.5 if case == "mcap-json" else np.nan  # which JSON cannot say
    group = max(hw.survey(log_files.write(case, tmp_path, data)).groups, key=lambda each: len(each.columns))
    assert (group.rows, group.lost) == (300, 1)
    assert [group.duration, group.step, group.longest] == pytest.approx([0.3, 1e-3, 2e-3], rel=1e-6)
    before, clock = log_files.WRITERS[case][3:]
    for name, values in data.items():
        (told,) = (each for each in group.columns if each.column.name == (clock if name == "t" else before + name))
        assert [told.low, told.high] == pytest.approx([np.nanmin(values), np.nanmax(values)], rel=1e-6)
        assert told.missing == np.isnan(values).sum()


def test_every_format_has_a_writer_here() -> None:
    assert set(formats.names()) == {case[0] for case in log_files.WRITERS.values()}


def test_a_new_format_is_one_new_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "counts.py").write_text(
        '"""Whole numbers, one a line."""\n'
        "import msgspec, numpy as np\n"
        "from crossbody.hw.formats import Column, Group\n"
        "SUFFIXES = ('.counts',)\n"
        "class Options(msgspec.Struct, forbid_unknown_fields=True):\n    every: int = 1\n"
        "def recognises(path, head):\n    return head.startswith(b'COUNTS\\x00')\n"
        "class Counts:\n"
        "    library, refused = 'none', {}\n"
        "    def __init__(self, path, options):\n"
        "        self.values = np.array(path.read_bytes().split()[1:], dtype=np.int64)[:: options.every]\n"
        "        self.groups = (Group(name='', rows=len(self.values), columns=(Column(name='n', type='int64'),)),)\n"
        "    def blocks(self, group, columns):\n        yield {'n': self.values}\n"
        "    def close(self):\n        pass\n"
        "def open_log(path, options):\n    return Counts(path, options)\n"
    )
    monkeypatch.setattr(formats, "__path__", [*formats.__path__, str(tmp_path)])
    log_path = tmp_path / "run"
    log_path.write_bytes(b"COUNTS\x00\n1\n2\n5\n9\n")
    columns = 'options = {every = 2}\n[time]\nsample_time = 0.5\n[sensors.n]\ncolumn = "n"\nunit = "mm"\n'
    log = hw.read(log_path, hw.parse_columns(columns))
    assert "counts" in formats.names()
    np.testing.assert_array_equal(log.channel("sensors", "n").values, [0.001, 0.005])
    np.testing.assert_array_equal(log.time, [0.0, 0.5])
    sys.modules.pop("crossbody.hw.formats.counts")


PACKAGES = {
    "mat73": "h5py", "hdf5": "h5py", "mcap": "mcap", "ros1": "rosbags", "ros2": "rosbags", "mdf": "asammdf",
    "tdms": "nptdms",
}  # fmt: skip


@pytest.mark.parametrize("case", PACKAGES)
def test_an_absent_package_names_the_extra(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = log_files.write(case, tmp_path, log_files.table(20))
    for name in [name for name in sys.modules if name.partition(".")[0] in (PACKAGES[case], "mcap_ros2")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, PACKAGES[case], None)
    monkeypatch.setitem(sys.modules, "mcap_ros2", None)
    with pytest.raises(FormatUnavailable, match=r"crossbody\[logs\]"):
        hw.read(path, map_of(case))


def test_reading_imports_only_the_library_of_its_format(tmp_path: Path) -> None:
    import subprocess

    log_files.write("csv", tmp_path, log_files.table(20))
    (tmp_path / "map.toml").write_text(hw.dump_columns(map_of("csv")))
    code = (
        "import sys\nfrom crossbody import hw\n"
        f"hw.read({str(tmp_path / 'log.csv')!r}, {str(tmp_path / 'map.toml')!r})\n"
        "found = [m for m in ('h5py', 'mcap', 'rosbags', 'asammdf', 'nptdms') if m in sys.modules]\n"
        "assert not found, found\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("case", CASES)
def test_a_column_that_is_not_there_is_named_with_its_neighbours(case: str, tmp_path: Path) -> None:
    path = log_files.write(case, tmp_path, log_files.table(20))
    before = log_files.WRITERS[case][3]
    columns = hw.parse_columns(f'[time]\nsample_time = 1e-3\n[sensors.a]\ncolumn = "{before}angel"\nunit = "rad"\n')
    with pytest.raises(LogFormatError, match="Did you mean") as told:
        hw.read(path, columns)
    assert f"{before}angle" in str(told.value)


def test_a_format_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    path = log_files.write("csv", tmp_path, log_files.table(20))
    text = 'format = "csw"\n[time]\nsample_time = 1e-3\n[sensors.a]\ncolumn = "angle"\nunit = "rad"\n'
    with pytest.raises(UnknownName, match="Did you mean 'csv'"):
        hw.read(path, hw.parse_columns(text))


def write_two_rates(path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    fast, slow = np.arange(100) * 1e-3, 0.0105 + np.arange(8) * 1e-2
    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                ChannelObject("arm", "t", fast), ChannelObject("arm", "q", np.sin(fast)),
                ChannelObject("drive", "t", slow), ChannelObject("drive", "u", 2.0 * slow),
            ]
        )  # fmt: skip


TWO_RATES = """join = "{join}"
[time]
column = "arm/t"
[sensors.q]
column = "arm/q"
unit = "1"
[sensors.u]
column = "drive/u"
unit = "N m"
time = "drive/t"
"""


@pytest.mark.parametrize("how", ["hold", "linear"])
def test_signals_with_times_of_their_own_are_joined_as_asked(how: str, tmp_path: Path) -> None:
    pytest.importorskip("nptdms")
    write_two_rates(tmp_path / "log.tdms")
    if how == "linear":
        with pytest.raises(LogFormatError, match="not a finite number"):  # nothing is extrapolated
            hw.read(tmp_path / "log.tdms", hw.parse_columns(TWO_RATES.format(join=how)))
        return
    log = hw.read(tmp_path / "log.tdms", hw.parse_columns(TWO_RATES.format(join=how)))
    assert log.time[0] == pytest.approx(0.011)
    assert [(r.name, r.rows) for r in log.provenance.repairs] == [("trim", 11)]
    held = 2.0 * (0.0105 + 1e-2 * np.minimum(np.floor((log.time - 0.0105) / 1e-2), 7))
    np.testing.assert_allclose(log.channel("sensors", "u").values, held, rtol=1e-12)
    assert log.provenance.join == "hold"


def test_signals_with_other_times_are_not_mixed_unasked(tmp_path: Path) -> None:
    pytest.importorskip("nptdms")
    write_two_rates(tmp_path / "log.tdms")
    with pytest.raises(LogFormatError, match="other times") as told:
        hw.read(tmp_path / "log.tdms", hw.parse_columns(TWO_RATES.format(join="exact")))
    assert told.value.row == 0
    without = hw.parse_columns(TWO_RATES.format(join="hold").replace('time = "drive/t"\n', ""))
    with pytest.raises(LogFormatError, match="name its column of times"):
        hw.read(tmp_path / "log.tdms", without)


def test_vectors_are_columns_by_index(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    values = np.random.default_rng(1).standard_normal((50, 3))
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["rig/force"] = values
        file["rig/force"].attrs["unit"] = "kN"
    columns = '[time]\nsample_time = 1e-3\n[sensors.fz]\ncolumn = "rig/force[2]"\n'
    log = hw.read(tmp_path / "log.h5", hw.parse_columns(columns))
    np.testing.assert_array_equal(log.channel("sensors", "fz").values, values[:, 2] * 1000.0)
    assert log.channel("sensors", "fz").unit == "N"


def test_ros_stamps_count_exactly(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = ("builtin_interfaces/msg/Time", "std_msgs/msg/Header", "sensor_msgs/msg/JointState")
    time_, header, state = (store.types[kind] for kind in kinds)
    start, none = 1_700_000_000, np.zeros(0)
    with Writer(tmp_path / "bag", version=9) as bag:
        link = bag.add_connection("/joints", state.__msgtype__, typestore=store)
        for i in range(30):
            stamp = header(stamp=time_(sec=start, nanosec=880_001 * i), frame_id="")
            message: Any = state(header=stamp, name=["a"], position=np.array([0.1 * i]), velocity=none, effort=none)
            bag.write(link, start * 10**9 + i, store.serialize_cdr(message, state.__msgtype__))
    columns = '[time]\ncolumn = "/joints.header.stamp"\n[coordinates.a]\ncolumn = "/joints.position[0]"\nunit = "rad"\n'
    log = hw.read(tmp_path / "bag", hw.parse_columns(columns))
    np.testing.assert_array_equal(log.time, np.arange(30) * 880_001 / 1e9)  # 1.7e18 ns is no float64
    assert log.provenance.origin == start * 10**9


@pytest.mark.parametrize(
    ("header", "options"),
    [("t;angle [deg];u", ""), ("t\tangle [deg]\tu", ""), ("# rig 7\nt|angle [deg]|u", "options = {skip = 1}")],
)
def test_text_tables_find_their_delimiter_and_units(header: str, options: str, tmp_path: Path) -> None:
    delimiter = next(c for c in ";\t|" if c in header)
    rows = "".join(delimiter.join((f"{i / 1000}", f"{90 * i}", "1")) + "\r\n" for i in range(5))
    (tmp_path / "log.txt").write_bytes(f"{header}\r\n{rows}".encode("utf-8-sig"))
    columns = hw.parse_columns(f'{options}\n[time]\ncolumn = "t"\n[sensors.a]\ncolumn = "angle [deg]"\n')
    log = hw.read(tmp_path / "log.txt", columns)
    np.testing.assert_allclose(log.channel("sensors", "a").values, np.arange(5) * np.pi / 2, rtol=1e-15)


def test_a_unit_of_the_file_that_contradicts_the_map_is_refused(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t [s],angle [deg]\n0,1\n0.1,2\n")
    text = '[time]\ncolumn = "t [s]"\n[sensors.a]\ncolumn = "angle [deg]"\nunit = "rad"\n'
    with pytest.raises(LogFormatError, match="one of them is wrong"):
        hw.read(tmp_path / "log.csv", hw.parse_columns(text))
