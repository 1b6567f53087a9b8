"""What replays and identifications must say of logs whose motion has a closed form, written out here.

A link that turns about its end without weight, J th'' = tau - k th', moves by exponentials between changes of its
torque. Its log is written as a rig would write it, in units, signs and offsets of its own and with times that do not
begin at zero, read by a column map, replayed, and its parameters identified. A ball in flight whose height is recorded
late is ahead of its record by a known way. So all that stands between a file and a number has an answer.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from crossbody import hw
from crossbody.cases import EngineUnavailable, Outcome
from crossbody.cases.arrays import Floats
from crossbody.hw import Comparison, Log
from crossbody.hw.models import load as load_model
from crossbody.hw.models.contract import Segment
from crossbody.hw.reading.columns import parse_columns
from crossbody.hw.reading.stream import Rows, join
from crossbody.hw.replaying import measures, sensors
from crossbody.hw.windows import rates
from crossbody.hw.windows.whiteness import noise_level
from crossbody.reports.judging.asked import Found, Within, unlike
from crossbody.reports.judging.form_of_case import form_of_case

EXACT, CLOSE = 1e-9, 1e-6
"""By which part sums in another order differ; and what an integrator at its tolerance, and a search, leave."""
INERTIA, MASS, REACH, DRAG, STEP, SAMPLES = 2e-3, 0.2, 0.15, 4e-3, 0.01, 240
"""Of the link: kg m^2, kg, m, N m s; of its log: s."""
BEGINS, COUNTS, ZERO, LATE = 12.5, 4000.0, 30.0, 0.023
"""Its first time, s; counts of an encoder a turn; its angle at zero counts, degrees; and by how much it is late, s."""
CHAINS = ("single_pendulum", "double_pendulum")
"""Models that engines run in coordinates of their own."""
NOISE, ALIKE = 2e-4, 0.15
"""Of angles, rad; and to which part a deviation is known by so many samples."""
GIVEN = {"gravity": 0.0, "m1": MASS, "a1": REACH, "L1": 2.0 * REACH, "I1": INERTIA, "k1": DRAG}
TORQUES, HELD, ANGLE, RATE = (0.02, -0.03, 0.01), 0.8, 0.4, -1.5
"""Torques, N m, each for so long, s; and angle and rate at first, rad and rad/s."""
LINK = """
[time]
column = "clock"
unit = "ms"
sample_time = 0.01
[coordinates.th1]
column = "encoder"
unit = "deg"
scale = 0.09
offset = -30.0
sign = -1
[inputs."torque 1"]
column = "drive"
unit = "mN m"
"""
G, HEIGHT, SPEED, DELAY, FLIES, WINDOW = 9.81, 3.0, 4.0, 0.004, 0.64, 0.32
"""Of the ball: m/s^2, m, m/s; how late its height is, and how long it flies and windows are, s."""
BALL = """
[time]
column = "t"
unit = "s"
sample_time = 0.01
[coordinates.height]
column = "h"
unit = "mm"
delay = 0.004
"""
TURN = 0.3
"""By how much an angle grows in a sample, rad."""
EVEN = """
[time]
column = "t"
unit = "s"
sample_time = 0.01
[coordinates.a]
column = "a"
"""
"""A map of samples at even instants: what is told of a coordinate follows, its unit first."""
TURNS = f"""{EVEN}unit = "deg"
[inputs.u]
column = "u"
unit = "N"
"""
TICK, STEP_TICKS = 2.5e-5, 400
"""Length of a tick of a clock, s, and how many of them are between samples."""
TICKS = "clock,h,temperature,speed\n1000,1,20,0\n1400,2,20.5,60\n1800,3,21,120\n"
COUNTED = """
[time]
column = "clock"
unit = "ms"
scale = 0.025
[coordinates.height]
column = "h"
unit = "mm"
[sensors.warmth]
column = "temperature"
unit = "degC"
[sensors.turns]
column = "speed"
unit = "rpm"
"""
UNLIKE = 2e-3
"""Noise of a ball's height, m."""
UNITS = {"fit": "%", "delay": "s", "speed": "s/s", "windows_failed": "1", "impacts_too_many": "1",
         "autocorrelation_inside": "%", "impulse_measured": "N s", "impulse_error": "N s",
         "impact_offset_median": "s", "impact_offset_largest": "s"}  # fmt: skip
