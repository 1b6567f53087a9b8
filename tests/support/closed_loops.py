"""The same mechanism in coordinates of its joints, and as loose bodies that loops hold together."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from friction_scenes import box_body, pair

from crossbody.cases.scene import Body, Joint, Loop, RowLaw, Scene, Shape

LOOP_LAW = RowLaw(a0=400.0, a1=40.0)
HALF = (0.12, 0.08, 0.06)
SHAPES = {"box": HALF, "capsule": (0.05, 0.1, 0.0), "sphere": (0.1, 0.0, 0.0)}


@dataclass(frozen=True, slots=True)
class Placed:
    """A body's place (3,), turn (3, 3), velocity of its origin (3,) and angular velocity (3,), in the world."""

    x: np.ndarray
    R: np.ndarray
    v: np.ndarray
    w: np.ndarray


def quaternion(R: np.ndarray) -> np.ndarray:
    """Return the unit quaternion of a rotation."""
    from scipy.spatial.transform import Rotation

    found: np.ndarray = np.roll(Rotation.from_matrix(R).as_quat(), 1)
    return found


def rotation(q: np.ndarray) -> np.ndarray:
    """Return the rotation of a quaternion."""
    from scipy.spatial.transform import Rotation

    found: np.ndarray = Rotation.from_quat(np.roll(q, -1)).as_matrix()
    return found


