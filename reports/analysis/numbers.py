"""Equilibria of a case with their linear models: trim, poles, ranks, responses, loci, stability maps (spec 2.7).

A case offers places: equilibria in a mode set, each by its name. The model at a place is minimal: rows that are held
stay held, unless their law is what is looked at (a ball in contact, soft fingers).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from crossbody import cases
from crossbody.cases import Case, CaseUnsupported, InvalidValue, UnknownName, Value
from crossbody.engines._equations import system_of
from crossbody.reference import System, delta
from crossbody.reference.delta import scene
from crossbody.reference.linear import LinearModel, Trim, controllable, linearise, locus, modes, observable, poses, trim

EQUILIBRIA = ("place", "outcome", "variable", "value")
POLES = ("place", "real", "imag", "frequency", "damping", "led_by")
RANKS = ("place", "states", "controllable", "observable", "growth")
RESPONSES = ("place", "input", "output", "omega", "magnitude", "phase")


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """An equilibrium in a mode set.

    Attributes:
        name: what it is.
        trim: state, inputs and multipliers there.
        model: its linear model, or None where there is no equilibrium.
    """

    name: str
    trim: Trim
    model: LinearModel | None


def build(case: Case) -> System:
    """The mechanism of a case, without a sampled controller."""
    return system_of(case)


def places(case: Case, at: Mapping[str, float] | None = None) -> tuple[Place, ...]:
    """The equilibria of a case.

    Args:
        case: with its numbers.
        at: where to look, for a mechanism that can stand in many places: x, y, z of the flange, m.

    Raises:
        CaseUnsupported: for a mechanism without a list of places.
        UnknownName: for another coordinate than those.
    """
    if case.mechanism not in PLACES:
        raise CaseUnsupported(f"There are no equilibria of {case.mechanism!r} here; there are of: {', '.join(PLACES)}.")
    return tuple(PLACES[case.mechanism](case, _known(case, at or {})))


def _known(case: Case, at: Mapping[str, float]) -> Mapping[str, float]:
    valid = ("x", "y", "z") if case.mechanism == "delta" else ()
    for name in at:
        if name not in valid:
            raise UnknownName(f"place of {case.name}", name, valid)
    return at


def _place(
    case: Case, name: str, active: Sequence[int], *, held: bool = True, q: ArrayLike | None = None,
    v: ArrayLike | None = None, t: float = 0.0, free: Sequence[int] | None = None, rates: Sequence[int] = (),
    inputs: Sequence[int] = (), system: System | None = None,
) -> Place:  # fmt: skip
    made = build(case) if system is None else system
    found = trim(
        made, case.q0 if q is None else q, v, active=active, free=free, rates=rates, inputs=inputs, t=t
    )  # fmt: skip
    if not found.outcome.ok:
        return Place(name=name, trim=found, model=None)
    names = [coordinate.name for coordinate in case.coordinates]
    model = linearise(made, found.q, found.v, found.u, active, names=names, reduce=held, t=t)
    return Place(name=name, trim=found, model=model)


def _ball(case: Case, at: Mapping[str, float]) -> list[Place]:
    return [_place(case, "on the floor", [0], held=False)]


def _delta(case: Case, at: Mapping[str, float]) -> list[Place]:
    robot = scene.robot_of(case.parameters)
    q = case.q0
    if at:
        here = dict(zip("xyz", delta.flange(robot, case.q0).tolist(), strict=True)) | dict(at)
        q = delta.inverse(robot, [here[axis] for axis in "xyz"])
    z = delta.flange(robot, q)
    name = f"flange at ({z[0]:.4g}, {z[1]:.4g}, {z[2]:.4g}) m"
    system = delta.system(robot, p=float(case.number("p")))
    place = _place(case, name, range(6), q=q, free=[], inputs=[0, 1, 2], system=system)
    if place.model is None:
        return [place]
    full = linearise(
        system, place.trim.q, u=place.trim.u, outputs=("q",), reduce=True, names=[c.name for c in case.coordinates]
    )  # fmt: skip
    weights = np.asarray(delta.virtual_jacobian(robot, place.trim.q))
    seen = full.combined(weights, [f"flange {axis} [m]" for axis in "xyz"])
    return [Place(name=name, trim=place.trim, model=seen)]


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
    """An angle of the maze at which a ring is solid at top and bottom: half a gap's spacing beside its gaps."""
    gaps, phase = int(case.number(f"gaps{ring}")), np.radians(case.number(f"phase{ring}"))
    spacing = 2.0 * np.pi / max(gaps, 1)
    angles = np.linspace(0.0, spacing, 97)[:-1]
    ends = np.array([0.5 * np.pi, -0.5 * np.pi])
    off = np.abs((ends[None] - phase - angles[:, None] + 0.5 * spacing) % spacing - 0.5 * spacing).min(axis=1)
    return float(angles[np.argmax(off)])


def _soft(case: Case, at: Mapping[str, float]) -> list[Place]:
    """Closed fingers in every mode set; positions, sensors and multipliers are found."""
    from crossbody.cases._soft import closed_forms as closed
    from crossbody.cases._soft.scene import numbers

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


PLACES: Mapping[str, Callable[[Case, Mapping[str, float]], list[Place]]] = {
    "ball": _ball, "delta": _delta, "maze": _maze, "soft_contact": _soft, "red_body": _red_body, "sliders": _chain,
    "pendulums": _chain,
}  # fmt: skip


