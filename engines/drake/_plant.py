"""Bodies on a line as a MultibodyPlant: spheres on prismatic joints, point contact with the law's stiffness."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.geometry import AddContactMaterial, Box, ProximityProperties, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel, CoulombFriction
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia, UnitInertia
from pydrake.systems.framework import DiagramBuilder

from crossbody.engines._line import Line

THICK = 10.0  # m, of the floor


def plant(scene: Line, dt: float) -> tuple[Any, Any]:
    """The diagram and its plant; dt is 0 for continuous time, else the step of the discrete plant, s.

    A contact has the stiffness m a0 of its row; Drake's dissipation (Hunt and Crossley) is not the law's: none.
    """
    builder = DiagramBuilder()
    made, _ = AddMultibodyPlantSceneGraph(builder, dt)
    axis = np.array([0.0, 0.0, 1.0] if scene.floor else [1.0, 0.0, 0.0])
    made.mutable_gravity_field().set_gravity_vector(np.array([0.0, 0.0, -scene.gravity]))
    for i, mass in enumerate(scene.masses.tolist()):
        inertia = SpatialInertia(mass, np.zeros(3), UnitInertia.SolidSphere(scene.radius))
        body = made.AddRigidBody(f"ball {i}", inertia)
        made.AddJoint(PrismaticJoint(f"ball {i}", made.world_frame(), body.body_frame(), axis))
        sphere = Sphere(scene.radius)
        made.RegisterCollisionGeometry(body, RigidTransform(), sphere, f"ball {i}", _material(scene))
    if scene.floor:
        place = RigidTransform(np.array([0.0, 0.0, -scene.radius - 0.5 * THICK]))
        floor = Box(THICK, THICK, THICK)
        made.RegisterCollisionGeometry(made.world_body(), place, floor, "floor", _material(scene))
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


def offsets(scene: Line) -> list[float]:
    """Position of every joint at q = 0, m."""
    return [0.0 if scene.floor else i * (2.0 * scene.radius + scene.gap) for i in range(len(scene.masses))]
