"""The way of a state and its derivatives through a motion: arcs, and saltation at its events."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from crossbody.cases import Event, Mode, Outcome, SceneError, Switch, Trajectory
from crossbody.reference._system import initial_modes
from crossbody.reference.kinds import Floats
from crossbody.reference.linear._bends import sided, smooth_switches, watched_gradient, with_sides
from crossbody.reference.linear._point import NO_ROWS, Point, dense, gaps, terms
from crossbody.reference.linear._slipping import ACTIVE, ALIKE, EDGE, GRAZED, NOISE, NONE, STILL, Slipping
from crossbody.reference.linear._slipping import AS_ONE as SWITCH_AS_ONE
from crossbody.reference.linear._variation import (
    Theta,
    bounced,
    gap_gradient,
    gradient,
    handover_gradient,
    lam_gradient,
    rates,
    slip_speeds,
    timed,
)
from crossbody.reference.linear._variations import OutOfTimeError, Variations, moved_to, placed

GRAZING = 1e-12  # part of the terms of g_x f + g_t below which an event is only grazed
TOUCHED = 10.0  # times the tolerance, of the largest coordinate, to which a gap is known: one as deep is only grazed

AS_ONE = (
    "sensitivity: several rows collide simultaneously; a deviation separates them, and the motion then depends on "
    'which comes first, so there is no derivative. Use collisions="sequential".'
)
SAME = 1e-3  # part of the motion's size by which its end may differ from the one that was passed through


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Jump:
    """What an event does to small deviations.

    Attributes:
        t: instant, s.
        contact: row, or -1.
        before, after: its mode; sides of the kink where `contact` is -1, so that a force jumps with no event.
        matrix (2 n, 2 n): the saltation matrix.
    """

    t: float
    contact: int
    before: Mode | int
    after: Mode | int
    matrix: Floats


class Walk:
    """State x (nq + n,) and its derivative S (2 n, 2 n + k) on the way through a motion."""

    def __init__(self, at: Point, over: Theta, rtol: float, run: Trajectory, time_limit: float) -> None:
        system, n = at.system, at.system.n
        self.at, self.over, self.rtol, self.run = at, over, rtol, run
        self.x = np.concatenate([at.q, at.v])
        self.S = np.hstack([np.eye(2 * n), np.zeros((2 * n, len(over.names)))])
        self.modes = initial_modes(system, at.q, at.v).astype(int).tolist()
        self.jumps: list[Jump] = []
        self.message = ""
        self.lost = np.zeros(self.S.shape[1], dtype=bool)
        self.variations = Variations(over, self.S.shape, time_limit)
        slipped, still = slip_speeds(at, run), max(STILL, NOISE * rtol)
        self.slipping = Slipping(
            system=system, over=over, run=run, place=placed, slipped=slipped, still=still,
            speed=float(slipped.max(initial=0.0)) or 1.0,
        )  # fmt: skip

    def within_time(self, run: Trajectory, t_end: float) -> Outcome:
        """Go to the end, or as far as the time suffices; how it ended."""
        try:
            return self.along(run, t_end)
        except OutOfTimeError as late:
            self.message = (
                f"The derivatives took {self.variations.time_limit:g} s up to t = {late.args[0]:.9g} s (time_limit)."
            )
            return Outcome.TIME_LIMIT

    def along(self, run: Trajectory, t_end: float) -> Outcome:
        """Go to the end; FINISHED, or how the derivative was lost."""
        now, rubs = 0.0, self.at.system.frictional
        if rubs and not (run.events and run.events[0].t == 0.0):
            here = self._here(0.0)
            self._begin(here, here.sliding.tolist())
            self.x[self.at.system.nq :] = self.slipping.hold(here, self.S)
        passed: list[Event | Switch] = [*run.events, *smooth_switches(run)]
        for t, group in groupby(sorted(passed, key=lambda one: one.t), key=lambda one: one.t):
            if not (self._begins(now, t) and self._smooth(now, t)):
                return Outcome.ILL_POSED
            now, both = t, list(group)
            events = [one for one in both if isinstance(one, Event)]
            if not self._bend([one for one in both if isinstance(one, Switch)], alone=not events):
                self.message = f"The end of a face, or of a range of a force, is only grazed at t = {t:.9g} s."
                return Outcome.ILL_POSED
            if not events:
                continue
            if (row := self._only_touches(events)) is not None:
                self.message = f"The gap of row {row} is only grazed at t = {t:.9g} s."
                return Outcome.ILL_POSED
            for piece in [events] if rubs else _pieces(self._lasting(events)):
                if not (self._switch(piece) if rubs else self._event(piece)):
                    self.message = f"The event of row {piece[0].contact} at t = {t:.9g} s is only grazed."
                    return Outcome.ILL_POSED
        if not (self._begins(now, t_end) and self._smooth(now, t_end)):
            return Outcome.ILL_POSED
        return Outcome.FINISHED if np.isfinite(self.S).all() else Outcome.NOT_FINITE

    def ends_as(self, run: Trajectory) -> bool:
        """Whether the end is that of the motion, as far as its size and what acts on it let that be known."""
        nq, known = self.at.system.nq, NOISE * self.rtol
        blocks, f, *_ = terms(self.at, self.at.q, self.at.v, self.at.u)
        speed, T = float(np.abs(np.linalg.solve(dense(blocks), f)).max(initial=0.0) * run.t[-1]), float(run.t[-1])
        parts = ((self.x[:nq], run.q, speed * T), (self.x[nq:], run.v, speed))
        return all(np.abs(x - y[-1]).max() <= SAME * np.abs(y).max() + known * floor for x, y, floor in parts)

    def _begin(self, here: Point, rows: list[int]) -> None:
        """Let variables go by which there is no derivative, since contacts among these slide from no slip there."""
        found, lost = self.slipping.begun(here, self.S, rows)
        lost &= ~self.lost
        if lost.any():
            self.lost |= lost
            self.S[:, lost] = 0.0
            self.message = self.message or (
                f"Row {found[0]} begins to slide from rest at t = {here.t:.9g} s: by what gives it a slip there, "
                "derivatives are one-sided at most (NaN); the others hold."
            )

    def _part(self, here: Point) -> None:
        """Let variables go that lift what touches at the start no deeper than its gap is known: there it would fall."""
        n = self.at.system.n
        gap, found = gaps(here, here.q, here.v), list[int]()
        own = (np.asarray(self.at.system.unilateral) != 0) & (np.asarray(self.at.system.follows) < 0)
        for i in here.active[own[here.active] & (np.abs(gap[here.active]) <= self.known)].tolist():
            for rate in (False, True):
                gradient = gap_gradient(here, self.over, i, rate=rate)
                change = gradient[: 2 * n] @ self.S
                change[2 * n :] += gradient[2 * n :]
                self.lost |= np.abs(change) > NONE * np.abs(gradient).max()
            found.append(i)
        if found:
            self.S[:, self.lost] = 0.0
            what = (
                f"{'Row' if len(found) == 1 else 'Rows'} {', '.join(map(str, found))} only "
                f"touch{'es' if len(found) == 1 else ''} at the start, t = 0 s: by what lifts it off, derivatives are "
                "one-sided at most (NaN); the others hold."
            )
            self.message = f"{self.message} {what}".strip()

    def _bend(self, group: list[Switch], *, alone: bool) -> bool:
        """Pass kinks of one instant, at which a force may jump; False if that is only grazed."""
        if not group:
            return True
        t, here = group[0].t, self._here(group[0].t, "left")
        sides = ({s.variable: getattr(s, name) for s in group} for name in ("before", "after"))
        old, new = (rates(with_sides(here, side)) for side in sides)
        if np.abs(new - old).max() <= ALIKE * np.abs(old).max():
            return True
        if len(group) > 1 or not alone:
            raise SceneError(SWITCH_AS_ONE.format(t=t))
        g = watched_gradient(here, self.over, group[0], self.rtol)
        return self._jump(group, g, np.eye(len(old), self.S.shape[1]), old, new)

    def _lasting(self, group: list[Event]) -> list[Event]:
        """Events of one instant without those of rows that touch and let go again there: nothing has pressed."""
        through = set[int]()
        for row in {e.contact for e in group}:
            own = [e for e in group if e.contact == row]
            modes = own[0].before, own[-1].after
            if not any(mode in ACTIVE for mode in modes) and all(e.after is not Mode.COLLISION for e in own):
                through.add(row)
                self.modes[row] = int(modes[1])
        return [e for e in group if e.contact not in through]

    def _begins(self, start: float, end: float) -> bool:
        """Whether no event is grazed where the motion starts; arcs that begin later do so at an event that is not."""
        if start > 0.0 or not end > start:
            return True
        here = self._here(0.0)
        self._part(here)
        for i in self._open():
            if self._grazes(here, i):
                self.message = f"The gap of row {i} is only grazed at the start, t = 0 s."
                return False
        for i, left, _ in self.slipping.watches(here):
            if i not in here.sliding and not left(here) > GRAZED:
                self.message = f"Row {i}, which has friction, is at its bound at the start, t = 0 s: it is only grazed."
                return False
        return True

    def _open(self) -> list[int]:
        """Rows with a gap of their own that are out of contact."""
        system = self.at.system
        own = (np.asarray(system.unilateral) != 0) & (np.asarray(system.follows) < 0)
        return [i for i in np.flatnonzero(own).tolist() if self.modes[i] not in ACTIVE]

    @property
    def known(self) -> float:
        """To what a gap is known, as far as the tolerance tells."""
        return TOUCHED * self.rtol * float(np.abs(self.run.q).max(initial=0.0))

    def _grazes(self, here: Point, i: int) -> bool:
        """Whether row i, out of contact, has come no deeper than its gap is known where that is least: it turns away.

        With the gap h, its rate and its acceleration a > 0 it is least at h - h'^2/(2 a).
        """
        n = self.at.system.n
        h, rate = (values[i] for values in np.split(gaps(here, here.q, here.v), 2))
        turns = float(gap_gradient(here, self.over, i, rate=True)[: 2 * n] @ rates(here))
        return bool(turns > 0.0 and abs(h) <= self.known and rate * rate <= 2.0 * turns * self.known)

    def _only_touches(self, group: list[Event]) -> int | None:
        """The row of an event that touches no deeper than its gap is known; None if none does."""
        for e in group if group[0].t > 0.0 else ():
            own = np.asarray(self.at.system.follows)[e.contact] < 0
            if e.before is Mode.FREE and own and self._grazes(self._here(e.t, "left"), e.contact):
                return e.contact
        return None

    def _closest(self) -> list[tuple[int, Any]]:
        """Rows above their surfaces; for `scipy.integrate.solve_ivp` the rate of a gap, which rises where it is least.

        All are computed at once where the first one is asked for. One that has let go and is below yet touches again
        by its load, not by its gap.
        """
        nc, at, rates_then = self.at.system.nc, math.nan, np.zeros(self.at.system.nc)

        def follow(i: int) -> Any:
            def rate(t: float, y: Floats) -> float:
                nonlocal at
                if t != at:
                    moved, at = moved_to(self.at, t, y), t
                    rates_then[:] = gaps(moved, moved.q, moved.v)[nc:]
                return float(rates_then[i])

            rate.terminal, rate.direction = False, 1.0  # type: ignore[attr-defined]
            return rate

        return [(i, follow(i)) for i in self._open() if self.modes[i] == Mode.FREE]

    def _here(self, t: float, side: str = "right") -> Point:
        """The state at t with the rows and constants of the present modes; slips as the motion has them beside it."""
        system, nq = self.at.system, self.at.system.nq
        modes = [self.modes[f] if f >= 0 else m for m, f in zip(self.modes, np.asarray(system.follows), strict=True)]
        fast = (np.array(modes) == Mode.COLLISION) & (np.asarray(system.b0) > 0.0)
        at = replace(
            self.at, q=self.x[:nq].copy(), v=self.x[nq:].copy(), t=t,
            alpha=np.where(fast[:, None], system.beta, system.alpha), idle=NO_ROWS,
            sharing=NO_ROWS, emerging=NO_ROWS,
            active=np.array([i for i, mode in enumerate(modes) if mode in ACTIVE], dtype=np.int64),
        )  # fmt: skip
        return self.slipping.directed(at, modes, self._sample(t, side)) if system.frictional else at

    def _sample(self, t: float, side: str) -> int:
        """The last sample before an event at t, or the first one behind it."""
        return int(
            np.searchsorted(self.run.t, t, "left") if side == "left" else np.searchsorted(self.run.t, t, "right") - 1
        )

    def _smooth(self, start: float, end: float) -> bool:
        """Integrate x and S between two events; False if one more is grazed on the way.

        A slip in space that begins turns at any rate, so that it takes an implicit method.
        """
        self.at = sided(self.at, self.run, start, end)  # also of what is looked at where it ends
        while end > start:
            here = self._here(start)
            ends, stiff = self.slipping.turns(here)
            watched, near = self.slipping.watches(here), self._closest()
            y, self.variations.refusal = np.concatenate([self.x, self.S.ravel()]), None
            size = np.concatenate([np.ones(len(self.x)), np.full(self.S.size, np.abs(self.S).max())])
            how: Any = {"method": "Radau", "jac": self.variations.jacobian(here)} if stiff else {"method": "DOP853"}
            done: Any = solve_ivp(
                self.variations.rate(here), (start, end), y, rtol=self.rtol, atol=1e-3 * self.rtol * size,
                events=[*(slope for *_, slope in watched), *(rate for _, rate in near), *ends], **how,
            )  # fmt: skip
            if done.status < 0:
                if self.variations.refusal is not None:
                    raise self.variations.refusal
                self.message = f"The derivative was lost at t = {done.t[-1]:.9g} s: {done.message}"
                return False
            for (i, left, _), times, states in zip(watched, done.t_events or (), done.y_events or (), strict=False):
                for t, state in zip(times, states, strict=True):
                    if t - start > EDGE * (end - start) and not left(placed(here, t, state)) > GRAZED:
                        self.message = f"An event of row {i}, which has friction, is grazed at t = {t:.9g} s."
                        return False
            found = zip(done.t_events or (), done.y_events or (), strict=True)
            for (i, _), (times, states) in zip(near, list(found)[len(watched) :], strict=False):
                for t, state in zip(times, states, strict=True):
                    if t - start > EDGE * (end - start) and self._grazes(moved_to(here, t, state), i):
                        self.message = f"The gap of row {i} is only grazed at t = {t:.9g} s."
                        return False
            width, start = len(self.x), float(done.t[-1])
            self.x, self.S = done.y[:width, -1].copy(), done.y[width:, -1].reshape(self.S.shape).copy()
            self.x[: self.at.system.nq] = self.at.system.normalised("sensitivity", self.x[: self.at.system.nq])
        return True

    def _switch(self, group: list[Event]) -> bool:
        """Pass all events of one instant: what fell to zero, and what follows from it; False if it is only grazed."""
        t, width, changes = group[0].t, 2 * self.at.system.n, list[Floats]()
        # At the start nothing has held a row before, which lets deviations of its slip die out.
        new_here = [e.contact for e in group if t == 0.0 or e.before not in (Mode.STICK, Mode.SLIP)]
        old = np.zeros(width)
        if t > 0.0:
            before, k = self._here(t, "left"), self._sample(t, "left")
            old, firsts = rates(before), {e.contact: e for e in reversed(group)}
            changes = [g for e in firsts.values() for g in [self.slipping.reached(e, before, k)] if g is not None]
        for e in group:
            self.modes[e.contact] = int(e.after)
        after = self._here(t)
        if t > 0.0:
            shifts = [self._shift(g, old) for g in changes]
            known = [shift for shift in shifts if shift is not None]
            if len(known) < len(shifts):
                return False
            new, R = rates(after), np.eye(width, self.S.shape[1])
            smooth = np.abs(new - old).max() <= ALIKE * np.abs(old).max()  # a label alone, as of what is free again
            if any(np.abs(s - known[0]).max() > ALIKE * np.abs(s).max() for s in known[1:]) or not (known or smooth):
                raise SceneError(SWITCH_AS_ONE.format(t=t))
            if known:
                self._jump(group, changes[0], R, old, new)
        self._begin(after, new_here)
        self.x[self.at.system.nq :] = self.slipping.hold(after, self.S)
        return True

    def _shift(self, g: Floats, old: Floats) -> Floats | None:
        """By how much an event moves in time with every variable; None if it is only grazed."""
        width, by_time = len(old), float(g[-1])
        speed = float(g[:width] @ old) + by_time
        if not abs(speed) > GRAZING * (float(np.abs(g[:width]) @ np.abs(old)) + abs(by_time)):
            return None
        change = g[:width] @ self.S
        change[width:] += g[width:-1]
        return -change / speed

    def _event(self, piece: list[Event]) -> bool:
        """Pass one event, or one frozen collision with all that it does; False if it is only grazed."""
        event = piece[0]
        before = self._here(event.t, "left")
        frozen = len(piece) > 1
        start, n = event.t == 0.0 and not frozen, self.at.system.n
        R, jumped = np.eye(2 * n, self.S.shape[1]), self.x
        if frozen:
            let_go = {e.contact for e in piece[1:-1]}
            held = [i for i in before.active.tolist() if i not in let_go]
            struck = replace(before, active=np.array([*held, event.contact], dtype=np.int64))
            after = bounced(struck, event.contact, piece[-1].after is Mode.CONTACT)
            R = np.vstack([R[:n], gradient(after, struck, self.over)])
            jumped = np.concatenate([struck.q, after(struck, struck.q, struck.v)])
        guard = None if start else self._guard(event, before)
        old = rates(before)
        for e in piece:
            self.modes[e.contact] = int(e.after)
        self.x = jumped
        if guard is None:
            return True
        new = rates(self._here(event.t))
        return self._jump(piece, guard, R, old, new)

    def _jump(self, piece: Sequence[Event | Switch], g: Floats, R: Floats, old: Floats, new: Floats) -> bool:
        width, shift = len(old), self._shift(g, old)
        if shift is None:
            return False
        kick = R[:, :width] @ old - new
        S = R[:, :width] @ self.S + np.outer(kick, shift)
        S[:, width:] += R[:, width:]
        self.S = S
        matrix = R[:, :width] - np.outer(kick, g[:width]) / (float(g[:width] @ old) + float(g[-1]))
        contact = piece[0].contact if isinstance(piece[0], Event) else -1
        self.jumps.append(
            Jump(t=piece[0].t, contact=contact, before=piece[0].before, after=piece[-1].after, matrix=matrix)
        )
        return True

    def _guard(self, event: Event, here: Point) -> Floats | None:
        """Gradient of what fell to zero, by (dq, v, theta, t); None where nothing changes but a label."""
        i, before, after = event.contact, event.before, event.after
        if before is Mode.FREE:
            return timed(gap_gradient(here, self.over, i))
        if before is Mode.COLLISION and after is Mode.CONTACT:
            return handover_gradient(here, self.over, i)
        if before in ACTIVE:
            return lam_gradient(here, self.over, i)
        return None if after is Mode.FREE else timed(gap_gradient(here, self.over, i, rate=True))


def _pieces(events: list[Event]) -> Iterator[list[Event]]:
    """Events of one instant: each frozen collision with the rows it releases and its end, every other one alone.

    Raises:
        SceneError: if several rows strike together.
    """
    k = 0
    while k < len(events):
        size = 1
        ends = [
            j for j, e in enumerate(events) if j > k and e.contact == events[k].contact and e.before is Mode.COLLISION
        ]
        if events[k].after is Mode.COLLISION and ends:
            if any(e.before is not Mode.CONTACT for e in events[k + 1 : ends[0]]):
                raise SceneError(AS_ONE)
            size = ends[0] - k + 1
        yield events[k : k + size]
        k += size
