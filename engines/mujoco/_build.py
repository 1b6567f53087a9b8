"""A scene as a model of MuJoCo, element by element."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import mujoco
import numpy as np

from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Actuator, Body, Joint, Loop, RowLaw, Scene, Shape, Tendon
from crossbody.cases.scene_contacts import Contact, contacts

POINT = 1e-15  # radius of a corner, m: below the rounding of any place, and above 0, which no ball has

FAR = 100.0
"""Half sides of the box whose face stands for a plane that moves, m: MuJoCo's planes stand still.
It rounds gaps to 1e-14 m, and has no other face within reach."""

LEAST = 2e-15
"""The smallest moment of inertia that MuJoCo admits, kg m^2 (twice mjMINVAL): it has no point masses."""
THIN = 1e-14
"""Moment of inertia, kg m^2, up to which a full tensor is at the rounding of what its eigenvalues must be."""


# The linear law in the direct format, without regularisation: aref = -B h' - K d h with the impedance
# d = dmin = dmax at its largest, solref = (-K dmax^2, -B dmax).
MAX_IMPEDANCE = 0.9999  # MuJoCo clamps d there; it leaves R = (1 - d)/d diagA, a bias of 1e-4 in lam
IMPEDANCE = (MAX_IMPEDANCE, MAX_IMPEDANCE, 1e-3, 0.5, 1.0)
"""The solimp that goes with it: the same impedance at every depth."""
REMAINING = 1e-7
"""Factor on R. With PGS on one row the error of lam falls with it: 2e-8, 2e-11, 6e-13 at 1e-4, 1e-7, 1e-9."""


def solref_of(a0: float, a1: float) -> tuple[float, float]:
    """Return the solref that gives aref = -a1 h' - a0 h; both negative or zero, or MuJoCo replaces them."""
    return -MAX_IMPEDANCE * a0, -MAX_IMPEDANCE * a1


def without_regularisation(model: Any) -> None:
    """Scale what R is made from: inverse weights of bodies (contacts), joints (joint rows) and tendons."""
    model.body_invweight0[:] *= REMAINING
    model.dof_invweight0[:] *= REMAINING
    model.tendon_invweight0[:] *= REMAINING


def compiled(spec: Any, scene: Scene) -> Any:
    """Return the compiled model, with what no element of the format says.

    That is where the springs of ball joints rest, the points of loops, which are computed there from
    the pose, and the corners of meshes, which the compiler turns to its own axes in single precision.
    """
    model = spec.compile()
    for shape in scene.shapes:
        if shape.type == "hull" and spec.mesh(shape.name) is not None:
            geom, mesh = model.geom(shape.name), model.mesh(shape.name).id
            geom.pos, geom.quat = shape.position, shape.orientation
            model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]] = shape.corners
    for i, loop in enumerate(scene.loops):
        if loop.type == "connect":
            model.eq_data[i, :6] = *loop.first_position, *loop.second_position
        if loop.type == "weld":
            model.eq_data[i, :6] = *loop.second_position, *loop.first_position
    for joint in scene.joints:
        if joint.type == "ball":
            at = int(model.joint(joint.name).qposadr[0])
            model.qpos_spring[at : at + 4] = joint.rest
    return model


def spec_of(scene: Scene, *, by_corners: bool = False, solids: Collection[str] = ()) -> Any:
    """Return a scene as an editable model.

    Args:
        scene: what it is made of.
        by_corners: whether every corner of a hull is a shape of its own: MuJoCo has but a few
            contacts of a mesh.
        solids: bodies whose mass and inertia MuJoCo takes from their shapes.
    """
    spec = mujoco.MjSpec()
    spec.compiler.balanceinertia = False
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    spec.compiler.degree, spec.compiler.autolimits = False, False
    spec.option.gravity = scene.gravity
    bodies = {"": spec.worldbody}
    for body in scene.bodies:
        added = bodies[body.parent].add_body(
            name=body.name, pos=body.position, quat=body.orientation, gravcomp=body.weightless
        )
        if body.name not in solids:
            _add_inertia(added, body)
        bodies[body.name] = added
        for joint in scene.joints:
            if joint.body == body.name:
                _add_joint(added, joint)
    for tendon in scene.tendons:
        _add_tendon(spec, bodies, tendon)
    for loop in scene.loops:
        _add_loop(spec, loop)
    for actuator in scene.actuators:
        _add_actuator(spec, actuator)
    for contact in contacts(scene):
        if by_corners and contact.second.type == "hull":
            _add_corners(spec, bodies, contact)
        else:
            _add_contact(spec, bodies, contact)
    return spec


