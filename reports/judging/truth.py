"""What a run is judged against, and how that is known (docs/explanation/verdicts.md)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, CaseUnsupported, Chaos, EngineUnavailable, Outcome, Tier, Trajectory, arguments
from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.contacts import CLOSED
from crossbody.cases.rotations import differences
from crossbody.cases.trajectory import Ledger
from crossbody.reference import ahead
from crossbody.reports.judging.answers import Answers
from crossbody.reports.judging.reach import BUDGET, SHORTEST, Followed, estimated, followed, motion, tight
from crossbody.reports.judging.stored import changed
from crossbody.reports.measuring.alignment import matched
from crossbody.reports.measuring.modes import violated
from crossbody.reports.measuring.scale import RESTS, energy
from crossbody.reports.measuring.slow_slips import firm_until
from crossbody.reports.measuring.truth import Truth, sample_times, shortened

SECOND = 10.0
"""Tolerance of the independent integrator that the truth is held against, in units of `Case.tight`."""
WITNESS = 100.0
"""Tolerance of the witness that shares nothing but the scene, likewise: in Python steps cost 1e3 more."""
OF_WITNESS, OF_FILES, SHARE = 4.0, 1.5, 0.05
"""Time that a witness of a scene may take, in budgets, and of a file, whose user waits for it, by what it takes for the
first part of the horizon, and that part."""
OF_KERNELS = 12.0
"""Time that CVODE may take of a case with kernels of its own, likewise: the slowest takes less than three."""
NUDGE, DIRECTIONS, INSTANTS = 1e-7, 2, 201
"""By how much of the largest velocity a start is put off, in how many directions, and when it is seen."""
PARTED = 1e-6
"""Difference of the two, over the largest coordinate, from which on neither is trusted."""
STEPS, GROWTH = 1e4, 10.0
"""Most steps of a run, whose errors may add up, and their growth if no chaos is declared."""
AGREES = STEPS * GROWTH
"""Largest disagreement of the two, in units of the looser tolerance; it is never more than `PARTED`."""
MULTIPLIED = 1e3
"""How many times as large an error of the start may have become where a run with the default
tolerance is still judged: its limits, 1e-6 of a motion, grow no further than to 1e-3."""
GAINS = {"energy_gained": "touches_that_gained", "energy_handed": "starts_inside"}
"""Of touches, which energies and which of their numbers both sources of a truth tell."""
GROWN = 1e3
"""A growth rate is read from where the two part by so many roundings of the largest coordinate."""


def truth_of(case: Case, known: Followed | None = None, budget: float = BUDGET) -> Truth:
    """The best truth that a case has: its closed form, else two independent integrators that agree.

    Args:
        case: the scene.
        known: the case as far as it is followed, with which motions are compared then; else to
            its whole horizon.
        budget: by which the time of its witness is measured, s.

    Raises:
        CrossbodyError: if the reference cannot run the case.
    """
    from crossbody import engines
    from crossbody.engines.equations import has_equations

    arguments.instance("case", case, Case, "a case")
    if case.closed_form is None:
        # SUNDIALS runs the level machine alone: any other truth is known by itself only.
        apart = case.fsm == "level" and engines.load("reference").why_not(case, "cvode") is None
        if apart and not case.general:
            ahead.meanwhile("SUNDIALS")
        known = followed(case) if known is None else known
        case, first = known.case, known.motion
        found = _integrated(case, first, "cvode" if apart else "compiled", budget=budget)
        return replace(found, part=known.part, short=known.why)
    exact = case.closed_form
    first = exact(np.zeros(1))
    truth = Truth(
        tier=Tier.A,
        source="closed form of every arc, which shares only the numbers of the case with the runs that it judges",
        trajectory=exact(sample_times(first, case.t_end)),
        at=exact,
        agreement={},
        touches=case.law.touches,
        joined=case.general,
    )
    if "reference" not in engines.names() or not has_equations(case):
        return truth
    second = tight(case)
    told = held_against(truth, second, case, case.tight)
    # A closed form is not cut short by what is held against it.
    return replace(told, trusted=math.inf, parted=math.inf, agreement=agreement(truth, second, case))


def law_of(case: Case) -> Truth | None:
    """The truth of the equations that an engine really integrates, where they are not the case's own.

    Against it an engine has a step error alone. It is known by the reference itself (tier D).

    Args:
        case: with the engine's machine and collision rule (`follows` of its run).

    Returns:
        None where the reference does not reach the horizon: the engine is then judged against itself.
    """
    first = tight(case)
    if not first.outcome.ok:
        return None
    found = _integrated(case, first, "compiled")
    rule = f"the equations that the engine follows (machine {case.fsm}, collisions {case.collisions}): "
    return replace(found, source=rule + found.source)


def _integrated(case: Case, first: Trajectory, other: str, budget: float = BUDGET) -> Truth:
    """The compiled integrator at its tightest, held against another: tier C if independent, else D."""

    @Answers
    def at(times: Floats) -> Trajectory:
        asked = (
            replace(case, t_end=min(max(float(times[-1]), SHORTEST * case.t_end), case.t_end)) if case.general else case
        )
        run = motion(asked, case.tight, samples=np.array(times))
        # A run that is asked for samples need not take the same steps: its events move by the tolerance.
        run = replace(
            with_both_sides(run, first), events=first.events, switches=first.switches, counts=first.counts,
            unique_until=first.unique_until, searched_until=first.searched_until,
        )  # fmt: skip
        return run if first.outcome.ok else replace(run, outcome=first.outcome, message=first.message)

    dense = at(sample_times(first, case.t_end))
    truth = Truth(
        tier=Tier.D, source="", trajectory=dense, at=at, expect=at.expect, agreement={}, tight=case.tight,
        touches=case.law.touches, joined=case.general,
    )  # fmt: skip
    second = _second(case, truth, other, budget)
    t, grown = _growing(case, dense, budget)
    witness = ("reference", second.name) if second.name == other else ("", "")
    known = replace(truth, tier=second.tier, grows=float(grown[-1]), witness=witness, spent=second.spent)
    truth = held_against(known, second.run, case, second.rtol)
    if (horizon := _horizon(case, truth, second.run, t, grown)) is not None:
        known = replace(truth, horizon=horizon, grows=float(np.interp(horizon.until, t, grown)))
        truth = held_against(known, second.run, replace(case, chaos=horizon), second.rtol)
    said = ", ".join(f"{name} {value:.1e}" for name, value in truth.agreement.items())
    source = f"compiled reference at rtol {case.tight:g}, {second.name} at {second.rtol:g} agrees: {said}"
    source += f"; they share {second.shared}{second.why and f' ({second.why})'}"
    if truth.parted < case.t_end:
        apart = f"they diverge at t = {truth.parted:.4g} s, by exp({truth.growth:.3g} t)"
        ended = f"{second.name} ends {second.run.outcome.value} at t = {truth.parted:.4g} s"
        source += f"; {ended if math.isnan(truth.growth) else apart}"
    if case.rubs:
        truth = replace(truth, firm=firm_until(truth, second.run, second.rtol, case))
    if truth.firm < min(case.t_end, truth.trusted):
        source += f"; impulses of friction are told up to t = {truth.firm:.4g} s, as slips are too slow behind it"
    return _rechecked(replace(truth, source=source), case)


@dataclass(frozen=True, slots=True)
class _Source:
    """What a truth is held against.

    Attributes:
        run: its motion.
        name: whose that is.
        rtol: its tolerance.
        shared: what it has in common with the truth.
        tier: how the truth is known by it.
        why: no other source that has less in common; empty where there is none.
        spent: engine and profile that would have less in common, but took all its time; empty where there is none.
    """

    run: Trajectory
    name: str
    rtol: float
    shared: str
    tier: Tier
    why: str = ""
    spent: tuple[str, str] = ("", "")


def _second(case: Case, truth: Truth, other: str, budget: float) -> _Source:
    """The source that has least in common with a truth, of those that get as far in their time."""
    from crossbody.cases.scene_contacts import frictional

    why, rtol, known = "", SECOND * case.tight, _determined(case, truth.trajectory)
    spent = ("", "")
    if case.general and truth.trajectory.outcome is Outcome.ILL_POSED:
        why = "no other can tell which way a motion goes that the equations leave open"
    elif other != "compiled":
        rubs = case.scene is not None and frictional(case.scene) is not None
        of_scene = OF_FILES if case.file else OF_WITNESS
        limit = (of_scene if case.general else OF_KERNELS) * budget
        found = _witness(case, limit) if case.general and not rubs else ""
        if isinstance(found, Trajectory):
            return _Source(found, "Pinocchio with CVODE", WITNESS * case.tight, "only the scene", Tier.C)
        run = _in_time(known, other, rtol, limit)
        if not (why := _left_out(truth, run, case, rubs)):
            return _Source(run, other, rtol, "only the equations of the mechanism", Tier.C, found)
        spent = ("reference", other) if run.outcome is Outcome.TIME_LIMIT else spent
    run = _in_time(known, "compiled", rtol)
    return _Source(run, "compiled", rtol, "equations, integrator and event location", Tier.D, why, spent)


def _until(case: Case, t: float) -> Case:
    """Return a scene up to the last instant that is asked for, s; other cases as they are."""
    return replace(case, t_end=min(max(t, SHORTEST * case.t_end), case.t_end)) if case.general else case


def _determined(case: Case, first: Trajectory) -> Case:
    """Return a scene up to where the law determines its motion: from there on no second source says anything of it."""
    end = min(first.determined_until, first.unique_until)
    return replace(case, t_end=end) if case.general and 0.0 < end < case.t_end else case


def _in_time(case: Case, solver: str, rtol: float, limit: float = math.inf) -> Trajectory:
    """A motion by another solver of the reference, as far as it gets in time, s: CVODE's equations are in Python."""
    from crossbody.engines import load

    for part in (SHARE, 1.0) if math.isfinite(limit) and case.general else (1.0,):
        shorter = replace(case, t_end=part * case.t_end)
        bound = {"time_limit": part * limit} if math.isfinite(limit) else {}
        run: Trajectory = load("reference").prepare(shorter, solver, rtol=rtol, **bound).run()
        if run.outcome is Outcome.TIME_LIMIT:
            break
    return run


