"""Event-driven integration: CVODE between events, a state machine at them."""

from __future__ import annotations

import math
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Mode, Outcome
from crossbody.cases.arrays import Floats
from crossbody.cases.control import NotFinite
from crossbody.engines._gates import Gated
from crossbody.engines._log import Log
from crossbody.engines._machines import ACTIVE, WATCHED, Fired, Machine, Passed, Settled, first_modes
from crossbody.engines.pinocchio._coordinates import Coordinates, World
from crossbody.engines.pinocchio._rows import ULP, PinRows
from crossbody.reference.sundials.quiet import quiet
from crossbody.reference.sundials.solvers import CVODE

PER_SOLVE = 100_000
"""Internal steps that CVODE may take before it returns; it returns after each, so this never binds."""
ROOT_FOUND = 2
"""CVODE's word for a step that ended at a zero of a watched function; later ones carry old events."""
VANISHED = 1e-6
"""Part of H M^-1 H^T of a row at the start below which nothing moves the row as its law says."""
TINY = 1e-300
"""In place of a watched function that is exactly 0: it has not passed yet. CVODE dislikes what stays at 0."""
LOOKS = np.linspace(0.0, 1.0, 10)[1:-1].tolist()
"""Parts of a step at which rows are looked at that may have turned twice in it."""
ROUNDED = 8.0 * ULP
"""Part of the largest coordinate that rounding may make of a gap: what hangs side by side parts by it."""
SHOWN = 200
"""Parts of the horizon, none of which is left without a sample: what falls or rests takes steps of any length."""
SAME_INSTANT = 100  # events in a row without the time moving on that make a cycle


