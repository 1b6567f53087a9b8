"""What must be said of how far estimates and residuals of made-up data can be relied on: each by a sum of its own.

Halves that were made to differ, noise that is correlated by a known part, channels of unlike noise, parameters that
nothing depends on, windows that were held out, a residual that follows an input, rotations nearly a turn apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy import stats

from crossbody import hw
from crossbody.cases.arrays import Floats
from crossbody.hw.fitting.covariance import Layout, scatter
from crossbody.hw.fitting.derivative import Exact
from crossbody.hw.fitting.doubts import agreement, moves
from crossbody.hw.windows.whiteness import Correlation, autocorrelation, crosscorrelation, stride_of
from crossbody.hw.windows.window import recorded_inputs, windows
from crossbody.reports.judging.asked import Found, Within, unlike
from crossbody.reports.replay import comparison
from crossbody.reports.replay import known_replay as known
from crossbody.reports.replay.known_fits import flight

EXACT, DRAWN = 1e-9, 0.25
"""By which part sums in another order differ; and what deviations of so few draws are known to."""
HALF, APART = 60, 0.5
"""Samples of half of the data, and by how much what it says differs from the other's."""
CORRELATED, LONG, UNLIKE = 0.8, 4000, (1.0, 7.0)
"""Of noise: from sample to sample, number of samples, and sizes in two channels."""
BEHIND, PERIOD, BAND = 3, 240, 0.85
"""Samples by which a residual follows an input; of a wave; and the least part of white ones that is inside its band."""
DRIVEN = (
    known.BALL
    + """
[inputs.u]
column = "u"
unit = "N"
delay = 0.02
"""
)


@cache
def wrong() -> tuple[Found, ...]:
    """Return what, number, least and most, and of what, where it is another one."""
    kinds = (_halves, _correlated, _channels, _unseen, _held, _moved, _residuals, _tables, _delayed, _turns)
    return unlike(kinds, "doubt", "data that end in")


def _halves() -> Iterator[Within]:
    """Yield what both halves say of a constant, and how probable it is that they mean the same."""
    draw = np.random.default_rng(5)
    J, layout = np.ones((2 * HALF, 1)), Layout(samples=(HALF, HALF), k=1)
    for apart in (0.0, APART):
        noise = 0.1 * draw.normal(size=2 * HALF)
        residual = noise + np.repeat([apart, -apart], HALF)
        (said,) = agreement(J, residual - residual.mean(), layout, np.zeros(1), np.ones(1), ["a"], ())
        parts = np.split(residual - residual.mean(), 2)
        means = [math.fsum(part) / HALF for part in parts]
        stds = [
            math.sqrt(math.fsum((part - mean) ** 2) / (HALF - 1) / HALF)
            for part, mean in zip(parts, means, strict=True)
        ]
        z = abs(means[0] - means[1]) / math.hypot(*stds)
        count = math.hypot(*stds) ** 4 * (HALF - 1) / sum(std**4 for std in stds)
        told = f"halves of data that differ by {2.0 * apart:g}"
        for k in range(2):
            yield f"value of half {k}", told, said.values[k], means[k], EXACT
            yield f"deviation of half {k}", told, said.stds[k], stds[k], EXACT
        yield "difference of halves", told, said.values[0] - said.values[1], means[0] - means[1], EXACT
        yield "probability", told, said.probability, 2.0 * float(stats.t.sf(z, count)), EXACT
        yield "agree", told, float(said.agrees), float(apart == 0.0), 0.0