def _left_out(truth: Truth, second: Trajectory, case: Case, rubs: bool) -> str:
    """Return why CVODE does not stand for the whole motion, and what it says all the same; nothing where it does.

    One that is at another place before its time is over does stand for it: then either may be wrong.
    """
    end = float(second.t[-1])
    if second.outcome is not Outcome.TIME_LIMIT:
        other = rubs and not (second.outcome.ok or second.outcome is truth.trajectory.outcome)
        return f"CVODE ends {second.outcome.value} at t = {end:.4g} s" if other else ""
    off = _apart(replace(truth, trusted=end), second, case)[1]
    if (off > PARTED).any():
        return ""
    said = "CVODE, which shares only the equations, takes longer than --budget allows"
    return f"{said}: up to t = {end:.4g} s it is at most {np.max(off, initial=0.0):.1e} off"


def _witness(case: Case, limit: float) -> Trajectory | str:
    """A scene's motion in Pinocchio, or the reason why there is none.

    Its model is built from the scene; kinematics, forces, rows, location of events and integrator
    are others' or written apart.
    """
    from crossbody import engines

    try:
        pinocchio = engines.load("pinocchio")
        first, rtol = replace(case, t_end=SHARE * case.t_end), WITNESS * case.tight
        cost, steps = estimated(partial(pinocchio.prepare, first, "law", rtol=rtol), SHARE, limit)
        if cost > limit:
            return f"Pinocchio would share only the scene, but take about {cost:.0f} s or more"
        # Contacts later on may want far more steps than the first part.
        most = max(1000, int(limit * steps / (SHARE * cost)))
        run = pinocchio.prepare(case, "law", rtol=rtol, max_steps=most).run()
    except (EngineUnavailable, CaseUnsupported) as error:
        return str(error).removesuffix(".")
    return run if run.outcome.ok else f"Pinocchio ends {run.outcome.value} at t = {run.t[-1]:.4g} s"


