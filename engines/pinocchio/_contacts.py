"""Contacts of a scene's shapes by Pinocchio's kinematics: gaps, gradients and, by differences, H' v."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.cases.scene_contacts import by_shapes, contacts
from crossbody.engines._contacts import TOGETHER, Contacts, Flat, Indices, Poses, closing, drift, flat
from crossbody.engines._log import Modes
from crossbody.engines._machines import ACTIVE
from crossbody.engines.nearest import Pose, cross

WORLD = pin.LOCAL_WORLD_ALIGNED
BACK = 1e-6
"""Part of what separates both ways by which shapes go on first: rounding turns none back."""


class ContactRows:
    """Rows of the contacts; no second derivative of a gap is written anywhere here.

    `along` says of contacts whose shapes may lie along each other whether these do; as they lie
    where it says nothing.
    """

    def __init__(self, scene: Scene, model: Any, placed: Mapping[str, tuple[int, Any]]) -> None:
        self.contacts = Contacts(scene)
        self.count = self.contacts.count
        self.model, self.data, self.placed = model, model.createData(), placed
        self._moved = model.createData()
        self.along: dict[int, bool] = {}
        self.carriers = [placed[body][0] for body in self.contacts.bodies]

    def heights(self, q: Floats, rows: Sequence[int] | None = None) -> Floats:
        """Return h (n,) of some rows, or of all."""
        return self.contacts.touches(self._now(q), rows, self.along).gap if self.count else np.zeros(0)

    def recorded(self, q: Floats) -> Floats:
        """Return h (m, n) of recorded positions (m, nq), one after the other."""
        gaps, ways = [np.zeros((0, self.count))], dict[int, bool]()
        for first in range(0, len(q) if self.count else 0, TOGETHER):
            found = [
                [now(body) for body in self.contacts.bodies] for now in map(self._now, q[first : first + TOGETHER])
            ]
            R, p = (np.array([[pose[k] for pose in one] for one in found]) for k in (0, 1))
            gaps.append(self.contacts.recorded(self._stacked(R, p), ways))
        return np.concatenate(gaps) if self.count else np.zeros((len(q), 0))

    def parted(self, q: Floats, which: Sequence[int]) -> tuple[Floats, Floats]:
        """Return how far shapes are from lying along each other, and to which side (`Contacts.parted`)."""
        return self.contacts.parted(self._now(q), which)

    def gradients(self, q: Floats, rows: Sequence[int] | None = None) -> tuple[Floats, Floats]:
        """Return h (n,) and H (n, nv) of some rows, or of all."""
        if not self.count:
            return np.zeros(0), np.zeros((0, self.model.nv))
        met = self.contacts.touches(self._now(q), rows, self.along)
        pin.computeJointJacobians(self.model, self.data, q)
        J, origins = np.zeros((len(self.carriers), 6, self.model.nv)), np.zeros((len(self.carriers), 3))
        for i in self.contacts.carriers(rows):
            if carrier := self.carriers[i]:
                J[i] = pin.getJointJacobian(self.model, self.data, carrier, WORLD).reshape(6, -1)
                origins[i] = self.data.oMi[carrier].translation
        H = np.zeros((len(met.gap), self.model.nv))
        for bodies, sign in ((met.second, 1.0), (met.first, -1.0)):
            about = cross(met.point - origins[bodies], met.normal)
            H += sign * np.matmul(np.concatenate([met.normal, about], axis=1)[:, None], J[bodies])[:, 0]
        return met.gap, H

    def drift(self, q: Floats, v: Floats, rows: Sequence[int]) -> Floats:
        """Return H' v of some rows."""
        if not len(rows):
            return np.zeros(0)
        data, needed = self._moved, self.contacts.carriers(rows).tolist()
        along, turn = self.contacts.lying(self._now(q), rows)
        along |= self.along

        def rates(times: Floats) -> Floats:
            R, p, moving, at = (np.zeros((len(times), len(self.carriers), *n)) for n in ((3, 3), (3,), (6,), (3,)))
            for k, t in enumerate(times):
                pin.forwardKinematics(self.model, data, pin.integrate(self.model, q, t * v), v)
                for i in needed:
                    R[k, i], p[k, i] = self._pose(self.contacts.bodies[i], data)
                    moving[k, i] = pin.getVelocity(self.model, data, self.carriers[i], WORLD).vector
                    at[k, i] = data.oMi[self.carriers[i]].translation

            def carried(bodies: Indices, points: Floats) -> Floats:
                twist = moving[:, bodies]
                return twist[..., :3] + cross(twist[..., 3:], points - at[:, bodies])

            return closing(self.contacts.touches(self._stacked(R, p), rows, along), carried)

        return drift(rates, v, turn)

    def _stacked(self, R: Floats, p: Floats) -> Poses:
        """Return what gives each body's poses at several instants, of all (m, nb, 3, 3) and (m, nb, 3)."""
        return {body: (R[:, i], p[:, i]) for i, body in enumerate(self.contacts.bodies)}.__getitem__

    def _now(self, q: Floats) -> Poses:
        """Return what gives the poses of bodies at q."""
        pin.forwardKinematics(self.model, self.data, q)
        return lambda body: self._pose(body, self.data)

    def _pose(self, body: str, data: Any) -> Pose:
        carrier, pose = self.placed[body]
        world = data.oMi[carrier] * pose
        return world.rotation, world.translation


