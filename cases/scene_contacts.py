"""Which pairs of a scene's shapes have rows, in what order, and how many each has."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Law
from crossbody.cases.errors import SceneError
from crossbody.cases.remembered import remembered
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import UNBOUNDED, Joint, Pair, RowLaw, Scene, Shape, Tendon, Vector

PLACES = {
    ("plane", "sphere"): 1, ("plane", "capsule"): 2, ("plane", "cylinder"): 4, ("plane", "box"): 8,
    ("plane", "ellipsoid"): 1, ("sphere", "sphere"): 1, ("sphere", "capsule"): 1, ("sphere", "cylinder"): 1,
    ("sphere", "box"): 1, ("capsule", "capsule"): 2, ("plane", "hull"): 256,
}  # fmt: skip
"""Number of places where two shapes may meet: over a plane ends of a capsule, corners of a box or a hull,
lowest and highest points of a cylinder's caps, or where it stands four points of its rim; of two capsules
one, or where they end if they lie along each other. Of a hull it is the most: each has as many as corners."""
WAYS = ("t1", "t2")
"""Directions across the normal: over a plane its x and y, else those of `crossbody.reference.tree.pair_slip`."""
Pose = tuple[Floats, Floats]  # rotation (3, 3) and origin (3,), m
SAME_GAP = 1e-9  # m, to which a bound's gap is that of two shapes: the places of bodies are rounded
STEEPEST = 0.5
"""Largest sine between the axes of capsules that lie along each other: where they stand as a T,
no end of the one is that of the other."""
LEVELLED = 1e-14  # sine of the angle between an axis and a plane below which it lies in it: rounding
WIDEST, SAG, LEVEL = 1e-2, 1e-8, 1e-6
"""Largest sine at which capsules lie along each other; and of the sum of two capsules' radii, by
how much their gap may be too large that is taken where they end. Last, the largest tilt with
which a cylinder stands."""
COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")
"""Of a loop in space: its points, then its axes; of a joint its velocities."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """A pair with rows.

    Attributes:
        pair: whose.
        first, second: its shapes, in the order in which the rows are written: the normal leads
            from first to second.
        places: number of its normal rows.
    """

    pair: Pair
    first: Shape
    second: Shape
    places: int

    @property
    def parallel(self) -> float:
        """Sine of the angle below which capsules lie along each other, or a cylinder stands; else 0."""
        return parallel(self.first, self.second)

    @property
    def friction(self) -> float:
        """Coefficient of its Coulomb friction; 0 without."""
        return self.pair.friction[0] if self.pair.dimension > 1 else 0.0

    @property
    def normals(self) -> tuple[str, ...]:
        """Names of its normal rows."""
        return (self.pair.name,) if self.places == 1 else tuple(f"{self.pair.name} {k}" for k in range(self.places))

    @property
    def tangents(self) -> tuple[str, ...]:
        """Names of its tangential rows, two for every normal one, behind all normal rows."""
        return tuple(f"{name} {way}" for name in self.normals for way in WAYS) if self.friction > 0.0 else ()

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of all its rows."""
        return (*self.normals, *self.tangents)


def parallel(first: Shape, second: Shape) -> float:
    """Return the sine of the angle below which two capsules lie along each other, or a cylinder stands on a plane.

    Axes a distance d apart that cross in the middle of a length L at an angle a are L^2 a^2 / 8d
    further apart where it ends. It is 0 for other shapes.
    """
    if first.type == "plane" and second.type == "cylinder":
        return LEVEL
    if first.type != "capsule" or second.type != "capsule":
        return 0.0
    length, apart = 2.0 * min(first.size[1], second.size[1]), first.size[0] + second.size[0]
    return float(min(WIDEST, np.sqrt(8.0 * SAG) * apart / length)) if length > 0.0 else WIDEST


@remembered(4)
def contacts(scene: Scene) -> tuple[Contact, ...]:
    """Return the pairs that have rows: of shapes whose gap is known in closed form, and that move.

    Those with friction have if the scene asks for it and it is of the kind that is known.
    """
    return tuple(found for found in _all(scene) if isinstance(found, Contact))


def rough(scene: Scene) -> Contact | None:
    """Return the first contact with friction; None if there is none."""
    return next((one for one in contacts(scene) if one.friction > 0.0), None)


def frictional(scene: Scene) -> str | None:
    """Return why an engine that has no rows with friction cannot run a scene; None if it can."""
    if (first := rough(scene)) is not None:
        what = f"Pair {first.pair.name!r} has friction"
    elif dry := [part for part, _ in scene.dry]:
        what = f"{type(dry[0]).__name__} {dry[0].name!r} has dry friction (friction_loss)"
    else:
        return None
    return f"{what}, for which this profile has no law. For a file, --without friction removes it in every engine."


