"""Drake: the case's equations or a MultibodyPlant under error-controlled integrators, or its discrete plant."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.metadata import version
from time import perf_counter
from typing import Any

import numpy as np
from pydrake.geometry import AddContactMaterial, Box, ProximityProperties, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel, CoulombFriction
from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, SpatialInertia, UnitInertia
from pydrake.symbolic import Expression, Variable, if_then_else
from pydrake.symbolic import max as larger
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import SymbolicVectorSystem

from crossbody.cases import Case, CaseUnsupported, Outcome, Parameter, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import matrices
from crossbody.cases.scene_contacts import frictional
from crossbody.engines import settings as _settings
from crossbody.engines._line import Line, followed, law_name, line
from crossbody.engines._peer import HIDDEN, PeerRun, ended, no_shapes, sampled, why_beside, why_not
from crossbody.engines._rubbing import RIGID, RubbingRun
from crossbody.engines.contract import Engine, Run
from crossbody.engines.drake import _scene
from crossbody.engines.drake._contacts import APPROXIMATIONS, HOLDS, STICTION, STIFF, Rubs
from crossbody.engines.drake._scene import SceneRun
from crossbody.engines.drake._simulate import Sim

THICK = 10.0  # sides of the box that stands for a plane, m
SCHEMES = ("runge_kutta5", "runge_kutta3", "bogacki_shampine3", "radau3")
USUAL_SCHEME, USUAL_ACCURACY = "runge_kutta3", 1e-4  # what a Simulator of 1.51.1 starts with
RUBS = RIGID, "Contacts of a discrete plant follow its own law, and are solved within a step."


def plant(scene: Line, dt: float) -> tuple[Any, Any]:
    """The diagram and its plant; dt is 0 for continuous time, else the step of the discrete plant, s.

    A contact has the stiffness m a0 of its row; Drake's dissipation (Hunt and Crossley) is not
    the law's: none.
    """
    builder = DiagramBuilder()
    made, _ = AddMultibodyPlantSceneGraph(builder, dt)
    made.mutable_gravity_field().set_gravity_vector(-scene.gravity * scene.axis)
    frames = {"": made.world_body()}
    bodies = zip(scene.bodies, scene.masses.tolist(), scene.places, strict=True)
    for name, mass, place in bodies:
        inertia = SpatialInertia(mass, np.zeros(3), UnitInertia.SolidSphere(1.0))
        frames[name] = body = made.AddRigidBody(name, inertia)
        before = made.AddFrame(FixedOffsetFrame(f"before {name}", made.world_frame(), RigidTransform(place)))
        made.AddJoint(PrismaticJoint(name, before, body.body_frame(), scene.axis))
    for shape in scene.shapes:
        turned = RotationMatrix(matrices(np.array(shape.orientation)))
        plane, at = shape.type == "plane", np.array(shape.position)
        place = RigidTransform(turned, at - plane * 0.5 * THICK * turned.matrix()[:, 2])
        solid = Box(THICK, THICK, THICK) if plane else Sphere(shape.size[0])
        made.RegisterCollisionGeometry(frames[shape.body], place, solid, shape.name, _material(scene))
    made.set_contact_model(ContactModel.kPoint)
    made.Finalize()
    return builder.Build(), made


def _material(scene: Line) -> Any:
    """Two bodies in contact are springs in series: each has twice the stiffness of the pair."""
    found, stiffness = ProximityProperties(), 2.0 * float(scene.reduced[0] * scene.a0[0])
    AddContactMaterial(
        dissipation=0.0, point_stiffness=stiffness, friction=CoulombFriction(0.0, 0.0), properties=found
    )  # fmt: skip
    return found


def system(scene: Line) -> Any:
    """X = (q, v), x' = (v, M^-1 H^T lam - g), lam as in `Line.memoryless`."""
    n = len(scene.masses)
    q, v = ([Variable(f"{name}{i}") for i in range(n)] for name in "qv")
    lam = [_multiplier(scene, row, q, v) for row in range(len(scene.H))]
    push = [_sum(column, lam) for column in scene.H.T]
    rates = [push[i] / float(scene.masses[i]) - scene.gravity for i in range(n)]
    dynamics = np.array([*(Expression(x) for x in v), *rates])
    return SymbolicVectorSystem(state=np.array([*q, *v]), dynamics=dynamics)


