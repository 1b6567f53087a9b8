"""Contacts of a scene's shapes by an engine's own poses of the bodies, in NumPy.

Written from the shapes, not from the reference's kernels, so that an engine that uses it is a witness.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Scene
from crossbody.cases.scene_contacts import STEEPEST, Contact, contacts
from crossbody.engines.nearest import ROUND, Pose, aslant, corners, crossing, lying, meet, overlap, tilt

FAR = 1.0  # m: the gap of a row that is none as its shapes lie
TURN = 1e-3  # angle or length over which H is differenced: the fourth power and rounding leave 1e-12 of it
SHARP = 30.0
"""Times the tilt of a cap, or the squared sine at which capsules cross: part of TURN that H is differenced over."""
MIXED = 1e-5
"""Part of a rate's change over TURN, or of what TURN makes of the rate, by which differences over
one step and over two part where there is a kink in between; where there is none they do by 1e-6."""
ONE_SIDED = np.array([[-25.0 / 12.0, 4.0, -3.0, 4.0 / 3.0, -0.25], [1.0, -4.0, 6.0, -4.0, 1.0]])
"""Slope at the first of five points, and what is none of a cubic through them."""
TOGETHER = 64
"""Recorded states whose gaps are computed at once: hundreds of pairs fill the memory's cache."""
KEPT = 256  # sets of rows whose numbers are kept
MOVES = np.array([
    [0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0],
    [0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0],
    [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1],
    [0, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0],
    [0, 0, 1, 0, 0, 0, 0, 0, -1, 0, 0, 0],
    [0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0],
], dtype=float)  # fmt: skip
"""Of a twist at the origin, its turning last, the rows of T but the last, which is 0."""
Poses = Callable[[str], Pose]  # body -> its pose, or its poses at some instants (..., 3, 3) and (..., 3)
Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Touches:
    """Places where shapes may meet, one a row.

    Attributes:
        gap (..., n): less the pairs' margins, m.
        normal (..., n, 3): from the first shape to the second; NaN or 0 where there is none.
        point (..., n, 3): of the second shape, in the world, m.
        first, second (n,): numbers of the bodies in `Contacts.bodies`.
    """

    gap: Floats
    normal: Floats
    point: Floats
    first: Indices
    second: Indices


@dataclass(frozen=True, slots=True)
class _Group:
    """Contacts of shapes of the same two types, which are computed at once.

    Attributes:
        kinds: of the first and the second shapes.
        which: places of the contacts in `Contacts.all`.
        one, two: places of their shapes in the choice.
        sizes: of both (m, 3), or of hulls (m, places, 3).
        margin, sine (m,): of the pairs; the sine of the angle up to which they lie along each other.
        taken: contact and place in this group of every row that is asked for.
        rows: places of these rows among those asked for.
    """

    kinds: tuple[str, str]
    which: Sequence[int]
    one: Indices
    two: Indices
    sizes: tuple[Floats, Floats]
    margin: Floats
    sine: Floats
    taken: tuple[Indices, Indices]
    rows: Indices


@dataclass(frozen=True, slots=True)
class _Choice:
    """What some rows need of the scene.

    Attributes:
        groups: of their contacts.
        shapes: numbers of the shapes.
        bodies: numbers in `Contacts.bodies` of those that carry them.
        carrier (ns,): place in `bodies` of what carries each shape.
    """

    groups: tuple[_Group, ...]
    shapes: Indices
    bodies: Indices
    carrier: Indices