def _rechecked(truth: Truth, case: Case) -> Truth:
    """The truth up to the first mode that does not hold: two searches may miss the same event."""
    broken = violated(case, truth.trajectory, SECOND * case.tight) or ()
    if not broken:
        return truth
    first = min(broken, key=lambda one: one.t)
    told = (
        f"; row {first.contact} is {first.mode.name} at t = {first.t:.6g} s, but {first.reason}: not trusted from there"
    )
    return replace(truth, source=truth.source + told, trusted=min(truth.trusted, first.t))


_SHARED = "the law does not determine the normal forces of sliding contacts"


def _by_shares(run: Trajectory) -> str:
    """By how much other shares of loads would move a contact of a motion; empty where nobody has told."""
    far = run.undetermined_by
    return f"; other shares of the load would move one by up to {far:.2g} m until the end" if far > 0.0 else ""


def _horizon(case: Case, truth: Truth, second: Trajectory, t: Floats, grown: Floats) -> Chaos | None:
    """Up to when the motion of a scene can be known, and why no further; None if to the end.

    Sources that part where neighbouring motions do not are no reason.

    Args:
        case: the scene.
        truth: held against the second source.
        second: that source.
        t (n,): instants, s.
        grown (n,): by how much errors of the start have grown until then.
    """
    if not case.general or case.chaos is not None:
        return None
    reasons = [
        (truth.trajectory.determined_until, _SHARED + _by_shares(truth.trajectory)),
        (  # what either has found is so, whatever the bound by which the other did not look for it
            min(truth.trajectory.unique_until, second.unique_until),
            "several sets of sticking, sliding and open contacts satisfy the law, or none is known to",
        ),
        (truth.trajectory.searched_until, "too many contacts could change at an instant to search for a second motion"),
        (_arbitrary(truth, second, case), "the law does not determine which of several dependent rows opens first"),
    ]
    if truth.parted < case.t_end and grown[-1] > MULTIPLIED:
        why = f"until then the distance of neighbouring motions grows by {MULTIPLIED:g} times"
        reasons.append((float(t[np.argmax(grown > MULTIPLIED) - 1]), why))
    until, why = min((reason for reason in reasons if reason[0] > 0.0), default=(math.inf, ""))
    return Chaos(until=until, why=why) if until < min(case.t_end, truth.parted) else None