def inert(scene: Scene) -> tuple[Pair, ...]:
    """Return the pairs of a plane and a shape whose gap no joint changes: a puck on slides along a table.

    A row of theirs would push without moving anything, and nothing would say how much.
    """
    shapes, axes = {shape.name: shape for shape in scene.shapes}, _Axes(scene)
    return tuple(pair for pair in scene.pairs if axes.hold(shapes[pair.first], shapes[pair.second]))


class _Axes:
    """Axes of a scene's joints in the world, at its reference pose."""

    def __init__(self, scene: Scene) -> None:
        self.turned = {name: turned for name, (turned, _) in _reference_poses(scene).items()}
        self.parents = {body.name: body.parent for body in scene.bodies}
        self.joints: dict[str, list[Joint]] = {}
        for joint in scene.joints:
            self.joints.setdefault(joint.body, []).append(joint)

    def hold(self, one: Shape, two: Shape) -> bool:
        """Return whether one shape is a plane over which no joint lifts or tilts the other."""
        plane, other = (one, two) if one.type == "plane" else (two, one)
        if plane.type != "plane" or other.type == "plane":
            return False
        normal = self.turned[plane.body] @ matrices(np.asarray(plane.orientation))[:, 2]
        between = set(self._above(plane.body)).symmetric_difference(self._above(other.body))
        joints = [joint for body in between for joint in self.joints.get(body, ())]
        return bool(joints) and all(self._keeps(joint, normal) for joint in joints)

    def _above(self, body: str) -> list[str]:
        """Return a body and those above it, without the world."""
        found = []
        while body:
            found.append(body)
            body = self.parents[body]
        return found

    def _keeps(self, joint: Joint, normal: Floats) -> bool:
        """Return whether a joint moves along a plane, or turns about its normal."""
        axis = self.turned[joint.body] @ joint.axis
        if joint.type == "slide":
            return bool(abs(axis @ normal) <= LEVELLED)
        return joint.type == "hinge" and bool(np.linalg.norm(axis - (axis @ normal) * normal) <= LEVELLED)


def by_shapes(scene: Scene) -> Scene:
    """Return the scene with pairs of shapes in the place of lower bounds that are the distance of two shapes.

    An engine with contacts of its own lets shapes touch. A bound is one of these if its gap is
    that of a sphere and a sphere or plane, on the bodies between which it is, at the reference
    pose. Unless all bounds are, it is the scene as it stands: rows keep their order.
    """
    poses, pairs = _reference_poses(scene), list[Pair]()
    joints, tendons = (
        tuple(_by_shapes(scene, part, poses, pairs) for part in parts) for parts in (scene.joints, scene.tendons)
    )
    if any(np.isfinite(part.range).any() for part in (*joints, *tendons)):
        return scene
    return scene.replace(joints=joints, tendons=tendons, pairs=(*pairs, *scene.pairs))


def _by_shapes(scene: Scene, part: Any, poses: Mapping[str, Pose], pairs: list[Pair]) -> Any:
    """Return a joint or tendon, and add its pair; as it is where no two shapes are that far apart."""
    low, high = part.range
    if not (math.isfinite(low) and math.isinf(high)):
        return part
    gap = _at_reference(scene, part, poses) - low - part.margin
    first, second = ([shape for shape in scene.shapes if shape.body == body] for body in _ends(scene, part))
    for one, two in product(first, second):
        apart = _apart(one, two, poses)
        if apart is not None and abs(apart - gap) <= SAME_GAP:
            pairs.append(Pair(name=part.name, first=one.name, second=two.name, law=part.law))
            return dataclasses.replace(part, range=UNBOUNDED)
    return part


def _ends(scene: Scene, part: Joint | Tendon) -> tuple[str, str]:
    """Return the bodies between which a joint, a sum of joints or a distance of points is; nobody's else.

    A sum counts a body from another that hangs on a third, whose joints are among them.
    """
    parents = {body.name: body.parent for body in scene.bodies}
    if isinstance(part, Joint):
        return (parents[part.body], part.body)
    own = {joint.name: joint.body for joint in scene.joints}
    moved = [own[name] for name in part.joints]
    found = part.bodies or tuple(body for body in moved if body not in [parents[other] for other in moved])
    return (found[0], found[1]) if len(found) == 2 else ("\n", "\n")


def _at_reference(scene: Scene, part: Joint | Tendon, poses: Mapping[str, Pose]) -> float:
    """Return the coordinate of a joint, or the length of a tendon, at the reference pose."""
    if isinstance(part, Joint):
        return part.reference
    if not part.bodies:
        return scene.rest_length(part)
    one, two = (_placed(poses[body], point) for body, point in zip(part.bodies, part.positions, strict=True))
    return float(np.linalg.norm(two - one))


