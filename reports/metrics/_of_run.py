"""Numbers of a run alone that are measured where a case claims or limits them: every function is a metric."""

from __future__ import annotations

import numpy as np

from crossbody.cases import Case, Mode, Trajectory
from crossbody.cases.contacts import at, rates
from crossbody.cases.contacts import contacts as contacts_of

UNITS = {
    "collision_impulse": "N s", "contact_loss": "J", "contact_time": "s", "energy_per_bounce": "J",
    "fifth_exit": "s", "final_gap": "m", "final_lam": "N", "separation_gap": "m",
}  # fmt: skip
"""Of those that are no counts and no ratios."""
ALWAYS = False


def bounces(run: Trajectory, case: Case) -> float | None:
    """Number of times a body becomes free again after a contact."""
    return float(sum(event.after == Mode.FREE for event in run.events))


def collision_impulse(run: Trajectory, case: Case) -> float | None:
    """Impulse of all instantaneous collisions."""
    impulses = [event.impulse for event in run.events if event.impulse]
    return sum(impulses) if impulses else None


def contact_loss(run: Trajectory, case: Case) -> float | None:
    """Energy lost in contacts until the end; without a ledger all missing energy, including the work of inputs."""
    if run.ledger is None:
        return float(run.total_energy[0] - run.total_energy[-1])
    return -float(run.ledger.contact[-1].sum())


def contact_time(run: Trajectory, case: Case) -> float | None:
    """Duration of the first contact that ended, touch to release."""
    return next((c.release - c.touch for c in contacts_of(run, case.law.touches) if np.isfinite(c.release)), None)


def contacts(run: Trajectory, case: Case) -> float | None:
    """Number of contacts that begin."""
    return float(len(contacts_of(run, case.law.touches)))


def energy_per_bounce(run: Trajectory, case: Case) -> float | None:
    """Energy gained from one release to the next, mean over all bounces."""
    energy, ended = run.total_energy, [c.release for c in contacts_of(run, case.law.touches) if np.isfinite(c.release)]
    return (at(run, energy, ended[-1]) - float(energy[0])) / len(ended) if ended else None


def fifth_exit(run: Trajectory, case: Case) -> float | None:
    """Instant of the fifth return to FREE; of the fifth release where the run has no modes."""
    exits = [e.t for e in run.events if e.after == Mode.FREE] or [c.release for c in contacts_of(run, case.law.touches)]
    return exits[4] if len(exits) > 4 and np.isfinite(exits[4]) else None


def final_gap(run: Trajectory, case: Case) -> float | None:
    """Gap of the closest row at the end, of those that have one: zero where a body rests without penetration."""
    gaps = run.gap[-1, case.law.touches | ~case.law.unilateral]
    return float(gaps.min()) if len(gaps) else None


def final_lam(run: Trajectory, case: Case) -> float | None:
    """Sum of the multipliers at the end: the weight, where a body rests."""
    return float(run.lam[-1].sum())


def restitution(run: Trajectory, case: Case) -> float | None:
    """Rate of the gap at release over that at touch, first contact."""
    found = rates(run)
    return -found[0][2] / found[0][1] if found and found[0][1] else None


def separation_gap(run: Trajectory, case: Case) -> float | None:
    """Gap at the end of the first contact that ended; negative below the surface."""
    ended = (c for c in contacts_of(run, case.law.touches) if np.isfinite(c.release))
    return next((at(run, run.gap[:, c.row], c.release) for c in ended), None)


def transitions(run: Trajectory, case: Case) -> float | None:
    """Number of transitions of the state machine, also several at one instant."""
    return float(len(run.events))
