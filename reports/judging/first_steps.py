"""The first steps of engines that step in time, held against the law's: what a model holds, its steps apply.

A known property of such an engine is as large as its step, and a parameter that is off by some per cent hides behind
it. Of steps a thousandth as long nothing is left, and what they do is known in closed form. Where nothing touches,
velocities change by v' dt, and theta of the change counts where a step moves bodies (`Engine.steps`). Where one pair
meets at the speed w, within half a step of its touch, it parts at e w; and where it slips fast besides, |p_t| =
mu p_n with M (v - v of the same steps where nothing touches) = H_n^T p_n + H_t^T p_t.

What changes with time shows nothing within so few steps. So activations are made as fast as these: their law has no
other constant of time, and what they do at every instant must be what a' = u or tau a' = u - a makes of controls that
jump, from the instants of the steps on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from crossbody import engines
from crossbody.cases import Case, CrossbodyError, Inputs, Trajectory
from crossbody.cases import closed_forms as cf
from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.rotations import normalised
from crossbody.cases.scene import UNBOUNDED, Actuator
from crossbody.cases.scene_contacts import WAYS, Contact, contacts, watched
from crossbody.reports.judging.audit import AuditRow
from crossbody.reports.measuring.equations import equations
from crossbody.reports.measuring.scale import of_like

if TYPE_CHECKING:
    from crossbody.reference import System

PART, OF_BLOWS = 1e-3, 1e-5
"""Parts of an engine's own step that are taken, where nothing touches and where a pair meets."""
STEPS, BLOWS = 4, 8
"""How many."""
FILTERS, DRIVEN = 0.5, 16
"""Part of so few steps that is a filter's constant of time there, and into how many steps of their own they are cut
first: an error of first order in them is taken out by twice as many."""
JUMPS = (0.0, 0.25, 0.5, 0.75)
"""Parts of that time at which controls jump."""
OF_DRIVES = 0.05
"""Part of what activations do by which they may be off: of second order in so many steps."""
SHOWN, LIGHT = 1e-12, 1e-4
"""Change of a velocity, SI, that rounding hides, and part of the largest one below which another is none."""
CLEAR = 1e-3
"""Gap, m, of what does not touch: no motion of that time crosses it."""
FAST, MEETS, SLIPS, FASTEST, PARTS = 0.5, 1.0, 30.0, 100.0, 0.5
"""Velocities, SI, of what is free and at which a pair meets, how many times as fast it slips, the fastest, and the
slowest at which one parts that tells a restitution."""
BEFORE = 2.75
"""How many steps before a pair meets."""
TOLERANCE, OF_PLACES = 2e-3, 0.02
"""To which a force or a restitution is what it must be, and theta."""
CHANGES, GROWS, HALF = 2e-7, 1e-3, 0.5
"""Part of a velocity that is a change, and of the next change that is no rounding; and how many steps
from its touch a pair meets at most."""
NEWTON, ROUNDED, NONE = 20, 1e-13, 1e-8
"""Iterations that place bodies, m; and part of a momentum that is none."""
BEYOND, HELD, SMALL = 1.5, 0.6, 0.7
"""How many times the end of its range a control is drawn up to, the ends of activations that have a range, and the part
of what it is drawn up to that any number is at least."""
SEED, USUAL, LEAST = 20240917, 1e-3, 1e-5
"""Of all draws; the step, s, in the place of none, and the least of which parts are told from rounding."""
MOST = 4  # pairs that meet: what is wrong with one is with all, or with the first of two shapes
Rows = NDArray[np.intp]


