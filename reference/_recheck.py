"""Look again at a finished motion: does every row stand in the mode that the level machine asks for, all the time?

An event search looks for switches; this looks for modes that do not hold, on a fine grid between
all rows of the motion, and so does not repeat the mistakes of a search:

    FREE          below the surface
    active        the multiplier pulls
    BALLISTIC     above the surface; or closing below it, where the row would press

Between two rows the motion is the quintic through q, v and v' at both. The equations themselves
tell its error.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crossbody.cases import Mode, Trajectory, arguments
from crossbody.cases.arrays import distinct
from crossbody.cases.control import Control
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats
from crossbody.reference.options import Options
from crossbody.reference.sundials.compiled import evaluation
from crossbody.reference.sundials.compiled.workspace import POINTS, Kind
from crossbody.reference.sundials.equations import ACTIVE, ULP, Ended, Equations
from crossbody.reference.sundials.evaluator import Evaluator
from crossbody.reference.sundials.level_machine import DEEP, Guard, Term
from crossbody.reference.sundials.sharing import share

UNDECIDED = 10.0  # times rtol: a pass closer than that is neither a touch nor none
CLOSING = 1e-6  # part of the largest rate of a row from which on its gap closes
CAUTION = 4.0  # errors of the quintic in units of that in the middle of its step
WEAK = 1e3  # times rtol, of the largest multiplier: a pull that is none
COARSE = 16.0  # roundings of the largest coordinate by which the quintic's ends may be off
MOST_TERMS = 3  # of a row
PASSING = (Mode.BALLISTIC, Mode.COLLISION_SEPARATION)


@dataclass(frozen=True, slots=True)
class Violation:
    """A row in a mode that does not hold.

    Attributes:
        t: the instant at which it is worst, s.
        contact: index of the row.
        mode: in which the motion has it there.
        amount: by how much, beyond what the tolerance leaves open: depth or height, m; multiplier, N.
        reason: in words.
    """

    t: float
    contact: int
    mode: Mode
    amount: float
    reason: str


@checked_arguments
def recheck(
    system: System,
    run: Trajectory,
    *,
    rtol: float = 1e-9,
    inputs: tuple[ArrayLike, ArrayLike] | None = None,
    collisions: str = "sequential",
) -> tuple[Violation, ...]:
    """Find the rows of a motion that stand in a mode which the level machine does not allow there.

    Args:
        system: the mechanism that moved.
        run: the motion; the denser its rows, the smaller the windows that are seen.
        rtol: relative tolerance with which it was computed: what this leaves open is not told.
        inputs: (times, values) as they acted, with what a controller in Python gave (`Trajectory.inputs`).
        collisions: the rule for rows with fast constants, as in `Options`.

    Returns:
        The worst place of each row, mode and reason. Where a controller acts, `switch` keeps
        numbers that a motion does not record, q' is not v, contacts have friction, or there is
        one row alone, only the motion's own rows are looked at.
    """
    rtol = arguments.real("rtol", rtol)
    rows = np.flatnonzero(np.asarray(system.unilateral, dtype=bool) & (np.asarray(system.follows) < 0)).tolist()
    if not rows or not len(run.t) or (run.mode < 0).any():
        return ()
    told = system.control is None or (isinstance(system.control, Control) and inputs is not None)
    bands = system.kinks + 1 + system.inputs if system.kinks else 0  # they are of no motion
    known = told and not system.frictional and system.latched == bands and system.velocity is None and len(run.t) > 1
    found = _Recheck(system, run, rows, rtol, inputs, collisions).between() if known else _recorded(run, rows, rtol)
    worst: dict[tuple[int, Mode, str], Violation] = {}
    for one in found:
        key = one.contact, one.mode, one.reason
        if key not in worst or one.amount > worst[key].amount:
            worst[key] = one
    return tuple(sorted(worst.values(), key=lambda one: one.t))


def _near(run: Trajectory, rtol: float) -> float:
    """How near a pass may come to touching before it is undecided, m."""
    return UNDECIDED * rtol * max(1.0, float(np.abs(run.q).max()))


def _worst(t: Floats, excess: Floats, i: int, mode: Mode, reason: str) -> Iterator[Violation]:
    at = np.argmax(excess)
    if excess.flat[at] > 0.0:
        yield Violation(float(t.flat[at]), i, mode, float(excess.flat[at]), reason)


def _recorded(run: Trajectory, rows: list[int], rtol: float) -> Iterator[Violation]:
    """The motion's own rows, by their gaps and multipliers; the instants of events belong to two modes."""
    quiet = ~np.isin(run.t, [e.t for e in run.events])
    near = _near(run, rtol) + DEEP
    largest = float(np.nan_to_num(np.abs(run.lam)).max(initial=0.0))
    force = WEAK * rtol * largest  # one that bears nothing has the rounding of what others do
    for i in rows:
        for mode in Mode:
            here = quiet & (run.mode[:, i] == mode)
            if not here.any():
                continue
            gap, lam = run.gap[here, i], run.lam[here, i]
            if mode == Mode.FREE:
                yield from _worst(run.t[here], -gap - near, i, mode, "below the surface")
            elif mode in PASSING:
                yield from _worst(run.t[here], gap - near, i, mode, "above the surface")
            elif mode in (*ACTIVE, Mode.STICK, Mode.SLIP):
                yield from _worst(run.t[here], -lam - force, i, mode, "pulls")


