"""The force that nobody measured, followed through a log by an extended Kalman filter and smoother.

Beside `estimate_force`, which balances accelerations one instant at a time, this one knows the equations of
motion from sample to sample and how quickly forces change (a Gauss-Markov process): positions alone serve,
nothing is smoothed by a polynomial, and the covariance holds the errors of neighbouring samples together.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from crossbody.cases import Value
from crossbody.cases.arrays import Floats
from crossbody.cases.entry_points import checked_arguments
from crossbody.engines.equations import system_of
from crossbody.hw.models.contract import Model, Segment
from crossbody.hw.reading.log import Log
from crossbody.hw.replaying.inverse import Inferred, noise_of, pushed, shift_of
from crossbody.hw.windows.lift import check_measured
from crossbody.hw.windows.rates import DEGREE, HALF, derivatives
from crossbody.hw.windows.window import recorded_inputs
from crossbody.reference.linear import Unknown, filtered


@checked_arguments
def track_force(
    log: Log, model: str | Model, *, size: float, memory: float,
    parameters: Mapping[str, Value] | None = None, delay: float = 0.0, stride: int = 1,
) -> Inferred:  # fmt: skip
    """The force that acts on the mechanism besides the recorded torques, from positions and torques.

    Args:
        log: what was recorded.
        model: its name in `hw.models`, or itself; its rows are always on, and it has inputs for such a force.
        size: standard deviation that the force may have, N.
        memory: its correlation time, s: much longer than a sample, not longer than what is to be seen.
        parameters: of the model, where not its defaults.
        delay: of the measured coordinates beyond what the column map says, s.
        stride: of so many samples one is used.

    Raises:
        SceneError: if the log or the model does not fit.
        InvalidValue: for a log shorter than a polynomial, or a size or memory that is not above 0.
    """
    chosen = pushed(model)
    chosen.check_log(log)
    y, _ = chosen.read(chosen, log)
    value, rate, _, _ = derivatives(log.time, y, HALF, DEGREE, np.array([HALF]))
    kept, t = slice(HALF, None, stride), log.time - shift_of(log, chosen, delay)
    case = chosen.build(chosen.numbers(parameters), Segment(y=value[0], yd=rate[0], t_end=float(t[-1] - t[0])))
    system, own = system_of(case), len(chosen.inputs)
    check_measured(system, chosen.seen, chosen.name)
    u = np.zeros((len(t[kept]), system.inputs))
    u[:, :own] = _means(log.time, recorded_inputs(log, chosen), t[kept])
    found = filtered(
        system, t[kept], y[kept], u, unknown=Unknown(inputs=tuple(range(own, own + len(chosen.forces)))),
        measured=chosen.seen, std_y=noise_of(log.time, y, HALF, DEGREE), q0=case.q0, v0=case.v0,
        std_force=size, time_force=memory,
    )  # fmt: skip
    nothing = np.full(found.force.shape, np.nan)
    return Inferred(
        t=found.t, names=chosen.forces, unit="N", value=found.force, std=found.std, recorded=nothing
    )  # fmt: skip


def _means(times: Floats, held: Floats, t: Floats) -> Floats:
    """Means (n, nu) from each instant of t to the next of inputs that hold from their own times on."""
    total = np.concatenate([np.zeros((1, held.shape[1])), np.cumsum(held[:-1] * np.diff(times)[:, None], axis=0)])
    ends = np.append(t, 2.0 * t[-1] - t[-2])
    k = np.clip(np.searchsorted(times, ends, side="right") - 1, 0, len(times) - 1)
    at = total[k] + held[k] * (ends - times[k])[:, None]
    return np.diff(at, axis=0) / np.diff(ends)[:, None]