class OverPlanes(ContactRows):
    """Rows of points of bodies over planes, whose H' v is written out."""

    def __init__(self, scene: Scene, model: Any, placed: Mapping[str, tuple[int, Any]]) -> None:
        super().__init__(scene, model, placed)
        frames = [placed[body][1] for body in self.contacts.bodies]
        self.flat = Flat(self.contacts, [(frame.rotation, frame.translation) for frame in frames])
        self.moving = np.array([carried(model, joint) for joint in self.carriers])
        self.apart = self.moving[self.flat.two] - self.moving[self.flat.one]

    def heights(self, q: Floats, rows: Sequence[int] | None = None) -> Floats:
        """See `ContactRows`."""
        pin.forwardKinematics(self.model, self.data, q)
        return self.flat.met(poses_of(self.data, self.carriers), rows)[0]

    def gradients(self, q: Floats, rows: Sequence[int] | None = None) -> tuple[Floats, Floats]:
        """See `ContactRows`."""
        pin.computeJointJacobians(self.model, self.data, q)
        gap, n, x = self.flat.met(poses_of(self.data, self.carriers), rows)
        J, apart = self.data.J.reshape(6, -1), self.apart if rows is None else self.apart[rows]
        return gap, apart * (n @ J[:3] + cross(x, n) @ J[3:])

    def drift(self, q: Floats, v: Floats, rows: Sequence[int]) -> Floats:
        """See `ContactRows`."""
        pin.computeJointJacobiansTimeVariation(self.model, self.data, q, v)
        own = self.moving * v
        twist, change = (own @ part.reshape(6, -1).T for part in (self.data.J, self.data.dJ))
        return self.flat.drift(poses_of(self.data, self.carriers), twist, change, rows)


def poses_of(data: Any, joints: Sequence[int]) -> Pose:
    """Return rotations (n, 3, 3) and origins (n, 3) of joints, of data that have them."""
    placed = data.oMi
    found = np.array([placed[joint].homogeneous for joint in joints])
    return found[:, :3, :3], found[:, :3, 3]


def carried(model: Any, joint: int) -> Floats:
    """Return which coordinates (nv,) move what a joint carries, as 1 and 0."""
    found = np.zeros(model.nv)
    for above in list(model.supports[joint])[1:]:
        found[model.joints[above].idx_v :][: model.joints[above].nv] = 1.0
    return found


def contact_rows(scene: Scene, model: Any, placed: Mapping[str, tuple[int, Any]]) -> ContactRows:
    """Return the rows of a scene's contacts."""
    return (OverPlanes if flat(contacts(scene)) else ContactRows)(scene, model, placed)


