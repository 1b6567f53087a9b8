"""A scene as the table of numbers that the kernels read: one row a joint, nothing compiled for a model.

A body with several joints is a chain of massless nodes, one without is fused into the node above. The pose of a node in
its parent is T0 + c T1 + s T2, with c, s = cos, sin of a hinge's angle or c = travel of a slide.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from crossbody.cases import SceneError
from crossbody.cases.arrays import Floats
from crossbody.cases.remembered import remembered
from crossbody.cases.scene import WIDTHS, Actuator, Body, Joint, Loop, Push, Scene, Shape, Tendon, Vector
from crossbody.cases.scene_contacts import Contact, contacts
from crossbody.reference.kinds import Index
from crossbody.reference.pairs import layout as pairs
from crossbody.reference.tree import layout

SHAPES = {
    "plane": pairs.PLANE, "sphere": pairs.SPHERE, "capsule": pairs.CAPSULE, "ellipsoid": pairs.ELLIPSOID,
    "cylinder": pairs.CYLINDER, "box": pairs.BOX, "hull": pairs.HULL,
}  # fmt: skip
TYPES = {"free": layout.FREE, "ball": layout.BALL, "slide": layout.SLIDE, "hinge": layout.HINGE}


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a body stands: its node (-1 for the world) and its constant pose in that node's frame."""

    node: int
    R: Floats
    p: Floats


WORLD = Place(node=-1, R=np.eye(3), p=np.zeros(3))


@dataclass(slots=True, kw_only=True)
class Inertia:
    """Mass, first moment and second moment about the origin of a node, in its axes; and the weight it is spared."""

    m: float = 0.0
    mc: Floats = field(default_factory=lambda: np.zeros(3))
    second: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    lifted: Floats = field(default_factory=lambda: np.zeros(4))

    def add(self, body: Body, place: Place) -> None:
        """Add a body that is fixed to the node."""
        xx, yy, zz, xy, xz, yz = body.inertia
        about_com = place.R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ place.R.T
        c = place.p + place.R @ np.array(body.com)
        self.m += body.mass
        self.mc += body.mass * c
        self.second += about_com + body.mass * (c @ c * np.eye(3) - np.outer(c, c))
        self.lifted += body.weightless * body.mass * np.array([1.0, *c])

    def row(self) -> Floats:
        """Mass, centre and inertia about it, and what it is spared: a node's entries from MASS on."""
        c = self.mc / self.m if self.m > 0.0 else np.zeros(3)
        J = self.second - self.m * (c @ c * np.eye(3) - np.outer(c, c))
        return np.array([self.m, *c, J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2], *self.lifted])


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A scene for the kernels.

    Attributes:
        p: the parameters of the kernels; at their end `sides` and then `kinks` discrete variables, `phases` angles,
            the kinks' bands, the tolerance and the inputs.
        places: body -> where it stands.
        nodes: number of nodes.
        dofs: joint -> its first velocity.
        coordinates: joint -> its first coordinate.
    """

    p: Floats
    places: dict[str, Place]
    nodes: int
    dofs: dict[str, int]
    coordinates: dict[str, int]
    sides: int
    phases: int
    kinks: int

    @property
    def latched(self) -> int:
        """How many numbers follow the discrete variables."""
        inputs = len(self.p) - int(self.p[layout.AT_TOLD])
        return self.phases + (self.kinks + inputs if self.kinks else 0)

    @property
    def constants(self) -> int:
        """How many numbers stand before the discrete variables."""
        return int(self.p[layout.AT_SIDE])

    @property
    def quaternions(self) -> list[int]:
        """First coordinate of every quaternion."""
        first = int(self.p[layout.AT_NODE])
        nodes = self.p[first : first + layout.NODE * self.nodes].reshape(-1, layout.NODE)
        kinds, at = nodes[:, layout.TYPE], nodes[:, layout.Q].astype(int)
        found: list[int] = (at + 3 * (kinds == layout.FREE))[kinds < layout.SLIDE].tolist()
        return found

    @property
    def scratch(self) -> int:
        """Length of w that the kernels need; the actuators' sums stand at its end."""
        return self.nodes * layout.NODE_SCRATCH + int(self.p[layout.DOFS]) * (layout.DOF_SCRATCH + 1)


