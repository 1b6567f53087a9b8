"""Logs that lie: clean ones of any kind are said to be clean, and what is planted anywhere is found there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from log_motions import KINDS, Motion, draw
from scipy.signal import lfilter

from crossbody import hw
from crossbody.cases import LogFormatError
from crossbody.hw.checks.finding import first_of_each
from crossbody.hw.checks.jumps import find_jumps
from crossbody.hw.checks.rates import RateCheck
from crossbody.hw.checks.smooth import JumpCheck, unwrapped
from crossbody.hw.checks.values import ValueCheck

MOVING = ("sines", "moves", "swing", "bounces")
SEEDS = range(6)
MANY = range(400)


def findings(motion: Motion, q: np.ndarray, v: np.ndarray | None = None, cut: int = 1500) -> list[hw.Finding]:
    """What the checks of a coordinate say, block by block."""
    rows = np.arange(len(q), dtype=np.int64)
    value, jumps, rate = ValueCheck("coordinates.q", "rad"), JumpCheck("q", "rad"), RateCheck("q")
    for part in (slice(0, cut), slice(cut, None)):
        value.see(rows[part], motion.t[part], q[part])
        jumps.see(rows[part], motion.t[part], q[part])
        rate.see(rows[part], motion.t[part], q[part], (motion.v if v is None else v)[part])
    return first_of_each([*value.findings(), *jumps.findings(), *rate.findings()])


def speed(motion: Motion, row: int) -> float:
    """What the coordinate moves in a sample about a row, with its noise and grid."""
    return float(np.abs(np.diff(motion.q[max(row - 20, 0) : row + 20])).max()) + 10.0 * motion.noise + 5.0 * motion.grid


def _clean(seed: int, kind: str) -> None:
    motion = draw(seed, kind)
    assert findings(motion, motion.q) == []


def _wraps(seed: int, kind: str) -> None:
    motion, random = draw(seed, kind), np.random.default_rng([seed, 1])
    inside = motion.q + random.uniform(-np.pi, np.pi)
    q = np.mod(inside + np.pi, 2.0 * np.pi) - np.pi
    at = np.flatnonzero(np.abs(np.diff(q)) > np.pi) + 1
    at = at[(at >= 3) & (at <= len(q) - 3)]  # with two neighbours on either side
    found = [f for f in findings(motion, q) if f.check == "wraps"]
    assert [f.row for f in found] == at[:1].tolist()
    assert [f.t for f in found] == motion.t[at[:1]].tolist()
    assert [f.count for f in found] == [len(at)][: len(found)]
    straight, rows = unwrapped(motion.t, q)
    assert rows.tolist() == at.tolist()
    if len(at) == np.count_nonzero(np.abs(np.diff(q)) > np.pi):
        np.testing.assert_allclose(np.diff(straight), np.diff(motion.q), atol=1e-9)


def _slips(seed: int, kind: str) -> None:
    motion, random = draw(seed, kind), np.random.default_rng([seed, 2])
    row = int(random.integers(5, len(motion.q) - 5))
    q = motion.q.copy()
    q[row:] += random.choice([-1.0, 1.0]) * no_turn(0.5 + 12.0 * speed(motion, row))
    found = [f for f in findings(motion, q) if f.check in ("slips", "wraps")]
    assert [(f.check, f.row, f.t, f.count) for f in found] == [("slips", row, motion.t[row], 1)]


def no_turn(size: float) -> float:
    """A size that is not that of whole turns."""
    return size + (2.0 if abs(size - 2.0 * np.pi * np.rint(size / (2.0 * np.pi))) < 1.0 else 0.0)


def _slow_slips(seed: int, kind: str) -> None:
    """A slip that takes up to eight samples, in a motion whose rate is not recorded."""
    motion, random = draw(seed, kind), np.random.default_rng([seed, 4])
    row, span = int(random.integers(40, len(motion.q) - 60)), int(random.integers(2, 9))
    ways = motion.q[row - 24 : row + 40] - motion.q[row - 32 : row + 32]  # of 8 samples
    size = 0.5 + 12.0 * (float(np.ptp(ways)) + 60.0 * motion.noise + 30.0 * motion.grid)
    if size > 2.0 * span:
        return  # steps of a turn
    share = np.clip(np.arange(1 - row, len(motion.q) + 1 - row) / span, 0.0, 1.0)
    share = share if random.random() < 0.5 else share**2 * (3.0 - 2.0 * share)
    q = motion.q + random.choice([-1.0, 1.0]) * size * share
    found = [f for f in findings(motion, q, np.full(len(q), np.nan)) if f.check in ("slips", "wraps", "spikes")]
    assert [(f.check, f.count) for f in found] == [("slips", 1)]
    assert row - 1 <= found[0].row < row + span


def _long_slips(seed: int, kind: str) -> None:
    """A slip that takes up to eighty samples, which the recorded rate does not know."""
    motion, random = draw(seed, kind), np.random.default_rng([seed, 5])
    row, span = int(random.integers(400, len(motion.q) - 500)), int(random.integers(9, 81))
    fastest = float(np.abs(motion.v[row - 60 : row + 140]).max())
    size = 0.5 + 12.0 * (motion.noise + motion.grid + motion.step * fastest * 16.0)
    share = np.clip(np.arange(1 - row, len(motion.q) + 1 - row) / span, 0.0, 1.0)
    found = [f for f in findings(motion, motion.q + size * share) if f.check not in ("stuck", "saturated")]
    if judged(motion):
        assert [f.check for f in found] in (["slips"], ["rates"], ["gain"], ["delay"])  # as many spans as disagree
        assert abs(found[0].row - row) <= 130


def _spikes(seed: int, kind: str) -> None:
    """A sample or two that leave a smooth motion and come back."""
    motion, random = draw(seed, kind), np.random.default_rng([seed, 6])
    row, span = int(random.integers(5, len(motion.q) - 6)), int(random.integers(1, 3))
    q, size = motion.q.copy(), no_turn(0.5 + 15.0 * speed(motion, row))
    q[row : row + span] += random.choice([-1.0, 1.0]) * size
    found = [f for f in findings(motion, q) if f.check not in ("stuck", "saturated")]
    assert [(f.check, f.row, f.t, f.count) for f in found] == [("spikes", row, motion.t[row], 1)]


def _degrees(seed: int, kind: str) -> None:
    """An angle of one turn in degrees that is taken for radians, or the reverse."""
    motion, random = draw(seed, kind), np.random.default_rng([seed, 7])
    q = np.mod(motion.q + random.uniform(-np.pi, np.pi) + np.pi, 2.0 * np.pi) - np.pi
    at = np.flatnonzero(np.abs(np.diff(q)) > np.pi) + 1
    apart = (
        len(at)
        and np.rad2deg(np.abs(np.diff(motion.q)).max()) < 2.0
        and np.diff(np.concatenate(([-40], at, [len(q) + 40]))).min() > 40
    )
    if not apart or len(at) < 2:
        return
    for factor in (180.0 / np.pi, np.pi / 180.0):
        found = [f for f in findings(motion, factor * q, factor * motion.v) if f.fault]
        assert [(f.check, f.row) for f in found] == [("unit", at[0])]


def _gains(seed: int, kind: str) -> None:
    """A gain that is off by a few per cent, or a rate that is some samples late."""
    motion, random = draw(seed, kind), np.random.default_rng([seed, 8])
    bend = np.sqrt(np.mean(np.gradient(motion.v, motion.step) ** 2) / max(np.mean(motion.v**2), 1e-30))
    late = int(random.integers(4, 9))
    if not judged(motion) or late * motion.step * bend > 0.5:
        return  # it rests, or so late is no small delay
    if (
        late * motion.step * np.std(motion.v[16:] - motion.v[:-16]) * np.sqrt(len(motion.q) / 16.0)
        < 12.0 * motion.noise
    ):
        return  # noise hides it
    gain = 1.0 + random.choice([-1.0, 1.0]) * random.uniform(0.05, 0.3)
    assert [f.check for f in findings(motion, motion.q, motion.v / gain)] == ["gain"]
    delayed = np.concatenate((np.full(late, motion.v[0]), motion.v[:-late]))
    (found,) = findings(motion, motion.q, delayed)
    assert found.check == "delay"
    assert abs(float(found.text.split("(")[1].split(" ")[0]) - late) <= 0.5 * late


def _stuck(seed: int, kind: str) -> None:
    """A channel freezes while it moves."""
    motion, random = draw(seed, kind), np.random.default_rng([seed, 3])
    row = int(random.integers(60, len(motion.q) - 300))
    q = motion.q.copy()
    length = int(random.integers(120, 200))
    steps = np.diff(q[row - 60 : row + 1])
    if np.abs(steps[-10:].sum()) <= 10.0 * motion.grid or abs(steps[-10:].mean()) < 0.7 * np.abs(steps).max():
        return  # it does not move there, or comes to rest
    if np.abs(motion.v[row + length : row + length + 60]).min() < 0.05 * np.abs(motion.v).max():
        return  # it goes on with a rest, which begins with a jump then
    q[row : row + length] = q[row]
    found = [f for f in findings(motion, q) if f.check == "stuck"]
    assert [(f.row, f.t, f.count) for f in found] == [(row, motion.t[row], length)]


def _saturated(seed: int, kind: str) -> None:
    """A range that ends at four fifths of the motion."""
    motion = draw(seed, kind)
    top = float(np.quantile(motion.q, 0.95))
    if top == 0.0 or top <= motion.q.min():
        return
    clipped = np.minimum(motion.q, top)
    rows = np.flatnonzero(np.diff((motion.q >= top).astype(int), prepend=0) == 1)
    sharp = [r for r in rows if r > 60 and _enters(motion, r) and np.all(motion.q[r : r + 12] >= top)]
    found = [f for f in findings(motion, clipped) if f.check == "saturated"]
    if sharp:
        assert [f.channel for f in found] == ["coordinates.q"]
        assert motion.q[found[0].row] >= top


def _enters(motion: Motion, row: int) -> bool:
    steps = np.diff(motion.q[row - 60 : row + 1])
    return bool(np.all(steps >= 0.0) and steps[-10:].sum() > max(10.0 * motion.grid, 0.25 * steps[-50:].sum()))


def _swapped(seed: int, kind: str) -> None:
    """Position and rate of another joint, or the rate in degrees."""
    motion, other = draw(seed, kind), draw(seed + 1000, kind)
    if not judged(motion):
        return
    wrong = [motion.v * 180.0 / np.pi, -motion.v]
    if np.std(other.v) > 0.0 and abs(np.corrcoef(motion.v, other.v)[0, 1]) < 0.5:
        wrong.append(other.v)
    for v in wrong:
        # A quarter of a wave the other way round is also one with a bias.
        assert [f.check for f in findings(motion, motion.q, v) if f.fault] in (["rates"], ["bias"])


def _biased(seed: int, kind: str) -> None:
    """A rate that is off by a constant, up to many times its own size."""
    motion, random = draw(seed, kind), np.random.default_rng([seed, 9])
    if not judged(motion):
        return
    noise = np.std(np.diff(motion.q)) / motion.step / np.sqrt(len(motion.q))
    bias = float(random.choice([-1.0, 1.0]) * np.exp(random.uniform(np.log(0.3), np.log(100.0))))
    bias *= float(np.abs(motion.v).mean()) + noise
    (found,) = findings(motion, motion.q, motion.v + bias)
    if found.check == "gain":  # of a motion that goes one way, mostly
        assert abs(motion.v.mean()) > 0.2 * np.abs(motion.v).mean()
        return
    assert found.check == "bias"
    told, unsure = (float(found.text.split(part)[1].split(")")[0].split(" ")[0]) for part in ("by ", "+- "))
    assert abs(told - bias) <= 2.0 * unsure + 0.03 * float(np.abs(motion.v).mean()) + 0.01 * abs(bias)


def _differences(seed: int, kind: str) -> None:
    """A rate by differences of an encoder, whose levels are few, is no channel at the end of its range."""
    motion, random = draw(seed, kind), np.random.default_rng([seed, 10])
    grid = 2.0 * np.pi / 2.0 ** random.integers(10, 17)
    q = grid * np.rint(motion.q / grid)
    v = np.diff(q, prepend=q[0]) / motion.step
    v[0] = random.choice([0.0, motion.v[0], v[1]])
    check = ValueCheck("velocities.q", "rad/s")
    check.see(np.arange(len(v)), motion.t, np.array([float(f"{one:.12g}") for one in v]))
    assert [f.check for f in check.findings()] == []
    assert [f.check for f in findings(motion, q, v) if f.check not in ("stuck", "saturated")] == []


def judged(motion: Motion) -> bool:
    check = RateCheck("q")
    check.see(np.arange(len(motion.q)), motion.t, motion.q, motion.v)
    return check._moves()


LAWS = {
    "clean": (_clean, KINDS), "wraps": (_wraps, (*MOVING, "spin")), "slips": (_slips, KINDS[:-1]),
    "slow-slips": (_slow_slips, KINDS), "long-slips": (_long_slips, MOVING), "spikes": (_spikes, KINDS),
    "degrees": (_degrees, (*MOVING, "spin")), "gains": (_gains, MOVING[:3]),
    "stuck": (_stuck, MOVING), "saturated": (_saturated, ("sines", "swing")), "swapped": (_swapped, MOVING[:3]),
    "biased": (_biased, MOVING[:3]), "differences": (_differences, MOVING[:3]),
}  # fmt: skip
CASES = [(law, kind) for law, (_, kinds) in LAWS.items() for kind in kinds]


@pytest.mark.parametrize(("law", "kind"), CASES)
def test_what_is_planted_is_found_and_nothing_else(law: str, kind: str) -> None:
    for seed in SEEDS:
        LAWS[law][0](seed, kind)


COLUMNS = """[time]
column = "t"
[coordinates.q]
column = "q"
unit = "rad"
[velocities.q]
column = "v"
unit = "rad/s"
"""


@pytest.mark.parametrize("span", [1, 2])
@pytest.mark.parametrize("seed", range(20))
def test_a_spike_is_as_large_as_it_is_off_the_line_of_those_around_it(seed: int, span: int) -> None:
    """However fast the motion is on which it sits, by ten to a hundred of whose steps: it is no slip."""
    rng = np.random.default_rng([seed, span])
    t, row = np.arange(400) / 500.0, int(rng.integers(50, 350))
    speed, steps = rng.choice([-1.0, 1.0], 2) * 10.0 ** rng.uniform((-1.0, 1.0), (2.0, 2.0))
    size = steps * abs(speed) * t[1]
    motion = speed * (t + 1e-3 * t**2) + 1e-9 * rng.normal(size=len(t))
    assert not len(find_jumps(t, motion, False)[0].at)
    motion[row : row + span] += size
    found = find_jumps(t, motion, False)[0]
    assert (found.at.tolist(), found.span.tolist(), found.spike.tolist()) == ([row], [span], [True])
    assert found.size == pytest.approx([size], rel=1e-3)


def _written(path: Path, **columns: np.ndarray) -> Path:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table(columns), path)
    return path


def test_a_wrapped_log_is_refused_and_unwrapped_when_asked(tmp_path: Path) -> None:
    motion = draw(3, "spin", rows=20_000)
    q = np.mod(motion.q + np.pi, 2.0 * np.pi) - np.pi
    path = _written(tmp_path / "log.parquet", t=motion.t, q=q, v=motion.v)
    first = int(np.flatnonzero(np.abs(np.diff(q)) > np.pi)[0]) + 1
    with pytest.raises(LogFormatError, match="wraps at a turn") as told:
        hw.read(path, hw.parse_columns(COLUMNS))
    assert (told.value.row, told.value.column) == (first, "coordinates.q")
    log = hw.read(path, hw.parse_columns(COLUMNS), repair=("unwrap",))
    np.testing.assert_allclose(log.channel("coordinates", "q").values, motion.q + q[0] - motion.q[0], atol=1e-8)
    (repair,) = log.provenance.repairs
    assert (repair.name, repair.row, repair.rows) == ("unwrap", first, np.count_nonzero(np.abs(np.diff(q)) > np.pi))
    assert not [f for f in log.findings if f.check in ("wraps", "slips")]


def _wave(seed: int) -> Motion:
    """One decaying wave of 34 to 200 samples a period: spans of sixteen follow it in jumps."""
    random = np.random.default_rng([seed, 10])
    step, rows = 10.0 ** random.uniform(-3.5, -1.5), int(random.integers(600, 3000))
    turn, decay = 2.0 * np.pi / random.uniform(34.0, 200.0), random.choice([0.0, random.uniform(0.0, 0.01)])
    t, wave = np.arange(rows) * step, (1j - decay) * turn / step
    wide = random.uniform(0.1, 1.5) * np.exp(wave * t + 1j * random.uniform(0.0, 6.3))
    noise = random.choice([0.0, 10.0 ** random.uniform(-6.0, -3.0)])
    q, v = wide.real + noise * random.standard_normal(rows), (wave * wide).real
    v += 0.005 * v.std() * random.standard_normal(rows)
    return Motion(t, q, v, step, 0.0, noise, "wave")


@pytest.mark.parametrize("seeds", [range(60), pytest.param(range(60, 1000), marks=pytest.mark.slow)])
def test_a_wrong_rate_is_found_however_few_samples_a_period_has(seeds: range) -> None:
    for seed in seeds:
        motion = _wave(seed)
        assert findings(motion, motion.q) == [], seed
        for wrong in (-motion.v, 0.0 * motion.v, np.rad2deg(motion.v), 2.5 * motion.v, 0.3 * motion.v):
            assert [f.check for f in findings(motion, motion.q, wrong) if f.fault] == ["rates"], seed


@pytest.mark.parametrize("seeds", [range(60), pytest.param(range(60, 1000), marks=pytest.mark.slow)])
def test_noise_at_rest_is_no_motion(seeds: range) -> None:
    """White or filtered, beside the noise of another sensor."""
    for seed in seeds:
        motion, random = _wave(seed), np.random.default_rng([seed, 11])
        q, v = random.standard_normal((2, len(motion.t)))
        q = 1e-3 * lfilter([1.0], [1.0, -random.choice([0.0, 0.5, 0.9])], q)
        assert [f.check for f in findings(motion, q, 0.01 * v) if f.check in ("rates", "gain", "delay")] == [], seed


@pytest.mark.parametrize("size", [1e150, 1e200, 1e308])
def test_values_whose_squares_overflow_are_no_crash(size: float) -> None:
    motion = draw(0, "sines")
    for q, v in ((size * motion.q, motion.v), (motion.q, size * motion.v), (size * motion.q, size * motion.v)):
        with np.errstate(over="ignore", invalid="ignore"):
            findings(motion, q, v)


def test_a_wrap_does_not_hide_a_wrong_rate(tmp_path: Path) -> None:
    t = np.arange(20_000) * 1e-3
    q = np.mod(9.0 * np.sin(1.3 * t) + np.pi, 2.0 * np.pi) - np.pi
    path = _written(tmp_path / "log.parquet", t=t, q=q, v=-11.7 * np.cos(1.3 * t))
    assert [f.check for f in hw.check(path, hw.parse_columns(COLUMNS)) if f.fault] == ["rates", "wraps"]


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig"])
def test_text_of_two_bytes_a_letter_is_read(encoding: str, tmp_path: Path) -> None:
    text = "t,q\n" + "".join(f"{i / 100},{i}\n" for i in range(3000))
    (tmp_path / "log.csv").write_bytes(text.encode(encoding))
    columns = hw.parse_columns('[time]\ncolumn = "t"\n[sensors.q]\ncolumn = "q"\nunit = "rad"\n')
    np.testing.assert_array_equal(hw.read(tmp_path / "log.csv", columns).matrix("sensors")[:, 0], np.arange(3000.0))
    assert hw.survey(tmp_path / "log.csv").groups[0].rows == 3000


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8", "ascii", "shift_jis"])
def test_text_that_its_encoding_does_not_hold_is_told(encoding: str, tmp_path: Path) -> None:
    """Cut off within a letter, or with a byte of another encoding, far behind the first block."""
    text = ("t,q\n" + "".join(f"{i},{i}\n" for i in range(120_000))).encode(encoding)
    (tmp_path / "log.csv").write_bytes(text[:-1] if encoding == "utf-16" else text + b"120000,\xff\n")
    columns = hw.parse_columns(f"options = {{encoding = '{encoding}'}}\n" + '[time]\ncolumn = "t"\n'
                               '[sensors.q]\ncolumn = "q"\nunit = "rad"\n')  # fmt: skip
    for go_through in (hw.read, hw.survey):
        with pytest.raises(LogFormatError, match=r"log\.csv"):
            go_through(tmp_path / "log.csv", columns)


def test_units_below_the_header_are_read_or_told(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,q\n[ms],(deg)\n" + "".join(f"{i},{i}\n" for i in range(300)))
    columns = '[time]\ncolumn = "t"\n[sensors.q]\ncolumn = "q"\n'
    with pytest.raises(LogFormatError, match=r"options\.units = true"):
        hw.survey(path)
    log = hw.read(path, hw.parse_columns("options = {units = true}\n" + columns))
    np.testing.assert_allclose(log.matrix("sensors")[:, 0], np.deg2rad(np.arange(300.0)))
    np.testing.assert_allclose(log.time, np.arange(300) / 1000)


def test_a_survey_reads_by_the_layout_of_a_map(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t|q\n" + "".join(f"{i},5|{i},25\n" for i in range(300)))
    with pytest.raises(LogFormatError, match=r"options\.decimal"):
        hw.survey(path)
    text = 'options = {decimal = ","}\n[time]\ncolumn = "t"\n[sensors.q]\ncolumn = "q"\nunit = "1"\n'
    found = hw.survey(path, hw.parse_columns(text))
    assert found.groups[0].rows == 300
    assert found.draft().options == {"decimal": ","}
    assert len(hw.read(path, found.draft())) == 300


@pytest.mark.parametrize(("tick", "unit"), [(1_000_000, "ns"), (1000, "us")])
def test_ticks_are_not_taken_for_seconds(tick: int, unit: str, tmp_path: Path) -> None:
    t = 1_700_000_000_000_000_000 + tick * np.arange(500)
    path = _written(
        tmp_path / "log.parquet", t=t, q=np.sin(np.arange(500) * 0.01), v=np.cos(np.arange(500) * 0.01) * 10
    )
    found = hw.survey(path)
    assert found.groups[0].clock is not None
    assert found.groups[0].clock.unit == unit
    assert found.groups[0].step == pytest.approx(1e-3)
    with pytest.raises(LogFormatError, match=f'Write `unit` \\("{unit}"'):
        hw.read(path, hw.parse_columns(COLUMNS))
    log = hw.read(path, hw.parse_columns(COLUMNS.replace('column = "t"', f'column = "t"\nunit = "{unit}"')))
    np.testing.assert_allclose(np.diff(log.time), 1e-3, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("law", "kind"), CASES)
def test_what_is_planted_is_found_and_nothing_else_many_times(law: str, kind: str) -> None:
    for seed in MANY:
        LAWS[law][0](seed, kind)