class Points:
    """Rows as Pinocchio's constraints of three components, the normal last, at positions q.

    A contact is a point without friction between its shapes. A coordinate that is held is an
    anchor, whose other components the joint keeps anyway; where it lies, velocities do not tell.

    Attributes:
        steady: whether M and the constraints' Jacobians are the same everywhere: where all
            slides, and no normal turns.
    """

    def __init__(self, scene: Scene, model: Any, placed: Mapping[str, tuple[int, Any]], straight: bool) -> None:
        self.model, self.data = model, model.createData()
        self.steady = straight and all(joint.type == "slide" for joint in scene.joints)
        loops = [loop for loop in scene.loops if loop.type == "joint" and not loop.second]
        self.contacts, self.placed = Contacts(by_shapes(scene)), placed
        self.anchors = [self._anchor(model.getJointId(loop.first)) for loop in loops]

    def __call__(self, q: Floats, rows: Sequence[int]) -> list[Any]:
        """Return the constraints of some rows."""
        found, held = [self.anchors[row] for row in rows if row < len(self.anchors)], len(self.anchors)
        if len(found) == len(rows):
            return found
        pin.forwardKinematics(self.model, self.data, q)
        met = self.contacts.touches(self._pose, [row - held for row in rows[len(found) :]])
        for gap, normal, point, *bodies in zip(met.gap, met.normal, met.point, met.first, met.second, strict=True):
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()
            world = pin.SE3(turn, point - 0.5 * gap * normal)
            joints = [self.placed[self.contacts.bodies[body]][0] for body in bodies]
            ends = [part for i in joints for part in (i, self.data.oMi[i].inverse() * world)]
            contact = pin.PointContactConstraintModel(self.model, *ends)
            contact.setFriction(0.0)
            found.append(pin.ConstraintModel(contact))
        return found

    def _anchor(self, joint: int) -> Any:
        """Return the point of a slide that is held, with the third axis along it."""
        kind = self.model.joints[joint]
        moved = kind.createData()
        kind.calc(moved, np.zeros(1))
        turn = pin.SE3(
            pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), np.array(moved.S)[:3]).matrix(), np.zeros(3)
        )
        world = self.model.jointPlacements[joint] * moved.M * turn
        return pin.ConstraintModel(pin.PointAnchorConstraintModel(self.model, 0, world, joint, turn))

    def _pose(self, body: str) -> Pose:
        carrier, pose = self.placed[body]
        world = self.data.oMi[carrier] * pose
        return world.rotation, world.translation


class Ways:
    """The ways of all pairs that may lie in two.

    Args:
        touching: the rows of contacts.
        first: number of the first of them among the rows of the mechanism.
        forget: of answers that were kept for rows as they were.

    Attributes:
        watched: number of functions that are watched, two a pair: until it lies the other way, and until
            it has turned through, inside one step, a way in which it did not seem to lie at the ends.
    """

    def __init__(self, touching: ContactRows, first: int, forget: Callable[[], None]) -> None:
        self.touching, self.first, self.forget = touching, first, forget
        self.turning = touching.contacts.turning
        self.watched = 2 * len(self.turning)
        self.sides: dict[int, float] = {}
        places = touching.contacts.rows
        self.rows = [[first + i for i, (k, _) in enumerate(places) if k == turned] for turned in self.turning]

    def begin(self, _q: Floats) -> None:
        """Hold none."""
        self.touching.along.clear()
        self.forget()

    def hold(self, q: Floats, modes: Modes) -> bool:
        """Hold the ways of pairs of which a row is in force, as they lie now if they were not."""
        along, before = self.touching.along, len(self.touching.along)
        wanted = [k for k, rows in zip(self.turning, self.rows, strict=True) if any(modes[i] for i in rows)]
        for k in [k for k in along if k not in wanted]:
            del along[k]
        if new := [k for k in wanted if k not in along]:
            parted, sides = self._parted(q, new)
            along.update({k: parted[k] <= 0.0 for k in new})
            self.sides.update({k: sides[k] for k in new})
        if new or len(along) != before:
            self.forget()
        return False

    def watch(self, q: Floats, out: Floats) -> None:
        """Fill out (watched,) with what is positive until a pair that is held lies the other way."""
        out[:] = 1.0
        if not (along := self.touching.along):
            return
        parted, sides = self._parted(q, list(along))
        for i, k in enumerate(self.turning):
            if k in along:
                out[2 * i] = BACK - parted[k] if along[k] else BACK + parted[k]
                out[2 * i + 1] = 1.0 if along[k] else sides[k] * np.sign(self.sides[k])

    def through(self, fired: frozenset[int]) -> bool:
        """Whether a step went through a way in which a pair lay on neither side of it."""
        return any(which % 2 for which in fired)

    def _parted(self, q: Floats, which: Sequence[int]) -> tuple[dict[int, float], dict[int, float]]:
        """Return of some pairs by how much they do not lie along, and to which side."""
        one, two = (dict(zip(which, part.tolist(), strict=True)) for part in self.touching.parted(q, which))
        return one, two

    def turn(self, q: Floats, modes: Modes, fired: frozenset[int]) -> Modes:
        """Let pairs lie the other way; the modes of all rows then."""
        after = list(modes)
        for i in {which // 2 for which in fired}:
            k, rows = self.turning[i], self.rows[i]
            self.touching.along[k] = not self.touching.along[k]
            self.sides[k] = self._parted(q, [k])[1][k]
            self.forget()
            carried = next((modes[row] for row in rows if modes[row] in ACTIVE), int(Mode.FREE))
            gaps = self.touching.heights(q)[np.subtract(rows, self.first)]
            for row in rows:
                after[row] = int(Mode.FREE)
            after[rows[int(np.argmin(gaps))]] = carried
        return tuple(after)
