"""Faults of known size in the events, modes and clock of a motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from crossbody.cases import Event, Mode, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.contacts import contacts
from crossbody.reports.judging.planted_forces import WEAK, carries, moving
from crossbody.reports.judging.planted_friction import bounds, fast
from crossbody.reports.judging.planting import (
    FAR,
    FEW,
    PART,
    PUSHES,
    TINY,
    Control,
    Plain,
    Range,
    exactly,
    roughly,
    with_signal,
)
from crossbody.reports.measuring.friction import rubbing, slips, turned
from crossbody.reports.measuring.truth import taken

HAIR = 1e-7
"""Gap at a touch, m, that no tolerance leaves, and that is less than what joins two touches."""
SEEN = 3e-6
"""Part of a row's longest way between samples that is beyond the limits of those who locate events."""


def counts(plain: Plain) -> Iterator[Control]:
    """Leave out a contact that ended, with its modes and without them."""
    run = plain.run
    row, touch, end = _last_contact(plain) or (-1, 0.0, 0.0)
    if row < 0:
        return
    mode = np.array(run.mode)
    mode[(run.t >= touch) & (run.t <= end), row] = Mode.FREE
    fewer = tuple(e for e in run.events if not (e.contact == row and touch <= e.t <= end))
    one = dict.fromkeys(("touch_count", "release_count"), exactly(1.0))
    yield Control(fault="a contact left out", run=replace(run, mode=mode, events=fewer), sees=one)
    inside = (run.t > touch) & (run.t < end)
    known = int(np.sum(inside & ~np.isin(run.t, [e.t for e in run.transitions(row)]) & (run.mode[:, row] != Mode.FREE)))
    if known:
        odd = {"mode_residual": (float(known), float(np.sum(mode != run.mode) * mode.shape[1]))}
        yield Control(fault="a contact without its modes", run=replace(run, mode=mode), sees=odd)


def modes(plain: Plain) -> Iterator[Control]:
    """Call what presses free, and what slips a stick, at one sample amid others of the same modes."""
    run = plain.run
    still = np.isin(np.arange(len(run.t)), plain.quiet)
    still[WIDE:-WIDE] &= np.all([still[i : len(still) - 2 * WIDE + i] for i in range(2 * WIDE + 1)], axis=0)
    still[:WIDE] = still[len(still) - WIDE :] = False
    for k in plain.normal if run.lam.any() else ():
        presses = still & (run.lam[:, k] > FAR * float(np.max(np.abs(run.lam)))) & np.isin(run.mode[:, k], PUSHES)
        for i in plain.samples(presses)[:1]:
            freed = with_signal(run, "mode", (i, int(k)), Mode.FREE)
            yield Control(fault=f"row {k} presses while FREE", run=freed, sees={"mode_contradicted": exactly(1.0)})
    yield from _misnamed(run)
    rows, ways, bound = bounds(plain.case, run)
    for k, row in enumerate(rows):
        slides = still & (run.mode[:, row] == Mode.SLIP) & (bound[:, k] > FAR * float(np.max(np.abs(run.lam))))
        for i in plain.samples(slides & fast(plain, ways, k))[:1]:
            held = with_signal(run, "mode", (i, int(row)), Mode.STICK)
            yield Control(fault=f"row {row} slips while STICK", run=held, sees={"mode_contradicted": exactly(1.0)})
            return


def _misnamed(run: Trajectory) -> Iterator[Control]:
    """Call what is below the surface behind a contact as if a collision had ended there, and the other way about."""
    swapped = {Mode.BALLISTIC: Mode.COLLISION_SEPARATION, Mode.COLLISION_SEPARATION: Mode.BALLISTIC}
    ends = {Mode.BALLISTIC: Mode.COLLISION, Mode.COLLISION_SEPARATION: Mode.CONTACT}
    odd = [e for e in run.events if e.after in ends and e.before not in (ends[e.after], Mode.FREE)
           and sum(abs(e.t - other.t) == 0.0 for other in run.events) == 1]  # fmt: skip
    if odd:
        names = np.arange(len(Mode))
        names[list(swapped)] = list(swapped.values())
        events = tuple(
            replace(e, before=swapped.get(e.before, e.before), after=swapped.get(e.after, e.after)) for e in run.events
        )
        other = replace(run, mode=names[run.mode].astype(run.mode.dtype), events=events)
        sees = {"mode_residual": (float(len(odd)), float(len(run.events)))}
        yield Control(fault="rows below their surface called by another name", run=other, sees=sees)


