"""A run with friction by SUNDIALS: CVODE between events, and every step searched for them."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.cases import Outcome
from crossbody.cases.brent import brent
from crossbody.reference.kinds import Floats, Floats2
from crossbody.reference.sundials import roots
from crossbody.reference.sundials.arcs import CHUNK, FAR, ORDER, ORDER_IN_CONTACT, SHARE, Fired, State
from crossbody.reference.sundials.dense import DenseStep
from crossbody.reference.sundials.equations import ULP, Ended, Equations
from crossbody.reference.sundials.friction_alarms import Alarm, values
from crossbody.reference.sundials.friction_machine import FrictionMachine
from crossbody.reference.sundials.level_machine import SAME_INSTANT, LevelMachine, View
from crossbody.reference.sundials.run import CAUTION, SundialsRun
from crossbody.reference.sundials.solvers import CVODE
from crossbody.reference.sundials.touches import Touches
from crossbody.reference.systems import absent

APART, APART_PART = 1e-7, 1e-4  # of positions, and part of a slip without a direction: steps of differences
RESOLVED = 64.0 * float(np.finfo(np.float64).eps)  # part of a velocity by which such a step differs from none
ACCOUNTED = 0.3  # part of the solver's tolerance where an account is kept: the work of forces that change their ways
STIFF = 10.0  # times the fastest pole of the rows


class SlidingArc(DenseStep):
    """One smooth arc: CVODE on the reduced equations, step by step, by Adams' formulas or backward differentiation.

    Friction turns a slip at a rate that goes as 1/|v_t|. CVODE keeps the matrix of Newton's method for twenty steps;
    one from when a slip was slower hides what lies across the slip, and the solver does not see it. So it begins anew
    whenever a slip has doubled that turns fast.

    Args:
        run: whose machine and options hold.
        start: where the arc begins.
        longest: bound on the step, s.
    """

    def __init__(self, run: FrictionRun, start: State, longest: float) -> None:
        self.run, system = run, run.system
        self.nq, self.ny = system.nq, system.nq + system.n
        y = np.concatenate([start.q, start.v, start.z])
        share = SHARE * (ACCOUNTED if len(start.z) else 1.0)
        tolerance = share * run.options.tolerance
        atol = np.concatenate([share * run.options.absolute(system), np.full(len(start.z), tolerance * run.scale)])
        self.turning = run.friction.turning(start.t, start.q, start.v)
        fastest, pole = max((rate for _, rate in self.turning.values()), default=0.0), self._pole()
        stiff = fastest > STIFF * pole
        order = 5 if stiff else ORDER_IN_CONTACT if run.friction.contacts() else ORDER
        self.solver = CVODE(
            self._slopes, method="BDF" if stiff else "Adams", rtol=share * run.options.rtol, atol=atol,
            max_num_steps=CHUNK, max_step=longest if np.isfinite(longest) else 0.0, max_order=order,
            jacfn=self._jacobian if self.turning else None,
        )  # fmt: skip
        self.solver.init_step(start.t, y)
        self._stand(start.t, y)

    def _slopes(self, t: float, y: Floats, yp: Floats) -> None:
        run, q, v = self.run, np.array(y[: self.nq]), np.array(y[self.nq : self.ny])
        run.tried += 1
        vd, lam = run.friction.accelerate(t, q, v)
        if run.system.velocity is None:
            yp[: self.nq] = v
        else:
            run.system.velocity(t, q, v, run.equations.p, run.qd)
            yp[: self.nq] = run.qd
        yp[self.nq : self.ny] = vd
        if len(y) > self.ny:
            yp[self.ny :] = run.equations.powers(t, q, v, lam)

    def _jacobian(self, t: float, y: Floats, yp: Floats, J: Floats2) -> None:
        """Differences over velocities that are small beside slips without a direction: the library's are not.

        By far: a direction that turns by an angle loses its square along itself, which over a step of a tenth stands
        as a rate of thousands of thousands, and Newton's method takes slips that begin to stand. By no more than that:
        a slip is a difference of velocities that are rounded.
        """
        moved, slopes, small = np.array(y), np.empty(len(y)), self.run.friction.small
        J[:] = 0.0
        for k in range(self.ny):
            step = APART * max(1.0, abs(y[k])) if k < self.nq else max(APART_PART * small, RESOLVED * abs(y[k]))
            moved[k] = y[k] + step
            self._slopes(t, moved, slopes)
            J[:, k] = (slopes - yp) / (moved[k] - y[k])
            moved[k] = y[k]

    def _pole(self) -> float:
        """Fastest pole of the laws in contact, 1/s; 1 without contacts."""
        laws = self.run.friction.sliding.slow[[*self.run.friction.contacts(), *self.run.friction.sliding.loops]]
        return float(max(1.0, np.sqrt(laws[:, 0]).max(initial=0.0), laws[:, 1].max(initial=0.0)))

    @property
    def stiff(self) -> bool:
        """Whether a slip that turns fast has doubled since the arc began."""
        if not any(rate > self._pole() for _, rate in self.turning.values()):
            return False
        s = self.at(self.t1)
        now = self.run.friction.slips(s.t, s.q, s.v)
        return any(now[i] > 2.0 * size for i, (size, _) in self.turning.items())

    def step(self, stop: float, target: float) -> tuple[State, Fired]:
        """Go on by one step, or to the first alarm inside it."""
        self.t0, self.y0, self._defect = self.t1, self.y1, None
        done = self.solver.step(stop, "onestep", stop)
        if done.status < 0:
            s = self.at(self.t0)
            jamming = self.run.friction.jamming(s.t, s.q, s.v)
            raise Ended(Outcome.PAINLEVE if jamming else Outcome.STEP_TOO_SMALL, jamming)
        size = float(done.y.dot(done.y))
        if not size < FAR**2:
            raise Ended(Outcome.DIVERGED if np.isfinite(done.y).all() else Outcome.NOT_FINITE)
        self.t1, self.y1 = float(done.t), done.y.copy()
        end, fired = self._search()
        state = self.at(end)
        if not fired:
            self.run.friction.renew(state.q, state.v, state.t)
            fired = self.run.friction.stopped(state.t, state.q, state.v)
        rows: Any = [alarm for alarm in fired if alarm.tells != "WATCH"]
        return state, Fired(rows, [alarm.row for alarm in fired if alarm.tells == "WATCH"])

    def _search(self) -> tuple[float, list[Alarm]]:
        """The first instant of the step at which alarms fire, and these; its end if none does."""
        machine = self.run.friction
        if not machine.alarms:
            return self.t1, []

        def evaluated(times: list[float]) -> Floats:
            y = np.array([self._between(t) for t in times])
            return values(machine, times, y[:, : self.nq], y[:, self.nq : self.ny])

        terms = roots.Together(evaluated)
        above = roots.stay_above(terms, self.t0, self.t1)
        end, found = self.t1, list[tuple[float, Alarm]]()
        for alarm in machine.alarms:
            if above[alarm.terms].any():
                continue

            def own(times: list[float], alarm: Alarm = alarm) -> Floats:
                return np.array([found[alarm.terms] for found in terms.at(times)])

            precision = max(64.0 * ULP, SHARE * self.run.options.rtol)
            none = np.zeros(alarm.terms.stop - alarm.terms.start)
            t = roots.first(roots.Together(own), self.t0, end, precision, none, alarm.armed)
            if t is not None:
                t = self._stop(alarm, terms, t) if alarm.tells == "STOP" else t
                end = min(t, end)
                found.append((t, alarm))
        return end, [alarm for t, alarm in found if t - end <= SAME_INSTANT * abs(end)]

    def _stop(self, alarm: Alarm, terms: roots.Terms, t: float) -> float:
        """Where a slip that passes zero by more than one may is at zero itself."""
        over = self.run.friction.leave(alarm.row)

        def ahead(t: float) -> float:
            return float(terms(t)[alarm.terms][0]) - over

        return float(brent(ahead, self.t0, t, xtol=1e-300, rtol=4.0 * ULP)) if ahead(self.t0) > 0.0 else t

    def at(self, t: float) -> State:
        """The state at an instant of the last step."""
        y = self._between(t)
        return State(t, y[: self.nq].copy(), y[self.nq : self.ny].copy(), y[self.ny :].copy())

    def multipliers(self, s: State) -> Floats:
        """Multipliers of all rows at a state of the last step."""
        return self.run.friction.accelerate(s.t, s.q, s.v)[1]


class Counts:
    """What a run tells of its work."""

    def __init__(self, run: FrictionRun, nz: int) -> None:
        self.run, self.nz = run, nz

    @property
    def steps(self) -> int:
        """Instants at which the solver evaluated the equations."""
        return self.run.tried

    @property
    def evaluations(self) -> int:
        """Right-hand sides so far."""
        return self.run.equations.evaluations


class FrictionRun(SundialsRun):
    """A run of a system that has contacts with friction; see `SundialsRun`."""

    def start(self) -> None:
        """Back to the beginning."""
        self.tried, self.qd = 0, np.zeros(self.system.nq)
        super().start()
        self.touches = Touches(self.friction.sliding.ways.keys() - self.friction.sliding.dry, self.options.rtol)
        self.energy_start = float(self.equations.energy(self.q0, self.v0).sum())

    def _machine(self, e: Equations) -> LevelMachine:
        self.friction = FrictionMachine(self.system, e, self.options.rtol, self.options.tolerance, (self.q0, self.v0))
        return self.friction

    def _scene(self, nz: int, scale: float) -> Any:
        self.scale = scale
        return Counts(self, nz)

    def _arc(self, view: View, cautious: bool = False) -> Any:
        longest = self.options.max_step
        if cautious:
            longest = min(longest, (self.options.t_end - self.state.t) * CAUTION**self.retries)
        return SlidingArc(self, self.state, longest)

    def _settle(self, switched: bool) -> View:
        view = super()._settle(switched)
        self._follow_touches(view.lam)
        return view

    def _step(self, arc: Any, stop: float) -> bool | None:
        switched = super()._step(arc, stop)
        self._follow_touches(np.zeros(self.system.nc))  # touches begin where modes settle alone
        return switched

    def _follow_touches(self, lam: Floats) -> None:
        """Follow what touches give out, by the energy account: none is kept, and nothing told, unless it is asked for.

        Likewise of a system that does not say what its energy is.
        """
        if not self.scene.nz or self.system.energy is absent.energy:
            return
        s, e, nc = self.state, self.equations, self.system.nc
        energy = e.energy(s.q, s.v)
        error = float(energy.sum()) - self.energy_start - float(s.z[:nc].sum() + s.z[nc] - s.z[nc + 1])
        self.touches.follow(self.machine.modes, e.gaps(s.t, s.q, s.v)[0], lam, s.z, energy, error)

    def _arc_on(self, arc: Any, view: View) -> Any:
        return self._arc(view) if arc.stiff else arc

    def _check_progress(self, moved: bool) -> None:
        """Say where time does not go on because contacts jam that it is that."""
        try:
            super()._check_progress(moved)
        except Ended as end:
            jamming = self.friction.jamming(self.state.t, self.state.q, self.state.v)
            raise Ended(Outcome.PAINLEVE, jamming) if jamming else end from None

    def _accelerate(self, t: float, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        return self.friction.accelerate(t, q, v)

    def _put_on_law(self) -> None:
        """Leave the state as it is: the laws of rows that slide are not those of rows alone."""

    def _follow_law(self, view: View, anew: bool) -> None:
        """Note nothing, likewise."""

    def _fire(self, fired: Any) -> bool:
        """Apply what was located; whether the arc ends there."""
        s = self.state
        if fired.rows:
            self.friction.apply(s.t, s.q, s.v, fired.rows)
        for guard in fired.guards:
            self._discretely(guard)
        return bool(fired.rows or fired.guards)
