"""Starts of windows fitted to the first samples by the model itself, where positions alone are measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from crossbody.cases import Value
from crossbody.hw.fitting.derivative import Exact
from crossbody.hw.models.contract import Model
from crossbody.hw.windows.rates import HALF
from crossbody.hw.windows.window import Window

ROUNDS = 2
"""Of Gauss and Newton with the first derivatives: few samples are all but linear in the start."""


def fitted_starts(model: Model, numbers: Mapping[str, Value], cut: Sequence[Window], span: float) -> tuple[Window, ...]:
    """The windows with starts that fit their first `span` seconds best, by the model and its recorded inputs.

    A polynomial through the samples beside an instant knows nothing of the torques; at the first sample
    of a log, where there is none before it, its rate is tens of times noisier than that of the model.
    """
    return tuple(_fitted(model, numbers, window, span) for window in cut)


def _fitted(model: Model, numbers: Mapping[str, Value], window: Window, span: float) -> Window:
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
