"""Column maps and units: what is written is what is read, and what is wrong is named by its path."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from log_files import STEADY

from crossbody import hw
from crossbody.cases import ColumnMapError, InvalidValue, LogFormatError
from crossbody.hw.reading.stream import Rows, join
from crossbody.hw.reading.units import to_si

GOOD = """[time]
column = "t"
unit = "ms"
sample_time = 8.8e-4
[coordinates.q11]
column = "enc1"
unit = "deg"
sign = -1
delay = 8.8e-4
range = [-90, 90]
"""


@pytest.mark.parametrize(
    ("change", "key", "says"),
    [
        (("unit = \"deg\"", "units = \"deg\""), "$.coordinates.q11", "units"),
        (("[time]\n", "colour = 1\n[time]\n"), "$", "colour"),
        (("column = \"t\"", "column = 7"), "$.time.column", "int"),
        (("sign = -1", "sign = 2"), "$.coordinates.q11.sign", "2"),
        (("sign = -1", "scale = 'big'"), "$.coordinates.q11.scale", "str"),
        (("sign = -1", "scale = 0.0"), "$.coordinates.q11.scale", "not 0"),
        (("sign = -1", "offset = nan"), "$.coordinates.q11.offset", "finite"),
        (("delay = 8.8e-4", "delay = inf"), "$.coordinates.q11.delay", "finite"),
        (("range = [-90, 90]", "range = [90, -90]"), "$.coordinates.q11.range", "below"),
        (("range = [-90, 90]", "range = [1, 2, 3]"), "$.coordinates.q11.range", "length"),
        (("unit = \"deg\"", "unit = \"dgree\""), "$.coordinates.q11.unit", "not a unit"),
        (("unit = \"ms\"", "unit = \"mm\""), "$.time.unit", "must measure [s]"),
        (("sample_time = 8.8e-4", "sample_time = 0"), "$.time.sample_time", "above 0"),
        (("unit = \"ms\"\nsample_time = 8.8e-4", "unit = \"sample\""), "$.time.sample_time", "missing"),
        (("[coordinates.q11]", "[coordinates]\nq11 = 5\n[sensors.x]"), "$.coordinates.q11", "int"),
        (("[time]\n", "join = \"nearest\"\n[time]\n"), "$.join", "nearest"),
        (("[time]", "[tme]"), "$", "tme"),
        (("[coordinates.q11]", "[coordinates.q11"), "$", "TOML"),
        (("column = \"enc1\"\n", ""), "$.coordinates.q11", "column"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_by_its_path(change: tuple[str, str], key: str, says: str) -> None:
    assert change[0] in GOOD
    with pytest.raises(ColumnMapError) as told:
        hw.parse_columns(GOOD.replace(*change), "rig.toml")
    assert told.value.key == key
    assert says in str(told.value)
    assert str(told.value).startswith("rig.toml: " if key == "$" else f"rig.toml: {key}: ")
    assert "$: " not in str(told.value)  # the whole file has no path inside it


def test_a_map_without_signals_is_refused() -> None:
    with pytest.raises(ColumnMapError, match="has no signal"):
        hw.parse_columns('[time]\ncolumn = "t"\n')


@pytest.mark.parametrize("name", ["nowhere.toml", "multiarm_doubel", "."])
def test_an_absent_map_lists_those_that_come_along(name: str) -> None:
    with pytest.raises(ColumnMapError, match="multiarm_double"):
        hw.load_columns(name)


@pytest.mark.parametrize("name", hw.maps())
def test_maps_that_come_along_are_maps(name: str) -> None:
    columns = hw.load_columns(name)
    assert columns.about
    assert hw.parse_columns(hw.dump_columns(columns)) == columns


def test_options_of_a_format_are_its_own(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,enc1\n0,1\n1,2\n")
    columns = hw.parse_columns("options = {delimeter = ';'}\n" + GOOD)
    with pytest.raises(ColumnMapError, match="delimeter") as told:
        hw.read(tmp_path / "log.csv", columns)
    assert told.value.key == "$.options"


@pytest.mark.parametrize("option", ["decimal = '1'", "decimal = ''", "delimiter = 'ab'", "skip = -1"])
def test_a_layout_that_no_table_has_is_refused_with_its_key(option: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,enc1\n0,1\n1,2\n")
    with pytest.raises(ColumnMapError) as told:
        hw.read(tmp_path / "log.csv", hw.parse_columns(f"options = {{{option}}}\n" + GOOD))
    assert told.value.key == f"$.options.{option.split()[0]}"


finite = st.floats(allow_nan=False, allow_infinity=False)
signals = st.builds(
    hw.Signal,
    column=st.text(min_size=1),
    unit=st.sampled_from([None, "deg", "N m", "1", "mm/s"]),
    scale=finite.filter(bool),
    offset=finite,
    sign=st.sampled_from([1, -1]),
    delay=finite,
    range=st.none() | st.tuples(finite, finite).filter(lambda r: r[0] < r[1]),
)
names = st.text(min_size=1, max_size=64)


@STEADY
@given(st.dictionaries(names, signals, min_size=1, max_size=3), st.text(), st.floats(1e-9, 1e3))
def test_what_is_written_is_what_is_read(found: dict[str, hw.Signal], about: str, step: float) -> None:
    columns = hw.Columns(about=about, time=hw.Time(column="t", sample_time=step), coordinates=found, sensors=found)
    assert hw.parse_columns(hw.dump_columns(columns)) == columns


@STEADY
@given(st.text(max_size=60))
def test_any_text_is_a_unit_or_a_sentence(text: str) -> None:
    with contextlib.suppress(InvalidValue):
        assert np.isfinite(to_si(text).factor)


ALPHABET = ["m", "s", "rad", "kg", "N", "q", "1", "9", "^", "**", "*", "/", "·", "(", ")", " ", "²", "-", "!", "%"]


@STEADY
@given(st.lists(st.sampled_from(ALPHABET), max_size=45).map("".join))
def test_any_text_of_unit_signs_is_a_unit_or_a_sentence(text: str) -> None:
    with contextlib.suppress(InvalidValue):
        assert 0.0 < to_si(text).factor < np.inf


BOMBS = [
    "m^9^9^9", "m**9**9**9", "(((m^9)^9)^9)^9", "((Gm^9)^9)", "a" * 26 + "!", "a" * 39 + "!", "m" * 10**6, "m^99999999",
    " " * 10**6 + "!", "(" * 40, "(" * 20 + "m" + ")" * 20, "m" + "^ " * 19, "m^1e9", "m^(9^9^9)", "m//m", "1" * 40,
]  # fmt: skip


@pytest.mark.parametrize("text", BOMBS, ids=range(len(BOMBS)))
def test_a_unit_that_would_never_end_is_refused_at_once(text: str) -> None:
    to_si("m")  # pint's registry is there before the clock runs
    before = time.process_time()
    with pytest.raises(InvalidValue, match="is not a unit"):
        to_si(text)
    assert time.process_time() - before < 1.0


@pytest.mark.parametrize(
    ("unit", "si", "value"),
    [
        ("deg", "rad", np.pi / 180), ("rpm", "rad/s", np.pi / 30), ("turn", "rad", 2 * np.pi), ("mN m", "N m", 1e-3),
        ("Nm", "N m", 1.0), ("N·m", "N m", 1.0), ("m/s^2", "m/s^2", 1.0), ("g", "kg", 1e-3), ("Hz", "1/s", 1.0),
        ("%", "1", 0.01), ("", "1", 1.0), ("µs", "s", 1e-6), ("degC", "K", 274.15), ("kN", "N", 1e3),
        ("deg/s", "rad/s", np.pi / 180), ("inch", "m", 0.0254), ("mNm", "N m", 1e-3), ("kNm", "N m", 1e3),
        ("Ns", "N s", 1.0), ("mNm*s", to_si("N m s").si, 1e-3), ("Nms", to_si("N m s").si, 1.0),
    ],
)  # fmt: skip
def test_units(unit: str, si: str, value: float) -> None:
    found = to_si(unit)
    assert found.si == si
    assert found.apply(np.array([1.0]))[0] == pytest.approx(value, rel=1e-15)
    assert to_si(found.si).si == si
    assert to_si(found.si).factor == 1.0


@pytest.mark.parametrize("unit", ["dB", "dBm", "Np", "decade", "octave", "dBu"])
def test_a_logarithm_is_no_factor_and_shift(unit: str) -> None:
    with pytest.raises(InvalidValue, match="is not a unit"):
        to_si(unit)


def test_whole_fractions_of_a_unit_round_once() -> None:
    ms = np.arange(100_000, dtype=np.float64)
    np.testing.assert_array_equal(to_si("ms").apply(ms), ms / 1000.0)


def test_a_value_is_the_sign_times_scale_and_offset(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,enc1\n0,10\n0.88,20\n1.76,30\n")
    text = GOOD.replace("range", "scale = 0.5\noffset = 2\nrange")
    log = hw.read(tmp_path / "log.csv", hw.parse_columns(text))
    channel = log.channel("coordinates", "q11")
    np.testing.assert_allclose(channel.values, -np.deg2rad([7.0, 12.0, 17.0]), rtol=1e-15)
    assert channel.range == pytest.approx((-np.pi / 2, np.pi / 2))
    np.testing.assert_allclose(log.times("coordinates", "q11"), [-8.8e-4, 0.0, 8.8e-4], atol=1e-18)


@pytest.mark.parametrize(
    ("role", "unit", "says"),
    [("coordinates", "N", "a coordinate is in"), ("velocities", "rad", "rad/s"), ("velocities", "m/s", "rad/s")],
)
def test_a_unit_that_no_such_signal_has_is_refused(role: str, unit: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,enc1,w\n0,10,1\n0.88,20,1\n")
    text = f'{GOOD}\n[{role}.{"q11" if role == "velocities" else "z"}]\ncolumn = "w"\nunit = "{unit}"\n'
    with pytest.raises(ValueError, match=says):
        hw.read(tmp_path / "log.csv", hw.parse_columns(text))


@pytest.mark.parametrize(("unit", "step"), [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("min", 60.0)])
def test_times_are_seconds_whatever_their_unit(unit: str, step: float, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,enc1\n" + "".join(f"{k},{k}\n" for k in range(20)))
    text = f'[time]\ncolumn = "t"\nunit = "{unit}"\n[sensors.a]\ncolumn = "enc1"\nunit = "rad"\n'
    np.testing.assert_allclose(hw.read(tmp_path / "log.csv", hw.parse_columns(text)).time, step * np.arange(20))


@pytest.mark.parametrize("unit", ["m", "rad", "N m", "1/s", "deg", "m/s"])
def test_times_in_what_is_no_unit_of_time_are_refused(unit: str, tmp_path: Path) -> None:
    """Said by the map or by the file."""
    for column, told in (("t", f'unit = "{unit}"\n'), (f"t [{unit}]", "")):
        (tmp_path / "log.csv").write_text(f"{column},enc1\n" + "".join(f"{k},{k}\n" for k in range(20)))
        text = f'[time]\ncolumn = "{column}"\n{told}[sensors.a]\ncolumn = "enc1"\nunit = "rad"\n'
        with pytest.raises((LogFormatError, ColumnMapError), match="time"):
            hw.read(tmp_path / "log.csv", hw.parse_columns(text))


@pytest.mark.parametrize("seed", range(30))
def test_joined_signals_are_the_last_ones_or_lie_between_neighbours(seed: int) -> None:
    """On a grid of times, so that some of both are equal: a command counts from its own instant on."""
    rng = np.random.default_rng(seed)
    instants, own = (np.sort(rng.choice(40, size, replace=False)) * 0.25 for size in rng.integers(2, 20, 2))
    values = rng.normal(size=len(own))
    other = Rows(rows=np.arange(len(own)), time=own, values=(values,))
    (held,), lead = join(Path("log"), "hold", instants, other, "x")
    (between,), _ = join(Path("log"), "linear", instants, other, "x")
    assert lead == sum(t < own[0] for t in instants)
    for t, hold, line in zip(instants.tolist(), held.tolist(), between.tolist(), strict=True):
        known = [k for k in range(len(own)) if own[k] <= t]
        assert hold == values[known[-1]] if known else np.isnan(hold)
        if not known or t > own[-1]:
            assert np.isnan(line)
            continue
        a, b = known[-1], min(known[-1] + 1, len(own) - 1)
        share = 0.0 if a == b else (t - own[a]) / (own[b] - own[a])
        assert line == pytest.approx(values[a] + share * (values[b] - values[a]), abs=1e-12)
