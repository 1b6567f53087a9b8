"""Scenes with friction in Drake's discrete plant: four approximations of Coulomb's law."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    Box,
    Capsule,
    CollisionFilterDeclaration,
    Cylinder,
    Ellipsoid,
    GeometrySet,
    HalfSpace,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, DiscreteContactApproximation
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Shape
from crossbody.cases.scene_contacts import contacts
from crossbody.engines._rubbing import AT_BOUND, Push, steps_of
from crossbody.engines._scene import Forces
from crossbody.engines.drake._scene import Applied, Observer
from crossbody.engines.drake._tree import Tree
from crossbody.engines.nearest import ROUND, Pose, corners

APPROXIMATIONS = {
    "sap": DiscreteContactApproximation.kSap, "lagged": DiscreteContactApproximation.kLagged,
    "similar": DiscreteContactApproximation.kSimilar, "tamsi": DiscreteContactApproximation.kTamsi,
}  # fmt: skip
STICTION = 1e-3  # slip below which Drake holds, m/s, where nothing else is said
STIFF, HOLDS, QUICK = 1e7, 1e-6, 100.0
"""Of matched contacts: stiffness, N/m; slip that holds, m/s; dissipation (Hunt and Crossley), s/m."""
SOFT_BOUND = 0.99
"""Part of its bound where friction slides whose law comes no nearer than mu/sqrt(1 + (stiction/slip)^2)."""


class Rubs:
    """A `Stepper` of a scene with friction; settings: dt, approximation, stiction, stiffness (0: Drake's own).

    Matched, places of boxes, capsules and hulls over planes are points; else solids are Drake's
    own, of which it has one contact, where they are deepest.
    """

    def __init__(self, case: Case, used: Mapping[str, Any], matched: bool) -> None:
        assert case.scene is not None
        self.case, self.scene, self.dt = case, case.scene, steps_of(case, float(used["dt"]))[1]
        self.matched, self.stiffness = matched, float(used["stiffness"])
        self.solid: dict[Any, str] = {}
        builder = DiagramBuilder()
        plant, self.graph = AddMultibodyPlantSceneGraph(builder, self.dt)
        plant.set_discrete_contact_approximation(APPROXIMATIONS[str(used["approximation"])])
        plant.set_stiction_tolerance(float(used["stiction"]))
        forces = Forces(self.scene)
        self.tree = Tree(self.scene, forces.armature, self.dt, plant, self._register)
        self.applied = Applied(self.scene, self.tree, forces)
        self.observer = Observer(self.scene, self.applied)
        applied = builder.AddSystem(self.applied)
        builder.Connect(plant.get_state_output_port(), applied.get_input_port())
        builder.Connect(applied.get_output_port(), plant.get_applied_generalized_force_input_port())
        self.simulator = Simulator(builder.Build())
        self.context = plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        self.bound = SOFT_BOUND if used["approximation"] in ("lagged", "similar") else 1.0 - AT_BOUND
        self.start()

    def _register(self, plant: Any) -> None:
        """Give every pair solids of its own, that meet each other alone: friction is a pair's."""
        groups, everything = [], GeometrySet()
        for contact in contacts(self.scene):
            ends, points = [], self.matched and contact.first.type == "plane"
            for shape in (contact.first, contact.second):
                group = GeometrySet()
                for k, (place, solid) in enumerate(_solids(shape, points)):
                    carrier = plant.GetBodyByName(shape.body) if shape.body else plant.world_body()
                    name = f"{contact.pair.name} {shape.name} {k}"
                    made = plant.RegisterCollisionGeometry(carrier, place, solid, name, self._surface(contact.friction))
                    self.solid[made] = shape.name
                    group.Add(made)
                    everything.Add(made)
                ends.append(group)
            groups.append(ends)
        self.meetings = everything, groups

    def _surface(self, mu: float) -> Any:
        found = ProximityProperties()
        stiff = {"dissipation": QUICK, "point_stiffness": self.stiffness} if self.stiffness else {}
        AddContactMaterial(friction=CoulombFriction(mu, mu), properties=found, **stiff)
        return found

    def start(self) -> tuple[Floats, Floats]:
        """See `Stepper`."""
        self.applied.forces.begin(self.case.act0)
        root = self.simulator.get_mutable_context()
        root.SetTime(0.0)
        everything, groups = self.meetings
        manager = self.graph.collision_filter_manager(self.graph.GetMyMutableContextFromRoot(root))
        manager.Apply(CollisionFilterDeclaration().ExcludeWithin(everything))
        for one, two in groups:
            manager.Apply(CollisionFilterDeclaration().AllowBetween(one, two))
        self.context.SetDiscreteState(self.tree.theirs(self.case.q0, self.case.v0))
        self.count = 0
        self.simulator.Initialize()
        return self.case.q0, self.case.v0

    def change(self, values: Floats, t: float) -> None:
        """See `Stepper`."""
        self.applied.forces.change(values, t)
        self.context.SetDiscreteState(self._state())  # what was computed with the inputs before is computed anew

    def _state(self) -> Floats:
        found: Floats = self.context.get_discrete_state_vector().CopyToVector()
        return found

    def step(self, t: float) -> tuple[Floats, Floats, list[Push]]:
        """See `Stepper`."""
        self.count += 1
        self.simulator.AdvanceTo(self.count * self.dt)
        q, v = self.tree.ours(self._state())
        self.tree.put(self.observer.context, q, v)
        return q, v, self._pushes()

    def _pushes(self) -> list[Push]:
        plant = self.tree.plant
        met = plant.get_contact_results_output_port().Eval(self.context)
        found = []
        for i in range(met.num_point_pair_contacts()):
            one = met.point_pair_contact_info(i)
            pair, force = one.point_pair(), np.array(one.contact_force())
            normal = np.array(pair.nhat_BA_W)
            across = force - (force @ normal) * normal
            mu = self._mu(pair.id_A, pair.id_B)
            slides = bool(np.linalg.norm(across) >= self.bound * mu * abs(force @ normal))
            found.append(
                Push(self.solid[pair.id_A], self.solid[pair.id_B], np.array(one.contact_point()), force, slides)
            )
        return found

    def _mu(self, one: Any, two: Any) -> float:
        names = {self.solid[one], self.solid[two]}
        return next(c.friction for c in contacts(self.scene) if {c.first.name, c.second.name} == names)

    def pose(self, body: str) -> Pose:
        """See `Stepper`."""
        return self.observer.pose(body)

    def observe(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """See `Stepper`."""
        return self.observer(q, v)

    def counts(self) -> Mapping[str, int]:
        """See `Stepper`."""
        return {}


def _solids(shape: Shape, points: bool) -> list[tuple[Any, Any]]:
    """Return places in the body and solids of a shape: points at its own places, or itself."""
    turned, at = RotationMatrix(matrices(np.array(shape.orientation))), np.array(shape.position)
    place, size = RigidTransform(turned, at), shape.size
    if shape.type in ROUND and (points or shape.type == "hull"):
        radius = size[0] if shape.type == "capsule" else 0.0
        ends = corners(shape.type, shape.extents)
        return [(RigidTransform(place @ end), Sphere(radius)) for end in ends]
    solids = {
        "plane": lambda: HalfSpace(), "sphere": lambda: Sphere(size[0]),
        "capsule": lambda: Capsule(size[0], 2.0 * size[1]), "cylinder": lambda: Cylinder(size[0], 2.0 * size[1]),
        "box": lambda: Box(*(2.0 * side for side in size)), "ellipsoid": lambda: Ellipsoid(*size),
    }  # fmt: skip
    return [(place, solids[shape.type]())]
