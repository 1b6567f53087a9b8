"""Checks tell the row and time of the first offence, wherever blocks are cut; repairs do what they say and no more."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from log_files import STEADY

from crossbody import hw
from crossbody.cases import LogFormatError, SceneError, UnknownName
from crossbody.hw.checks import smooth
from crossbody.hw.checks.clock import ClockCheck
from crossbody.hw.checks.rates import RateCheck
from crossbody.hw.checks.values import ValueCheck

STEP = 8.8e-4
COLUMNS = """[time]
column = "t"
sample_time = {step}
[coordinates.arm]
column = "q"
unit = "rad"
[inputs.motor]
column = "u"
unit = "N m"
"""


def parquet(path: Path, data: dict[str, np.ndarray]) -> Path:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table(data), path)
    return path


def motion(rows: int = 2000) -> dict[str, np.ndarray]:
    t = np.arange(rows) * STEP
    return {"t": t, "q": np.sin(5.0 * t), "u": np.cos(2.0 * t)}


def columns(step: float = STEP) -> hw.Columns:
    return hw.parse_columns(COLUMNS.format(step=step))


def blocks(check: Any, cuts: list[int], *arrays: np.ndarray) -> Any:
    """Show arrays to a check in pieces."""
    rows = np.arange(len(arrays[0]), dtype=np.int64)
    for part in np.split(np.arange(len(rows)), sorted(cuts)):
        check.see(rows[part], *(array[part] for array in arrays))
    return check


def told(check: Any) -> list[tuple[str, int, int]]:
    return [(f.check, f.row, f.count) for f in check.findings()]


cuts = st.lists(st.integers(0, 300), max_size=6)


@STEADY
@given(cuts, st.integers(1, 299), st.sampled_from(["nan", "back", "same", "gap", "late"]))
def test_a_broken_clock_is_found_at_its_row_wherever_blocks_are_cut(at: list[int], row: int, kind: str) -> None:
    t = np.arange(300) * STEP
    match kind:
        case "nan":
            t[row] = np.nan
        case "back":
            t[row:] -= 0.5 * STEP + STEP
        case "same":
            t[row:] = t[row - 1 : -1].copy()
        case "gap":
            t[row:] += 3.0 * STEP
        case "late":
            t[row:] += 0.3 * STEP
    check = {"nan": "time", "back": "time", "same": "time", "gap": "dropped", "late": "jitter"}[kind]
    found = {name: (r, n) for name, r, n in told(blocks(ClockCheck(STEP), at, t))}
    assert found[check] == (row, 1)
    assert set(found) <= {check, "drift"}


@STEADY
@given(cuts)
def test_clock_figures_do_not_depend_on_the_cuts(at: list[int]) -> None:
    random = np.random.default_rng(3)
    t = np.arange(300) * STEP * (1 + 40e-6) + 5e-6 * random.standard_normal(300)
    whole, cut = blocks(ClockCheck(STEP), [], t), blocks(ClockCheck(STEP), at, t)
    assert cut.jitter == pytest.approx(whole.jitter, rel=1e-6)
    assert cut.drift == pytest.approx(whole.drift, rel=1e-6)


def test_drift_and_jitter_are_those_of_the_clock() -> None:
    random = np.random.default_rng(4)
    t = np.arange(100_000) * STEP * (1 + 40e-6) + 5e-6 * random.standard_normal(100_000)
    check = blocks(ClockCheck(STEP), [30_000], t)
    assert check.drift == pytest.approx(40e-6, rel=1e-3)
    assert check.jitter == pytest.approx(5e-6, rel=2e-2)
    drift = next(f for f in check.findings() if f.check == "drift")
    assert drift.row == pytest.approx(1 / 40e-6, rel=2e-2)  # a whole sample off


def test_dropped_samples_are_counted() -> None:
    t = np.delete(np.arange(1000) * STEP, [100, 101, 500])
    (finding,) = blocks(ClockCheck(STEP), [100], t).findings()
    assert (finding.check, finding.row, finding.count, finding.fault) == ("dropped", 100, 2, False)
    assert finding.t == pytest.approx(102 * STEP)
    assert finding.text.startswith("3 samples")


@pytest.mark.parametrize(("step", "given", "told"), [(1e3, None, True), (50.0, None, False), (1e3, 1e3, False)])
def test_steps_of_minutes_are_doubted_unless_the_map_says_so(step: float, given: float | None, told: bool) -> None:
    """Microseconds whose map says seconds."""
    clock = ClockCheck(given)
    clock.see(np.arange(500), step * np.arange(500))
    assert [f.check for f in clock.findings()] == ["sample_time"] * told


@pytest.mark.parametrize("factor", [1e-3, 0.5, 2.0, 1e3])
def test_a_wrong_unit_of_time_is_a_fault(factor: float) -> None:
    (finding,) = blocks(ClockCheck(STEP), [1], np.arange(300) * STEP * factor).findings()
    assert (finding.check, finding.fault) == ("sample_time", True)


@STEADY
@given(cuts, st.integers(0, 299), st.sampled_from([np.nan, np.inf, 7.0, -7.0]))
def test_a_bad_value_is_found_at_its_row_wherever_blocks_are_cut(at: list[int], row: int, value: float) -> None:
    t = np.arange(300) * STEP
    x = np.sin(t)
    x[row] = value
    found = blocks(ValueCheck("sensors.x", "N", (-2.0, 2.0)), at, t, x).findings()
    wanted = {"finite", "range"} if np.isinf(value) else {"finite"} if np.isnan(value) else {"range"}
    assert {f.check for f in found} == wanted
    assert {(f.row, f.t, f.count, f.fault) for f in found} == {(row, t[row], 1, True)}


@STEADY
@given(cuts, st.integers(1, 150), st.integers(1, 150))
def test_runs_do_not_depend_on_the_cuts(at: list[int], start: int, length: int) -> None:
    t = np.arange(300) * STEP
    x = np.sin(700.0 * t) + 3.0
    x[start : start + length] = x[start]
    assert told(blocks(ValueCheck("x", "N"), at, t, x)) == told(blocks(ValueCheck("x", "N"), [], t, x))
    stuck = [(row, n) for name, row, n in told(blocks(ValueCheck("x", "N"), at, t, x)) if name == "stuck"]
    assert stuck == ([(start, length)] if length >= 100 else [])


@pytest.mark.parametrize("seed", range(60))
def test_findings_of_values_do_not_depend_on_the_cuts(seed: int) -> None:
    """Motions on a grid that stand still, jump and are cut off at ends, wherever: texts and all."""
    rng = np.random.default_rng(seed)
    grid, parts, at = 10.0 ** rng.uniform(-4.0, -2.0), [], 0.0
    for _ in range(rng.integers(2, 7)):
        count = int(rng.integers(20, 220))
        moved = np.cumsum(rng.integers(-6, 30, count)) if rng.random() < 0.6 else np.zeros(count)
        parts.append(at + moved)
        at = parts[-1][-1] + rng.choice([0.0, 7.0, 400.0])
    x = grid * np.concatenate(parts)
    x = np.clip(x, -np.inf, rng.choice([np.inf, float(np.quantile(x, 0.8))]))
    x[rng.integers(len(x), size=2)] = rng.choice([np.nan, x[0]], 2)
    t = np.arange(len(x)) * STEP
    whole = blocks(ValueCheck("x", "N"), [], t, x).findings()
    for _ in range(4):
        cut = blocks(ValueCheck("x", "N"), rng.integers(0, len(x), rng.integers(1, 6)).tolist(), t, x).findings()
        assert cut == whole


@STEADY
@given(cuts)
def test_a_saturated_channel_is_found_at_its_first_run(at: list[int]) -> None:
    t = np.arange(300) * STEP
    x = np.clip(2.0 * np.sin(100.0 * t), -1.5, 5.0)
    longest = told(blocks(ValueCheck("x", "N"), at, t, x))
    assert [name for name, _, _ in longest] == ["saturated"]
    row, count = longest[0][1:]
    assert np.all(x[row : row + count] == -1.5)
    assert x[row - 1] > -1.5 < x[row + count]


@STEADY
@given(cuts, st.sampled_from([-1.0, 1.0]))
def test_of_saturations_that_last_as_long_the_first_is_told(at: list[int], sign: float) -> None:
    k = np.arange(300)
    x = sign * np.clip(2.0 * np.sin(0.05 * np.pi * k + 0.1), -5.0, 1.0)
    [(name, row, count)] = told(blocks(ValueCheck("x", "N"), at, k * STEP, x))
    stays = np.flatnonzero(x == sign)
    assert (name, row) == ("saturated", stays[0])
    assert count == np.flatnonzero(np.diff(stays) > 1)[0] + 1


@pytest.mark.parametrize("rest", [np.zeros(300), (np.arange(300) > 150).astype(float)])
def test_a_touch_sensor_may_rest_and_press(rest: np.ndarray) -> None:
    pressed = rest.copy()
    pressed[:3] = 1.0
    assert told(blocks(ValueCheck("x", "1"), [100], np.arange(300) * STEP, pressed)) in ([], [("stuck", 151, 149)])


def swing(rate: float = 1.0, noise: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    t = np.arange(20_000) * STEP
    random = np.random.default_rng(2)
    q = 0.8 * np.sin(3.0 * t) + 0.3 * np.sin(11.0 * t) + noise * random.standard_normal(len(t))
    return t, q, rate * (2.4 * np.cos(3.0 * t) + 3.3 * np.cos(11.0 * t))


@pytest.mark.parametrize("kind", ["wraps", "slips", "spikes"])
def test_a_jump_counts_once_wherever_two_chunks_meet(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(smooth, "CHUNK", 300)
    t = np.arange(1300) * STEP
    smooth_motion = np.sin(5.0 * t) + 1e-4 * np.random.default_rng(5).standard_normal(len(t))
    for row in range(300 - 2 * smooth.HALF - 3, 304):
        values = smooth_motion.copy()
        values[row : row + 1 if kind == "spikes" else None] += 2.0 * np.pi if kind == "wraps" else 0.5
        for cuts in ([], [row], [row - 1, row + 2]):
            check = blocks(smooth.JumpCheck("arm", "rad"), cuts, t, values)
            assert [(f.check, f.row, f.count) for f in check.findings()] == [(kind, row, 1)], (row, cuts)
        if kind == "wraps":
            straight, wraps = smooth.unwrapped(t, values)
            assert wraps.tolist() == [row]
            np.testing.assert_allclose(straight, smooth_motion, atol=1e-12)


@pytest.mark.parametrize("rate", [np.pi / 180, 180 / np.pi, -1.0, 1e3, 0.0])
def test_a_rate_in_another_unit_or_sign_is_a_fault(rate: float) -> None:
    (finding,) = blocks(RateCheck("arm"), [7000], *swing(rate)).findings()
    assert finding.fault
    assert finding.channel == "coordinates.arm"


@pytest.mark.parametrize("cuts", [[7000], [1, 5000, 5001, 16_000], list(range(100, 20_000, 37))], ids=len)
@pytest.mark.parametrize("rate", [0.9, 1.0, -1.0])
def test_rates_are_judged_alike_wherever_blocks_are_cut(rate: float, cuts: list[int]) -> None:
    """Every sample counts, whichever block it came in."""
    data = swing(rate, noise=1e-5)
    whole, cut = (blocks(RateCheck("arm"), at, *data) for at in ([], cuts))
    np.testing.assert_allclose(cut._totals, whole._totals, rtol=1e-9)
    assert [(f.check, f.row, f.count, f.text) for f in cut.findings()] == [
        (f.check, f.row, f.count, f.text) for f in whole.findings()
    ]


@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-3])
def test_a_rate_that_belongs_to_its_coordinate_is_none(noise: float) -> None:
    t, q, v = swing(noise=noise)
    counts = 2.0**18 / (2.0 * np.pi)
    assert not blocks(RateCheck("arm"), [7000], t, np.rint(q * counts) / counts, v).findings()


def test_an_arm_at_rest_is_not_judged_by_its_noise() -> None:
    t = np.arange(20_000) * STEP
    random = np.random.default_rng(6)
    assert not blocks(RateCheck("arm"), [], t, *random.standard_normal((2, len(t)))).findings()


def test_faults_refuse_a_log_and_check_tells_them(tmp_path: Path) -> None:
    data = motion()
    data["q"][[700, 900]] = np.nan
    path = parquet(tmp_path / "log.parquet", data)
    with pytest.raises(LogFormatError) as error:
        hw.read(path, columns())
    assert (error.value.row, error.value.column) == (700, "coordinates.arm")
    assert f"t = {700 * STEP:.9g} s" in str(error.value)
    (finding,) = hw.check(path, columns())
    assert (finding.fault, finding.row, finding.t, finding.count) == (True, 700, 700 * STEP, 2)


def test_nothing_is_repaired_unasked(tmp_path: Path) -> None:
    data = {name: np.delete(values, [300, 301]) for name, values in motion().items()}
    log = hw.read(parquet(tmp_path / "log.parquet", data), columns())
    assert len(log) == 1998
    assert [f.check for f in log.findings] == ["dropped"]
    assert log.provenance.repairs == ()


def test_dropped_samples_are_filled_measured_linearly_commanded_held(tmp_path: Path) -> None:
    whole = motion()
    data = {name: np.delete(values, [300, 301, 302, 1500]) for name, values in whole.items()}
    log = hw.read(parquet(tmp_path / "log.parquet", data), columns(), repair=("fill_dropped",))
    np.testing.assert_array_equal(log.filled, [300, 301, 302, 1500])
    for start, stop in ((0, 2000), (301, 1500), (302, 2000), (400, 1400), (1, 1501)):
        part = log.window(*log.time[[start, min(stop, 1999)]])
        np.testing.assert_array_equal(part.time[part.filled], log.time[[i for i in log.filled if start <= i < stop]])
    kept = np.setdiff1d(np.arange(2000), log.filled)
    np.testing.assert_allclose(log.time, whole["t"], atol=1e-15)
    q, u = log.channel("coordinates", "arm").values, log.channel("inputs", "motor").values
    np.testing.assert_array_equal(q[kept], whole["q"][kept])
    np.testing.assert_allclose(q[300:303], np.interp([1, 2, 3], [0, 4], whole["q"][[299, 303]]), rtol=1e-12)
    np.testing.assert_array_equal(u[300:303], whole["u"][299])
    (repair,) = log.provenance.repairs
    assert (repair.name, repair.rows, repair.row) == ("fill_dropped", 4, 300)


def test_duplicates_are_dropped_when_asked(tmp_path: Path) -> None:
    order = np.sort(np.append(np.arange(2000), [700, 700, 1900]))
    data = {name: values[order] for name, values in motion().items()}
    path = parquet(tmp_path / "log.parquet", data)
    with pytest.raises(LogFormatError, match="does not advance") as error:
        hw.read(path, columns())
    assert error.value.row == 701
    log = hw.read(path, columns(), repair=("drop_duplicates",))
    np.testing.assert_array_equal(log.time, motion()["t"])
    assert [(r.name, r.rows, r.row) for r in log.provenance.repairs] == [("drop_duplicates", 3, 701)]


def test_a_repair_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownName, match="fill_dropped"):
        hw.read(tmp_path / "log.parquet", columns(), repair=("fill_droped",))


@settings(STEADY, max_examples=25)
@given(st.floats(0.0, 1.7), st.floats(0.0, 1.7))
def test_a_window_holds_the_rows_of_its_times(start: float, stop: float) -> None:
    data = motion()
    values = hw.Channel(role=hw.Role.COORDINATES, name="arm", unit="rad", values=data["q"])
    source = hw.Provenance(file="x", sha256="", format="csv", library="")
    log = hw.Log(time=data["t"], channels=(values,), sample_time=STEP, provenance=source)
    inside = (data["t"] >= start) & (data["t"] < stop)
    if not inside.any():
        with pytest.raises(SceneError, match="no rows"):
            log.window(start, stop)
        return
    np.testing.assert_array_equal(log.window(start, stop).matrix("coordinates")[:, 0], data["q"][inside])


def test_a_log_is_frozen_and_names_what_it_has(tmp_path: Path) -> None:
    log = hw.read(parquet(tmp_path / "log.parquet", motion()), columns())
    with pytest.raises(ValueError, match="read-only"):
        log.time[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        log.channel("coordinates", "arm").values[0] = 1.0
    with pytest.raises(UnknownName, match=r"coordinates\.arm"):
        log.channel("coordinates", "am")
    assert log.names("inputs") == ("motor",)
    assert log.matrix("references").shape == (2000, 0)