class Contacts:
    """The contacts of a scene.

    Attributes:
        all: of the scene.
        rows: of every row its contact's place in `all`, and its own within the contact.
        bodies: those that carry the shapes.
    """

    def __init__(self, scene: Scene) -> None:
        self.all: Sequence[Contact] = contacts(scene)
        self.rows = [(k, place) for k, contact in enumerate(self.all) for place in range(contact.places)]
        shapes = {shape.name: shape for contact in self.all for shape in (contact.first, contact.second)}
        self.bodies = list(dict.fromkeys(shape.body for shape in shapes.values()))
        self.number = {name: i for i, name in enumerate(shapes)}
        self._body = np.array([self.bodies.index(shape.body) for shape in shapes.values()], dtype=np.intp)
        self._turned = matrices(np.array([shape.orientation for shape in shapes.values()]).reshape(-1, 4))
        self._position = np.array([shape.position for shape in shapes.values()]).reshape(-1, 3)
        self._extents = [shape.extents for shape in shapes.values()]
        self._choices: dict[tuple[int, ...], _Choice] = {}
        self.turning = [k for k, contact in enumerate(self.all) if contact.parallel > 0.0]

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.rows)

    def touches(
        self, poses: Poses, rows: Sequence[int] | None = None, along: Mapping[int, Any] | None = None
    ) -> Touches:
        """Return those of some rows, or of all.

        Args:
            poses: of the bodies.
            rows: which; all if not given.
            along: of contacts in `turning`, whether the shapes lie along each other, at all
                instants or at each (...); as they do, if not given.
        """
        choice = self._choice_of(rows)
        R, p = self._placed(poses, choice)
        lead, count = p.shape[:-2], self.count if rows is None else len(rows)
        gap, normal, point = (np.empty((*lead, count, *size)) for size in ((), (3,), (3,)))
        first, second = np.empty((2, count), dtype=np.intp)
        for group in choice.groups:
            at, by = ((R[..., shapes, :, :], p[..., shapes, :]) for shapes in (group.one, group.two))
            gaps, normals, points = meet(group.kinds, group.sizes, at, by, self._lying(group, at, by, along or {}))
            contact, place = group.taken
            h = gaps[..., contact, place] - group.margin[contact]
            gap[..., group.rows] = np.where(np.isinf(h), FAR, h)
            normal[..., group.rows, :] = normals[..., contact, place, :]
            point[..., group.rows, :] = points[..., contact, place, :]
            for bodies, shapes in ((first, group.one), (second, group.two)):
                bodies[group.rows] = choice.bodies[choice.carrier[shapes[contact]]]
        return Touches(gap, normal, point, first, second)

    def lying(self, poses: Poses, rows: Sequence[int]) -> tuple[dict[int, bool], float]:
        """Return of the shapes of some rows whether they lie along each other, and over what H may be differenced.

        The nearest points of axes that cross at a small angle a run along them in a turn of the
        size of a^2, the lowest of a cap round it in one of its tilt.
        """
        found: dict[int, bool] = {}
        least, choice = 1.0, self._choice_of(rows)
        groups = [group for group in choice.groups if group.sine.any()]
        R, p = self._placed(poses, choice) if groups else (np.zeros(0), np.zeros(0))
        for group in groups:
            at, by = ((R[shapes], p[shapes]) for shapes in (group.one, group.two))
            along = lying(group.kinds, group.sizes, at, by, group.sine)
            found |= zip(group.which, along.tolist(), strict=True)
            if group.kinds[0] == "plane":
                sharp = tilt(at, by)
            else:  # where they are not beside each other ends are nearest
                beside = np.less_equal(*overlap(at, group.sizes[0][:, 1], by, group.sizes[1][:, 1]))
                sharp = np.where(beside & (aslant(at, by) <= STEEPEST), crossing(at, by) ** 2, 1.0)
            least = min(least, float(sharp[~along].min(initial=1.0)))
        return found, TURN * min(1.0, SHARP * least)

    def recorded(self, poses: Poses, before: dict[int, bool]) -> Floats:
        """Return the gaps (m, n) of all rows at instants of a motion, one after the other.

        Out of reach shapes that are crossed stay so.

        Args:
            poses: of the bodies at all of them.
            before: how the shapes of the contacts in `turning` lay last, which is brought up to date.
        """
        along: dict[int, NDArray[np.bool_]] = {}
        R, p = self._placed(poses, self._choice_of(None))
        for k in self.turning:
            pair = self.all[k]
            at, by = (
                (R[..., j, :, :], p[..., j, :]) for j in (self.number[pair.first.name], self.number[pair.second.name])
            )
            kinds, sizes = (pair.first.type, pair.second.type), _sizes(pair)
            found = lying(kinds, sizes, at, by, np.array(pair.parallel))
            seen = _last(_within_reach(pair, at, by))
            along[k] = (_last(~found) < seen) | (found.cumprod() > 0) & before.get(k, True)
            before[k] = bool(along[k][-1])
        return self.touches(poses, None, along).gap

    def parted(self, poses: Poses, which: Sequence[int]) -> tuple[Floats, Floats]:
        """Return by how much the shapes of some pairs in `turning` do not lie along each other, and to which side (n,).

        The first is below 0 if they do, in units of the sine, or of the first capsule's half
        length, at which that changes. The second, 1 of a cylinder, changes its sign where
        capsules turn through each other's direction.
        """
        found, ways = np.zeros(len(which)), np.ones(len(which))
        for i, pair in enumerate(self.all[k] for k in which):
            at, by = self.ends(poses, pair)
            if pair.first.type == "plane":
                found[i] = tilt(at, by) / pair.parallel - 1.0
                continue
            half, other = np.array(pair.first.size[1]), np.array(pair.second.size[1])
            low, high = overlap(at, half, by, other)
            steep = float(aslant(at, by)) - STEEPEST
            found[i] = max(float(crossing(at, by)) / pair.parallel - 1.0, float(low - high) / pair.first.size[1], steep)
            ways[i] = np.cross(at[0][:, 2], by[0][:, 2]) @ (by[1] - at[1])
        return found, ways

    def ends(self, poses: Poses, contact: Contact) -> tuple[Pose, Pose]:
        """Return from the bodies' poses those of both shapes of a contact (..., 3, 3) and (..., 3)."""
        one, two = (self._place(poses, self.number[shape.name]) for shape in (contact.first, contact.second))
        return one, two

    def _place(self, poses: Poses, shape: int) -> Pose:
        R, p = poses(self.bodies[self._body[shape]])
        return R @ self._turned[shape], p + R @ self._position[shape]

    def _placed(self, poses: Poses, choice: _Choice) -> Pose:
        """Return the poses of the shapes of a choice (..., ns, 3, 3) and (..., ns, 3)."""
        if not len(choice.bodies):
            return np.zeros((0, 3, 3)), np.zeros((0, 3))
        found = [poses(self.bodies[body]) for body in choice.bodies]
        R = np.stack([pose[0] for pose in found], axis=-3)[..., choice.carrier, :, :]
        p = np.stack([pose[1] for pose in found], axis=-2)[..., choice.carrier, :]
        return R @ self._turned[choice.shapes], p + np.einsum("...ij,...j->...i", R, self._position[choice.shapes])

    def carriers(self, rows: Sequence[int] | None = None) -> Indices:
        """Return the numbers of the bodies whose poses are asked for where some rows are, or all."""
        return self._choice_of(rows).bodies

    def _choice_of(self, rows: Sequence[int] | None) -> _Choice:
        """Return what some rows need, or all; found once for each choice."""
        wanted = tuple(range(self.count) if rows is None else rows)
        if wanted not in self._choices:
            self._choices[wanted] = self._chosen(wanted)
        return self._choices[wanted]

    def _chosen(self, wanted: Sequence[int]) -> _Choice:
        pairs = [self.all[k] for k in dict.fromkeys(self.rows[row][0] for row in wanted)]
        shapes = distinct([self.number[one.name] for pair in pairs for one in (pair.first, pair.second)]).astype(int)
        bodies, carrier = np.unique(self._body[shapes], return_inverse=True)
        return _Choice(groups=self._grouped(wanted, shapes), shapes=shapes, bodies=bodies, carrier=carrier)

    def _grouped(self, wanted: Sequence[int], shapes: Indices) -> tuple[_Group, ...]:
        kinds: dict[tuple[str, str], list[int]] = {}
        for k in dict.fromkeys(self.rows[row][0] for row in wanted):
            kinds.setdefault((self.all[k].first.type, self.all[k].second.type), []).append(k)
        return tuple(self._group(kind, which, wanted, shapes) for kind, which in kinds.items())

    def _group(self, kinds: tuple[str, str], which: Sequence[int], wanted: Sequence[int], shapes: Indices) -> _Group:
        pairs = [self.all[k] for k in which]
        one, two = (
            np.array([self.number[shape.name] for shape in ends], dtype=np.intp)
            for ends in ([pair.first for pair in pairs], [pair.second for pair in pairs])
        )
        at, stands = self.rows, {k: j for j, k in enumerate(which)}
        mine = [(stands[at[row][0]], at[row][1], i) for i, row in enumerate(wanted) if at[row][0] in stands]
        contact, place, rows = np.array(mine, dtype=np.intp).T
        return _Group(
            kinds=kinds, which=which, one=np.searchsorted(shapes, one),
            two=np.searchsorted(shapes, two), sizes=(self._sizes(one), self._sizes(two)),
            margin=np.array([pair.pair.margin for pair in pairs]),
            sine=np.array([pair.parallel for pair in pairs]), taken=(contact, place), rows=rows,
        )  # fmt: skip

    def _sizes(self, shapes: Indices) -> Floats:
        """Return the extents of shapes of one type; a hull's last corner stands in for those it lacks."""
        found = [self._extents[i] for i in shapes]
        if found[0].ndim == 1:
            return np.array(found)
        most = np.arange(max(map(len, found)))
        return np.array([one[np.minimum(most, len(one) - 1)] for one in found])

    def _lying(self, group: _Group, at: Pose, by: Pose, along: Mapping[int, Any]) -> NDArray[np.bool_]:
        if not group.sine.any():
            return np.zeros(len(group.sine), dtype=bool)
        if all(k in along for k in group.which):
            return np.stack([np.asarray(along[k]) for k in group.which], axis=-1)
        found = lying(group.kinds, group.sizes, at, by, group.sine)
        for j, k in enumerate(group.which):
            if k in along:
                found[..., j] = along[k]
        return found


