"""One smooth arc between two events: CVODE on the reduced equations, or IDA on the DAE; root finding is SUNDIALS' own.

    cvode            q' = v, v' from the KKT matrix
    ida, index 1     q' = v, M v' = f + H_A^T lam_A, active rows H v' + H' v + a1 h' + a0 h + a2 h^3 = 0, else lam = 0
    ida, index 3     for bilateral rows h = 0 in the stabilised form of index 2 (Gear, Leimkuhler and Gupta 1985):
                     q' = v + H^T mu, h = 0, H v = 0; unilateral rows keep their law

The work of rows, inputs and damping is integrated beside the motion (z), in the same error control.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from sksundae.cvode import CVODE
from sksundae.ida import IDA

from crossbody.cases import Outcome
from crossbody.reference._kinds import Floats
from crossbody.reference._options import Options
from crossbody.reference.sundials.discrete import Discrete
from crossbody.reference.sundials.equations import Ended, Equations
from crossbody.reference.sundials.level_machine import LevelMachine, View, Watch

SHARE = 0.1  # of the tolerance asked for: a multistep method's error grows well beyond that of one step
CHUNK = 500  # internal steps between two looks at the clock
ROOT, TOO_MUCH_WORK = 2, -1
ORDER, ORDER_IN_CONTACT = 12, 6  # of Adams' formulas; those of high order are stable for short steps alone
STALLED, LIMIT, DAMPED = 200, 0.3, 0.3  # steps; step times pole; damping ratio: beyond all three the arc is stiff
UNWATCHED = 1e6  # in units of a multiplier's size: at index 2 errors of lam are errors of the motion over the step
CAUTIOUS = 0.1  # part of the step at which a formula of order one is as good as the tolerance


@dataclass(slots=True)
class State:
    """One instant: t, q (n,), v (n,), work z; lam (nc,) where the solver carries it."""

    t: float
    q: Floats
    v: Floats
    z: Floats
    lam: Floats | None = None


@dataclass(slots=True)
class Fired:
    """What a root call located: (row, function) of the machine, and guards of the mechanism."""

    rows: list[tuple[int, Watch]]
    guards: list[int]


@dataclass(slots=True)
class Scene:
    """What all arcs of a run share."""

    equations: Equations
    machine: LevelMachine
    discrete: Discrete
    options: Options
    nz: int
    scale: float
    """Size of the energies, J."""
    steps: int = 0
    """Instants at which the equations were evaluated: steps tried."""


def _damped_pole(equations: Equations) -> float:
    """Fastest pole of the active rows that decays rather than swings, 1/s."""
    a0, a1, _ = equations.law[equations.active].T
    frequency, half = np.sqrt(a0), 0.5 * a1
    poles = half + np.sqrt(np.maximum(half**2 - a0, 0.0))
    return float(poles[half > DAMPED * frequency].max(initial=0.0))


class Arc:
    """The part that both solvers share.

    Args:
        scene: of the run.
        start: where the arc begins.
        view: what holds there.
        longest: bound on the step, s.
    """

    def __init__(self, scene: Scene, start: State, view: View, longest: float) -> None:
        self.scene, self.options, self.n = scene, scene.options, scene.equations.system.n
        self.q, self.v = start.q.copy(), start.v.copy()
        self._last = -np.inf
        self._known = start.t, view.lam
        self._stalled, self._pole = 0, _damped_pole(scene.equations)
        self.common = {
            "rtol": SHARE * self.options.rtol,
            "max_num_steps": CHUNK,
            "max_step": longest if np.isfinite(longest) else 0.0,
        }
        self.of_rows = len(Watch) * len(scene.machine.rows)
        self.watched = self.of_rows + scene.discrete.guards
        self.solver = self._begin(start, view)

    def _begin(self, start: State, view: View) -> Any:
        raise NotImplementedError

    def _state(self, t: float, y: Floats) -> State:
        raise NotImplementedError

    @property
    def stiff(self) -> bool:
        """Whether the damped poles of the active rows, not accuracy, have bound the steps for long."""
        return self._stalled >= STALLED

    def _take(self, t: float, y: Floats) -> None:
        """Copy the solver's read-only state for the kernels, and count the steps."""
        n = self.n
        self.q[:], self.v[:] = y[:n], y[n : 2 * n]
        if t != self._last:
            self._stalled = self._stalled + 1 if (t - self._last) * self._pole > LIMIT else 0
            self._last = t
            self.scene.steps += 1

    def _watch(self, t: float, y: Floats, out: Floats) -> None:
        n, scene = self.n, self.scene
        self.q[:], self.v[:] = y[:n], y[n : 2 * n]
        _, lam = scene.equations.accelerate(t, self.q, self.v)
        self._known = t, lam
        scene.machine.guards(t, self.q, self.v, lam, out[: self.of_rows])
        scene.discrete.watch(t, self.q, self.v, out[self.of_rows :])

    def multipliers(self, s: State) -> Floats:
        """Lam at a state that `step` returned: the solver's own, or that of the last look at the guards."""
        if s.lam is not None:
            return s.lam
        t, lam = self._known
        return lam if t == s.t else self.scene.equations.accelerate(s.t, s.q, s.v)[1]

    def _guards(self, function: Any) -> dict[str, Any]:
        """The options of root finding: every function fires where it falls through zero."""
        if not self.watched:
            return {}
        function.direction = [-1] * self.watched
        return {"eventsfn": function, "num_events": self.watched}

    def _tolerances(self) -> Floats:
        """Absolute ones, for q, v and the work."""
        share = SHARE * self.options.tolerance
        return np.concatenate([np.full(2 * self.n, share), np.full(self.scene.nz, share * self.scene.scale)])

    def step(self, target: float, stop: float, natural: bool) -> tuple[State, Fired]:
        """Go on by one step of the solver's own, or to `target`; never beyond `stop`.

        Returns:
            The state, and what fired there.

        Raises:
            Ended: with the outcome if the solver gives up.
        """
        done = self.solver.step(target, "onestep" if natural else "normal", stop)
        if done.status < 0 and done.status != TOO_MUCH_WORK:
            raise Ended(Outcome.STEP_TOO_SMALL)
        if not np.isfinite(done.y).all():
            raise Ended(Outcome.NOT_FINITE)
        fired = np.flatnonzero(done.i_events[-1]).tolist() if done.status == ROOT else []
        return self._state(float(done.t), done.y), self._fired(fired)

    def _fired(self, places: list[int]) -> Fired:
        rows, own = self.scene.machine.rows, self.of_rows
        pairs = [(rows[j // len(Watch)], Watch(j % len(Watch))) for j in places if j < own]
        return Fired(pairs, [j - own for j in places if j >= own])


class CvodeArc(Arc):
    """CVODE, by Adams' formulas; by backward differentiation once stability holds the steps back (`stiff`)."""

    method = "Adams"

    def _begin(self, start: State, view: View) -> Any:
        def rhs(t: float, y: Floats, yp: Floats) -> None:
            self._take(t, y)
            n, e = self.n, self.scene.equations
            vd, lam = e.accelerate(t, self.q, self.v)
            yp[:n], yp[n : 2 * n] = self.v, vd
            if self.scene.nz:
                yp[2 * n :] = e.powers(t, self.q, self.v, lam)

        def watch(t: float, y: Floats, out: Floats) -> None:
            self._watch(t, y, out)

        guards, e = self._guards(watch), self.scene.equations
        order = {} if self.method == "BDF" else {"max_order": ORDER_IN_CONTACT if e.active else ORDER}
        solver = CVODE(rhs, method=self.method, atol=self._tolerances(), **self.common, **order, **guards)
        solver.init_step(start.t, np.concatenate([start.q, start.v, start.z]))
        return solver

    def _state(self, t: float, y: Floats) -> State:
        n = self.n
        return State(t, y[:n].copy(), y[n : 2 * n].copy(), y[2 * n :].copy())


class BdfArc(CvodeArc):
    """CVODE by backward differentiation formulas."""

    method = "BDF"


class IdaArc(Arc):
    """IDA on (q, v, lam), with the multipliers mu of the stabilised form where bilateral rows are rigid."""

    def _begin(self, start: State, view: View) -> Any:
        n, nc, e = self.n, self.scene.equations.system.nc, self.scene.equations
        bilateral = ~np.asarray(e.system.unilateral, dtype=bool)
        self.rigid = np.flatnonzero(bilateral).tolist() if self.options.index == 3 else []
        nb = len(self.rigid)
        self.lam, self.mu = slice(2 * n, 2 * n + nc), slice(2 * n + nc, 2 * n + nc + nb)
        self.work = slice(2 * n + nc + nb, None)

        def residual(t: float, y: Floats, yp: Floats, out: Floats) -> None:
            self._take(t, y)
            self._residual(t, y, yp, out)

        def watch(t: float, y: Floats, yp: Floats, out: Floats) -> None:
            self._watch(t, y, out)

        share, size = SHARE * self.options.rtol, np.where(view.size > 0.0, view.size, 1.0)
        loose = UNWATCHED if self.rigid else 1.0
        own = self._tolerances()
        atol = np.concatenate([own[: 2 * n], share * size * loose, np.full(nb, UNWATCHED), own[2 * n :]])
        solver = IDA(
            residual, atol=atol, algebraic_idx=list(range(2 * n, 2 * n + nc + nb)), first_step=self._first_step(),
            **self.common, **self._guards(watch),
        )  # fmt: skip
        powers = e.powers(start.t, start.q, start.v, view.lam) if self.scene.nz else np.zeros(0)
        zero = np.zeros(nb)
        solver.init_step(
            start.t,
            np.concatenate([start.q, start.v, view.lam, zero, start.z]),
            np.concatenate([start.v, view.vd, np.zeros(nc), zero, powers]),
        )
        return solver

    def _first_step(self) -> float:
        """0 to let IDA guess; at index 2 its guess is so short that it sees rounding over the step and nothing else."""
        if not self.rigid:
            return 0.0
        a0, a1, _ = self.scene.equations.law[self.scene.equations.active].T
        fastest = max(1.0, float(np.sqrt(a0).max()), float(a1.max()))
        return float(CAUTIOUS * np.sqrt(SHARE * self.options.rtol) / fastest)

    def _residual(self, t: float, y: Floats, yp: Floats, out: Floats) -> None:
        n, e, q, v = self.n, self.scene.equations, self.q, self.v
        lam, vd = y[self.lam], yp[n : 2 * n]
        M, f = e.terms(t, q, v)
        H, h, Hdv = e.rows(t, q, v)
        out[:n] = yp[:n] - v
        out[n : 2 * n] = M @ vd - f - H.T @ lam[e.active]
        rows = out[self.lam]
        rows[:] = lam
        rows[e.active] = H @ vd + Hdv + e.drive(h, H @ v)
        if len(self.rigid):
            places = [e.active.index(i) for i in self.rigid]
            out[:n] -= H[places].T @ y[self.mu]
            rows[self.rigid] = h[places]
            out[self.mu] = H[places] @ v
        if self.scene.nz:
            smooth = e.accelerate(t, q, v)[1] if self.rigid else lam
            out[self.work] = yp[self.work] - e.powers(t, q, v, smooth)
        if not np.isfinite(out).all():
            raise Ended(Outcome.NOT_FINITE)

    def _state(self, t: float, y: Floats) -> State:
        n = self.n
        return State(t, y[:n].copy(), y[n : 2 * n].copy(), y[self.work].copy(), y[self.lam].copy())