def rotation(quaternion: tuple[float, ...] | Floats) -> Floats:
    """Return the rotation matrix of a quaternion (w first) of any length above 0."""
    w, x, y, z = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


@remembered(4)
def tabulate(scene: Scene) -> Table:
    """Return the table of a scene.

    Raises:
        SceneError: for a scene without joints, or one that the kernels cannot do.
    """
    if not scene.joints:
        raise SceneError("The scene has no joint: nothing can move; valid: a joint or freejoint in one body at least.")
    builder = _Builder(scene)
    return builder.table()


class _Builder:
    """Goes through the bodies once, from the world outwards."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.joints: dict[str, list[Joint]] = {}
        for joint in scene.joints:
            self.joints.setdefault(joint.body, []).append(joint)
        self.places: dict[str, Place] = {"": WORLD}
        self.rows: list[Floats] = []
        self.inertias: list[Inertia] = []
        self.dof_rows: list[Floats] = []
        self.last_dof: list[int] = []
        self.coordinates: dict[str, int] = {}
        self.dofs: dict[str, int] = {}
        self.nq = 0
        self.resting = 0.0
        self.sides = self.phases = 0
        self.kinks: list[tuple[int, ...]] = []

    def table(self) -> Table:
        for body in self.scene.bodies:
            self._place(body)
        for row, inertia in zip(self.rows, self.inertias, strict=True):
            row[layout.MASS : layout.STIFFNESS] = inertia.row()
        return Table(
            p=self._packed(), places=self.places, nodes=len(self.rows), dofs=self.dofs, coordinates=self.coordinates,
            sides=self.sides, phases=self.phases, kinks=len(self.kinks),
        )  # fmt: skip

    def _place(self, body: Body) -> None:
        """Hang a body on its parent: a node for each of its joints, none if it has none."""
        above = self.places[body.parent]
        R, p = above.R @ rotation(body.orientation), above.p + above.R @ np.array(body.position)
        place = Place(node=above.node, R=R, p=p)
        for joint in self.joints.get(body.name, ()):
            self._node(joint, place)
            place = Place(node=len(self.rows) - 1, R=np.eye(3), p=np.zeros(3))
        self.places[body.name] = place
        if place.node >= 0:
            self.inertias[place.node].add(body, place)
        else:
            centre = place.p + place.R @ np.array(body.com)
            self.resting -= (1.0 - body.weightless) * body.mass * float(centre @ np.array(self.scene.gravity))

    def _node(self, joint: Joint, before: Place) -> None:
        if joint.type == "free" and any(joint.stiffness):
            raise SceneError(f"Joint {joint.name!r}: springs of a free joint are not supported.")
        row, kind = np.zeros(layout.NODE), TYPES[joint.type]
        width_q, width_v = WIDTHS[joint.type]
        dof, index = len(self.dof_rows), len(self.rows)
        root = self.rows[before.node][layout.ROOT] if before.node >= 0 else index
        row[[layout.TYPE, layout.PARENT, layout.Q, layout.V, layout.ROOT, layout.REFERENCE]] = (
            kind,
            before.node,
            self.nq,
            dof,
            root,
            joint.reference,
        )
        row[layout.POSE : layout.POSE + 36] = np.concatenate(_pose(joint, before))
        row[layout.AXIS : layout.AXIS + 3], row[layout.ANCHOR : layout.ANCHOR + 3] = joint.axis, joint.anchor
        row[layout.STIFFNESS : layout.STIFFNESS + 3] = joint.stiffness
        row[layout.REST : layout.REST + len(joint.rest)] = joint.rest
        self.coordinates[joint.name], self.dofs[joint.name] = self.nq, dof
        previous = self.last_dof[before.node] if before.node >= 0 else -1
        for k in range(width_v):
            low, high = joint.force_range
            drag = self._bend(layout.DRAG_BENDS, dof + k, joint.damping[1] != 0.0)
            acted = any(_moves(one) and (one.joint == joint.name or one.tendon) for one in self.scene.actuators)
            bend = self._bend(layout.SUM_BENDS, dof + k, acted and _bends(joint.force_range))
            self.dof_rows.append(np.array([previous, joint.armature, *joint.damping, drag, low, high, bend]))
            previous = dof + k
        self.last_dof.append(previous)
        self.rows.append(row)
        self.inertias.append(Inertia())
        self.nq += width_q

    def _bend(self, kind: int, of: int, there: bool, which: int = 0, row: int = 0) -> int:
        """Return the number of a kink, -1 if it is not there."""
        if not there:
            return -1
        self.kinks.append((kind, of, which, row))
        return len(self.kinks) - 1

    def _packed(self) -> Floats:
        scene = self.scene
        actuators = [self._actuator(i, actuator) for i, actuator in enumerate(scene.actuators)]
        tendons = [self._tendon(i, tendon) for i, tendon in enumerate(scene.tendons)]
        rows = constraint_rows(scene, self)
        head = np.zeros(layout.HEAD)
        head[[layout.NODES, layout.DOFS, layout.ACTUATORS, layout.TENDONS, layout.ROWS]] = (
            len(self.rows), len(self.dof_rows), len(actuators), len(tendons), len(rows),
        )  # fmt: skip
        head[layout.GRAVITY : layout.GRAVITY + 3] = scene.gravity
        head[layout.RESTING] = self.resting
        head[layout.POSED] = sum(row[layout.KIND] in layout.OF_POSES for row in rows)
        pushes = [self._push(push) for push in scene.pushes]
        head[layout.PUSHES] = len(pushes)
        head[layout.SPANNED] = sum(scene.acts_along(tendon) for tendon in scene.tendons if tendon.bodies)
        pairs_ = pair_rows(scene, self, first=len(rows) - sum(len(contact.rows) for contact in contacts(scene)))
        for row in pairs_:
            row[pairs.PHASE] += self.sides + len(self.kinks)  # behind all that says how shapes lie
        head[layout.LYING] = sum(row[pairs.LIES] >= 0.0 for row in pairs_)
        parts = [
            self.rows,
            self.dof_rows,
            actuators,
            tendons,
            rows,
            pairs_,
            pushes,
            [np.array(kink, dtype=float) for kink in self.kinks],
            [np.zeros(self.sides)],
            [np.zeros(len(self.kinks) + self.phases)],
            [np.zeros(len(self.kinks))],
            [np.zeros(1 + len(scene.inputs) + 2 * len(scene.activated))] if self.kinks else [],
        ]
        starts = layout.HEAD + np.cumsum([0, *(sum(map(len, part)) for part in parts)])
        head[[
            layout.AT_NODE, layout.AT_DOF, layout.AT_ACTUATOR, layout.AT_TENDON, layout.AT_ROW, layout.AT_PAIR,
            layout.AT_PUSH, layout.AT_KINK, layout.AT_SIDE, layout.AT_BEND, layout.AT_BAND, layout.AT_TOLD,
        ]] = starts[:-1]  # fmt: skip
        head[layout.KINKS] = len(self.kinks)
        head[[layout.SUMMED, layout.GAPPED]] = [
            sum(kink[0] == kind for kink in self.kinks) for kind in (layout.SUM_BENDS, layout.GAP_BENDS)
        ]
        head[layout.PLAIN] = sum(
            kind == layout.FORCE_BENDS and actuators[i][layout.SINGLE] for kind, i, *_ in self.kinks
        )
        head[layout.EXERTING] = sum(map(_exerts, scene.actuators))
        if actuators:
            head[layout.BOUNDED] = sum(np.isfinite(row[layout.SUM : layout.SUM + 2]).any() for row in self.dof_rows)
        packed = np.concatenate([head, *(row for part in parts for row in part)])
        finite: Floats = np.clip(packed, -1e300, 1e300)
        return finite  # a bound that is not there: parameters are finite

    def placed(self, body: str, position: Vector | Floats) -> tuple[float, ...]:
        """Return the node of a body, and a point of the body in the node's frame."""
        place = self.places[body]
        return (place.node, *(place.p + place.R @ np.array(position)))

    def _push(self, push: Push) -> Floats:
        if self.places[push.body].node < 0:
            raise SceneError(f"Push {push.name!r}: body {push.body!r} does not move.")
        com = next(body.com for body in self.scene.bodies if body.name == push.body)
        return np.array(self.placed(push.body, com))

    def _actuator(self, i: int, actuator: Actuator) -> Floats:
        row = np.zeros(layout.ACTUATOR)
        if actuator.tendon:
            names = [tendon.name for tendon in self.scene.tendons]
            row[[layout.TARGET, layout.WHICH]] = layout.ON_TENDON, names.index(actuator.tendon)
            row[layout.GEAR] = actuator.gear[0]
        elif actuator.joint:
            joint = next(joint for joint in self.scene.joints if joint.name == actuator.joint)
            width = WIDTHS[joint.type][1]
            if len(actuator.gear) < width:
                raise SceneError(
                    f"Actuator {actuator.name!r}: gear is {list(actuator.gear)}; it needs {width} numbers."
                )
            if width > 1 and (actuator.gain[1] or actuator.bias[1]):
                raise SceneError(
                    f"Actuator {actuator.name!r}: its force depends on its length, which a {joint.type} joint "
                    "does not have."
                )
            dof = self.dofs[joint.name]
            row[[layout.TARGET, layout.WHICH, layout.ANGLE]] = layout.ON_JOINT, dof, self.coordinates[joint.name]
            row[layout.SINGLE] = width == 1 and not actuator.activation
            row[layout.GEAR : layout.GEAR + width] = actuator.gear[:width]
            for k in range(width):
                self.dof_rows[dof + k][layout.ARMATURE] += actuator.gear[0] ** 2 * actuator.armature
                self.dof_rows[dof + k][layout.DAMPING] += actuator.gear[0] ** 2 * actuator.damping
        else:
            raise SceneError(f"Actuator {actuator.name!r} acts on neither a joint nor a tendon.")
        row[layout.GAIN : layout.GAIN + 3], row[layout.BIAS : layout.BIAS + 3] = actuator.gain, actuator.bias
        bend = self._bend(layout.FORCE_BENDS, i, _moves(actuator) and _bends(actuator.force_range))
        row[layout.CONTROL : layout.CONTROL + 2] = actuator.control_range
        row[layout.FORCE : layout.FORCE + 3] = *actuator.force_range, bend
        if actuator.activation:
            kind = ("integrator", "filter").index(actuator.activation) + layout.INTEGRATOR
            place = [self.scene.actuators[i].name for i in self.scene.activated].index(actuator.name)
            bend = self._bend(layout.ACTIVATION_BENDS, i, _bends(actuator.activation_range))
            row[layout.ACTIVATION : layout.SINCE + 1] = (
                kind, actuator.time_constant, *actuator.activation_range, bend, len(self.scene.inputs) + 2 * place,
            )  # fmt: skip
        return row

    def ends(self, tendon: Tendon) -> list[float]:
        """Return where the points of a tendon are: a node and a point in its frame, twice."""
        placed = zip(tendon.bodies, tendon.positions, strict=True)
        return [float(number) for end in placed for number in self.placed(*end)]

    def _tendon(self, i: int, tendon: Tendon) -> Floats:
        b0, *others = tendon.damping
        b0 += sum(a.gear[0] ** 2 * a.damping for a in self.scene.actuators if a.tendon == tendon.name)
        drag = self._bend(layout.TENDON_DRAG_BENDS, i, others[0] != 0.0)
        bend = self._bend(layout.SPRING_BENDS, i, any(tendon.stiffness) and _bends(tendon.rest))
        spring = *tendon.stiffness, b0, *others, drag, *tendon.rest, bend
        if tendon.bodies:
            return np.array([layout.POINTS, *spring, *self.ends(tendon), 0.0])
        steps = [
            (self.coordinates[name], self.dofs[name], c)
            for name, c in zip(tendon.joints, tendon.coefficients, strict=True)
        ]
        return np.array([len(steps), *spring, *np.ravel(steps)])


