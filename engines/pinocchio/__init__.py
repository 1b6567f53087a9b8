"""Pinocchio: the case's law by its constrained dynamics, instantaneous impacts, or an LCP in time steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any, Protocol

import numpy as np
import pinocchio as pin

from crossbody.cases import Case, CaseUnsupported, Outcome, Parameter, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.scene_contacts import frictional
from crossbody.engines import settings as _settings
from crossbody.engines._formed import FormedRun, form_of, linearised, on_scene, why_no_form
from crossbody.engines._level_machine import LevelMachine
from crossbody.engines._log import Log
from crossbody.engines._machines import Machine
from crossbody.engines._rubbing import RubbingRun
from crossbody.engines.contract import Engine, Run
from crossbody.engines.linear import Spot, Tangent
from crossbody.engines.pinocchio import _model
from crossbody.engines.pinocchio._admm import TimeStepper
from crossbody.engines.pinocchio._cones import Cones
from crossbody.engines.pinocchio._coordinates import Prepared
from crossbody.engines.pinocchio._flow import Flow
from crossbody.engines.pinocchio._impulse import RULES, Impact, ImpulseMachine, constants, restitution
from crossbody.engines.pinocchio._rows import ALGEBRA, audit
from crossbody.reference.sundials import solvers

STEPS = Parameter(default=200_000, doc="bound on the number of steps", low=1, high=1e9)
RTOL = Parameter(default=1e-10, doc="relative tolerance", low=1e-14, high=1e-1)
METHODS, AUTO = ("Adams", "BDF"), "auto"
METHOD = Parameter(default="Adams", doc="linear multistep method of CVODE", choices=METHODS)
METHOD_OF_STIFF = replace(
    METHOD,
    default=AUTO,
    doc="that, or auto: the one that advances further per right-hand side",
    choices=(AUTO, *METHODS),
)
OF_GATES = replace(RTOL, default=1e-12), replace(METHOD, default="BDF")
"""A ball that rests on a face is stiff; and what a switch latches of a place, as the angle that a
controller goes to, stays off by the error that it had: of 1e-10 three microseconds are left after
a minute in the maze."""
TRIED = 250
"""Steps by which the methods are compared: their start, at order 1, takes less than half of them."""
SOLVER = Parameter(default="forwardDynamics", doc="how v' and lam are computed", choices=tuple(ALGEBRA))


class Solver(Protocol):
    """What integrates: it fills the log and says how it ended."""

    steps: int
    outcome: Outcome
    message: str


@dataclass(slots=True, kw_only=True)
class PinocchioRun(Run):
    """One prepared run; see `crossbody.engines.Run`."""

    case: Case
    scene: Prepared
    profile: str
    settings: Mapping[str, Any]
    constants: Mapping[str, Any]
    integrate: Callable[[Log], tuple[Solver, Mapping[str, int]]]
    follows: Case | None = None
    engine: str = "pinocchio"

    def run(self) -> Trajectory:
        """Integrate from the start."""
        log = Log()
        start = perf_counter()
        solver, counts = self.integrate(log)
        wall = perf_counter() - start - log.aside_s
        chart = self.scene.chart
        found = log.trajectory(self.scene.observe, solver.outcome, solver.message, solver.steps, wall, counts, chart)
        acting = self.scene.world.acting
        return found if acting is None else acting.told(found)

    def audit(self) -> Mapping[str, Any]:
        """The physics read back from the model."""
        return {**audit(self.case, self.scene.rows, self.constants), **self.scene.audit}


class Pinocchio(Engine):
    """Pinocchio 4; see `crossbody.engines.Engine`."""

    name = "pinocchio"
    profiles: Mapping[str, str] = {
        "law": "the case's law solved for v' and lam by forwardDynamics, CVODE, the level machine",
        "impulse": "instantaneous impacts with the restitution of the law's linear part, one after another; rigid "
        "contact once captured",
        "impulse_simultaneous": (
            "the same, with collisions of all touching contacts solved together as a complementarity problem"
        ),
        "admm": "time stepping with ADMM, the LCP baseline: first order, restitution of the law's linear part",
    }
    versions: Mapping[str, str] = {"pin": pin.__version__, "scikit-sundae": solvers.VERSION}
    orders: Mapping[str, float] = dict.fromkeys(profiles, 1.0)
    steps: Mapping[str, float] = {"admm": 0.5, **dict.fromkeys(RULES, math.nan)}
    held = frozenset({"admm"})
    interpreted: Mapping[str, str] = {
        "*": "the loop over steps, the rows of the law, gaps; Pinocchio's algorithms are called from Python"
    }
    hidden: Mapping[str, Mapping[str, str]] = {"*": {"ledger": "These runs keep no account of the work of their rows."}}

    def why_not(self, case: Case, profile: str) -> str | None:
        """What is no scene, machines other than `level`, and impacts of what is always on."""
        _settings.check_case(case)
        profile = _settings.profile_of(self.name, self.profiles, profile)
        if (refused := why_no_form(case)) is not None:
            return refused
        case = on_scene(case)
        if case.scene is None:
            return f"Pinocchio has no model of the mechanism {case.mechanism!r}; it has: scene."
        if (refused := _model.why_not(case, profile)) is not None:
            return refused
        opens = case.law.unilateral
        closed = any(loop.in_space for loop in case.scene.loops)
        if profile == "admm" and (closed or not case.contacts):
            return "The profile admm steps contacts in time: this case has loops in space, or no contact."
        if profile in RULES and not (opens.any() and opens.all()):
            return "An impact needs a contact that can open: a row that is always active has none."
        if profile == "impulse_simultaneous" and int(case.law.unilateral.sum()) < 2:
            return "There is only one contact, so the profile impulse is the same."
        if profile == "law" and case.fsm != "level":
            return f"The profile law switches by the machine 'level', not by {case.fsm!r}."
        return None

    def prepare(self, case: Case, profile: str = _settings.MATCHED, **settings: Any) -> Run:
        """Build the model of a case; see `Engine.prepare`. The profile matched is law.

        Settings: law: rtol, method, max_steps and algebra; impulse and impulse_simultaneous: rtol,
        restitution, max_steps; admm: dt in s, tol in m/s and N s, restitution, max_steps.
        """
        profile = _settings.profile_of(self.name, self.profiles, profile)
        if (reason := self.why_not(case, profile)) is not None:
            raise CaseUnsupported(reason)
        if (form := form_of(case)) is not None:
            return FormedRun(form=form, inner=self.prepare(form.case, profile, **settings))
        used = _settings.chosen(self.name, profile, _known(case, profile), settings)
        if case.scene is not None and frictional(case.scene):
            stepper = Cones(case, used, _bounces(case, settings))
            return RubbingRun(
                case=case, engine=self.name, profile=profile, settings=used, stepper=stepper, physics=stepper.physics()
            )
        scene = _model.build(case, str(used.get("algebra", "forwardDynamics")))
        constants: dict[str, Any] = dict(zip(("a0", "a1", "a2"), scene.rows.entered, strict=True))
        if profile != "law":
            constants = {"restitution": used["restitution"]}
        integrate = _PROFILES[profile](case, scene, used, _bounces(case, settings))
        return PinocchioRun(
            case=case, scene=scene, profile=profile, settings=used, constants=constants, integrate=integrate,
            follows=_model.followed(case, profile),
        )  # fmt: skip

    def linearise(self, case: Case, spot: Spot) -> tuple[Tangent, ...]:
        """The derivatives of v' of the profile law at an equilibrium, by each way that there is."""
        from crossbody.engines.pinocchio._linear import linearise

        if (reason := self.why_not(case, "law")) is not None:
            raise CaseUnsupported(reason)
        if case.form is not None:
            return linearised(case, spot, self.linearise)
        return linearise(case, spot)