class Flow:
    """One run.

    Attributes:
        modes: modes of the rows now.
        opens: whether any row can, so that something may switch.
        steps, rhs: steps and right-hand sides so far.
        outcome, message: how it ended.
    """

    def __init__(
        self, machine: Machine, log: Log, rtol: float, atol: Floats, method: str, max_steps: int,
        world: World | None = None, coordinates: Coordinates | None = None,
    ) -> None:  # fmt: skip
        self.machine, self.rows, self.log, self.max_steps = machine, machine.rows, log, max_steps
        self.world = world or World()
        self.coordinates = coordinates
        self.n = len(atol) // 2 if coordinates is None else coordinates.nq
        self.q, self.v = np.empty(self.n), np.empty(len(atol) - self.n)  # Pinocchio and CVODE do not share memory
        self.vd: Floats = np.zeros(self.n)
        self.steps = self.rhs = self.still = 0
        self.longest = math.inf
        self.outcome, self.message = Outcome.FINISHED, ""
        self.modes = first_modes(self.rows)
        options: dict[str, Any] = {"rtol": rtol, "atol": atol, "method": method, "max_num_steps": PER_SOLVE}
        self.ways = machine.rows.ways if isinstance(machine.rows, PinRows) else None
        self.gated = self.ways if isinstance(self.ways, Gated) else None
        watched = WATCHED * self.rows.nc + (self.ways.watched if self.ways is not None else 0)

        def watch(t: float, y: NDArray[Any], out: NDArray[Any]) -> None:  # CVODE hangs attributes on it
            self._watch(t, y, out)
            out[out == 0.0] = TINY

        self.opens = self.ways is not None or any(self.rows.unilateral)
        if self.opens:
            options |= {"eventsfn": watch, "num_events": watched}
        self.solver = CVODE(self._rhs, **options)

    def run(self, q0: Floats, v0: Floats, t_end: float) -> None:
        """Integrate from (q0, v0) to t_end, s."""
        self.start, self.longest = q0.copy(), t_end / SHOWN
        self.world.reset()
        if self.ways is not None:
            self.ways.begin(q0)
        with quiet() as said:
            self._run(np.concatenate((q0, v0)), t_end)
        words = " ".join(said.getvalue().split())
        self.message = f"{self.message} CVODE: {words}" if words else self.message

    def _run(self, y: Floats, t_end: float) -> None:
        """From one change of the inputs to the next."""
        instants = [t for t in self.world.instants if t < t_end]
        changed = not instants or instants[0] > 0.0 or self._change(instants.pop(0), y)
        y = self._switch(0.0, y, frozenset(), first=True)
        if not changed:
            return
        t = 0.0
        for stop in (*instants, t_end):
            y = self._until(t, y, stop)
            t = stop
            if not self.outcome.ok:
                return
            if t < t_end:
                if not self._change(t, y):
                    return
                y = self._switch(t, y, frozenset(), first=True)

    def _change(self, t: float, y: Floats) -> bool:
        """Put in force what acts from t on, s; whether the run goes on."""
        try:
            self.world.change(t, y[: self.n].copy(), y[self.n :].copy())
        except NotFinite as failure:
            self._end(Outcome.NOT_FINITE, t, y, str(failure).removesuffix("."))
        return self.outcome.ok

    def _until(self, t: float, y: Floats, end: float) -> Floats:
        """The state at `end`, s, or where the run ended."""
        self.solver.init_step(t, y)
        stop, asked = end, t
        while t < end and self.outcome.ok:
            if self.steps >= self.max_steps:
                return self._end(Outcome.STEP_LIMIT, t, y, f"{self.max_steps} steps did not reach the horizon")
            step = self.solver.step(stop, method="onestep", tstop=stop)
            self.steps += 1
            if not self._sound(step, t, y):
                return y
            fired, turned = self._fired(step)
            deepest = self._passed_over(t, y, step, fired) if step.t > t else None
            if deepest is None and step.t > t and self.ways is not None and self.ways.through(turned):
                deepest = float(step.t)
            if deepest is not None and deepest != asked:
                stop = asked = deepest  # a dip that began and turned inside one step: again, no further than its bottom
                self.solver.init_step(t, y)
                continue
            before, t, stop, asked = t, float(step.t), end, t
            reached = np.array(step.y)
            if t - before > self.longest:
                self._tell_inside(before, t)
            modes, y = self.modes, self._switch(t, reached, fired, turned=turned)
            self.still = self.still + 1 if t == before else 0
            if self.still > SAME_INSTANT:
                bad = Outcome.MODE_CYCLE if fired or turned else Outcome.STEP_TOO_SMALL
                gone = "" if fired or turned else self._vanished(y)
                bad = Outcome.ILL_POSED if gone else bad
                return self._end(bad, t, y, gone or f"time does not advance (rows {modes})")
            if turned or self.modes != modes or not np.array_equal(y, reached):
                self.solver.init_step(t, y)
        return y

    def _tell_inside(self, before: float, t: float) -> None:
        """Record what CVODE's own polynomial says inside of a long step, s; CVODE then stands at its end again."""
        began = perf_counter()
        for at in np.linspace(before, t, math.ceil((t - before) / self.longest) + 1)[1:-1].tolist():
            q, v = self._state(self._inside(at))
            self._tell(at)
            self._record(at, q, v, self.rows.accelerate(q, v, self.modes)[1])
        self._inside(t)
        self.log.aside_s += perf_counter() - began

    def _inside(self, t: float) -> Floats:
        """Return the state at an instant, s, of the last step; behind a zero the first answer is the zero again."""
        asked = self.solver.step(t, method="normal")
        return np.array(asked.y if asked.t == t else self.solver.step(t, method="normal").y)

    def _vanished(self, y: Floats) -> str:
        """What to say where hardly anything moves a row that must move, and something did at the start."""
        q = self._state(y)[0]
        on = [i for i, mode in enumerate(self.modes) if mode in ACTIVE]
        before, now = (np.diag(self.rows.delassus(at))[on] for at in (self.start, q))
        gone = [i for i, a, b in zip(on, before, now, strict=True) if b < VANISHED * a]
        return f"almost nothing can move rows {gone}, which must move" if gone else ""

    def _fired(self, step: Any) -> tuple[Fired, frozenset[int]]:
        """(row, function) of every function that fell to zero, and pairs that lie the other way."""
        if step.status != ROOT_FOUND or step.i_events is None:
            return frozenset(), frozenset()
        fallen, rows = np.flatnonzero(step.i_events[-1] < 0), WATCHED * self.rows.nc
        turned = frozenset((fallen[fallen >= rows] - rows).tolist())
        return frozenset(divmod(int(k), WATCHED) for k in fallen[fallen < rows]), turned

    def _sound(self, step: Any, t: float, y: Floats) -> bool:
        """Whether a step succeeded, with a state that is finite and that the scene can reach."""
        if not step.success and (gone := self._vanished(y)):
            self._end(Outcome.ILL_POSED, t, y, gone)
        elif not step.success:
            finite = bool(np.isfinite(self.vd).all())
            bad = Outcome.STEP_TOO_SMALL if finite else Outcome.NOT_FINITE
            self._end(bad, t, y, "CVODE gave up" if finite else f"the acceleration is {self.vd.tolist()}")
        elif not math.isfinite(step.y.sum()):
            self._end(Outcome.NOT_FINITE, t, y, "the next state is not finite")
        elif not self.world.safe(step.y[: self.n], step.y[self.n :]):
            self._end(Outcome.DIVERGED, t, y, "the state left the region that the scene can reach")
        return self.outcome.ok

    def _switch(
        self, t: float, y: Floats, fired: Fired, first: bool = False, turned: frozenset[int] = frozenset()
    ) -> Floats:
        """Record an instant, let the machine look at it, and record it again if something switched."""
        self._tell(t)
        q, v = self._state(y)
        lam = self.rows.accelerate(q, v, self.modes)[1]
        if not first:
            self._record(t, q, v, lam)
        if not first and not fired and not turned and not (self.opens and self._pulls(lam)):
            return y
        if not self.opens and t > 0.0:
            self._record(t, q, v, lam)
            return y
        before = self.gated.discrete() if self.gated is not None and t > 0.0 else ()
        self._turn(t, q, turned)
        settled = self._settle(t, q, v, fired)
        y = np.concatenate((y[: self.n], settled.v))
        if settled.passed or first or turned:
            self._record(t, q, settled.v, self.rows.accelerate(q, settled.v, self.modes)[1])
        if self.gated is not None and before:
            self.log.switches += self.gated.switches(t, before)
        if self.gated is not None and self.gated.lost:
            return self._end(Outcome.LOST, t, y, self.gated.gates.lost)
        if settled.cycle:
            self._end(Outcome.MODE_CYCLE, t, y, f"the rows return to {settled.modes} at one instant")
        return y

    def _record(self, t: float, q: Floats, v: Floats, lam: Floats) -> None:
        self.log.add(t, q, v, lam, self.modes)
        if self.gated is not None:
            self.gated.keep()

    def _settle(self, t: float, q: Floats, v: Floats, fired: Fired) -> Settled:
        """Switch rows until nothing changes; again where what acts on them depends on which are in force."""
        passed: tuple[Passed, ...] = ()
        while True:
            settled: Settled = self.machine.settle(q, v, self.modes, fired)
            self.modes, v, fired, passed = settled.modes, settled.v, frozenset(), (*passed, *settled.passed)
            self.log.events += settled.events(t)
            if self.ways is None or not self.ways.hold(q, self.modes):
                return replace(settled, passed=passed)

    def _turn(self, t: float, q: Floats, turned: frozenset[int]) -> None:
        """Let pairs of shapes lie the other way, or gates open and close, with the modes of their rows."""
        if self.ways is None or not turned:
            return
        before, self.modes = self.modes, self.ways.turn(q, self.modes, turned)
        pairs = zip(before, self.modes, self.rows.follows, strict=True)  # a row that follows has no events of its own
        passed = tuple((i, b, a, 0.0) for i, (b, a, leader) in enumerate(pairs) if a != b and leader < 0)
        self.log.events += Settled(self.modes, np.zeros(0), passed).events(t)

    def _pulls(self, lam: Floats) -> bool:
        """Whether a contact pulls though its zero was not found: it began below, by rounding."""
        return any(m in ACTIVE and m != Mode.BILATERAL and lam[i] < 0.0 for i, m in enumerate(self.modes))

    def _passed_over(self, t: float, before: Floats, step: Any, fired: Fired) -> float | None:
        """When in a step a free row was at its lowest whose touch was not found; None if there is none.

        It stands below its surface at the end, or it turned twice in between: up, down and up
        again has the same signs at both ends. What falls freely takes steps as long as that.
        """
        if Mode.FREE not in self.modes:
            return None
        (h, rate), (end, rate_end) = (self.rows.gaps(*self._state(y)) for y in (before, step.y))
        free = np.array([m == Mode.FREE for m in self.modes], dtype=bool)
        noise = ROUNDED * float(np.abs(step.y[: self.n]).max(initial=0.0))
        if any(free[i] and end[i] < -noise and h[i] > 0.0 and (i, 0) not in fired for i in range(len(h))):
            return float(step.t)
        dt, bend = float(step.t) - t, np.abs(rate_end - rate)
        fast = np.maximum(np.abs(rate), np.abs(rate_end)) + bend
        may = free & (np.minimum(np.abs(rate), np.abs(rate_end)) < bend) & (h + end < fast * dt) & (h > 0.0)
        if not may.any():
            return None
        lowest = np.minimum(h, end)[may]
        dip, where = min((float(np.min(self._heights(before, step.y, dt, x)[may] - 0.5 * lowest)), x) for x in LOOKS)
        return t + where * dt if dip < -noise else None

    def _heights(self, before: Floats, after: Floats, dt: float, x: float) -> Floats:
        """Gaps (nc,) at a part x of a step of dt, s: where the cubic through both ends has the positions."""
        (q, v), (p, u) = ((y[: self.n], y[self.n :]) for y in (before, after))
        if self.coordinates is not None:
            v, u = self.coordinates.rates(q, v), self.coordinates.rates(p, u)
        at = q + x * x * (3.0 - 2.0 * x) * (p - q) + x * (1.0 - x) * dt * ((1.0 - x) * v - x * u)
        self._normalise(at)
        return self.rows.gaps(at, before[self.n :])[0]

    def _state(self, y: Floats) -> tuple[Floats, Floats]:
        """Copies of q, with quaternions of length 1, and v."""
        q, v = y[: self.n].copy(), y[self.n :].copy()
        self._normalise(q)
        return q, v

    def _normalise(self, q: Floats) -> None:
        """Bring quaternions to length 1: Pinocchio's rnea is wrong for any other."""
        if self.coordinates is not None:
            self.coordinates.normalise(q)

    def _tell(self, t: float) -> None:
        """Tell the time, s, to what depends on it."""
        if self.world.clock is not None:
            self.world.clock(t)

    def _rhs(self, t: float, y: NDArray[Any], yp: NDArray[Any]) -> None:
        n = self.n
        self.rhs += 1
        self._tell(t)
        self.q[:], self.v[:] = y[:n], y[n:]
        yp[:n] = self.v if self.coordinates is None else self.coordinates.rates(self.q, self.v)
        self._normalise(self.q)
        yp[n:] = self.vd = self.rows.accelerate(self.q, self.v, self.modes)[0]

    def _watch(self, t: float, y: NDArray[Any], out: NDArray[Any]) -> None:
        self._tell(t)
        self.q[:], self.v[:] = y[: self.n], y[self.n :]
        self._normalise(self.q)
        rows = WATCHED * self.rows.nc
        self.machine.watch(self.q, self.v, self.modes, out[:rows])
        if self.ways is not None:
            self.ways.watch(self.q, out[rows:])

    def _end(self, outcome: Outcome, t: float, y: Floats, what: str) -> Floats:
        self.outcome = outcome
        self.message = f"t = {t:g} s, q = {y[: self.n].tolist()}, v = {y[self.n :].tolist()}: {what}."
        return y