def flat(met: Sequence[Contact]) -> bool:
    """Return whether there are contacts, and all are of points of bodies, with a radius, over planes."""
    return bool(met) and all(one.first.type == "plane" and one.second.type in ("sphere", *ROUND) for one in met)


class Flat:
    """Rows of points of bodies over planes, whose H' v is written out.

    A body moves its point at x (1 behind its coordinates) at T x, and accelerates it at (T' + T
    T) x. Seen from the plane, with the normal n and T1, a point that moves at T2 accelerates,
    where no coordinate does, as

        h'' = n.(T2' + T2 T2 - T1' - T1 T1 - 2 T1 (T2 - T1)) x

    Args:
        contacts: all of which are `flat`.
        frames: rotations and origins of `Contacts.bodies` in the frames whose poses are given, of
            all rows in them.

    Attributes:
        one, two (n,): numbers of the bodies of the plane and of the point.
    """

    def __init__(self, contacts: Contacts, frames: Sequence[Pose]) -> None:
        rows, framed = [], dict(zip(contacts.bodies, frames, strict=True)).__getitem__
        for k, place in contacts.rows:
            contact = contacts.all[k]
            one, two = (contacts.bodies.index(shape.body) for shape in (contact.first, contact.second))
            (R, o), (S, p) = contacts.ends(framed, contact)
            solid, extents = contact.second.type, contact.second.extents
            at = p + S @ corners(solid, extents)[place] if solid in ROUND else p
            radius = extents[0] if solid in ("sphere", "capsule") else 0.0
            rows.append((one, two, R[:, 2, None], at[:, None], R[:, 2] @ o + radius + contact.pair.margin))
        self._parts = tuple(np.array(part) for part in zip(*rows, strict=True))
        self.one, self.two, *_ = self._parts
        self._of = lru_cache(KEPT)(lambda chosen: tuple(part[list(chosen)] for part in self._parts))

    def met(self, poses: Pose, rows: Sequence[int] | None = None) -> tuple[Floats, Floats, Floats]:
        """Return gaps (n,) less the margins, normals and points (n, 3) of some rows, or of all.

        Args:
            poses: rotations (nb, 3, 3) and origins (nb, 3) of the bodies' frames.
            rows: which.
        """
        one, two, normal, at, off = self._parts if rows is None else self._of(tuple(rows))
        R, o = poses
        n = (R.take(one, 0) @ normal)[:, :, 0]
        x = (R.take(two, 0) @ at)[:, :, 0] + o.take(two, 0)
        return (n * (x - o.take(one, 0))).sum(axis=1) - off, n, x

    def drift(self, poses: Pose, twist: Floats, change: Floats, rows: Sequence[int]) -> Floats:
        """Return H' v of some rows (n,).

        Args:
            poses: as of `met`.
            twist: velocities (nb, 6) of the bodies at the world's origin, their turning last.
            change: the rates of these at v' = 0.
            rows: which.
        """
        one, two, *_ = self._of(tuple(rows))
        _, n, x = self.met(poses, rows)
        T, accelerates = (twist @ MOVES).reshape(-1, 3, 4), (change @ MOVES).reshape(-1, 3, 4)
        accelerates = accelerates + T[:, :, :3] @ T
        below, of = T.take(one, 0), T.take(two, 0)
        seen = accelerates.take(two, 0) - accelerates.take(one, 0) - 2.0 * below[:, :, :3] @ (of - below)
        total: Floats = (n * ((seen[:, :, :3] @ x[:, :, None])[:, :, 0] + seen[:, :, 3])).sum(axis=1)
        return total