def _add_inertia(added: Any, body: Body) -> None:
    added.explicitinertial, added.mass, added.ipos = True, body.mass, body.com
    if body.mass > 0.0 and any(body.inertia[:3]) and min(body.inertia[:3]) <= THIN and not any(body.inertia[3:]):
        added.inertia = np.maximum(body.inertia[:3], LEAST)
    elif body.mass > 0.0 and any(body.inertia):
        added.fullinertia = body.inertia  # in the order xx yy zz xy xz yz
    else:
        added.inertia = (LEAST if body.mass > 0.0 else 0.0,) * 3


def moves(body: Any) -> bool:
    """Return whether a body or one above it has a joint."""
    while body.name != "world":
        if body.joints:
            return True
        body = body.parent
    return False


def _bounds(bounds: tuple[float, ...]) -> tuple[bool, tuple[float, ...]]:
    """Return whether there is a bound, and both of them; one that is not there is far away."""
    return bool(np.isfinite(bounds).any()), tuple(np.clip(bounds, -1e10, 1e10))


def _solref(law: RowLaw) -> tuple[float, float]:
    return solref_of(law.a0, law.a1)


def _add_joint(body: Any, joint: Joint) -> None:
    added = body.add_joint(
        name=joint.name, type=getattr(mujoco.mjtJoint, f"mjJNT_{joint.type.upper()}"), axis=joint.axis,
        pos=joint.anchor, ref=joint.reference, margin=joint.margin, armature=joint.armature,
        springref=joint.rest[0], frictionloss=joint.friction_loss,
    )  # fmt: skip
    added.damping[:], added.stiffness[:] = joint.damping, joint.stiffness
    added.limited, added.range = _bounds(joint.range)
    if joint.type == "ball":
        added.range[0] = 0.0
    added.actfrclimited, added.actfrcrange = _bounds(joint.force_range)
    added.solref_limit, added.solimp_limit = _solref(joint.law), IMPEDANCE


def _add_tendon(spec: Any, bodies: Mapping[str, Any], tendon: Tendon) -> None:
    added = spec.add_tendon(
        name=tendon.name, springlength=tendon.rest, margin=tendon.margin, frictionloss=tendon.friction_loss
    )
    added.damping[:], added.stiffness[:] = tendon.damping, tendon.stiffness
    added.limited, added.range = _bounds(tendon.range)
    added.solref_limit, added.solimp_limit = _solref(tendon.law), IMPEDANCE
    for name, c in zip(tendon.joints, tendon.coefficients, strict=True):
        added.wrap_joint(name, c)
    for k, (name, position) in enumerate(zip(tendon.bodies, tendon.positions, strict=True)):
        added.wrap_site(bodies[name].add_site(name=f"{tendon.name} end {k}", pos=position).name)


def _add_loop(spec: Any, loop: Loop) -> None:
    added = spec.add_equality(name=loop.name, type=getattr(mujoco.mjtEq, f"mjEQ_{loop.type.upper()}"), active=True)
    kind = "body" if loop.in_space else loop.type
    added.objtype = getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
    added.name1, added.name2 = loop.first, loop.second
    if loop.in_space:
        added.name1, added.name2 = loop.first or "world", loop.second or "world"
    else:
        added.data[:5] = loop.polynomial
    if loop.type == "weld":
        added.data[6:11] = *loop.orientation, loop.torque_scale
    added.solref, added.solimp = _solref(loop.law), IMPEDANCE


