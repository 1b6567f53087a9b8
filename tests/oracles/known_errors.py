"""Made-up runs and what every limited metric must say of them: an error at a drawn place, its size known beforehand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from crossbody import engines
from crossbody.cases import Case, Event, Mode, Tier, Trajectory, load
from crossbody.cases.contacts import AT_REST, CLOSED, LIGHT
from crossbody.cases.mechanisms.delta import pose
from crossbody.cases.parameters import of_numbers
from crossbody.reports.measuring.truth import Truth, from_run, sample_times

OFF = 1e-3
"""Size of an error, over what it is measured by."""
Scale = Callable[[Trajectory], np.ndarray]


@dataclass(frozen=True)
class Scene:
    """A case with the right motion, and a generator that draws where it is spoilt."""

    case: Case
    truth: Truth
    rng: np.random.Generator

    @property
    def run(self) -> Trajectory:
        return self.truth.trajectory

    def sign(self) -> float:
        return float(self.rng.choice([-1.0, 1.0]))

    def one(self, among: Sequence[Any] | np.ndarray) -> int:
        return int(self.rng.choice(np.asarray(among)))

    def sample(self) -> int:
        """A sample between two others, and not at the instant of an event."""
        t, k = self.run.t, np.arange(2, len(self.run.t) - 2)
        apart = np.min([np.abs(t - e.t) for e in (*self.run.events, *self.run.switches)] or [t + 1.0], axis=0)
        return self.one(k[(t[k] > t[k - 1]) & (t[k] < t[k + 1]) & (apart[k] > 1e-6 * t[-1])])

    def at(self, t: float) -> np.ndarray:
        """Both samples of an event."""
        return np.flatnonzero(np.abs(self.run.t - t) <= 1e-12 * self.run.t[-1])


Known = Callable[[Scene], tuple[Trajectory, float]]
"""A run that is wrong at one place, and what the metric must say of it."""

RUNS: dict[str, tuple[str, str, dict[str, Any], int]] = {
    "ball": ("bouncing_ball", "elastic", {}, 0),
    "linear ball": ("bouncing_ball", "linear", {}, 0),
    "sliders": ("newtons_cradle", "sliders", {"gap": 1e-3}, 0),
    "pendulums": ("newtons_cradle", "pendulums", {"n": 3}, 301),
    "springs": ("newtons_cradle", "sliders", {"collisions": "resolved", "gap": 1e-4}, 0),
    "box": ("red_body", "resolved", {}, 0),
    "blow": ("red_body", "frozen", {}, 301),
    "block": ("soft_contact", "axis", {}, 301),
    "robot": ("delta_impulse", "light", {"t_end": 0.5}, 0),
    "maze": ("ball_maze", "solve", {}, 301),
    "edge": ("ball_maze", "outside", {}, 301),
    "swing": ("ball_maze", "inside", {"t_end": 2.0}, 301),
}
"""Case, variant, parameters, and number of equidistant rows (0 for a run's own steps, or the closed form's)."""


@cache
def right(name: str) -> tuple[Case, Truth]:
    """A case and its motion: the closed form where it has one, else a run that is taken to be right."""
    if name == "mirrored robot":
        case, truth = right("robot")
        signs = {each: -getattr(truth.trajectory, each) for each in ("q", "v", "lam")}
        return case, from_run(replace(truth.trajectory, **signs), Tier.D, "made up")
    which, variant, parameters, rows = RUNS[name]
    case = load(which, variant, **parameters)
    if case.closed_form is not None:
        times = sample_times(case.closed_form(np.zeros(1)), case.t_end, grid=301, inside=21)
        return case, replace(from_run(case.closed_form(times), Tier.A, "closed form"), at=case.closed_form)
    run = engines.load("reference").prepare(case, "compiled", samples=rows).run()
    return case, from_run(run, Tier.D, "made up")


def scene(name: str, seed: int) -> Scene:
    return Scene(*right(name), np.random.default_rng(seed))


def changed(run: Trajectory, name: str, at: Any, by: Any, whole: bool = False) -> Trajectory:
    """The run with entries of one signal larger by so much, or (`whole`) of this value."""
    values = getattr(run, name).copy()
    values[at] = by if whole else values[at] + by
    return replace(run, **{name: values})


def booked(run: Trajectory, name: str, at: Any, by: float) -> Trajectory:
    """The run with entries of one account larger by so much."""
    assert run.ledger is not None
    account = getattr(run.ledger, name).copy()
    account[at] += by
    return replace(run, ledger=replace(run.ledger, **{name: account}))


def moved(run: Trajectory, k: int, by: float) -> Trajectory:
    """The run with one event later."""
    events = list(run.events)
    events[k] = replace(events[k], t=events[k].t + by)
    return replace(run, events=tuple(events))


def bumped(signal: str, scale: Scale, columns: Callable[[Scene], Sequence[int]] | None = None) -> Known:
    """One column at one sample, either way, by a part of its scale (columns,)."""

    def known(s: Scene) -> tuple[Trajectory, float]:
        size = np.broadcast_to(scale(s.run), getattr(s.run, signal).shape[1:])
        column = s.one(range(len(size)) if columns is None else columns(s))
        return changed(s.run, signal, (s.sample(), column), s.sign() * OFF * size[column]), OFF

    return known


def off_its_surface(s: Scene) -> tuple[Trajectory, float]:
    """One touch, or one row that comes free from below, recorded a part of the longest step's way away."""
    own = (e for e in s.run.events if s.case.law.unilateral[e.contact] and e.t > 0.0)
    closing = {(Mode.FREE, mode) for mode in CLOSED}
    surface = [e for e in own if (e.before, e.after) in closing | {(Mode.BALLISTIC, Mode.FREE)}]
    event = surface[s.one(range(len(surface)))]
    near, by = AT_REST * max(1.0, np.abs(s.run.q).max()), OFF * np.abs(s.run.gap).max()
    run = changed(s.run, "gap", (s.at(event.t), event.contact), s.sign() * (near + by))
    return run, by / np.abs(np.diff(run.gap[:, event.contact])).max()


