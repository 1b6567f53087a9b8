"""Any scene in a MultibodyPlant: Drake's bodies and integrators, forces of the scene at its force input.

A plant in continuous time has no rows: no bounds, no loops, and contacts with a law of their own.
A motion is the scene's until the first row would act; there a run ends and says so. One in
discrete time has soft bounds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from time import perf_counter
from typing import Any

import numpy as np
from pydrake.systems.framework import BasicVector, DiagramBuilder, LeafSystem

from crossbody.cases import Case, CaseUnsupported, Mode, Outcome, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene, Tendon
from crossbody.cases.scene_contacts import frictional
from crossbody.engines._acting import Acting
from crossbody.engines._contacts import Contacts
from crossbody.engines._log import Log
from crossbody.engines._rubbing import why_no_steps
from crossbody.engines._scene import Forces, Stretch, masses
from crossbody.engines.contract import Run
from crossbody.engines.drake._simulate import Sim
from crossbody.engines.drake._tree import Tree
from crossbody.engines.nearest import Pose

NO_ROWS = "a MultibodyPlant in continuous time has no rows."
FIRST = 1e-5
"""First step of the matched profile, s: in Drake's own, .01, a force that grows with the cube of
a rate may overflow before the error is seen."""
SOFT = "Bounds of a MultibodyPlant in discrete time are its own springs and dampers, whose forces it does not report."


def hidden(profile: str) -> dict[str, str]:
    """Return which quantities of the audit there are not, and why."""
    return dict.fromkeys(("constants", "H", "lam"), SOFT if profile == "default" else NO_ROWS.capitalize())


def why_not(scene: Scene, profile: str) -> str | None:
    """Return why a scene has no motion in a plant; None if it has one."""
    if frictional(scene):
        if profile == "continuous":
            return "Friction is supported in Drake's discrete plants here: the profiles matched and default."
        if found := why_no_steps("Drake", scene, bounds=True):
            return found
    elif scene.loops:
        return f"The loop {scene.loops[0].name!r} is a row, and {NO_ROWS}"
    forces = Forces(scene)
    for joint in scene.joints:
        if joint.type in ("ball", "free") and forces.armature[forces.moved(joint)].any():
            return (
                f"Drake's rotor inertia is about one axis; the joint {joint.name!r} of type {joint.type} has armature."
            )
    return None


class Applied(LeafSystem):  # type: ignore[misc]
    """What acts on the bodies beside their weight, at the plant's force input."""

    def __init__(self, scene: Scene, tree: Tree, forces: Forces) -> None:
        super().__init__()
        self.tree, self.forces = tree, forces
        self.context = tree.plant.CreateDefaultContext()
        own = {body.name: body for body in scene.bodies}
        gravity = np.array(scene.gravity)
        self.lifted = [
            (body.name, body.com, -body.weightless * body.mass * gravity) for body in scene.bodies if body.weightless
        ]
        self.pushed = [(push.body, own[push.body].com) for push in scene.pushes]
        self.strings = [tendon for tendon in scene.tendons if tendon.bodies]
        if self.strings:
            self.forces.spans = self.spans
        n = tree.plant.num_velocities()
        self.DeclareVectorInputPort("x", BasicVector(tree.plant.num_multibody_states()))
        self.DeclareVectorOutputPort("tau", BasicVector(n), self._calculate)

    def _calculate(self, context: Any, output: Any) -> None:
        self.forces.t = context.get_time()
        output.SetFromVector(self.of(self.get_input_port().Eval(context)))

    def of(self, x: Floats) -> Floats:
        """Return the forces (nv,) in Drake's coordinates at its state."""
        q, v = self.tree.ours(x)
        total: Floats = self.tree.J(q).T @ self.forces(q, v)
        acting = [*self.lifted, *((*one, f) for one, f in zip(self.pushed, self.forces.pushes, strict=True))]
        if acting:
            self.tree.plant.SetPositionsAndVelocities(self.context, x)
        for body, com, force in acting:
            total += self.tree.point(self.context, body, com)[1].T @ force
        return total

    def spans(self, q: Floats, v: Floats) -> Stretch:
        """Return lengths, rates and derivatives of the tendons between points, in the scene's coordinates."""
        self.tree.put(self.context, q, v)
        found = [self._span(tendon) for tendon in self.strings]
        rows = np.array([row for _, row in found]) @ self.tree.J(q).T
        return np.array([length for length, _ in found]), rows @ v, rows

    def _span(self, tendon: Tendon) -> tuple[float, Floats]:
        """Return the length, and its derivative (n,) along Drake's velocities."""
        (one, H), (two, G) = (
            self.tree.point(self.context, *end) for end in zip(tendon.bodies, tendon.positions, strict=True)
        )
        length = float(np.linalg.norm(one - two))
        return length, (H - G).T @ (one - two) / length


