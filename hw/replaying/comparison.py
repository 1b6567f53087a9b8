"""What a replay finds: the measurement beside what every engine predicts, window by window."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from crossbody.cases import Coordinate, Limit, Outcome, Trajectory, Value
from crossbody.cases.arrays import Floats
from crossbody.hw.reading.log import Log
from crossbody.hw.replaying import measures as _measures
from crossbody.hw.windows.rates import impacts, least_of, matched, rates_by_fit
from crossbody.hw.windows.turns import deviation, difference, increments, way
from crossbody.hw.windows.whiteness import Correlation, autocorrelation, crosscorrelation, noise_level, stride_of
from crossbody.hw.windows.window import Window

ENOUGH = 50
"""Averages of residuals from which on their correlations tell something: the band is then .36 wide."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prediction:
    """What one engine makes of every window.

    Attributes:
        engine, profile: who ran.
        settings: what was really used.
        y: for every window (n, k): the measured coordinates as predicted at the instants of the samples.
        yd: their rates.
        outcomes: how each window's run ended.
        messages: where and why, for those that failed.
        wall_s: time of all runs, s.
        steps: of all runs.
    """

    engine: str
    profile: str
    settings: Mapping[str, Any]
    y: tuple[Floats, ...]
    yd: tuple[Floats, ...]
    outcomes: tuple[Outcome, ...]
    messages: tuple[str, ...] = ()
    wall_s: float = 0.0
    steps: int = 0

    @property
    def failed(self) -> int:
        """Windows whose run did not reach their end."""
        return sum(not outcome.ok for outcome in self.outcomes)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One number about one prediction: `channel` of the log, or empty for all of them together."""

    engine: str
    profile: str
    metric: str
    channel: str
    value: float
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """A log beside the predictions of a model.

    Attributes:
        log: what was recorded, with its findings and its provenance.
        model, title: what it was replayed on.
        kind: "forward" or "closed_loop".
        parameters: of the model.
        coordinates: names and units of what is compared.
        windows: stretches, each started anew from the measurement.
        predictions: one an engine.
        skipped: engine, profile -> why there is none.
        delay: of the measured coordinates beyond what the column map says, s.
        falls: which coordinate jumps in its rate at impacts; -1 for none.
        mass: of what strikes, kg.
        limits: of the model.
        turns: of each rotation among the coordinates, the first of its three columns.
    """

    log: Log
    model: str
    title: str
    kind: str
    parameters: Mapping[str, Value]
    units: Mapping[str, str]
    coordinates: tuple[Coordinate, ...]
    windows: tuple[Window, ...]
    predictions: tuple[Prediction, ...]
    skipped: Mapping[tuple[str, str], str] = field(default_factory=lambda: MappingProxyType({}))
    delay: float = 0.0
    falls: int = -1
    mass: float = 1.0
    limits: tuple[Limit, ...] = ()
    turns: tuple[int, ...] = ()

    @property
    def measured(self) -> Floats:
        """All samples of all windows (n, k)."""
        return np.concatenate([w.y for w in self.windows])

    @property
    def time(self) -> Floats:
        """Their recorded times (n,), s; a restart stands twice."""
        return np.concatenate([w.t for w in self.windows])

    def after(self, prediction: Prediction, age: float) -> Floats:
        """Largest |error| over the coordinates at a time after each restart, s, without shorter windows."""
        found = []
        for window, yhat in zip(self.windows, prediction.y, strict=True):
            k = int(np.searchsorted(window.t - window.t[0], age - 1e-9))
            if k < len(window.t):
                off = difference(window.y[k : k + 1], yhat[k : k + 1], self.turns)
                found.append(float(np.max(np.abs(off))))
        return np.array(found)

    def residual(self, prediction: Prediction) -> Floats:
        """Measured less predicted (n, k), all windows; NaN where a run ended early.

        Of rotations it is the logarithm of the relative one, at most pi long.
        """
        return np.concatenate(self._residuals(prediction))

    def _residuals(self, prediction: Prediction) -> list[Floats]:
        return [difference(w.y, yhat, self.turns) for w, yhat in zip(self.windows, prediction.y, strict=True)]

    def _pieces(self, prediction: Prediction, channel: int) -> list[tuple[Window, Floats]]:
        """Windows with the residuals of one coordinate, where all of them are finite."""
        pairs = zip(self.windows, self._residuals(prediction), strict=True)
        return [(w, r[:, channel]) for w, r in pairs if np.all(np.isfinite(r[:, channel]))]

    def noise(self, channel: int) -> float:
        """Size of the measurement's noise, or rounding, in one coordinate."""
        return noise_level(self._motion(channel))

    def _motion(self, channel: int) -> list[Floats]:
        """Measured values of one coordinate, window by window; of a rotation its way, without jumps."""
        return [way(w.y, self.turns)[:, channel] for w in self.windows]

    def autocorrelation(self, prediction: Prediction, channel: int) -> Correlation:
        """Of the residuals of one coordinate in the windows that were run to their end; see `whiteness`."""
        stride, floor = self._scales(channel)
        return autocorrelation([r for _, r in self._pieces(prediction, channel)], stride=stride, floor=floor)

    def crosscorrelation(self, prediction: Prediction, channel: int, which: int) -> Correlation:
        """Of the same residuals with one recorded input."""
        stride, floor = self._scales(channel)
        pieces = self._pieces(prediction, channel)
        left, inputs = [r for _, r in pieces], [w.u[:, which] for w, _ in pieces]
        return crosscorrelation(left, inputs, stride=stride, floor=floor)

    def tells(self, channel: int) -> bool:
        """Whether there are averages enough to test residuals of a coordinate for what the model misses."""
        stride, _ = self._scales(channel)
        return sum(len(w.t) // stride for w in self.windows) >= ENOUGH

    def _scales(self, channel: int) -> tuple[int, float]:
        """Samples to average, and the error that is not worth telling."""
        motion = self._motion(channel)
        noise = noise_level(motion)
        return stride_of(motion, noise), noise

    def rows(self) -> tuple[Row, ...]:
        """Every metric of every prediction."""
        return tuple(row for prediction in self.predictions for row in self._of(prediction))

    def _of(self, prediction: Prediction) -> Iterator[Row]:
        def row(metric: str, value: float, unit: str, channel: str = "") -> Row:
            return Row(
                engine=prediction.engine, profile=prediction.profile, metric=metric,
                channel=channel, value=value, unit=unit,
            )  # fmt: skip

        y, left = deviation(self.measured, self.turns), self.residual(prediction)
        yhat = np.concatenate(prediction.y)
        for turn in self.turns:
            yhat[:, turn : turn + 3] = (y - left)[:, turn : turn + 3]
        steps, said = (
            [increments(one, self.turns) for one in side] for side in ([w.y for w in self.windows], prediction.y)
        )
        for i, c in enumerate(self.coordinates):
            a, b = y[:, i], yhat[:, i]
            yield row("fit", _measures.fit(a, b), "%", c.name)
            for name, measure in (("rmse", _measures.rmse), ("largest", _measures.largest), ("bias", _measures.bias)):
                yield row(name, measure(a, b), c.unit, c.name)
            late = _measures.shift([s[:, i] for s in steps], [s[:, i] for s in said], self.log.sample_time)
            yield row("delay", late, "s", c.name)
            noise = self.noise(i)
            yield row("noise", noise, c.unit, c.name)
            yield row("unexplained", math.sqrt(max(float(np.mean((a - b) ** 2)) - noise**2, 0.0)), c.unit, c.name)
            if np.all(np.isfinite(b)) and self.tells(i):
                inside = 100.0 * self.autocorrelation(prediction, i).inside
                yield row("autocorrelation_inside", inside, "%", c.name)
                for j in range(self.windows[0].u.shape[1]):
                    inside = 100.0 * self.crosscorrelation(prediction, i, j).inside
                    yield row(f"crosscorrelation_{j + 1}_inside", inside, "%", c.name)
        unit = self.coordinates[0].unit if len({c.unit for c in self.coordinates}) == 1 else "mixed"
        for age in self._ages():
            errors = self.after(prediction, age)
            yield row(f"error_{age:g}s_median", _quantile(errors, 50.0), unit)
            yield row(f"error_{age:g}s_90", _quantile(errors, 90.0), unit)
        for metric, value, unit in self._impacts(prediction):
            yield row(metric, value, unit, self.coordinates[self.falls].name)
        yield row("windows_failed", float(prediction.failed), "1")
        yield row("speed", sum(w.segment.t_end for w in self.windows) / max(prediction.wall_s, 1e-12), "s/s")

    def _impacts(self, prediction: Prediction) -> Iterator[tuple[str, float, str]]:
        """How far impacts are from the measured ones: in number, in time, and in impulse over all of them."""
        if self.falls < 0 or prediction.failed:
            return
        own, other, offsets, jumps = 0.0, 0, [], []
        for window, yhat in zip(self.windows, prediction.y, strict=True):
            t, y = window.t, window.y[:, self.falls]
            least = least_of(t, y)
            seen, said = impacts(t, y, least), impacts(t, yhat[:, self.falls], least)
            offset, jump = matched(seen, said)
            own, other = own + float(seen.jump.sum()), other + len(said.t) - len(seen.t)
            offsets.append(offset)
            jumps.append(jump)
        late, off = np.concatenate(offsets), np.concatenate(jumps)
        yield "impacts_too_many", float(other), "1"
        if len(late):
            yield "impact_offset_median", float(np.median(late)), "s"
            yield "impact_offset_largest", float(np.max(np.abs(late))), "s"
            yield "impulse_error", self.mass * float(np.sum(off)), "N s"
            yield "impulse_measured", self.mass * own, "N s"

    def _ages(self) -> tuple[float, ...]:
        """Half and whole length of the windows, s."""
        length = float(np.median([w.segment.t_end for w in self.windows]))
        return (float(f"{0.5 * length:.4g}"), float(f"{length:.4g}")) if len(self.windows) > 1 else ()

    def measurement(self) -> Trajectory:
        """What was measured, as a motion in the model's measured coordinates; without forces and modes."""
        y = [w.y for w in self.windows]
        return self._trajectory(
            y, [rates_by_fit(w.t, way(w.y, self.turns)) for w in self.windows], Outcome.FINISHED, "", 0, 0.0
        )

    def trajectory(self, prediction: Prediction) -> Trajectory:
        """What one engine predicts, at the same instants."""
        bad = [outcome for outcome in prediction.outcomes if not outcome.ok]
        outcome = bad[0] if bad else Outcome.FINISHED
        message = prediction.messages[0] if prediction.messages else ""
        y, yd = list(prediction.y), list(prediction.yd)
        return self._trajectory(y, yd, outcome, message, prediction.steps, prediction.wall_s)

    def _trajectory(
        self, y: list[Floats], yd: list[Floats], outcome: Outcome, message: str, steps: int, wall_s: float
    ) -> Trajectory:
        n = sum(len(w.t) for w in self.windows)
        nothing = np.zeros((n, 0))
        return Trajectory(
            t=self.time - self.windows[0].t[0], q=np.concatenate(y), v=np.concatenate(yd),
            gap=nothing, lam=nothing, energy=np.full((n, 2), np.nan), mode=nothing.astype(np.int8),
            outcome=outcome, message=message, steps=steps, wall_s=wall_s,
        )  # fmt: skip


def _quantile(values: Floats, percent: float) -> float:
    return float(np.percentile(values, percent)) if len(values) else math.nan
