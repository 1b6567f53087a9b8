"""Integration of rows that are always on: CVODE from one change of the inputs to the next, without root finding."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sksundae.cvode import CVODE

from crossbody.cases import Mode, Outcome
from crossbody.cases.arrays import Floats
from crossbody.engines._log import Chart, Log, Modes, Observe
from crossbody.reference.sundials.quiet import quiet

PER_SOLVE = 100_000
"""Internal steps that CVODE may take before it returns; it returns after each, so this never binds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Smooth:
    """A mechanism without contacts that open.

    Attributes:
        q0, v0 (n,): start in the engine's coordinates.
        accelerate: (t, q, v) -> v' (n,) and lam (nc,), N.
        nc: number of rows.
        instants: when the inputs change, s, increasing.
        change: (t, q, v) puts in force what acts from such an instant on.
        reset: back to the start: no input, no memory.
        chart: positions and velocities of the engine -> those of the case.
        observe: gaps and energies of many states of the model.
        audit: the physics read back from the model.
    """

    q0: Floats
    v0: Floats
    accelerate: Callable[[float, Floats, Floats], tuple[Floats, Floats]]
    nc: int
    instants: Sequence[float]
    change: Callable[[float, Floats, Floats], None]
    reset: Callable[[], None]
    chart: Chart
    observe: Observe
    audit: Any


class SmoothFlow:
    """One run.

    Attributes:
        steps, rhs: steps and right-hand sides so far.
        outcome, message: how it ended.
    """

    def __init__(self, scene: Smooth, log: Log, rtol: float, method: str, max_steps: int) -> None:
        self.scene, self.log, self.max_steps = scene, log, max_steps
        self.n = len(scene.q0)
        self.q, self.v = np.empty(self.n), np.empty(self.n)  # Pinocchio and CVODE do not share memory
        self.steps = self.rhs = 0
        self.outcome, self.message = Outcome.FINISHED, ""
        self.modes: Modes = (int(Mode.BILATERAL),) * scene.nc

        def rhs(t: float, y: NDArray[Any], yp: NDArray[Any]) -> None:  # CVODE hangs attributes on it
            self._rhs(t, y, yp)

        # Angles in rad, rates in rad/s: one tolerance serves both, relative and absolute.
        self.solver = CVODE(rhs, rtol=rtol, atol=rtol, method=method, max_num_steps=PER_SOLVE)

    def run(self, t_end: float) -> None:
        """Integrate to t_end, s."""
        self.scene.reset()
        with quiet() as said:
            self._run(t_end)
        words = " ".join(said.getvalue().split())
        self.message = f"{self.message} CVODE: {words}" if words else self.message

    def _run(self, t_end: float) -> None:
        scene = self.scene
        y: Floats = np.concatenate((scene.q0, scene.v0))
        stops = [*scene.instants, t_end] if scene.instants else [t_end]
        t = 0.0
        if stops[0] == 0.0:
            scene.change(stops.pop(0), scene.q0, scene.v0)
        for stop in stops:
            self._record(t, y)
            y = self._until(t, y, stop)
            if not self.outcome.ok:
                return
            t = stop
            if t < t_end:
                scene.change(t, y[: self.n].copy(), y[self.n :].copy())

    def _until(self, t: float, y: Floats, stop: float) -> Floats:
        """The state at `stop`, s; every step is recorded."""
        solver = self.solver
        solver.init_step(t, y)
        while t < stop:
            if self.steps >= self.max_steps:
                return self._end(Outcome.STEP_LIMIT, t, y, f"{self.max_steps} steps were not enough")
            step = solver.step(stop, method="onestep", tstop=stop)
            self.steps += 1
            if not step.success or not np.isfinite(step.y).all():
                bad = Outcome.STEP_TOO_SMALL if np.isfinite(self.v).all() else Outcome.NOT_FINITE
                return self._end(bad, t, y, "CVODE gave up")
            t, y = float(step.t), np.array(step.y)
            self._record(t, y)
        return y

    def _record(self, t: float, y: Floats) -> None:
        q, v = y[: self.n], y[self.n :]
        self.log.add(t, q, v, self.scene.accelerate(t, q, v)[1], self.modes)

    def _rhs(self, t: float, y: NDArray[Any], yp: NDArray[Any]) -> None:
        n = self.n
        self.rhs += 1
        self.q[:], self.v[:] = y[:n], y[n:]
        yp[:n] = self.v
        yp[n:] = self.scene.accelerate(t, self.q, self.v)[0]

    def _end(self, outcome: Outcome, t: float, y: Floats, what: str) -> Floats:
        self.outcome = outcome
        self.message = f"t = {t:g} s, q = {y[: self.n].tolist()}, v = {y[self.n :].tolist()}: {what}."
        return y
