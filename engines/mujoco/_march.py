"""Stepping: fixed steps, or the same cut at the first event, into a log that MuJoCo writes itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Acts, Mode, Outcome
from crossbody.cases.arrays import Floats
from crossbody.cases.brent import brent
from crossbody.cases.control import NotFinite
from crossbody.engines._log import Log, Modes
from crossbody.engines.mujoco._scene import Prepared

FREE, CONTACT, BALLISTIC = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BALLISTIC)
COLLISION, SEPARATED = int(Mode.COLLISION), int(Mode.COLLISION_SEPARATION)
TOGETHER = 1e-12
"""Part of a step within which rows cross together: which of them is located first is rounding."""
ULPS = 4.0 * float(np.finfo(np.float64).eps)
Sign = tuple[int, int, float]
"""(row, 0 for its gap or 1 for its multiplier, sign that it has in its present mode)."""
WATCHED: dict[int, tuple[tuple[int, float], ...]] = {
    FREE: ((0, 1.0),),
    **dict.fromkeys((CONTACT, COLLISION), ((0, -1.0), (1, 1.0))),
    **dict.fromkeys((BALLISTIC, SEPARATED), ((0, -1.0), (1, -1.0))),
}


OUTLIVING = WATCHED | dict.fromkeys((CONTACT, COLLISION), ((1, 1.0),))
"""Of rows that push above their surface too until their multiplier is zero, as the law has it."""
STATE = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)  # as its own type it costs three times the copy
"""time, qpos, qvel, act, ...: what a step starts from, inputs apart."""
ROUNDS = 20  # of rows that open and close each other at one instant
SAME_INSTANT = 100  # events in a row without the time moving on that make a cycle


def signs(modes: Modes, watched: Mapping[int, tuple[tuple[int, float], ...]] = WATCHED) -> list[Sign]:
    """What must keep its sign while the modes last."""
    return [(i, which, sign) for i, mode in enumerate(modes) for which, sign in watched.get(mode, ())]


def _root(value: Callable[[float], float], sign: float, full: float) -> float:
    """Return when a value that has a sign at first has it no more, at the latest behind the full step.

    A trial starts from an evaluation of its own, and may just miss what the step passed.
    """
    last = value(full)
    if sign * last > 0.0:
        return full
    return brent(lambda tau: last if tau == full else value(tau), 0.0, full, 1e-15 * full, ULPS)


class Locator:
    """Finds and lands on the first instant of a step at which a row leaves its mode.

    The rows keep the equations of their modes in every trial (a closed one outlives its gap), so that the
    end of a trial is a smooth function of its length and the order of the integrator survives the event.
    """

    def __init__(self, scene: Prepared, advance: Callable[[], None], rewind: Callable[[], None]) -> None:
        assert scene.margins is not None
        self.model, self.data, self.margins = scene.model, scene.data, scene.margins
        self.advance, self.rewind, self.outlives, self.entered = advance, rewind, scene.outlives, scene.entered
        self.watched = OUTLIVING if scene.outlives else WATCHED

    def beyond(self, modes: Modes) -> Modes:
        """The modes just behind the event: those rows that crossed are taken by their gap and multiplier."""
        found = [
            mode if mode not in WATCHED or (self.outlives and mode in (CONTACT, COLLISION) and lam > 0.0)
            else FREE if h > 0.0 else CONTACT if lam > 0.0 else BALLISTIC
            for mode, (h, lam) in zip(modes, self.margins(), strict=True)
        ]  # fmt: skip
        return self.entered(found)

    def land(self, modes: Modes) -> int:
        """Redo the step so that it ends just behind its first event; returns the trials that it took.

        It ends behind all rows that cross together there: of those that one motion moves alike
        any may be the one that bears. A change of constants alone (COLLISION to CONTACT) crosses
        nothing: it is taken at the end of the step.
        """
        if not (crossed := self._crossed(modes)):
            return 0
        full, trials = self.model.opt.timestep, 0

        def value(tau: float, row: int, which: int) -> float:
            nonlocal trials
            trials += 1
            self._redo(tau)
            return self.margins()[row][which]

        roots = []
        for row, which, sign in crossed:
            start = value(0.0, row, which)
            bracketed = sign * start > 0.0
            roots.append(_root(partial(value, row=row, which=which), sign, full) if bracketed else 0.0)
        tau, nudge = min(roots), 1e-16 * full
        together = {one for one, root in zip(crossed, roots, strict=True) if root <= tau + TOGETHER * full}
        self._redo(tau)
        while not together.issubset(self._crossed(modes)) and tau < full:
            tau, nudge = min(tau + nudge, full), 2.0 * nudge
            self._redo(tau)
            trials += 1
        return trials

    def _crossed(self, modes: Modes) -> list[Sign]:
        now = self.margins()
        # A gap of exactly 0 is closed, a multiplier of exactly 0 does not push.
        return [s for s in signs(modes, self.watched) if (now[s[0]][s[1]] > 0.0) == (s[2] < 0.0)]

    def _redo(self, tau: float) -> None:
        self.rewind()
        self.model.opt.timestep = tau
        mujoco.mj_forward(self.model, self.data)
        if tau > 0.0:
            self.advance()
            mujoco.mj_forward(self.model, self.data)


class Tape(Log):
    """One row an instant (capacity, size of the state), of which the first `n` are written.

    The last is also the state to which a step returns that overran an event.
    """

    def __init__(self, model: Any, data: Any, capacity: int) -> None:
        super().__init__()
        self.model, self.data, self.n = model, data, 0
        self.rows: Floats = np.empty((max(capacity, 16), mujoco.mj_stateSize(model, STATE)))

    def record(self, lam: Any, mode: Modes) -> None:
        """Append the present state."""
        if self.n == len(self.rows):
            self.rows = np.concatenate((self.rows, np.empty_like(self.rows)))
        mujoco.mj_getState(self.model, self.data, self.rows[self.n], STATE)
        self.n += 1
        self.lam.append(lam)
        self.mode.append(mode)

    def rewind(self) -> None:
        """Put the last recorded state back."""
        mujoco.mj_setState(self.model, self.data, self.rows[self.n - 1], STATE)

    def columns(self) -> tuple[Floats, Floats, Floats]:
        """Times (n,), qpos (n, nq), qvel (n, nv)."""
        nq, nv, rows = self.model.nq, self.model.nv, self.rows[: self.n]
        return rows[:, 0], rows[:, 1 : 1 + nq], rows[:, 1 + nq : 1 + nq + nv]


def integrator(model: Any, data: Any) -> Callable[[], None]:
    """Return what mj_step does after its forward pass, for the integrator that the model names."""
    if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        return partial(mujoco.mj_RungeKutta, model, data, 4)
    if model.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER:
        return partial(mujoco.mj_Euler, model, data)
    return partial(mujoco.mj_implicit, model, data)


def acts(model: Any, followed: bool) -> Acts:
    """Return when forces act that are evaluated at the end of every step: over the next one, but in Runge-Kutta's.

    Args:
        model: with its integrator.
        followed: whether samples tell both sides of every jump.
    """
    if model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
        return Acts.BEHIND
    return Acts.AT if followed else Acts.GRID


class March:
    """One run from the start of the scene.

    Attributes:
        steps: steps accepted.
        trials: steps tried to locate events.
        outcome: how it ended, with a message if not at its horizon.
        now: modes of the rows.
        still: events in a row at one instant.
    """

    def __init__(self, scene: Prepared, tape: Tape, dt: float, max_steps: int) -> None:
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
        always_on = all(mode == Mode.BILATERAL for mode in self.now)
        self.tape.acts = acts(scene.model, always_on or self.locator is not None)
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
                return self._end(Outcome.STEP_LIMIT, f"{self.max_steps} steps of {dt:g} s did not reach the horizon")
            advance()
            forward(model, data)
            self.steps += 1
            before, t = t, data.time
            if not safe() or not t > before:
                return self._broken()
            if modes() != now:
                t = self._event(before)
                if self.still > SAME_INSTANT:
                    return self._end(Outcome.MODE_CYCLE, f"rows {now} and {self.now} switch forever")
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
        return self._end(
            Outcome.DIVERGED if finite else Outcome.NOT_FINITE, "the state left the region that the scene can reach"
        )

    def _end(self, outcome: Outcome, what: str) -> bool:
        data = self.scene.data
        self.outcome = outcome
        self.message = f"t = {data.time:g} s, q = {data.qpos.tolist()}, v = {data.qvel.tolist()}: {what}."
        return False
