"""Stepping: fixed steps, or the same steps cut at the events of the rows.

One evaluation at the start of every step serves the record (lam belongs to that instant), the
test for events and the integrator's first stage: mj_forward, then the integrator alone, instead
of mj_step, which would evaluate twice.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Mode, Outcome
from crossbody.cases.control import NotFinite
from crossbody.engines._log import Modes
from crossbody.engines.mujoco._locate import Locator
from crossbody.engines.mujoco._scene import Scene
from crossbody.engines.mujoco._tape import Tape

ROUNDS = 20  # of rows that open and close each other at one instant
SAME_INSTANT = 100  # events in a row without the time moving on that make a cycle


def integrator(model: Any, data: Any) -> Callable[[], None]:
    """Return what mj_step does after its forward pass, for the integrator that the model names."""
    if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        return partial(mujoco.mj_RungeKutta, model, data, 4)
    if model.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER:
        return partial(mujoco.mj_Euler, model, data)
    return partial(mujoco.mj_implicit, model, data)


class March:
    """One run from the start of the scene.

    Attributes:
        steps: steps accepted.
        trials: steps tried to locate events.
        outcome: how it ended, with a message if not at its horizon.
        now: modes of the rows.
        still: events in a row at one instant.
    """

    def __init__(self, scene: Scene, tape: Tape, dt: float, max_steps: int) -> None:
        self.scene, self.tape, self.dt, self.max_steps = scene, tape, dt, max_steps
        self.advance = integrator(scene.model, scene.data)
        self.locator = Locator(scene, self.advance, tape.rewind) if scene.arm is not None else None
        self.steps = self.trials = self.still = 0
        self.outcome, self.message = Outcome.FINISHED, ""
        self.now: Modes = ()

    def run(self, t_end: float) -> None:
        """Step to t_end, s, a step cut to end there and at every instant at which the inputs change."""
        scene = self.scene
        scene.start()
        instants = [t for t in scene.instants if t < t_end]
        if instants and instants[0] == 0.0 and not self._change(instants.pop(0)):
            return
        self.now = self._settled(scene.modes())
        self.tape.switch(0.0, tuple(m if m == Mode.BILATERAL else int(Mode.FREE) for m in self.now), self.now)
        self.tape.record(scene.lam(), self.now)
        if why := scene.lost():
            self._end(Outcome.LOST, why)
            return
        for instant in instants:
            if not self._until(instant) or not self._change(instant):
                return
            before, self.now = self.now, self._settled(self.now)
            self.tape.switch(instant, before, self.now)  # an input that jumps may open or close a row
            self.tape.record(scene.lam(), self.now)
        self._until(t_end)

    def _change(self, t: float) -> bool:
        """Put in force what acts from t on, s; whether the run goes on."""
        try:
            self.scene.change(t)
        except NotFinite as failure:
            if not self.tape.n:  # behind the start the instant stands there already
                self.tape.record(self.scene.lam(), self.scene.modes())
            return self._end(Outcome.NOT_FINITE, str(failure).removesuffix("."))
        return True

    def _until(self, t_end: float) -> bool:
        """Step to t_end, s; whether the run goes on."""
        scene, data, opt, dt = self.scene, self.scene.data, self.scene.model.opt, self.dt
        model, forward, advance, record = scene.model, mujoco.mj_forward, self.advance, self.tape.record
        modes, safe, lam, lost = scene.modes, scene.safe, scene.lam, scene.lost
        now, t, last = self.now, float(data.time), t_end - dt * (1 + 1e-9)
        opt.timestep = dt
        while t_end - t >= 1e-9 * dt:
            if t > last:
                opt.timestep = t_end - t
            if self.steps == self.max_steps:
                return self._end(Outcome.STEP_LIMIT, f"{self.max_steps} steps of {dt:g} s were not enough")
            advance()
            forward(model, data)
            self.steps += 1
            before, t = t, data.time
            if not safe() or not t > before:
                return self._broken()
            if modes() != now:
                t = self._event(before)
                if self.still > SAME_INSTANT:
                    return self._end(Outcome.MODE_CYCLE, f"rows {now} and {self.now} switch for ever")
                now, opt.timestep = self.now, dt
            record(lam(), now)
            if why := lost():
                return self._end(Outcome.LOST, why)
        if scene.instants:
            data.time = t_end  # instants are met exactly, whatever the sum of the steps
        return True

    def _event(self, before: float) -> float:
        """Pass to the modes behind an event: located in the step, or as at its end. Returns the time."""
        scene, tape = self.scene, self.tape
        if self.locator is None:
            after = scene.modes()
        else:
            self.trials += self.locator.land(self.now)
            tape.record(scene.lam(), self.now)
            after = self._settled(self.locator.beyond(self.now))
        t: float = scene.data.time
        self.still = self.still + 1 if t - before < 1e-9 * self.dt else 0
        tape.switch(t, self.now, after)
        self.now = after
        return t

    def _settled(self, guess: Modes) -> Modes:
        """Open and close the rows, evaluate, and read the modes, until they are what was put in."""
        scene = self.scene
        for _ in range(ROUNDS):
            if scene.arm is not None:
                scene.arm(guess)
                # Called even when no row is there: a third of the cost of a free step.
                if scene.hook is not None and not scene.always:
                    mujoco.set_mjcb_control(scene.hook if any(guess) else None)
            mujoco.mj_forward(scene.model, scene.data)
            found = scene.modes()
            if found == guess or not scene.outlives:
                break
            guess = found
        return found

    def _broken(self) -> bool:
        data = self.scene.data
        if finite := all(bool(np.isfinite(x).all()) for x in (data.qpos, data.qvel, data.qacc)):
            self.tape.record(self.scene.lam(), self.now)
        return self._end(Outcome.DIVERGED if finite else Outcome.NOT_FINITE, "the state left what the scene can reach")

    def _end(self, outcome: Outcome, what: str) -> bool:
        data = self.scene.data
        self.outcome = outcome
        self.message = f"t = {data.time:g} s, q = {data.qpos.tolist()}, v = {data.qvel.tolist()}: {what}."
        return False
