"""A scene as data: bodies on joints, shapes, loops, tendons and actuators, in SI units and world axes with z up.

Coordinates: q (nq) and v (nv) stand in the order of `Scene.joints`. A hinge or slide has one of
each; a ball joint has a quaternion (w first) and its angular velocity in body axes; a free joint
has the position and quaternion of its body in the world, the velocity of the body's origin in
world axes and its angular velocity in body axes.

A scene is a value: frozen, checked once, hashable; `replace` makes a changed copy.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from crossbody.cases.arguments import shown
from crossbody.cases.arrays import Floats
from crossbody.cases.errors import SceneError
from crossbody.cases.fields import Vector as Vector  # a name of this module too
from crossbody.cases.fields import bounds, check_fields, parts, points, turn, vector

ZERO: Vector = (0.0, 0.0, 0.0)
UPRIGHT: Vector = (1.0, 0.0, 0.0, 0.0)
UNBOUNDED: Vector = (-math.inf, math.inf)
WIDTHS = {"free": (7, 6), "ball": (4, 3), "slide": (1, 1), "hinge": (1, 1)}
"""Coordinates and velocities of every type of joint."""
LARGEST = 10_000  # bodies of one scene
ROUGHEST = 1e100  # coefficient of friction: the square of a much larger one is no number
FLAT = 1e-6
"""Part of its length that is the least thickness of a hull: files have corners in single precision."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RowLaw:
    """Constants of h'' + a1 h' + a0 h + a2 h^3 = 0 for one row; b0, b1 of COLLISION, 0 without."""

    a0: float
    a1: float
    a2: float = 0.0
    b0: float = 0.0
    b1: float = 0.0

    def __post_init__(self) -> None:
        """Check that the constants are finite and not below 0."""
        check_fields(self, "RowLaw.")
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if not value >= 0.0:
                raise SceneError(f"RowLaw.{field.name} is {shown(value)}; it must be finite and at least 0.")


