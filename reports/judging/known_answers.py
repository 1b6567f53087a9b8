"""What metrics must say of made-up motions, by sums over samples: no code of a metric is asked for it.

The answers are those of the sentences that metrics have, written out: a metric and its answer share no function. So a
rule that cancels between a run and a truth, or that no engine makes use of, comes out as a number that is another one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from crossbody.cases import Case, Event, Mode, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports import metrics
from crossbody.reports.judging.made_up import MadeUp, case_of
from crossbody.reports.judging.planting import Range
from crossbody.reports.measuring.truth import Truth

EXACT = 1e-9
"""Part of an answer by which sums in another order differ, and what a run is allowed at its surface."""
Answers = Mapping[str, float | None]

UNLIKE = (("m", "rad", "m", "rad", "m"), (True, False, True, True))
HELD = (("rad", "rad", "rad"), (False, False))
MADE = ((*UNLIKE, 1, 2), (*HELD, 3, 0), (("m",), (True,), 4, 0))
"""Units of coordinates, which rows open, seed, and number of rows of friction, of motions of which every run asks."""


@cache
def wrong() -> tuple[tuple[str, float, Range, str], ...]:
    """Return metric, number, least and most, and motion, of what metrics say of made-up motions and must not.

    Each is asked of the first motion that has a number of it, and of those before.
    """
    told: set[str] = set()
    found: list[tuple[str, float, Range, str]] = []
    for units, opens, seed, rubs in MADE:
        made = MadeUp(case_of(units, opens, seed, rubs), seed)
        wanted = {name: value for name, value in answers(made).items() if name not in told}
        found += _wrong(made, wanted)
        told |= {name for name, value in wanted.items() if value is not None}
    return tuple(found)


def _wrong(made: MadeUp, wanted: Answers) -> Iterator[tuple[str, float, Range, str]]:
    for name, value in wanted.items():
        found = measured(name, made.truth, made.run, made.case)
        if value is None and found is not None:
            yield name, found, (np.nan, np.nan), "a number of a motion that has none"
        elif value is not None and not (found is not None and abs(found - value) <= EXACT * abs(value)):
            yield name, np.nan if found is None else found, (value, value), "a made-up motion"


def measured(name: str, truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Return what a metric says; NaN where it throws."""
    try:
        return metrics.load(name).measure(truth, run, case)
    except Exception:
        return np.nan


def answers(made: MadeUp) -> Answers:
    """Return metric -> what it must say of the run of a made-up motion; None where there is no such number."""
    found: dict[str, float | None] = {}
    for kind in KINDS:
        found |= kind(made)
    return MappingProxyType(found)


def largest_of_like(values: Floats, units: Sequence[str]) -> Floats:
    """Return the largest value (n,) of each unit, of that of each coordinate (n,)."""
    return np.array([max(v for v, other in zip(values, units, strict=True) if other == unit) for unit in units])


def _energy(run: Trajectory) -> float:
    return max(float(run.energy[:, 0].max()), float(run.energy[:, 1].max() - run.energy[:, 1].min()))


def _coordinates(made: MadeUp) -> Answers:
    """Positions by their own, velocities by their like; the way that velocities do not explain."""
    k, run, exact, case = made.trusted, made.run, made.exact, made.case
    own = np.abs(exact.q).max(axis=0)
    rates = np.maximum(np.abs(exact.v).max(axis=0), [c.rate for c in case.velocities])
    fast = largest_of_like(rates, [c.unit for c in case.velocities])
    found: dict[str, float | None] = {}
    if case.scene is None:  # joints of scenes are measured by more (`known_sizes`)
        found["velocity"] = float((np.abs(run.v[:k] - exact.v[:k]) / fast).max())
    if case.scene is None and not case.quaternions:
        found["position"] = float((_at_and_between(run, exact, k, case.t_end / 200.0) / own).max())
    if not case.quaternions:
        step, mean = np.diff(run.t)[:, None], 0.5 * (run.v[1:] + run.v[:-1])
        moved = np.diff(run.q, axis=0)
        off = np.abs(((moved - mean * step) * np.sign(mean)).sum(axis=0))
        found["rate_residual"] = float((off / np.abs(moved).sum(axis=0)).max())
        starts = ((case.q0, exact.q, case.coordinates, run.q), (case.v0, exact.v, case.velocities, run.v))
        found["start_error"] = max(
            float((np.abs(mine[0] - start) / largest_of_like(np.abs(all_).max(axis=0), [c.unit for c in named])).max())
            for start, all_, named, mine in starts
        )
    if not case.law.unilateral.any():
        far = np.abs(run.q - exact.q)[:k].max(axis=1) > 1e-3 * np.abs(exact.q).max()
        found["divergence_time"] = next((t for t, left in zip(run.t, far, strict=False) if left), run.t[k - 1])
    angles = all(c.unit == "rad" for c in case.coordinates)
    found["angle_error"] = float(np.abs(run.q[:k] - exact.q[:k]).max()) if angles else None
    return found


