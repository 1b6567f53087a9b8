"""Any scene in Pinocchio: its own model, joint by joint, with rows and forces written apart."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Case, CaseUnsupported, Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Body, Joint, Scene, Tendon
from crossbody.cases.scene_contacts import frictional
from crossbody.engines import _scene as parts
from crossbody.engines._acting import Acting
from crossbody.engines.pinocchio._contacts import ContactRows
from crossbody.engines.pinocchio._coordinates import Coordinates
from crossbody.engines.pinocchio._joined import Joined, Spans, Strings, by_least_norm, loose_rows, none_pulling
from crossbody.engines.pinocchio._rows import Chosen, Forces, PinRows, mass_matrix, point_jacobian, pose
from crossbody.engines.pinocchio._scene import Scene as Prepared
from crossbody.engines.pinocchio._scene import World
from crossbody.engines.pinocchio._ways import Ways

SMALL = 1e-4
"""Size of coordinates and rates, SI, below which they are known to the absolute tolerance alone:
a pendulum that is let go upright moves by less for a while, and by all of it later."""
DIPS = 0.02
"""m: shapes further apart are not looked at for dips that begin and end in one step; a robot has hundreds of pairs,
every one of which would have steps end where it is nearest."""
Heights = Callable[[Floats], Floats]
Gradients = tuple[Floats, Floats]
"""h (n,) and H (n, nv)."""
Placed = dict[str, tuple[int, Any]]
"""Body -> joint that carries it, and its pose in that joint's frame."""


def why_not(case: Case, profile: str) -> str | None:
    """Return why a profile cannot do it: bounds and loops follow the law alone."""
    if case.scene is not None and (found := frictional(case.scene)):
        return found
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
    armature = forces.armature
    model.armature[:] = armature
    to = Coordinates(scene)
    forces.spans = spans(scene, model, placed, to)
    centres = at_centres(scene, forces, model, model.createData(), placed)

    def apply(q: Floats, v: Floats, tau: Floats) -> None:
        # A free joint's armature resists the acceleration of p', of which Pinocchio's velocities turn with the body.
        ours = forces(to.ours(q), to.velocities(q, v)) - armature * to.bend(q, v)
        tau[:] = to.back(q, ours) + centres(q)

    loops, strings = [loop for loop in scene.loops if loop.in_space], [one for one in scene.tendons if one.bodies]
    in_space: list[Joined | Strings] = [
        *([Joined(model, placed, loops)] if loops else []), *([Strings(model, placed, strings)] if strings else []),
    ]  # fmt: skip
    touching, order = ContactRows(scene, model, placed), _order(scene)

    def heights(q: Floats) -> Floats:
        own = np.concatenate([rows.heights(to.ours(q)), *(part.heights(q) for part in in_space)])
        return np.concatenate([own[order], touching.heights(q)])

    def own_gradients(q: Floats) -> Gradients:
        h = np.concatenate([rows.heights(to.ours(q)), *(part.heights(q) for part in in_space)])
        H = np.concatenate([to.back(q, rows.jacobian(to.ours(q))), *(part.jacobian(q) for part in in_space)])
        return h[order], H[order]

    @LastAsked
    def gradients(q: Floats) -> Gradients:
        (h, H), (gaps, N) = own_gradients(q), touching.gradients(q)
        return np.concatenate([h, gaps]), np.concatenate([H, N])

    def gradient_of(q: Floats, chosen: Chosen) -> Gradients:
        if isinstance(chosen, slice):
            return gradients(q)
        wanted = np.array(chosen)
        before = wanted < len(order)
        if before.all():
            h, H = own_gradients(q)
            return h[wanted], H[wanted]
        h, H = np.empty(len(wanted)), np.empty((len(wanted), model.nv))
        h[~before], H[~before] = touching.gradients(q, (wanted[~before] - len(order)).tolist())
        if before.any():
            h[before], H[before] = (part[wanted[before]] for part in own_gradients(q))
        return h, H

    def drift_of(q: Floats, v: Floats, chosen: Chosen) -> Floats:
        wanted = np.arange(len(order) + touching.count)[chosen]
        before = wanted < len(order)
        total: Floats = np.empty(len(wanted))
        if before.any():
            own = [rows.drift(to.ours(q), to.velocities(q, v)), *(part.drift(q, v) for part in in_space)]
            total[before] = np.concatenate(own)[order][wanted[before]]
        total[~before] = touching.drift(q, v, list(wanted[~before] - len(order)))
        return total

    pinned = PinRows(
        model, lambda q: gradients(q)[1], lambda q: gradients(q)[0], lambda q, v: drift_of(q, v, slice(None)),
        law=case.law, algebra=algebra, forces=apply, drift_of=drift_of, gradient_of=gradient_of,
    )  # fmt: skip
    pinned.near[len(order) :] = DIPS
    if touching.contacts.turning:
        pinned.ways = Ways(touching, len(order), gradients.forget)
    start = to.theirs(case.q0)
    if _may_depend(scene, touching.count):
        widths = [loop.width for loop in scene.loops]
        root = np.linalg.cholesky(mass_matrix(model, pinned.data, start))
        A = np.linalg.solve(root, gradients(start)[1][: sum(widths)].T).T
        loose = loose_rows(A, widths, case.rank) if widths else ()
        pinned.solve = by_least_norm(model, pinned.data, pinned.tau, *loose)
        pinned.shared = none_pulling
    return Prepared(
        rows=pinned, observe=_observe(scene, model, placed, forces, heights, to),
        sizes=(np.full(to.nq, SMALL), np.full(to.nv, SMALL)),
        start=(start, to.back(start, case.v0)), chart=lambda q, v: (to.ours(q), to.velocities(q, v)),
        world=_world(case, forces, to), audit=_audit(scene, pinned, forces, apply, to),
        coordinates=to if to.turns else None,
    )  # fmt: skip