def _arbitrary(truth: Truth, second: Trajectory, case: Case) -> float:
    """The first instant at which rows that depend on each other switch otherwise in the two sources; infinite if none.

    They move alike all the same: the sources have not parted.
    """
    if not truth.trajectory.counts.get("redundant", 0):
        return math.inf
    for a, b in matched(truth, second):
        if abs(a.touch - b.touch) > PARTED * case.t_end:
            return min(a.touch, b.touch)
        if not abs(a.release - b.release) <= PARTED * case.t_end and a.release != b.release:
            return min(a.release, b.release)
    return math.inf


def _growing(case: Case, truth: Trajectory, limit: float) -> tuple[Floats, Floats]:
    """Instants (n,), s, and by how much more than in free flight errors of the start have grown until then (n,).

    Of a scene, and of any case with other parameters than those that its limits are for.

    Its velocities are put off, on its rows, and followed up to where the law determines them. A neighbour that gets
    less far, or takes longer than a limit, s, tells of growth as far as it gets: limits are the stricter for what is
    not known.
    """
    fastest = max(float(np.max(np.abs(truth.v), initial=0.0)), RESTS)  # what balances falls, however slowly
    if not (case.general or changed(case)) or not truth.outcome.ok or not fastest < math.inf:
        return np.array([0.0, case.t_end]), np.ones(2)
    from crossbody.engines.equations import system_of

    rng, system = np.random.default_rng(0), system_of(case)
    some = distinct(np.searchsorted(truth.t, np.linspace(0.0, float(truth.t[-1]), INSTANTS)))
    t, exact, most, end = truth.t[some], truth.q[some], np.ones(len(some)), _determined(case, truth).t_end
    held = system.constraint(case.q0, case.v0)[0][~case.law.unilateral]
    for _ in range(DIRECTIONS):
        way = rng.choice([-1.0, 1.0], size=len(case.v0))
        way -= np.linalg.lstsq(held, held @ way, rcond=None)[0] if len(held) else 0.0
        off = NUDGE * fastest
        nudged = replace(case, v0=case.v0 + off * way, t_end=end)
        run = motion(nudged, case.tight, samples=t[t <= end], time_limit=limit)
        count = int(np.searchsorted(t, run.t[-1], side="right")) if len(run.t) else 0
        apart = np.zeros(len(t))
        apart[:count] = np.max(differences(run.q[:count], exact[:count], case.quaternions), axis=1)
        most = np.maximum(most, grown(t, apart, off))
    return t, most