def _at_and_between(run: Trajectory, exact: Trajectory, k: int, far: float) -> Floats:
    """Errors of the first k samples (m, nq), and at eight instants of what is longer than `far`, s, by de Casteljau."""
    off = run.q[:k] - exact.q[:k]
    found = [*off]
    for i, (own, step) in enumerate(zip(np.diff(run.t[:k]), np.diff(exact.t[:k]), strict=True)):
        way = [(run.v[j] * own - exact.v[j] * step) / 3.0 for j in (i, i + 1)]
        ends = off[i], off[i] + way[0], off[i + 1] - way[1], off[i + 1]
        for x in [part / 9.0 for part in range(1, 9)] if own > far else ():
            points = list(ends)
            while len(points) > 1:
                points = [(1.0 - x) * a + x * b for a, b in pairwise(points)]
            found += points
    sizes: Floats = np.abs(np.array(found))
    return sizes


def _energies(made: MadeUp) -> Answers:
    """Energies, and the work of every row, by the largest energy."""
    k, size, run, exact = made.trusted, _energy(made.exact), made.run, made.exact
    assert run.ledger is not None
    assert exact.ledger is not None
    total = run.energy[:, 0] + run.energy[:, 1]
    book = run.ledger.input - run.ledger.dissipated + sum(run.ledger.contact.T)
    left = total - book - (total - book)[0]
    found: dict[str, float | None] = {
        "energy_drift": float(np.abs(total - exact.energy[:, 0] - exact.energy[:, 1])[:k].max() / size),
        "contact_work": float(np.abs(run.ledger.contact[:k] - exact.ledger.contact[:k]).max() / size),
        "energy_integrator": float(np.abs(left).max() / size), "energy_law": None,
        "contact_loss": -float(sum(run.ledger.contact[-1])),
    }  # fmt: skip
    if (opens := made.case.law.unilateral).any():
        work = sum(run.ledger.contact.T[opens])
        found["energy_law"] = max(0.0, float(np.max(work))) / float(exact.energy[:, 0].max())
    return found


def _gaps(made: MadeUp) -> Answers:
    """Gaps of rows that touch, and of those that are always on."""
    k, run, exact, opens = made.trusted, made.run, made.exact, made.case.law.touches
    on = ~made.case.law.unilateral
    deep, right = np.minimum(run.gap[:, opens], 0.0), np.minimum(exact.gap[:, opens], 0.0)
    apart = float(np.max(np.abs(deep - right)[:k], initial=0.0))
    found: dict[str, float | None] = (
        {} if made.case.mechanism else {"gap_error": None}
    )  # equations tell what else measures a gap
    if not made.case.mechanism and opens.any():
        found["gap_error"] = float(np.abs(run.gap - exact.gap)[:k, opens].max() / np.abs(exact.gap[:, opens]).max())
    return found | {
        "constraint_drift": float(np.abs(run.gap[:, on]).max()) if on.any() else None,
        "penetration": -float(deep.min()) if opens.any() else None,
        "penetration_error": apart / -float(right.min()) if np.any(right < 0.0) else None,
        "final_gap": float(min(run.gap[-1, ~made.rubs])),
    }


def integrals(t: Floats, lam: Floats) -> Floats:
    """Return the integrals (n, nc) by trapezoids from the start to each sample."""
    found = [np.zeros(lam.shape[1])]
    for i in range(1, len(t)):
        found.append(found[-1] + 0.5 * (t[i] - t[i - 1]) * (lam[i - 1] + lam[i]))
    return np.array(found)


def _idle(run: Trajectory) -> float:
    """Return a thousandth of the force that moves a motion's energy along its longest way, N."""
    return 1e-3 * _energy(run) / float((run.q.max(axis=0) - run.q.min(axis=0)).max())


