"""Equilibria of a case, each in a mode set, with the linear model there.

The model at a place is minimal: rows that are held stay held, unless their law is what is looked at (a
ball in contact, soft fingers). What acts from outside on a scene is held at what it is there. A mechanism
without a list of places is looked at where its run passes: in every mode set that it visits. What slides,
or is driven, stands nowhere: its model is the tangent of the right-hand side where the run is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from crossbody import cases
from crossbody.cases import Case, Mode, Outcome, SceneError, Trajectory, UnknownName
from crossbody.cases.arrays import Floats
from crossbody.engines.equations import system_of
from crossbody.engines.linear import Spot
from crossbody.engines.reference import ReferenceRun
from crossbody.reference import System, delta
from crossbody.reference.delta import scene
from crossbody.reference.delta.loop import closed_loop
from crossbody.reference.kinds import Array
from crossbody.reference.linear import LinearModel, Trim, linearise, trim

TRIED = 8
"""Samples of a run beside which equilibria are looked for in each set of rows."""
DEEP, SAME, ALIKE = 1e-9, 1e-9, 1e-6
"""Depth that rounding leaves of a bound; change of a position, and of poles over the largest, that is none."""
MOVING = ", moving"
"""Behind the name of what is no equilibrium: an instant of a motion."""
ON = (Mode.CONTACT, Mode.COLLISION, Mode.BILATERAL, Mode.STICK, Mode.SLIP)


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """An equilibrium in a mode set.

    Attributes:
        name: what it is.
        case: the scene in which it lies.
        system: its equations.
        trim: state, inputs and multipliers there.
        model: its linear model, or None where there is no equilibrium, or a row would have to pull in it.
        t: time at which what depends on it is frozen, s.
        held: whether the rows that are on are held, instead of following their law.
        powered: whether the case's servos act.
        controlled: whether the model is that of a feedback loop around the equilibrium, in continuous time.
        why: why there is no model, where the law has none.
    """

    name: str
    case: Case
    system: System
    trim: Trim
    model: LinearModel | None
    t: float
    held: bool
    powered: bool
    controlled: bool = False
    why: str = ""

    @property
    def spot(self) -> Spot | None:
        """Where an engine has to linearise; None where there is nothing, or what no engine has."""
        if self.model is None or self.controlled or self.system.frictional:
            return None
        found = self.trim
        rows = tuple(found.active.tolist())
        return Spot(q=found.q, v=found.v, u=found.u, rows=rows, lam=found.lam, t=self.t, powered=self.powered)

    def linearised(self, *, reduce: bool) -> LinearModel:
        """The model from all inputs to q and v: of all states, or of those that the rows leave."""
        names, found = [coordinate.name for coordinate in self.case.velocities], self.trim
        return linearise(
            self.system, found.q, found.v, found.u, found.active.tolist(), outputs=("q", "v"), names=names,
            reduce=reduce, t=self.t,
        )  # fmt: skip


def build(case: Case) -> System:
    """The mechanism of a case, without a sampled controller."""
    return system_of(case)


def places(case: Case, at: Mapping[str, float] | None = None) -> tuple[Place, ...]:
    """The equilibria of a case, of which some stand in many places: near x, y, z of the flange, m."""
    return tuple(PLACES.get(case.mechanism, _visited)(case, _known(case, at or {})))


def _known(case: Case, at: Mapping[str, float]) -> Mapping[str, float]:
    valid = ("x", "y", "z") if case.mechanism == "delta" else ()
    for name in at:
        if name not in valid:
            raise UnknownName(f"place of {case.name}", name, valid)
    return at


def _place(
    case: Case, name: str, active: Sequence[int], *, held: bool = True, q: ArrayLike | None = None,
    v: ArrayLike | None = None, t: float = 0.0, free: Sequence[int] | None = None, rates: Sequence[int] = (),
    inputs: Sequence[int] = (), system: System | None = None, powered: bool = True,
) -> Place:  # fmt: skip
    made = build(case) if system is None else system
    u = case.inputs.at(t) if case.scene is not None and case.inputs is not None else None
    found = trim(made, case.q0 if q is None else q, v, u, active=active, free=free, rates=rates, inputs=inputs, t=t)
    model, why = None, ""
    if found.pulling:
        rows = ", ".join(case.contacts[i] for i in found.pulling)
        why = f"It is one of the equations alone: {rows} would pull, and can only push."
    elif found.outcome.ok:
        names = [coordinate.name for coordinate in case.velocities]
        model = linearise(made, found.q, found.v, found.u, active, names=names, reduce=held, t=t)
    return Place(
        name=name, case=case, system=made, trim=found, model=model, t=t, held=held, powered=powered, why=why
    )  # fmt: skip


def _delta(case: Case, at: Mapping[str, float]) -> list[Place]:
    """Held by constant torques; where moving servos end; in its loop, if it has a controller."""
    robot = scene.robot_of(case.parameters)
    q = case.q0
    if at:
        here = dict(zip("xyz", delta.flange(robot, case.q0).tolist(), strict=True)) | dict(at)
        q = delta.inverse(robot, [here[axis] for axis in "xyz"])
    z = delta.flange(robot, q)
    system = delta.system(robot, p=float(case.number("p")))
    name = f"flange at ({z[0]:.4g}, {z[1]:.4g}, {z[2]:.4g}) m"
    found = [_place(case, name, range(6), q=q, free=[], inputs=[0, 1, 2], system=system, powered=False)]
    if "ramp" in case.parameters and not at:
        y = np.full(3, delta.elbow_angle(robot) + case.number("offset"))
        guess = delta.holding_pose(robot, float(y[0]))
        found.append(_place(case, "where the servos end", range(6), q=guess, t=case.t_end))
    seen = [_of_flange(robot, place) for place in found]
    if "period" in case.parameters:
        model = closed_loop(robot, q, scene.controller_of(case.parameters))
        seen.append(replace(seen[0], name=f"{name}, controlled", model=model, controlled=True))
    return seen


def _of_flange(robot: delta.Robot, place: Place) -> Place:
    """With the flange's position as the outputs of its model."""
    if place.model is None:
        return place
    weights = np.zeros((3, 18))
    weights[:, :9] = delta.virtual_jacobian(robot, place.trim.q)
    seen = place.linearised(reduce=True).combined(weights, [f"flange {axis} [m]" for axis in "xyz"])
    return replace(place, model=seen)


