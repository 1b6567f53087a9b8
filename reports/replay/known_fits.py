"""What an identification must say of logs whose least squares are written out here: estimates and their intervals.

A ball in flight from a known start is linear in gravity, y = h + v t - g t^2/2, and its windows start as measured: so
the derivative is -t^2/2 whatever step it is taken over. A link that turns about its end without weight
(`known_replay`) is identified with its start. Of white residuals r of n samples, J their derivatives by p unknowns, a
deviation is the root of r.r/(n - p) (J^T J)^-1, and half an interval so many of it as Student's t with n - p degrees
of freedom has at 97.5 %.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache

import numpy as np
from scipy import stats

from crossbody import hw
from crossbody.cases.arrays import Floats
from crossbody.hw import Estimate
from crossbody.hw.fitting import covariance
from crossbody.hw.fitting.difference import Differences
from crossbody.hw.fitting.doubts import SPAN
from crossbody.hw.windows.window import windows
from crossbody.reports.judging.asked import Found, Within, unlike
from crossbody.reports.replay import known_replay as known

FIRST, PART, CURVED = 1e-5, 2e-3, 1e-2
"""By which part numbers may be off: of what engines leave; of what a linear problem, and one that is nearly so, makes
of deviations."""
FLIES, HEIGHT, SPEED, GUESS, STILL = 0.64, 3.0, 4.0, 7.0, 12
"""Of the ball: s, m, m/s, m/s^2, and samples at its start that have no noise."""
ASKED = 0.95
"""Part of all intervals that have the true value in them."""
SCATTERS = 0.2
"""By how much the correlation of 600 neighbours is another one than was drawn: five deviations, (1 - rho^2)/sqrt(n)."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return what, number, least and most, and of which log, where it is another one."""
    return unlike((_ball, _link, _correlated), "identification", "a log that ends in")


