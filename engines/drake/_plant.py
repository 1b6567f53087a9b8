"""Bodies on a line in Drake, in two ways.

As a MultibodyPlant: spheres on prismatic joints, point contact with the law's stiffness. And as a
symbolic vector system, in which Drake evaluates the case's memoryless law without Python.
"""

from __future__ import annotations

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

from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import matrices
from crossbody.engines._line import Line

THICK = 10.0  # sides of the box that stands for a plane, m


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