STIFF = RowLaw(a0=2500.0, a1=100.0)
"""What a row follows for which nothing else is said: both poles at -50/s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Named:
    """A part that is told apart by its name."""

    name: str
    sizes: ClassVar[dict[str, int]] = {}

    def __post_init__(self) -> None:
        """Check the type of every field, and that every number but a bound is finite; bring vectors to tuples."""
        what = f"{type(self).__name__} {self.name!r}"
        if not isinstance(self.name, str) or not self.name:
            raise SceneError(f"{type(self).__name__}.name is {shown(self.name)}; it must be a text.")
        for name, size in self.sizes.items():
            check = bounds if name.endswith("range") else turn if name == "orientation" else vector
            object.__setattr__(self, name, check(f"{what}: {name}", getattr(self, name), size))
        check_fields(self, f"{what}: ")
        law = getattr(self, "law", STIFF)
        if not isinstance(law, RowLaw):
            raise SceneError(f"{what}: law is {shown(law)}; it must be a RowLaw.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Body(_Named):
    """A rigid body.

    Attributes:
        parent: name of the body it hangs on; empty for the world.
        position, orientation: of its frame in the parent's at q = reference, m and quaternion (w first).
        mass: kg.
        com: centre of mass in body axes, m.
        inertia: xx, yy, zz, xy, xz, yz about the centre of mass in body axes, kg m^2.
        weightless: share of the weight that a force at the centre of mass takes off.
    """

    parent: str = ""
    position: Vector = ZERO
    orientation: Vector = UPRIGHT
    mass: float = 0.0
    com: Vector = ZERO
    inertia: Vector = (0.0,) * 6
    weightless: float = 0.0
    sizes: ClassVar[dict[str, int]] = {"position": 3, "orientation": 4, "com": 3, "inertia": 6}


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint(_Named):
    """How a body moves against its parent; several of one body act in their order.

    Attributes:
        body: whose.
        type: free, ball, slide or hinge.
        axis, anchor: in body axes, unit and m.
        reference: coordinate at the pose of `Body.position`, m or rad; slide and hinge alone.
        range: lowest and highest coordinate, m or rad; of a ball joint 0 (it becomes -inf) and
            the largest angle.
        margin: distance to the bound at which its row begins to act.
        armature: added to the joint's inertia, kg m^2 or kg.
        damping: b0, b1, b2 of the force -(b0 v + b1 v |v| + b2 v^3).
        stiffness: k0, k1, k2 of the force -(k0 x + k1 x^2 + k2 x^3), x = q - rest.
        rest: where the spring is at rest: one number, or four of a quaternion.
        friction_loss: bound of dry friction along each of its velocities, N m or N: it holds up
            to that, and takes so much against them where it slides.
        force_range: bounds of the sum of the actuators' forces on it.
        law: of the rows of its bounds; a slip that friction holds decays by it.
    """

    body: str
    type: str
    axis: Vector = (0.0, 0.0, 1.0)
    anchor: Vector = ZERO
    reference: float = 0.0
    range: Vector = UNBOUNDED
    margin: float = 0.0
    armature: float = 0.0
    damping: Vector = ZERO
    stiffness: Vector = ZERO
    rest: Vector = (0.0,)
    friction_loss: float = 0.0
    force_range: Vector = UNBOUNDED
    law: RowLaw = STIFF
    sizes: ClassVar[dict[str, int]] = {
        "axis": 3, "anchor": 3, "range": 2, "damping": 3, "stiffness": 3, "force_range": 2,
    }  # fmt: skip

    def __post_init__(self) -> None:
        """Check the type and bring the axis to length 1."""
        _Named.__post_init__(self)
        if self.type not in WIDTHS:
            raise SceneError(f"Joint {self.name!r}: type is {shown(self.type)}; valid: {', '.join(WIDTHS)}.")
        _check_loss(self)
        length = math.hypot(*self.axis)
        if not length > 0.0:
            raise SceneError(f"Joint {self.name!r}: axis is {list(self.axis)}; it must not be zero.")
        object.__setattr__(self, "axis", tuple(number / length for number in self.axis))
        size = 4 if self.type in ("ball", "free") else 1
        rest = vector(f"Joint {self.name!r}: rest", self.rest)
        if size == 4 and len(rest) == 1:
            rest = UPRIGHT
        check = turn if size == 4 else vector
        object.__setattr__(self, "rest", check(f"Joint {self.name!r}: rest", rest, size))
        if size == 4 and self.limited:
            self._put_angle()

    def _put_angle(self) -> None:
        """Check the bound of a ball joint, and leave it alone: no angle is below 0."""
        low, high = self.range
        if self.type == "free":
            raise SceneError(f"Joint {self.name!r}: a free joint has no bounds; range is {list(self.range)}.")
        if low > 0.0 or not high > max(self.margin, 0.0):
            raise SceneError(
                f"Joint {self.name!r}: range is {list(self.range)} and margin {self.margin:g}; "
                "a ball joint has 0 and its largest angle, rad, above the margin: at angle zero there is no direction."
            )
        object.__setattr__(self, "range", (-math.inf, high))

    @property
    def limited(self) -> bool:
        """Whether it has a bound."""
        return math.isfinite(self.range[0]) or math.isfinite(self.range[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape(_Named):
    """A solid on a body, for contacts and for the eye.

    Attributes:
        body: whose; empty for the world.
        type: sphere, capsule, cylinder, box, ellipsoid, plane or hull.
        size: as MuJoCo's: radius; radius and half length; half sides; semi-axes, m. A hull has none.
        corners: of a hull (n, 3), m: at least four that do not lie in a plane.
        position, orientation: in body axes.
        friction: sliding, torsional, rolling.
        margin: added to the distance at which a row acts, m.
    """

    body: str = ""
    type: str = "sphere"
    size: Vector = ZERO
    position: Vector = ZERO
    orientation: Vector = UPRIGHT
    friction: Vector = (1.0, 0.005, 0.0001)
    margin: float = 0.0
    corners: tuple[Vector, ...] = ()
    sizes: ClassVar[dict[str, int]] = {"size": 3, "position": 3, "orientation": 4, "friction": 3}

    def __post_init__(self) -> None:
        """Check size and friction; that a hull, and nothing else, has corners, and that they fill a space."""
        _Named.__post_init__(self)
        _check_friction(self)
        what = f"Shape {self.name!r}"
        if min(self.size) < 0.0:
            raise SceneError(f"{what}: size is {shown(self.size)}; valid: lengths of at least 0 m.")
        found = points(f"{what}: corners", self.corners)
        object.__setattr__(self, "corners", found)
        if (self.type == "hull") != bool(found):
            raise SceneError(f"{what} of type {self.type!r} has {len(found)} corners; only a hull has any.")
        if found and not _thickness(found) > FLAT:
            raise SceneError(
                f"{what} has {len(found)} corners that lie in one plane; a hull has at least four that do not."
            )

    @property
    def extents(self) -> Floats:
        """What its type needs: of a hull the corners (n, 3), of others the size (3,), m."""
        return np.array(self.corners or self.size)


def _thickness(points: tuple[Vector, ...]) -> float:
    """Return how thick points are in their thinnest direction, part of the thickest."""
    spread = np.array(points) - np.mean(points, axis=0)
    values = np.linalg.svd(spread / max(np.abs(spread).max(), 1e-300), compute_uv=False)
    return float(values[2] / values[0]) if len(points) > 3 and values[0] > 0.0 else 0.0


DIMENSIONS = (1, 3, 4, 6)  # of pairs: without friction, with sliding, torsional, rolling friction


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair(_Named):
    """Two shapes that may touch; their rows push only.

    Attributes:
        first, second: names of the shapes.
        margin: distance at which the rows begin to act, m.
        friction: along the two tangents, about the normal, about the two tangents.
        dimension: 1 without friction, 3 with sliding, 4 with torsional, 6 with rolling friction.
        law: of its rows.
    """

    first: str
    second: str
    margin: float = 0.0
    friction: Vector = (0.0,) * 5
    dimension: int = 1
    law: RowLaw = STIFF
    sizes: ClassVar[dict[str, int]] = {"friction": 5}

    def __post_init__(self) -> None:
        """Check the friction."""
        _Named.__post_init__(self)
        if self.dimension not in DIMENSIONS:
            raise SceneError(f"Pair {self.name!r}: dimension is {shown(self.dimension)}; valid: {DIMENSIONS}.")
        _check_friction(self)


def _check_friction(part: Shape | Pair) -> None:
    """Check the coefficients of a shape or a pair: of two shapes the larger holds, which may hide a negative one."""
    if not all(0.0 <= mu <= ROUGHEST for mu in part.friction):
        raise SceneError(
            f"{type(part).__name__} {part.name!r}: friction is {part.friction}; it must be at least 0 and at most "
            f"{ROUGHEST:g}."
        )


ROWS = {"connect": 3, "weld": 6, "joint": 1, "tendon": 1}  # of every type of loop


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop(_Named):
    """Rows that are always on.

    Attributes:
        type: connect (two points stay together), weld (two frames do), joint or tendon (the
            first's coordinate or length follows the second's by a polynomial).
        first, second: names of two bodies (the second may be empty: the world), joints or tendons
            (it may be empty).
        first_position, second_position: of the points in body axes, m.
        orientation: of the second body in the first, for a weld.
        polynomial: x1 - x1ref = c0 + c1 y + ... + c4 y^4, y = x2 - x2ref, for joints and tendons.
        torque_scale: of a weld's rotational rows, m.
        law: of its rows.
    """

    type: str
    first: str
    second: str = ""
    first_position: Vector = ZERO
    second_position: Vector = ZERO
    orientation: Vector = UPRIGHT
    polynomial: Vector = (0.0, 1.0, 0.0, 0.0, 0.0)
    torque_scale: float = 1.0
    law: RowLaw = STIFF
    sizes: ClassVar[dict[str, int]] = {
        "first_position": 3, "second_position": 3, "orientation": 4, "polynomial": 5,
    }  # fmt: skip

    def __post_init__(self) -> None:
        """Check the type."""
        _Named.__post_init__(self)
        if self.type not in ROWS:
            raise SceneError(f"Loop {self.name!r}: type is {shown(self.type)}; valid: {', '.join(ROWS)}.")

    @property
    def width(self) -> int:
        """Number of its rows."""
        return ROWS[self.type]

    @property
    def in_space(self) -> bool:
        """Whether it joins bodies."""
        return self.width > 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Tendon(_Named):
    """A length: l = sum c_j q_j of joints, or the distance of two points.

    Attributes:
        joints, coefficients: what it adds up, hinges and slides alone; empty for two points.
        bodies, positions: those of the two points, in body axes, m; the world is an empty name.
        damping, stiffness: as of a joint, of the length.
        rest: dead band of the spring, lowest and highest length.
        range, margin, law: as of a joint.
        friction_loss: as of a joint.
    """

    joints: tuple[str, ...] = ()
    coefficients: Vector = ()
    bodies: tuple[str, ...] = ()
    positions: tuple[Vector, ...] = ()
    damping: Vector = ZERO
    stiffness: Vector = ZERO
    rest: Vector = (0.0, 0.0)
    range: Vector = UNBOUNDED
    margin: float = 0.0
    friction_loss: float = 0.0
    law: RowLaw = STIFF
    sizes: ClassVar[dict[str, int]] = {
        "damping": 3, "stiffness": 3, "rest": 2, "range": 2,
    }  # fmt: skip

    def __post_init__(self) -> None:
        """Check that every joint has its coefficient, and that there are two points or none."""
        _Named.__post_init__(self)
        what = f"Tendon {self.name!r}"
        _check_loss(self)
        if self.rest[0] > self.rest[1]:
            raise SceneError(f"{what}: rest is {list(self.rest)}; it must be the shortest and the longest length.")
        object.__setattr__(self, "coefficients", vector(f"{what}: coefficients", self.coefficients, len(self.joints)))
        if bool(self.joints) == bool(self.bodies) or len(self.bodies) not in (0, 2):
            raise SceneError(f"{what} has joints {list(self.joints)} and bodies {list(self.bodies)}; it needs either, "
                             "two of the latter.")  # fmt: skip
        places = points(f"{what}: positions", self.positions)
        if len(places) != len(self.bodies):
            raise SceneError(f"{what}: positions is {shown(self.positions)}; it must be a point of each body.")
        object.__setattr__(self, "positions", places)


def _check_loss(part: Joint | Tendon) -> None:
    """Check the bound of a part's dry friction."""
    if not part.friction_loss >= 0.0:
        raise SceneError(
            f"{type(part).__name__} {part.name!r}: friction_loss is {part.friction_loss}; it must be at least 0."
        )