def _maze(case: Case, at: Mapping[str, float]) -> list[Place]:
    """On top of every ring and at the bottom inside it, with the slip rows if there are any."""
    found = []
    slip = len(case.contacts) > 6
    closed = case.parameters["controller"] == "continuous"
    for ring in range(int(case.number("rings"))):
        for side, row, follower in (("outer", 0, 6), ("inner", 3, 7)):
            if closed and side == "inner":
                continue
            phase = {**case.parameters, "ring": ring, "side": side, "angle": 0.0, "theta": _solid(case, ring)}
            here = cases.load(case.name, case.variant, **phase)
            rows = [row, follower] if slip else [row]
            where = "top" if side == "outer" else "bottom inside"
            found.append(_place(here, f"ring {ring}, {where}", rows, free=[1, 2]))
    return found


def _solid(case: Case, ring: int) -> float:
    """An angle of the maze at which a ring is solid at top and bottom: half a spacing beside its gaps."""
    gaps, phase = int(case.number(f"gaps{ring}")), np.radians(case.number(f"phase{ring}"))
    spacing = 2.0 * np.pi / max(gaps, 1)
    angles = np.linspace(0.0, spacing, 97)[:-1]
    ends = np.array([0.5 * np.pi, -0.5 * np.pi])
    off = np.abs((ends[None] - phase - angles[:, None] + 0.5 * spacing) % spacing - 0.5 * spacing).min(axis=1)
    return float(angles[np.argmax(off)])