def pushing_as_it_lets_go(s: Scene) -> tuple[Trajectory, float]:
    """One row that is let go, below its surface and by itself, while it pushes by a part of the longest step's way."""
    t = [e.t for e in s.run.events]
    below = [
        (e, gap) for e in s.run.events if e.before in CLOSED and e.after not in CLOSED and t.count(e.t) == 1
        if (gap := abs(s.run.gap[s.at(e.t)[0], e.contact])) > OFF * np.abs(np.diff(s.run.gap[:, e.contact])).max()
    ]  # fmt: skip
    event, gap = below[s.one(range(len(below)))]
    by = 0.1 * OFF * np.abs(s.run.lam).max()
    light = LIGHT * max(1.0, np.abs(s.run.lam).max())
    run = changed(s.run, "lam", (s.at(event.t)[0], event.contact), s.sign() * (light + by), whole=True)
    return run, by / np.abs(np.diff(run.lam[:, event.contact])).max()


def of_all(signal: str) -> Scale:
    return lambda run: np.abs(getattr(run, signal)).max()


def of_each(signal: str) -> Scale:
    return lambda run: np.abs(getattr(run, signal)).max(axis=0)


def kinetic(run: Trajectory) -> np.ndarray:
    """The largest kinetic energy."""
    return run.energy[:, 0].max()


def energies(run: Trajectory) -> np.ndarray:
    """The largest kinetic energy, or the swing of the potential."""
    return max(run.energy[:, 0].max(), np.ptp(run.energy[:, 1]))


def moving(signal: str) -> Callable[[Scene], Sequence[int]]:
    """Columns that do not rest."""

    def columns(s: Scene) -> Sequence[int]:
        own = of_each(signal)(s.run)
        return np.flatnonzero(own > 1e-3 * own.max()).tolist()

    return columns


def of_unit(signal: str, named: str) -> Scale:
    """The largest of all columns that share a unit (columns,); those of the box."""

    def scale(run: Trajectory) -> np.ndarray:
        own, units = of_each(signal)(run), np.array([c.unit for c in getattr(right("box")[0], named)])
        return np.array([own[units == unit].max() for unit in units])

    return scale