def _moves(actuator: Actuator) -> bool:
    """Whether its force changes while its control holds."""
    return bool(actuator.activation) or any(actuator.gain[1:]) or any(actuator.bias[1:])


def _exerts(actuator: Actuator) -> bool:
    """Whether there is a force for any control: by its constants, or by a bound that leaves zero out."""
    low, high = actuator.force_range
    return any(actuator.gain) or any(actuator.bias) or not low <= 0.0 <= high


def _bends(bounds: Vector) -> bool:
    """Whether there is room between bounds, and one of them is there."""
    return bounds[0] < bounds[1] and bool(np.isfinite(bounds).any())


def _pose(joint: Joint, before: Place) -> tuple[Floats, Floats, Floats]:
    """T0, T1, T2 (12,) each: nine of the rotation, three of the position, in the parent's frame."""
    R, p, axis, anchor = before.R, before.p, np.array(joint.axis), np.array(joint.anchor)
    none = np.zeros(9)
    if joint.type == "hinge":
        K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        terms = (np.eye(3) + K @ K, -K @ K, K)
        moved = (anchor - terms[0] @ anchor, -terms[1] @ anchor, -terms[2] @ anchor)
        first, *others = (np.concatenate([(R @ T).ravel(), R @ m]) for T, m in zip(terms, moved, strict=True))
        first[9:] += p
        return first, others[0], others[1]
    if joint.type == "slide":
        return np.array([*R.ravel(), *p]), np.array([*none, *(R @ axis)]), np.zeros(12)
    return np.array([*R.ravel(), *p]), np.zeros(12), np.zeros(12)