def _apart(one: Shape, two: Shape, poses: Mapping[str, Pose]) -> float | None:
    """Return the gap of two spheres, or of a plane and a sphere, at the reference pose; None of others."""
    at, by = (_placed(poses[shape.body], shape.position) for shape in (one, two))
    if (one.type, two.type) == ("sphere", "sphere"):
        return float(np.linalg.norm(by - at)) - one.size[0] - two.size[0]
    if (one.type, two.type) == ("plane", "sphere"):
        normal = poses[one.body][0] @ matrices(np.array(one.orientation))[:, 2]
        return float(normal @ (by - at)) - two.size[0]
    return _apart(two, one, poses) if (one.type, two.type) == ("sphere", "plane") else None


def _placed(pose: Pose, point: Vector) -> Floats:
    at: Floats = pose[1] + pose[0] @ np.array(point)
    return at


def _reference_poses(scene: Scene) -> dict[str, Pose]:
    """Return rotation and origin of every body at the reference pose."""
    found: dict[str, Pose] = {"": (np.eye(3), np.zeros(3))}
    for body in scene.bodies:
        turned, at = found[body.parent]
        found[body.name] = turned @ matrices(np.array(body.orientation)), _placed((turned, at), body.position)
    return found


def watched(scene: Scene) -> tuple[Pair, ...]:
    """Return the pairs that have no rows: a motion in which they meet is not the scene's."""
    return tuple(found for found in _all(scene) if isinstance(found, Pair))


def _all(scene: Scene) -> Iterator[Contact | Pair]:
    shapes, axes = {shape.name: shape for shape in scene.shapes}, _Axes(scene)
    for pair in scene.pairs:
        if axes.hold(shapes[pair.first], shapes[pair.second]):
            continue
        one, two = shapes[pair.first], shapes[pair.second]
        if (one.type, two.type) not in PLACES:
            one, two = two, one
        places = _places(one, two)
        known = places > 0 and not unknown_friction(scene, pair)
        yield Contact(pair=pair, first=one, second=two, places=places) if known else pair


def unknown(scene: Scene) -> dict[frozenset[str], str]:
    """Return of the pairs that have no rows because of their friction the reason, by their shapes."""
    told = {frozenset((pair.first, pair.second)): unknown_friction(scene, pair) for pair in watched(scene)}
    return {shapes: reason for shapes, reason in told.items() if reason}


def rowless(scene: Scene) -> dict[frozenset[str], str]:
    """Return of all pairs that have no rows though their shapes may meet the reason, by their shapes."""
    types = {shape.name: shape.type for shape in scene.shapes}

    def gapless(one: str, two: str) -> str:
        if {(one, two), (two, one)} & PLACES.keys():
            return f"the hull has more than {PLACES['plane', 'hull']} corners"
        return f"the gap between a {one} and a {two} is not implemented"

    return {
        frozenset((pair.first, pair.second)): unknown_friction(scene, pair)
        or gapless(types[pair.first], types[pair.second])
        for pair in watched(scene)
    }


def check_pairs(scene: Scene) -> None:
    """Refuse pairs that have no rows though their shapes may meet."""
    inert_, shapes = inert(scene), {shape.name: shape for shape in scene.shapes}
    for pair in (found for found in _all(scene) if isinstance(found, Pair) and found not in inert_):
        one, two = sorted((shapes[pair.first], shapes[pair.second]), key=lambda shape: shape.type != "plane")
        if (one.type, two.type) not in PLACES:
            one, two = two, one
        reason = unknown_friction(scene, pair) if _places(one, two) else "their gap is not implemented"
        raise SceneError(
            f"Pair {pair.name!r} of a {one.type} and a {two.type} has no rows: {reason}. Valid are pairs of "
            f"{', '.join(map(' and '.join, PLACES))}, with friction that slides (dimension=3) or without (1)."
        )


def unknown_friction(scene: Scene, pair: Pair) -> str:
    """Return why the machine does not know the friction of a pair; empty if it knows it."""
    if pair.dimension == 1 or (pair.dimension == 3 and not any(pair.friction[:2])):
        return ""
    if pair.dimension != 3:
        many = f"dimension={pair.dimension}, condim in a file"
        return (
            f"torsional and rolling friction are not supported ({many}; 3, or without=rolling, keeps sliding friction)"
        )
    if pair.friction[0] != pair.friction[1]:
        return f"friction that differs by direction is not supported ({pair.friction[0]} and {pair.friction[1]})"
    if not scene.friction:
        return "its friction is left out where Scene.friction is False (a file's friction=0; friction=1 has it)"
    return ""