def grown(t: Floats, apart: Floats, off: float) -> Floats:
    """Return by how much more than in free flight an error of the start has grown until instants (n,).

    Args:
        t (n,): instants from the start to the horizon, s.
        apart (n,): how far two motions are apart, m or rad.
        off: by what their velocities differ at the start, m/s or rad/s.
    """
    largest: Floats = np.maximum.accumulate(apart) / (off * t[-1])
    return largest


def held_against(truth: Truth, second: Trajectory, case: Case, rtol: float) -> Truth:
    """The truth with what a second source says of it: agreement, until when, how fast they part."""
    t, off = _apart(truth, second, case)
    parted = off > PARTED
    trusted = math.inf if second.outcome.ok else float(second.t[-1]) if len(second.t) else 0.0
    growth = math.nan
    if parted.any():
        trusted, growth = float(t[np.argmax(parted)]), _growth(t, off)
    agreed = trusted
    if case.chaos is not None:  # what is worse known than the declared time is not compared either
        agreed = min(trusted, case.chaos.until)
    apart = agreement(replace(truth, trusted=agreed), second, case)
    allowed = PARTED if case.chaos is not None else min(AGREES * rtol, PARTED)
    return replace(truth, trusted=agreed, parted=trusted, allowed=allowed, growth=growth, agreement=apart)


def _apart(truth: Truth, second: Trajectory, case: Case) -> tuple[Floats, Floats]:
    """Instants of the second run up to the end of the first (n,), and their distance over the largest coordinate."""
    from crossbody.reports.measuring.alignment import aligned

    inside, exact = aligned(truth, second, case)
    scale = max(float(np.max(np.abs(truth.trajectory.q), initial=0.0)), RESTS)
    off = differences(second.q[inside], exact.q, case.quaternions)
    return second.t[inside], np.max(off, axis=1, initial=0.0) / scale


def _growth(t: Floats, off: Floats) -> float:
    """Slope of ln(largest distance so far), 1/s, between rounding and the largest; infinite for a jump."""
    worst = np.maximum.accumulate(off)
    rising = (worst > GROWN * np.finfo(float).eps) & (worst <= PARTED)
    if rising.sum() < 2 or np.ptp(t[rising]) == 0.0:
        return math.inf
    return float(np.polyfit(t[rising], np.log(worst[rising]), 1)[0])


def with_both_sides(run: Trajectory, natural: Trajectory) -> Trajectory:
    """A run sampled at given times, with the states at both sides of an event where an instant was asked for twice.

    Args:
        run: sampled; an event's instant gives the state before it, or after it where its own
            event came earlier.
        natural: the same run at its own steps, both sides of every event.
    """
    again = np.flatnonzero(run.t[1:] == run.t[:-1]) + 1
    before, behind = (np.searchsorted(natural.t, run.t[again], side=side) for side in ("left", "right"))
    twice = behind - before > 1
    rows: dict[str, Floats] = {}
    at = np.concatenate([again[twice] - 1, again[twice]])
    known = np.concatenate([before[twice], behind[twice] - 1])
    for name in ("q", "v", "gap", "lam", "energy", "mode"):
        rows[name] = getattr(run, name).copy()
        rows[name][at] = getattr(natural, name)[known]
    booked = run.ledger
    if booked is not None and natural.ledger is not None:
        booked = _booked(booked, natural.ledger, at, known)
    return replace(run, ledger=booked, **rows)  # type: ignore[arg-type]