def constraint_rows(scene: Scene, builder: _Builder) -> list[Floats]:
    """Return the rows: loops, bounds of joints, bounds of tendons, contacts of shapes, dry friction."""
    rows: list[Floats] = []
    for loop in scene.loops:
        rows += _loop(loop, builder)
    for joint in scene.joints:
        rows += [_limit(joint, builder, sign) for sign in (1.0, -1.0) if np.isfinite(joint.range[0 if sign > 0 else 1])]
    for i, tendon in enumerate(scene.tendons):
        for sign in (1.0, -1.0):
            bound = tendon.range[0 if sign > 0 else 1]
            if not np.isfinite(bound):
                continue
            beyond = bound + sign * tendon.margin
            if tendon.bodies:
                rows.append(_row(layout.STRING, sign, *builder.ends(tendon), beyond))
            else:
                rows.append(_row(layout.TENDON_LIMIT, sign, i, beyond))
    met = contacts(scene)
    for i, contact in enumerate(met):
        rows += _contact_rows(contact, i, builder)
    for i, contact in enumerate(met):
        for row in _contact_rows(contact, i, builder) if contact.friction > 0.0 else ():
            rows += [_tangent(row, across) for across in range(2)]
    return [*rows, *_dry(scene, builder)]


def _dry(scene: Scene, builder: _Builder) -> Iterator[Floats]:
    """Return the rows of dry friction."""
    for part, width in scene.dry:
        if isinstance(part, Joint):
            first = builder.dofs[part.name]
            yield from (_row(layout.DRY_JOINT, 1.0, 0.0, first + k) for k in range(width))
        elif part.bodies:
            yield _row(layout.DRY_STRING, 1.0, *builder.ends(part))
        else:
            yield _row(layout.DRY_TENDON, 1.0, scene.tendons.index(part))