def _sizes(contact: Contact) -> tuple[Floats, Floats]:
    return contact.first.extents, contact.second.extents


def _last(when: NDArray[np.bool_]) -> Indices:
    """Return for every instant the last one so far of those marked (m,); -1 before all."""
    return np.maximum.accumulate(np.where(when, np.arange(len(when)), -1))


def _within_reach(contact: Contact, at: Pose, by: Pose) -> NDArray[np.bool_]:
    """Whether shapes are so near that how they lie matters: about their own size from where they touch."""
    one, two = _sizes(contact)
    way, reach = by[1] - at[1], 2.0 * (two[0] + contact.pair.margin) + two[1]
    if contact.first.type == "plane":
        return np.asarray(np.einsum("...i,...i->...", way, at[0][..., 2]) <= reach)
    return np.asarray(np.linalg.norm(way, axis=-1) <= reach + 2.0 * one[0] + one[1])


def _along(contact: Contact, at: Pose, by: Pose) -> bool:
    """Whether two capsules lie beside each other, and along, or a cylinder stands."""
    kinds = (contact.first.type, contact.second.type)
    return bool(lying(kinds, _sizes(contact), at, by, np.array(contact.parallel)))


def end_of(contact: Contact, at: Pose, by: Pose, point: Floats) -> int:
    """Return at which place of two capsules, or of a cylinder over a plane, a point is where they meet."""
    if contact.first.type == "plane":
        x, n = by[0].T @ (point - by[1]), by[0].T @ at[0][:, 2]
        if _along(contact, at, by):
            return int(np.round(np.arctan2(x[1], x[0]) / (0.5 * np.pi))) % 4
        return 2 * int(x[2] > 0.0) + int(x[:2] @ n[:2] > 0.0)
    one, two = _sizes(contact)
    low, high = overlap(at, one[1], by, two[1])
    return int(_along(contact, at, by) and at[0][:, 2] @ (point - at[1]) > 0.5 * (low + high))