def _sum(coefficients: Floats, parts: list[Any]) -> Any:
    return sum((c * part for c, part in zip(coefficients.tolist(), parts, strict=True) if c), Expression(0.0))


def _multiplier(scene: Line, row: int, q: list[Any], v: list[Any]) -> Any:
    h, hd = _sum(scene.H[row], q) + float(scene.h0[row]), _sum(scene.H[row], v)
    a0, a1, a2, m, w = (float(a[row]) for a in (scene.a0, scene.a1, scene.a2, scene.reduced, scene.presses))
    lam = m * (w - a1 * hd - a0 * h - a2 * h * h * h)
    return if_then_else(h > 0.0, Expression(0.0), larger(lam, Expression(0.0))) if scene.unilateral[row] else lam


def _runner(case: Case, scene: Line, sim: Sim, max_steps: int, dt: float) -> Callable[[], Trajectory]:
    n = len(scene.masses)

    def integrate() -> Trajectory:
        sim.start()
        rows: list[tuple[float, Floats]] = []
        start = perf_counter()
        told = sim.run(case.t_end, max_steps, lambda t, x: rows.append((t, x)))
        wall = perf_counter() - start
        t, x = np.array([r[0] for r in rows]), np.array([r[1] for r in rows])
        q, v = x[:, :n], x[:, n:]
        lam = _multipliers(scene, sim, t, x, dt)
        outcome, what = _ended(case, scene, t, q, v, max_steps, told)
        place = f"t = {t[-1]:g} s, q = {q[-1].tolist()}, v = {v[-1].tolist()}"
        return sampled(
            scene, t, q, v, lam, wall_s=wall, steps=len(t) - 1, outcome=outcome,
            message="" if outcome.ok else f"{place}: {what}.",
        )  # fmt: skip

    return integrate


def _ended(
    case: Case, scene: Line, t: Floats, q: Floats, v: Floats, max_steps: int, told: str
) -> tuple[Outcome, str]:  # fmt: skip
    if told:
        return Outcome.STEP_TOO_SMALL, f"Drake says: {told}"
    if t[-1] < case.t_end:
        return Outcome.STEP_LIMIT, f"{max_steps} steps did not reach the horizon"
    return ended(scene, q[-1], v[-1]), "the state left the region that the scene can reach"


def _multipliers(scene: Line, sim: Sim, t: Floats, x: Floats, dt: float) -> Floats:
    """Lam (n, nc), N, from the accelerations that Drake evaluates, or from the discrete plant's steps."""
    n = len(scene.masses)
    if dt:
        change = np.vstack([np.zeros((1, n)), np.diff(x[:, n:], axis=0) / dt + scene.gravity])
    else:
        change = sim.rates(t, x)[:, n:] + scene.gravity
    lam = scene.transmitted(change)
    rounding = 1e-9 * float(scene.masses.max()) * max(abs(scene.gravity), 1e-3)
    return np.where(scene.unilateral, np.where(lam > rounding, lam, 0.0), lam)