def about(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation by an angle about an axis."""
    from scipy.spatial.transform import Rotation

    found: np.ndarray = Rotation.from_rotvec(np.asarray(axis) / np.linalg.norm(axis) * angle).as_matrix()
    return found


def placed(scene: Scene, q: np.ndarray, v: np.ndarray) -> dict[str, Placed]:
    """Place the bodies of a scene, each of which has one joint at most, free, ball or hinge."""
    joints, found = {joint.body: joint for joint in scene.joints}, dict[str, Placed]()
    world, at, speed = Placed(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3)), 0, 0
    for body in scene.bodies:
        joint, on = joints.get(body.name), found.get(body.parent, world)
        if joint is not None and joint.type == "free":
            R = rotation(q[at + 3 : at + 7])
            found[body.name] = Placed(q[at : at + 3], R, v[speed : speed + 3], R @ v[speed + 3 : speed + 6])
            at, speed = at + 7, speed + 6
            continue
        R0 = on.R @ rotation(np.array(body.orientation))
        anchor = np.zeros(3) if joint is None else np.array(joint.anchor)
        pivot = on.x + on.R @ np.array(body.position) + R0 @ anchor
        R, w = R0, on.w
        if joint is not None and joint.type == "hinge":
            axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
            R = R0 @ about(axis, q[at])
            w = on.w + R @ axis * v[speed]
            at, speed = at + 1, speed + 1
        elif joint is not None:
            R = R0 @ rotation(q[at : at + 4])
            w = on.w + R @ v[speed : speed + 3]
            at, speed = at + 4, speed + 3
        of_pivot = on.v + np.cross(on.w, pivot - on.x)
        x = pivot - R @ anchor
        found[body.name] = Placed(x, R, of_pivot - np.cross(w, pivot - x), w)
    return found


def cut(
    scene: Scene, q: np.ndarray, v: np.ndarray, names: list[str], law: RowLaw = LOOP_LAW
) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Return the scene with these bodies loose, each held to its parent by loops in its joint's place, and its start.

    A hinge is two points of its axis that stay together with the parent's: one row follows from the other five. Bodies
    that are cut may not have others on them that are not.
    """
    places, joints = placed(scene, q, v), {joint.body: joint for joint in scene.joints}
    bodies, order, loops = list[Body](), list[Joint](), list[Loop](scene.loops)
    for body in scene.bodies:
        joint = joints.get(body.name)
        if body.name not in names:
            bodies.append(body)
            order += [] if joint is None else [joint]
            continue
        bodies.append(dataclasses.replace(body, parent="", position=(0.0,) * 3, orientation=(1.0, 0.0, 0.0, 0.0)))
        order.append(Joint(name=f"loose {body.name}", body=body.name, type="free"))
        loops += restated(body, joint, law)
    loose = scene.replace(bodies=tuple(bodies), joints=tuple(order), loops=tuple(loops))
    return loose, *_start(loose, scene, q, v, places)


def restated(body: Body, joint: Joint | None, law: RowLaw = LOOP_LAW) -> list[Loop]:
    """Return loops that hold a body to its parent as its joint does, a weld where it has none."""
    R0, at = rotation(np.array(body.orientation)), np.array(body.position)
    if joint is None:
        return [Loop(
            name=f"{body.name} fixed", type="weld", first=body.name, second=body.parent, law=law,
            second_position=tuple(at), orientation=tuple(quaternion(R0.T)), torque_scale=0.3,
        )]  # fmt: skip
    points = [np.array(joint.anchor)]
    if joint.type == "hinge":
        axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
        points = [points[0] - 0.1 * axis, points[0] + 0.15 * axis]
    return [
        Loop(name=f"{body.name} {k}", type="connect", first=body.name, second=body.parent, law=law,
             first_position=tuple(point), second_position=tuple(at + R0 @ point)) for k, point in enumerate(points)
    ]  # fmt: skip


def _start(
    loose: Scene, scene: Scene, q: np.ndarray, v: np.ndarray, places: dict[str, Placed]
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities of the scene that was cut."""
    own, at, speed = dict[str, tuple[np.ndarray, np.ndarray]](), 0, 0
    for joint in scene.joints:
        count = {"free": (7, 6), "ball": (4, 3), "hinge": (1, 1)}[joint.type]
        own[joint.name] = q[at : at + count[0]], v[speed : speed + count[1]]
        at, speed = at + count[0], speed + count[1]
    positions, velocities = list[np.ndarray](), list[np.ndarray]()
    for joint in loose.joints:
        if joint.name in own:
            place, rate = own[joint.name]
        else:
            there = places[joint.body]
            place, rate = np.r_[there.x, quaternion(there.R)], np.r_[there.v, there.R.T @ there.w]
        positions.append(place)
        velocities.append(rate)
    return np.concatenate(positions), np.concatenate(velocities)


def apart(one: dict[str, Placed], other: dict[str, Placed]) -> float:
    """Return by how much the bodies of two scenes are apart, in m and rad."""
    return max(
        max(float(np.abs(at.x - other[name].x).max()), float(np.abs(at.R - other[name].R).max()))
        for name, at in one.items()
    )


def drawn(seed: int, *, most: int = 4, tilt: float = 0.3) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Return bodies on hinges, balls or nothing at all, in a chain or a star on a free one, that fall on a slope."""
    rng = np.random.default_rng(seed)
    bodies, joints, shapes, q, v = [], list[Joint](), [Shape(name="floor", type="plane")], list[float](), list[float]()
    mu, law = float(rng.uniform(0.1, 0.9)), RowLaw(a0=float(10 ** rng.uniform(3, 4)), a1=float(rng.uniform(20, 200)))
    branch = list[str]()
    for i in range(int(rng.integers(2, most + 1))):
        parent = str(rng.choice(branch)) if bodies else ""
        made, kind = box_body(f"b{i}", HALF, float(rng.uniform(0.5, 2.0))), str(rng.choice(["hinge", "ball", "fixed"]))
        turn = rng.normal(size=4)
        turn /= np.linalg.norm(turn)
        place = rng.normal(size=3) * 0.2 if parent else np.zeros(3)
        branch = [*branch[: branch.index(parent) + 1 if parent else 0], f"b{i}"]
        bodies.append(dataclasses.replace(made, parent=parent, position=tuple(place),
                                          orientation=tuple(turn) if parent else (1.0, 0.0, 0.0, 0.0)))  # fmt: skip
        if not parent:
            joints.append(Joint(name="free", body="b0", type="free"))
            q += [0.0, 0.0, 0.8, *turn]
            v += [*rng.normal(size=2), -2.0, *(2.0 * rng.normal(size=3))]
        elif kind != "fixed":
            anchor, axis, angle = rng.normal(size=3) * 0.1, rng.normal(size=3), rng.normal(size=4)
            joints.append(Joint(name=f"j{i}", body=f"b{i}", type=kind, axis=tuple(axis), anchor=tuple(anchor)))
            q += [float(rng.normal())] if kind == "hinge" else list(angle / np.linalg.norm(angle))
            v += list(rng.normal(size=1 if kind == "hinge" else 3))
        shape = str(rng.choice(list(SHAPES)))
        shapes.append(Shape(name=f"s{i}", body=f"b{i}", type=shape, size=SHAPES[shape]))
    pairs = tuple(pair("floor", shape.name, mu, law) for shape in shapes[1:])
    gravity = (9.81 * np.sin(tilt), 0.0, -9.81 * np.cos(tilt))
    scene = Scene(bodies=tuple(bodies), joints=tuple(joints), shapes=tuple(shapes), pairs=pairs, gravity=gravity)
    return scene, np.array(q), np.array(v)