def _multipliers(made: MadeUp) -> Answers:
    """Multipliers and their impulses, with those of blows."""
    k, run, exact, opens = made.trusted, made.run, made.exact, made.case.law.unilateral
    idle = _idle(exact)
    off, most = float(np.abs(run.lam[:k] - exact.lam[:k]).max()), float(np.abs(exact.lam[:k]).max())
    mine, theirs = integrals(run.t, run.lam)[:k], integrals(made.t[:k], exact.lam[:k])
    for found, motion in ((mine, run), (theirs, exact)):
        for event in motion.events:
            found[motion.t[:k] > event.t, event.contact] += event.impulse
    own, right = _totals(made)
    total = _largest(made, [own - right]) / max(_largest(made, [right]), idle * made.case.t_end)
    path = _largest(made, mine - theirs) / max(_largest(made, theirs), idle * made.case.t_end)
    return {
        "lam_error": None if opens.any() else off / max(most, idle), "lam_impulse": total, "lam_impulse_path": path,
        "final_lam": float(sum(run.lam[-1])),
    }  # fmt: skip


def _largest(made: MadeUp, values: Iterable[Floats]) -> float:
    """Return the largest size of values of rows (nc,): of both tangents of a place its length."""
    names = made.case.contacts
    pairs = [(k, k + 1) for k in range(len(names) - 1) if names[k].endswith(" t1") and names[k + 1].endswith(" t2")]
    return max(
        max([*np.abs(one).tolist(), *(math.hypot(one[i], one[j]) for i, j in pairs)], default=0.0) for one in values
    )


def _totals(made: MadeUp) -> tuple[Floats, Floats]:
    """Return the impulses (nc,) of both up to one instant: that of the run's last sample for which the truth is known.

    The truth's is that beside the run's last sample by then that has a truth, and what it comes to from there on.
    """
    run, exact = made.run, made.exact
    last = max(i for i, t in enumerate(run.t) if t <= min(made.truth.trusted, made.t[-1]))
    near, end = min(made.trusted - 1, last), run.t[last]
    own, sums = integrals(run.t, run.lam)[last], integrals(made.t, exact.lam)
    right = sums[near].copy()
    right += [np.interp(end, made.t, one) - np.interp(made.t[near], made.t, one) for one in sums.T]
    for found, motion in ((own, run), (right, exact)):
        for event in motion.events:
            found[event.contact] += event.impulse * (event.t <= end)
    return own, right


def _pulls(made: MadeUp) -> Answers:
    """Multipliers that pull, or act on rows that are open, by the largest of those that open."""
    rows = np.flatnonzero(made.case.law.touches)
    if not len(rows):
        return {"complementarity": None}
    lam, free = made.run.lam[:, rows], made.run.mode[:, rows] == Mode.FREE
    return {"complementarity": max(-float(lam.min()), float(np.abs(lam[free]).max())) / float(np.abs(lam).max())}


def _begins(event: Event) -> bool:
    return event.before == Mode.FREE and event.after == Mode.COLLISION


def _ends(event: Event) -> bool:
    return event.before == Mode.CONTACT


def _settles(event: Event) -> bool:
    return event.before == Mode.COLLISION


def _counts(made: MadeUp) -> Answers:
    """How often a made-up run does what its truth does."""
    events, touches = made.run.events, made.case.law.touches
    blows, count = [e.impulse for e in events if e.impulse], 0.0 if touches.any() else None
    return {
        "touch_count": count, "release_count": count,
        "contacts": float(sum(_begins(e) and touches[e.contact] for e in events)),
        "bounces": float(sum(e.after == Mode.FREE for e in events)), "transitions": float(len(events)),
        "collision_impulse": float(sum(blows)) if blows else None,
    }  # fmt: skip


def _instants(made: MadeUp) -> Answers:
    """How far touches, hand-overs and releases are off of contacts that begin while the truth is trusted."""
    run, exact, late = made.run, made.exact, made.late
    touches, settles, ends = ([e.t for e in exact.events if of(e)] for of in (_begins, _settles, _ends))
    rows = [e.contact for e in exact.events if _ends(e)]
    known = [k for k, t in enumerate(touches) if t <= made.truth.trusted]
    shifts = [abs(float(late(t)) - t) for k in known for t in (touches[k], ends[k])]
    handed = [abs(float(late(settles[k])) - settles[k]) for k in known]
    for k in known:  # by the way of the gap until it is free, with a blow behind, at its fastest
        gap, t, until = exact.gap[:, rows[k]], made.t, [*touches, np.inf][k + 1]
        free = max(e.t for e in exact.events if e.contact == rows[k] and e.after == Mode.FREE and e.t < until)
        way = abs(float(np.interp(late(free), t, gap)) - float(np.interp(free, t, gap)))
        handed.append(way / max(abs(b - a) / d for a, b, d in zip(gap[:-1], gap[1:], np.diff(t), strict=True)))
    lasts = [e.t for e in run.events if _ends(e)]
    exits = [e.t for e in run.events if e.after == Mode.FREE]
    return {
        "event_times": max(shifts) if shifts else None, "mode_times": max(handed) if handed else None,
        "contact_time": lasts[0] - float(late(touches[0])) if lasts else None,
        "fifth_exit": exits[4] if len(exits) > 4 else None,
    }  # fmt: skip


