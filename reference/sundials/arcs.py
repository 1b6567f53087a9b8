"""One smooth arc between two events: CVODE on the reduced equations, or IDA on the DAE.

    cvode            q' = v, v' from the KKT matrix
    ida, index 1     q' = v, M v' = f + H_A^T lam_A, active rows H M^-1 (f + H_A^T lam_A) + H' v + a1 h' + a0 h + a2 h^3
                     = 0, else lam = 0; the multipliers are all but out of the error control
    ida, index 3     for bilateral rows h = 0 in the stabilised form of index 2 (Gear, Leimkuhler and Gupta 1985):
                     q' = v + H^T mu, h = 0, H v = 0; unilateral rows keep their law

The work of rows, inputs and damping is integrated beside the motion (z), in the same error control. SUNDIALS' own root
finding sees changes of sign between the ends of its steps alone: it is not used. Every step is examined on the solver's
dense output (`roots`), unless a bound says that no guard can fire inside it (`evaluation`). That bound stands in the
place of a root function, so that the library goes on by itself: it is zero at the end of a step that needs a look.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from crossbody.cases import Outcome
from crossbody.reference.kinds import Floats
from crossbody.reference.options import Options
from crossbody.reference.sundials import roots
from crossbody.reference.sundials.compiled import evaluation
from crossbody.reference.sundials.dense import DenseStep
from crossbody.reference.sundials.discrete import Discrete
from crossbody.reference.sundials.equations import ULP, Ended, Equations
from crossbody.reference.sundials.evaluator import ENDS, Evaluator
from crossbody.reference.sundials.level_machine import SAME_INSTANT, LevelMachine, View, Watch
from crossbody.reference.sundials.solvers import CVODE, IDA

SHARE = 0.1  # of the tolerance asked for: a multistep method's error grows well beyond that of one step
CHUNK = 500  # internal steps between two looks at the clock
TOO_MUCH_WORK = -1
ORDER, ORDER_IN_CONTACT = 12, 6  # of Adams' formulas; those of high order are stable for short steps alone
STALLED, DAMPED = 200, 0.3  # steps bound by stability; damping ratio: beyond both the arc is stiff
UNWATCHED = 1e6  # N: in no error control
LOOSE = 1e-2  # of the size of a multiplier: it follows from the state
CAUTIOUS = 0.1  # part of the step at which a formula of order one is as good as the tolerance
FAR = 1e30  # beyond this a motion has diverged
MANY = 100  # rows: from there on those that are off have no unknowns; they would be most of a norm, and of a Jacobian
NOISY = 64.0  # rounding of a multiplier along a step, in units of its bound at the start
MOST_TERMS = 5  # of the guards of one row
ENDLESS = 2**62


@dataclass(slots=True)
class State:
    """One instant: t, q (nq,), v (n,), work z; lam (nc,) where the solver carries it."""

    t: float
    q: Floats
    v: Floats
    z: Floats
    lam: Floats | None = None


@dataclass(slots=True)
class Fired:
    """What was located: (row, function) of the machine, and guards of the mechanism."""

    rows: list[tuple[int, Watch]]
    guards: list[int]


class Scene:
    """What all arcs of a run share.

    Attributes:
        equations, machine, discrete, options: of the run.
        nz: accounts of work.
        scale: size of the energies, J.
        looks: compiled looks at a state.
    """

    def __init__(
        self, equations: Equations, machine: LevelMachine, discrete: Discrete, options: Options, nz: int, scale: float
    ) -> None:
        self.equations, self.machine, self.discrete, self.options = equations, machine, discrete, options
        self.nz, self.scale = nz, scale
        self.looks = Evaluator(equations, MOST_TERMS * len(machine.rows) + discrete.guards, nz)
        self.work = self.looks.work

    @property
    def steps(self) -> int:
        """Instants at which the equations were evaluated: steps tried."""
        return int(self.work["count"][1])

    @property
    def evaluations(self) -> int:
        """Right-hand sides so far, in compiled code and at events."""
        return int(self.work["count"][0]) + self.equations.evaluations


def _damped_pole(equations: Equations) -> float:
    """Fastest pole of the active rows that decays rather than swings, 1/s."""
    a0, a1, _ = equations.law[equations.active].T
    frequency, half = np.sqrt(a0), 0.5 * a1
    poles = half + np.sqrt(np.maximum(half**2 - a0, 0.0))
    return float(poles[half > DAMPED * frequency].max(initial=0.0))


class Arc(DenseStep):
    """The part that both solvers share.

    Args:
        scene: of the run.
        start: where the arc begins.
        view: what holds there.
        longest: bound on the step, s.
        single: whether every step is asked for: the solver never goes on by itself.
    """

    def __init__(self, scene: Scene, start: State, view: View, longest: float, single: bool) -> None:
        self.scene, self.options = scene, scene.options
        self.nq, self.ny = scene.equations.system.nq, scene.equations.system.nq + scene.equations.system.n
        self.single, self.fresh = single, True
        self.guards = [*scene.machine.guards, *scene.discrete.watched()]
        *self.firsts, self.terms = np.cumsum([0, *(len(guard.terms) for guard in self.guards)]).tolist()
        scene.looks.begin(self.guards, scene.machine.frozen, scene.machine.tied)
        self.ask = scene.looks.ask
        scene.work["clock"][:2] = -np.inf, _damped_pole(scene.equations)
        scene.work["count"][2:] = 0, ENDLESS, 0
        left = max(1, self.options.max_steps - scene.steps)
        self.common: dict[str, Any] = {
            "rtol": SHARE * self.options.rtol,
            "max_num_steps": min(CHUNK, left),
            "max_step": longest if np.isfinite(longest) else 0.0,
        }
        self.events = None if single or not self.guards else self._events()
        if self.events is not None:
            self.events.terminal, self.events.direction = (True,), (0,)
            self.common |= {"eventsfn": self.events, "num_events": 1}
        self.solver, y = self._begin(start, view)
        self._stand(start.t, y)
        self.ask(evaluation.BEGIN, start.t, y)

    def _begin(self, start: State, view: View) -> tuple[Any, Floats]:
        """The solver, and where it starts."""
        raise NotImplementedError

    def _unknowns(self, carried: int, y: Floats) -> None:
        """Say which entries of a whole vector the solver has: all, or of many rows those that are active.

        Args:
            carried: how many sets of an entry a row stand behind q and v, before the accounts of work.
            y: the vector at the start.
        """
        e, nc, nz = self.scene.equations, self.scene.equations.system.nc, self.scene.nz
        self.whole, self.kept = y.copy(), np.arange(len(y))
        if nc < MANY or e.beside is not None:  # shared multipliers may stand in any row
            return
        idle = np.setdiff1d(np.arange(nc), e.active)
        firsts = [self.ny + k * nc for k in range(carried)] + [len(y) - nz] * (nz > 0)
        self.kept = np.setdiff1d(self.kept, np.concatenate([np.zeros(0, dtype=int), *(at + idle for at in firsts)]))

    def _wide(self, y: Floats) -> Floats:
        """The whole vector of one of the solver's: what has no unknown stands still."""
        if len(y) == len(self.whole):
            return y
        wide = self.whole.copy()
        wide[self.kept] = y
        return wide

    def _state(self, t: float, y: Floats) -> State:
        raise NotImplementedError

    @property
    def stiff(self) -> bool:
        """Whether the damped poles of the active rows, not accuracy, have bound the steps for long."""
        return bool(self.scene.work["count"][2] >= STALLED)

    def multipliers(self, s: State) -> Floats:
        """Lam at a state of the last step: the solver's own, or from the equations."""
        if s.lam is not None:
            return s.lam
        if s.t == self.t1:
            return self.scene.work["lam1"].copy()
        self.ask(evaluation.FORCES, s.t, np.concatenate([s.q, s.v]))
        return self.scene.work["lam"].copy()

    def _tolerances(self) -> Floats:
        """Absolute ones, for q, v and the work."""
        share = SHARE * self.options.tolerance
        motion = SHARE * self.options.absolute(self.scene.equations.system)
        return np.concatenate([motion, np.full(self.scene.nz, share * self.scene.scale)])

    def _events(self) -> Any:
        """The bound in the place of a root function, in the form that the library calls."""
        raise NotImplementedError

    def step(self, stop: float, target: float) -> tuple[State, Fired]:
        """Go on to the first guard that fires, or to `target` or earlier; by one step if the arc is single or new.

        A step never goes beyond `stop`.

        Raises:
            Ended: with the outcome if the solver gives up.
        """
        alone = self.single or self.fresh
        self.fresh = False
        done = self.solver.step(stop if alone else target, "onestep" if alone else "normal", stop)
        if done.status < 0 and done.status != TOO_MUCH_WORK:
            raise Ended(Outcome.STEP_TOO_SMALL)
        self._check(done.y)
        if self.events is not None:
            for found in vars(self.events).values():
                if isinstance(found, list):  # the library keeps all that it stopped at
                    found.clear()
        t, fired = self._examine(float(done.t), done.y)
        return self.at(t), fired

    def _check(self, y: Floats) -> None:
        size = float(y.dot(y))
        if not size < FAR**2:
            raise Ended(Outcome.DIVERGED if np.isfinite(y).all() else Outcome.NOT_FINITE)

    def _examine(self, t: float, y: Floats) -> tuple[float, Fired]:
        """The end of the last step, or the first instant inside it at which guards fire, and these."""
        work = self.scene.work
        if t > work["clock"][2]:  # the library has not asked
            self.ask(evaluation.SCAN if self.guards else evaluation.BEGIN, t, y)
        self.t1, self.t0 = work["clock"][2:].tolist()
        self.y1, self._defect = y, None
        self.y0 = work["ends"][0, : len(y)].copy()
        left, work["count"][4] = work["count"][4], 0
        return self._search() if left else (t, Fired([], []))

    def _search(self) -> tuple[float, Fired]:
        """The first of the guards that may fire inside the step, and all that fire with it."""
        known: dict[float, Floats] = {}

        def terms(t: float) -> Floats:
            if t not in known:
                self.ask(evaluation.TERMS, t, self._between(t))
                known[t] = self.scene.looks.values.copy()
            return known[t]

        end, found = self.t1, []
        precision = max(64.0 * ULP, SHARE * self.options.rtol)
        above = roots.stay_above(terms, self.t0, self.t1)[: self.terms]  # behind them stand those of earlier arcs
        open_ = self.scene.work["undecided"][: len(self.guards)] != 0
        for k in np.flatnonzero(open_ & ~np.logical_or.reduceat(above, self.firsts)).tolist():
            guard = self.guards[k]
            mine = slice(self.firsts[k], self.firsts[k] + len(guard.terms))

            def its_own(t: float, mine: slice = mine) -> Floats:
                return terms(t)[mine]

            noise = np.array([NOISY * term.noise for term in guard.terms])
            armed = guard.watch is not None  # a guard of the mechanism counts from above zero on
            t = roots.first(its_own, self.t0, end, precision, noise, armed)
            if t is not None:
                end = min(t, end)
                found.append((t, guard))
        now = [guard for t, guard in found if t - end <= SAME_INSTANT * abs(end)]
        rows = [(guard.row, guard.watch) for guard in now if guard.watch is not None]
        return end, Fired(rows, [guard.row for guard in now if guard.watch is None])

    def at(self, t: float) -> State:
        """The state at an instant of the last step."""
        return self._state(t, self._between(t))


