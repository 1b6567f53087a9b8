"""Runge-Kutta steps of the matched maze, cut at the events that the maze's own machine watches."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from maze_charts import Charts
from scipy.optimize import brentq

from crossbody.cases import Case, Outcome, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.engines._maze.log import MazeLog
from crossbody.engines._maze.machine import MazeMachine, Settled
from crossbody.engines._maze.memory import CONTACT, FREE
from crossbody.engines._maze.rows import NORMALS
from crossbody.engines._maze.scene import ball_maze
from crossbody.engines.mujoco._globals import hooked
from crossbody.engines.mujoco._march import SAME_INSTANT

State = tuple[float, ...]
FULL = mujoco.mjtState.mjSTATE_INTEGRATION
TOGETHER = 1e-12
"""Events closer than this are one, as a part of the step."""
FINER = 16
"""Steps in the place of one while a contact is lively."""
SETTLED = 1e-6
"""What is left of an approach, |h'| + sqrt(a0) |h|, when a ball has settled on a face, m/s."""
FASTEST = 1e4
"""Speed at which a run has diverged, rad/s and m/s."""


def followed(case: Case, dt: float = 1e-3) -> Trajectory:
    """Return the motion of a case on MuJoCo's polar chain, whose rows the maze's own machine switches."""
    maze, log = ball_maze(case), MazeLog()
    charts = Charts(case, maze)
    march = MazeMarch(charts, log, dt, 2_000_000)
    with hooked(charts.stage):
        march.run(case.q0, case.v0, case.t_end)
    return log.trajectory(maze.observer(log.places), march.outcome, march.message, march.steps)