def _surfaces(made: MadeUp) -> Answers:
    """How far gaps are from zero at touches, and gaps or multipliers at releases, by their longest ways."""
    run, touches = made.run, made.case.law.touches
    if not touches.any():
        return {"event_gap": None}

    def ways(signal: Floats, t: float, nothing: float) -> float:
        there = abs(float(np.interp(t, run.t, signal)))
        longest: float = max(abs(b - a) for a, b in pairwise(signal.tolist()))
        return max(there - nothing, 0.0) / longest

    near, light = 1e-10 * max(1.0, float(np.abs(run.q).max())), 1e-12 * max(1.0, float(np.abs(run.lam).max()))
    found = [0.0]
    for e in (e for e in run.events if touches[e.contact]):
        gap, push = ways(run.gap[:, e.contact], e.t, near), ways(run.lam[:, e.contact], e.t, light)
        surfaces = e.before == Mode.BALLISTIC
        found += [gap] if _begins(e) or surfaces else [min(gap, push)] if _ends(e) else []
    return {"event_gap": max(found)}


def _leaves(made: MadeUp) -> Answers:
    """What a run does as its contacts end."""
    run, ends = made.run, [e for e in made.run.events if _ends(e)]
    if not ends:
        return {"energy_per_bounce": None, "separation_gap": None}
    total = run.energy[:, 0] + run.energy[:, 1]
    return {
        "energy_per_bounce": (float(np.interp(ends[-1].t, run.t, total)) - float(total[0])) / len(ends),
        "separation_gap": float(np.interp(ends[0].t, run.t, run.gap[:, ends[0].contact])),
    }


def _rebounds(made: MadeUp) -> Answers:
    """Rates of a ball as its contacts end, by those as they begin."""
    if not made.scalar:
        return {}
    pairs = []
    for motion in (made.exact, made.run):
        into, out = ([float(np.interp(e.t, motion.t, motion.v[:, 0])) for e in motion.events if of(e)]
                     for of in (_begins, _ends))  # fmt: skip
        pairs.append([-b / a for a, b in zip(into, out, strict=True)])
    known = [e.t <= made.truth.trusted for e in made.exact.events if _begins(e)]
    off = [abs(a - b) for a, b, there in zip(*pairs, known, strict=True) if there]
    return {"restitution": pairs[1][0], "restitution_error": max(off)}


def _modes(made: MadeUp) -> Answers:
    """Samples in a mode that no event left, and samples of rows that open whose force is not that of their mode."""
    run, opens = made.run, made.case.law.unilateral
    odd, other = 0, 0
    for row in range(len(opens)):
        events = [e for e in run.events if e.contact == row]
        left = [Mode.FREE if opens[row] else Mode.BILATERAL, *(e.after for e in events)]
        at = [-np.inf, *(e.t for e in events), np.inf]
        for t, mode in zip(run.t.tolist(), run.mode[:, row].tolist(), strict=True):
            odd += not any(a <= t <= b and mode == m for a, b, m in zip(at[:-1], at[1:], left, strict=True))
        odd += sum(int(e.before != was) for e, was in zip(events, left[:-1], strict=True))
    light = 1e-6 * float(np.abs(run.lam).max())
    ways = np.maximum(1e-6 * max(1.0, float(np.abs(run.q).max())), np.abs(np.diff(run.gap, axis=0)).max(axis=0))
    for i in range(2, len(run.t)):
        first, last = run.t[i - 1], run.t[min(i + 1, len(run.t) - 1)]
        if any(first <= e.t <= last for e in run.events):
            continue
        for row in np.flatnonzero(opens).tolist():
            bears, high = abs(run.lam[i, row]) > light, run.gap[i, row] > ways[row]
            other += bool(bears if run.mode[i, row] == Mode.FREE else high and not bears)
    for e in run.events:  # and touches of rows that are above by two of these ways at the samples around
        behind = next((i for i in range(1, len(run.t)) if run.t[i] > e.t), len(run.t) - 1)
        least = min(run.gap[max(behind - 2, 0) : behind + 1, e.contact].tolist())
        other += bool(opens[e.contact] and _begins(e) and e.before == Mode.FREE and least > 2.0 * ways[e.contact])
    return {"mode_residual": float(odd), "mode_contradicted": float(other)}


KINDS: tuple[Callable[[MadeUp], Answers], ...] = (
    _coordinates, _energies, _gaps, _multipliers, _pulls, _counts, _instants, _surfaces, _leaves,
    _rebounds, _modes,
)  # fmt: skip
