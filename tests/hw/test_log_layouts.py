"""A text table of any layout, under any map, against the numbers that were written and the map's own formula."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np
import pytest

from crossbody import hw
from crossbody.cases import LogFormatError
from crossbody.hw.formats import csv
from crossbody.hw.reading.survey import draft_text

SEEDS = range(25)
FACTORS = {"deg": np.pi / 180.0, "mm": 1e-3, "rpm": np.pi / 30.0, "mN m": 1e-3, "1": 1.0}
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}


@dataclass
class Drawn:
    """A table, the map that reads it, and what must come out.

    Attributes:
        random: what decides it.
        names, units, cells: of the columns, in their order.
        columns: the map.
        time (n,): s.
        values: role.name -> (n,), SI.
        part (n,): number of the run of each row.
    """

    random: np.random.Generator
    names: list[str] = field(default_factory=list)
    units: list[str] = field(default_factory=list)
    cells: list[np.ndarray] = field(default_factory=list)
    columns: hw.Columns = field(default_factory=lambda: hw.Columns(time=hw.Time()))
    time: np.ndarray = field(default_factory=lambda: np.zeros(0))
    values: dict[str, np.ndarray] = field(default_factory=dict)
    part: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def add(self, name: str, cells: np.ndarray, unit: str = "") -> str:
        """One more column; its name in the file."""
        self.names.append(name)
        self.units.append(unit)
        self.cells.append(cells)
        return name


def drawn(seed: int) -> Drawn:
    found = Drawn(np.random.default_rng(seed))
    random, rows = found.random, int(found.random.integers(40, 500))
    runs = int(random.integers(2, 5)) if random.random() < 0.4 else 1
    found.part = np.sort(random.choice([3, 4, 8, 11][:runs], rows)).astype(float)
    time = _clock(found, rows)
    sensors = {}
    for i in range(random.integers(1, 4)):
        raw, unit = random.normal(size=rows), str(random.choice(list(FACTORS)))
        scale, offset = float(random.choice([1.0, -0.5, 40.0])), float(random.choice([0.0, 3.0]))
        sign, told = int(random.choice([-1, 1])), random.random() < 0.5
        name = found.add(f"s{i}", raw, "" if told or unit == "1" else unit)
        told |= unit == "1"
        sensors[name] = hw.Signal(
            column=name,
            unit=unit if told else None,
            scale=scale,
            offset=offset,
            sign=sign,
            delay=float(random.choice([0.0, 0.5])),
        )
        found.values[name] = sign * (raw * scale + offset) * FACTORS[unit]
    for i in range(random.choice([0, 3, 80])):
        found.add(f"other{i}", random.integers(-9, 9, rows).astype(float))
    if runs > 1:
        found.add("run", found.part)
    found.columns = hw.Columns(time=time, sensors=sensors, part="run" if runs > 1 else "")
    return found


def _clock(found: Drawn, rows: int) -> hw.Time:
    """Times of a column with a unit, of ticks, of a count, or of none: rows are counted then, in each run anew."""
    random, step, first = found.random, 10.0 ** found.random.uniform(-3.0, -1.0), float(found.random.integers(0, 9))
    k = np.cumsum(1 + (random.random(rows) < 0.1)).astype(float)
    match random.choice(["map", "file", "ticks", "sample", "none"]):
        case "none":
            found.time = step * np.concatenate([np.arange(np.sum(found.part == p)) for p in np.unique(found.part)])
            return hw.Time(sample_time=step)
        case "sample":
            found.time = step * (first + k)
            return hw.Time(column=found.add("k", first + k), unit="sample", sample_time=step)
        case "ticks":
            found.time = step * (first + k)
            return hw.Time(column=found.add("k", 8.0 * (first + k)), scale=step / 8.0, unit="s")
        case where:
            unit = str(random.choice(list(SECONDS)))
            found.time = step * (first + k)
            column = found.add("t", found.time / SECONDS[unit], unit if where == "file" else "")
            return hw.Time(column=column, unit=unit if where == "map" else None)


def written(path: Path, found: Drawn) -> hw.Columns:
    """Write the table in a layout of its own; the map, which tells it."""
    random = found.random
    delimiter, encoding = (
        str(random.choice(list(",;\t|"))),
        str(random.choice(["utf-8", "utf-16", "utf-16-le", "latin-1"])),
    )
    decimal = "," if delimiter != "," and random.random() < 0.5 else "."
    head = bool(random.random() < 0.8)
    below = random.random() < 0.5
    skip = int(random.integers(0, 3))
    lines = ["of a rig"] * skip
    names = found.names if below else [f"{n} [{u}]" if u else n for n, u in zip(found.names, found.units, strict=True)]
    shown = dict(zip(found.names, names if head else [f"c{i}" for i in range(len(names))], strict=True))
    if not head and any(found.units):
        below = True
    lines += [delimiter.join(names)] * head
    lines += [delimiter.join(f"[{u}]" if u else "" for u in found.units)] * below
    table = np.column_stack(found.cells)
    lines += [delimiter.join(repr(float(x)).replace(".", decimal) for x in row) for row in table]
    path.write_bytes("".join(line + "\n" for line in lines).encode(encoding))
    columns = found.columns
    options = {"skip": skip, "header": head, "units": below, "decimal": decimal}
    if random.random() < 0.5 or skip:
        options["delimiter"] = delimiter
    if encoding == "latin-1":
        options["encoding"] = encoding
    renamed = {n: msgspec.structs.replace(s, column=shown[s.column]) for n, s in columns.sensors.items()}
    time = msgspec.structs.replace(columns.time, column=shown.get(columns.time.column, ""))
    return msgspec.structs.replace(
        columns, options=options, sensors=renamed, time=time, part=shown.get(columns.part, ""), format="csv"
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_written_is_read_in_si_whatever_the_layout(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whole and block by block, with the runs of a file apart."""
    monkeypatch.setattr(csv, "BLOCK_BYTES", 1 << 13)
    monkeypatch.setattr(csv, "BLOCK_LINES", 2)
    found, path = drawn(seed), tmp_path / "log.csv"
    columns = written(path, found)
    runs = np.unique(found.part)
    if columns.part:
        assert hw.parts(path, columns) == tuple(runs)
    for run in runs:
        here = found.part == run if len(runs) > 1 else np.ones(len(found.part), bool)
        part = int(run) if columns.part else None
        log = hw.read(path, columns, part=part)
        with hw.scan(path, columns, part) as scan:
            blocks = list(scan.rows())
        np.testing.assert_array_equal(np.concatenate([b.rows for b in blocks]), np.flatnonzero(here))
        for time in (log.time, np.concatenate([b.time for b in blocks])):
            np.testing.assert_allclose(time, found.time[here], rtol=1e-12, atol=1e-12)
        for i, (name, values) in enumerate(found.values.items()):
            assert log.channel("sensors", name).delay == columns.sensors[name].delay
            for read in (log.channel("sensors", name).values, np.concatenate([b.values[i] for b in blocks])):
                np.testing.assert_allclose(read, values[here], rtol=1e-12, atol=1e-15)
        assert log.provenance.rows == np.count_nonzero(here)


