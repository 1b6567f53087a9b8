"""Time stepping with impulses from ADMM: the LCP baseline, first order in the step (spec 4.3).

v+ = v + M^-1 ( dt (tau - b) + J^T p )        q+ = q + dt (theta v+ + (1 - theta) v)
0 <= p  perp  J v+ + e J v >= 0               rows whose gap is closed half a step ahead (Moreau and Jean)
(1 + a1 dt + k dt^2) J v+ = J v - k dt h      rows that are always on: implicit Euler of the law, k = a0 + a2 h^2

theta = 1/2, exact in free flight; 1 if a row is always on, or its position would not follow its own condition.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from crossbody.cases import Mode, Outcome
from crossbody.cases.arrays import Floats
from crossbody.engines._log import Log, Modes
from crossbody.engines._machines import first_modes
from crossbody.engines.pinocchio._rows import PinRows, mass_matrix
from crossbody.engines.pinocchio._scene import Points

FREE, CONTACT, BILATERAL = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BILATERAL)
WORST = 1e-6
"""Largest residual of the complementarity conditions, m/s, recomputed here, that still counts as solved."""


class TimeStepper:
    """One run.

    Attributes:
        rows: the mechanism; `points` its rows as Pinocchio's constraints, whose third row is the normal (`Scene`).
        e: restitution of every row.
        steps, unsolved, iterations: counters.
        outcome, message: how it ended.
    """

    def __init__(self, rows: PinRows, points: Points, e: list[float], tol: float, log: Log, max_steps: int) -> None:
        self.rows, self.points, self.e, self.log, self.max_steps = rows, points, e, log, max_steps
        self.settings = pin.ADMMSolverSettings()
        self.settings.max_iterations = 1000
        for name in ("absolute_feasibility_tol", "absolute_complementarity_tol"):
            setattr(self.settings, name, tol)
        for name in ("relative_feasibility_tol", "relative_complementarity_tol"):
            setattr(self.settings, name, 0.0)
        self.steps = self.unsolved = self.iterations = 0
        self.outcome, self.message = Outcome.FINISHED, ""

    def run(self, q0: Floats, v0: Floats, t_end: float, dt: float) -> None:
        """Step from (q0, v0) to t_end, s; lam is the impulse of the step before each instant over its length."""
        t, q, v = 0.0, np.array(q0), np.array(v0)
        modes = first_modes(self.rows)
        theta = 1.0 if BILATERAL in modes else 0.5
        self.log.add(t, q, v, np.zeros(self.rows.nc), modes)
        while t_end - t > 1e-9 * dt:
            if self.steps >= self.max_steps:
                return self._end(Outcome.STEP_LIMIT, t, q, v, f"{self.max_steps} steps of {dt:g} s were not enough")
            tau = min(dt, t_end - t)
            closed = self._closed(q, v, tau)
            new, p = self._step(q, v, closed, tau)
            if not np.isfinite(new).all():
                return self._end(Outcome.NOT_FINITE, t, q, v, "the next velocity is not finite")
            q, v, t = q + tau * (theta * new + (1.0 - theta) * v), new, t + tau
            self.steps += 1
            modes = self._modes(t, modes, p)
            self.log.add(t, q, v, p / tau, modes)
        return None

    def _closed(self, q: Floats, v: Floats, dt: float) -> list[int]:
        ahead = self.rows.heights(q + 0.5 * dt * v)
        return [i for i, u in enumerate(self.rows.unilateral) if not u or ahead[i] <= 0.0]

    def _step(self, q: Floats, v: Floats, closed: list[int], dt: float) -> tuple[Floats, Floats]:
        """Velocity behind the step, and the impulse of every row (nc,), N s."""
        rows, p = self.rows, np.zeros(self.rows.nc)
        free = v + dt * rows.accelerate(q, v, (FREE,) * rows.nc)[0]
        if not closed:
            return free, p
        J = rows.jacobian(q)
        offset = np.array([self._offset(q, v, J, i, dt) for i in closed])
        p[closed] = self._impulses(q, J[closed] @ free + offset, closed)
        new = free + np.linalg.solve(mass_matrix(rows.model, rows.data, q), J.T @ p)
        gap_rate = J[closed] @ new + offset
        self._check(p[closed], gap_rate, closed)
        return new, p

    def _offset(self, q: Floats, v: Floats, J: Floats, i: int, dt: float) -> float:
        """What is added to J v+ in the condition of row i, m/s."""
        hd, rows = float(J[i] @ v), self.rows
        if rows.unilateral[i]:
            return self.e[i] * hd
        h = float(rows.heights(q)[i])
        a0, a1, a2 = (float(x) for x in rows.slow[:, i])
        k = a0 + a2 * h * h
        return (k * dt * h - hd) / (1.0 + a1 * dt + k * dt * dt)

    def _impulses(self, q: Floats, g: Floats, closed: list[int]) -> Floats:
        """Solve 0 <= p perp G p + g >= 0 (or G p + g = 0) with a Delassus operator made anew: ADMM changes it."""
        model, data = self.rows.model, self.rows.data
        models, datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
        points = self.points(q) if callable(self.points) else self.points
        for i in closed:
            models.append(points[i])
            datas.append(points[i].createData())
        pin.crba(model, data, q, pin.Convention.WORLD)
        for m, d in zip(models, datas, strict=True):
            m.calc(model, data, d)
        factors = pin.ConstraintCholeskyDecomposition(model, data, models, datas)
        factors.compute(model, data, models, datas, 0.0)
        delassus = factors.getDelassusOperatorCholeskyExpression()
        offset = np.zeros(3 * len(closed))
        offset[2::3] = g
        solver, result = pin.ADMMConstraintSolver(len(offset)), pin.ADMMSolverResult()
        solver.solve(delassus, offset, models, datas, self.settings, result)
        self.iterations += int(result.iterations)
        return np.array(result.retrieveConstraintImpulses())[2::3]

    def _check(self, p: Floats, rate: Floats, closed: list[int]) -> None:
        """Count a step whose conditions do not hold, whatever the solver says of itself."""
        for i, impulse, w in zip(closed, p, rate, strict=True):
            wrong = abs(w) if not self.rows.unilateral[i] else max(-w, -impulse, min(abs(w), abs(impulse)))
            if not wrong <= WORST:
                self.unsolved += 1
                return

    def _modes(self, t: float, before: Modes, p: Floats) -> Modes:
        after = tuple(m if m == BILATERAL else CONTACT if p[i] > 0.0 else FREE for i, m in enumerate(before))
        self.log.switch(t, before, after)
        return after

    def _end(self, outcome: Outcome, t: float, q: Floats, v: Floats, what: str) -> None:
        self.outcome = outcome
        self.message = f"t = {t:g} s, q = {q.tolist()}, v = {v.tolist()}: {what}."
