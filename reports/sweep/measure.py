"""How far a run is from the truth, and whether its energy account is closed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from crossbody import engines
from crossbody.cases import Case, CrossbodyError, Event, Mode, Tier, Trajectory
from crossbody.cases.arrays import Floats, distinct
from crossbody.reports import metrics
from crossbody.reports.measuring.alignment import matched
from crossbody.reports.measuring.truth import Truth, from_run

SHARES = (33, 49)
"""How many instants of a run are looked at, evenly and from 1e-12 of the horizon on by their logarithm."""
STEPS = 100
"""Fewest steps that a run counts for where its errors are added up: independent ones grow by its root."""
TRACE = 1e-3
"""A touch or release whose shift leaves less than this part of it in the motion pressed nothing."""
SECOND_RTOL = 1e-12  # tolerance of the independent integrator: grazing multiplies its errors by 1e5


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What is asked of a run.

    Attributes:
        limit: largest error, relative.
        near: builds a scene that differs by the tolerance of the run.
        second: bounds on steps and on time, s, of the independent integrator, asked where there
            is no closed form.
    """

    limit: float
    near: Callable[[], Case]
    second: tuple[int, float] | None = None


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
    """When a run is looked at, s: what decays at once counts too, for the scale of what rests later."""
    even, early = SHARES
    return distinct(np.linspace(0.0, t_end, even), t_end * np.logspace(-12.0, 0.0, early))


def error(case: Case, run: Trajectory, asked: Asked) -> Error:
    """Against the best truth at hand, up to the divergence time.

    A run further from the truth than its limit is inaccurate only where the truth itself is
    sharper than that: up to the time at which so many errors as the run has steps, each of the
    size of its tolerance, may add up to the limit.
    """
    if not len(run.t):
        return Error()
    truth = _truth(case, run.t, asked)
    if isinstance(truth, str):
        return Error(why=truth)
    found = _against(truth, run, case)
    if not found.value > asked.limit:
        return found
    most = asked.limit / math.sqrt(max(STEPS, run.steps))
    until = _divergence(truth, run.t, asked, most, case.t_end)
    if until > case.t_end:
        return found
    shifts = [shift for start, shift in _shifts(truth, run) if start < until]
    apart = float(np.max(_apart(truth, run)[run.t < until], initial=0.0))
    value = max(apart, _with_trace(max(shifts, default=0.0) / case.t_end, apart))
    return Error(
        value=value, tier=found.tier, until=until, why=f"diverges at t = {until:.3g} s; after that, {found.why}"
    )


def _truth(case: Case, times: Floats, asked: Asked) -> Truth | str:
    """The closed form, else the independent integrator; a sentence (empty: not asked) without."""
    found = "" if case.closed_form is None else _exact(case, times)
    if isinstance(found, str) and asked.second is not None:
        return _second(case, times, *asked.second)
    return found


def _exact(case: Case, times: Floats) -> Truth | str:
    assert case.closed_form is not None
    motion = case.closed_form(times)
    if not motion.outcome.ok:
        return f"no truth: {motion.message}"
    return replace(from_run(motion, Tier.A, "closed form", case.law.touches), at=case.closed_form)


def _second(case: Case, times: Floats, max_steps: int, time_limit: float) -> Truth | str:
    """The same equations by SUNDIALS."""
    engine = engines.load("reference")
    if (reason := engine.why_not(case, "cvode")) is not None:
        return reason
    rtol = max(SECOND_RTOL, case.tight)
    other = engine.prepare(
        case, "cvode", rtol=rtol, samples=distinct(times), max_steps=max_steps, time_limit=time_limit, ledger=False
    ).run()
    if not other.outcome.ok:
        return f"no truth: the independent integrator ended with {other.outcome.value}"
    return from_run(other, Tier.C, "compiled against CVODE", case.law.touches)


