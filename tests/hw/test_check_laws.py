"""Every figure that a check tells, against the same figure from the whole log at once, over random logs.

The logs lack samples, and come in blocks that are cut anywhere.
"""

from __future__ import annotations

import re

import numpy as np
import pytest

from crossbody.hw.checks import smooth
from crossbody.hw.checks.clock import ClockCheck
from crossbody.hw.checks.finding import Finding
from crossbody.hw.checks.jumps import find_jumps
from crossbody.hw.checks.rates import RateCheck
from crossbody.hw.checks.smooth import JumpCheck
from crossbody.hw.checks.values import ValueCheck

Check = ClockCheck | JumpCheck | RateCheck | ValueCheck


def shown(check: Check, random: np.random.Generator, *arrays: np.ndarray) -> list[Finding]:
    """What a check says that has seen arrays in blocks that are cut anywhere."""
    rows = np.arange(len(arrays[0]), dtype=np.int64)
    for part in np.split(rows, np.sort(random.integers(0, len(rows), random.choice([0, 3, 40])))):
        check.see(part, *(array[part] for array in arrays))  # type: ignore[call-arg]
    return check.findings()


def figure(text: str, before: str) -> float:
    """The number behind some words of a finding."""
    found = re.search(re.escape(before) + r" ([+-]?[\d.]+(?:e[+-]?\d+)?)", text)
    assert found is not None, text
    return float(found[1])


def indices(random: np.random.Generator, rows: int, share: float = 0.9) -> np.ndarray:
    """Which samples of a steady clock are there: the first, and most of the others."""
    return np.append(0, 1 + np.flatnonzero(random.random(rows - 1) < share))


@pytest.mark.parametrize("seed", range(12))
def test_a_clock_is_the_line_through_its_samples(seed: int) -> None:
    random = np.random.default_rng(seed)
    step, slow = 10.0 ** random.uniform(-4.0, -1.0), random.choice([-1.0, 1.0]) * random.uniform(4e-4, 2e-3)
    k = indices(random, 6000)
    t = random.uniform(-9.0, 9.0) + step * ((1.0 + slow) * k + 0.01 * random.standard_normal(len(k)))
    check = ClockCheck(step)
    found = {finding.check: finding for finding in shown(check, random, t)}
    late = t[1:] - t[0] - step * k[1:]
    line = np.polyfit(k[1:], late, 1)
    gaps, behind = np.flatnonzero(np.diff(k) > 1) + 1, np.flatnonzero(np.abs(late) > step) + 1
    assert check.rows == len(k)
    assert check.missing == k[-1] + 1 - len(k)
    assert (check.start, check.end, check.longest) == (t[0], t[-1], pytest.approx(np.diff(t).max(), rel=1e-12))
    assert check.median == pytest.approx(np.median(np.diff(t)), rel=5e-3)
    assert check.drift == pytest.approx(line[0] / step, rel=1e-5)
    assert check.jitter == pytest.approx(np.std(late - np.polyval(line, k[1:])), rel=1e-4)
    dropped, drift = found["dropped"], found["drift"]
    assert (dropped.row, dropped.t, dropped.count) == (gaps[0], t[gaps[0]], len(gaps))
    assert dropped.text.startswith(f"{check.missing} samples are missing in {len(gaps)} places")
    assert (drift.row, drift.t, drift.count) == (behind[0], t[behind[0]], len(behind))
    assert figure(drift.text, "runs") == pytest.approx(1e6 * slow, rel=2e-2)


@pytest.mark.parametrize("seed", range(8))
def test_steps_off_by_more_than_a_tenth_are_counted(seed: int) -> None:
    """Each sample is off its own place, so that it is both of its steps that are wrong; lost samples are no jitter."""
    random = np.random.default_rng([seed, 1])
    k = indices(random, 3000)
    off = np.where(random.random(len(k)) < 0.02, random.choice([-1.0, 1.0], len(k)) * random.uniform(0.12, 0.4), 0.0)
    off[0] = 0.0
    step = 10.0 ** random.uniform(-4.0, -1.0)
    t = step * (k + off)
    (found,) = [f for f in shown(ClockCheck(step), random, t) if f.check == "jitter"]
    wrong = np.flatnonzero(np.abs(np.diff(off)) > 0.1) + 1
    assert (found.row, found.t, found.count) == (wrong[0], t[wrong[0]], len(wrong))