def _may_depend(scene: Scene, touching: int) -> bool:
    """Return whether rows that act at once may depend on each other; bounds of joints alone do not.

    Planar loops have rows that do, joints that are coupled and both at their bounds, and bodies on many feet.
    """
    bounds = [part for part in scene.bounded if np.isfinite(part.range).any()]
    tendons = any(isinstance(part, Tendon) for part in bounds)
    return bool(scene.loops) or touching > 1 or (bool(bounds) and (touching > 0 or tendons))


KEPT = 2
"""Places at which answers are kept: the end of a step and its start, the end of the one before."""


class LastAsked:
    """The last answers of a function of q, which may only be read: a step asks several times at both of its ends."""

    def __init__(self, function: Callable[[Floats], Gradients]) -> None:
        self.function = function
        self.forget()

    def forget(self) -> None:
        """Ask anew next time, wherever it is."""
        self.known: deque[tuple[Floats, Gradients]] = deque(maxlen=KEPT)

    def __call__(self, q: Floats) -> Gradients:
        """Return the answer."""
        for at, answer in self.known:
            if np.array_equal(q, at):
                return answer
        found = self.function(q)
        for part in found:
            part.flags.writeable = False
        self.known.append((np.array(q), found))
        return found


def spans(scene: Scene, model: Any, placed: Placed, to: Coordinates) -> Callable[[Floats, Floats], parts.Stretch]:
    """Return what gives the lengths of tendons between points, in the scene's coordinates."""
    measured = Spans(model, placed, [tendon for tendon in scene.tendons if tendon.bodies])

    def stretch(q: Floats, v: Floats) -> parts.Stretch:
        r = to.theirs(q)
        lengths, rows = measured(r)
        H = to.velocities(r, rows)
        return lengths, H @ v, H

    return stretch


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
        carrier, where = placed[body.parent]
        where = where * pose(body.position, body.orientation)
        for joint in scene.joints:
            if joint.body != body.name:
                continue
            anchor = pin.SE3(np.eye(3), np.array(joint.anchor))
            before = pin.SE3.Identity() if joint.type == "free" else where * anchor
            carrier = model.addJoint(carrier, _joint(joint), before, joint.name)
            where = anchor.inverse()
        placed[body.name] = (carrier, where)
        model.appendBodyToJoint(carrier, _inertia(body), where)
    return model, placed


