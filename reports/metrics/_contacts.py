"""Touches, releases, modes and gaps of a run, against the truth's and itself: every function is a metric."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Mode, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.contacts import CLOSED, Contact, rates
from crossbody.reports.measuring.alignment import aligned, matched
from crossbody.reports.measuring.equations import equations, finite, spread
from crossbody.reports.measuring.friction import SLOW, guard, rubbing, turned
from crossbody.reports.measuring.impulse import away, told
from crossbody.reports.measuring.instants import off
from crossbody.reports.measuring.placed import Placed, largest, of_rows, placed
from crossbody.reports.measuring.scale import rounded
from crossbody.reports.measuring.truth import Truth, taken
from crossbody.reports.metrics.position import gap_scale_of

UNITS = {
    "constraint_drift": "m", "event_times": "s", "mode_times": "s", "penetration": "m",
    "slip_times": "s", "stick_times": "s",
}  # fmt: skip
NEEDS = {"mode_contradicted": "lam"}
WAYS = 2.0
"""So many of its longest ways between samples a row may be above its surface where an engine finds it late."""
KNOWN = 1e-6
"""Part of the largest to which limits hold gaps and what releases leave of multipliers."""
SHALLOW = 1e-12
"""Penetration below this part of the largest gap is rounding: collisions that take no time do not penetrate."""


def constraint_drift(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Largest gap of the rows that are always active: zero if a closure holds.

    Max |h| over all bilateral rows and samples, m; None without such a row. Where a case starts off the
    manifold this is its start; its decay is what the law prescribes.
    """
    rows = ~case.law.unilateral
    return largest(np.abs(run.gap[:, rows]), run.t, of_rows(case, "m", "rad", rows)) if rows.any() else None