class Observer:
    """Gaps and energies of states of the scene, by Drake's kinematics."""

    def __init__(self, scene: Scene, applied: Applied) -> None:
        self.scene, self.applied, self.tree = scene, applied, applied.tree
        self.context = self.tree.plant.CreateDefaultContext()
        self.touching = Contacts(scene)
        self.rows = bool(self.touching.count) or any(np.isfinite(part.range).any() for part in scene.bounded)

    def pose(self, body: str) -> Pose:
        """Return rotation and position of a body."""
        if not body:
            return np.eye(3), np.zeros(3)
        found = self.tree.plant.EvalBodyPoseInWorld(self.context, self.tree.plant.GetBodyByName(body))
        return found.rotation().matrix(), found.translation()

    def gaps(self, q: Floats) -> Floats:
        """Return h (nc,)."""
        self.tree.put(self.context, q, np.zeros(self.scene.nv))
        forces = self.applied.forces
        own = forces.bounds(q, forces.stretch(q, np.zeros(self.scene.nv))[0])
        return np.concatenate([own, self.touching.touches(self.pose).gap])

    def energy(self, q: Floats, v: Floats) -> tuple[float, float]:
        """Return kinetic and potential energy, J, without that of the springs."""
        self.tree.put(self.context, q, v)
        held = sum(
            float(self.tree.point(self.context, body, com)[0] @ force) for body, com, force in self.applied.lifted
        )
        kinetic = 0.5 * float(v @ self.tree.mass_matrix(self.context, q) @ v)
        return kinetic, float(self.tree.plant.CalcPotentialEnergy(self.context)) - held

    def __call__(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Return gaps (n, nc) and energies (n, 2)."""
        energy = np.array([self.energy(*one) for one in zip(q, v, strict=True)])
        energy[:, 1] += self.applied.forces.energy(q)
        return np.array([self.gaps(one) for one in q]).reshape(len(q), -1), energy


@dataclass(slots=True, kw_only=True)
class SceneRun(Run):
    """One prepared run of a scene; see `crossbody.engines.Run`."""

    case: Case
    profile: str
    settings: Mapping[str, Any]
    engine: str = "drake"
    sim: Sim = field(init=False)
    applied: Applied = field(init=False)
    observer: Observer = field(init=False)
    acting: Acting = field(init=False)

    def __post_init__(self) -> None:
        """Build the plant and what acts on it."""
        if (scene := self.case.scene) is None:
            raise CaseUnsupported(f"{self.case.label} is not a scene.")
        dt = float(self.settings.get("dt", 0.0))
        forces = Forces(scene)
        tree = Tree(scene, forces.armature, dt)
        self.applied, self.acting = Applied(scene, tree, forces), Acting(self.case)
        self.observer = Observer(scene, self.applied)
        builder = DiagramBuilder()
        plant, applied = builder.AddSystem(tree.plant), builder.AddSystem(self.applied)
        builder.Connect(plant.get_state_output_port(), applied.get_input_port())
        builder.Connect(applied.get_output_port(), plant.get_applied_generalized_force_input_port())
        used = self.settings
        start = tree.theirs(self.case.q0, self.case.v0)
        self.sim = Sim(
            builder.Build(), start, str(used.get("scheme", "runge_kutta3")), float(used.get("rtol", 0.0)),
            first=FIRST if self.profile == "matched" else 0.0,
        )  # fmt: skip

    def run(self) -> Trajectory:
        """Integrate from the start."""
        log, forces = Log(), self.applied.forces
        self.acting.reset()
        forces.begin(self.case.act0)
        start = perf_counter()
        with np.errstate(all="ignore"):  # a trial step may go far out; Drake refuses what is not finite
            outcome, message = self._integrate(log)
        wall = perf_counter() - start
        found = log.trajectory(self.observer, outcome, message, len(log.motion) - 1, wall)
        return self.acting.told(found)

    def _integrate(self, log: Log) -> tuple[Outcome, str]:
        """Go from one change of the inputs to the next, as far as no row would act."""
        sim, tree, t_end, limit = self.sim, self.applied.tree, self.case.t_end, int(self.settings["max_steps"])
        nc = len(self.case.contacts)
        none, free, met = np.zeros(nc), (int(Mode.FREE),) * nc, ""

        def keep(t: float, x: Floats) -> bool:
            nonlocal met
            if not log.motion or t > log.motion[-1][0]:
                log.add(t, *tree.ours(x), none, free)
                met = self._met(log.motion[-1][1])
            return bool(met)

        sim.start()
        changes = [t for t in self.acting.instants if t < t_end]
        for begin, end in pairwise(sorted({0.0, *changes, t_end})):
            if begin in changes:
                self.applied.forces.change(self.acting.at(begin, *tree.ours(sim.state())), begin)
                sim.put(sim.state())
            told = sim.run(end, limit, keep)
            place = f"t = {log.motion[-1][0]:g} s"
            if met:
                raise CaseUnsupported(
                    f"The row {met!r} acts before {place}, and {self._lacks()} It can run up to there: set t_end."
                )
            if told:
                return Outcome.STEP_TOO_SMALL, f"{place}: Drake says: {told}"
            if log.motion[-1][0] < end:
                return Outcome.STEP_LIMIT, f"{place}: {limit} steps did not reach the horizon."
        return Outcome.FINISHED, ""

    def _lacks(self) -> str:
        return "contacts of a scene are not supported in Drake." if self.profile == "default" else NO_ROWS

    def _met(self, q: Floats) -> str:
        """Return the row that a motion has reached; empty if it has reached none."""
        if not self.observer.rows:
            return ""
        h = self.observer.gaps(q)
        if self.profile == "default":  # it has bounds
            h[: len(h) - self.observer.touching.count] = np.inf
        return self.case.contacts[int(h.argmin())] if h.min() < 0.0 else ""

    def audit(self) -> Mapping[str, Any]:
        """The physics read back from the plant."""
        return physics(self.case, self.profile, self.observer)


def physics(case: Case, profile: str, observer: Observer) -> dict[str, Any]:
    """Return what the audit is told, read back from the plant, in the scene's coordinates."""
    tree, context, applied = observer.tree, observer.context, observer.applied

    def bias(q: Floats, v: Floats) -> Floats:
        applied.forces.still()
        tree.put(context, q, v)
        own = tree.plant.CalcBiasTerm(context) - tree.plant.CalcGravityGeneralizedForces(context)
        total: Floats = tree.J(q) @ (own - applied.of(tree.theirs(q, v)))
        return total

    def M(q: Floats) -> Floats:
        tree.put(context, q, np.zeros(len(case.v0)))
        return tree.mass_matrix(context, q)

    scene = observer.scene
    own = {body.name: tree.plant.GetBodyByName(body.name).get_mass(context) for body in scene.bodies}
    gravity = tree.plant.gravity_field().gravity_vector()
    return {
        "masses": masses(scene, own), "gravity": float(np.linalg.norm(gravity)), "q0": case.q0,
        "v0": case.v0, "M": M, "bias": bias, "hidden": hidden(profile),
    }  # fmt: skip