@pytest.mark.parametrize("clock", [True, False])
def test_a_draft_reads_what_was_surveyed(clock: bool, tmp_path: Path) -> None:
    """All columns but the times; where there are none, rows are counted and the draft says that it does not know."""
    random, names = np.random.default_rng(3), ["angle [zork]", "torque", "rate", "force"]
    data = random.normal(size=(50, 4))
    t = np.arange(50) * 0.25
    table = np.column_stack([t, data]) if clock else data
    head = ",".join(["time"] * clock + names)
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=head, comments="")
    found = hw.survey(tmp_path / "log.csv")
    (tmp_path / "map.toml").write_text(draft_text(found))
    columns = hw.load_columns(tmp_path / "map.toml")
    log = hw.read(tmp_path / "log.csv", columns)
    np.testing.assert_allclose(log.time, t if clock else np.arange(50.0))
    np.testing.assert_allclose(
        [log.channel(role.value, name).values for role, name, _ in columns.signals()],
        [data[:, names.index(signal.column)] for _, _, signal in columns.signals()],
    )
    assert len(list(columns.signals())) == 4
    assert ("set the sample time" in draft_text(found)) == (not clock)
    assert np.isnan(found.groups[0].duration) == np.isnan(found.groups[0].step) == (not clock)


def test_times_in_pure_numbers_are_refused(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,q\n[1],[rad]\n" + "".join(f"{k},{k}\n" for k in range(20)))
    text = 'options = {units = true}\n[time]\ncolumn = "t"\n[sensors.q]\ncolumn = "q"\n'
    with pytest.raises(LogFormatError, match=r"measures \[1\], not time"):
        hw.read(tmp_path / "log.csv", hw.parse_columns(text))


@pytest.mark.parametrize("rate", [0.4, 2.3])
@pytest.mark.parametrize("how", ["hold", "linear"])
def test_an_angle_that_joins_a_log_from_other_rows_goes_on_over_a_turn_or_is_refused(
    how: str, rate: float, tmp_path: Path
) -> None:
    """Between the two sides of a wrap nothing lies: a straight line between them passes angles that never were."""
    from scipy.io import savemat

    t = np.arange(1000) * 1e-3
    own = np.linspace(t[0] - 2e-3, t[-1] + 3e-3, int(rate * len(t)))
    way = 0.3 + 9.0 * np.sin(3.0 * own)
    wrapped = np.mod(way + np.pi, 2.0 * np.pi) - np.pi
    savemat(tmp_path / "log.mat", {"t": t, "u": np.cos(t), "own": own, "angle": wrapped})
    columns = hw.parse_columns(
        f'join = "{how}"\n[time]\ncolumn = "t"\n[sensors.u]\ncolumn = "u"\nunit = "1"\n'
        '[coordinates.q]\ncolumn = "angle"\nunit = "rad"\ntime = "own"\n'
    )
    with pytest.raises(LogFormatError, match="wraps at a turn"):
        hw.read(tmp_path / "log.mat", columns)
    log = hw.read(tmp_path / "log.mat", columns, repair=("unwrap",))
    last = np.searchsorted(own, t, side="right") - 1
    wanted = way[last] if how == "hold" else np.interp(t, own, way)
    np.testing.assert_allclose(log.channel("coordinates", "q").values, wanted, atol=1e-9)
    (told,) = log.provenance.repairs
    wraps = np.flatnonzero(np.abs(np.diff(wrapped)) > np.pi) + 1
    assert (told.name, told.rows, told.row, told.t) == ("unwrap", len(wraps), wraps[0], pytest.approx(own[wraps[0]]))


@pytest.mark.parametrize("begins", [(0.3, 0.1, 0.2), (0.1, 0.3, 0.2), (0.1, 0.2, 0.3)])
def test_a_log_begins_where_the_last_of_its_clocks_does(begins: tuple[float, ...], tmp_path: Path) -> None:
    from scipy.io import savemat

    t = np.arange(100) * 0.01
    clocks = {f"t{i}": begin + np.arange(80) * 0.02 for i, begin in enumerate(begins)}
    savemat(tmp_path / "log.mat", {"t": t, "u": np.cos(t)} | clocks | {f"x{i}": clocks[f"t{i}"] for i in range(3)})
    signals = "".join(f'[sensors.x{i}]\ncolumn = "x{i}"\nunit = "s"\ntime = "t{i}"\n' for i in range(3))
    columns = f'join = "linear"\n[time]\ncolumn = "t"\n[sensors.u]\ncolumn = "u"\nunit = "1"\n{signals}'
    log = hw.read(tmp_path / "log.mat", hw.parse_columns(columns))
    assert log.time == pytest.approx(t[t > 0.299])
    for name, values in (("u", np.cos(log.time)), *((f"x{i}", log.time) for i in range(3))):
        np.testing.assert_allclose(log.channel("sensors", name).values, values, atol=1e-12)
    assert [(one.name, one.rows) for one in log.provenance.repairs] == [("trim", 30)]


def test_what_a_map_does_not_say_changes_nothing(tmp_path: Path) -> None:
    t, x = np.arange(50) * 0.125, np.random.default_rng(0).normal(size=50)
    np.savetxt(tmp_path / "log.csv", np.column_stack([t, x]), "%.17g", delimiter=",", header="t,x", comments="")
    columns = hw.parse_columns('[time]\ncolumn = "t"\n[sensors.x]\ncolumn = "x"\nunit = "rad"\n')
    log = hw.read(tmp_path / "log.csv", columns)
    channel = log.channel("sensors", "x")
    assert (log.time.tobytes(), channel.values.tobytes()) == (t.tobytes(), x.tobytes())
    assert log.times("sensors", "x").tobytes() == t.tobytes()
    assert (channel.delay, channel.range, log.sample_time) == (0.0, None, 0.125)
    assert (log.provenance.repairs, log.provenance.origin, log.provenance.part, log.filled.size) == ((), 0, None, 0)


@pytest.mark.parametrize("timed", [True, False])
def test_a_draft_begins_with_the_rows_that_have_times_then_with_those_of_most_numbers(
    timed: bool, tmp_path: Path
) -> None:
    """What has times in another unit, or none, is left out; faults are told before what is doubtful."""
    from scipy.io import savemat

    few, many = ({f"{name}{n}": np.random.default_rng(n).normal(size=n) for name in ("a", "b")} for n in (30, 90))
    few["a30"][20] = np.nan
    if timed:
        few["t"] = np.arange(30) * 0.1 + 5.0 * (np.arange(30) >= 10)
    savemat(tmp_path / "log.mat", few | many)
    found = hw.survey(tmp_path / "log.mat")
    assert [(group.rows, len(group.columns)) for group in found.groups] == [(30, 2 + timed), (90, 2)]
    read = {signal.column for _, _, signal in found.draft().signals()}
    assert read == ({"a30", "b30"} if timed else {"a90", "b90"})
    told = [(finding.check, finding.fault, finding.row) for finding in found.findings]
    assert told == [("finite", True, 20), ("dropped", False, 10)][: 1 + timed]