def _soft(case: Case, at: Mapping[str, float]) -> list[Place]:
    """Closed fingers in every mode set; positions, sensors and multipliers are found."""
    from crossbody.cases.mechanisms.soft import claims as closed
    from crossbody.cases.mechanisms.soft.scene import numbers

    p, found = numbers(case.parameters), []
    for name, rows in (("grasp", [0, 1]), ("left finger", [0]), ("right finger", [1])):
        q, v = closed.grasp(p) if len(rows) == 2 else closed.touching(p)
        if name == "left finger":
            q[1:3] += 0.01
        steady = {"free": [0, 1, 2, 3, 4], "rates": [5, 6], "t": p["close_end"]}
        found.append(_place(case, name, rows, held=False, q=q, v=v, **steady))  # type: ignore[arg-type]
    return found


def _red_body(case: Case, at: Mapping[str, float]) -> list[Place]:
    p = case.parameters
    level = np.array(case.q0)
    level[2], level[5] = 0.0, 0.0
    level[4] = float(p["slab_half_height"])
    level[1] = 2.0 * level[4] + float(p["half_height"])
    return [_place(case, "box level on the slab", [0, 1, 2, 3], q=level, held=False)]


def _chain(case: Case, at: Mapping[str, float]) -> list[Place]:
    """Hanging side by side, free and, if there is no gap between them, touching."""
    n, rest = len(case.q0), np.zeros(len(case.q0))
    found = [_place(case, "at rest, free", [], q=rest)]
    if case.number("gap") == 0.0:
        found.append(_place(case, "at rest, all touching", range(n - 1), q=rest, held=False))
    return found


def _visited(case: Case, at: Mapping[str, float]) -> list[Place]:
    """In every set of rows that are on: where a run moves least, or most where some slide."""
    from crossbody import engines

    prepared = engines.load("reference").prepare(case, "compiled")
    run, system = prepared.run(), system_of(case, prepared.system if isinstance(prepared, ReferenceRun) else None)
    follows, drift = np.asarray(system.follows), np.asarray(system.drift)
    sets: dict[tuple[tuple[int, bool], ...], list[tuple[float, int]]] = {}
    for k, (v, modes) in enumerate(zip(run.v, run.mode, strict=True)):
        slips = np.abs(system.gap(run.q[k], v)[1] - drift) if system.frictional else v
        on = [i for i, mode in enumerate(modes.tolist()) if mode in ON]
        rows = tuple((i, modes[i] == Mode.SLIP) for i in on if follows[i] in (-1, i))
        slowest = [slips[j : j + system.tangents[i]].max() for i, slides in rows if slides for j in [system.tangent[i]]]
        sets.setdefault(rows, []).append((float(-min(slowest) if slowest else np.abs(v).max()), k))
    found = [place for rows, seen in sets.items() for place in _seen(case, system, run, seen, dict(rows))]
    return sorted(found, key=lambda place: (place.model is None, place.name.endswith(MOVING)))


def _seen(
    case: Case, system: System, run: Trajectory, seen: Sequence[tuple[float, int]], rows: Mapping[int, bool]
) -> list[Place]:
    """The equilibria beside samples of a run with these rows on; where some slide, or muscles act, the slowest itself.

    Args:
        case: what was run.
        system: its equations.
        run: of it.
        seen: how fast it is in each sample with these rows, and which one that is.
        rows: those that are on, and whether they slide.
    """
    sliding, (_, k) = [i for i, slides in rows.items() if slides], min(seen)
    one_way = [i for i in rows if case.law.unilateral[i]]
    sticks = [case.contacts[i] for i in one_way if system.tangents[i] and not rows[i]]
    names = {
        "touching": [case.contacts[i] for i in one_way if not system.tangents[i]],
        "held by": sticks, "sliding on": [case.contacts[i] for i in sliding],
    }  # fmt: skip
    name = ", ".join(f"{how} {', '.join(which)}" for how, which in names.items() if which) or "touching nothing"
    if sliding or system.activations is not None:
        return [_passed(case, name, system, run, k, rows)]
    spread = np.linspace(0, len(seen) - 1, min(len(seen), TRIED)).astype(int)
    tried = dict.fromkeys([k, *(seen[i][1] for i in spread)])
    held, places, why = not one_way, list[Place](), ""
    for i in tried:
        try:
            places.append(_place(case, name, list(rows), held=held, q=run.q[i], t=float(run.t[k]), system=system))
        except SceneError as error:
            why = why or str(error)
    if not places:
        return [_passed(case, name, system, run, k, rows, why)]
    found = _distinct([_nearest(place, list(rows), held) for place in places if not _beyond(place)]) or places[:1]
    return [replace(one, name=f"{name} ({i})") for i, one in enumerate(found, 1)] if len(found) > 1 else found


