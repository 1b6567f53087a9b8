"""Event-driven integration: CVODE between events, a state machine at them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sksundae.cvode import CVODE

from crossbody.cases import Mode, Outcome
from crossbody.cases._arrays import Floats
from crossbody.cases._control import NotFinite
from crossbody.engines._log import Log
from crossbody.engines._machines import ACTIVE, WATCHED, Fired, Machine, Settled, first_modes
from crossbody.engines.pinocchio._coordinates import Coordinates
from crossbody.engines.pinocchio._scene import World
from crossbody.reference.sundials.quiet import quiet

PER_SOLVE = 100_000
"""Internal steps that CVODE may take before it returns; it returns after each, so this never binds."""
ROOT_FOUND = 2
"""CVODE's word for a step that ended at a zero of a watched function; later steps still carry the old events."""
TINY = 1e-300
"""In place of a watched function that is exactly 0: it has not passed yet. CVODE complains of what stays at 0."""
SAME_INSTANT = 100
"""Events in a row without the time moving on that make a cycle."""


class Flow:
    """One run.

    Attributes:
        modes: modes of the rows now.
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
        self.outcome, self.message = Outcome.FINISHED, ""
        self.modes = first_modes(self.rows)
        options: dict[str, Any] = {"rtol": rtol, "atol": atol, "method": method, "max_num_steps": PER_SOLVE}
        watched = WATCHED * self.rows.nc

        def watch(t: float, y: NDArray[Any], out: NDArray[Any]) -> None:  # CVODE hangs attributes on it
            self._watch(t, y, out)
            out[out == 0.0] = TINY

        if watched:
            options |= {"eventsfn": watch, "num_events": watched}
        self.solver = CVODE(self._rhs, **options)

    def run(self, q0: Floats, v0: Floats, t_end: float) -> None:
        """Integrate from (q0, v0) to t_end, s."""
        self.world.reset()
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
        stop = end
        while t < end and self.outcome.ok:
            if self.steps >= self.max_steps:
                return self._end(Outcome.STEP_LIMIT, t, y, f"{self.max_steps} steps were not enough")
            step = self.solver.step(stop, method="onestep", tstop=stop)
            self.steps += 1
            if not self._sound(step, t, y):
                return y
            fired = _fired(step)
            if step.t > t and stop != step.t and self._overran(y, step.y, fired):
                stop = float(step.t)  # a dip that began and turned inside one step: again, no further than its bottom
                self.solver.init_step(t, y)
                continue
            before, t, stop = t, float(step.t), end
            modes, y = self.modes, self._switch(t, np.array(step.y), fired)
            self.still = self.still + 1 if t == before else 0
            if self.still > SAME_INSTANT:
                bad = Outcome.MODE_CYCLE if fired else Outcome.STEP_TOO_SMALL
                return self._end(bad, t, y, f"the time does not move on (rows {modes})")
            if self.modes != modes or not np.array_equal(y, step.y):
                self.solver.init_step(t, y)
        return y

    def _sound(self, step: Any, t: float, y: Floats) -> bool:
        """Whether a step succeeded, with a state that is finite and that the scene can reach."""
        if not step.success:
            finite = bool(np.isfinite(self.vd).all())
            bad = Outcome.STEP_TOO_SMALL if finite else Outcome.NOT_FINITE
            self._end(bad, t, y, "CVODE gave up" if finite else f"the acceleration is {self.vd.tolist()}")
        elif not np.isfinite(step.y).all():
            self._end(Outcome.NOT_FINITE, t, y, "the next state is not finite")
        elif not self.world.safe(step.y[: self.n], step.y[self.n :]):
            self._end(Outcome.DIVERGED, t, y, "the state left what the scene can reach")
        return self.outcome.ok

    def _switch(self, t: float, y: Floats, fired: Fired, first: bool = False) -> Floats:
        """Record an instant, let the machine look at it, and record it again if something switched."""
        self._tell(t)
        q, v = self._state(y)
        lam = self.rows.accelerate(q, v, self.modes)[1]
        if not first:
            self.log.add(t, q, v, lam, self.modes)
        if not first and not fired and not self._pulls(lam):
            return y
        settled: Settled = self.machine.settle(q, v, self.modes, fired)
        if settled.passed:
            self.modes = settled.modes
            self.log.events += settled.events(t)
            lam = self.rows.accelerate(q, settled.v, self.modes)[1]
        y = np.concatenate((y[: self.n], settled.v))
        if settled.passed or first:
            self.log.add(t, q, settled.v, lam, self.modes)
        if settled.cycle:
            self._end(Outcome.MODE_CYCLE, t, y, f"the rows come back to {settled.modes} at one instant")
        return y

    def _pulls(self, lam: Floats) -> bool:
        """Whether a contact pulls though its zero was not found: it began below, by the rounding of its start."""
        return any(m in ACTIVE and m != Mode.BILATERAL and lam[i] < 0.0 for i, m in enumerate(self.modes))

    def _overran(self, before: Floats, after: Floats, fired: Fired) -> bool:
        """Whether a free row came from above its surface and stands below it without its touch having been found."""
        h = self.rows.gaps(*self._state(after))[0]
        if not (h < 0.0).any():
            return False
        above = self.rows.gaps(*self._state(before))[0]
        free = [i for i, m in enumerate(self.modes) if m == Mode.FREE]
        return any(h[i] < 0.0 < above[i] and (i, 0) not in fired for i in free)

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
        self.machine.watch(self.q, self.v, self.modes, out)

    def _end(self, outcome: Outcome, t: float, y: Floats, what: str) -> Floats:
        self.outcome = outcome
        self.message = f"t = {t:g} s, q = {y[: self.n].tolist()}, v = {y[self.n :].tolist()}: {what}."
        return y


def _fired(step: Any) -> Fired:
    """(row, function) of every function that fell to zero."""
    if step.status != ROOT_FOUND or step.i_events is None:
        return frozenset()
    return frozenset(divmod(int(k), WATCHED) for k in np.flatnonzero(step.i_events[-1] < 0))
