"""How far a run is from the truth in position, at its samples and between them.

Samples alone do not tell it: a run that rests from one sample to the next may be at the truth's place at both while the
truth bounces between. So errors between samples that are far apart are asked for as well.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import drifts, signed, sizes
from crossbody.reports.measuring.impulse import away
from crossbody.reports.measuring.truth import Truth, taken

FAR = 200  # parts of the horizon: what happens between samples that are further apart is asked for
LOOKS = np.linspace(0.0, 1.0, 10)[1:-1]
"""Parts of the time between two samples at which it is asked for."""


def errors(truth: Truth, run: Trajectory, exact: Trajectory, case: Case) -> tuple[Floats, Floats]:
    """Return how far q is off (m, nq), of quaternions by the angle, rad, at samples and between; and when (m,), s.

    `exact` is the truth beside every sample of the run, by its own clock. What is not known beside one is left out.
    """
    known = np.flatnonzero(~np.isnan(exact.q).all(axis=1))
    run, exact = taken(run, known), taken(exact, known)
    off = signed(run.q, exact.q, case.quaternions)
    first = far_apart(run.t, case)
    ends = np.stack([first, first + 1])
    step = np.diff(exact.t)[first]
    faster = (np.diff(run.t)[first] / np.where(step > 0.0, step, np.inf))[:, None]  # the run's clock than the truth's
    rates = [rate_of_error(truth, taken(run, i), taken(exact, i), faster, case) for i in ends]
    cubic = sizes(_cubic(off[ends], np.stack(rates), step[:, None]), case.quaternions)
    t = run.t[first] + LOOKS[:, None] * np.diff(run.t)[first]
    return np.concatenate([sizes(off, case.quaternions), cubic]), np.concatenate([run.t, t.ravel()])


def rate_of_error(truth: Truth, run: Trajectory, exact: Trajectory, faster: Floats, case: Case) -> Floats:
    """Return the rates (n, nv) of errors, 1/s of the truth's clock, than which that of the run goes `faster` (n, 1).

    They are zero at collisions that take no time, where a sample does not say behind which it stands.
    """
    off = signed(run.q, exact.q, case.quaternions)
    rate = drifts(off, run.v * faster, exact.v, case.quaternions)
    rate[~away(exact, [event.t for event in truth.trajectory.events if event.impulse], case.t_end)] = 0.0
    return rate


def far_apart(t: Floats, case: Case) -> NDArray[np.intp]:
    """Return the samples (m,) behind which the next one, of instants (n,), is more than a 200th of the horizon away."""
    return np.flatnonzero(np.diff(t) > case.t_end / FAR)


def _cubic(off: Floats, rate: Floats, step: Floats) -> Floats:
    """Return errors (m, nv) between samples, from those at both ends (2, k, nv), their rates, and lengths (k, 1), s.

    Not the run's cubic is laid beside the truth, but that of both errors is taken: a run that is right at its samples,
    in place and velocity, is right between them however long its steps, as far as its samples can tell.
    """
    x, (a, b), (u, w) = LOOKS[:, None, None], off, rate
    found = a + x * x * (3.0 - 2.0 * x) * (b - a) + x * (1.0 - x) * step * ((1.0 - x) * u - x * w)
    cubic: Floats = found.reshape(-1, off.shape[2])
    return cubic
