"""Any scene in Pinocchio: its own model, joint by joint, with rows and forces written apart."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Case, CaseUnsupported, Law, Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.case import Force
from crossbody.cases.scene import Body, Joint, Scene, Tendon
from crossbody.cases.scene_contacts import frictional
from crossbody.engines import _scene as parts
from crossbody.engines._acting import Acting
from crossbody.engines._acting import acting as acting_of
from crossbody.engines._gates import ALL_AT_ONCE, Gated
from crossbody.engines._log import Observe
from crossbody.engines._real_time import depths
from crossbody.engines._real_time import followed as real_time
from crossbody.engines._rubbing import why_no_steps
from crossbody.engines.pinocchio._contacts import Points, Ways, contact_rows
from crossbody.engines.pinocchio._coordinates import Coordinates, Prepared, World
from crossbody.engines.pinocchio._joined import Joined, Spans, Strings, by_least_norm, loose_rows, none_pulling
from crossbody.engines.pinocchio._native import Native, apt
from crossbody.engines.pinocchio._rows import Chosen, PinRows, mass_matrix, point_jacobian, pose

RULES_FOLLOWED = {"impulse": "sequential", "impulse_simultaneous": "simultaneous"}
"""Profiles with impacts in no time, and the rule that each has for several of them."""
SMALL = 1e-4
"""Size of coordinates and rates, SI, below which they are known to the absolute tolerance alone:
a pendulum that is let go upright moves by less for a while, and by all of it later."""
RESTS = 1e-12  # gap and rate, SI, at which a row rests at the start
DIPS = 0.02
"""m: shapes further apart are not looked at for dips that begin and end in one step; a robot has
hundreds of pairs, every one of which would have steps end where it is nearest."""
Gradients = tuple[Floats, Floats]  # h (n,) and H (n, nv)
Placed = dict[str, tuple[int, Any]]  # body -> joint that carries it, and its pose in that joint's frame


def why_not(case: Case, profile: str) -> str | None:
    """Return why a profile cannot do it: bounds and loops follow the law alone."""
    if case.scene is not None and (found := frictional(case.scene)):
        return found if profile != "admm" else why_no_steps("Pinocchio's admm", case.scene)
    if profile != "law" and case.gates is not None:
        return f"The profile {profile} has no rows that hand a contact over where a wall ends, as at the maze's gaps."
    if profile != "law" and case.force is not None:
        return "This case depends on finite forces; impacts and time stepping have impulses instead."
    if profile != "law" and case.general:
        return "The rows of a scene follow the law, which instantaneous impacts and time stepping do not have."
    return None


def followed(case: Case, profile: str) -> Case | None:
    """Return the case whose equations the profile integrates, if not its own; None for time stepping."""
    if profile == "law":
        return real_time(case, two_sets=True)
    rule = RULES_FOLLOWED.get(profile)
    other = rule is not None and rule != case.collisions and (case.law.b0 > 0.0).any()
    return replace(case, collisions=rule, closed_form=None, claims=()) if other and rule is not None else None


class Bodies:
    """The bodies of a scene in Pinocchio and what acts on them beside their rows.

    Attributes:
        model, data: Pinocchio's.
        placed: where each body is.
        forces: of the scene; to: coordinates.
        none: whether nothing but gravity ever acts.
    """

    def __init__(self, scene: Scene, force: Force | None = None) -> None:
        self.forces = parts.Forces(scene)
        self.model, self.placed = tree(scene)
        self.armature = self.model.armature[:] = self.forces.armature
        self.data, self.to = self.model.createData(), Coordinates(scene)
        self.forces.spans = spans(scene, self.model, self.placed, self.to)
        self._centres = at_centres(scene, self.forces, self.model, self.model.createData(), self.placed)
        self._lifting = bool(scene.pushes) or any(body.weightless for body in scene.bodies)
        self._bends = any(self.armature[first : first + 3].any() for _, first in self.to.frees)
        self._act, self._beside = None if force is None else acting_of(force), np.zeros(scene.nv)
        self.none = self.forces.none and self.to.same and not self._lifting and self._act is None

    def apply(self, q: Floats, v: Floats, tau: Floats) -> None:
        """Write the generalised forces (nv,) beside gravity at a state of Pinocchio's."""
        # A free joint's armature resists the acceleration of p', of which Pinocchio's velocities turn with the body.
        r, u = (q, v) if self.to.same else (self.to.ours(q), self.to.velocities(q, v))
        ours = self.forces(r, u)
        if self._act is not None:
            self._act(self.forces.t, r, u, self._beside)
            ours += self._beside
        if self._bends:
            ours -= self.armature * self.to.bend(q, v)
        own = ours if self.to.same else self.to.back(q, ours)
        tau[:] = own + self._centres(q) if self._lifting else own


