"""How far a run is from the truth, and whether its energy account is closed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from crossbody import engines
from crossbody.cases import Case, Event, Mode, Tier, Trajectory
from crossbody.cases._arrays import Floats
from crossbody.reports import metrics
from crossbody.reports.judging.truth import PARTED, Truth, from_run
from crossbody.reports.metrics._contacts import contacts

SHARES = (33, 49)
"""How many instants of a run are looked at, evenly and from 1e-12 of the horizon on by their logarithm."""
SECOND_RTOL = 1e-11
"""Tolerance of the independent integrator."""
AFTER = 1.5
"""Motions that part from their own neighbours no later than this times when they part from another's are chaotic."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Error:
    """Distance to a truth, relative.

    Attributes:
        value: NaN where nothing can be said.
        tier: of the truth; empty without one.
        until: up to which time it was compared, s.
        why: what differs, where it is not a number alone.
    """

    value: float = math.nan
    tier: str = ""
    until: float = math.nan
    why: str = ""


def instants(t_end: float) -> Floats:
    """When a run is looked at, s: what decays at once is seen as well, and gives the scale of what is at rest later."""
    even, early = SHARES
    return np.unique(np.concatenate([np.linspace(0.0, t_end, even), t_end * np.logspace(-12.0, 0.0, early)]))


def against_closed_form(case: Case, run: Trajectory) -> Error:
    """Against the exact motion, if the case has one that reaches the horizon."""
    if case.closed_form is None or not len(run.t):
        return Error()
    exact = case.closed_form(run.t)
    if not exact.outcome.ok:
        return Error(why=f"no truth: {exact.message}")
    truth = replace(from_run(exact, Tier.A, "closed form"), at=case.closed_form)
    return _against(truth, run, case)


def at_the_end(case: Case, q: Floats, v: Floats) -> Error:
    """The end state (n,), (n,) against the exact motion: positions and speeds, each over its largest."""
    if case.closed_form is None:
        return Error()
    exact = case.closed_form(instants(case.t_end))
    if not exact.outcome.ok:
        return Error(why=f"no truth: {exact.message}")
    parts = [
        float(np.max(np.abs(mine - theirs[-1]))) / (float(np.max(np.abs(theirs))) or 1.0)
        for mine, theirs in ((q, exact.q), (v, exact.v))
    ]
    return Error(value=max(parts), tier=Tier.A.value, until=case.t_end)


def against_second(case: Case, run: Trajectory, max_steps: int, time_limit: float) -> Error:
    """Against the same equations by SUNDIALS, up to where the two part for good (chaos)."""
    engine = engines.load("reference")
    reason = engine.why_not(case, "cvode")
    if reason is not None or not len(run.t):
        return Error(why=reason or "")
    times = np.unique(run.t)
    rtol = max(SECOND_RTOL, case.tight)
    other = engine.prepare(
        case, "cvode", rtol=rtol, samples=times, max_steps=max_steps, time_limit=time_limit, ledger=False
    ).run()
    if not other.outcome.ok:
        return Error(why=f"no truth: the independent integrator ended with {other.outcome.value}")
    truth = from_run(other, Tier.C, "compiled against CVODE")
    parted = _parted(other, run, times)
    if math.isinf(parted):
        return _against(truth, run, case)
    again = engine.prepare(
        case, "compiled", rtol=rtol, samples=times, max_steps=max_steps, time_limit=time_limit, ledger=False
    ).run()
    if _parted(again, run, times) > AFTER * parted:
        return Error(
            value=_distance(other, run, times).max(), tier=truth.tier.value, until=parted,
            why=f"parts from the independent integrator at t = {parted:.4g} s, though not from itself",
        )  # fmt: skip
    return _before(replace(truth, trusted=parted), run, case)


def _against(truth: Truth, run: Trajectory, case: Case) -> Error:
    """Positions on matched arcs and instants of contact.

    Where one of them counts more contacts, they cannot be matched: positions are then compared as they stand. Rows that
    only pass an impulse on, and touches that press by rounding, are told by some and not by others.
    """
    truth, run = replace(truth, trajectory=lasting(truth.trajectory)), lasting(run)
    more = len(contacts(run)) - len(contacts(truth.trajectory))
    if not more:
        return _before(truth, run, case)
    value = float(_distance(truth.at(run.t), run, run.t).max())
    return Error(value=value, tier=truth.tier.value, until=case.t_end, why=f"{more:+d} contacts, error {value:.2e}")


def lasting(run: Trajectory) -> Trajectory:
    """The run without contacts that are over at the instant of their touch: some machines tell them, others do not.

    Collisions in no time are another thing: they stay.
    """
    kept: list[Event] = []
    for event in run.events:
        last = kept[-1] if kept else None
        same = last is not None and (last.t, last.contact, last.after) == (event.t, event.contact, event.before)
        if last is None or not same or event.before != Mode.CONTACT:
            kept.append(event)
            continue
        kept.pop()
        if last.before != event.after:
            kept.append(replace(last, after=event.after))
    return replace(run, events=tuple(kept))


def _before(truth: Truth, run: Trajectory, case: Case) -> Error:
    until = min(truth.trusted, case.t_end)
    position = metrics.load("position").measure(truth, run, case)
    shift = metrics.load("event_times").measure(truth, run, case) if math.isinf(truth.trusted) else None
    parts = [position, None if shift is None else shift / case.t_end]
    known = [part for part in parts if part is not None]
    return Error(value=max(known, default=math.nan), tier=truth.tier.value if known else "", until=until)


def _distance(other: Trajectory, run: Trajectory, times: Floats) -> Floats:
    """Largest difference of a coordinate at every instant, over the largest coordinate (n,)."""
    found = []
    for each in (run, other):
        rows = np.minimum(np.searchsorted(each.t, times), len(each.t) - 1)
        found.append(each.q[rows])
    scale = float(np.max(np.abs(found[1]), initial=0.0)) or 1.0
    return np.asarray(np.max(np.abs(found[0] - found[1]), axis=1, initial=0.0) / scale)


def _parted(other: Trajectory, run: Trajectory, times: Floats) -> float:
    """When two runs part by more than `PARTED`, s; infinite if they never do."""
    off = _distance(other, run, times) > PARTED
    return float(times[np.argmax(off)]) if off.any() else math.inf


def residual(run: Trajectory) -> float:
    """What the energy account leaves open (spec 1.4), over the largest energy that moved, stood or was turned over.

    NaN without an account.
    """
    if run.ledger is None or not len(run.t):
        return math.nan
    works = [run.ledger.input, run.ledger.dissipated, *run.ledger.contact.T]
    book = run.ledger.input - run.ledger.dissipated + run.ledger.contact.sum(axis=1)
    change = run.total_energy - run.total_energy[0]
    turned = [float(np.ptp(work)) for work in (run.energy[:, 1], *works)]
    scale = max(float(run.energy[:, 0].max()), *turned)
    if scale == 0.0:
        return 0.0
    return float(np.max(np.abs(change - (book - book[0])))) / scale
