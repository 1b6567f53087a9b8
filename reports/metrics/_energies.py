"""Energies of a run against the truth's, its account and itself: every function is a metric."""

from __future__ import annotations

import math

import numpy as np

from crossbody.cases import Case, Trajectory
from crossbody.reports.measuring.alignment import aligned
from crossbody.reports.measuring.equations import equations, finite, spread
from crossbody.reports.measuring.impulse import away
from crossbody.reports.measuring.placed import largest, of_rows
from crossbody.reports.measuring.scale import energy
from crossbody.reports.measuring.switching import made, parted
from crossbody.reports.measuring.truth import Truth

UNITS: dict[str, str] = {}
NEEDS = dict.fromkeys(("contact_work", "energy_integrator", "energy_law", "energy_switching_error"), "ledger")

ENERGY = ("energy", "J")
KINDS = (("kinetic energy", "J"), ("potential energy", "J"))


def contact_work(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Work of every row against the truth's on matched arcs, by the truth's largest energy.

    Max over samples and rows of |W - W_truth| / the truth's largest energy. NaN without an account, None
    where the truth has none. The sum over all rows is in `energy_integrator`; here each row has its own.
    Instants of collisions that take no time are left out, as in `energy_drift`.
    """
    inside, exact = aligned(truth, run, case)
    scale = energy(truth.trajectory)
    if exact.ledger is None or scale == 0.0 or not inside.any() or not run.gap.shape[1]:
        return None
    if run.ledger is None:
        return math.nan
    smooth = away(exact, [event.t for event in truth.trajectory.events if event.impulse], case.t_end)
    off = np.abs(run.ledger.contact[inside] - exact.ledger.contact)[smooth]
    return largest(off, run.t[inside][smooth], of_rows(case, "J", "J"), scale)


def energy_drift(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Energy against the truth's on matched arcs, over the largest kinetic energy or range of the potential.

    Max |E(t) - E_truth(t)| / the truth's largest energy. Instants of collisions that take no time are left
    out: several may share one, and a sample does not say behind which it stands.
    """
    inside, exact = aligned(truth, run, case)
    scale = energy(truth.trajectory)
    if scale == 0.0 or not inside.any():
        return None
    smooth = away(exact, [event.t for event in truth.trajectory.events if event.impulse], case.t_end)
    off = np.abs(run.total_energy[inside] - exact.total_energy)[smooth]
    return largest(off, run.t[inside][smooth], (ENERGY,), scale)


def energy_integrator(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Energy that the integrator made or lost, over the largest kinetic energy or range of the potential.

    Max |E - E(0) - input + dissipated - work of all rows| / the truth's largest energy; NaN without an
    account. What is left of E(t) - E(0) after the work of the inputs, of every multiplier and of damping.
    """
    scale = energy(truth.trajectory)
    if scale == 0.0:
        return None
    if run.ledger is None:
        return math.nan
    book = run.ledger.input - run.ledger.dissipated + run.ledger.contact.sum(axis=1)
    change = run.total_energy - run.total_energy[0]
    return largest(np.abs(change - (book - book[0])), run.t, (ENERGY,), scale)


def energy_law(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Largest net energy made by the contact law, over the largest kinetic energy.

    max(0, max over t of the work of all rows) / max T of the truth; NaN without an account. From the run's
    own account of the work of every multiplier (docs/explanation/model.md): above zero, the law made energy.
    """
    scale = float(truth.trajectory.energy[:, 0].max())
    rows = case.law.unilateral
    if scale == 0.0 or not rows.any():
        return None
    if run.ledger is None:
        return math.nan
    return largest(np.maximum(run.ledger.contact[:, rows].sum(axis=1), 0.0), run.t, (ENERGY,), scale)


def energy_residual(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Recorded energies against those of the recorded state, over the largest: an identity at every sample.

    Max over kinetic and potential energy of |E - E(q, v)| / max |E(q, v)|, at most 400 samples. None where
    the case has no equations, or those no energy.
    """
    system = equations(case)
    if system is None or system.energy is None:
        return None
    if not finite(run):
        return math.nan
    some = spread(run)
    wanted = np.zeros((len(some), 2))
    for row, q, v in zip(wanted, run.q[some], run.v[some], strict=True):
        system.energy(np.array(q), np.array(v), np.array(system.p), row)
    scale = np.max(np.abs(wanted), axis=0)
    off = np.abs(run.energy[some] - wanted)
    return largest(off, run.t[some], KINDS, np.where(scale > 0.0, scale, 1.0))


def energy_switching(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Energy that the contact law made by switching rows on and off, over the largest kinetic energy.

    Sum of the jumps of 1/2 a0 h_A^T G_A^-1 h_A / max T of the truth; None where there is no such potential.
    """
    scale = float(truth.trajectory.energy[:, 0].max())
    jumps = made(run, case)
    return None if jumps is None or scale == 0.0 else jumps / scale


def energy_switching_error(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Energy made by switching, formula against ledger, over the largest kinetic energy; without damping.

    |sum of jumps - work of all rows| / max T of the truth. None with damping, whose work is not in the
    formula, and while rows still press, whose energy comes back; NaN without an account.
    """
    scale = float(truth.trajectory.energy[:, 0].max())
    jumps = made(run, case)
    if jumps is None or case.law.a1.any() or scale == 0.0 or not parted(run):
        return None
    if run.ledger is None:
        return math.nan
    return abs(jumps - float(run.ledger.contact[-1].sum())) / scale
