"""Any scene in Pinocchio: its own model, joint by joint, with rows and forces written apart."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Case, CaseUnsupported, Mode
from crossbody.cases._arrays import Floats
from crossbody.cases.scene import Body, Joint, Scene, Tendon
from crossbody.engines import _scene as parts
from crossbody.engines.pinocchio._contacts import ContactRows
from crossbody.engines.pinocchio._coordinates import Coordinates
from crossbody.engines.pinocchio._joined import Joined, Strings, by_least_norm
from crossbody.engines.pinocchio._rows import Forces, PinRows, mass_matrix, point_jacobian
from crossbody.engines.pinocchio._scene import Scene as Prepared
from crossbody.engines.pinocchio._scene import World

Heights = Callable[[Floats], Floats]
Placed = dict[str, tuple[int, Any]]
"""Body -> joint that carries it, and its pose in that joint's frame."""


def why_not(case: Case, profile: str) -> str | None:
    """Return why a profile cannot do it: bounds and loops follow the law alone."""
    if profile != "law":
        return "The rows of a scene follow the law: impacts in no time and time stepping have none."
    return None


def build(case: Case, algebra: str) -> Prepared:
    """Return the model of a scene with its forces and rows."""
    scene = case.scene
    if scene is None:
        raise CaseUnsupported(f"{case.label} is not a scene.")
    forces = parts.Forces(scene)
    rows = parts.Rows(scene.replace(loops=tuple(loop for loop in scene.loops if not loop.in_space)), forces)
    model, placed = tree(scene)
    model.armature[:] = forces.armature
    to = Coordinates(scene)
    data = model.createData()

    def apply(q: Floats, v: Floats, tau: Floats) -> None:
        # A free joint's armature resists the acceleration of p', of which Pinocchio's velocities turn with the body.
        ours = forces(to.ours(q), to.velocities(q, v)) - forces.armature * to.bend(q, v)
        tau[:] = to.back(q, ours) + at_centres(scene, forces, model, data, placed, q)

    joined = Joined(model, placed, tuple(loop for loop in scene.loops if loop.in_space))
    strings = Strings(model, placed, tuple(tendon for tendon in scene.tendons if tendon.bodies))
    touching = ContactRows(scene, model, placed)
    order = _order(scene)

    def heights(q: Floats) -> Floats:
        own = np.concatenate([rows.heights(to.ours(q)), joined.heights(q), strings.heights(q)])[order]
        return np.concatenate([own, touching.heights(q)])

    def jacobian(q: Floats) -> Floats:
        own = np.concatenate([to.back(q, rows.jacobian(to.ours(q))), joined.jacobian(q), strings.jacobian(q)])[order]
        return np.concatenate([own, touching.jacobian(q)])

    def drift(q: Floats, v: Floats) -> Floats:
        own = np.concatenate([rows.drift(to.ours(q), to.velocities(q, v)), joined.drift(q, v), strings.drift(q, v)])[
            order
        ]
        return np.concatenate([own, touching.drift(q, v)])

    pinned = PinRows(model, jacobian, heights, drift, law=case.law, algebra=algebra, forces=apply)
    if joined.ends:  # planar loops have rows that depend on each other
        pinned.solve = by_least_norm(model, pinned.data, pinned.tau)
    start = to.theirs(case.q0)
    return Prepared(
        rows=pinned, observe=_observe(scene, model, placed, forces, heights, to),
        sizes=(np.ones(to.nq), np.ones(to.nv)),
        start=(start, to.back(start, case.v0)), chart=lambda q, v: (to.ours(q), to.velocities(q, v)),
        world=_world(case, forces), audit=_audit(scene, pinned, forces, apply, to),
        coordinates=to if to.turns else None,
    )  # fmt: skip


def _order(scene: Scene) -> list[int]:
    """Return where each row of a scene stands where loops in space come last but one, and distances of points last."""
    kinds = [1 * loop.in_space for loop in scene.loops for _ in range(loop.width)]
    for part in scene.bounded:
        kinds += [2 * (isinstance(part, Tendon) and bool(part.bodies))] * int(np.isfinite(part.range).sum())
    stands = np.empty(len(kinds), dtype=int)
    stands[np.argsort(kinds, kind="stable")] = np.arange(len(kinds))
    return list(stands.tolist())


def tree(scene: Scene) -> tuple[Any, Placed]:
    """Return Pinocchio's model of the bodies, and where each of them is."""
    model = pin.Model()
    model.gravity.linear = np.array(scene.gravity)
    placed: Placed = {"": (0, pin.SE3.Identity())}
    for body in scene.bodies:
        carrier, pose = placed[body.parent]
        pose = pose * _pose(body.position, body.orientation)
        for joint in scene.joints:
            if joint.body != body.name:
                continue
            anchor = pin.SE3(np.eye(3), np.array(joint.anchor))
            before = pin.SE3.Identity() if joint.type == "free" else pose * anchor
            carrier = model.addJoint(carrier, _joint(joint), before, joint.name)
            pose = anchor.inverse()
        placed[body.name] = (carrier, pose)
        model.appendBodyToJoint(carrier, _inertia(body), pose)
    return model, placed