def build(case: Case, algebra: str) -> Prepared:
    """Return the model of a scene with its forces and rows."""
    if (scene := case.scene) is None:
        raise CaseUnsupported(f"{case.label} is not a scene.")
    law = (real_time(case, two_sets=True) or case).law
    gated = None if case.gates is None else Gated(case.gates, len(case.contacts), scene.nv)
    bodies = Bodies(scene, case.force if gated is None or case.force is None else gated.force(case.force))
    model, placed, forces, to = bodies.model, bodies.placed, bodies.forces, bodies.to
    start = to.theirs(case.q0), to.back(to.theirs(case.q0), case.v0)
    points = None
    gaps: Gated | Gaps
    if gated is not None:
        gaps, pinned = gated, _of_gates(case, gated, bodies, law, algebra)
    else:
        gaps = Gaps(scene, forces, (model, placed), to)
        pinned = _of_parts(case, gaps, bodies, law, algebra, start)
        points = None if case.general else Points(scene, model, placed, gaps.steady)
    return Prepared(
        rows=pinned, points=points, observe=observer(scene, bodies, gaps.recorded),
        sizes=_given_sizes(case, to) or _sizes(pinned, *start),
        start=start, chart=None if to.same else lambda q, v: (to.ours(q), to.velocities(q, v)),
        world=_world(case, forces, to), audit=_audit(scene, pinned, bodies),
        coordinates=to if to.turns else None,
    )  # fmt: skip


def _of_gates(case: Case, gated: Gated, bodies: Bodies, law: Law, algebra: str) -> PinRows:
    """Return the rows that a case brings beside its scene."""
    gated.begin(case.q0)
    pinned = PinRows(
        bodies.model, lambda q: gated.gradients(q)[1], lambda q: gated.gradients(q)[0],
        lambda q, v: gated.at(q, v)[2], law=law, algebra=algebra,
        forces=None if bodies.none else bodies.apply,
        follows=gated.gates.follows, gradient_of=gated.gradient_of,
    )  # fmt: skip
    pinned.ways = gated
    pinned.near[:] = min(case.force.far, default=np.inf) if case.force is not None else np.inf
    return pinned


def _of_parts(
    case: Case, gaps: Gaps, bodies: Bodies, law: Law, algebra: str, start: tuple[Floats, Floats]
) -> PinRows:  # fmt: skip
    """Return the rows of a scene's own parts."""
    scene, model, placed = gaps.scene, bodies.model, bodies.placed
    pinned = PinRows(
        model, gaps.jacobian, gaps.heights, lambda q, v: gaps.drift_of(q, v, slice(None)),
        law=law, algebra=algebra, forces=None if bodies.none else bodies.apply, drift_of=gaps.drift_of,
        gradient_of=gaps.gradient_of,
    )  # fmt: skip
    pinned.near[gaps.own :] = DIPS
    if gaps.touching.contacts.turning:
        pinned.ways = Ways(gaps.touching, gaps.own, gaps.gradients.forget)
    if _may_depend(scene, gaps):
        widths = [loop.width for loop in scene.loops]
        root = np.linalg.cholesky(mass_matrix(model, pinned.data, start[0]))
        A = np.linalg.solve(root, gaps.gradients(start[0])[1][: sum(widths)].T).T
        loose = loose_rows(A, widths, case.rank) if widths else ()
        if loose and not loose[0] and apt(scene, law, A):
            pinned.native = Native(model, placed, scene, law)
        pinned.solve = by_least_norm(model, pinned.data, pinned.tau, *loose)
        pinned.shared = none_pulling
    return pinned


