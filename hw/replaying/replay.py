"""Replay a log: what engines make of the recorded inputs or references, beside what was measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from crossbody.cases import (
    CaseUnsupported,
    EngineUnavailable,
    InvalidValue,
    SceneError,
    Trajectory,
    UnknownName,
    Value,
)
from crossbody.cases.arrays import Floats
from crossbody.cases.entry_points import checked_arguments
from crossbody.hw import models
from crossbody.hw.fitting.derivative import Exact
from crossbody.hw.models.contract import Model
from crossbody.hw.reading.log import Log
from crossbody.hw.replaying.comparison import Comparison, Prediction
from crossbody.hw.windows.rates import HALF
from crossbody.hw.windows.window import Window, run_window, windows

KINDS = ("forward", "closed_loop")
ROUNDS = 2
"""Of Gauss and Newton with the first derivatives: few samples are all but linear in the start."""


@checked_arguments
def replay(
    log: Log, model: str | Model, *, kind: str = "forward",
    wanted: Sequence[str] = ("reference",), parameters: Mapping[str, Value] | None = None,
    restart: float | None = None, horizon: float | None = None, delay: float = 0.0,
    settings: Mapping[str, Any] | None = None, tell: Callable[[str], None] = lambda _: None,
    keep: Callable[[str, Callable[[], Prediction]], Prediction] = lambda _, predict: predict(),
) -> Comparison:  # fmt: skip
    """Run a model through a log.

    The model starts in every window from what was measured there; where rates are not, from the
    state that fits the window's first samples (`Model.start_span`). Recorded inputs change at their
    recorded times and hold between them; the integrator is free between them and is never resampled.

    Args:
        log: what was recorded.
        model: its name in `hw.models`, or itself.
        kind: "forward": recorded inputs drive the model; "closed_loop": recorded references drive
            the model and its controller (one free run, reference alone).
        wanted: engines, each E or E:PROFILE.
        parameters: of the model, where not its own defaults.
        restart: time between restarts, s; 0 for a free run; the model's usual one if not given.
        horizon: length of a window, s; up to the next restart if not given.
        delay: of the measured coordinates beyond what the column map says, s.
        settings: of the engines, where they have them.
        tell: is told what is being done.
        keep: is given the words for a prediction and what makes it, and gives it, made or kept from before.

    Raises:
        UnknownName: for a model, kind, engine, profile or parameter that does not exist.
        SceneError: if the log lacks what the model needs, or a start is impossible.
        InvalidValue: for a number outside its range.
    """
    chosen = models.chosen(model)
    numbers = chosen.numbers(parameters)
    if kind not in KINDS:
        raise UnknownName("kind of replay", kind, KINDS)
    if kind == "closed_loop" and chosen.loop is None:
        raise InvalidValue(f"{chosen.name} has no controller; replay it forward.")
    restart = 0.0 if kind == "closed_loop" else restart
    cut = windows(log, chosen, restart, delay, horizon)
    if chosen.start_span and chosen.places:
        cut = tuple(_fitted(chosen, numbers, window, chosen.start_span) for window in cut)
    predictions, skipped = [], {}
    for text in wanted:
        name, _, profile = text.partition(":")
        profile = profile or chosen.profiles.get(name, "matched")
        words = f"{chosen.name} on {name}:{profile}, {len(cut)} windows"
        tell(words)
        predict = partial(_predict, chosen, numbers, cut, name, profile, kind, settings or {})
        try:
            predictions.append(keep(words, predict))
        except (CaseUnsupported, EngineUnavailable) as error:
            skipped[name, profile] = str(error)
    return Comparison(
        log=log, model=chosen.name, title=chosen.title, kind=kind, parameters=MappingProxyType(numbers),
        units=MappingProxyType({k: p.unit for k, p in chosen.parameters.items()}),
        coordinates=chosen.measured, windows=cut, predictions=tuple(predictions),
        skipped=MappingProxyType(skipped), delay=delay, falls=chosen.falls,
        mass=float(numbers.get("mass", 1.0)), limits=chosen.limits, turns=chosen.turns,
    )  # fmt: skip


def _predict(
    model: Model, numbers: Mapping[str, Value], cut: Sequence[Window], name: str, profile: str, kind: str,
    settings: Mapping[str, Any],
) -> Prediction:  # fmt: skip
    runs = []
    used: dict[str, Any] = {}
    for window in cut:
        if kind == "closed_loop":
            run, used = _looped(model, numbers, window, name)
        else:
            run, used = run_window(model, numbers, window, name, profile, settings)
        runs.append((run, *_seen(model, run, window)))
    label = str(used.pop("profile", profile))
    return Prediction(
        engine=name, profile=label, settings=MappingProxyType(used),
        y=tuple(y for _, y, _ in runs), yd=tuple(yd for _, _, yd in runs),
        outcomes=tuple(run.outcome for run, *_ in runs),
        messages=tuple(run.message for run, *_ in runs if run.message),
        wall_s=sum(run.wall_s for run, *_ in runs), steps=sum(run.steps for run, *_ in runs),
    )  # fmt: skip


def _looped(model: Model, numbers: Mapping[str, Value], window: Window, name: str) -> tuple[Trajectory, dict[str, Any]]:
    if name != "reference":
        raise CaseUnsupported(f"{name} follows only the paths of a case; only the reference follows a recorded one.")
    assert model.loop is not None  # checked by the caller
    if lacking := [r for r in model.references if r not in window.log.names("references")]:
        raise SceneError(f"The log has no reference {', '.join(lacking)}, which the controller follows.")
    return model.loop(numbers, window.segment, window.log), {"profile": "compiled"}


def _seen(model: Model, run: Trajectory, window: Window) -> tuple[Floats, Floats]:
    """Measured coordinates and their rates at the instants at which each sample was true."""
    first = window.age[:, 0]
    if np.array_equal(window.age, np.broadcast_to(first[:, None], window.age.shape)):
        return model.see(model, run, np.ascontiguousarray(first))
    each = [model.see(model, run, np.ascontiguousarray(age)) for age in window.age.T]
    y, yd = (np.column_stack([pair[j][:, i] for i, pair in enumerate(each)]) for j in (0, 1))
    return y, yd


def _fitted(model: Model, numbers: Mapping[str, Value], window: Window, span: float) -> Window:
    """The window with the start that fits its first `span` seconds best, by the model and its recorded inputs.

    A polynomial through the samples beside an instant knows nothing of the torques; at the first sample
    of a log, where there is none before it, its rate is tens of times noisier than that of the model.
    """
    count = max(2 * HALF, int(np.searchsorted(window.t - window.t[0], span)))
    short = _shortened(window, min(count, len(window.t)))
    problem = Exact(model, numbers, (), (short,), True, 1)
    x = problem.first()
    J = problem.jacobian(x)
    for _ in range(ROUNDS):
        x = x - np.linalg.lstsq(J, problem.residual(x), rcond=None)[0]
    y, yd = np.split(x, 2)
    return replace(window, segment=replace(window.segment, y=y, yd=yd))


def _shortened(window: Window, count: int) -> Window:
    segment = window.segment
    driven = bool(len(segment.times))
    return replace(
        window, t=window.t[:count], age=window.age[:count], y=window.y[:count], u=window.u[:count],
        segment=replace(
            segment, t_end=float(window.t[count - 1] - window.t[0]),
            times=segment.times[: count - 1] if driven else segment.times,
            inputs=segment.inputs[: count - 1] if driven else segment.inputs,
        ),
    )  # fmt: skip