def _last_contact(plain: Plain) -> tuple[int, float, float] | None:
    """Return row, touch and end of a row's last contact, behind which it stays free; of bodies without friction."""
    for row in plain.some(plain.normal) if not (plain.case.rubs or plain.case.general) else ():
        events = plain.run.transitions(row)
        touched = [e.t for e in events if e.before == Mode.FREE and e.after in PUSHES]
        if touched and events[-1].after == Mode.FREE and touched[-1] < events[-1].t:
            return row, touched[-1], events[-1].t
    return None


def touches(plain: Plain) -> Iterator[Control]:
    """Record a touch too early: by a part of the fall onto it, and by a hair."""
    run, case = plain.run, plain.case
    begun = {(one.row, one.touch) for one in contacts(run, case.law.touches, case.general)}  # not what rounding parts
    for event in run.events:
        if not (event.before == Mode.FREE and event.after in PUSHES) or not event.t > run.t[0]:
            continue
        if (event.contact, event.t) not in begun:
            continue
        gap = np.abs(run.gap[:, event.contact])
        off = 0.05 * _since_last(run, event)
        high = float(np.interp(event.t - off, run.t, gap))
        if sum(e.t == event.t for e in run.events) > 1 or high < FAR * float(gap.max()):
            continue
        long = max(HAIR * max(1.0, float(np.max(np.abs(run.q)))), SEEN * float(np.max(np.abs(np.diff(gap)))))
        hair = long * off / high
        for early, more in ((off, {"event_times": exactly(off)}), (hair, {})):
            if early <= off:
                sees: dict[str, Range] = {"event_gap": _left(run, event, early), **more}
                yield Control(fault=f"a touch {early:.3g} s early", run=shifted(run, [event], -early), sees=sees)
        return


def _since_last(run: Trajectory, event: Event) -> float:
    """Return the time from the instant at which something last happened to an event, s."""
    return event.t - max([e.t for e in run.events if e.t < event.t], default=float(run.t[0]))


def _left(run: Trajectory, event: Event, early: float) -> Range:
    """Return which part of its longest way between samples a row is off its surface before a touch."""
    gap = run.gap[:, event.contact]
    return roughly(abs(float(np.interp(event.t - early, run.t, gap))) / float(np.max(np.abs(np.diff(gap)))))


def shifted(run: Trajectory, which: Sequence[Event], by: float) -> Trajectory:
    """Return a motion with the instants of some events off, s."""
    return replace(run, events=tuple(replace(e, t=e.t + by) if e in which else e for e in run.events))


def released(plain: Plain) -> Iterator[Control]:
    """Record the end of a contact too late, and too early: by a part of the time since anything happened."""
    run = plain.run
    ends = [e for e in run.events if e.before in PUSHES and e.after not in PUSHES and e.contact in plain.normal]
    for event in ends if not (plain.case.rubs or plain.case.general) else ():
        behind = min([e.t for e in run.events if e.t > event.t], default=float(run.t[-1]))
        off, lam = 0.05 * min(behind - event.t, _since_last(run, event)), np.abs(run.lam[:, event.contact])
        alone = off > 0.0 and sum(e.t == event.t for e in run.events) == 1
        if alone and float(np.interp(event.t - off, run.t, lam)) > FAR * float(lam.max()):
            for by in (off, -off):
                moved = shifted(run, [event], by)
                yield Control(fault=f"a release {by:.3g} s off", run=moved, sees={"event_times": exactly(off)})
            return


def handed(plain: Plain) -> Iterator[Control]:
    """Record the end of a collision too early."""
    run = plain.run
    ends = [e for e in run.events if (e.before, e.after) == (Mode.COLLISION, Mode.CONTACT)]
    for event in ends[:1]:
        off = 0.2 * _since_last(run, event)
        early = shifted(run, [event], -off)
        yield Control(fault=f"a hand-over {off:.3g} s early", run=early, sees={"mode_times": exactly(off)})