def begun(signal: str, scale: Scale) -> Known:
    """A start beside the case's."""

    def known(s: Scene) -> tuple[Trajectory, float]:
        size = np.broadcast_to(scale(s.run), getattr(s.run, signal).shape[1:])
        column = s.one(range(len(size)))
        return changed(s.run, signal, (0, column), s.sign() * OFF * size[column]), OFF

    return known


def account(s: Scene) -> tuple[Trajectory, float]:
    """An energy, or an account of the ledger."""
    off, k = s.sign() * OFF * float(energies(s.run)), s.sample()
    name = s.rng.choice(["energy", "contact", "input", "dissipated"])
    if name == "energy":
        return changed(s.run, name, (k, s.one([0, 1])), off), OFF
    return booked(s.run, name, (k, s.one(range(s.run.gap.shape[1]))) if name == "contact" else k, off), OFF


def worked(s: Scene) -> tuple[Trajectory, float]:
    """Work of one row that the truth does not know."""
    at = (s.sample(), s.one(range(s.run.gap.shape[1])))
    return booked(s.run, "contact", at, s.sign() * OFF * float(energies(s.run))), OFF


def given(s: Scene) -> tuple[Trajectory, float]:
    """Work of the rows above zero: the law made energy."""
    assert s.run.ledger is not None
    k, row = s.sample(), s.one(np.flatnonzero(s.case.law.unilateral))
    before = float(s.run.ledger.contact[k, s.case.law.unilateral].sum())
    return booked(s.run, "contact", (k, row), OFF * float(kinetic(s.run)) - before), OFF


def switched(s: Scene) -> tuple[Trajectory, float]:
    """Work at the end that no switch has made."""
    at = (-1, s.one(range(s.run.gap.shape[1])))
    return booked(s.run, "contact", at, s.sign() * OFF * float(kinetic(s.run))), OFF


def closed(s: Scene, shut: bool = True) -> tuple[int, int]:
    """A sample away from events, and a row that is closed there, or open."""
    for _ in range(1000):
        k = s.sample()
        rows = np.flatnonzero(np.isin(s.run.mode[k], CLOSED) == shut)
        if len(rows):
            return k, s.one(rows)
    raise AssertionError("nothing touches")


def pressed(s: Scene) -> tuple[Trajectory, float]:
    """A multiplier that is not the law's."""
    return changed(s.run, "lam", closed(s), s.sign() * OFF * np.abs(s.run.lam).max()), OFF


def pulling(s: Scene) -> tuple[Trajectory, float]:
    return changed(s.run, "lam", closed(s), -OFF * s.run.lam.max(), whole=True), OFF


def acting(s: Scene) -> tuple[Trajectory, float]:
    return changed(s.run, "lam", closed(s, shut=False), s.sign() * OFF * s.run.lam.max(), whole=True), OFF


def acting_unseen(s: Scene) -> tuple[Trajectory, float]:
    """The same of a run that has no modes: where it stands higher than anything that touches."""
    k, row = closed(s, shut=False)
    while s.run.gap[k, row] < 0.1 * s.run.gap.max():
        k, row = closed(s, shut=False)
    run = changed(s.run, "lam", (k, row), s.sign() * OFF * s.run.lam.max(), whole=True)
    return replace(run, mode=np.full_like(run.mode, -1)), OFF


def impulse(run: Trajectory) -> float:
    """The largest impulse of any row at any sample, by the trapezoidal rule."""
    total = np.cumsum(0.5 * np.diff(run.t)[:, None] * (run.lam[1:] + run.lam[:-1]), axis=0)
    return float(np.abs(total).max())


def pushed(s: Scene) -> tuple[Trajectory, float]:
    """An impulse that the truth does not have, of one row from one sample on."""
    k = s.sample()
    off = OFF * impulse(s.run) / (0.5 * (s.run.t[k + 1] - s.run.t[k - 1]))
    return changed(s.run, "lam", (k, s.one(range(s.run.gap.shape[1]))), s.sign() * off), OFF