@pytest.mark.parametrize("degree", range(3))
@pytest.mark.parametrize("seed", range(4))
def test_the_noise_of_steps_is_that_of_the_samples_whatever_parabola_they_move_on(seed: int, degree: int) -> None:
    """The second differences of steps of white noise have the variance 1 + 9 + 9 + 1; nine of ten are below 1.645."""
    random = np.random.default_rng([seed, 2])
    t, noise = np.arange(4000) / 4000.0, 10.0 ** random.uniform(-8.0, -3.0)
    values = np.polyval(random.uniform(10.0, 90.0, degree + 1), t) + noise * random.standard_normal(len(t))
    assert find_jumps(t, values, False)[1] == pytest.approx(0.5 * 1.645 * np.sqrt(20.0) * noise, rel=0.12)


def planted(random: np.random.Generator, kind: str, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A smooth motion with jumps of a kind at random distances: its values, where they are, and their sizes."""
    at = np.cumsum(random.integers(70, 240, rows // 70))
    at = at[(at < rows - 40) & (at > random.integers(0, 0.7 * rows))]
    signs = random.choice([-1.0, 1.0], len(at))
    sizes = signs * (2.0 * np.pi if kind == "wraps" else random.uniform(0.5, 1.5, len(at)))
    values = np.sin(6.0 * np.arange(rows) / rows) + 1e-5 * random.standard_normal(rows)
    for row, size in zip(at, sizes, strict=True):
        match kind:
            case "spikes":
                values[row] += size
            case "slow":
                values[row:] += size * np.minimum(np.arange(1, rows - row + 1) / 4.0, 1.0)
            case _:
                values[row:] += size
    return values, at, sizes


@pytest.mark.parametrize("kind", ["wraps", "slips", "spikes", "slow"])
@pytest.mark.parametrize("seed", range(4))
def test_jumps_are_counted_once_and_the_first_told_wherever_chunks_end(
    seed: int, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(smooth, "CHUNK", 400)
    random = np.random.default_rng([seed, 3])
    values, at, sizes = planted(random, kind, 6000)
    check = "slips" if kind == "slow" else kind
    t = np.arange(len(values)) * 1e-3
    (found,) = shown(JumpCheck("arm", "rad"), random, t, values)
    assert (found.check, found.count, found.t) == (check, len(at), t[found.row])
    assert found.row == at[0]
    if kind != "wraps":
        assert figure(found.text, "by") == pytest.approx(sizes[0], abs=0.02)
    if kind == "wraps":
        straight, rows = smooth.unwrapped(t, values)
        assert rows.tolist() == at.tolist()
        assert np.abs(np.diff(straight)).max() < 0.1


@pytest.mark.parametrize("seed", range(6))
def test_a_gain_a_delay_and_a_bias_of_a_rate_are_told_in_their_size(seed: int) -> None:
    """Of an angle that wraps or does not, with samples that are lost."""
    random = np.random.default_rng([seed, 4])
    step = 10.0 ** random.uniform(-3.5, -2.0)
    t = step * indices(random, 9000)
    rates, sizes, phases = 6.3 / step / random.uniform(300.0, 900.0, 2), random.uniform(1.0, 4.0, 2), random.random(2)

    def motion(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        angles = np.multiply.outer(at, rates) + phases
        return np.sin(angles) @ sizes, np.cos(angles) @ (sizes * rates)

    q, v = motion(t)
    if seed % 2:
        q = np.mod(q + np.pi, 2.0 * np.pi) - np.pi
    assert not shown(RateCheck("arm"), random, t, q, v)
    gain = 1.0 + random.choice([-1.0, 1.0]) * random.uniform(0.05, 0.3)
    (found,) = shown(RateCheck("arm"), random, t, q, v / gain)
    assert (found.check, figure(found.text, "moves")) == ("gain", pytest.approx(gain, rel=5e-3))
    late = random.choice([-1.0, 1.0]) * random.uniform(4.0, 8.0) * step
    (found,) = shown(RateCheck("arm"), random, t, q, motion(t - late)[1])
    assert found.check == "delay"
    assert figure(found.text, "velocity is") == pytest.approx(abs(late), rel=0.05)
    assert ("behind" in found.text) == (late > 0.0)
    assert float(found.text.split("(")[1].split()[0]) == pytest.approx(late / step, abs=0.06 * abs(late) / step)
    assert not shown(RateCheck("arm", lag=late), random, t, q, motion(t - late)[1])
    bias = random.choice([-1.0, 1.0]) * random.uniform(0.2, 3.0) * np.abs(v).mean()
    (found,) = shown(RateCheck("arm"), random, t, q, v + bias)
    assert (found.check, figure(found.text, "biased by")) == ("bias", pytest.approx(bias, rel=1e-2))


@pytest.mark.parametrize("seed", range(4))
def test_a_gain_is_as_unsure_as_least_squares_leave_it(seed: int) -> None:
    """Twice its standard error is told, of all spans of sixteen samples but the few that are unusual."""
    random, t = np.random.default_rng([seed, 7]), np.arange(4001) * 1e-3
    phase, noise = random.random(), 10.0 ** random.uniform(-3.0, -1.5)
    q = 1.1 * np.sin(9.0 * t + phase) + noise * random.standard_normal(len(t))
    v = 9.0 * np.cos(9.0 * t + phase)
    (found,) = shown(RateCheck("arm"), random, t, q, v)
    way = np.append(0.0, np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t)))
    X, dq = np.column_stack([np.diff(way[::16]), np.diff(v[::16])]), np.diff(q[::16])
    left = dq - X @ np.linalg.lstsq(X, dq, rcond=None)[0]
    error = np.sqrt(np.linalg.inv(X.T @ X)[0, 0] * (left @ left) / (len(dq) - 2))
    assert found.check == "gain"
    assert figure(found.text, "+-") == pytest.approx(2.0 * error, rel=0.1)


@pytest.mark.parametrize("high", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("low", [-1.0, 0.0, 0.25])
def test_a_switch_has_the_values_0_and_1_alone(low: float, high: float) -> None:
    """A channel that stays at an end of another range may be saturated there; 0 is what a sensor reads at rest."""
    up = np.linspace(low, high, 200)
    x = np.tile(np.concatenate((up, np.full(50, high), up[::-1], np.full(50, low))), 3)
    found = shown(ValueCheck("sensors.x", "N"), np.random.default_rng(0), np.arange(len(x)) * 1e-3, x)
    ends = [figure(f.text, f"its {end},") for f in found for end in ("largest", "smallest") if end in f.text]
    assert ends == ([] if (low, high) == (0.0, 1.0) else [high, low] if low else [high])


def grid_motion(random: np.random.Generator) -> np.ndarray:
    """Moves on a grid, with rests, jumps and ends that are cut off."""
    parts, at = [], 0.0
    for _ in range(random.integers(3, 8)):
        count = int(random.integers(20, 260))
        moved = np.cumsum(random.integers(-6, 30, count)) if random.random() < 0.6 else np.zeros(count)
        parts.append(at + random.choice([-1.0, 1.0]) * moved)
        at = parts[-1][-1] + random.choice([0.0, 7.0, -400.0, 400.0])
    x = 1e-3 * (np.concatenate(parts) + random.uniform(0.1, 0.9))
    return np.clip(x, random.choice([-np.inf, np.quantile(x, 0.2)]), random.choice([np.inf, np.quantile(x, 0.8)]))


@pytest.mark.parametrize("seed", range(40))
def test_what_is_said_of_a_channel_is_said_of_it_with_the_other_sign(seed: int) -> None:
    random = np.random.default_rng([seed, 5])
    x = grid_motion(random)
    t = np.arange(len(x)) * 1e-3

    def said(check: Check, *arrays: np.ndarray) -> set[tuple[str, int, int, str]]:
        found = shown(check, np.random.default_rng(seed), t, *arrays)
        return {(f.check, f.row, f.count, f.text.replace("largest", "end").replace("smallest", "end")
                 .replace("+", "").replace("-", "")) for f in found}  # fmt: skip

    assert said(ValueCheck("x", "N"), x) == said(ValueCheck("x", "N"), -x)
    assert said(JumpCheck("x", "rad"), x) == said(JumpCheck("x", "rad"), -x)
    v = np.gradient(x, t) * random.choice([1.0, 1.2]) + random.choice([0.0, 0.5])
    assert said(RateCheck("x"), x, v) == said(RateCheck("x"), -x, -v)


@pytest.mark.parametrize("way", [-1.0, 1.0])
@pytest.mark.parametrize("seed", range(6))
def test_single_counts_of_an_encoder_are_no_jumps(seed: int, way: float) -> None:
    """Of a motion so slow that it stands still for many samples between two of them."""
    random = np.random.default_rng([seed, 6])
    grid, t = 10.0 ** random.uniform(-5.0, -2.0), np.arange(3000) * 1e-3
    counts = np.rint(way * t * random.uniform(5.0, 60.0) + random.random())
    found = find_jumps(t, grid * counts, True)[0]
    assert not len(found.at)
    counts[1500:] += way * 9.0
    found = find_jumps(t, grid * counts, True)[0]
    (at,) = found.at.tolist()  # a count of its own just before is the beginning of a slip over some samples
    assert 1492 <= at <= 1500