@dataclass
class Probe:
    """An engine under test, and the equations of its case.

    Attributes:
        case: without a controller, gates or coordinates of its own.
        engine, profile: who steps.
        used, asked: settings of its run, and those of them that were asked for.
        theirs: the reference's audit, with gap(q), H(q) and M(q).
        system: the reference's equations.
        steps: whether it steps in time, with these.
        opening, held: rows that open, and those that are always on.
    """

    case: Case
    engine: engines.Engine
    profile: str
    used: Mapping[str, Any]
    asked: Mapping[str, Any]
    theirs: Mapping[str, Any]
    system: System
    steps: bool
    opening: Rows = field(init=False)
    held: Rows = field(init=False)

    def __post_init__(self) -> None:
        """Tell rows apart."""
        self.opening = np.flatnonzero(self.case.law.touches)
        self.held = np.flatnonzero((np.asarray(self.system.follows) < 0) & ~self.case.law.unilateral)

    @property
    def dt(self) -> float:
        """Its step, s, or what stands for it in one that has none."""
        return max(float(self.used.get("dt", USUAL)), LEAST)

    @property
    def restitution(self) -> float:
        """What pairs must part with; NaN where the engine has none, or rows have their own."""
        law = self.case.law
        laws = np.stack([law.a0, law.a1, law.b0, law.b1])[:, self.opening]
        kinds = len(set(map(tuple, laws.T.tolist())))
        asked, e = "restitution" in self.asked, float(self.used.get("restitution", np.nan))
        if kinds == 1 and not asked and e > 0.0:
            e = _of_law(*(float(part[self.opening[0]]) for part in (law.a0, law.a1, law.b0, law.b1)))
        return e if (asked or kinds == 1) and (e == 0.0 or e * self.meets >= PARTS) else np.nan

    @property
    def meets(self) -> float:
        """Speed at which pairs meet, m/s: engines let those rest that part too slowly, and the law captures some."""
        if "dt" in self.used or not len(self.opening):
            e = float(self.used.get("restitution", 0.0))
            return min(max(MEETS, MEETS / e), FASTEST) if e > 0.0 else MEETS
        a0, a1 = float(self.case.law.a0[self.opening[0]]), float(self.case.law.a1[self.opening[0]])
        slow = cf.threshold_speed(a0, a1, float(self.theirs.get("gravity", 0.0))) if a0 > 0.0 else math.inf
        return max(MEETS, 2.0 * slow)

    def ways(self, rows: Rows) -> Rows:
        """Return the tangents of normal rows, two for each."""
        return np.array([int(self.system.tangent[row]) + k for row in rows for k in range(len(WAYS))])

    def placed(self, rows: Rows, gaps: Floats) -> Floats:
        """Return positions near the start in which rows have some gaps: by Newton, in least change."""
        q: Floats = np.array(self.case.q0)
        for _ in range(NEWTON):
            off = gaps - self.theirs["gap"](q)[rows]
            if np.all(np.abs(off) <= ROUNDED):
                break
            q = q + self.system.displacement(q, np.linalg.lstsq(self.theirs["H"](q)[rows], off)[0])
            q = normalised(q, self.case.quaternions)
        return q

    def stepped(self, q: Floats, v: Floats, part: float, count: int) -> Trajectory | None:
        """Return some steps from a state; None where they fail."""
        case = self.begun(q, v, count * part * self.dt, jumps=1 + (part == PART))
        run = self.engine.prepare(case, self.profile, **self.given(part * self.dt)).run()
        return run if run.outcome.ok else None

    def given(self, dt: float) -> dict[str, Any]:
        """Return the settings of a run that has another step, s."""
        given = {name: value for name, value in self.asked.items() if name != "max_steps"}
        return given | ({"dt": dt} if "dt" in self.used else {})

    def activated(self, t_end: float, size: float, steps: int) -> Case:
        """Return the case with activations that follow controls of a size, none for 0, within an instant, s.

        Controls are given anew in every step of the first half, where they jump or not. Neither their ranges nor those
        of forces end what they do, but for those of activations that have one: within these they are held.
        """
        case = self.case
        assert case.scene is not None
        drawn = np.random.default_rng(SEED)
        start, inputs = size * _sized(drawn, (len(case.act0),)), case.scene.inputs
        values = size * _sized(drawn, (len(JUMPS), len(inputs)))
        given = distinct(np.arange(steps // 2) / steps, JUMPS)
        values = values[np.searchsorted(JUMPS, given, side="right") - 1]
        for i in (i for i in case.scene.activated if case.scene.actuators[i].activation == "integrator"):
            values[:, i] /= t_end
        return replace(
            case, scene=case.scene.replace(actuators=tuple(
                replace(one, control_range=UNBOUNDED, activation_range=_ends(one), force_range=UNBOUNDED,
                        time_constant=FILTERS * t_end if one.activation == "filter" else 0.0) if one.activation else one
                for one in case.scene.actuators
            )), act0=start, inputs=Inputs(names=inputs, times=t_end * given, values=values),
            t_end=t_end, closed_form=None, claims=(), chaos=None, consistent=False,
        )  # fmt: skip

    def clear(self) -> Floats | None:
        """Return positions near the start in which nothing touches; None if there are none to be told."""
        gap = self.theirs["gap"]
        q = self.placed(self.opening, np.maximum(gap(self.case.q0)[self.opening], 0.0) + CLEAR)
        # rows that are always on are soft in engines, and take their time
        unclear = len(self.held) or _has_more(self) or np.any(gap(q)[self.opening] <= 0.5 * CLEAR)
        return None if unclear else q

    def begun(self, q: Floats, v: Floats, t_end: float, jumps: int = 2) -> Case:
        """Return the case from another state on, up to an instant, s, with inputs that jump, perhaps again amid."""
        scene, inputs = self.case.scene, self.case.inputs
        names = scene.inputs if scene is not None and self.case.general else ()
        size = float(np.max(np.abs(inputs.values), initial=1e-3)) if inputs is not None else 1.0
        sizes = [_beyond(one, size) for one in scene.actuators] if names and scene is not None else []
        widths = np.array([*sizes, *[size] * (len(names) - len(sizes))])
        values = widths * _sized(np.random.default_rng(SEED), (jumps, len(names)))
        return replace(
            self.case, q0=q, v0=v, t_end=t_end, closed_form=None, claims=(), chaos=None, consistent=False,
            inputs=Inputs(names=names, times=np.array([0.0, 0.5 * t_end])[:jumps], values=values) if names else None,
        )  # fmt: skip


def _sized(draw: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    """Return numbers of either sign and of sizes up to 1, none of which is small."""
    return draw.choice([-1.0, 1.0], shape) * draw.uniform(SMALL, 1.0, shape)


def _ends(actuator: Actuator) -> tuple[float, ...]:
    return (-HELD, HELD) if np.isfinite(actuator.activation_range).any() else UNBOUNDED


def _beyond(actuator: Actuator, size: float) -> float:
    """Return up to what a control is drawn, so that it comes to the ends of its range, and its force to those of its.

    A servo's force depends on where it is, too: it is asked for what its control adds.
    """
    ends = [abs(end) for end in actuator.control_range]
    if actuator.gain[0] and not actuator.activation:
        ends += [abs(end / actuator.gain[0]) for end in actuator.force_range]
    return max([size, *(BEYOND * end for end in ends if math.isfinite(end))])


def first_steps(
    case: Case, who: tuple[engines.Engine, str], used: Mapping[str, Any], asked: Mapping[str, Any],
    audited: Sequence[AuditRow], theirs: Mapping[str, Any],
) -> tuple[AuditRow, ...]:  # fmt: skip
    """Return rows for the parity audit of an engine that steps in time, or has a restitution; none of another.

    Args:
        case: the scene.
        who: engine and profile.
        used: settings of its run.
        asked: those of them that were asked for.
        audited: rows of the audit so far: whose masses are known to be others accelerates otherwise.
        theirs: the reference's audit.
    """
    system, theta = equations(case), who[0].steps.get(who[1])
    if theta is None or system is None or "gap" not in theirs or not _plain(case):
        return ()
    same = all(row.ok for row in audited if row.quantity in ("M", "bias"))
    probe = Probe(case, *who, used, asked, theirs, system, same and "dt" in used and not math.isnan(theta))
    try:
        touching = () if case.file or who[1] in who[0].late else _blows(probe)
        held = _held(probe) if probe.steps and who[1] in who[0].held else ()
        return (*(_free(probe) if probe.steps else ()), *held, *(_driven(probe) if probe.steps else ()), *touching)
    except (CrossbodyError, np.linalg.LinAlgError):  # a state that the engine or the reference refuses
        return ()


def _of_law(a0: float, a1: float, b0: float, b1: float) -> float:
    """Return the restitution of a row's linear part as it is entered: its rate where its force ends, of one inwards."""
    arc = cf.LinearArc(*((b0, b1) if b0 > 0.0 else (a0, a1)), 0.0, -1.0)
    ends = arc.rate.rate.first_zero()
    return float(arc.rate(ends)) if math.isfinite(ends) else 0.0


def _plain(case: Case) -> bool:
    """Whether bodies, joints, shapes and inputs are all that there is, so that a state says all."""
    return not (case.form or case.gates or case.control)


def _free(probe: Probe) -> Iterator[AuditRow]:
    """Step where nothing touches and everything moves."""
    q, t_end = probe.clear(), PART * STEPS * probe.dt
    if q is None:
        return
    v = np.random.default_rng(SEED).uniform(-FAST, FAST, len(probe.case.v0))
    quarters = np.linspace(0.0, t_end, 5)
    exact = engines.load("reference").prepare(probe.begun(q, v, t_end), "compiled", samples=quarters).run()
    run = probe.stepped(q, v, PART, STEPS)
    if not exact.outcome.ok:
        return
    wanted, least = exact.v[-1] - v, t_end / probe.case.t_end * FAST
    along = np.array([exact.v[np.searchsorted(exact.t, t, side="right") - 1] for t in quarters])  # inputs jump amid
    bends = float(np.max(np.abs(along[2::2] - 2.0 * along[1::2] + along[:-1:2])))
    size = np.maximum(of_like(np.abs(wanted), probe.case.velocities), least) + bends / TOLERANCE
    changed = np.full(len(v), np.inf) if run is None else run.v[-1] - v
    yield _row("acceleration", changed / t_end, wanted / t_end, float(np.max(np.abs(changed - wanted) / size)))
    if run is not None and float(np.max(size)) > 2.0 * least and math.isfinite(probe.engine.steps[probe.profile]):
        yield from _places(probe, run)


def _driven(probe: Probe) -> Iterator[AuditRow]:
    """Step while activations follow controls that jump, where nothing touches: what they do beside controls of none.

    An engine that reads the file by itself has the file's constants.
    """
    case, q, t_end = probe.case, probe.clear(), PART * STEPS * probe.dt
    own = probe.used.get("reader") == "file"
    if own or not (case.general and case.scene is not None and case.scene.activated) or q is None:
        return
    still = np.zeros(len(case.v0))

    def changed(run: Callable[[Case], Trajectory], steps: int = len(JUMPS)) -> Floats:
        runs = [run(replace(probe.activated(t_end, size, steps), q0=q, v0=still)) for size in (1.0, 0.0)]
        found: Floats = runs[0].v[-1] - runs[1].v[-1]
        return found if all(one.outcome.ok for one in runs) else np.full(len(still), np.inf)

    def stepped(steps: int) -> Floats:
        given = probe.given(t_end / steps)
        return changed(lambda one: probe.engine.prepare(one, probe.profile, **given).run(), steps)

    wanted = changed(lambda one: engines.load("reference").prepare(one, "compiled").run())
    size = float(np.max(np.abs(wanted)))
    if SHOWN < size < np.inf:
        found = 2.0 * stepped(2 * DRIVEN) - stepped(DRIVEN)
        off = float(np.max(np.abs(found - wanted) / np.maximum(np.abs(wanted), LIGHT * size)))
        yield _row("activations", found / t_end, wanted / t_end, off, OF_DRIVES)


def _held(probe: Probe) -> Iterator[AuditRow]:
    """Step beside the surfaces of rows that are always on, and across them: h'' = -a1 h' - (a0 + a2 h^2) h.

    Each of the three parts is as large as the others: at a gap h, and a rate that a0 h and a1 h' are alike for.
    """
    rows, law, other = probe.held, probe.case.law, probe.opening
    if not len(rows) or probe.system.control is not None:
        return
    gap, dt = probe.theirs["gap"](probe.case.q0), PART * probe.dt
    draw = np.random.default_rng(SEED)
    high, apart = CLEAR * _sized(draw, (len(rows),)), np.maximum(gap[other], 0.0) + 10.0 * CLEAR
    q = probe.placed(np.concatenate([rows, other]), np.concatenate([high, apart]))
    H = probe.theirs["H"](q)[rows]
    rates = np.where(law.a1[rows] > 0.0, law.a0[rows] * CLEAR / np.maximum(law.a1[rows], SHOWN), 0.0)
    v = np.linalg.lstsq(H, rates * _sized(draw, (len(rows),)))[0]
    h, hd = probe.theirs["gap"](q)[rows], H @ v
    run = probe.stepped(q, v, PART, 1)
    if run is None or not np.allclose(h, high, rtol=0.0, atol=1e-3 * CLEAR):
        return
    parts = np.stack([law.a1[rows] * hd, (law.a0[rows] + law.a2[rows] * h * h) * h])
    wanted = -parts.sum(axis=0)
    bends = probe.theirs["H"](run.q[-1])[rows] @ run.v[-1] - hd
    size = np.maximum(np.abs(parts).sum(axis=0), SHOWN / dt)
    implicit = float(np.max(law.a1[rows] * dt + (law.a0[rows] + law.a2[rows] * h * h) * dt * dt))  # to first order
    off = float(np.max(np.abs(bends / dt - wanted) / size))
    yield _row("held rows", bends / dt, wanted, off, TOLERANCE + implicit)


def _has_more(probe: Probe) -> bool:
    """Whether a file as it stands has dry friction, soft in engines too, or pairs that no motion brings closer.

    Engines let those rub that touch.
    """
    scene = probe.case.scene
    if scene is None or not probe.case.file:
        return False
    return bool(np.any(np.asarray(probe.system.friction_loss) > 0.0)) or (
        len(contacts(scene)) + len(watched(scene)) < len(scene.pairs)
    )


def _places(probe: Probe, run: Trajectory) -> Iterator[AuditRow]:
    """Tell by which part of the change of velocities in a step it moves bodies."""
    turning, dt = [i + k for i in probe.case.quaternions for k in range(4)], np.diff(run.t)
    straight = np.delete(np.arange(run.q.shape[1]), turning)
    q, parts = np.array(run.q[0]), (run.v[:-1], np.diff(run.v, axis=0))
    moved, change = (probe.system.displacement(q, dt @ part)[straight] for part in parts)
    known = float(np.max(np.abs(run.q))) * float(np.finfo(np.float64).eps)
    if float(np.linalg.norm(change)) * OF_PLACES > 10.0 * known:
        more, promised = (run.q[-1] - run.q[0])[straight] - moved, probe.engine.steps[probe.profile]
        theta = float(more @ change) / float(change @ change)
        yield _row("positions", theta, promised, abs(theta - promised), OF_PLACES)


def _blows(probe: Probe) -> Iterator[AuditRow]:
    """Let pairs meet, one at a time; yield what is worst of all."""
    if probe.meets > FASTEST:
        return
    found = [row for rows, mu in _pairs(probe) for row in _blow(probe, rows, mu)]
    for quantity in dict.fromkeys(row.quantity for row in found):
        yield max((row for row in found if row.quantity == quantity), key=lambda row: row.difference)


def _pairs(probe: Probe) -> Iterator[tuple[Rows, float]]:
    """Yield the normal rows of every pair, and its coefficient of friction."""
    case = probe.case
    named = {name: i for i, name in enumerate(case.contacts)}
    met: Sequence[Contact] = contacts(case.scene) if case.general and case.scene is not None else ()
    for contact in met[:MOST]:
        yield np.array([named[name] for name in contact.normals]), contact.friction
    if not met:
        yield from ((np.array([row]), 0.0) for row in probe.opening[:1])


def _blow(probe: Probe, pair: Rows, mu: float) -> Iterator[AuditRow]:
    """Let one pair meet at its nearest places, and slip along one of its tangents."""
    met = next((met for way in (0, 1, -1) if (met := _meeting(probe, pair, way if mu > 0.0 else -1, mu))), None)
    if met is None:
        return
    run, free = (probe.stepped(q, met.v, OF_BLOWS, BLOWS) for q in (met.q, met.away))
    if run is None or free is None:
        return
    H, e = probe.theirs["H"](met.q), probe.restitution
    if np.isfinite(e):
        left = H[met.rows] @ run.v[-1] / probe.meets
        found = float(left[np.argmax(np.abs(left - e))])
        yield _row("restitution", found, e, abs(found - e) / (e or 1.0))
    if probe.steps and len(run.t) == len(free.t) == BLOWS + 1:
        yield from _touched(probe, (run.v - free.v) @ H[met.rows].T)
        yield from _pressed(probe, met, (run.lam - free.lam)[:, met.among], run.v[-1] - free.v[-1], mu)


def _touched(probe: Probe, rates: Floats) -> Iterator[AuditRow]:
    """Tell the gap at which a pair meets, in steps: at the first sample whose velocity is another than in free flight.

    Where velocities do not count in how far a step moves, they follow from where it ends.
    """
    size = np.max(np.abs(rates), axis=1)
    behind = np.flatnonzero(size > CHANGES * probe.meets)
    if len(behind):
        first = int(behind[0])
        while first > 0 and size[first - 1] > GROWS * size[first]:  # a spring begins to push by less
            first -= 1
        found = BEFORE - float(first) + float(probe.engine.steps[probe.profile] > 0.0)
        yield _row("touches", found, 0.0, abs(found), HALF)


def _pressed(probe: Probe, met: Meeting, lam: Floats, change: Floats, mu: float) -> Iterator[AuditRow]:
    """Hold the forces that are recorded against what they do, and friction against what pushes.

    A force is that of the step before its instant, or of the one behind it.
    """
    H, M = probe.theirs["H"](met.q), probe.theirs["M"](met.q)
    p = np.linalg.lstsq(H[np.concatenate([met.among, probe.held])].T, M @ change)[0]
    every, recorded = met.sums(p), (OF_BLOWS * probe.dt * met.sums(part.sum(axis=0)) for part in (lam[1:], lam[:-1]))
    if not every[0] > NONE * float(np.max(np.abs(M @ met.v))):
        return
    told = min(recorded, key=lambda one: float(np.max(np.abs(one - every))))
    yield _row("forces", told, every, float(np.max(np.abs(told - every))) / every[0])
    if met.way >= 0:
        alone = H[met.rows] @ np.linalg.solve(M, H[met.rows].T)
        blow = np.full(len(met.rows), probe.meets * (1.0 + probe.restitution))
        pushes = (every[0], float(np.sum(np.linalg.lstsq(alone, blow)[0])))  # some bound it by that without friction
        found = min((-every[1 + met.way] / push for push in pushes if np.isfinite(push)), key=lambda x: abs(x - mu))
        yield _row("friction", found, mu, abs(found - mu) / mu)


@dataclass(frozen=True)
class Meeting:
    """A state just before a pair meets, without a turn.

    Attributes:
        q, v: the state. away: positions far from it.
        rows: normal rows that meet. among: these, and behind them their tangents, if they slip.
        way: along which of their two tangents they slip; below 0 for none.
    """

    q: Floats
    v: Floats
    away: Floats
    rows: Rows
    among: Rows
    way: int

    def sums(self, values: Floats) -> Floats:
        """Return what all places bear together: along the normal, and along each tangent."""
        count = len(self.rows)
        ways = [values[count + k : 3 * count : len(WAYS)].sum() for k in range(len(WAYS) if self.way >= 0 else 0)]
        return np.array([values[:count].sum(), *ways])


def _meeting(probe: Probe, pair: Rows, way: int, mu: float) -> Meeting | None:
    """Return a state; None where no motion brings the pair together so, or none that leaves the others alone."""
    gap, step = probe.theirs["gap"](probe.case.q0), OF_BLOWS * probe.dt * probe.meets
    others = probe.opening[~np.isin(probe.opening, pair)]
    kept = np.concatenate([gap[probe.held], np.maximum(gap[others], 0.0) + CLEAR])
    every, apart = np.concatenate([probe.held, others, pair]), gap[pair] - np.min(gap[pair])
    q, away = (probe.placed(every, np.concatenate([kept, apart + high])) for high in (BEFORE * step, CLEAR))
    ways = probe.ways(pair) if way >= 0 else np.zeros(0, dtype=int)
    H = probe.theirs["H"](q)[np.concatenate([probe.held, pair, ways])]
    slips = SLIPS * probe.meets * (np.arange(len(ways)) % len(WAYS) == way)
    rates = np.concatenate([np.zeros(len(probe.held)), np.full(len(pair), -probe.meets), slips])
    v = np.linalg.lstsq(H, rates)[0]
    near = np.allclose(probe.theirs["gap"](q)[every], [*kept, *(apart + BEFORE * step)], rtol=0.0, atol=1e-3 * step)
    alike = np.allclose(H @ v, rates, rtol=0.0, atol=1e-9 * probe.meets)
    if not (near and alike):
        return None
    rows = pair[apart < ROUNDED]
    found = Meeting(q, v, away, rows, np.concatenate([rows, probe.ways(rows)]) if way >= 0 else rows, way)
    return found if way < 0 or _bears(probe, found, mu) else None


def _bears(probe: Probe, met: Meeting, mu: float) -> bool:
    """Whether all places push where friction is at its bound: none lifts, and none jams."""
    H, M, count = probe.theirs["H"](met.q)[met.among], probe.theirs["M"](met.q), len(met.rows)
    pushes = H[:count] - mu * H[count + met.way :: len(WAYS)]
    answers = H[:count] @ np.linalg.solve(M, pushes.T)
    p = np.linalg.lstsq(answers, np.ones(count))[0]
    return bool(np.all(p > 0.0) and np.allclose(answers @ p, 1.0))


def _row(quantity: str, mine: Any, theirs: Any, off: float, tolerance: float = TOLERANCE) -> AuditRow:
    mine, theirs = (" ".join(f"{x:.6g}" for x in np.atleast_1d(value)) for value in (mine, theirs))
    off = off if np.isfinite(off) else np.inf
    return AuditRow(quantity=quantity, mine=mine, theirs=theirs, difference=off, tolerance=tolerance)