def equilibria(found: Sequence[Place], case: Case) -> pd.DataFrame:
    """One row a variable: positions and rates that are not 0, inputs, multipliers of the active rows."""
    rows = []
    for place in found:
        t = place.trim
        named = list(zip([c.name for c in case.coordinates], t.q.tolist(), t.v.tolist(), strict=True))
        values = [*((k, x) for k, x, _ in named), *((f"{k}'", rate) for k, _, rate in named if rate)]
        values += [(f"u[{i}]", x) for i, x in enumerate(t.u.tolist())]
        values += [(f"lam {case.contacts[i]}", x) for i, x in zip(t.active.tolist(), t.lam.tolist(), strict=True)]
        rows += [{"place": place.name, "outcome": t.outcome.value, "variable": k, "value": x} for k, x in values]
    return pd.DataFrame(rows, columns=list(EQUILIBRIA))


def poles(found: Sequence[Place]) -> pd.DataFrame:
    """One row a pole; `led_by` is the state that takes part in it most."""
    rows = []
    for place in found:
        if place.model is None:
            continue
        m = modes(place.model)
        for k, pole in enumerate(m.poles.tolist()):
            rows.append(
                {"place": place.name, "real": pole.real, "imag": pole.imag, "frequency": float(m.frequency[k]),
                 "damping": float(m.damping[k]), "led_by": m.states[int(m.participation[:, k].argmax())]}
            )  # fmt: skip
    return pd.DataFrame(rows, columns=list(POLES))


def ranks(found: Sequence[Place]) -> pd.DataFrame:
    """States, how many the inputs reach and the outputs show, and the largest real part, 1/s: one row a place."""
    rows = []
    for place in found:
        if place.model is None:
            continue
        rows.append(
            {"place": place.name, "states": len(place.model.states), "controllable": controllable(place.model),
             "observable": observable(place.model), "growth": float(place.model.poles().real.max(initial=-np.inf))}
        )  # fmt: skip
    return pd.DataFrame(rows, columns=list(RANKS))


def responses(found: Sequence[Place], omega: ArrayLike) -> pd.DataFrame:
    """Magnitude and phase, degrees, from every input to every output at omega (m,), rad/s."""
    w, parts = np.asarray(omega, dtype=np.float64), []
    for place in found:
        if place.model is None:
            continue
        values = place.model.response(w)
        for j, source in enumerate(place.model.inputs):
            for i, sink in enumerate(place.model.outputs):
                one = values[:, i, j]
                phase = np.degrees(np.unwrap(np.angle(one)))
                row = {"place": place.name, "input": source, "output": sink, "omega": w}
                parts.append(pd.DataFrame({**row, "magnitude": np.abs(one), "phase": phase}))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(RESPONSES))


def root_locus(
    name: str, variant: str | None, overrides: Mapping[str, Value], at: Mapping[str, float], parameter: str,
    values: Sequence[float],
) -> pd.DataFrame:  # fmt: skip
    """Poles of every place over a parameter of the case: columns place, parameter, value, branch, real, imag.

    Raises:
        InvalidValue: where a place has no equilibrium at some value.
    """
    first, parts = places(cases.load(name, variant, **{**overrides, parameter: values[0]}), at), []
    for k, place in enumerate(first):

        def model(value: float, k: int = k) -> LinearModel:
            found = places(cases.load(name, variant, **{**overrides, parameter: value}), at)[k].model
            if found is None:
                raise InvalidValue(f"There is no equilibrium {first[k].name!r} at {parameter} = {value:g}.")
            return found

        found = locus(model, values)
        for branch in range(found.poles.shape[1]):
            line = found.poles[:, branch]
            head = {"place": place.name, "parameter": parameter, "value": found.values, "branch": branch}
            parts.append(pd.DataFrame({**head, "real": line.real, "imag": line.imag}))
    return pd.concat(parts, ignore_index=True)


def workspace(
    case: Case, points: int = 61, depths: tuple[float, float] = (0.30, 0.75), reach: float = 0.30
) -> pd.DataFrame:
    """Open-loop stability of the delta robot over the plane y = 0 of its workspace, held by constant torques.

    Args:
        case: of the delta robot.
        points: of each of the two axes.
        depths: of the flange, m.
        reach: largest |x| of the flange, m.

    Returns:
        Columns x, z, growth (largest real part, 1/s; NaN where the robot does not reach or is singular), unstable
        (number of poles to the right of 0).

    Raises:
        CaseUnsupported: for another mechanism.
    """
    if case.mechanism != "delta":
        raise CaseUnsupported(f"There is a map of the workspace for the delta robot, not for {case.mechanism!r}.")
    robot = scene.robot_of(case.parameters)
    x, z = (
        grid.ravel()
        for grid in np.meshgrid(np.linspace(-reach, reach, points), np.linspace(depths[0], depths[1], points))
    )
    q, there = delta.inverses(robot, np.column_stack([x, 0.0 * x, z]))
    growth, count = np.full(len(x), np.nan), np.zeros(len(x), dtype=int)
    found = poses(delta.system(robot, p=case.number("p")), q[there], [0, 1, 2])
    growth[there] = found.growth
    count[there] = (found.poles.real > 0.0).sum(axis=1)
    return pd.DataFrame({"x": x, "z": z, "growth": growth, "unstable": count})
