"""Exudyn: connectors with the case's law as symbolic functions, or plain springs and dampers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version
from time import perf_counter
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface as items  # noqa: N813 - a module
from exudyn.advancedUtilities import CreateSymbolicUserFunction

from crossbody.cases import Acts, Case, CaseUnsupported, Outcome, Parameter, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.engines import _real_time
from crossbody.engines import settings as _settings
from crossbody.engines._line import Line, followed, law_name, line
from crossbody.engines._peer import HIDDEN, PeerRun, ended, sampled, why_not
from crossbody.engines.contract import Engine

METHODS = ("DOPRI5", "ODE23")  # the others Exudyn names, but has not
ATOL_PART = 1e-3  # absolute tolerance in units of the relative one
LONGEST = 0.1  # s: as no step is rejected that jumps over a contact
SHORTEST = 1e-300  # s: none, since a step that is rejected there is tried again for ever, and nobody called
FAR = 1e9  # m, where the other stop of a connector is
TIGHTEST = 1e-12  # below it DOPRI5 may reject a step at a contact for ever, and calls nobody who could end it
EVERY = 1e-300  # s: sensors keep every step

Law = Callable[..., Any]


@dataclass(slots=True, kw_only=True)
class Model:
    """A compiled system.

    Attributes:
        mbs: MainSystem; `held` keeps alive what it refers to.
        sensors: coordinates and rates of every body, then the force of every row.
        masses: read back from it.
        laws: the symbolic law of every row; empty for plain connectors.
        rows: numbers of the connectors.
    """

    mbs: Any
    held: tuple[Any, ...]
    sensors: tuple[list[Any], list[Any], list[Any]]
    masses: list[float]
    laws: list[Any]
    rows: list[Any]


def _law(scene: Line, row: int) -> Law:
    """Force of a connector: its lam with the sign of Exudyn, which pulls the right body to the left."""
    m, w = float(scene.reduced[row]), float(scene.presses[row])
    a0, a1, a2 = (float(a[row]) for a in (scene.a0, scene.a1, scene.a2))
    opens, zero = bool(scene.unilateral[row]), exu.symbolic.Real(0.0)

    def force(mbs: Any, t: Any, itemNumber: Any, displacement: Any, velocity: Any, k: Any, d: Any, offset: Any) -> Any:
        h = displacement - offset
        lam = m * (w - a1 * velocity - a0 * h - a2 * h * h * h)
        return exu.symbolic.IfThenElse(h > 0.0, zero, -exu.symbolic.max(lam, zero)) if opens else -lam

    return force


def _connector(mbs: Any, scene: Line, row: int, markers: list[Any], symbolic: bool) -> Any:
    """The row with its law still to come, or a spring and damper that act below the surface alone."""
    offset = -float(scene.h0[row])
    if symbolic or not scene.unilateral[row]:
        m = 0.0 if symbolic else float(scene.reduced[row])
        return items.CoordinateSpringDamper(
            markerNumbers=markers, offset=offset, stiffness=m * scene.a0[row], damping=m * scene.a1[row]
        )
    m, stopped = float(scene.reduced[row]), [0.0, 0.0, 0.0]
    memory = mbs.AddNode(items.NodeGenericData(initialCoordinates=stopped, numberOfDataCoordinates=len(stopped)))
    return items.CoordinateSpringDamperExt(
        markerNumbers=markers, nodeNumber=memory, offset=offset, useLimitStops=True, limitStopsLower=offset,
        limitStopsUpper=FAR, limitStopsStiffness=m * scene.a0[row], limitStopsDamping=m * scene.a1[row],
    )  # fmt: skip


def _build(scene: Line, symbolic: bool) -> Model:
    container = exu.SystemContainer()
    mbs, kinds = container.AddSystem(), exu.OutputVariableType
    ground = mbs.AddNode(items.NodePointGround())
    markers = {-1: mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))}
    nodes, bodies, laws, rows = [], [], [], []
    for i, mass in enumerate(scene.masses.tolist()):
        start = {"initialCoordinates": [float(scene.q0[i])], "initialVelocities": [float(scene.v0[i])]}
        nodes.append(mbs.AddNode(items.Node1D(referenceCoordinates=[0.0], **start)))
        bodies.append(mbs.AddObject(items.Mass1D(nodeNumber=nodes[i], mass=mass)))
        markers[i] = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=nodes[i], coordinate=0))
        if scene.gravity:
            mbs.AddLoad(items.LoadCoordinate(markerNumber=markers[i], load=-mass * scene.gravity))
    for row, (left, right) in enumerate(scene.pairs):
        rows.append(mbs.AddObject(_connector(mbs, scene, row, [markers[left], markers[right]], symbolic)))
        if symbolic:
            laws.append(CreateSymbolicUserFunction(mbs, _law(scene, row), "springForceUserFunction", rows[row]))
            mbs.SetObjectParameter(rows[row], "springForceUserFunction", laws[row])
    q, v = (
        [mbs.AddSensor(items.SensorNode(nodeNumber=n, outputVariableType=kind, storeInternal=True)) for n in nodes]
        for kind in (kinds.Coordinates, kinds.Coordinates_t)
    )
    lam = [
        mbs.AddSensor(items.SensorObject(objectNumber=o, outputVariableType=kinds.Force, storeInternal=True))
        for o in rows
    ]
    mbs.Assemble()
    masses = [float(mbs.GetObjectParameter(body, "mass")) for body in bodies]
    return Model(mbs=mbs, held=(container, *laws), sensors=(q, v, lam), masses=masses, laws=laws, rows=rows)


def _springs(model: Model) -> Floats:
    """Return stiffness, N/m, and damping, N s/m, of every connector (2, nc), read back."""
    read = [model.mbs.GetObject(row) for row in model.rows]
    names = ("limitStopsStiffness", "stiffness"), ("limitStopsDamping", "damping")
    return np.array([[row.get(stop, row[spring]) for row in read] for stop, spring in names])


def _said(springs: Floats) -> str:
    """Return the connectors that differ, each once."""
    return ",".join("/".join(f"{x:.6g}" for x in one) for one in sorted(set(map(tuple, springs.T.tolist()))))


def _constants(scene: Line, model: Model) -> dict[str, Floats]:
    """Return a0, a1 and a2 (nc,) of every row by what was built: a spring and a damper have no cubic term."""
    if model.laws:
        return {"a0": scene.a0, "a1": scene.a1, "a2": scene.a2}
    a0, a1 = _springs(model) * (scene.H**2 @ (1.0 / np.array(model.masses)))
    return {"a0": a0, "a1": a1, "a2": 0.0 * a0}


def _simulation(case: Case, used: Mapping[str, Any]) -> tuple[Any, Any]:
    """Exudyn's settings and the type of its solver."""
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = EVERY
    time = settings.timeIntegration
    time.endTime = case.t_end
    time.minimumStepSize = SHORTEST
    if "rtol" not in used:
        time.numberOfSteps = max(1, math.ceil(case.t_end / float(used["dt"]) - 1e-9))
        return settings, exu.DynamicSolverType.GeneralizedAlpha
    time.numberOfSteps = max(1, math.ceil(case.t_end / min(LONGEST, case.t_end)))
    time.relativeTolerance, time.absoluteTolerance = float(used["rtol"]), ATOL_PART * float(used["rtol"])
    return settings, getattr(exu.DynamicSolverType, str(used["method"]))