def _known(case: Case, profile: str) -> dict[str, Parameter]:
    """The settings of a profile."""
    if profile == "law":
        stiff = case.general and len(case.law.a0) > 0  # a file's rows bind the steps of Adams' formulas
        rtol, method = (RTOL, METHOD_OF_STIFF if stiff else METHOD) if case.gates is None else OF_GATES
        return {"rtol": rtol, "method": method, "algebra": SOLVER, "max_steps": STEPS}
    e = Parameter(default=max(_bounces(case, {}), default=0.0), doc="restitution of every row", low=0.0, high=1.0)
    if profile in RULES:
        return {"rtol": RTOL, "restitution": e, "max_steps": STEPS}
    return {
        "dt": Parameter(default=min(1e-3, case.t_end), unit="s", doc="time step", low=0.0, open_low=True),
        "tol": Parameter(default=1e-12, doc="absolute tolerance of ADMM", low=1e-15, high=1e-1),
        "restitution": e,
        "max_steps": STEPS,
    }


def _absolute(scene: Prepared, rtol: float) -> Floats:
    """Absolute tolerances (nq + nv,): rtol of how far and how fast the scene moves."""
    widths = (scene.rows.model.nq, scene.rows.model.nv)
    return rtol * np.concatenate([np.broadcast_to(size, (n,)) for size, n in zip(scene.sizes, widths, strict=True)])