def switched(plain: Plain) -> Iterator[Control]:
    """Record too early that what slides holds, or the other way about."""
    run = plain.run
    between = {Mode.STICK, Mode.SLIP}
    counted = {(t, slides) for _, t, slides in turned(run, plain.case)}  # slides that are too short are none
    turns = [e for e in run.events if {e.before, e.after} == between and (e.t, e.after == Mode.SLIP) in counted]
    for slides, metric in ((False, "stick_times"), (True, "slip_times")):
        for event in [e for e in turns if (e.after == Mode.SLIP) == slides and _of_pair(plain, e)][-1:]:
            off = 0.05 * _since_last(run, event)
            same = [e for e in run.events if e.t == event.t]
            if not _shows(plain, event, event.t - off):
                continue
            yield Control(
                fault=f"a change between slip and stick {off:.3g} s early", run=shifted(run, same, -off),
                sees={metric: exactly(off)},
            )  # fmt: skip


def _of_pair(plain: Plain, event: Event) -> bool:
    """Whether a place of a pair begins to slide as its first, or holds as its last: others' changes are no instants."""
    found = rubbing(plain.run, plain.case)
    if found is None:
        return False
    times, own = plain.run.t, found.rows == event.contact
    mates = found.rows[np.isin(found.pair, found.pair[own]) & ~own]
    before, after = int(np.searchsorted(times, event.t)) - 1, int(np.searchsorted(times, event.t, side="right"))
    beside = max(before, 0) if event.after == Mode.SLIP else min(after, len(times) - 1)
    return not (plain.run.mode[beside, mates] == Mode.SLIP).any()


def _shows(plain: Plain, event: Event, t: float) -> bool:
    """Whether at an instant before a change slip, or what friction is below its bound, is far from none."""
    run, (rows, ways, bound) = plain.run, bounds(plain.case, plain.run)
    if event.contact not in rows:
        return False
    k, i = int(np.searchsorted(rows, event.contact)), int(np.searchsorted(run.t, t))
    if event.after == Mode.SLIP:
        below = np.abs(bound[:, k] - np.linalg.norm(run.lam[:, ways[k]], axis=1))
        return bool(below[i] > FAR * float(bound[:, k].max()))
    rates = slips(plain.case, taken(run, np.array([i, *range(0, len(run.t), -(-len(run.t) // FEW))])))[:, ways[k]]
    speeds = np.linalg.norm(rates, axis=1)
    return bool(speeds[0] > FAR * speeds.max())


def clocks(plain: Plain) -> Iterator[Control]:
    """Stretch time between touches, or between slips and sticks: laid beside the truth, the motion is the same."""
    run = plain.run
    touched = {e.t for e in run.events if e.before == Mode.FREE and e.after in PUSHES and e.t > run.t[0]}
    turned = {e.t for e in run.events if {e.before, e.after} == {Mode.STICK, Mode.SLIP}}
    rubs = plain.case.rubs or plain.case.general
    if rubs == bool(touched) or not touched | turned:
        return
    knots = sorted(touched | turned)
    late = PART * float(np.min(np.diff([run.t[0], *knots]))) * np.resize([1.0, -1.0], len(knots))

    def stretched(t: Floats) -> Floats:
        moved: Floats = t + np.interp(t, [run.t[0], *knots], [0.0, *late])
        return moved

    other = replace(
        run, t=stretched(run.t), events=tuple(replace(e, t=float(stretched(np.array(e.t)))) for e in run.events)
    )
    sees = dict.fromkeys(("position", "velocity", "gap_error"), (0.0, TINY))
    if rubs:
        if not carries(run, WEAK * moving(run)):
            return
        sees = {"lam_impulse_path": exactly(_apart(run, other))}
    yield Control(fault="another clock between events", run=other, sees=sees, wrong=False)


def _apart(run: Trajectory, other: Trajectory) -> float:
    """Return how far impulses are apart in two clocks, over the largest."""
    total = [np.cumsum(0.5 * np.diff(one.t)[:, None] * (one.lam[1:] + one.lam[:-1]), axis=0) for one in (run, other)]
    return float(np.max(np.abs(total[1] - total[0])) / np.max(np.abs(total[0]), initial=1e-300))


WIDE = 3
"""Samples on either side of one between which and its neighbours nothing may happen."""