def _tangent(row: Floats, across: int) -> Floats:
    """Return a tangential row of the contact row `row`."""
    found = row.copy()
    found[layout.KIND], found[pairs.ACROSS] = layout.TANGENT, across
    return found


def _contact_rows(contact: Contact, i: int, builder: _Builder) -> list[Floats]:
    """Return the rows of pair i; over a plane each has the point that the second shape is round in its place."""
    shape = contact.second
    if contact.first.type != "plane":
        return [_row(layout.CONTACT, i, k) for k in range(contact.places)]
    radius = shape.size[0] if shape.type in ("sphere", "capsule") else 0.0
    points = shape.position + _points(contact) @ rotation(shape.orientation).T
    return [_row(layout.CONTACT, i, k, *builder.placed(shape.body, x)[1:], radius) for k, x in enumerate(points)]


def _points(contact: Contact) -> Floats:
    """Return the points (places, 3) that the second shape is round, in its axes; its centre where it is round none."""
    shape = contact.second
    if shape.type == "box":
        signs = [[-1.0 if k >> bit & 1 == 0 else 1.0 for bit in range(3)] for k in range(contact.places)]
        return np.array(signs) * shape.size
    if shape.type == "capsule":
        return np.array([[0.0, 0.0, -shape.size[1]], [0.0, 0.0, shape.size[1]]])
    return np.array(shape.corners) if shape.type == "hull" else np.zeros((contact.places, 3))