def _start(case: Case, scene: Prepared) -> tuple[Floats, Floats]:
    return scene.start or (case.q0, case.v0)


Integrate = Callable[[Log], tuple[Solver, Mapping[str, int]]]


def _law(case: Case, scene: Prepared, used: Mapping[str, Any], _e: list[float]) -> Integrate:
    fast = min(case.force.fast, default=0.0) if case.gates is not None and case.force is not None else 0.0
    return _flowing(lambda: LevelMachine(scene.rows, float(used["rtol"]), fast), case, scene, used)


def _impulse(rule: Impact) -> Callable[[Case, Prepared, Mapping[str, Any], list[float]], Integrate]:
    def prepared(case: Case, scene: Prepared, used: Mapping[str, Any], e: list[float]) -> Integrate:
        rows = scene.rows.rigid()
        a0 = [constants(case.law, i)[0] for i in range(rows.nc)]
        return _flowing(lambda: ImpulseMachine(rows, a0, e, rule), case, scene, used)

    return prepared


def _bounces(case: Case, asked: Mapping[str, Any]) -> list[float]:
    """Restitution of every row: the one that was asked for, or its law's."""
    if "restitution" in asked:
        return [float(asked["restitution"])] * len(case.law.a0)
    return [restitution(case.law, i) for i in range(len(case.law.a0))]


def _flowing(machine: Callable[[], Machine], case: Case, scene: Prepared, used: Mapping[str, Any]) -> Integrate:
    rtol, method, limit = float(used["rtol"]), str(used.get("method", "Adams")), int(used["max_steps"])
    if method == AUTO and case.control is not None:
        method = METHODS[0]  # a trial would ask a controller of the user's own at ticks that it has had

    def flown(log: Log, method: str, limit: int) -> Flow:
        flow = Flow(machine(), log, rtol, _absolute(scene, rtol), method, limit, scene.world, scene.coordinates)
        flow.run(*_start(case, scene), case.t_end)
        return flow

    def integrate(log: Log) -> tuple[Solver, Mapping[str, int]]:
        counts, paces = {}, {method: 0.0}
        if method == AUTO:
            tried = {one: (own := Log(), flown(own, one, min(limit, TRIED))) for one in METHODS}
            paces = {one: own.motion[-1][0] / max(flow.rhs, 1) for one, (own, flow) in tried.items()}
            counts = {"tried": sum(flow.rhs for _, flow in tried.values())}
            log.aside_s = sum(own.aside_s for own, _ in tried.values())
        flow = flown(log, max(paces, key=paces.__getitem__), limit)
        return flow, {"rhs": flow.rhs, **counts}

    return integrate


def _admm(case: Case, scene: Prepared, used: Mapping[str, Any], e: list[float]) -> Integrate:
    assert scene.points is not None
    points = scene.points

    def integrate(log: Log) -> tuple[Solver, Mapping[str, int]]:
        stepper = TimeStepper(scene.rows, points, e, float(used["tol"]), log, int(used["max_steps"]))
        stepper.run(*_start(case, scene), case.t_end, float(used["dt"]))
        return stepper, {"iterations": stepper.iterations, "unsolved": stepper.unsolved}

    return integrate


_PROFILES = {"law": _law, **{profile: _impulse(rule) for profile, rule in RULES.items()}, "admm": _admm}


ENGINE = Pinocchio()