def _correlated() -> Iterator[Within]:
    """Yield the deviation of a mean whose noise is correlated from sample to sample, and by how much it is."""
    draw, noise = np.random.default_rng(11), np.zeros(LONG)
    for k, fresh in enumerate(draw.normal(size=LONG).tolist()):
        noise[k] = CORRELATED * noise[k - 1] + fresh if k else fresh / math.sqrt(1.0 - CORRELATED**2)
    Q = np.full((LONG, 1), LONG**-0.5)
    found = scatter(Q, np.full((LONG, 1), 1.0 / LONG), noise - noise.mean(), Layout(samples=(LONG // 20,) * 20, k=1))
    wanted = 1.0 / (1.0 - CORRELATED) / math.sqrt(LONG)
    yield "deviation", "a mean of correlated noise", float(found.std[0]), wanted, 2.0 * DRAWN * wanted
    yield "correlation of noise", "correlated noise", found.correlation, CORRELATED, 0.05


def _channels() -> Iterator[Within]:
    """Yield the deviations of the means of two channels with noises of unlike sizes."""
    draw, n = np.random.default_rng(12), LONG // 4
    own = np.concatenate([size * draw.normal(size=n) for size in UNLIKE])
    L = np.kron(np.eye(2), np.full((n, 1), 1.0 / n))
    left = own - L @ (n * (L.T @ own))
    found = scatter(math.sqrt(n) * L, L, left, Layout(samples=(n,), k=2))
    for k, part in enumerate(np.split(left, 2)):
        wanted = math.sqrt(math.fsum(part**2) / (n - 1) / n)
        yield f"deviation of channel {k}", "two channels of unlike noise", float(found.std[k]), wanted, EXACT


@cache
def _log() -> hw.Log:
    """Return the log of a ball in flight."""
    return flight()[2]


@cache
def _flight(windows: float, hold: int, *free: str, most: float = 20.0) -> hw.Fit:
    bounds = {"gravity": (5.0, most)}
    return hw.identify(_log(), "ball", free, parameters={"gravity": 9.0}, restart=windows, hold=hold, bounds=bounds)


def _unseen() -> Iterator[Within]:
    """Yield what is said of a parameter of contact from a flight without one: that it has no effect."""
    fit, told = _flight(0.0, 0, "gravity", "a1"), "a parameter that nothing depends on"
    said = [warning for warning in fit.warnings if "a1" in warning]
    yield "identifiable", told, float(fit["a1"].identifiable), 0.0, 0.0
    yield "identifiable", "a parameter that all depends on", float(fit["gravity"].identifiable), 1.0, 0.0
    yield (
        "identifiable",
        "an estimate at a bound",
        float(_flight(0.0, 0, "gravity", most=9.5)["gravity"].identifiable),
        0.0,
        0.0,
    )
    yield "combinations without effect", told, float(len(fit.unseen)), 1.0, 0.0
    yield "said of no effect", told, float(any("no effect" in warning for warning in said)), 1.0, 0.0
    flat = any("the rmse changes by" in warning for warning in said)
    yield "said of twice and half its value", told, float(flat), 1.0, 0.0


def _held() -> Iterator[Within]:
    """Yield which windows are held out, and by how much a fit is worse on them."""
    fit = _flight(0.16, 2, "gravity")
    for side, numbers in (((0, 2), fit.fitted), ((1, 3), fit.held)):
        yield "windows", "a log of four windows", float(side == numbers), 1.0, 0.0
    for after, wanted in ((3.0, 50.0), (1.0, 0.0)):
        other = replace(fit, before={"rmse": (1.0, 2.0)}, after={"rmse": (0.5, after)})
        yield "worse", "a fit of known errors", other.worse, wanted, EXACT


def _moved() -> Iterator[Within]:
    """Yield by how much a free start moves an inertia, how well it is known then, and whether noise explains that.

    To first order: of what a start makes of angles, 1 and T (1 - e^(-t/T)), nothing is left in residuals, nor in the
    derivative by the inertia.
    """
    t: Floats = known.STEP * np.arange(known.SAMPLES, dtype=np.float64)
    settles = (known.INERTIA + known.MASS * known.REACH**2) / known.DRAG
    log, model = known.link_log(0.0, known.NOISE), hw.models.load("single_pendulum")
    start = np.column_stack([np.ones(known.SAMPLES), settles * (1.0 - np.exp(-t / settles))])
    cut, more = windows(log, model, 0.0), 1e-4 * known.INERTIA
    J: Any = (known.turned(t, known.INERTIA + more) - known.turned(t, known.INERTIA - more)) / (2.0 * more)
    J = J - start @ np.linalg.lstsq(start, J, rcond=None)[0]
    for off, refuted in ((0.0, False), (1e-2, True), (-1e-2, True)):
        inertia, told = (1.0 + off) * known.INERTIA, f"an inertia {off:g} off"
        left = log.channel("coordinates", "th1").values - known.turned(t, inertia)
        by = float(J @ left) / float(J @ J)
        rest = left - start @ np.linalg.lstsq(start, left, rcond=None)[0] - by * J
        std = math.sqrt(float(rest @ rest) / (known.SAMPLES - 3) / float(J @ J))
        problem = Exact(model, {**model.numbers(known.GIVEN), "I1": inertia}, ["I1"], cut, False, 1)
        found = moves(problem, np.array([inertia]), np.array([known.INERTIA]), [])[0]
        yield "move by free starts", told, found.by, by, 0.02 * abs(by) + 0.1 * std
        yield "deviation with free starts", told, found.std, std, DRAWN * std
        yield "refuted", told, float(found.refuted), float(refuted), 0.0


def _residuals() -> Iterator[Within]:
    """Yield at which lag a residual follows an input, how much is inside a band, and how long means may be."""
    draw = np.random.default_rng(13)
    u, own = draw.normal(size=(2, 800))
    found = crosscorrelation(np.roll(u, BEHIND), u)
    at = int(found.lags[int(np.argmax(np.abs(found.values)))])
    yield "lag", "a residual that follows an input", float(at), float(BEHIND), 0.0
    yield "correlation", "a residual that is an input", float(np.max(found.values)), 1.0, 0.02
    for what, residual, most in (("white", own, 1.0), ("slow", np.cumsum(own), 1.0 - BAND)):
        inside = autocorrelation(residual).inside
        yield "inside", f"a residual that is {what}", inside, most, 1.0 - BAND
    wave = np.sin(2.0 * math.pi * np.arange(20 * PERIOD) / PERIOD)
    yield "samples of a mean", "a wave", float(stride_of(wave, 0.0)), PERIOD / 12.0, 1.0


def _tables() -> Iterator[Within]:
    """Yield how much is inside a band on both of its sides, and rows of what pages show of residuals."""
    lags = Correlation(lags=np.arange(4), values=np.array([1.0, -0.9, 0.01, 0.5]), band=0.1)
    yield "inside", "a residual that changes its sign", lags.inside, 1.0 / 3.0, EXACT
    yield "inside", "a residual against an input", replace(lags, lags=lags.lags + 1).inside, 1.0 / 4.0, EXACT
    replayed = hw.replay(_log(), "ball", restart=0.0)
    (one,) = replayed.predictions[:1]
    told, some, shown = "a replay of a ball", 7, comparison.residuals(replayed, points=7)
    yield "rows of residuals", told, float(len(shown)), float(some * len(replayed.predictions)), 0.0
    at = np.linspace(0, len(replayed.time) - 1, some).astype(int)
    left = replayed.measured[:, 0] - np.concatenate([y[:, 0] for y in one.y])
    for name, wanted in (("t", replayed.time), ("measured", replayed.measured[:, 0]), ("value", left)):
        if name in shown:
            off = float(np.max(np.abs(shown[name].to_numpy()[:some] - wanted[at])))
            yield f"{name} of residuals", told, off, 0.0, EXACT
    means = replace(lags, stride=5)
    made: Any = SimpleNamespace(
        predictions=(SimpleNamespace(engine="e", profile="p", failed=0),), coordinates=(SimpleNamespace(name="h"),),
        tells=lambda _: True, autocorrelation=lambda *_: means, windows=(SimpleNamespace(u=np.zeros((1, 0))),),
        log=SimpleNamespace(sample_time=known.STEP),
    )  # fmt: skip
    rows = comparison.correlations(made)
    for name, column in (("lag_s", 5.0 * known.STEP * lags.lags), ("value", lags.values), ("lag", lags.lags)):
        yield f"{name} of correlations", told, float(np.max(np.abs(rows[name] - column))), 0.0, EXACT


def _delayed() -> Iterator[Within]:
    """Yield an input that is recorded two samples late, where it was in force."""
    text = "\n".join(["t,h,u", *(f"{0.01 * k!r},1000.0,{float(k)!r}" for k in range(12))])
    log: Any = known.read(text, DRIVEN)
    model: Any = SimpleNamespace(inputs=("u",), name="made up")
    found = recorded_inputs(log, model)[:, 0]
    yield "input", "a log whose input is late", float(found[5]), 7.0, EXACT


def _turns() -> Iterator[Within]:
    """Yield what is left of rotations about one axis that are nearly a turn apart: the short way."""
    axis, t = np.array([0.6, 0.0, 0.8]), known.STEP * np.arange(9)

    def turned(angle: float) -> Floats:
        found: Floats = np.tile(angle * axis, (len(t), 1))
        return found

    ball = hw.replay(_log(), "ball", restart=0.0)
    (window,), (one,) = ball.windows, ball.predictions[:1]
    made = replace(
        ball, windows=(replace(window, y=turned(3.0)),), predictions=(replace(one, y=(turned(-3.0),)),), turns=(0,)
    )
    left = float(np.linalg.norm(made.residual(made.predictions[0])[0]))
    yield "residual", "rotations that are nearly a turn apart", left, 2.0 * math.pi - 6.0, 1e-6