class CvodeArc(Arc):
    """CVODE, by Adams' formulas; by backward differentiation once stability holds the steps back (`stiff`)."""

    method = "Adams"

    def _events(self) -> Any:
        call, lines, equations = self.scene.looks.call, self.scene.looks.lines, self.scene.equations

        def events(t: float, y: Floats, out: Floats) -> None:
            if code := call(evaluation.WATCHED, t, y, out, lines):
                raise Ended(ENDS[-code], equations.active)

        return events

    def _begin(self, start: State, view: View) -> tuple[Any, Floats]:
        scene, call, lines = self.scene, self.scene.looks.call, self.scene.looks.lines

        whole = np.concatenate([start.q, start.v, start.z])
        self._unknowns(0, whole)
        kept, slopes = self.kept, np.empty(len(whole))

        def all_of_them(t: float, y: Floats, yp: Floats) -> None:
            if code := call(evaluation.DERIVATIVE, t, y, yp, lines):
                raise Ended(ENDS[code], scene.equations.active)

        def some(t: float, y: Floats, yp: Floats) -> None:
            all_of_them(t, self._wide(y), slopes)
            yp[:] = slopes[kept]

        rhs = all_of_them if len(kept) == len(whole) else some
        if self.method == "Adams":
            scene.work["count"][3] = STALLED
        order = {"max_order": ORDER_IN_CONTACT if scene.equations.active else ORDER} if self.method == "Adams" else {}
        solver = CVODE(rhs, method=self.method, atol=self._tolerances()[kept], **self.common, **order)
        solver.init_step(start.t, whole[kept])
        return solver, whole[kept]

    def _state(self, t: float, y: Floats) -> State:
        nq, ny, whole = self.nq, self.ny, self._wide(y)
        return State(t, whole[:nq], whole[nq:ny], whole[ny:])


