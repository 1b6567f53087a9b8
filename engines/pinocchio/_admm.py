"""Time stepping with impulses from ADMM: the LCP baseline, first order in the step (docs/explanation/engines.md).

v+ = v + M^-1 ( dt (tau - b) + J^T p )        q+ = q + dt (theta v+ + (1 - theta) v)
0 <= p  perp  J v+ + e J v >= 0               rows whose gap is closed half a step ahead (Moreau and Jean)
(1 + a1 dt + k dt^2) J v+ = J v - k dt h      rows that are always on: implicit Euler of the law, k = a0 + a2 h^2

theta = 1/2, exact in free flight; 1 if a row is always on, or its position would not follow its
own condition.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Acts, Mode, Outcome
from crossbody.cases.arrays import Floats
from crossbody.engines._log import Log, Modes
from crossbody.engines._machines import first_modes
from crossbody.engines.pinocchio._contacts import Points
from crossbody.engines.pinocchio._rows import PinRows

FREE, CONTACT, BILATERAL = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BILATERAL)
WORST = 1e-6
"""Largest residual of the complementarity conditions, m/s, recomputed here, that still counts as solved."""


class Touching:
    """Impulses of rows that are closed, by ADMM to an absolute tolerance, m/s and N s."""

    def __init__(self, rows: PinRows, points: Points, tol: float) -> None:
        self.rows, self.points, self.iterations = rows, points, 0
        self.settings = pin.ADMMSolverSettings()
        self.settings.max_iterations = 1000
        for name in ("absolute_feasibility_tol", "absolute_complementarity_tol"):
            setattr(self.settings, name, tol)
        for name in ("relative_feasibility_tol", "relative_complementarity_tol"):
            setattr(self.settings, name, 0.0)
        self._made: dict[tuple[int, ...], Any] = {}

    def impulses(self, q: Floats, g: Floats, closed: tuple[int, ...]) -> Floats:
        """Solve 0 <= p perp G p + g >= 0 (or G p + g = 0) with a new Delassus operator: ADMM changes it."""
        made = self._made.get(closed) or self._problem(q, closed)
        if self.points.steady:
            self._made[closed] = made
        models, datas, factors, solver, offset = made
        factors.compute(self.rows.model, self.rows.data, models, datas, 0.0)
        offset[2::3] = g
        result = pin.ADMMSolverResult()
        solver.solve(
            factors.getDelassusOperatorCholeskyExpression(), offset, models, datas, self.settings, result
        )  # fmt: skip
        self.iterations += int(result.iterations)
        return np.array(result.retrieveConstraintImpulses())[2::3]

    def _problem(self, q: Floats, closed: Sequence[int]) -> tuple[Any, ...]:
        """Return constraints and their data at q, factors of M and G to be, a solver, and room for g."""
        model, data = self.rows.model, self.rows.data
        models, datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
        for point in self.points(q, closed):
            models.append(point)
            datas.append(point.createData())
        pin.crba(model, data, q, pin.Convention.WORLD)
        for m, d in zip(models, datas, strict=True):
            m.calc(model, data, d)
        factors = pin.ConstraintCholeskyDecomposition(model, data, models, datas)
        return models, datas, factors, pin.ADMMConstraintSolver(3 * len(closed)), np.zeros(3 * len(closed))


class TimeStepper:
    """One run of steps with a restitution of every row, to an absolute tolerance, m/s and N s."""

    def __init__(self, rows: PinRows, points: Points, e: list[float], tol: float, log: Log, max_steps: int) -> None:
        self.rows, self.log, self.max_steps = rows, log, max_steps
        self.touching, self.e, self.laws = Touching(rows, points, tol), e, rows.slow.T.tolist()
        self.held = tuple(i for i, opens in enumerate(rows.unilateral) if not opens)
        self.none = np.zeros(rows.nc)
        self.none.flags.writeable = False
        self.steps = self.unsolved = 0
        self.outcome, self.message = Outcome.FINISHED, ""

    @property
    def iterations(self) -> int:
        """Iterations of all steps."""
        return self.touching.iterations

    def run(self, q0: Floats, v0: Floats, t_end: float, dt: float) -> None:
        """Step from (q0, v0) to t_end, s; lam is the impulse of the step before over its length."""
        t, q, v = 0.0, np.array(q0), np.array(v0)
        modes = first_modes(self.rows)
        self.log.acts = Acts.BEFORE
        theta = 1.0 if BILATERAL in modes else 0.5
        self.log.add(t, q, v, self.none, modes)
        while t_end - t > 1e-9 * dt:
            if self.steps >= self.max_steps:
                return self._end(
                    Outcome.STEP_LIMIT, t, q, v, f"{self.max_steps} steps of {dt:g} s did not reach the horizon"
                )
            tau = min(dt, t_end - t)
            closed = self._closed(q, v, tau)
            new, p = self._step(q, v, closed, tau)
            if not math.isfinite(new.sum()):
                return self._end(Outcome.NOT_FINITE, t, q, v, "the next velocity is not finite")
            q, v, t = q + tau * (theta * new + (1.0 - theta) * v), new, t + tau
            self.steps += 1
            modes = self._modes(t, modes, p)
            self.log.add(t, q, v, p / tau, modes)
        return None

    def _closed(self, q: Floats, v: Floats, dt: float) -> tuple[int, ...]:
        if len(self.held) == self.rows.nc:
            return self.held
        ahead = self.rows.heights(q + 0.5 * dt * v).tolist()
        return tuple(i for i, u in enumerate(self.rows.unilateral) if not u or ahead[i] <= 0.0)

    def _step(self, q: Floats, v: Floats, closed: tuple[int, ...], dt: float) -> tuple[Floats, Floats]:
        """Velocity behind the step, and the impulse of every row (nc,), N s."""
        rows = self.rows
        free = v + dt * rows.accelerate(q, v, (FREE,) * rows.nc)[0]
        if not closed:
            return free, self.none
        which = slice(None) if len(closed) == rows.nc else list(closed)
        H, p = rows.jacobian(q)[which], np.zeros(rows.nc)
        offset = np.array(self._offsets(q, (H @ v).tolist(), closed, dt))
        p[which] = part = self.touching.impulses(q, H @ free + offset, closed)
        new = v + dt * pin.aba(rows.model, rows.data, q, v, rows.tau + H.T @ (part / dt))
        self._check(part, H @ new + offset, closed)
        return new, p

    def _offsets(self, q: Floats, rates: list[float], closed: tuple[int, ...], dt: float) -> list[float]:
        """What is added to J v+ in the condition of every closed row, m/s."""
        h = self.rows.heights(q).tolist() if self.held else ()
        return [
            self.e[i] * hd if self.rows.unilateral[i] else self._held(h[i], hd, self.laws[i], dt)
            for i, hd in zip(closed, rates, strict=True)
        ]

    def _held(self, h: float, hd: float, law: Sequence[float], dt: float) -> float:
        a0, a1, a2 = law
        k = a0 + a2 * h * h
        return (k * dt * h - hd) / (1.0 + a1 * dt + k * dt * dt)

    def _check(self, p: Floats, rate: Floats, closed: tuple[int, ...]) -> None:
        """Count a step whose conditions do not hold, whatever the solver says of itself."""
        for i, impulse, w in zip(closed, p.tolist(), rate.tolist(), strict=True):
            wrong = abs(w) if not self.rows.unilateral[i] else max(-w, -impulse, min(abs(w), abs(impulse)))
            if not wrong <= WORST:
                self.unsolved += 1
                return

    def _modes(self, t: float, before: Modes, p: Floats) -> Modes:
        if p is self.none and CONTACT not in before:
            return before
        pushes = p.tolist()
        after = tuple(m if m == BILATERAL else CONTACT if pushes[i] > 0.0 else FREE for i, m in enumerate(before))
        if after != before:
            self.log.switch(t, before, after)
        return after

    def _end(self, outcome: Outcome, t: float, q: Floats, v: Floats, what: str) -> None:
        self.outcome = outcome
        self.message = f"t = {t:g} s, q = {q.tolist()}, v = {v.tolist()}: {what}."