class Drake(Engine):
    """Drake; see `crossbody.engines.Engine`."""

    name = "drake"
    profiles: Mapping[str, str] = {
        "matched": "the case's law as a symbolic system, Runge-Kutta 5 with error control at a tight accuracy; "
        "memoryless, each row independent of the others",
        "continuous": "a MultibodyPlant in continuous time, point contact with the law's stiffness, the simulator's "
        "own integrator (Runge-Kutta 3) and accuracy (1e-4)",
        "default": "a discrete MultibodyPlant with steps of 1 ms and point contact with the law's stiffness",
    }
    hidden = HIDDEN
    versions: Mapping[str, str] = {"drake": version("drake")}
    orders: Mapping[str, float] = dict.fromkeys(profiles, 1.0)
    steps: Mapping[str, float] = {"matched": 1.0, "default": 1.0}
    late = frozenset({"default"})

    def why_not(self, case: Case, profile: str) -> str | None:
        """Cases of their own kernels that are not on a line; contacts of a plant that never open."""
        _settings.check_case(case)
        _settings.profile_of(self.name, self.profiles, profile)
        if case.general and case.scene is not None:
            return why_beside("Drake", case) or _scene.why_not(case.scene, profile)
        reason = why_not("Drake", case)
        if reason is None and profile != "matched" and not case.law.unilateral.all():
            return "A contact of a MultibodyPlant only pushes, so a row that is always active cannot be one."
        if reason is None and profile != "matched" and not float(line(case).a0[0]) > 0.0:
            return "A contact of a MultibodyPlant needs a stiffness above 0."
        return no_shapes(case) if reason is None and profile != "matched" else reason

    def prepare(self, case: Case, profile: str = _settings.MATCHED, **settings: Any) -> Run:
        """Build the system and its simulator; see `Engine.prepare`.

        Settings: matched: rtol (Drake's accuracy), scheme; continuous: rtol; default: dt, s; all: max_steps.
        """
        if (reason := self.why_not(case, profile)) is not None:
            raise CaseUnsupported(reason)
        used = _settings.chosen(self.name, profile, _known(case, profile), settings)
        if case.scene is not None and frictional(case.scene):
            stepper = Rubs(case, used, profile == "matched")
            return RubbingRun(
                case=case, engine=self.name, profile=profile, settings=used, stepper=stepper,
                physics=_scene.physics(case, profile, stepper.observer) | {"hidden": dict.fromkeys(*RUBS)},
            )  # fmt: skip
        if case.general:
            return SceneRun(case=case, profile=profile, settings=used)
        scene, dt, physics = line(case), float(used.get("dt", 0.0)), {}
        if profile == "matched":
            root = system(scene)
            physics = {"masses": scene.masses, "constants": {"a0": scene.a0, "a1": scene.a1, "a2": scene.a2}}
        else:
            root, made = plant(scene, dt)
            physics = _read(scene, made)
        start = np.concatenate((scene.q0, scene.v0))
        sim = Sim(root, start, str(used.get("scheme", USUAL_SCHEME)), float(used.get("rtol", 0.0)))
        law = {"law": law_name(scene)} if profile == "matched" else {}
        return PeerRun(
            engine=self.name, profile=profile, settings=used | law,
            integrate=_runner(case, scene, sim, int(used["max_steps"]), dt),
            physics={"gravity": scene.gravity, "q0": case.q0, "v0": case.v0} | physics,
            follows=followed(case, scene) if profile == "matched" else None,
        )  # fmt: skip


def _read(scene: Line, made: Any) -> dict[str, Any]:
    """Return the plant's numbers; its contact has a stiffness, and constants of the law are none of it."""
    context = made.CreateDefaultContext()
    masses = [made.GetBodyByName(name).get_mass(context) for name in scene.bodies]
    gravity = -float(made.gravity_field().gravity_vector() @ scene.axis)
    return {"masses": masses, "gravity": gravity}


def _known(case: Case, profile: str) -> dict[str, Parameter]:
    if case.scene is not None and frictional(case.scene):
        return _stepped(case, profile)
    steps = Parameter(default=1_000_000, doc="bound on the number of steps", low=1, high=1e9)
    if profile == "default":
        step = Parameter(default=min(1e-3, case.t_end), unit="s", doc="time step", low=0.0, open_low=True)
        return {"dt": step, "max_steps": steps}
    default = 1e-11 if profile == "matched" else USUAL_ACCURACY
    accuracy = Parameter(default=default, doc="requested accuracy", low=1e-14, high=1e-1)
    scheme = Parameter(default=SCHEMES[0], doc="integration scheme", choices=SCHEMES)
    return {"rtol": accuracy, "max_steps": steps} | ({"scheme": scheme} if profile == "matched" else {})


def _stepped(case: Case, profile: str) -> dict[str, Parameter]:
    """Return the settings of the discrete plant with friction."""
    matched = profile == "matched"
    return {
        "dt": Parameter(default=min(1e-3, case.t_end), unit="s", doc="time step", low=0.0, open_low=True),
        "approximation": Parameter(
            default="tamsi" if matched else "lagged", choices=tuple(APPROXIMATIONS), doc="of Coulomb's law"
        ),
        "stiction": Parameter(
            default=HOLDS if matched else STICTION,
            unit="m/s",
            doc="slip speed below which contacts stick; not for sap",
            low=0.0,
            open_low=True,
        ),
        "stiffness": Parameter(
            default=STIFF if matched else 0.0, unit="N/m", doc="of contacts; 0: Drake's default", low=0.0
        ),
        "max_steps": Parameter(default=1_000_000, doc="bound on the number of steps", low=1, high=1e9),
    }


ENGINE = Drake()
