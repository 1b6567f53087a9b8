"""Fixed steps of the maze of segments, as a user would take them: torque once a step, nothing located."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Event, Mode, Outcome
from crossbody.cases.arrays import Floats
from crossbody.engines._maze.log import MazeLog
from crossbody.engines._maze.machine import MazeMachine, Settled, switches
from crossbody.engines._maze.memory import CONTACT, FREE, Memory
from crossbody.engines._maze.rows import ABOVE, BELOW, NORMALS, SLIP_OF
from crossbody.engines._maze.scene import BallMaze
from crossbody.engines.mujoco._maze_contacts import ContactForces

State = tuple[float, ...]
FASTEST = 1e4
"""Speed at which a run has diverged, rad/s and m/s."""


class MazeSteps:
    """One run.

    Attributes:
        memory: rows in contact, place and controller, as seen at the start of a step.
        steps: steps taken.
        outcome, message: how it ended.
    """

    def __init__(
        self, maze: BallMaze, model: Any, data: Any, rings: Sequence[int], log: MazeLog, dt: float, limit: int
    ) -> None:
        self.maze, self.model, self.data, self.log, self.dt, self.limit = maze, model, data, log, dt, limit
        self.forces = ContactForces(maze, model, data, rings)
        self.machine = MazeMachine(maze, _no_equations)
        self.steps, self.outcome, self.message = 0, Outcome.FINISHED, ""
        self.memory: Memory

    def run(self, q0: Floats, v0: Floats, t_end: float) -> None:
        """Step from (q0, v0) to t_end, s."""
        model, data, t = self.model, self.data, 0.0
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = q0, v0
        self.memory = self.machine.untouched(tuple(q0.tolist()))
        while self.outcome.ok:
            model.opt.timestep = min(self.dt, t_end - t) or self.dt
            mujoco.mj_step1(model, data)
            q, v = tuple(data.qpos.tolist()), tuple(data.qvel.tolist())
            data.qfrc_applied[0] = self.maze.torque(q, v, self.memory)
            brake = self.maze.braking(v, self.memory)
            data.qfrc_applied[0], data.qfrc_applied[3] = data.qfrc_applied[0] - brake, brake
            mujoco.mj_step2(model, data)
            self._look(t, q, v)
            if t_end - t <= 1e-9 * self.dt or not self.outcome.ok:
                return
            self.steps += 1
            t += model.opt.timestep
            if not np.abs(data.qvel).max() < FASTEST:
                finite = bool(np.isfinite(data.qvel).all())
                self._end(Outcome.DIVERGED if finite else Outcome.NOT_FINITE, t, q, v, "the state left all bounds")
            elif self.steps >= self.limit:
                self._end(Outcome.STEP_LIMIT, t, q, v, f"{self.limit} steps of {self.dt:g} s were not enough")

    def _look(self, t: float, q: State, v: State) -> None:
        """Record the start of the step that was just taken, and what it shows to the controller."""
        before = self.memory
        seen = self.machine.seen(before, q)
        lam = self.forces.multipliers(q, seen.place)
        modes = [CONTACT if i in NORMALS and force > 0.0 else FREE for i, force in enumerate(lam)]
        for face, slip in SLIP_OF.items() if self.maze.rows.rolling else ():
            modes[slip] = modes[face]
        touched = CONTACT in (modes[BELOW], modes[ABOVE])
        self.memory = self.machine.controlled(replace(seen, modes=tuple(modes)), q, touched)
        events = [
            Event(t=t, contact=i, before=Mode(before.modes[i]), after=Mode(modes[i]))
            for i in NORMALS if before.modes[i] != modes[i]
        ]  # fmt: skip
        settled = Settled(self.memory, tuple(events), switches(t, before, self.memory) if t else ())
        self.log.pass_to(settled)
        self.log.note(t, np.array(q), np.array(v), lam, self.memory)
        if self.machine.strayed(q, self.memory):
            self._end(Outcome.LOST, t, q, v, "the ball is more than 60 degrees from the top")

    def _end(self, outcome: Outcome, t: float, q: State, v: State, what: str) -> None:
        self.outcome, self.message = outcome, f"t = {t:g} s, q = {list(q)}, v = {list(v)}: {what}."


def _no_equations(q: State, v: State, memory: Memory) -> tuple[Floats, Floats]:
    """The machine is asked about place and controller alone."""
    raise AssertionError("fixed steps switch no rows")