class MazeMarch:
    """One run.

    Attributes:
        steps, trials: steps accepted, and steps tried to locate events.
        outcome, message: how it ended.
    """

    def __init__(self, charts: Charts, log: MazeLog, dt: float, max_steps: int) -> None:
        self.charts, self.log, self.dt, self.max_steps = charts, log, dt, max_steps
        self.machine = MazeMachine(charts.maze, charts.probe)
        self.saved = np.empty(mujoco.mj_stateSize(charts.model, FULL))
        self.now: tuple[State, State, Floats]
        self.steps = self.trials = self.still = 0
        self.outcome, self.message = Outcome.FINISHED, ""

    def run(self, q0: Floats, v0: Floats, t_end: float) -> None:
        """Step from (q0, v0) to t_end, s. The callback of every stage must be in place."""
        q, v = tuple(q0.tolist()), tuple(v0.tolist())
        mujoco.mj_resetData(self.charts.model, self.charts.data)
        self.charts.arm(self.machine.untouched(q), q, v)
        self._pass(0.0, q, v, self.machine.first(q, v))
        t = 0.0
        watched = self._watch()
        while t_end - t > 1e-9 * self.dt and self.outcome.ok:
            if self.steps >= self.max_steps:
                return self._end(Outcome.STEP_LIMIT, t, f"{self.max_steps} steps of {self.dt:g} s were not enough")
            step = min(self.dt / FINER if self._lively() else self.dt, t_end - t)
            mujoco.mj_getState(self.charts.model, self.charts.data, self.saved, FULL)
            ahead = self._try(step)
            if not self._sound():
                return self._broken(t)
            self.steps += 1
            crossed = self._crossed(watched, ahead)
            if crossed:
                root, fired = self._first_of(crossed, watched, step)
                t = self._event(t, self._behind(root, fired[0], watched, step), fired)
                watched = self._watch()
            else:
                t, watched = t + step, ahead
                self._record(t)
        return None

    def _try(self, step: float) -> list[float]:
        """Advance from the saved state, and evaluate: the functions watched there."""
        model, data = self.charts.model, self.charts.data
        model.opt.timestep = step
        if step > 0.0:
            mujoco.mj_RungeKutta(model, data, 4)
        mujoco.mj_forward(model, data)
        return self._watch()

    def _redo(self, step: float) -> list[float]:
        model, data = self.charts.model, self.charts.data
        self.trials += 1
        mujoco.mj_setState(model, data, self.saved, FULL)
        mujoco.mj_forward(model, data)
        return self._try(step)

    def _watch(self) -> list[float]:
        """The functions watched; state and multipliers are kept for the record."""
        q, v = self.charts.state()
        self.now = q, v, self.charts.multipliers()
        return self.machine.watch(q, v, self.charts.memory, self.now[2])

    def _lively(self) -> bool:
        """Whether a tip is touched, or a face by a ball that has not settled on it."""
        charts, q, v = self.charts, self.now[0], self.now[1]
        if charts.face is None:
            return CONTACT in charts.memory.modes
        h, H, _ = charts.maze.rows.at(charts.memory.place)[charts.face](q, v)
        return abs(H[1] * v[1] + H[2] * v[2]) + charts.rate * abs(h) > SETTLED

    def _crossed(self, before: Sequence[float], after: Sequence[float]) -> list[int]:
        """Functions that changed sign; of a free row's h' only a rise through zero below the surface counts."""
        found = []
        for i, (b, a) in enumerate(zip(before, after, strict=True)):
            if (b > 0.0) != (a > 0.0) and (not self._is_rate(i) or (a > 0.0 and after[i - 1] < -b * self.dt)):
                found.append(i)
        return found

    def _is_rate(self, i: int) -> bool:
        slot, push = divmod(i, 2)
        return bool(push) and slot in NORMALS and self.charts.memory.modes[slot] == FREE

    def _first_of(self, crossed: Sequence[int], before: Sequence[float], step: float) -> tuple[float, list[int]]:
        """When the first of them passes zero, and which pass with it."""
        times = {}
        for i in crossed:
            start = before[i]
            times[i] = float(brentq(lambda tau, i=i: self._redo(tau)[i], 0.0, step, xtol=1e-16)) if start else 0.0
        first = min(times.values())
        return first, [i for i, tau in times.items() if tau - first <= TOGETHER * self.dt]

    def _behind(self, step: float, i: int, before: Sequence[float], longest: float) -> float:
        """Land where function i has just left its sign: on it, it would be found again for ever."""
        nudge = 1e-16 * longest
        while (self._redo(step)[i] > 0.0) == (before[i] > 0.0) and step < longest:
            step, nudge = min(step + nudge, longest), 2.0 * nudge
        return step

    def _event(self, t: float, step: float, fired: list[int]) -> float:
        """Record an instant that was landed on, switch, and record what is behind it."""
        self.still = 0 if step > 1e-9 * self.dt else self.still + 1
        t += step
        self._record(t)
        q, v = self.charts.state()
        self._pass(t, q, v, self.machine.settle(t, q, v, self.charts.memory, fired))
        if self.still > SAME_INSTANT:
            self._end(Outcome.MODE_CYCLE, t, f"the time does not move on (rows {self.charts.memory.modes})")
        return t

    def _pass(self, t: float, q: State, v: State, settled: Settled) -> None:
        self.charts.arm(settled.memory, q, v)
        self.now = *self.charts.state(), self.charts.multipliers()
        self.log.pass_to(settled)
        if settled.changed or t == 0.0:
            self._record(t)
        if settled.lost:
            self._end(Outcome.LOST, t, "the ball is more than 60 degrees from the top")
        if settled.cycle:
            self._end(Outcome.MODE_CYCLE, t, f"the rows come back to {settled.memory.modes} at one instant")

    def _record(self, t: float) -> None:
        q, v, lam = self.now
        self.log.note(t, np.array(q), np.array(v), lam, self.charts.memory)

    def _sound(self) -> bool:
        return bool(np.abs(self.charts.data.qvel).max() < FASTEST)

    def _broken(self, t: float) -> None:
        finite = bool(np.isfinite(self.charts.data.qvel).all())
        self._end(Outcome.DIVERGED if finite else Outcome.NOT_FINITE, t, "the state left what the scene can reach")

    def _end(self, outcome: Outcome, t: float, what: str) -> None:
        q, v = self.charts.state()
        self.outcome, self.message = outcome, f"t = {t:g} s, q = {list(q)}, v = {list(v)}: {what}."
