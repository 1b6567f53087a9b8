"""Bodies on a line as a MultibodyPlant: spheres on prismatic joints, point contact with the law's stiffness."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.geometry import AddContactMaterial, Box, ProximityProperties, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel, CoulombFriction
from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, SpatialInertia, UnitInertia
from pydrake.systems.framework import DiagramBuilder

from crossbody.cases.rotations import matrices
from crossbody.engines._line import Line

THICK = 10.0  # sides of the box that stands for a plane, m


def plant(scene: Line, dt: float) -> tuple[Any, Any]:
    """The diagram and its plant; dt is 0 for continuous time, else the step of the discrete plant, s.

    A contact has the stiffness m a0 of its row; Drake's dissipation (Hunt and Crossley) is not the law's: none.
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