def _add_contact(spec: Any, bodies: Mapping[str, Any], contact: Contact) -> None:
    """Add a pair by itself, and its shapes where no other pair has added them; nothing else touches them."""
    for shape in (contact.first, contact.second):
        add_shape(spec, bodies, shape)
    _add_pair(spec, contact, contact.pair.name, contact.second.name)


def _add_corners(spec: Any, bodies: Mapping[str, Any], contact: Contact) -> None:
    """Add every corner of a hull as the least ball that there is, and a pair of each with the plane."""
    add_shape(spec, bodies, contact.first)
    shape = contact.second
    at = np.array(shape.position) + np.array(shape.corners) @ matrices(np.array(shape.orientation)).T
    for row, name, corner in zip(contact.normals, corner_names(shape), at, strict=True):
        add_shape(spec, bodies, Shape(name=name, body=shape.body, size=(POINT, 0.0, 0.0), position=corner))
        _add_pair(spec, contact, row, name)


def corner_names(shape: Shape) -> tuple[str, ...]:
    """Return names for the corners of a hull; a line of its own tells them from the names in a file."""
    return tuple(f"{shape.name}\n{k}" for k in range(len(shape.corners)))


def add_shape(spec: Any, bodies: Mapping[str, Any], shape: Shape) -> None:
    """Add a shape that touches nothing by itself, if it is not there."""
    if spec.geom(shape.name) is not None:
        return
    kind, size, position = "mesh" if shape.type == "hull" else shape.type, shape.size, np.array(shape.position)
    if kind == "plane":
        size = (0.0, 0.0, 1.0)  # without end, and a grid to be drawn
    if kind == "plane" and moves(bodies[shape.body]):
        kind, size = "box", (FAR, FAR, FAR)
        position -= FAR * matrices(np.array(shape.orientation))[:, 2]
    if kind == "sphere":
        size = (max(size[0], POINT), 0.0, 0.0)
    added = bodies[shape.body].add_geom(
        name=shape.name, type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}"), size=size,
        pos=position, quat=shape.orientation, contype=0, conaffinity=0,
    )  # fmt: skip
    if kind == "mesh":
        added.meshname = spec.add_mesh(name=shape.name, uservert=np.ravel(shape.corners)).name


def _add_pair(spec: Any, contact: Contact, name: str, second: str) -> None:
    spec.add_pair(
        name=name, geomname1=contact.first.name, geomname2=second,
        condim=contact.pair.dimension if contact.friction > 0.0 else 1, friction=contact.pair.friction,
        margin=contact.pair.margin, solref=_solref(contact.pair.law), solimp=IMPEDANCE,
    )  # fmt: skip


def _add_actuator(spec: Any, actuator: Actuator) -> None:
    added = spec.add_actuator(name=actuator.name, target=actuator.joint or actuator.tendon)
    added.trntype = mujoco.mjtTrn.mjTRN_JOINT if actuator.joint else mujoco.mjtTrn.mjTRN_TENDON
    added.gear[: len(actuator.gear)] = actuator.gear
    added.gaintype, added.biastype = mujoco.mjtGain.mjGAIN_AFFINE, mujoco.mjtBias.mjBIAS_AFFINE
    added.gainprm[:3], added.biasprm[:3] = actuator.gain, actuator.bias
    added.armature, added.damping[0] = actuator.armature, actuator.damping
    if actuator.activation:
        added.dyntype = getattr(mujoco.mjtDyn, f"mjDYN_{actuator.activation.upper()}")
        added.dynprm[0] = actuator.time_constant
        added.actlimited, added.actrange = _bounds(actuator.activation_range)
    added.ctrllimited, added.ctrlrange = _bounds(actuator.control_range)
    added.forcelimited, added.forcerange = _bounds(actuator.force_range)