class BdfArc(CvodeArc):
    """CVODE by backward differentiation formulas."""

    method = "BDF"


class IdaArc(Arc):
    """IDA on (q, v, lam), with the multipliers mu of the stabilised form where bilateral rows are rigid."""

    def _events(self) -> Any:
        call, lines, equations = self.scene.looks.call, self.scene.looks.lines, self.scene.equations

        def events(t: float, y: Floats, yp: Floats, out: Floats) -> None:
            if code := call(evaluation.WATCHED, t, y, out, lines):
                raise Ended(ENDS[-code], equations.active)

        return events

    def _begin(self, start: State, view: View) -> tuple[Any, Floats]:
        ny, nc, nz, e = self.ny, self.scene.equations.system.nc, self.scene.nz, self.scene.equations
        bilateral = e.system.held
        self.rigid = np.flatnonzero(bilateral).tolist() if self.options.index == 3 else []
        nb = len(self.rigid)
        self.lam, self.mu = slice(ny, ny + nc), slice(ny + nc, ny + nc + nb)
        self.work = slice(ny + nc + nb, None)
        looks = self.scene.looks
        call, lines, slopes = looks.call, looks.lines, looks.work["slopes"][: ny + nc + nb + nz]
        looks.work["rigid"][:] = -1
        looks.work["rigid"][self.rigid] = range(nb)
        looks.work["scale"][e.active] = self._masses(start)

        zero = np.zeros(nb)
        whole = np.concatenate([start.q, start.v, view.alone, zero, start.z])
        self._unknowns(1, whole)
        kept, left = self.kept, np.empty(len(whole))

        def all_of_them(t: float, y: Floats, yp: Floats, out: Floats) -> None:
            slopes[:] = yp
            if code := call(evaluation.RESIDUAL, t, y, out, lines):
                raise Ended(ENDS[code], e.active)

        def some(t: float, y: Floats, yp: Floats, out: Floats) -> None:
            slopes[:] = 0.0
            slopes[kept] = yp
            if code := call(evaluation.RESIDUAL, t, self._wide(y), left, lines):
                raise Ended(ENDS[code], e.active)
            out[:] = left[kept]

        own = self._tolerances()
        atol = np.concatenate([own[:ny], self._watched(start), np.full(nb, UNWATCHED), own[ny:]])
        algebraic = np.flatnonzero((kept >= ny) & (kept < ny + nc + nb)).tolist()
        solver = IDA(
            all_of_them if len(kept) == len(whole) else some, atol=atol[kept], algebraic_idx=algebraic,
            first_step=self._first_step(), **self.common,
        )  # fmt: skip
        powers = e.powers(start.t, start.q, start.v, view.lam) if nz else np.zeros(0)
        qd = e.system.rates(start.q, start.v, start.t, e.p)
        rates = np.concatenate([qd, view.vd, np.zeros(nc), zero, powers])
        solver.init_step(start.t, whole[kept], rates[kept])
        return solver, whole[kept]

    def _masses(self, start: State) -> Floats:
        """What a row moves, 1 / (H M^-1 H^T)_ii, of the active rows: its equation is one of forces then."""
        e = self.scene.equations
        if not e.active:
            return np.zeros(0)
        H, X = e.mobility(start.t, start.q, start.v, e.active)
        masses: Floats = 1.0 / np.einsum("ij,ji->i", H, X)
        return masses

    def _watched(self, start: State) -> Floats:
        """Tolerance of every multiplier (nc,): loose, but not none, or Newton's iteration ends with any of them.

        Then what it leaves keeps stiff contacts at order two and short steps. At index 2 their errors are errors of the
        motion over the step, and they are left out.
        """
        e = self.scene.equations
        found = np.full(e.system.nc, UNWATCHED)
        if not self.rigid and e.active:
            largest = float(max(np.abs(start.q).max(), np.abs(start.v).max()))
            error = SHARE * (self.options.rtol * largest + self.options.tolerance)
            noise, size = e.noise(start.t, start.q, start.v, self.scene.machine.fastest, error)
            found[e.active] = (LOOSE * size + NOISY * noise)[e.active]
        return found

    def _first_step(self) -> float:
        """0 to let IDA guess; at index 2 its guess is so short that it sees rounding over the step and nothing else."""
        if not self.rigid:
            return 0.0
        a0, a1, _ = self.scene.equations.law[self.scene.equations.active].T
        fastest = max(1.0, float(np.sqrt(a0).max()), float(a1.max()))
        return float(CAUTIOUS * np.sqrt(SHARE * self.options.rtol) / fastest)

    def _state(self, t: float, y: Floats) -> State:
        nq, ny, y = self.nq, self.ny, self._wide(y)
        # At index 1 lam follows from the state.
        if not self.rigid:
            return State(t, y[:nq], y[nq:ny], y[self.work])
        e = self.scene.equations
        lam = e.share(t, y[:nq], y[nq:ny], y[self.lam])
        return State(t, y[:nq], y[nq:ny], y[self.work], lam)