def _pose(position: Any, orientation: Any) -> Any:
    w, x, y, z = orientation
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized().matrix(), np.array(position))


def _joint(joint: Joint) -> Any:
    if joint.type in ("free", "ball"):
        return pin.JointModelFreeFlyer() if joint.type == "free" else pin.JointModelSpherical()
    kinds = {"hinge": pin.JointModelRevoluteUnaligned, "slide": pin.JointModelPrismaticUnaligned}
    return kinds[joint.type](np.array(joint.axis))


def _inertia(body: Body) -> Any:
    xx, yy, zz, xy, xz, yz = body.inertia
    return pin.Inertia(body.mass, np.array(body.com), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


def at_centres(scene: Scene, forces: parts.Forces, model: Any, data: Any, placed: Placed, q: Floats) -> Floats:
    """Return the generalised force (nv,) of the weight that bodies are spared, and of pushes."""
    total: Floats = np.zeros(model.nv)
    acting = {body.name: -body.weightless * body.mass * np.array(scene.gravity) for body in scene.bodies}
    for push, force in zip(scene.pushes, forces.pushes, strict=True):
        acting[push.body] = acting[push.body] + force
    found = [(body, acting[body.name]) for body in scene.bodies if acting[body.name].any()]
    if found:
        pin.computeJointJacobians(model, data, q)
    for body, force in found:
        carrier, pose = placed[body.name]
        centre = (data.oMi[carrier] * pose).act(np.array(body.com))
        total += point_jacobian(model, data, carrier, centre).T @ force
    return total


def _observe(
    scene: Scene, model: Any, placed: Placed, forces: parts.Forces, heights: Heights, to: Coordinates
) -> Any:  # fmt: skip
    """Gaps (n, nc), and kinetic and potential energy (n, 2) with that of the springs."""
    data = model.createData()

    def observe(q: Floats, v: Floats) -> tuple[Floats, Floats]:
        energy: Floats = np.empty((len(q), 2))
        for i in range(len(q)):
            # Armature is in Pinocchio's M but not in its kinetic energy.
            energy[i, 0] = pin.computeKineticEnergy(model, data, q[i], v[i]) + 0.5 * (model.armature * v[i]) @ v[i]
            energy[i, 1] = pin.computePotentialEnergy(model, data, q[i])
            for body in scene.bodies:
                if body.weightless:
                    carrier, pose = placed[body.name]
                    height = (data.oMi[carrier] * pose).act(np.array(body.com)) @ np.array(scene.gravity)
                    energy[i, 1] += body.weightless * body.mass * height
        energy[:, 1] += forces.energy(to.ours(q))
        return np.array([heights(one) for one in q]).reshape(len(q), -1), energy

    return observe


def _world(case: Case, forces: parts.Forces) -> World:
    """The inputs, from one change to the next."""
    given = case.inputs
    if given is None:
        return World()

    def change(t: float, _q: Floats, _v: Floats) -> None:
        forces.change(given.values[np.searchsorted(given.times, t)])

    return World(instants=given.times.tolist(), change=change, reset=forces.still)


def _audit(scene: Scene, rows: PinRows, forces: parts.Forces, apply: Forces, to: Coordinates) -> dict[str, Any]:
    """What differs from the rows' own audit: masses body by body, forces at zero input, and the scene's coordinates."""
    model, data = rows.model, rows.data
    on = rows_on(rows)

    def bias(q: Floats, v: Floats) -> Floats:
        forces.still()
        r = to.theirs(q)
        u = to.back(r, v)
        apply(r, u, rows.tau)
        own = pin.nonLinearEffects(model, data, r, u) - rows.tau
        total: Floats = to.velocities(r, own) - M(q) @ to.bend(r, u)
        return total

    def M(q: Floats) -> Floats:
        r = to.theirs(q)
        half = to.velocities(r, mass_matrix(model, data, r))  # J M J^T: J is orthogonal
        return to.velocities(r, half.T)

    def lam(q: Floats, v: Floats) -> Floats:
        forces.still()
        r = to.theirs(q)
        return rows.accelerate(r, to.back(r, v), on)[1]

    return {
        "masses": np.array([body.mass for body in scene.bodies]),
        "M": M,
        "bias": bias,
        "H": lambda q: to.velocities(to.theirs(q), rows.jacobian(to.theirs(q))),
        "lam": lam,
    }


def rows_on(rows: PinRows) -> tuple[int, ...]:
    """Every row active."""
    return tuple(int(Mode.CONTACT) for _ in range(rows.nc))