def struck(s: Scene) -> tuple[Trajectory, float]:
    """An impulse of a collision in no time."""
    k, value = s.one([i for i, e in enumerate(s.run.events) if e.impulse]), s.sign() * OFF
    rows = [sum(e.impulse for e in s.run.events if e.contact == i) for i in range(s.run.gap.shape[1])]
    events = list(s.run.events)
    lam = np.array([np.sum(0.5 * np.diff(s.run.t) * (c[1:] + c[:-1])) for c in s.run.lam.T])
    events[k] = replace(events[k], impulse=events[k].impulse + value * np.abs(lam + rows).max())
    return replace(s.run, events=tuple(events)), OFF


def later(s: Scene) -> tuple[Trajectory, float]:
    """One touch or release at another instant, before the next event of its row."""
    kinds = [i for i, e in enumerate(s.run.events) if (e.before in CLOSED) != (e.after in CLOSED)]
    return moved(s.run, s.one(kinds), s.sign() * 1e-7), 1e-7


def handed(s: Scene) -> tuple[Trajectory, float]:
    """One hand-over at another instant."""
    kinds = [i for i, e in enumerate(s.run.events) if (e.before, e.after) == (Mode.COLLISION, Mode.CONTACT)]
    return moved(s.run, s.one(kinds), s.sign() * 1e-7), 1e-7


def freed(s: Scene) -> tuple[Trajectory, float]:
    """A row that was let go below the surface comes free later: the way of its gap until then, at its fastest rate."""
    t, gap = s.run.t, s.run.gap[:, 0]
    k = s.one([i for i, e in enumerate(s.run.events) if e.before is Mode.BALLISTIC])
    slopes = np.diff(gap)[np.diff(t) > 0.0] / np.diff(t)[np.diff(t) > 0.0]
    behind = s.at(s.run.events[k].t)[-1]
    slope = (gap[behind + 1] - gap[behind]) / (t[behind + 1] - t[behind])
    return moved(s.run, k, 1e-7), 1e-7 * slope / np.abs(slopes).max()


def lost(of: Callable[[Event], bool]) -> Known:
    """The last contact of one row, or its end alone, left out."""

    def known(s: Scene) -> tuple[Trajectory, float]:
        events = s.run.events
        rows = sorted({e.contact for e in events if of(e)})
        row = s.one(rows)
        last = max(i for i, e in enumerate(events) if e.contact == row and of(e))
        kept = tuple(e for i, e in enumerate(events) if i < last or e.contact != row)
        return replace(s.run, events=kept), -1.0

    return known


def bounced(s: Scene) -> tuple[Trajectory, float]:
    """One contact, the first or a later one, that gives back more or less."""
    run = s.run
    touches, ends = ([e.t for e in run.events if (e.after in CLOSED) == shut and shut != (e.before in CLOSED)]
                     for shut in (True, False))  # fmt: skip
    k = s.one(range(len(ends)))
    into = run.v[s.at(touches[k])[0], 0]
    return changed(run, "v", (s.at(ends[k]), 0), s.sign() * OFF * into), OFF


def deeper(s: Scene) -> tuple[Trajectory, float]:
    """One gap below the surface, by a part of the deepest."""
    k, row = closed(s)
    while s.run.gap[k, row] > -0.1 * np.abs(s.run.gap.min()):
        k, row = closed(s)
    return changed(s.run, "gap", (k, row), OFF * s.run.gap.min()), OFF


def opened(s: Scene) -> tuple[Trajectory, float]:
    """A closure that is open at one sample."""
    run = replace(s.run, gap=0.0 * s.run.gap)
    return changed(run, "gap", (s.sample(), s.one(range(run.gap.shape[1]))), s.sign() * OFF), OFF


def aside(s: Scene) -> tuple[Trajectory, float]:
    """The flange beside its place at one sample."""
    from crossbody.cases.mechanisms.delta.claims import flange

    p = of_numbers(s.case.parameters)
    k, way = s.sample(), np.zeros(3)
    way[s.one(range(3))] = s.sign() * OFF
    return changed(s.run, "q", k, pose.pose(p, flange(s.run, s.case)[k] + way), whole=True), OFF


def momentum(s: Scene) -> tuple[Trajectory, float]:
    brought = abs(float(s.run.v[0].sum()))  # equal masses
    return changed(s.run, "v", (s.sample(), s.one(range(s.run.v.shape[1]))), s.sign() * OFF * brought), OFF