def _joint(joint: Joint) -> Any:
    if joint.type in ("free", "ball"):
        return pin.JointModelFreeFlyer() if joint.type == "free" else pin.JointModelSpherical()
    kinds = {"hinge": pin.JointModelRevoluteUnaligned, "slide": pin.JointModelPrismaticUnaligned}
    return kinds[joint.type](np.array(joint.axis))


def _inertia(body: Body) -> Any:
    xx, yy, zz, xy, xz, yz = body.inertia
    return pin.Inertia(body.mass, np.array(body.com), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


def at_centres(scene: Scene, forces: parts.Forces, model: Any, data: Any, placed: Placed) -> Callable[[Floats], Floats]:
    """Return what gives, at q, the generalised force (nv,) of the weight that bodies are spared, and of pushes."""
    own = {body.name: np.array(body.com) for body in scene.bodies}
    lifted = {
        body.name: -body.weightless * body.mass * np.array(scene.gravity) for body in scene.bodies if body.weightless
    }
    pushed = [push.body for push in scene.pushes]

    def force(q: Floats) -> Floats:
        total: Floats = np.zeros(model.nv)
        acting = [*lifted.items(), *zip(pushed, forces.pushes, strict=True)]
        if acting:
            pin.computeJointJacobians(model, data, q)
        for body, each in acting:
            carrier, where = placed[body]
            centre = (data.oMi[carrier] * where).act(own[body])
            total += point_jacobian(model, data, carrier, centre).T @ each
        return total

    return force


def _observe(
    scene: Scene, model: Any, placed: Placed, forces: parts.Forces, heights: Heights, to: Coordinates
) -> Any:  # fmt: skip
    """Gaps (n, nc), and kinetic and potential energy (n, 2) with that of the springs."""
    data = model.createData()
    # Pinocchio leaves out what is fixed to the world.
    fixed = [(body, placed[body.name][1]) for body in scene.bodies if placed[body.name][0] == 0]
    held = -sum(body.mass * float(pose.act(np.array(body.com)) @ np.array(scene.gravity)) for body, pose in fixed)

    def observe(q: Floats, v: Floats) -> tuple[Floats, Floats]:
        energy: Floats = np.empty((len(q), 2))
        for i in range(len(q)):
            # Pinocchio's own kinetic energy has the armature of some types of joints and not of others.
            energy[i, 0] = 0.5 * v[i] @ mass_matrix(model, data, q[i]) @ v[i]
            energy[i, 1] = held + pin.computePotentialEnergy(model, data, q[i])
            for body in scene.bodies:
                if body.weightless:
                    carrier, pose = placed[body.name]
                    height = (data.oMi[carrier] * pose).act(np.array(body.com)) @ np.array(scene.gravity)
                    energy[i, 1] += body.weightless * body.mass * height
        energy[:, 1] += forces.energy(to.ours(q))
        return np.array([heights(one) for one in q]).reshape(len(q), -1), energy

    return observe


def _world(case: Case, forces: parts.Forces, to: Coordinates) -> World:
    """The inputs, from one change to the next; a controller is asked in the scene's coordinates."""
    acting = Acting(case)

    def change(t: float, q: Floats, v: Floats) -> None:
        r = q.copy()
        to.normalise(r)
        forces.change(acting.at(t, to.ours(r), to.velocities(r, v)), t)

    def reset() -> None:
        forces.begin(case.act0)
        acting.reset()

    def clock(t: float) -> None:
        forces.t = t

    return World(
        instants=acting.instants, change=change, reset=reset, acting=acting, clock=clock if len(case.act0) else None
    )  # fmt: skip


def _audit(
    scene: Scene, rows: PinRows, forces: parts.Forces, apply: Forces, to: Coordinates
) -> dict[str, Any]:  # fmt: skip
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

    def H(q: Floats) -> Floats:
        r = to.theirs(q)
        return to.velocities(r, rows.jacobian(r))

    return {
        "masses": np.array([body.mass for body in scene.bodies]),
        "M": M,
        "bias": bias,
        "H": H,
        "lam": lam,
    }


def rows_on(rows: PinRows) -> tuple[int, ...]:
    """Every row active."""
    return tuple(int(Mode.CONTACT) for _ in range(rows.nc))