def drift(rates: Callable[[Floats], Floats], v: Floats, turn: float = TURN) -> Floats:
    """Return H' v by differences of fourth order along the motion: central, or of one side where a kink is close.

    H v has one where nearest points come to the end of a capsule, or to an edge of a box.

    Args:
        rates: times from now along the motion with constant v (m,) -> H v there (m, n).
        v: velocities (nv,).
        turn: angle or length over which they are.
    """
    step = turn / max(float(np.abs(v).max()), 1e-12)
    before, left, right, ahead = rates(step * np.array([-2.0, -1.0, 1.0, 2.0]))
    near, far = 0.5 * (right - left), 0.25 * (ahead - before)
    total: Floats = (4.0 * near - far) / (3.0 * step)
    mixed = np.abs(near - far) > MIXED * np.maximum(np.abs(near), turn * np.maximum(np.abs(left), np.abs(right)))
    if mixed.any():
        sides = rates(0.5 * step * np.arange(-4.0, 5.0))[:, mixed]
        back, on = (ONE_SIDED @ part for part in (sides[4::-1], sides[4:]))
        total[mixed] = np.where(np.abs(back[1]) < np.abs(on[1]), -back[0], on[0]) / (0.5 * step)
    return total


def closing(met: Touches, velocity: Callable[[Indices, Floats], Any]) -> Floats:
    """Return the rate of every gap (..., n), m/s, by how fast bodies carry points of the world."""
    apart = velocity(met.second, met.point) - velocity(met.first, met.point)
    total: Floats = np.einsum("...ni,...ni->...n", met.normal, apart)
    return total
