"""A run by SUNDIALS through scikit-sundae (Hindmarsh et al. 2005): the independent check on the compiled loop.

It shares nothing with the compiled loop but the mechanism's kernels: equations, state machine, integrator and root
finding are others. It is slower by the price of some Python calls a step. Every arc between two events, changes of the
inputs or ticks of the controller begins anew at order one.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from math import isfinite
from types import MappingProxyType

import numpy as np

from crossbody.cases import InvalidValue, Ledger, Mode, Outcome, SceneError, Trajectory
from crossbody.cases.control import Control, NotFinite
from crossbody.reference._activations import Live
from crossbody.reference._blame import (
    KEEP_OUT,
    STUCK,
    buried,
    dependence,
    not_finite,
    undirected,
    vanished,
    whirling,
)
from crossbody.reference._elapsed import Elapsed
from crossbody.reference._redundant import watched
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats
from crossbody.reference.notes import noted
from crossbody.reference.options import Options
from crossbody.reference.sundials.arcs import SHARE, Arc, BdfArc, CvodeArc, Fired, IdaArc, Scene, State
from crossbody.reference.sundials.compiled.equations import linear_arc
from crossbody.reference.sundials.compiled.evaluation import entry
from crossbody.reference.sundials.discrete import GIVEN, START, TOUCHED, Discrete
from crossbody.reference.sundials.equations import ULP, Ended, Equations
from crossbody.reference.sundials.folds import Folds
from crossbody.reference.sundials.frozen_machine import FrozenMachine
from crossbody.reference.sundials.level_machine import LevelMachine, View
from crossbody.reference.sundials.quiet import quiet
from crossbody.reference.sundials.touches import Touches
from crossbody.reference.systems import absent

RETRIES, CAUTION = 8, 0.1  # a trial step that left the kernels' domain is tried again, shorter
ROUNDS = 100  # of rows and discrete variables that switch each other at one instant
STILL = 200  # steps in a row, each within rounding of the time
LOOK_AFTER = 1000  # steps, whether a row has still a direction
ON_THE_MANIFOLD = 1e-6


class SundialsRun:
    """One prepared run; `go` may be repeated, with the same result.

    Args:
        system: the mechanism.
        q0, v0 (n,): start.
        options: what is asked; solver "cvode" or "ida", fsm "level".

    Raises:
        InvalidValue: for another machine than "level", or as `Options.freezes`.
        SceneError: if rows of index 3 do not hold at the start.
    """

    def __init__(self, system: System, q0: Floats, v0: Floats, options: Options) -> None:
        if options.fsm != "level":
            raise InvalidValue(f"fsm is {options.fsm!r} with solver {options.solver!r}; valid: 'level'.")
        if options.index == 3 and system.velocity is not None:
            raise InvalidValue("index is 3; valid: 1, since the system has a kernel velocity: q' is not v.")
        self.system, self.options, self.q0, self.v0 = system, options, q0, v0
        self.samples, (self.inputs_t, self.inputs_u) = options.grid(), options.schedule(system)
        self.natural, self.ones = options.samples is None, np.ones(system.nc)
        if not system.frictional:
            entry(system)  # the kernels are built into the compiled equations before the clock runs
        self.kind: type[Arc] = IdaArc if options.solver == "ida" else CvodeArc
        self.rigid: list[int] = np.flatnonzero(system.held).tolist() if options.index == 3 else []
        self._check_manifold()

    def _check_manifold(self) -> None:
        h, hd = self.system.gap(self.q0, self.v0)
        off = max(np.abs(h[self.rigid]).max(initial=0.0), np.abs(hd[self.rigid]).max(initial=0.0))
        if off > ON_THE_MANIFOLD:
            raise SceneError(f"index=3 needs a start with h = h' = 0 in every bilateral row; the largest is {off:.3g}.")

    def warm(self) -> None:
        """Nothing to prepare: what is compiled is compiled when the run is made."""

    def start(self) -> None:
        """Back to the beginning."""
        e = self.equations = Equations(self.system, rigid=bool(self.rigid))
        self.machine = self._machine(e)
        self.machine.error, self.machine.rtol = SHARE * self.options.tolerance, self.options.rtol
        self.discrete = Discrete(self.system, e)
        self.folds = Folds(e)
        self.single = self.natural or bool(self.folds.rows)
        nz = self.system.nc + 2 if self.options.ledger else 0
        energy = np.abs(np.nan_to_num(e.energy(self.q0, self.v0))).sum()
        self.scene = self._scene(nz, max(float(energy), 1.0))
        self.state = State(0.0, self.q0.copy(), self.v0.copy(), np.zeros(nz))
        self.rows: list[tuple[float, Floats, Floats, Floats, Floats, Floats, list[int], Floats]] = []
        self.next_sample = self.next_input = self.next_tick = 0
        self.retries = self.still = self.looked = 0
        self.ended_rows: list[int] = []
        self.failed = ""  # what a controller in Python gave that is not finite
        self.touches = Touches(set(), self.options.rtol)
        self.told = 0  # events of which the mechanism's `switch` knows

    def _machine(self, e: Equations) -> LevelMachine:
        if not self.options.freezes(self.system):
            return LevelMachine(self.system, e)
        return FrozenMachine(self.system, e, self.options.collisions, self.options.rtol)

    def _scene(self, nz: int, scale: float) -> Scene:
        return Scene(self.equations, self.machine, self.discrete, self.options, nz, scale)

    def go(self, progress: Callable[[float], None] | None = None) -> tuple[Outcome, float]:
        """Run to the end; how it ended, and the wall time in s."""
        control = self.system.control
        self.controller = control.begin(self.system.inputs) if isinstance(control, Control) else None
        self.live = Live(self.system.activations) if self.system.activations is not None else None
        began = time.perf_counter()
        self.start()
        outcome = Outcome.FINISHED
        try:
            with quiet():
                self._drive(progress)
        except Ended as end:
            outcome, self.ended_rows = end.outcome, end.rows
            if outcome is Outcome.STEP_TOO_SMALL:
                active = np.array(self.equations.active, dtype=np.int64)
                gone = vanished(self.system, active, self.q0, self.state.q, self.state.v)
                outcome, self.ended_rows = (Outcome.ILL_POSED, gone) if gone else (outcome, self.ended_rows)
        except KeyboardInterrupt:
            outcome = Outcome.INTERRUPTED
        return outcome, time.perf_counter() - began

    def _drive(self, progress: Callable[[float], None] | None) -> None:
        t_end, elapsed = self.options.t_end, Elapsed()
        stop = self._take_inputs()
        self._discretely(START)
        self._give()
        view = self._settle(switched=True)
        self._sample(view.lam)
        self.folds.begin(self.state.t, self.state.q, self.state.v)
        arc = self._arc(view)
        while self.state.t < t_end:
            self._check_bounds(elapsed)
            switched = self._step(arc, stop)
            if switched is None:
                arc = self._arc(view, cautious=True)
                continue
            if progress is not None:
                progress(self.state.t / t_end)
            at_stop = self.state.t >= stop
            if at_stop and stop < t_end:
                stop = self._take_inputs()
                self._give()
            s = self.state
            if switched or (s.t < t_end and (at_stop or self.machine.contradicts(s.t, s.q, s.v))):
                view = self._settle(switched)
                arc = self._arc(view)
            else:
                arc = self._arc_on(arc, view)

    def _check_bounds(self, elapsed: Elapsed) -> None:
        if self.scene.steps >= self.options.max_steps:
            raise Ended(Outcome.STEP_LIMIT)
        if elapsed.exceeds(self.options.time_limit):
            raise Ended(Outcome.TIME_LIMIT)
        if self.scene.steps >= self.looked + LOOK_AFTER:
            self.looked = self.scene.steps
            active, s = np.array(self.equations.active, dtype=np.int64), self.state
            if gone := whirling(self.system, active, self.v0, s.q, s.v, s.t):
                raise Ended(Outcome.ILL_POSED, gone)

    def _settle(self, switched: bool) -> View:
        """Switch what must be switched now (more, if something has `switched`), and record the instant behind it.

        IDA cannot start off the manifold of rigid rows: the drift of the arc before is taken away first.
        """
        s, work, known = self.state, self.machine.work.copy(), len(self.machine.events)
        s.q, s.v = s.q.copy(), s.v.copy()
        if self.rigid:
            self.equations.project(s.q, s.v, self.rigid)
        view = self._settle_both()
        if self.scene.nz:
            s.z = s.z.copy()
            s.z[: self.system.nc] += self.machine.work - work
        self._follow_law(view, switched or len(self.machine.events) > known)
        if self.natural:
            self._record(view.lam)
        return view

    def _settle_both(self) -> View:
        """Settle the rows, and tell the mechanism's `switch` whenever some have switched, until nothing changes."""
        s, events = self.state, self.machine.events
        for _ in range(ROUNDS):
            view = self.machine.settle(s.t, s.q, s.v)
            if len(events) == self.told:
                return view
            self.told = len(events)
            if not self._discretely(TOUCHED):
                return view
        raise Ended(Outcome.MODE_CYCLE, sorted({e.contact for e in events if e.t == s.t}))

    def _discretely(self, fired: int) -> bool:
        """Let the mechanism switch its discrete variables; whether it did."""
        s, events = self.state, self.machine.events
        changed, modes = self.discrete.switch(s.t, s.q, s.v, self.machine.modes, fired)
        known = len(events)
        self.machine.move(s.t, modes)
        self.told += len(events) - known
        return changed

    def _arc_on(self, arc: Arc, view: View) -> Arc:
        """The arc that goes on from here: of the same solver, or of one for what has turned out to be stiff."""
        if self.kind is not CvodeArc or not arc.stiff:
            return arc
        return BdfArc(self.scene, self.state, view, self.options.max_step, self.single)

    def _accelerate(self, t: float, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        return self.equations.accelerate(t, q, v)

    def _arc(self, view: View, cautious: bool = False) -> Arc:
        longest = self.options.max_step
        if cautious:
            longest = min(longest, (self.options.t_end - self.state.t) * CAUTION**self.retries)
        return self.kind(self.scene, self.state, view, longest, self.single or cautious)

    def _step(self, arc: Arc, stop: float) -> bool | None:
        """Go on; whether a machine switched, or None if the arc must begin anew with shorter steps."""
        before = self.state
        if stop - before.t <= 16.0 * ULP * stop:
            self.state.t = stop
            if self._next_sample() <= stop:
                self._sample(self._accelerate(stop, before.q, before.v)[1])
            self._check_progress(moved=False)
            return False
        try:
            state, fired = arc.step(stop, min(stop, self._next_sample()))
        except Ended as end:
            if end.outcome is not Outcome.NOT_FINITE or self.retries >= RETRIES:
                raise
            self.retries += 1
            return None
        self._check_folds(arc, before, state)
        while self._next_sample() < state.t:
            self.state = arc.at(self._next_sample())
            self._sample(arc.multipliers(self.state))
        self.state = state
        if fired.rows:
            self._put_on_law()
        self._check_progress(state.t - before.t > 16.0 * ULP * stop)
        if self.natural:
            self._record(arc.multipliers(state))
        elif self._next_sample() == state.t:
            self._sample(arc.multipliers(state))
        return self._fire(fired)

    def _check_folds(self, arc: Arc, before: State, after: State) -> None:
        """End the run if the rows that are always on lost rank in the step between these states."""

        def state(t: float) -> tuple[Floats, Floats]:
            s = after if t >= after.t else arc.at(t)
            return s.q, s.v

        self.folds.check(before.t, after.t, state)

    def _fire(self, fired: Fired) -> bool:
        """Apply what was located; whether the arc ends there."""
        s = self.state
        switched = self.machine.fire(s.t, s.q, s.v, fired.rows) if fired.rows else False
        for guard in fired.guards:
            self._discretely(guard)
        return switched or bool(fired.guards)

    def _put_on_law(self) -> None:
        """Move the state to where the linear laws of the active rows have their gaps.

        The solver keeps a gap to its tolerance, and a0 times that is the multiplier of a row that is to let go: it
        would let go at another instant, and at a rate at which it comes back.
        """
        s, arc = self.state, self.scene.work["arc"]
        rows = [i for i in self.equations.active if i not in self.rigid and np.isfinite(arc[i, 0])]
        if not any(self.machine.switching[i] for i in rows):
            return
        laws = self.equations.law[rows]
        h, rate = np.array(
            [linear_arc(a0, a1, *arc[i, 1:], s.t - arc[i, 0]) for i, (a0, a1, _) in zip(rows, laws, strict=True)]
        ).T
        s.q, s.v = s.q.copy(), s.v.copy()
        self.equations.project(s.q, s.v, rows, np.where(laws[:, 0] > 0.0, h, np.nan), rate)
        if not self.rigid:
            e, lam = self.equations, self.equations.accelerate(s.t, s.q, s.v)[1]
            s.lam = e.share(s.t, s.q, s.v, lam)

    def _follow_law(self, view: View, anew: bool) -> None:
        """Note from where each active row follows its law; one that did so before goes on, unless all begin anew."""
        arc, active = self.scene.work["arc"], self.equations.active
        for i in range(self.system.nc):
            if i not in active or self.equations.law[i, 2] > 0.0:
                arc[i, 0] = np.nan
            elif anew or np.isnan(arc[i, 0]):
                arc[i] = self.state.t, view.gap[i], view.rate[i]

    def _check_progress(self, moved: bool) -> None:
        self.still = 0 if moved else self.still + 1
        if moved:
            self.retries = 0
        elif self.still > STILL:
            raise Ended(Outcome.STEP_TOO_SMALL)

    def _next_sample(self) -> float:
        return float(self.samples[self.next_sample]) if self.next_sample < len(self.samples) else np.inf

    def _sample(self, lam: Floats) -> None:
        """Record the samples that fall on the present instant."""
        while self._next_sample() <= self.state.t:
            self._record(lam)
            self.next_sample += 1

    def _record(self, lam: Floats) -> None:
        s, e = self.state, self.equations
        gap, energy = e.gaps(s.t, s.q, s.v)[0].copy(), e.energy(s.q, s.v)
        known = 0.0 if self.system.energy is absent.energy else energy[0] + energy[1]
        if not isfinite(gap.dot(self.ones) + known):
            raise Ended(Outcome.NOT_FINITE)
        self.rows.append((s.t, s.q, s.v, gap, lam, energy, [int(m) for m in self.machine.modes], s.z))

    def _take_inputs(self) -> float:
        """Put the inputs that hold from now on in force; the next instant at which they change."""
        s, system = self.state, self.system
        while self.next_input < len(self.inputs_t) and self.inputs_t[self.next_input] <= s.t:
            now = self.inputs_u[self.next_input]
            if system.control is None:
                self.equations.u[:] = now
            else:  # by its change, so that what a controller holds on top stays
                self.equations.u += now - (self.inputs_u[self.next_input - 1] if self.next_input else 0.0)
            self.next_input += 1
        if system.control is not None and self.next_tick * system.tick <= s.t:
            self._control(s)
            self.next_tick += 1
        stops = [self.options.t_end, *self.inputs_t[self.next_input : self.next_input + 1].tolist()]
        if system.control is not None:
            stops.append(self.next_tick * system.tick)
        return float(min(stops))

    def _give(self) -> None:
        """Let a mechanism that looks at its inputs see those that hold from now on."""
        if self.discrete.give(self.options.rtol, self.equations.u):
            self._discretely(GIVEN)

    def _control(self, s: State) -> None:
        """Let the sampled controller set the inputs.

        Raises:
            Ended: NOT_FINITE if one in Python gives NaN or infinity.
        """
        if self.controller is None:
            self.equations.control(s.t, s.q, s.v)
            return
        try:
            given = self.controller(s.t, s.q, s.v)
        except NotFinite as failure:
            self.failed = f"{failure} "
            raise Ended(Outcome.NOT_FINITE) from None
        self.equations.u[: self.controller.width] = given[: self.controller.width]
        if self.live is not None:
            self.live.put(s.t, self.equations.u)

    def trajectory(self, outcome: Outcome, wall_s: float) -> Trajectory:
        """What was recorded, as a Trajectory."""
        if not self.rows:  # it ended before its first row, or none was asked for: the start is known at least
            gap, energy = self.system.gap(self.q0, self.v0)[0], self.equations.energy(self.q0, self.v0)
            nothing, start = np.zeros(self.system.nc), [int(m) for m in self.machine.modes]
            self.rows.append((0.0, self.q0, self.v0, gap, nothing, energy, start, np.zeros(self.scene.nz)))
        n, nq, nc, count = self.system.n, self.system.nq, self.system.nc, len(self.rows)
        columns = list(zip(*self.rows, strict=True))
        widths = (nq, n, nc, nc, 2, nc, self.scene.nz)
        t = np.array(columns[0], dtype=np.float64)
        q, v, gap, lam, energy, mode, z = (
            np.array(c, dtype=np.float64).reshape(count, w) for c, w in zip(columns[1:], widths, strict=True)
        )
        modes = mode.astype(np.int8)
        run = Trajectory(
            t=t, q=self.system.normalised("run", q), v=v, gap=gap, lam=lam, energy=energy, mode=modes,
            events=tuple(self.machine.events),
            switches=tuple(self.discrete.switches),
            outcome=outcome, message=self._message(outcome), steps=self.scene.steps, wall_s=wall_s,
            unique_until=self.machine.unique_until, searched_until=self.machine.searched_until, counts=MappingProxyType(
                {"rhs": self.scene.evaluations}
                | ({"redundant": self.machine.redundant} if self.machine.redundant else {})
                | self.machine.told
                | self.touches.told
            ),
            energy_gained=self.touches.gained,
            energy_handed=self.touches.handed,
            ledger=Ledger(contact=z[:, :nc], input=z[:, nc], dissipated=z[:, nc + 1]) if self.scene.nz else None,
        )  # fmt: skip
        if self.controller is not None:
            given = self.controller.given(self.inputs_t, self.inputs_u)
            run = replace(run, inputs=given, control_s=self.controller.seconds)
        return watched(self.system, run)

    def _message(self, outcome: Outcome) -> str:
        if outcome is Outcome.FINISHED:
            return noted({**self.machine.told, **self.touches.told, **self.touches.amounts})
        s = self.state
        where = f"t = {s.t:.12g} s, q = {s.q.tolist()}, v = {s.v.tolist()}"
        on = np.flatnonzero(~np.isin([int(m) for m in self.machine.modes], (Mode.FREE, Mode.BALLISTIC)))
        if outcome in STUCK and (deep := buried(self.system, on, s.q, s.v)):
            return f"At {where}, {deep}. {KEEP_OUT}"
        rows = f"Rows {self.ended_rows}, " if self.ended_rows else ""
        if outcome is Outcome.NOT_FINITE:
            rows = self.failed or self._blamed()
        elif outcome is Outcome.ILL_POSED and self.ended_rows:
            active = np.array(self.ended_rows)
            gone = whirling(self.system, active, self.v0, s.q, s.v, s.t)
            rows = undirected(gone) if gone else dependence(self.system, active, s.q, s.v)
        return f"{rows}{where}. {outcome.advice}"

    def _blamed(self) -> str:
        """The kernel that gave what is not finite, at the end of the motion or behind it."""
        s, e = self.state, self.equations
        active, ahead = np.array(e.active, dtype=np.int64), self.options.t_end - s.t
        return not_finite(self.system, s.t, np.concatenate([s.q, s.v]), e.u, e.p, active, ahead)