def _beyond(place: Place) -> bool:
    """Whether a row that is off is behind its bound there, so that it would be on."""
    system, q = place.system, place.trim.q
    off = (np.asarray(system.unilateral) != 0) & (np.asarray(system.follows) < 0)
    off[place.trim.active] = False
    return bool((system.gap(q, np.zeros(system.n))[0][off] < -DEEP * max(1.0, np.abs(q).max(initial=0.0))).any())


def _nearest(place: Place, rows: Sequence[int], held: bool) -> Place:
    """The same equilibrium with angles less than half a turn from the start, where whole turns lead to it."""
    turns, q, q0 = [i for i, c in enumerate(place.case.coordinates) if c.unit == "rad"], place.trim.q, place.case.q0
    wrapped = q.copy()
    wrapped[turns] -= 2.0 * np.pi * np.round((q - q0)[turns] / (2.0 * np.pi))
    if place.model is None or np.array_equal(wrapped, q):
        return place
    found = _place(place.case, place.name, rows, held=held, q=wrapped, t=place.t, system=place.system)
    stays = found.model is not None and np.abs(found.trim.q - wrapped).max() <= SAME * max(1.0, np.abs(wrapped).max())
    return found if stays and not _beyond(found) else place


def _distinct(places: Sequence[Place]) -> list[Place]:
    """Places with a model but for those with the poles of one before: where a body that floats stands is no other."""
    found: list[tuple[Place, Array]] = []
    for place in places:
        if place.model is None:
            continue
        poles = np.sort_complex(np.round(place.model.poles(), 12))
        size = np.abs(poles).max(initial=0.0)
        if all(len(poles) != len(p) or np.abs(poles - p).max(initial=0.0) > ALIKE * size for _, p in found):
            found.append((place, poles))
    return [place for place, _ in found]


def _passed(
    case: Case, name: str, system: System, run: Trajectory, k: int, rows: Mapping[int, bool], why: str = ""
) -> Place:  # fmt: skip
    """Sample k of a run, with these rows on and some sliding, or with muscles: the tangent of the motion there."""
    t, sliding = float(run.t[k]), [i for i, slides in rows.items() if slides]
    u, model = case.inputs.at(t) if case.inputs is not None else None, None
    active = np.array(
        [i for i, f in enumerate(np.asarray(system.follows).tolist()) if i in rows or f in rows], dtype=np.int64
    )
    try:
        if not why:
            model = linearise(
                system, run.q[k], run.v[k], u, list(rows), sliding=sliding, t=t,
                activations=_activations(case, system, t), names=[c.name for c in case.velocities],
            )  # fmt: skip
    except SceneError as error:
        why = str(error)
    passed = Trim(
        q=run.q[k], v=run.v[k], u=np.zeros(0) if u is None else u, lam=run.lam[k][active], active=active,
        residual=np.nan, outcome=Outcome.ILL_POSED if why else Outcome.FINISHED, pulling=(),
    )  # fmt: skip
    return Place(
        name=f"{name}{MOVING}", case=case, system=system, trim=passed, model=model, t=t,
        held=False, powered=True, why=why,
    )  # fmt: skip


def _activations(case: Case, system: System, t: float) -> Floats | None:
    """What the activations are at t under a case's inputs."""
    behind = system.activations
    if behind is None or case.inputs is None:
        return None
    u = behind.extended(case.inputs).at(t)
    since, value = u[-behind.width :].reshape(-1, 2).T
    return behind.after(value, u[: -behind.width], t - since)


PLACES: Mapping[str, Callable[[Case, Mapping[str, float]], list[Place]]] = {
    "ball": lambda case, at: [_place(case, "on the floor", [0], held=False)],
    "delta": _delta, "maze": _maze, "soft_contact": _soft, "red_body": _red_body, "sliders": _chain,
    "pendulums": _chain,
}  # fmt: skip