def _set(settings: Any, solver: Any) -> dict[str, Any]:
    """Return settings as Exudyn's solver is given them; fixed steps divide the horizon, and are counted."""
    time = settings.timeIntegration
    if solver == exu.DynamicSolverType.GeneralizedAlpha:
        return {}
    if float(time.absoluteTolerance) != ATOL_PART * float(time.relativeTolerance):
        return {"rtol": math.nan}
    return {"rtol": float(time.relativeTolerance), "method": solver.name}


def _integrator(
    case: Case, scene: Line, model: Model, simulation: tuple[Any, Any], limit: int
) -> Callable[[], Trajectory]:
    settings, solver = simulation
    mbs = model.mbs

    begun = [0]

    def count(_mbs: Any, _t: float) -> bool:
        begun[0] += 1
        return begun[0] < limit  # the step is made all the same

    def solve() -> tuple[bool, float]:
        exu.config.printToConsole = False  # what it warns of is in the outcome
        try:
            start = perf_counter()
            return bool(mbs.SolveDynamic(settings, solverType=solver, storeSolver=False)), perf_counter() - start
        finally:
            exu.config.printToConsole = True

    def integrate() -> Trajectory:
        if not 0 < begun[0] < limit:  # counted once, off the clock: Exudyn calls Python for it in every step
            begun[0] = 0
            mbs.SetPreStepUserFunction(count)
            done, wall = solve()
            if begun[0] < limit:
                mbs.SetPreStepUserFunction(0)
        if begun[0] < limit:
            done, wall = solve()
        found = _trajectory(case, scene, model, done, begun[0], limit, wall)
        # Steps of one length go across touches, which are put in behind them, on one side each.
        return replace(found, acts=Acts.GRID) if solver == exu.DynamicSolverType.GeneralizedAlpha else found

    return integrate


