"""Forces from positions alone: an extended Kalman filter and a smoother over the record."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases import InvalidValue
from crossbody.cases.arrays import frozen, full
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference._indices import different
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats
from crossbody.reference.linear._kalman import Filter
from crossbody.reference.linear._unmeasured import LARGEST, Estimate, Record, Unknown
from crossbody.reference.linear.linearisation import point


@checked_arguments
def filtered(
    system: System, t: ArrayLike, y: ArrayLike, u: ArrayLike | None = None, *, unknown: Unknown,
    measured: Sequence[int], std_y: ArrayLike, q0: ArrayLike, v0: ArrayLike | None = None,
    std_force: ArrayLike, time_force: float, active: Sequence[int] | None = None,
    std_q0: float = 1e-3, std_v0: float = 1e-1, smooth: bool = True,
) -> Estimate:  # fmt: skip
    """Forces from positions alone by an extended Kalman filter, and a smoother over the record.

    Args:
        system: the mechanism; its active rows keep one set through the record.
        t: instants (N,), s, increasing.
        y: measured positions (N, ny).
        u: inputs (N, nu), each held from its instant on; zero if not given.
        unknown: what is looked for.
        measured: coordinates that y holds.
        std_y: deviation of their errors, a number or (ny,).
        q0: positions near the start (n,), on the active rows.
        v0: velocities near the start (n,), zero if not given.
        std_force: deviation of the unknown forces, a number or (k,).
        time_force: their correlation time, s.
        active: rows that are on beside the unknown ones; those that are always on, if not given.
        std_q0: deviation of q0, in the coordinates that the rows leave free.
        std_v0: deviation of v0.
        smooth: use the whole record at every instant, else its past alone.

    Raises:
        SceneError: for arrays of another shape.
        InvalidValue: for deviations or times that are not above 0, or instants that do not increase.
    """
    record = Record(system, t, u, unknown, active)
    Y = frozen("filtered", "y", y, (len(record.t), len(measured)))
    noise = full("filtered", "std_y", std_y, len(measured))
    strength = full("filtered", "std_force", std_force, len(unknown))
    times = np.array([time_force, std_q0, std_v0])
    _check_positive(**{"std_y": noise, "std_force": strength, "time_force, std_q0, std_v0": times})
    if np.any(np.diff(record.t) <= 0.0):
        raise InvalidValue("filtered: the instants t must increase.")
    start = point(system, q0, v0, None, record.held.tolist(), float(record.t[0]))
    places = different("filtered.measured", measured, system.n)
    run = Filter(record, start, places, noise, strength, time_force, (std_q0, std_v0))
    return run.through(Y, smooth)


def _check_positive(**given: Floats) -> None:
    for name, values in given.items():
        if not (np.all(values > 0.0) and np.all(values <= LARGEST)):
            raise InvalidValue(f"filtered: {name} is {values.tolist()}; it must be above 0, and at most {LARGEST:g}.")