def event_times(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Instants of touch and release against the truth's, each row's in order.

    Max |t - t_truth| over matched touches and releases, s, or less where the gap, or the multiplier, comes near
    zero slowly (`measuring.instants`); None where nothing touches. A contact that the run or the truth does not
    have is not here: it is a difference in the metric contacts. NaN where an event of the run has no instant.
    """
    if np.isnan([event.t for event in run.events]).any():
        return math.nan
    pairs = matched(truth, run)
    shifts = [_shift(case, a.row, "touch", _touched(truth, a, b), a.touch) for a, b in pairs]
    ended = [(a, b) for a, b in pairs if np.isfinite(a.release) and np.isfinite(b.release)]
    shifts += [_shift(case, a.row, "release", _let_go(truth, a, b), a.release) for a, b in ended]
    return max(shifts, default=None)


def _shift(case: Case, row: int, what: str, late: float, t: float) -> Placed:
    """Return how far an instant of a row is off, s, that is at `t` in the truth."""
    return placed(late, f"{what} of {case.contacts[row]}", late, "s", t)


def _of_row(
    truth: Truth, signal: str, row: int, modes: tuple[Mode, ...]
) -> tuple[Callable[[Trajectory], Floats], float]:
    """Return the signal (n,) of a row of a motion, and to what it is known: a part of its own largest in the truth.

    It is infinite in other modes: there others bring events about.
    """
    largest = float(np.nanmax(np.abs(getattr(truth.trajectory, signal)[:, row]), initial=0.0))
    return (
        lambda motion: np.where(np.isin(motion.mode[:, row], modes), getattr(motion, signal)[:, row], np.inf),
        KNOWN * largest,
    )


def _touched(truth: Truth, a: Contact, b: Contact) -> float:
    """How far a touch is off, s."""
    return off(truth, a.touch, b.touch, *_of_row(truth, "gap", a.row, (Mode.FREE,)))


def _let_go(truth: Truth, a: Contact, b: Contact) -> float:
    """How far a release is off, s; contacts in no time end with their touch, which tells how far they are."""
    if a.release == a.touch and b.release == b.touch:
        return 0.0
    return off(truth, a.release, b.release, *_of_row(truth, "lam", a.row, CLOSED))


def gap_error(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Gaps against the truth's on matched arcs, over the largest of each row.

    Max |gap - gap_truth| / max |gap_truth| over samples and rows that touch, or over what the positions of the row's
    bodies are measured by, as far as they move it; None without one. Where a discrete variable changes a gap may
    jump: those instants are left out.
    """
    rows = case.law.touches
    inside, exact = aligned(truth, run, case)
    if not rows.any() or not inside.any():
        return None
    smooth = away(exact, [switch.t for switch in truth.trajectory.switches if not switch.smooth], case.t_end)
    apart = np.abs(run.gap[inside] - exact.gap)[smooth][:, rows]
    scale = gap_scale_of(truth, case, rows)
    named = of_rows(case, "m", "rad", rows)
    return largest(apart, run.t[inside][smooth], named, np.where(scale > 0.0, scale, 1.0))


def gap_residual(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Recorded gaps against those of the recorded positions, over the largest: an identity at every sample.

    Max |gap - gap(q)| / max |gap(q)|, or what rounding leaves of gaps is measured by, at most 400 samples. None without
    rows, where gaps depend on discrete variables, and where the case has no equations.
    """
    system = equations(case)
    if system is None or not run.gap.shape[1] or system.jumps:
        return None
    if not finite(run):
        return math.nan
    some = spread(run)
    wanted = system.gaps_along(run.q[some], 0.0 * run.v[some])[0]
    scale = max(float(np.max(np.abs(wanted))), rounded(run.q[some]))
    return largest(np.abs(run.gap[some] - wanted), run.t[some], of_rows(case, "m", "rad"), scale)


def mode_contradicted(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Recorded modes against recorded gaps, forces and slips: samples whose mode they contradict.

    Number of samples and rows at which an open row pushes, a FREE one is below its surface by more than the longest way
    between samples though the run has BALLISTIC ones (engines without call any FREE that does not push), or a closed
    one is above by as much and bears nothing; at which friction is called SLIP below half its bound, STICK beyond one
    and a half times it (pyramids in and around a cone of friction are within the root of two), or STICK at its bound
    while it slips. Touches of a row that is far above its surface count too: none begins there in any engine. Samples
    beside events are left out: a step has the force of either side. It asks nothing of the truth or the law. None
    without rows and where modes are not known, NaN where lam is not; rows that are always on and follow from others
    have none.
    """
    if not run.mode.size or (run.mode < 0).any() or len(run.t) < 2:
        return None
    if (known := told(run)) is None:
        return math.nan
    run = replace(run, lam=np.where(known, run.lam, 0.0))
    quiet, light = _between_events(run), KNOWN * float(np.max(np.abs(run.lam)))
    rows = case.law.unilateral
    mode, gap, bears = run.mode[:, rows], run.gap[:, rows], np.abs(run.lam[:, rows]) > light
    size = KNOWN * max(1.0, float(np.max(np.abs(run.q))))
    near = np.maximum(size, np.max(np.abs(np.diff(gap, axis=0)), axis=0))
    closed = np.isin(mode, CLOSED)
    below = (mode == Mode.FREE) & (gap < -near) & (run.mode == Mode.BALLISTIC).any()
    wrong = (~closed & bears) | below | (closed & (gap > near) & ~bears)
    other = np.sum(wrong[quiet]) + np.sum(_other_friction(run, case, light)[quiet])
    return float(other + _touching_nothing(run, np.flatnonzero(rows).tolist(), near))


def _touching_nothing(run: Trajectory, rows: list[int], near: Floats) -> int:
    """Count touches of rows that are above their surface by more than two of their longest ways between samples."""
    least = {row: WAYS * float(way) for row, way in zip(rows, near, strict=True)}
    touches = [e for e in run.events if e.contact in least and e.before == Mode.FREE and e.after in CLOSED]
    at = np.searchsorted(run.t, [e.t for e in touches], side="right").clip(1, len(run.t) - 1)
    around = [run.gap[max(i - 2, 0) : i + 1, e.contact] for i, e in zip(at.tolist(), touches, strict=True)]
    return sum(float(np.min(gap)) > least[e.contact] for gap, e in zip(around, touches, strict=True))


def _between_events(run: Trajectory) -> NDArray[np.bool_]:
    """Return the samples (n,) that are neither at an event nor beside one, nor the first two."""
    quiet = np.ones(len(run.t), dtype=bool)
    quiet[:2] = False
    at = np.array([event.t for event in run.events if np.isfinite(event.t)])
    first, last = (np.searchsorted(run.t, at, side=side) for side in ("left", "right"))
    for i, j in zip((first - 1).clip(0).tolist(), (last + 1).tolist(), strict=True):
        quiet[i:j] = False
    return quiet


def _other_friction(run: Trajectory, case: Case, light: float) -> NDArray[np.bool_]:
    """Return where (n, m) friction is not what its mode says; `light` is what is no force, N."""
    if (found := rubbing(run, case)) is None:
        return np.zeros((len(run.t), 0), dtype=bool)
    bound, mode = found.mu * found.normal, run.mode[:, found.rows]
    force, speed = np.linalg.norm(found.force, axis=-1), np.linalg.norm(found.slip, axis=-1)
    weak, heavy = (bound > light) & (force < 0.5 * bound), force > 1.5 * bound + light
    slips = (bound > light) & (force > (1.0 - KNOWN) * bound) & (speed > SLOW * float(speed.max(initial=0.0)))
    wrong: NDArray[np.bool_] = ((mode == Mode.SLIP) & weak) | ((mode == Mode.STICK) & (heavy | slips))
    return wrong


def mode_times(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Instants of hand-over and release against the truth's, each row's in order.

    Max |t - t_truth| over all that matched contacts have in both, s; None where there is none. A hand-over
    is from COLLISION to CONTACT; a row is free at its release or, let go below the surface, where it comes
    up to it. NaN where an event of the run has no instant.
    """
    if np.isnan([event.t for event in run.events]).any():
        return math.nan
    pairs = matched(truth, run)
    handed = [(a, b) for a, b in pairs if np.isfinite(a.settled) and np.isfinite(b.settled)]
    shifts = [_shift(case, a.row, "hand-over", abs(b.settled - a.settled), a.settled) for a, b in handed]
    freed = [(a, b) for a, b in pairs if np.isfinite(a.free) and np.isfinite(b.free)]
    shifts += [_shift(case, a.row, "freedom", _opened(truth.trajectory, a, b), a.free) for a, b in freed]
    return max(shifts, default=None)


def _opened(truth: Trajectory, a: Contact, b: Contact) -> float:
    """How far the gap of the truth opens from one freedom to the other, over its fastest rate, s.

    A row that is let go where its multiplier vanishes rises as the cube of the time: its instant is known
    to the cube root of its depth alone, and nothing in the motion depends on it. Where a discrete variable
    changes in between, the row's gap is another one: that instant is judged as a change of the variable.
    """
    first, last = sorted((a.free, b.free))
    if any(first <= switch.t <= last and not switch.smooth for switch in truth.switches):
        return 0.0
    gap, (here, there) = truth.gap[:, a.row], np.interp([a.free, b.free], truth.t, truth.gap[:, a.row])
    dt = np.diff(truth.t)
    fastest = float(np.max(np.abs(np.diff(gap)[dt > 0.0] / dt[dt > 0.0]), initial=0.0))
    return abs(there - here) / fastest if fastest else 0.0


def penetration(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Largest penetration.

    max(0, -gap) over all rows that touch and samples, m.
    """
    rows = case.law.touches
    depth = np.maximum(-run.gap[:, rows], 0.0)
    return largest(depth, run.t, of_rows(case, "m", "rad", rows)) if rows.any() else None


def penetration_error(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Penetration against the truth's on matched arcs, over the largest penetration.

    Max |min(gap, 0) - min(gap_truth, 0)| / max penetration of the truth; None where nothing penetrates.
    """
    rows = case.law.touches
    deepest = float(np.max(-truth.trajectory.gap[:, rows], initial=0.0))
    if deepest <= SHALLOW * float(np.max(np.abs(truth.trajectory.gap), initial=0.0)):
        return None
    inside, exact = aligned(truth, run, case)
    if not inside.any():
        return None
    apart = np.abs(np.minimum(run.gap[inside][:, rows], 0.0) - np.minimum(exact.gap[:, rows], 0.0))
    return largest(apart, run.t[inside], of_rows(case, "m", "rad", rows), deepest)


def release_count(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Contacts that ended in the run minus those of the truth: 0 if both release equally often.

    Number of contacts of the run that ended minus the truth's; None without a row that touches. What ended in one
    of them alone, and from there on bears no more in either than multipliers are known to, counts in neither.
    """
    if not case.law.touches.any():
        return None
    mine, theirs = (sum(np.isfinite(c.release) for c in truth.contacts(each)) for each in (run, truth.trajectory))
    pairs = [(a, b) for a, b in matched(truth, run) if np.isfinite(a.release) != np.isfinite(b.release)]
    untold = sum(1 if np.isfinite(b.release) else -1 for a, b in pairs if _light(truth, run, a, b))
    return float(mine - theirs - untold)


def _light(truth: Truth, run: Trajectory, a: Contact, b: Contact) -> bool:
    """Whether what ended in one motion alone bears no more there and here than is known, as in `event_times`.

    The other one goes on, closed: else it has lost an event.
    """
    lam, known = _of_row(truth, "lam", a.row, CLOSED)
    for motion, one in ((truth.trajectory, a), (run, b)):
        behind = (motion.t > min(a.release, b.release)) & np.isin(motion.mode[:, a.row], CLOSED)
        if not np.isfinite(one.release) and not behind.any():
            return False
        if not np.max(np.abs(lam(motion)[behind]), initial=0.0) <= truth.grows * known:
            return False
    return True


def restitution_error(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Restitution against the truth's, largest difference over matched contacts.

    Max |e - e_truth| over the contacts that ended in both; None where there is none.
    """
    pairs = zip(rates(truth.trajectory), rates(run), strict=False)
    return max((abs(out / into - b_out / b_into) for (_, b_into, b_out), (_, into, out) in pairs), default=None)


def slip_times(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Instants at which sticking shapes begin to slide, against the truth's.

    Max |t - t_truth|, s, or less where friction comes near its bound slowly (`measuring.instants`); None where the
    truth has none, or the run has not the same pairs in the same order.
    """
    return _turned(truth, run, case, slides=True)


def stick_times(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Instants at which sliding shapes begin to stick, against the truth's.

    Max |t - t_truth|, s, or less where the slip comes near zero slowly (`measuring.instants`); None where the
    truth has none, or the run has not the same pairs in the same order.
    """
    return _turned(truth, run, case, slides=False)


def _turned(truth: Truth, run: Trajectory, case: Case, slides: bool) -> float | None:
    """How far pairs are off that begin to slide, or hold, at most, s."""
    motions = (truth.trajectory, run)
    pairs, mine = ([one[:2] for one in turned(each, case) if one[2] == slides] for each in motions)
    if not pairs and not mine:
        return None
    guarded = {pair: guard(truth.trajectory, case, pair, slides) for pair, _ in (*pairs, *mine)}
    while len(pairs) != len(mine):
        longer = max(pairs, mine, key=len)
        if not _untold(truth, run, longer[-1][1], *guarded[longer[-1][0]]):
            return None
        longer.pop()
    if not pairs or [pair for pair, _ in pairs] != [pair for pair, _ in mine]:
        return None
    return float(np.max([off(truth, t, found, *guarded[k]) for (k, t), (_, found) in zip(pairs, mine, strict=True)]))


def _untold(truth: Truth, run: Trajectory, t: float, values: Callable[[Trajectory], Floats], known: float) -> bool:
    """Whether a change that one motion has alone is none that is known: what brings it about is none from there on."""
    behind = [taken(motion, motion.t >= t) for motion in (truth.trajectory, run)]
    return all(len(one.t) and float(np.max(np.abs(values(one)))) <= truth.grows * known for one in behind)


def touch_count(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Contacts of the run minus those of the truth: 0 if both touch equally often.

    Number of contacts of the run minus the truth's; None without a row that touches.
    """
    if not case.law.touches.any():
        return None
    return float(len(truth.contacts(run)) - len(truth.contacts(truth.trajectory)))