def passed(s: Scene) -> tuple[Trajectory, float]:
    """One ring change at another instant."""
    switches = list(s.run.switches)
    k = s.one([i for i, each in enumerate(switches) if each.variable == channel(s)])
    switches[k] = replace(switches[k], t=switches[k].t + s.sign() * OFF)
    return replace(s.run, switches=tuple(switches)), OFF


def channel(s: Scene) -> int:
    return s.case.discrete.index("channel")


def widest(s: Scene) -> list[int]:
    """The row whose gap opens farthest: its own measure is that of all."""
    return [int(np.argmax(np.abs(s.run.gap).max(axis=0)))]


def misnamed(s: Scene) -> tuple[Trajectory, float]:
    """One mode that no event left."""
    k, row = s.sample(), s.one(range(s.run.gap.shape[1]))
    return changed(s.run, "mode", (k, row), Mode.COLLISION_SEPARATION, whole=True), 1.0


ERRORS: dict[str, tuple[str, Known]] = {
    "position": ("box", bumped("q", of_unit("q", "coordinates"), moving("q"))),
    "position below zero": ("mirrored robot", bumped("q", of_each("q"), moving("q"))),
    "velocity": ("box", bumped("v", of_unit("v", "velocities"))),
    "start_error": ("box", begun("q", of_unit("q", "coordinates"))),
    "start_error in velocity": ("sliders", begun("v", of_all("v"))),
    "gap_error": ("box", bumped("gap", of_all("gap"), widest)),
    "gap_residual": ("box", bumped("gap", of_all("gap"))),
    "gap_residual of closures": ("robot", bumped("gap", lambda run: 1e-6 * np.abs(run.q).max())),
    "energy_drift": ("box", bumped("energy", energies)),
    "energy_residual": ("box", bumped("energy", of_each("energy"))),
    "energy_residual below zero": ("robot", bumped("energy", of_each("energy"))),
    "energy_integrator": ("box", account),
    "energy_integrator with friction": ("block", account),
    "energy_law": ("box", given),
    "energy_switching_error": ("springs", switched),
    "contact_work": ("sliders", worked),
    "contact_work of one row": ("linear ball", worked),
    "law_residual": ("box", pressed),
    "lam_error": ("robot", bumped("lam", of_all("lam"))),
    "lam_error below zero": ("mirrored robot", bumped("lam", of_all("lam"))),
    "lam_impulse": ("box", pushed),
    "lam_impulse below zero": ("mirrored robot", pushed),
    "lam_impulse_path": ("box", pushed),
    "lam_impulse_path below zero": ("mirrored robot", pushed),
    "lam_impulse_path of collisions in no time": ("blow", struck),
    "complementarity": ("box", pulling),
    "complementarity of an open row": ("box", acting),
    "complementarity without modes": ("box", acting_unseen),
    "event_gap": ("box", off_its_surface),
    "event_gap of one row": ("linear ball", off_its_surface),
    "event_gap of a row that lets go": ("linear ball", pushing_as_it_lets_go),
    "event_gap of rows that let go": ("box", pushing_as_it_lets_go),
    "event_times": ("box", later),
    "event_times of one row": ("linear ball", later),
    "mode_times": ("box", handed),
    "mode_times of a row that comes free": ("linear ball", freed),
    "touch_count": ("box", lost(lambda e: e.after in CLOSED and e.before not in CLOSED)),
    "release_count": ("box", lost(lambda e: e.before in CLOSED and e.after not in CLOSED)),
    "mode_residual": ("sliders", misnamed),
    "restitution_error": ("ball", bounced),
    "penetration_error": ("box", deeper),
    "penetration_error of one row": ("ball", deeper),
    "constraint_drift": ("robot", opened),
    "angle_error": ("robot", bumped("q", lambda run: np.ones(run.q.shape[1]))),
    "flange": ("robot", aside),
    "momentum": ("sliders", momentum),
    "ring_change_times": ("maze", passed),
}
"""Scene and error of every metric that measures a difference; words behind the name tell two of one metric apart."""