def _given_sizes(case: Case, to: Coordinates) -> tuple[Floats, Floats] | None:
    """Return sizes of coordinates (nq,) and velocities (nv,) of a force; those of robots are small."""
    if case.general:
        return np.full(to.nq, SMALL), np.full(to.nv, SMALL)
    force = case.force
    return (np.array(force.far), np.array(force.fast)) if force is not None and force.far else None


def _sizes(rows: PinRows, q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Return how far coordinates move while a row is closed (nq,), and how fast (nv,), by what the start drives.

    Rows that rest on their surfaces hold what stands on them: a body that falls does so over one
    that does not.
    """
    h, H = rows.gradient_of(q, slice(None))
    rests = (np.abs(h) <= RESTS) & (np.abs(H @ v) <= RESTS)
    free = rows.accelerate(q, v, tuple(int(Mode.CONTACT if one else Mode.FREE) for one in rests))[0]
    deep, fast = depths(rows.entered, h, H @ v, H @ free + rows.drift(q, v), rows.unilateral)
    depth, speed = float(deep.max(initial=0.0)), float(fast.max(initial=0.0))
    across = float(np.abs(H).max(initial=0.0)) or 1.0
    far = depth or float(np.abs(q).max(initial=0.0)) or 1.0
    return np.full(len(q), far / across), np.full(len(v), (speed or 1.0) / across)


class Gaps:
    """Gaps of all rows of a scene by Pinocchio's kinematics: loops, bounds, then contacts of shapes.

    `steady` says whether H is the same everywhere.
    """

    def __init__(self, scene: Scene, forces: parts.Forces, tree: tuple[Any, Placed], to: Coordinates) -> None:
        self.scene, self.to, self.nv = scene, to, tree[0].nv
        self.rows = parts.Rows(scene.replace(loops=tuple(loop for loop in scene.loops if not loop.in_space)), forces)
        loops, strings = [loop for loop in scene.loops if loop.in_space], [one for one in scene.tendons if one.bodies]
        self.in_space: list[Joined | Strings] = [
            *([Joined(*tree, loops)] if loops else []), *([Strings(*tree, strings)] if strings else []),
        ]  # fmt: skip
        self.touching, self.order = contact_rows(scene, *tree), _order(scene)
        self.own = len(self.order)
        self.steady = to.same and not (self.rows.bends or self.in_space or self.touching.count)
        self.gradients, self._own = LastAsked(self._gradients), LastAsked(self._all_own)
        self.still = np.zeros(self.own)

    def heights(self, q: Floats) -> Floats:
        """Return h (nc,)."""
        if not self.own:
            return self.touching.heights(q)
        own = self._heights(q)
        return np.concatenate([own, self.touching.heights(q)]) if self.touching.count else own

    def _heights(self, q: Floats) -> Floats:
        if self.steady:
            return self.rows.heights(q)
        own = [self.rows.heights(self.to.ours(q)), *(part.heights(q) for part in self.in_space)]
        return np.concatenate(own)[self.order]

    def jacobian(self, q: Floats) -> Floats:
        """Return H (nc, nv)."""
        return self.rows.straight if self.steady else self.gradients(q)[1]

    def recorded(self, q: Floats) -> Floats:
        """Return h (m, nc) of recorded positions (m, nq)."""
        if self.steady:
            found: Floats = q @ self.rows.straight.T + self.rows.offset
            return found
        own = np.array([self._heights(one) for one in q]).reshape(len(q), -1)
        return np.concatenate([own, self.touching.recorded(q)], axis=1)

    def _all_own(self, q: Floats) -> Gradients:
        """Return h and H of the rows before those of contacts."""
        if not len(self.rows.offset) and len(self.in_space) == 1:
            return self.in_space[0].gradients(q)
        ours = self.to.ours(q)
        own = (self.rows.heights(ours), self.to.back(q, self.rows.jacobian(ours)))
        if not self.in_space:
            return own
        h, H = zip(own, *(part.gradients(q) for part in self.in_space), strict=True)
        return np.concatenate(h)[self.order], np.concatenate(H)[self.order]

    def _gradients(self, q: Floats) -> Gradients:
        if not self.own or not self.touching.count:
            return self._own(q) if self.own else self.touching.gradients(q)
        (h, H), (gaps, N) = self._own(q), self.touching.gradients(q)
        return np.concatenate([h, gaps]), np.concatenate([H, N])

    def gradient_of(self, q: Floats, chosen: Chosen) -> Gradients:
        """Return h and H of some rows."""
        if self.steady:
            return self.rows.heights(q)[chosen], self.rows.straight[chosen]
        if isinstance(chosen, slice):
            return self.gradients(q)
        if not self.own:
            return self.touching.gradients(q, chosen)
        wanted = np.array(chosen, dtype=np.intp)  # of no row too
        before = wanted < self.own
        if before.all():
            h, H = self._own(q)
            return h[wanted], H[wanted]
        h, H = np.empty(len(wanted)), np.empty((len(wanted), self.nv))
        h[~before], H[~before] = self.touching.gradients(q, (wanted[~before] - self.own).tolist())
        if before.any():
            h[before], H[before] = (part[wanted[before]] for part in self._own(q))
        return h, H

    def drift_of(self, q: Floats, v: Floats, chosen: Chosen) -> Floats:
        """Return H' v of some rows."""
        if self.steady:
            return self.still[chosen]
        if not self.touching.count:
            return self._own_drift(q, v)[chosen]
        if not self.own:
            return self.touching.drift(q, v, range(self.touching.count) if isinstance(chosen, slice) else chosen)
        wanted = np.arange(self.own + self.touching.count)[chosen]
        before = wanted < self.own
        total: Floats = np.empty(len(wanted))
        if before.any():
            total[before] = self._own_drift(q, v)[wanted[before]]
        total[~before] = self.touching.drift(q, v, list(wanted[~before] - self.own))
        return total

    def _own_drift(self, q: Floats, v: Floats) -> Floats:
        if not len(self.rows.offset) and len(self.in_space) == 1:
            return self.in_space[0].drift(q, v)
        own = self.rows.drift(self.to.ours(q), self.to.velocities(q, v))
        if not self.in_space:
            return own
        return np.concatenate([own, *(part.drift(q, v) for part in self.in_space)])[self.order]


def _may_depend(scene: Scene, gaps: Gaps) -> bool:
    """Return whether rows that act at once may depend on each other; bounds of joints alone do not.

    Planar loops have rows that do, joints that are coupled and both at their bounds, and bodies on
    many feet. Where H is the same everywhere, it tells. Distances do not where bodies that move
    apart from each other make no ring of them: the last of a chain moves by coordinates of its own.
    """
    H, touching = gaps.rows.straight, gaps.touching.count
    if gaps.steady and np.linalg.matrix_rank(H) == len(H):
        return False
    alone = not touching and not len(H) and len(gaps.in_space) == 1
    if alone and all(isinstance(part, Strings) and part.chained for part in gaps.in_space):
        return False
    bounds = [part for part in scene.bounded if np.isfinite(part.range).any()]
    tendons = any(isinstance(part, Tendon) for part in bounds)
    return bool(scene.loops) or touching > 1 or (bool(bounds) and (touching > 0 or tendons))


KEPT = 2  # places at which answers are kept: the end of a step and its start, the end of the one before


class LastAsked:
    """The last answers of a function of q, which may only be read: a step asks again at both ends."""

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
    """Return where each row stands if loops in space come last but one, and distances of points last."""
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
    found = pin.Inertia.Zero()  # part by part: made at once, what no rigid body has would be refused
    found.mass, found.lever = body.mass, np.array(body.com)
    found.inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return found


def at_centres(scene: Scene, forces: parts.Forces, model: Any, data: Any, placed: Placed) -> Callable[[Floats], Floats]:
    """Return what gives, at q, the generalised force (nv,) of the weight that bodies lack, and of pushes."""
    own = {body.name: np.array(body.com) for body in scene.bodies}
    lifted = {
        body.name: -body.weightless * body.mass * np.array(scene.gravity) for body in scene.bodies if body.weightless
    }
    pushed = [push.body for push in scene.pushes]

    def force(q: Floats) -> Floats:
        total: Floats = np.zeros(model.nv)
        acting = [*lifted.items(), *(zip(pushed, forces.pushes, strict=True) if forces.pushed else ())]
        if acting:
            pin.computeJointJacobians(model, data, q)
        for body, each in acting:
            carrier, where = placed[body]
            centre = (data.oMi[carrier] * where).act(own[body])
            total += point_jacobian(model, data, carrier, centre).T @ each
        return total

    return force


def observer(scene: Scene, bodies: Bodies, recorded: Callable[[Floats], Floats]) -> Observe:
    """Return what gives gaps (n, nc), and kinetic and potential energy (n, 2) with that of the springs."""
    model, placed, forces, to = bodies.model, bodies.placed, bodies.forces, bodies.to
    data = model.createData()
    # Pinocchio leaves out what is fixed to the world.
    fixed = [(body, placed[body.name][1]) for body in scene.bodies if placed[body.name][0] == 0]
    lighter, armed = [body for body in scene.bodies if body.weightless], bool(model.armature.any())
    held = -sum(body.mass * float(pose.act(np.array(body.com)) @ np.array(scene.gravity)) for body, pose in fixed)

    def observe(q: Floats, v: Floats) -> tuple[Floats, Floats]:
        energy: Floats = np.empty((len(q), 2))
        for i in range(len(q)):
            # Pinocchio's own kinetic energy has the armature of some types of joints and not of others.
            energy[i, 0] = (
                0.5 * v[i] @ mass_matrix(model, data, q[i]) @ v[i]
                if armed
                else pin.computeKineticEnergy(model, data, q[i], v[i])
            )
            energy[i, 1] = held + pin.computePotentialEnergy(model, data, q[i])
            for body in lighter:
                carrier, pose = placed[body.name]
                height = (data.oMi[carrier] * pose).act(np.array(body.com)) @ np.array(scene.gravity)
                energy[i, 1] += body.weightless * body.mass * height
        energy[:, 1] += forces.energy(to.ours(q))
        return recorded(q), energy

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
        instants=acting.instants, change=change, reset=reset, acting=acting,
        clock=clock if len(case.act0) or case.force is not None else None,
    )  # fmt: skip