"""Of metrics of a ball that are no lengths."""
WALL = 0.5
"""Time that a prediction is told to have taken, s."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return what, number, least and most, and of which log, where it is another one."""
    kinds = (_reading, _repaired, _joined, _sensed, _measured, _link, _ball, _bounces, _impacts, _needed, _formed)
    return unlike(kinds, "log", "a log that ends in")


def turned(t: Floats, inertia: float = INERTIA, drag: float = DRAG) -> Floats:
    """Return the angles of a link (n,), rad, at instants t of its log, s: the sum of its answers to each change."""
    J, before = inertia + MASS * REACH**2, 0.0
    found: Floats = ANGLE + RATE * (J / drag) * (1.0 - np.exp(-drag / J * t))
    for k, torque in enumerate(TORQUES):
        gone = np.maximum(t - k * HELD, 0.0 if k else -np.inf)
        found += (torque - before) / drag * (gone - (J / drag) * (1.0 - np.exp(-drag / J * gone)))
        before = torque
    return found


def _torque(t: Floats) -> Floats:
    found: Floats = np.array(TORQUES)[np.minimum((t / HELD + EXACT).astype(int), len(TORQUES) - 1)]
    return found


def read(text: str, columns: str, repair: tuple[str, ...] = ()) -> Log:
    """Return a log that was written as text, whatever formats of others say of such a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_text(text, encoding="utf-8")
        return hw.read(path, parse_columns(f'format = "csv"\n{columns}'), repair=repair)


@cache
def link_log(late: float = 0.0, noise: float = 0.0) -> Log:
    """Return the log of the link whose angles are late, s, and noisy, rad."""
    t = STEP * np.arange(SAMPLES, dtype=np.float64)
    angles = turned(t - late) + noise * np.random.default_rng(5).normal(size=SAMPLES)
    counts = (-np.degrees(angles) + ZERO) * COUNTS / 360.0
    rows = zip((1e3 * (BEGINS + t)).tolist(), counts.tolist(), (1e3 * _torque(t)).tolist(), strict=True)
    return read("\n".join(["clock,encoder,drive", *(",".join(map(repr, row)) for row in rows)]), LINK)


def _reading() -> Iterator[Within]:
    log, t = link_log(), STEP * np.arange(SAMPLES, dtype=np.float64)
    pairs: tuple[tuple[str, Floats, Floats], ...] = (
        ("times", log.time, BEGINS + t), ("angles", log.channel("coordinates", "th1").values, turned(t)),
        ("torques", log.channel("inputs", "torque 1").values, _torque(t)),
    )  # fmt: skip
    for what, found, wanted in pairs:
        worst = int(np.argmax(np.abs(found - wanted)))
        yield "log", f"{what} of a made-up log", float(found[worst]), float(wanted[worst]), EXACT * (BEGINS + 10.0)
    ticks = read(TICKS, COUNTED)
    yield "log", "times of whole ticks", float(ticks.time[-1] - ticks.time[0]), 2.0 * TICK * STEP_TICKS, EXACT
    warm, rate = (ticks.channel("sensors", name).values[1] for name in ("warmth", "turns"))
    yield "log", "a temperature in degrees", float(warm), 273.15 + 20.5, 1e-9
    yield "log", "a rate in turns a minute", float(rate), 60.0 * 2.0 * math.pi / 60.0, 1e-9
    late = read("t,h\n0,1\n0.01,2\n0.02,3\n", BALL)
    true = late.times("coordinates", "height")
    yield "log", "when a late height was true", float(true[1]), STEP - DELAY, EXACT
    yield "log", "a height in mm", float(late.channel("coordinates", "height").values[1]), 2e-3, EXACT


def _repaired() -> Iterator[Within]:
    """Yield rows that are put where samples are missing, or taken where they stand twice, and angles without turns."""
    n, missing, twice = 40, (13, 14), 22
    count = np.arange(n, dtype=np.float64)
    wraps = np.degrees(np.arctan2(np.sin(TURN * count), np.cos(TURN * count)))
    stands = [k for k in range(n) if k not in missing for _ in range(1 + (k == twice))]
    text = "\n".join(["t,a,u", *(f"{STEP * k!r},{float(wraps[k])!r},{float(k)!r}" for k in stands)])
    log = read(text, TURNS, ("drop_duplicates", "fill_dropped", "unwrap"))
    holds = np.where(np.isin(count, missing), missing[0] - 1.0, count)
    pairs = (("times", log.time, STEP * count), ("angles", log.channel("coordinates", "a").values, TURN * count),
             ("commands", log.channel("inputs", "u").values, holds))  # fmt: skip
    yield "log", "rows of a repaired log", float(len(log.time)), float(n), 0.0
    for what, found, wanted in pairs:
        worst = int(np.argmax(np.abs(found - wanted)))
        yield "log", f"{what} of a repaired log", float(found[worst]), float(wanted[worst]), EXACT


def _joined() -> Iterator[Within]:
    """Yield what a signal with times of its own is at those of a log."""
    other = Rows(rows=np.arange(3), time=np.array([0.0, 1.0, 3.0]), values=(np.array([2.0, 4.0, -4.0]),))
    at = np.array([0.25, 1.0, 2.5])
    for how, wanted in (("linear", (2.5, 4.0, -2.0)), ("hold", (2.0, 4.0, 4.0))):
        (found,), lead = join(Path("made up"), how, at, other, "")
        for one, must in zip(found.tolist(), wanted, strict=True):
            yield "log", f"a signal that is joined by {how}", one, must, EXACT
        yield "log", "rows before a signal begins", float(lead), 0.0, 0.0


def _sensed() -> Iterator[Within]:
    """Yield what a sensor with a lag shows of a ramp and of a step, what it felt, and how well that is known.

    With T = 1/ks it shows s (t - T (1 - e^(-t/T))) of a ramp s t, and 1 - e^(-t/T) of a step; of readings with noises
    n that are c = e^(-dt/T) apart, (n' - c n)/(1 - c).
    """
    t, slope, lag, count = STEP * np.arange(40, dtype=np.float64), 3.0, 2.5 * STEP, 0.02
    ramp, ones, told, more = (slope * t)[:, None], np.ones((len(t), 1)), "a sensor with a lag", 0.3 * count
    gone, c = np.exp(-t / lag)[:, None], math.exp(-STEP / lag)
    step = np.concatenate([np.zeros((1, 1)), ones[1:]])
    late = np.maximum(t - LATE, 0.0)[:, None]
    pairs = (
        ("a ramp", sensors.Sensor(rate=1.0 / lag).read(t, ramp, slope * ones), ramp - slope * lag * (1.0 - gone)),
        ("a step that holds", sensors.lagged(t, step, 1.0 / lag), np.maximum(1.0 - gone / c, 0.0)),
        ("a ramp that is late", sensors.Sensor(delay=LATE).read(t, ramp, slope * ones), slope * late),
        ("a ramp in counts", sensors.Sensor(quantum=count).read(t, ramp + more),
         count * np.floor((ramp + more) / count + 0.5)),
        ("what is felt", sensors.unlagged(t, sensors.lagged(t, step, 1.0 / lag), 1.0 / lag, NOISE).force, step[:-1]),
        ("a noise", sensors.unlagged(t, ramp, 1.0 / lag, NOISE, count).std,
         np.full((len(t) - 1, 1), math.sqrt((NOISE**2 + count**2 / 12.0) * (1.0 + c * c)) / (1.0 - c))),
    )  # fmt: skip
    for what, found, wanted in pairs:
        worst = int(np.argmax(np.abs(found - wanted)))
        yield "sensor", f"{told}: {what}", float(found[worst, 0]), float(wanted[worst, 0]), EXACT


def _measured() -> Iterator[Within]:
    """Yield metrics of made-up numbers, a lag of parts of a sample, and the size of a noise."""
    draw = np.random.default_rng(3)
    y, yhat = draw.normal(size=(2, 50)) + 2.0
    off = yhat - y
    mean = math.fsum(y) / len(y)
    spread = math.sqrt(math.fsum((y - mean) ** 2))
    told = "made-up numbers"
    yield "fit", told, measures.fit(y, yhat), 100.0 * (1.0 - math.sqrt(math.fsum(off**2)) / spread), 1e-6
    yield "rmse", told, measures.rmse(y, yhat), math.sqrt(math.fsum(off**2) / len(y)), EXACT
    yield "largest", told, measures.largest(y, yhat), max(abs(x) for x in off.tolist()), EXACT
    yield "bias", told, measures.bias(y, yhat), math.fsum(off) / len(y), EXACT
    t = STEP * np.arange(300, dtype=np.float64)

    def moves(s: Floats) -> Floats:
        return np.sin(3.0 * s) + 0.7 * np.sin(7.3 * s + 1.0) + 0.4 * np.cos(11.9 * s)

    for lag in (2.4 * STEP, -3.7 * STEP):
        found = measures.delay(moves(t), moves(t + lag), STEP)
        yield "delay", "a motion that is recorded late", found, lag, 0.02 * STEP
    noise = draw.normal(size=4000)
    wanted = math.sqrt(math.fsum(noise**2) / len(noise))
    yield "noise", "a motion with noise", noise_level([np.sin(0.01 * np.arange(4000)) + noise]), wanted, ALIKE * wanted


def _rows(found: Comparison) -> dict[str, float]:
    return {row.metric: row.value for row in found.rows()}


def _link() -> Iterator[Within]:
    """Yield how far a replay of the link is from its log, and what is identified from it."""
    log = link_log()
    replayed = hw.replay(log, "single_pendulum", parameters=GIVEN, restart=0.6)
    yield "largest", "a replay of its own motion", _rows(replayed)["largest"], 0.0, 1e3 * CLOSE
    for engine in ("mujoco:matched", "pinocchio:law"):  # in coordinates of their own
        with suppress(EngineUnavailable):
            other = hw.replay(log, "single_pendulum", parameters=GIVEN, restart=0.6, wanted=(engine,))
            yield "largest", f"a replay of its own motion in {engine}", _rows(other)["largest"], 0.0, 1e3 * CLOSE
    more = GIVEN | {"I1": 1.4 * INERTIA, "k1": 0.7 * DRAG}
    fit = hw.identify(link_log(LATE), "single_pendulum", ["I1", "k1", "delay"], parameters=more, restart=1.2, hold=0)
    for name, wanted in (("I1", INERTIA), ("k1", DRAG), ("delay", LATE)):
        yield f"estimate of {name}", "a link of known motion", fit[name].value, wanted, 1e3 * CLOSE * wanted
        yield f"interval of {name}", "a link without noise", fit[name].high - fit[name].low, 0.0, 1e4 * CLOSE * wanted


def _ball() -> Iterator[Within]:
    """Yield metrics of a ball whose windows start at what is measured late: ahead by g a d + g d^2/2 at the age a."""
    t = STEP * np.arange(round(FLIES / STEP) + 2)
    true = t - DELAY
    heights = HEIGHT + SPEED * true - 0.5 * G * true**2
    text = "\n".join(["t,h", *(f"{a!r},{1e3 * b!r}" for a, b in zip(t.tolist(), heights.tolist(), strict=True))])
    found = hw.replay(read(text, BALL), "ball", parameters={"gravity": G}, restart=WINDOW)
    found = replace(found, predictions=tuple(replace(one, wall_s=WALL) for one in found.predictions))
    rows, count = _rows(found), round(WINDOW / STEP)
    ages = np.concatenate([STEP * np.arange(count + 1) - DELAY] * 2)
    ahead = G * (ages * DELAY + 0.5 * DELAY**2)
    told = "a ball that is recorded late"
    yield "windows", told, float(len(found.windows)), 2.0, 0.0
    for row in found.rows():
        yield "unit", f"{row.metric}, {row.unit}", float(row.unit != UNITS.get(row.metric, "m")), 0.0, 0.0
    yield "bias", told, rows["bias"], math.fsum(ahead) / len(ahead), CLOSE
    yield "rmse", told, rows["rmse"], math.sqrt(math.fsum(ahead**2) / len(ahead)), CLOSE
    yield "largest", told, rows["largest"], float(ahead.max()), CLOSE
    y = found.measured[:, 0]
    spread = math.sqrt(math.fsum((y - math.fsum(y) / len(y)) ** 2))
    yield "fit", told, rows["fit"], 100.0 * (1.0 - math.sqrt(math.fsum(ahead**2)) / spread), 1e-3
    for age in (0.5 * WINDOW, WINDOW):
        wanted = G * ((age - DELAY) * DELAY + 0.5 * DELAY**2)
        for name in ("median", "90"):
            yield f"error_{age:g}s_{name}", told, rows[f"error_{age:g}s_{name}"], wanted, CLOSE
    yield "speed", told, rows["speed"], 2.0 * WINDOW / WALL, EXACT
    yield "windows_failed", told, rows["windows_failed"], 0.0, 0.0
    draw = np.random.default_rng(6)
    left = [w.y + UNLIKE * draw.normal(size=w.y.shape) for w in found.windows]
    noisy = _rows(replace(found, windows=tuple(replace(w, y=y) for w, y in zip(found.windows, left, strict=True))))
    rest = [(y - yhat) ** 2 for y, yhat in zip(left, found.predictions[0].y, strict=True)]
    wanted = math.sqrt(float(np.mean(np.concatenate(rest))) - noisy["noise"] ** 2)
    yield "noise", "a ball whose record is noisy", noisy["noise"], UNLIKE, 2.0 * ALIKE * UNLIKE
    yield "unexplained", "a ball whose record is noisy", noisy["unexplained"], wanted, CLOSE
    failed = replace(found.predictions[0], outcomes=(Outcome.NOT_FINITE, Outcome.FINISHED))
    one = _rows(replace(found, predictions=(failed,)))
    yield "windows_failed", "a prediction that failed once", one["windows_failed"], 1.0, 0.0


def _bounces() -> Iterator[Within]:
    """Yield how late, and by how much weaker, the impacts of a prediction are than those that are measured."""
    t = STEP * np.arange(round(FLIES / STEP) + 2)
    text = "\n".join(["t,h", *(f"{a!r},1000.0" for a in t.tolist())])
    found = hw.replay(read(text, BALL), "ball", parameters={"gravity": G}, restart=0.0)
    (window,), (one,) = found.windows, found.predictions
    at, late, up, less = 0.3, 0.03, 2.5, 0.8
    falls, shifted = (np.where(window.t < hit, hit - window.t, keeps * up * (window.t - hit))[:, None]
                      for hit, keeps in ((at, 1.0), (at + late, less)))  # fmt: skip
    made: Any = replace(found, windows=(replace(window, y=falls),), predictions=(replace(one, y=(shifted,)),), mass=2.0)
    rows, told = _rows(made), "a ball that bounces late"
    yield "impact_offset_median", told, rows["impact_offset_median"], late, 1e-6
    yield "impact_offset_largest", told, rows["impact_offset_largest"], late, 1e-6
    yield "impulse_measured", told, rows["impulse_measured"], 2.0 * (1.0 + up), 1e-6
    yield "impulse_error", told, rows["impulse_error"], 2.0 * up * (less - 1.0), 1e-6
    yield "impacts_too_many", told, rows["impacts_too_many"], 0.0, 0.0
    for more, (seen, said) in ((1.0, (at, LATER)), (-1.0, (LATER, at))):  # of two impacts the other motion has one
        first, second = (_fallen(window.t, (at, hit)) for hit in (seen, said))
        both: Any = replace(made, windows=(replace(window, y=first),), predictions=(replace(one, y=(second,)),))
        yield "impacts_too_many", "a ball that bounces once more or less", _rows(both)["impacts_too_many"], more, 0.0


LATER = 0.5
"""When a ball bounces again, s."""
FALLS = (0.117, 0.31, 0.4852)
"""When a motion is bent, s: between samples and at one."""


def _fallen(t: Floats, hits: tuple[float, ...]) -> Floats:
    """Return a motion (n, 1) whose rate changes by so much at each of some instants, of the same ones but once."""
    bent: Floats = np.sum([HEIGHT * np.maximum(t - hit, 0.0) for hit in sorted(set(hits))], axis=0)
    return bent[:, None]


def _impacts() -> Iterator[Within]:
    """Yield when impacts are, and how strong, of a motion that is straight between them."""
    t, jumps = STEP * np.arange(62, dtype=np.float64), np.array([4.0, 3.0, 2.5])
    y: Floats = -SPEED * t + np.sum(
        [jump * np.maximum(t - hit, 0.0) for hit, jump in zip(FALLS, jumps, strict=True)], axis=0
    )
    found, told = rates.impacts(t, y, 0.2 * jumps[-1] / STEP), "a motion with three impacts"
    yield "impacts", told, float(len(found.t)), float(len(FALLS)), 0.0
    for k, (hit, jump) in enumerate(zip(FALLS, jumps.tolist(), strict=True)):
        if k < len(found.t):
            yield f"instant of impact {k}", told, float(found.t[k]), hit, EXACT
            yield f"strength of impact {k}", told, float(found.jump[k]), jump, EXACT
    other = replace(found, t=found.t[[0, 2]] + LATE, jump=found.jump[[0, 2]] - 1.0)
    for k, (late, weaker) in enumerate(zip(*rates.matched(found, other), strict=True)):
        yield f"how late impact {k} is", told, float(late), LATE, EXACT
        yield f"how much weaker impact {k} is", told, float(weaker), -1.0, EXACT


def _needed() -> Iterator[Within]:
    """Yield the torques that the motion of the link needs, away from their changes, and how well these are known."""
    found = hw.inverse(link_log(), "single_pendulum", parameters=GIVEN, half=6, degree=4)
    t = found.t - BEGINS
    quiet = np.min(np.abs(t[:, None] - HELD * np.arange(len(TORQUES) + 1)), axis=1) > 8.0 * STEP
    off = np.abs(found.value[:, 0] - _torque(t))[quiet]
    told = "the link of known torques"
    yield "torque that is needed", told, float(np.max(off)), 0.0, 1e-3 * max(map(abs, TORQUES))
    noisy = hw.inverse(link_log(0.0, NOISE), "single_pendulum", parameters=GIVEN, half=6, degree=4)
    spread = float(np.sqrt(np.mean((noisy.value[quiet, 0] - _torque(t)[quiet]) ** 2)))
    mean = float(np.sqrt(np.mean(noisy.std[quiet, 0] ** 2)))
    yield "deviation of torques", "a link of known noise", mean, spread, 2.0 * ALIKE * spread
    yield "instants of torques", told, float(t[0]), 6.0 * STEP, EXACT


def _formed() -> Iterator[Within]:
    """Yield how far states of models that engines run in coordinates of their own are off, there and back."""
    for name in CHAINS:
        model = load_model(name)
        numbers = {key: float(one.default) for key, one in model.parameters.items()}
        y = np.linspace(0.4, 1.1, len(model.measured))
        segment = Segment(t_end=1.0, y=y, yd=-y)
        for row in form_of_case(model.build(numbers, segment)):
            yield row.quantity, name, row.difference, 0.0, row.tolerance