def _trajectory(
    case: Case, scene: Line, model: Model, done: bool, begun: int, limit: int, wall_s: float
) -> Trajectory:  # fmt: skip
    columns = [np.column_stack([model.mbs.GetSensorStoredData(s)[:, 1] for s in group]) for group in model.sensors]
    t: Floats = model.mbs.GetSensorStoredData(model.sensors[0][0])[:, 0]
    q, v, lam = columns[0], columns[1], -columns[2]
    outcome, what = ended(scene, q[-1], v[-1]), "the state left the region that the scene can reach"
    if outcome.ok and abs(t[-1] - case.t_end) > 1e-9 * case.t_end:
        short = begun < limit
        outcome = Outcome.STEP_TOO_SMALL if short else Outcome.STEP_LIMIT
        what = "Exudyn gave up" if short else f"{limit} steps did not reach the horizon"
    elif outcome.ok and not done:
        outcome, what = Outcome.STEP_TOO_SMALL, "Exudyn reported a failure"
    message = "" if outcome.ok else f"t = {t[-1]:g} s, q = {q[-1].tolist()}, v = {v[-1].tolist()}: {what}."
    t = np.where(t > case.t_end, case.t_end, t)
    return sampled(
        scene, t, q, v, np.where(scene.unilateral, np.maximum(lam, 0.0), lam), wall_s=wall_s,
        steps=len(t) - 1, outcome=outcome, message=message,
    )  # fmt: skip


def _audit(case: Case, scene: Line, model: Model) -> Mapping[str, Any]:
    """What was put in, and the law as Exudyn evaluates it."""
    found: dict[str, Any] = {
        "masses": model.masses, "gravity": scene.gravity, "q0": case.q0, "v0": case.v0,
        "constants": _constants(scene, model),
    }  # fmt: skip

    def lam(q: Floats, v: Floats) -> Floats:
        rows = zip(model.laws, scene.H @ q, scene.rates(v), -scene.h0, strict=True)
        return np.array(
            [-float(law.Evaluate(model.mbs, 0.0, 0, *map(float, (x, hd, 0.0, 0.0, at)))) for law, x, hd, at in rows]
        )

    return found | ({"lam": lam} if scene.alone and model.laws else {})


class Exudyn(Engine):
    """Exudyn; see `crossbody.engines.Engine`."""

    name = "exudyn"
    profiles: Mapping[str, str] = {
        "matched": "the case's law as a symbolic function of each connector, error-controlled Runge-Kutta (DOPRI5) "
        "at a tight tolerance; memoryless, each row independent of the others",
        "default": "the obvious model: springs and dampers that act below the surface, generalised-alpha, fixed steps",
    }
    hidden = HIDDEN
    versions: Mapping[str, str] = {"exudyn": version("exudyn")}
    orders: Mapping[str, float] = dict.fromkeys(profiles, 1.0)
    steps: Mapping[str, float] = {"default": 0.5}

    def why_not(self, case: Case, profile: str) -> str | None:
        """Cases that are not of bodies on a line."""
        _settings.check_case(case)
        _settings.profile_of(self.name, self.profiles, profile)
        return why_not("Exudyn", case)

    def prepare(self, case: Case, profile: str = _settings.MATCHED, **settings: Any) -> PeerRun:
        """Build and assemble the system; see `Engine.prepare`.

        Settings: matched: rtol, method; default: dt, s; both: max_steps.
        """
        if (reason := self.why_not(case, profile)) is not None:
            raise CaseUnsupported(reason)
        used = _settings.chosen(self.name, profile, _known(case, profile), settings)
        scene = line(case)
        model = _build(scene, symbolic=profile == "matched")
        extra = (
            {"law": law_name(scene)}
            if profile == "matched"
            else {"method": "GeneralizedAlpha", "springs": _said(_springs(model))}
        )
        simulation = _simulation(case, used)
        return PeerRun(
            engine=self.name, profile=profile, settings=used | extra,
            integrate=_integrator(case, scene, model, simulation, int(used["max_steps"])),
            physics={**_audit(case, scene, model), "set": _set(*simulation)},
            follows=followed(case, scene) if profile == "matched" else None,
        )  # fmt: skip


def _known(case: Case, profile: str) -> dict[str, Parameter]:
    steps = Parameter(default=1_000_000, doc="bound on the number of steps", low=1, high=1e9)
    if profile == "matched":
        return {
            "rtol": Parameter(default=1e-11, doc="relative tolerance", low=TIGHTEST, high=1e-1),
            "method": Parameter(default=METHODS[0], doc="Runge-Kutta method", choices=METHODS),
            "max_steps": steps,
        }
    step = min(1e-3, _real_time.resolving_step(case.law), case.t_end)
    return {"dt": Parameter(default=step, unit="s", doc="time step", low=0.0, open_low=True), "max_steps": steps}


ENGINE = Exudyn()