def pair_rows(scene: Scene, builder: _Builder, first: int) -> list[Floats]:
    """Return the pairs whose rows are contacts: two shapes, where the rows begin, and in how many ways they lie.

    Raises:
        SceneError: for shapes that do not move against each other.
    """
    rows, place = [], first
    for i, contact in enumerate(contacts(scene)):
        one, two = (_shape(shape, builder.places) for shape in (contact.first, contact.second))
        if one[pairs.NODE] == two[pairs.NODE]:
            raise SceneError(f"Pair {contact.pair.name!r}: its shapes do not move relative to each other.")
        lies = phase = -1.0
        if contact.parallel > 0.0:
            lies, builder.sides = builder.sides, builder.sides + 1
        if contact.first.type == "plane" and contact.parallel > 0.0:
            phase, builder.phases = builder.phases, builder.phases + 1
        bends = pairs.BENDING.get(int(two[pairs.TYPE]), 0) if one[pairs.TYPE] == pairs.SPHERE else 0
        bend = len(builder.kinks) if bends else -1
        for which in range(bends):
            builder._bend(layout.GAP_BENDS, i, True, which, place)
        place += contact.places
        rows.append(np.concatenate([one, two, [contact.pair.margin, lies, contact.parallel, phase, bend]]))
    return rows


def _shape(shape: Shape, places: Mapping[str, Place]) -> Floats:
    place = places[shape.body]
    R, p = place.R @ rotation(shape.orientation), place.p + place.R @ np.array(shape.position)
    return np.array([SHAPES[shape.type], place.node, *R.ravel(), *p, *shape.size])


def _row(kind: int, *numbers: float) -> Floats:
    row = np.zeros(layout.ROW)
    row[: 1 + len(numbers)] = (kind, *numbers)
    return row


def _limit(joint: Joint, builder: _Builder, sign: float) -> Floats:
    bound = joint.range[0 if sign > 0 else 1] + sign * joint.margin
    place = builder.coordinates[joint.name], builder.dofs[joint.name]
    if joint.type == "ball":
        builder.sides += 1
        return _row(layout.BALL_LIMIT, *place, bound, builder.sides - 1)
    return _row(layout.LIMIT, sign, *place, bound)


def _followed(loop: Loop, name: str, builder: _Builder) -> tuple[float, float, float]:
    """Return coordinate and velocity of a joint, or number of a tendon, and where it rests; -1 without a name."""
    if not name:
        return -1, -1, 0.0
    if loop.type == "tendon":
        i, tendon = next((i, one) for i, one in enumerate(builder.scene.tendons) if one.name == name)
        return i, -1, builder.scene.rest_length(tendon)
    joint = next(joint for joint in builder.scene.joints if joint.name == name)
    return builder.coordinates[name], builder.dofs[name], joint.reference


def _loop(loop: Loop, builder: _Builder) -> list[Floats]:
    if not loop.in_space:
        kind = layout.JOINT_LOOP if loop.type == "joint" else layout.TENDON_LOOP
        ends = [number for name in (loop.first, loop.second) for number in _followed(loop, name, builder)]
        return [_row(kind, *ends, *loop.polynomial)]
    points = *builder.placed(loop.first, loop.first_position), *builder.placed(loop.second, loop.second_position)
    rows = [_row(layout.CONNECT, k, *points) for k in range(3)]
    if loop.type == "weld":
        one, two = (builder.places[name] for name in (loop.first, loop.second))
        turns = (one.R @ rotation(loop.orientation)).ravel(), two.R.ravel()
        rows += [_row(layout.TURN, k, one.node, *turns[0], two.node, *turns[1], loop.torque_scale) for k in range(3)]
    return rows


def dof_parents(table: Table) -> Index:
    """Return for every velocity the one before it on the way to the world, -1 for none."""
    p, first, count = table.p, int(table.p[layout.AT_DOF]), int(table.p[layout.DOFS])
    return p[first : first + layout.DOF * count : layout.DOF].astype(np.int64)