def mechanics(scene: Scene, bodies: Bodies) -> dict[str, Any]:
    """Return for the audit all masses, M and the bias at zero input, in the scene's coordinates."""
    model, data, to, forces, tau = bodies.model, bodies.data, bodies.to, bodies.forces, np.zeros(bodies.model.nv)

    def M(q: Floats) -> Floats:
        r = to.theirs(q)
        half = to.velocities(r, mass_matrix(model, data, r))  # J M J^T: J is orthogonal
        return to.velocities(r, half.T)

    def bias(q: Floats, v: Floats) -> Floats:
        forces.still()
        r = to.theirs(q)
        u = to.back(r, v)
        bodies.apply(r, u, tau)
        return to.velocities(r, pin.nonLinearEffects(model, data, r, u) - tau) - M(q) @ to.bend(r, u)

    return {"masses": parts.masses(scene), "M": M, "bias": bias}


def _audit(scene: Scene, rows: PinRows, bodies: Bodies) -> dict[str, Any]:
    """What differs from the rows' own audit."""
    on = tuple(int(Mode.COLLISION if fast else Mode.CONTACT) for fast in rows.fast)  # all just entered
    to = bodies.to
    hidden = {"hidden": {"lam": ALL_AT_ONCE}} if isinstance(rows.ways, Gated) else {}

    def lam(q: Floats, v: Floats) -> Floats:
        bodies.forces.still()
        r = to.theirs(q)
        return rows.accelerate(r, to.back(r, v), on)[1]

    def H(q: Floats) -> Floats:
        r = to.theirs(q)
        return to.velocities(r, rows.jacobian(r))

    return mechanics(scene, bodies) | {"H": H, "lam": lam} | hidden
