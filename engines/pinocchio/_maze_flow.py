"""Event-driven integration of the maze: CVODE between events, the maze's own machine at them."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sksundae.cvode import CVODE

from crossbody.cases import Mode, Outcome
from crossbody.cases.arrays import Floats
from crossbody.engines._maze.log import MazeLog
from crossbody.engines._maze.machine import NG, MazeMachine, Settled
from crossbody.engines._maze.memory import Memory
from crossbody.engines.pinocchio._flow import PER_SOLVE, ROOT_FOUND, SAME_INSTANT, TINY
from crossbody.reference.sundials.quiet import quiet


class MazeFlow:
    """One run.

    Attributes:
        memory: the discrete state now.
        steps, rhs: steps and right-hand sides so far.
        outcome, message: how it ended.
    """

    def __init__(
        self, machine: MazeMachine, log: MazeLog, rtol: float, atol: Floats, method: str, max_steps: int
    ) -> None:
        self.machine, self.log, self.max_steps = machine, log, max_steps
        self.steps = self.rhs = self.still = 0
        self.outcome, self.message = Outcome.FINISHED, ""
        self.memory: Memory

        def rhs(_t: float, y: NDArray[Any], yp: NDArray[Any]) -> None:  # CVODE hangs attributes on it
            self.rhs += 1
            s = y.tolist()
            yp[:4] = s[4:]
            yp[4:] = machine.accelerate(s[:4], s[4:], self.memory)[0]

        def watch(_t: float, y: NDArray[Any], out: NDArray[Any]) -> None:
            s = y.tolist()
            out[:] = machine.watch(s[:4], s[4:], self.memory)
            out[out == 0.0] = TINY

        options = {"rtol": rtol, "atol": atol, "method": method, "max_num_steps": PER_SOLVE}
        self.solver = CVODE(rhs, eventsfn=watch, num_events=NG, **options)

    def run(self, q0: Floats, v0: Floats, t_end: float) -> None:
        """Integrate from (q0, v0) to t_end, s."""
        with quiet() as said:
            self._run(np.concatenate((q0, v0)), t_end)
        words = " ".join(said.getvalue().split())
        self.message = f"{self.message} CVODE: {words}" if words else self.message

    def _run(self, y: Floats, t_end: float) -> None:
        t = 0.0
        q, v = _halves(y)
        self._pass(t, y, self.machine.first(q, v))
        self.solver.init_step(t, y)
        while t < t_end and self.outcome.ok:
            if self.steps >= self.max_steps:
                return self._end(Outcome.STEP_LIMIT, t, y, f"{self.max_steps} steps were not enough")
            step = self.solver.step(t_end, method="onestep", tstop=t_end)
            self.steps += 1
            if not step.success or not np.isfinite(step.y).all():
                bad = Outcome.STEP_TOO_SMALL if np.isfinite(step.y).all() else Outcome.NOT_FINITE
                return self._end(bad, t, y, "CVODE gave up")
            before, t, y = t, float(step.t), np.array(step.y)
            changed = self._look(t, y, _fired(step))
            self.still = self.still + 1 if t == before else 0
            if self.still > SAME_INSTANT:
                return self._end(Outcome.MODE_CYCLE, t, y, f"the time does not move on (rows {self.memory.modes})")
            if changed:
                self.solver.init_step(t, y)
        return None

    def _look(self, t: float, y: Floats, fired: Collection[int]) -> bool:
        """Record an instant; let the machine look at it if something fired. Returns whether something switched."""
        q, v = _halves(y)
        lam = self._record(t, y)
        if not fired and not any(m == Mode.CONTACT and lam[i] < 0.0 for i, m in enumerate(self.memory.modes[:6])):
            return False
        settled = self.machine.settle(t, q, v, self.memory, fired)
        if settled.changed or settled.lost:
            self._pass(t, y, settled)
        return settled.changed

    def _pass(self, t: float, y: Floats, settled: Settled) -> None:
        self.memory = settled.memory
        self.log.pass_to(settled)
        self._record(t, y)
        if settled.lost:
            self._end(Outcome.LOST, t, y, "the ball is more than 60 degrees from the top")
        if settled.cycle:
            self._end(Outcome.MODE_CYCLE, t, y, f"the rows come back to {settled.memory.modes} at one instant")

    def _record(self, t: float, y: Floats) -> Floats:
        q, v = _halves(y)
        lam = self.machine.accelerate(q, v, self.memory)[1]
        self.log.note(t, y[:4], y[4:], lam, self.memory)
        return lam

    def _end(self, outcome: Outcome, t: float, y: Floats, what: str) -> None:
        self.outcome = outcome
        self.message = f"t = {t:g} s, q = {y[:4].tolist()}, v = {y[4:].tolist()}: {what}."


def _halves(y: Floats) -> tuple[tuple[float, ...], tuple[float, ...]]:
    s = y.tolist()
    return tuple(s[:4]), tuple(s[4:])


def _fired(step: Any) -> list[int]:
    if step.status != ROOT_FOUND or step.i_events is None:
        return []
    return [int(k) for k in np.flatnonzero(step.i_events[-1])]