def _divergence(truth: Truth, times: Floats, asked: Asked, most: float, t_end: float) -> float:
    """When the truth has parted by more than `most` from that of the scene beside it, s; infinite if it never does.

    That may be in a coordinate, or in the time of a touch: a gap that closes slowly closes at a
    time hardly known.
    """
    try:
        near = _truth(asked.near(), times, asked)
    except CrossbodyError:  # the scene stands at the edge of what can be built
        return math.inf
    if isinstance(near, str):
        return math.inf
    off = _distance(truth.at(times), near.at(times), times) > most
    late = [start for start, shift in _shifts(truth, near.trajectory) if shift > most * t_end]
    return min(float(times[np.argmax(off)]) if off.any() else math.inf, *late, math.inf)


def _shifts(truth: Truth, run: Trajectory) -> list[tuple[float, float]]:
    """Of every contact that both have: when it begins, and by how much it is shifted, s."""
    return [(min(a.touch, b.touch), abs(a.touch - b.touch)) for a, b in matched(truth, run)]


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


def _against(truth: Truth, run: Trajectory, case: Case) -> Error:
    """Positions on matched arcs and instants of contact.

    Where one of them counts more contacts, they cannot be matched: positions are then compared as
    they stand. Rows that only pass an impulse on, and touches that press by rounding, are told by
    some and not by others.
    """
    truth, run = replace(truth, trajectory=lasting(truth.trajectory)), lasting(run)
    if not (more := len(truth.contacts(run)) - len(truth.contacts(truth.trajectory))):
        return _matched(truth, run, case)
    value = float(_apart(truth, run).max())
    return Error(value=value, tier=truth.tier.value, until=case.t_end, why=f"{more:+d} contacts, error {value:.2e}")


def lasting(run: Trajectory) -> Trajectory:
    """The run without contacts that are over at the instant of their touch: some machines tell them, others do not.

    Collisions in no time are another thing: they stay.
    """
    kept: list[Event | None] = []
    latest: dict[int, int] = {}
    for event in run.events:
        k = latest.get(event.contact, -1)
        last = kept[k] if k >= 0 else None
        if last is not None and event.before == Mode.CONTACT and (last.t, last.after) == (event.t, event.before):
            kept[k] = replace(last, after=event.after) if last.before != event.after else None
            continue
        latest[event.contact] = len(kept)
        kept.append(event)
    return replace(run, events=tuple(event for event in kept if event is not None))


def _matched(truth: Truth, run: Trajectory, case: Case) -> Error:
    """By the clock of the touches or by the clock on the wall, whichever is nearer.

    The first is no good where a gap that closes slowly shifts it for all that moves fast, the
    second beside an impact.
    """
    position = metrics.load("position").measure(truth, run, case)
    shift = metrics.load("event_times").measure(truth, run, case)
    apart = float(_apart(truth, run).max())
    known = [] if position is None else [min(position, apart)]
    if shift is not None:
        known.append(_with_trace(shift / case.t_end, apart))
    value = max(known, default=math.nan)
    return Error(value=value, tier=truth.tier.value if known else "", until=case.t_end, why=f"error {value:.2e}")


def _with_trace(shift: float, apart: float) -> float:
    """A shift of touches or releases, relative; 0 if no motion shows it: a still gap let go."""
    return 0.0 if apart < TRACE * shift else shift


def _apart(truth: Truth, run: Trajectory) -> Floats:
    """Distance to the truth at the run's own instants (n,)."""
    return _distance(truth.at(run.t), run, run.t)


def _distance(other: Trajectory, run: Trajectory, times: Floats) -> Floats:
    """Largest difference of a coordinate at every instant, over the largest coordinate (n,)."""
    found = []
    for each in (run, other):
        rows = np.minimum(np.searchsorted(each.t, times), len(each.t) - 1)
        found.append(each.q[rows])
    scale = float(np.max(np.abs(found[1]), initial=0.0)) or 1.0
    return np.asarray(np.max(np.abs(found[0] - found[1]), axis=1, initial=0.0) / scale)


def residual(run: Trajectory) -> float:
    """What the energy account leaves open, over the largest energy that moved, stood or was turned over.

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