ACTIVATIONS = ("integrator", "filter")


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuator(_Named):
    """A force (g0 + g1 l + g2 l') a + b0 + b1 l + b2 l' on a joint or tendon, l = gear x.

    a is the control u itself, or an activation: a' = u of an integrator, tau a' = u - a of a filter.

    Attributes:
        joint, tendon: what it acts on; one of them is empty.
        gear: one number; of a ball or free joint, as many as it has velocities.
        gain: g0, g1, g2.
        bias: b0, b1, b2.
        armature: gear^2 armature is added to the joint's, kg m^2; a tendon cannot have it. Of
            several gears the first counts, for every velocity of the joint.
        damping: -gear^2 damping v acts on the joint likewise, or along the tendon.
        control_range, force_range: bounds of u, and of the force.
        activation: integrator or filter; empty where a = u.
        time_constant: tau of a filter, s.
        activation_range: bounds of a, at which it stands still.
    """

    joint: str = ""
    tendon: str = ""
    gear: Vector = (1.0,)
    gain: Vector = (1.0, 0.0, 0.0)
    bias: Vector = ZERO
    armature: float = 0.0
    damping: float = 0.0
    control_range: Vector = UNBOUNDED
    force_range: Vector = UNBOUNDED
    activation: str = ""
    time_constant: float = 0.0
    activation_range: Vector = UNBOUNDED
    sizes: ClassVar[dict[str, int]] = {
        "gain": 3, "bias": 3, "control_range": 2, "force_range": 2, "activation_range": 2,
    }  # fmt: skip

    def __post_init__(self) -> None:
        """Check the activation, and that a tendon's inertia is not asked for."""
        _Named.__post_init__(self)
        what = f"Actuator {self.name!r}"
        if self.activation not in ("", *ACTIVATIONS):
            raise SceneError(
                f"{what}: activation is {shown(self.activation)}; valid: {', '.join(ACTIVATIONS)}, or none."
            )
        if (self.activation == "filter") != (0.0 < self.time_constant < math.inf):
            raise SceneError(f"{what}: time_constant is {shown(self.time_constant)}; only a filter has one, above 0 s.")
        object.__setattr__(self, "gear", vector(f"{what}: gear", self.gear))
        if not all(math.isfinite(gear * gear) for gear in self.gear):  # inertia at a joint goes by it
            raise SceneError(f"{what}: gear is {shown(self.gear)}; valid: numbers whose squares are finite.")
        if self.tendon and self.armature:
            raise SceneError(f"Actuator {self.name!r} has armature on a tendon, which is not supported.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Push(_Named):
    """A force in world axes at the centre of mass of a body; its x, y and z, N, are inputs behind the controls.

    Attributes:
        body: whose.
    """

    body: str


_GROUPS: dict[str, type[_Named]] = {
    "bodies": Body, "joints": Joint, "shapes": Shape, "pairs": Pair, "loops": Loop, "tendons": Tendon,
    "actuators": Actuator, "pushes": Push,
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """Bodies on joints and what acts between them; see the module.

    Attributes:
        bodies: depth-first: behind its parent, and no other branch in between. Engines number them so.
        joints: those of one body stand together, in the order of the bodies.
        shapes, pairs, loops, tendons, actuators, pushes: what else there is.
        gravity: m/s^2.
        friction: whether pairs with friction have rows; a motion in which they meet is else not the scene's.
    """

    bodies: tuple[Body, ...] = ()
    joints: tuple[Joint, ...] = ()
    shapes: tuple[Shape, ...] = ()
    pairs: tuple[Pair, ...] = ()
    loops: tuple[Loop, ...] = ()
    tendons: tuple[Tendon, ...] = ()
    actuators: tuple[Actuator, ...] = ()
    pushes: tuple[Push, ...] = ()
    gravity: Vector = (0.0, 0.0, -9.81)
    friction: bool = True

    def __post_init__(self) -> None:
        """Check that names are unique, that every name used is there, and the parts' order."""
        object.__setattr__(self, "gravity", vector("Scene.gravity", self.gravity, 3))
        check_fields(self, "Scene.")
        for group, kind in _GROUPS.items():
            object.__setattr__(self, group, parts(f"Scene.{group}", getattr(self, group), kind))
            _unique(group, getattr(self, group))
        if len(self.bodies) > LARGEST:
            raise SceneError(f"The scene has {len(self.bodies)} bodies; at most {LARGEST} can be run.")
        self._check_order()
        bodies, joints = {"", *(b.name for b in self.bodies)}, {j.name for j in self.joints}
        tendons = {t.name for t in self.tendons}
        for shape in self.shapes:
            _known(shape, "body", shape.body, bodies)
        shapes = {shape.name for shape in self.shapes}
        for pair in self.pairs:
            _known(pair, "first", pair.first, shapes)
            _known(pair, "second", pair.second, shapes)
        _paired_once(self.pairs)
        for loop in self.loops:
            among = bodies if loop.in_space else {"", *(tendons if loop.type == "tendon" else joints)}
            _known(loop, "first", loop.first, among - {""})
            _known(loop, "second", loop.second, among)
        for tendon in self.tendons:
            for name in tendon.joints:
                _known(tendon, "joints", name, joints)
            for name in tendon.bodies:
                _known(tendon, "bodies", name, bodies)
        for actuator in self.actuators:
            _known(actuator, "joint", actuator.joint, joints | {""})
            _known(actuator, "tendon", actuator.tendon, tendons | {""})
        for push in self.pushes:
            _known(push, "body", push.body, bodies - {""})

    def _check_order(self) -> None:
        seen: dict[str, int] = {"": -1}
        branch: list[str] = []
        for i, body in enumerate(self.bodies):
            _known(body, "parent", body.parent, seen)
            seen[body.name] = i
            while branch and body.parent != branch[-1]:
                branch.pop()
            if body.parent and not branch:
                raise SceneError(
                    f"Body {body.name!r} is a child of {body.parent!r}, whose branch has ended before it: "
                    "Scene.bodies must stand branch by branch (depth-first)."
                )
            branch.append(body.name)
        for joint in self.joints:
            _known(joint, "body", joint.body, set(seen) - {""})
            if joint.type == "free" and self.bodies[seen[joint.body]].parent:
                raise SceneError(f"Joint {joint.name!r}: a free joint is only possible for a child of the world.")
        places = [seen[joint.body] for joint in self.joints]
        if places != sorted(places):
            raise SceneError("Scene.joints must be in the order of the bodies.")

    def replace(self, **changes: Any) -> Scene:
        """Return a copy with other parts."""
        return dataclasses.replace(self, **changes)

    @property
    def bounded(self) -> tuple[Joint | Tendon, ...]:
        """What may have bounds, in the order of their rows."""
        return (*self.joints, *self.tendons)

    @property
    def dry(self) -> tuple[tuple[Joint | Tendon, int], ...]:
        """What has dry friction of its own, and along how many velocities, in the rows' order."""
        found = [(joint, WIDTHS[joint.type][1]) for joint in self.joints if joint.friction_loss > 0.0]
        return (*found, *((tendon, 1) for tendon in self.tendons if tendon.friction_loss > 0.0))

    def rest_length(self, tendon: Tendon) -> float:
        """Return the length of a tendon at the reference pose."""
        rest = {joint.name: joint.reference for joint in self.joints}
        return sum(c * rest[name] for name, c in zip(tendon.joints, tendon.coefficients, strict=True))

    @property
    def activated(self) -> tuple[int, ...]:
        """Which actuators have an activation, in the order of these."""
        return tuple(i for i, actuator in enumerate(self.actuators) if actuator.activation)

    def acts_along(self, tendon: Tendon) -> bool:
        """Return whether a spring, a damper or an actuator acts along a tendon."""
        driven = any(actuator.tendon == tendon.name for actuator in self.actuators)
        return driven or any(tendon.stiffness) or any(tendon.damping)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of its inputs: the controls, then the components of the pushes."""
        return (*(part.name for part in self.actuators), *(f"{push.name} {k}" for push in self.pushes for k in "xyz"))

    @property
    def nq(self) -> int:
        """Number of coordinates."""
        return sum(WIDTHS[joint.type][0] for joint in self.joints)

    @property
    def nv(self) -> int:
        """Number of velocities."""
        return sum(WIDTHS[joint.type][1] for joint in self.joints)


def _unique(group: str, parts: Sequence[_Named]) -> None:
    seen: set[str] = set()
    for part in parts:
        if part.name in seen:
            raise SceneError(f"Scene.{group} has the name {part.name!r} twice.")
        seen.add(part.name)


def _paired_once(pairs: Sequence[Pair]) -> None:
    seen: dict[frozenset[str], str] = {}
    for pair in pairs:
        shapes = frozenset((pair.first, pair.second))
        if shapes in seen:
            raise SceneError(
                f"Pairs {seen[shapes]!r} and {pair.name!r} are of the same shapes, {pair.first!r} and {pair.second!r}: "
                "each would press with its own law. Valid is one pair for any two shapes."
            )
        seen[shapes] = pair.name


def _known(part: _Named, field: str, name: str, among: Any) -> None:
    if name not in among:
        raise SceneError(
            f"{type(part).__name__} {part.name!r}: {field} is {shown(name)}, which does not exist (before it)."
        )
