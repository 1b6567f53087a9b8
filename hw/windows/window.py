"""A log cut into windows, each of which a model is started in anew from what was measured there."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crossbody import engines
from crossbody.cases import Case, CaseUnsupported, InvalidValue, SceneError, Trajectory, Value, arguments
from crossbody.cases.arrays import Floats
from crossbody.engines.equations import system_of
from crossbody.hw.models.contract import Model, Segment
from crossbody.hw.reading.log import Log
from crossbody.hw.windows.rates import impacts, least_of, rates_by_fit
from crossbody.hw.windows.turns import advanced
from crossbody.reference import simulate

FEWEST = 8  # samples of a window
SAME = 1e-6  # of a sample: two times this near are one
BESIDE = 3  # samples on each side of an impact at which no polynomial through neighbours gives a rate
REFERENCE = {"rtol": 1e-8}  # settings of the reference: far below what a rig measures


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Window:
    """One stretch of a log.

    Attributes:
        t (n,): recorded times, s; both ends belong to it.
        age (n, k): how long after the window's beginning each measured value was true, s: its
            delay taken off.
        y (n, k): measured coordinates.
        u (n, nu): recorded inputs, in force from each time on.
        segment: what a model needs to run it.
        log: its rows.
    """

    t: Floats
    age: Floats
    y: Floats
    u: Floats
    segment: Segment
    log: Log


def windows(
    log: Log, model: Model, restart: float | None = None, delay: float = 0.0, horizon: float | None = None
) -> tuple[Window, ...]:
    """Cut a log.

    Where rates are not recorded, a window that would start beside an impact starts behind it:
    samples within three of an impact show neither the rate before it nor the one behind.

    Args:
        log: what was recorded.
        model: what it is replayed on.
        restart: time from one restart to the next, s; 0 for one window; the model's usual one if None.
        delay: of the measured coordinates beyond what the column map says, s.
        horizon: length of a window, s; up to the next restart if None. Longer ones overlap.
    """
    model.check_log(log)
    length = model.restart if restart is None else arguments.real("restart", restart)
    delay = arguments.real("delay", delay)
    if not 0.0 <= length < math.inf:
        raise InvalidValue(f"restart is {length!r} s; it must be at least 0 (0: one free run).")
    reach = length if horizon is None else arguments.real("horizon", horizon)
    if not 0.0 <= reach < math.inf or (length == 0.0 and reach > 0.0) or (length > 0.0 and reach == 0.0):
        raise InvalidValue(f"horizon is {reach!r} s; it must be above 0, and restart too.")
    y, yd = model.read(model, log)
    each = np.array([log.channel("coordinates", name).delay for name in model.channels])
    if model.needs:  # they are made of others: one for all
        each = np.full(len(model.measured), each[0])
    delays = each + delay
    driven = any(name in log.names("inputs") for name in model.inputs)
    u = recorded_inputs(log, model) if driven else np.zeros((len(log), 0))
    cuts = _cuts(log.time, length, reach)
    if yd is None:
        if model.falls >= 0:
            cuts = _behind_impacts(log.time, y[:, model.falls], cuts)
        starts = np.array([a for a, _ in cuts])
        yd = np.zeros_like(y)
        yd[starts] = rates_by_fit(log.time, y, starts)
    return tuple(_window(log, y, yd, u, delays, model.turns, a, b) for a, b in cuts)


def recorded_inputs(log: Log, model: Model) -> Floats:
    """The inputs that drive a model (n, nu), in force from each of the log's times on.

    Their delays, which the column map tells, are taken off, to the next sample.
    """
    if lacking := [name for name in model.inputs if name not in log.names("inputs")]:
        raise SceneError(f"The log has no input {', '.join(lacking)}, which {model.name} is driven by.")
    return np.array([_in_force(log, name) for name in model.inputs]).reshape(len(model.inputs), len(log)).T


def _in_force(log: Log, name: str) -> Floats:
    channel = log.channel("inputs", name)
    if channel.delay == 0.0:
        return channel.values
    rows = np.searchsorted(log.times("inputs", name), log.time + SAME * log.sample_time, side="right") - 1
    return channel.values[np.maximum(rows, 0)]


def _cuts(t: Floats, restart: float, length: float) -> list[tuple[int, int]]:
    """First and last row of every whole window."""
    if restart == 0.0:
        return [(0, len(t) - 1)]
    starts = t[0] + restart * np.arange(max(0, int((t[-1] - t[0] - length) / restart + 1e-9) + 1))
    edges = np.searchsorted(t, np.stack([starts, starts + length]) - 1e-9 * length)
    if not (found := [(int(a), int(b)) for a, b in edges.T if b - a >= FEWEST and b < len(t)]):
        raise SceneError(
            f"The log spans {t[-1] - t[0]:g} s with {len(t)} samples: no window of {length:g} s with {FEWEST} of them."
        )
    return found


def _behind_impacts(t: Floats, y: Floats, cuts: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """The same windows, but for starts that stand beside an impact; one too short for that stays."""
    hits = impacts(t, y, least_of(t, y)).t
    beside = np.zeros(len(t), dtype=bool)
    for row in np.searchsorted(t, hits):
        beside[max(0, row - BESIDE) : row + BESIDE + 1] = True
    moved = [(a + int(np.argmin(beside[a:])), b) for a, b in cuts]
    return [new if new[1] - new[0] >= FEWEST else old for new, old in zip(moved, cuts, strict=True)]


def _window(log: Log, y: Floats, yd: Floats, u: Floats, delays: Floats, turns: Sequence[int], a: int, b: int) -> Window:
    rows = slice(a, b + 1)
    t = log.time[rows]
    age = (t - t[0])[:, None] - delays
    # The state at the window's beginning was measured a delay later: the rate carries it there.
    start, rate = advanced(y[a], yd[a], delays, turns), yd[a]
    driven = bool(u.shape[1])
    segment = Segment(
        y=start, yd=rate, t_end=float(t[-1] - t[0]), times=t[:-1] - t[0] if driven else np.zeros(0),
        inputs=u[a:b] if driven else np.zeros((0, 0)),
    )  # fmt: skip
    last = float(log.time[b]) if b + 1 == len(log) else float(log.time[b + 1])
    kept = log.window(float(t[0]), np.nextafter(last, math.inf) if b + 1 == len(log) else last)
    return Window(t=t, age=age, y=y[rows], u=u[rows], segment=segment, log=kept)


def overlap(cut: Sequence[Window]) -> int:
    """How many of the windows behind it a window has samples in common with at most; logs begin anew."""
    found = 0
    for i, window in enumerate(cut):
        count, last = 0, window.t[0]
        for other in cut[i + 1 :]:
            if not last < other.t[0] < window.t[-1]:
                break
            count, last = count + 1, other.t[0]
        found = max(found, count)
    return found


def run_once(case: Case, solver: str, **options: Any) -> Trajectory:
    """One motion of a case by the reference: a `solver` of its profiles, and `reference.Options`."""
    given = case.inputs
    return simulate(
        system_of(case), case.q0, case.v0, case.t_end, solver=solver, fsm=case.fsm,
        collisions=case.collisions,
        inputs=None if given is None else (given.times, given.values), **options,
    )  # fmt: skip


def run_window(
    model: Model, numbers: Mapping[str, Value], window: Window, name: str, profile: str, settings: Mapping[str, Any]
) -> tuple[Trajectory, dict[str, Any]]:
    """One window on one engine: the motion, and what was really used."""
    case = model.build(numbers, window.segment)
    asked = dict(model.settings.get(name, {})) | dict(settings)
    engine = engines.load(name)
    reason = model.why_not.get(name) or engine.why_not(case, profile)
    if reason is not None:
        raise CaseUnsupported(reason)
    if name == "reference":
        used = REFERENCE | asked
        solver = "compiled" if profile == "matched" else profile
        # Where inputs change at every sample its steps end there: samples of their own would cost a third more.
        samples = None if len(window.segment.times) else window.t - window.t[0]
        return run_once(case, solver, samples=samples, **used), {**used, "profile": solver}
    prepared = engine.prepare(case, profile, **asked)
    return prepared.run(), dict(prepared.settings) | {"profile": prepared.profile}