class _Recheck:
    """The grid between the rows of one motion, by stretches of equal modes, inputs and discrete variables."""

    def __init__(
        self, system: System, run: Trajectory, rows: list[int], rtol: float, inputs: Any, collisions: str
    ) -> None:
        self.system, self.run, self.rows, self.rtol = system, run, rows, rtol
        self.equations = Equations(system)
        self.looks = Evaluator(self.equations, MOST_TERMS * len(rows))
        fast = np.asarray(system.b0) > 0.0
        self.frozen = frozenset() if collisions == "resolved" else frozenset(np.flatnonzero(fast).tolist())
        self.near = _near(run, rtol)
        self.inputs_t, self.inputs_u = Options(t_end=1.0, inputs=inputs).schedule(system, played=True)
        self.speed = np.abs(system.gaps_along(run.q, run.v)[1]).max(axis=0)

    def between(self) -> Iterator[Violation]:
        """What does not hold between the rows."""
        smooth = self._smooth()
        state = np.column_stack([self.run.mode, self._held(self.inputs_t), self._discrete()])
        new = np.any(state[1:] != state[:-1], axis=1)
        cuts = np.flatnonzero(np.concatenate([[True], ~smooth[1:] | ~smooth[:-1] | new[:-1], [True]]))
        for first, last in pairwise(cuts.tolist()):
            if smooth[first]:
                try:
                    yield from self._stretch(first, last)
                except Ended:
                    continue  # where the equations cannot be evaluated the run itself had to end

    def _smooth(self) -> NDArray[np.bool_]:
        """Intervals from a row to the next inside which nothing switches."""
        t, mode = self.run.t, self.run.mode
        stops = distinct([*(e.t for e in self.run.events), *(s.t for s in self.run.switches), *self.inputs_t])
        inside = np.searchsorted(stops, t[1:], "left") - np.searchsorted(stops, t[:-1], "right") > 0
        # A single row at an event shows the state before it.
        behind = np.concatenate([[True], t[1:] == t[:-1]]) | ~np.isin(t, [e.t for e in self.run.events])
        same = np.all(mode[1:] == mode[:-1], axis=1)
        smooth: NDArray[np.bool_] = (t[1:] > t[:-1]) & ~inside & same & behind[:-1]
        return smooth

    def _held(self, times: Any) -> NDArray[np.intp]:
        """The last of `times` at or before each row, -1 for none."""
        return np.searchsorted(np.asarray(times), self.run.t, "right") - 1

    def _discrete(self) -> Floats:
        """Discrete variables (rows, nd) from each row on."""
        values = np.tile(np.asarray(self.system.discrete, dtype=np.float64), (len(self.run.t), 1))
        for switch in self.run.switches:
            values[self.run.t >= switch.t, switch.variable] = switch.after
        return values

    def _stretch(self, first: int, last: int) -> Iterator[Violation]:
        """Rows first .. last, between which one set of equations holds."""
        run, e, work = self.run, self.equations, self.looks.work
        modes = run.mode[first].tolist()
        for left_out in np.asarray(self.system.redundant).tolist():
            modes[left_out] = int(Mode.FREE)
        held = self._held(self.inputs_t)[first]
        e.u[:] = self.inputs_u[held] if held >= 0 else 0.0
        discrete = self._discrete()[first]
        jumping, end = len(discrete) - self.system.kinks, len(e.p) - self.system.latched
        e.p[end - len(discrete) : end - self.system.kinks] = discrete[:jumping]  # sides of kinks are told by values
        e.activate(modes)
        contact = [i for i in self.rows if modes[i] in ACTIVE]
        if len(contact) > 1 and not self.frozen:
            always = [i for i in e.active if i not in contact]
            q, v = run.q[first].copy(), run.v[first].copy()  # those of a trajectory may be read alone
            found = share(e, run.t[first], q, v, contact, always, ())
            if found is not None and not found.lifted:
                e.activate(modes, {*e.active}.difference(found.basis))
                e.beside = found.beside
        guards = [self._terms(i, Mode(modes[i])) for i in self.rows]
        self.looks.begin(guards, self.frozen)
        y = np.hstack([run.q, run.v])
        self.looks.ask(evaluation.BEGIN, run.t[first], y[first])
        values, check = (np.empty((last - first, *work[name].shape)) for name in ("grid", "check"))
        for k in range(last - first):
            self.looks.ask(evaluation.GRID, run.t[first + k + 1], y[first + k + 1])
            values[k], check[k] = work["grid"], work["check"]
        errors = np.abs(check[:, 2:] - check[:, :2]).max(axis=1)
        step = np.diff(run.t[first : last + 1])
        places = (np.arange(POINTS) + 0.5) / POINTS
        t = run.t[first:last, None] + step[:, None] * places
        at = 0
        for guard in guards:
            mine = slice(at, at + len(guard.terms))
            at = mine.stop
            i, mode = guard.row, Mode(modes[guard.row])
            asked = mode in ACTIVE or len(guard.terms) > 2  # of the others no multiplier tells
            force = self._force(i, first, step)[:, None] if asked else np.zeros((1, 1))
            yield from self._judge(i, mode, t, values[:, :, mine], CAUTION * errors[:, None, mine], force)

    def _terms(self, i: int, mode: Mode) -> Guard:
        """What tells whether row i belongs in its mode."""
        if mode in ACTIVE:
            return Guard(i, None, [Term(Kind.FORCE, i)])
        kinds = [Kind.GAP, Kind.RATE] + [Kind.PRESS] * (mode in PASSING and i not in self.frozen)
        return Guard(i, None, [Term(kind, i) for kind in kinds])

    def _judge(self, i: int, mode: Mode, t: Floats, value: Floats, error: Floats, force: Floats) -> Iterator[Violation]:
        """The three kinds of modes; each value has to pass its error and what the tolerance leaves open."""
        if mode in ACTIVE:
            yield from _worst(t, -value[..., 0] - error[..., 0] - force, i, mode, "pulls")
            return
        depth = -value[..., 0] - error[..., 0] - self.near
        closing = -value[..., 1] - error[..., 1] > CLOSING * self.speed[i]
        if mode == Mode.FREE:
            closes = np.where(closing, depth, depth - DEEP)  # one that does not close may have been started there
            yield from _worst(t, closes, i, mode, "below the surface")
            return
        yield from _worst(t, value[..., 0] - error[..., 0] - self.near - DEEP, i, mode, "above the surface")
        presses = np.ones_like(closing)
        if value.shape[-1] > 2:
            presses = -value[..., 2] - error[..., 2] > force
        yield from _worst(t, np.where(closing & presses, depth, -1.0), i, mode, "closing, and would press")

    def _force(self, i: int, row: int, step: Floats) -> Floats:
        """What the tolerance and the steps (k,) of a stretch leave open in a multiplier (k,), N.

        The tolerance does as rounding does, but by errors of the motion. A step of nanoseconds from
        one event to the next is shorter than what tells the speed from where it begins and ends.
        """
        e, run = self.equations, self.run
        modes = [*run.mode[row].tolist()]
        if e.beside is None and i not in e.active:
            modes[i] = Mode.CONTACT if i in self.frozen or not e.has_fast[i] else Mode.COLLISION
            e.activate(modes)
        at = run.t[row], run.q[row].copy(), run.v[row].copy()
        a0, a1 = e.law[i, :2]
        exact, off = (e.noise(*at, error=error)[0] for error in (0.0, a1 / max(a0 + a1, 1e-300)))
        if e.beside is None:
            noise, of_speed = float(exact[i]), float(off[i] - exact[i])
            e.activate(run.mode[row].tolist())
        else:  # rows that share a load share their noise
            noise, of_speed = float(exact.max()), float((off - exact).max())
        rounding: Floats = of_speed * COARSE * ULP * np.abs(run.q).max() / step
        return UNDECIDED * self.rtol / (8.0 * ULP) * noise + rounding