def _booked(run: Ledger, natural: Ledger, at: NDArray[np.intp], after: NDArray[np.intp]) -> Ledger:
    """The account on both sides of an event: a collision in no time does its work at one instant."""
    accounts = {name: getattr(run, name).copy() for name in ("contact", "input", "dissipated")}
    for name, account in accounts.items():
        account[at] = getattr(natural, name)[after]
    return Ledger(**accounts)


def agreement(truth: Truth, second: Trajectory, case: Case) -> dict[str, float]:
    """Return by metric how far another motion is from a truth, up to where that is trusted."""
    from crossbody.reports import metrics

    truth = shortened(truth)
    second = truth.compared(second)
    found = {name: metrics.load(name).measure(truth, second, case) for name in ("position", "event_times")}
    if truth.tier is Tier.C and not case.general:  # of a scene, rows that share a load may switch in any order
        found["modes"] = _other_modes(truth, second, case)
    if truth.tier is Tier.C and not (_share(truth.trajectory) or _share(second)):
        found |= _accounts(truth, second, case)
    if truth.tier is Tier.C and case.rubs and math.isinf(truth.trusted):  # a motion tells this of the whole alone
        found |= _touches(truth.trajectory, second)
    return {name: value for name, value in found.items() if value is not None}


def _share(run: Trajectory) -> bool:
    """Whether rows of a motion depend on each other: what one of them does is then one of many answers."""
    return bool(run.counts.get("redundant", 0))


def _touches(exact: Trajectory, second: Trajectory) -> dict[str, float]:
    """Return by how much else two motions say that touches gave out, over the largest energy, and how many more.

    Of those whose gain is below what tolerances leave open either may count some: such numbers are no difference.
    """
    found, scale = dict[str, float](), energy(exact)
    if scale == 0.0:
        return found
    for amount, count in GAINS.items():
        a, b = getattr(exact, amount), getattr(second, amount)
        found[amount] = abs(a - b) / scale
        many = exact.counts.get(count, 0), second.counts.get(count, 0)
        found[count] = float(abs(many[0] - many[1])) if max(a, b) > PARTED * scale else 0.0
    return found


def _accounts(truth: Truth, second: Trajectory, case: Case) -> dict[str, float]:
    """Return how far the account of energy of another motion is off, by itself and row by row, and its impulses.

    What it moves like says nothing of these: they are recorded beside.
    """
    from crossbody.reports import metrics

    by = (*(("energy_integrator", "contact_work") if second.ledger is not None else ()), "lam_impulse_path")
    found = {name: metrics.load(name).measure(truth, second, case) for name in by}
    return {name: value for name, value in found.items() if value is not None}


def _other_modes(truth: Truth, second: Trajectory, case: Case) -> float:
    """Return how many modes of samples differ, away from the events of both, of rows that both know.

    Whether what pushes nothing is just below its surface, or free just above it, rounding decides.
    """
    from crossbody.reports.measuring.alignment import aligned

    inside, exact = aligned(truth, second, case)
    t, mode = second.t[inside], second.mode[inside]
    flat = np.abs(exact.gap) <= PARTED * float(np.max(np.abs(exact.gap), initial=0.0))
    told = ~flat | np.isin(exact.mode, CLOSED) | np.isin(mode, CLOSED)
    events = np.array([event.t for event in (*truth.trajectory.events, *second.events)])
    near = np.searchsorted(np.sort(events), t + np.array([[PARTED], [-PARTED]]) * case.t_end)
    other = (exact.mode >= 0) & (mode >= 0) & (exact.mode != mode) & told
    return float(np.sum(other[near[0] == near[1]]))