def _least_squares(J: Floats, y: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Return unknowns (p,), their deviations and halves of intervals (p,), and the residual (n,)."""
    x = np.asarray(np.linalg.lstsq(J, y, rcond=None)[0], dtype=np.float64)
    left, free = y - J @ x, len(y) - J.shape[1]
    std = np.asarray(np.sqrt(float(left @ left) / free * np.diag(np.linalg.inv(J.T @ J))), dtype=np.float64)
    return x, std, stats.t.ppf(0.5 + 0.5 * ASKED, free) * std, left


def _told(name: str, what: str, found: Estimate, wanted: tuple[float, float, float], part: float) -> Iterator[Within]:
    value, std, half = wanted
    yield f"estimate of {name}", what, found.value, value, part * std
    yield f"deviation of {name}", what, found.std, std, part * std
    for end, sign in ((found.low, -1.0), (found.high, 1.0)):
        yield f"interval of {name}", what, end, value + sign * half, 2.0 * part * half


def flight(still: int = -1) -> tuple[Floats, Floats, hw.Log]:
    """Return instants, s, noisy heights, m, and the log of a ball in flight, up to a sample without noise."""
    t = known.STEP * np.arange(round(FLIES / known.STEP) + 1, dtype=np.float64)
    noise = known.NOISE * np.random.default_rng(8).normal(size=len(t)) * (np.arange(len(t)) > still)
    heights = HEIGHT + SPEED * t - 0.5 * known.G * t**2 + noise
    text = "\n".join(["t,h", *(f"{a!r},{1e3 * b!r}" for a, b in zip(t.tolist(), heights.tolist(), strict=True))])
    return t, heights, known.read(text, known.BALL.replace(f"delay = {known.DELAY}", ""))


def _ball() -> Iterator[Within]:
    """Yield gravity from a flight of known start, its derivative, interval and profile: no part of it is curved."""
    t, heights, log = flight(STILL)
    model = hw.models.load("ball")
    (cut,) = windows(log, model, 0.0)
    (height,), (speed,) = cut.segment.y, cut.segment.yd
    told = "a flight of a ball"
    J = (-0.5 * t[:, None] ** 2).astype(np.float64)
    (g,), (std,), (half,), left = _least_squares(J, heights - height - speed * t)
    fit = hw.identify(log, "ball", ["gravity"], parameters={"gravity": GUESS}, restart=0.0, hold=0)
    yield from _told("gravity", told, fit["gravity"], (float(g), float(std), float(half)), PART)
    values, costs = fit.profile["gravity"]
    yield "profile", told, float(costs[-1]), 1.0 + SPAN**2 / (len(t) - 1), PART
    yield "values of a profile", told, float(values[-1] - values[0]), 2.0 * SPAN * float(std), PART * float(std)
    yield "rmse", told, fit.after["rmse"][0], float(np.sqrt(np.mean(left**2))), FIRST * known.NOISE
    problem = Differences(model, model.numbers(None), ["gravity"], [cut], False, 1, "")
    slopes = problem.jacobian(np.array([GUESS]))
    worst = int(np.argmax(np.abs(slopes + J)))
    yield "derivative", told, float(slopes[worst, 0]), -float(J[worst, 0]), FIRST * float(np.abs(J).max())


def _link() -> Iterator[Within]:
    """Yield the inertia of a link from noisy angles, beside least squares in it and its start, to first order."""
    t, step = known.STEP * np.arange(known.SAMPLES, dtype=np.float64), 1e-4 * known.INERTIA
    settles = (known.INERTIA + known.MASS * known.REACH**2) / known.DRAG
    slope = (known.turned(t, known.INERTIA + step) - known.turned(t, known.INERTIA - step)) / (2.0 * step)
    J = np.column_stack([slope, np.ones(known.SAMPLES), settles * (1.0 - np.exp(-t / settles))])
    log = known.link_log(0.0, known.NOISE)
    x, std, half, _ = _least_squares(J, log.channel("coordinates", "th1").values - known.turned(t))
    given = known.GIVEN | {"I1": 1.2 * known.INERTIA}
    fit = hw.identify(log, "single_pendulum", ["I1"], parameters=given, restart=0.0, hold=0)
    wanted = known.INERTIA + float(x[0]), float(std[0]), float(half[0])
    yield from _told("I1", "a link with noise", fit["I1"], wanted, CURVED)
    more = 1e-4 * known.DRAG
    drags = (known.turned(t, drag=known.DRAG + more) - known.turned(t, drag=known.DRAG - more)) / (2.0 * more)
    both = np.column_stack([J, drags])
    scatter = np.linalg.inv(both.T @ both)
    fit = hw.identify(log, "single_pendulum", ["I1", "k1"], parameters=given, restart=0.0, hold=0)
    together = float(scatter[0, 3] / math.sqrt(scatter[0, 0] * scatter[3, 3]))
    yield "correlation of I1 and k1", "a link with noise", float(fit.correlation[0, 1]), together, CURVED


def _correlated() -> Iterator[Within]:
    """Yield the covariance, and correlation, of estimates from residuals that follow each other by a known part.

    Of two windows of noise with V_ij = rho^|i - j| in each, and weights L: that is L' V L times the noise's variance.
    """
    draw, count, rho = np.random.default_rng(21), 300, 0.6
    gaps = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    V = np.kron(np.eye(2), rho**gaps)
    noise = np.linalg.cholesky(V) @ draw.normal(size=2 * count)
    t = np.tile(np.arange(count) / count, 2)
    Q, R = np.linalg.qr(np.stack([np.ones(2 * count), t, t * t], axis=1))
    L = Q @ np.linalg.inv(R).T
    residual = noise - Q @ (Q.T @ noise)
    found, told = covariance.scatter(Q, L, residual, covariance.Layout(samples=(count, count), k=1)), "noise that lasts"
    V = np.kron(np.eye(2), found.correlation**gaps)
    wanted = L.T @ V @ L
    size = np.sqrt(np.diag(wanted))
    of_estimates = found.covariance / np.outer(found.std, found.std)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        yield "correlation", told, float(of_estimates[i, j]), float(wanted[i, j] / (size[i] * size[j])), 1e-9
    yield "correlation of neighbours", told, found.correlation, rho, SCATTERS
    place, each = (np.arange(count) + 0.5) / count, covariance.PARTS // 2
    waves = np.kron(np.eye(2), np.cos(np.pi * np.outer(place, np.arange(each))) * np.sqrt([1.0, *[2.0] * (each - 1)]))
    for i in range(3):
        parts = L[:, i : i + 1] * waves / np.sqrt(each)
        cut = parts - Q @ (Q.T @ parts)
        known, A = float(np.sum((parts.T @ residual) ** 2)), cut.T @ V @ cut
        std = math.sqrt(known * float(wanted[i, i]) / float(np.trace(A)))
        yield "deviation", told, float(found.std[i]), std, 1e-9 * std
        freedom = float(np.trace(A)) ** 2 / float(np.sum(A * A))
        half = std * stats.t.ppf(0.5 + 0.5 * ASKED, freedom)
        yield "half of an interval", told, float(found.half[i]), half, 1e-6 * std