def _places(one: Shape, two: Shape) -> int:
    """Return at how many places two shapes may meet; 0 where no gap is known, or too many."""
    most = PLACES.get((one.type, two.type), 0)
    if two.type != "hull":
        return most
    return len(two.corners) if len(two.corners) <= most else 0


def rows_of(scene: Scene) -> tuple[list[str], list[RowLaw], list[bool]]:
    """Return names, laws and whether they can open, of the rows in the order of all engines; rows of friction last."""
    names, laws, unilateral = [], [], []
    for loop in scene.loops:
        for k in range(loop.width):
            names.append(loop.name if loop.width == 1 else f"{loop.name} {COMPONENTS[k]}")
            laws.append(loop.law)
            unilateral.append(False)
    for part in scene.bounded:
        for side, bound in zip(("low", "high"), part.range, strict=True):
            if np.isfinite(bound):
                names.append(f"{part.name} {side}")
                laws.append(part.law)
                unilateral.append(True)
    met = contacts(scene)
    for contact in met:
        names += contact.normals
        laws += [contact.pair.law] * contact.places
        unilateral += [True] * contact.places
    for contact in met:
        names += contact.tangents
        laws += [_held_back(contact.pair.law)] * len(contact.tangents)
        unilateral += [True] * len(contact.tangents)
    for part, width in scene.dry:
        ways = ("",) if width == 1 else COMPONENTS[-width:]
        names += [f"{part.name} friction {way}".strip() for way in ways]
        laws += [_held_back(part.law)] * width
        unilateral += [True] * width
    return names, laws, unilateral


def without_gap(scene: Scene) -> int:
    """Return how many rows have no gap: the last ones, tangential or of dry friction."""
    return sum(len(contact.tangents) for contact in contacts(scene)) + sum(width for _, width in scene.dry)


def turning(scene: Scene) -> set[str]:
    """Return the names of the rows whose gap is an angle: their multipliers are torques."""
    joints = {joint.name for joint in scene.joints if joint.type in ("hinge", "ball")}
    bounds = {f"{name} {side}" for name in joints for side in ("low", "high")}
    loops = {loop.name for loop in scene.loops if loop.type == "joint" and loop.first in joints}
    dry = {f"{part.name} friction {way}" for part, _ in scene.dry for way in COMPONENTS[3:]}
    return bounds | loops | dry | {f"{name} friction" for name in joints}


def _held_back(law: RowLaw) -> RowLaw:
    """Return the law of rows that friction holds, by that of their contact or joint: a slip decays as fast as a gap."""
    return RowLaw(a0=0.0, a1=law.a1 or math.sqrt(law.a0))


def law_of(scene: Scene) -> Law:
    """Return the constants of a scene's rows."""
    _, laws, unilateral = rows_of(scene)
    a0, a1, a2, b0, b1 = np.array([dataclasses.astuple(one) for one in laws]).reshape(-1, 5).T
    opens = np.array(unilateral, dtype=bool)
    touches = opens & (np.arange(len(laws)) < len(laws) - without_gap(scene))
    return Law(a0=a0, a1=a1, a2=a2, b0=b0, b1=b1, unilateral=opens, touches=touches)


def under_law(scene: Scene, law: Law) -> Scene:
    """Return the scene whose parts have the constants of a law's rows, of several those of the first."""
    names = [field.name for field in dataclasses.fields(RowLaw)]
    rows = zip(*(getattr(law, name).tolist() for name in names), strict=True)
    laws = (RowLaw(**dict(zip(names, row, strict=True))) for row in rows)

    def put(part: Any, count: int) -> Any:
        mine = [next(laws) for _ in range(count)]
        return dataclasses.replace(part, law=mine[0]) if mine and mine[0] != part.law else part

    loops = [put(loop, loop.width) for loop in scene.loops]
    bounded = [put(part, int(np.isfinite(part.range).sum())) for part in scene.bounded]
    places = {contact.pair.name: contact.places for contact in contacts(scene)}
    pairs = [put(pair, places.get(pair.name, 0)) for pair in scene.pairs]
    n = len(scene.joints)
    return scene.replace(loops=loops, joints=bounded[:n], tendons=bounded[n:], pairs=pairs)


def softness(scene: Scene, pairs: Sequence[Pair]) -> dict[str, list[float]]:
    """Return a0 and a1 of all bounds, loops and pairs by name; of a pair by those of its shapes."""
    parts: tuple[Joint | Tendon, ...] = (*scene.joints, *scene.tendons)
    bounded = [part for part in parts if not set(part.range) <= set(UNBOUNDED)]
    laws = {part.name: part.law for part in bounded} | {loop.name: loop.law for loop in scene.loops}
    laws |= {":".join(sorted((pair.first, pair.second))): pair.law for pair in pairs}
    return {name: [law.a0, law.a1] for name, law in laws.items()}
