"""Random scenes: bodies on joints of every type, massless links, several joints a body, springs, tendons, actuators."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from crossbody.cases.scene import WIDTHS, Actuator, Body, Joint, Loop, Pair, Push, RowLaw, Scene, Shape, Tendon
from crossbody.cases.scene_contacts import PLACES

ALL = ("hinge", "slide", "ball", "free")
SINGLE = ("hinge", "slide")
KINDS = ("sphere", "capsule", "cylinder", "box", "ellipsoid")


def random_scene(seed: int, types: Sequence[str] = ALL, bodies: int = 6) -> Scene:
    """Return a scene of that many bodies, the same for the same seed."""
    rng = np.random.default_rng(seed)
    made: list[Body] = []
    joints: list[Joint] = []
    for i in range(bodies):
        branch = _branch(made)
        parent = str(rng.choice(["", *branch]))
        kinds = _kinds(rng, types, parent)
        made.append(_body(rng, f"body {i}", parent, fixed=not kinds))
        joints += [_joint(rng, f"joint {i} {k}", f"body {i}", kind) for k, kind in enumerate(kinds)]
    if not joints:
        joints.append(_joint(rng, "joint", made[0].name, "hinge"))
    joints.sort(key=lambda joint: [body.name for body in made].index(joint.body))
    single = [joint for joint in joints if joint.type in SINGLE]
    tendons = (*_tendons(rng, single), *_strings(rng, made))
    return Scene(
        bodies=tuple(made), joints=tuple(joints), actuators=(*_actuators(rng, joints), *_winches(tendons)),
        tendons=tendons,
        loops=(*_loops(rng, single), *_joined(rng, made)), **_contacts(rng, made, joints),
        gravity=tuple(rng.normal(size=3) * 5.0), pushes=_pushes(rng, joints),
    )  # fmt: skip


def with_own_laws(scene: Scene, seed: int) -> Scene:
    """Return the scene with a law of its own for everything that has rows."""
    rng = np.random.default_rng(seed)

    def law() -> RowLaw:
        return RowLaw(a0=float(rng.uniform(1e2, 1e4)), a1=float(rng.uniform(10.0, 1e3)))

    groups = ("joints", "tendons", "loops", "pairs")
    return scene.replace(**{name: tuple(replace(part, law=law()) for part in getattr(scene, name)) for name in groups})


def random_state(scene: Scene, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return q with unit quaternions, v and u, none of them zero."""
    q: list[float] = []
    for joint in scene.joints:
        part = rng.normal(size=WIDTHS[joint.type][0])
        if joint.type in ("ball", "free"):
            part[-4:] /= np.linalg.norm(part[-4:])
        q += part.tolist()
    return np.array(q), rng.normal(size=scene.nv) * 2.0, rng.normal(size=len(scene.inputs)) * 3.0


def _branch(made: Sequence[Body]) -> list[str]:
    """Return the last body and those above it: on these the next one may hang."""
    parents = {body.name: body.parent for body in made}
    branch = [made[-1].name] if made else []
    while branch and parents[branch[-1]]:
        branch.append(parents[branch[-1]])
    return branch


def _kinds(rng: np.random.Generator, types: Sequence[str], parent: str) -> list[str]:
    if "free" in types and not parent and rng.random() < 0.3:
        return ["free"]
    turning = [kind for kind in types if kind != "free"]
    count = int(rng.choice([0, 1, 1, 1, 2, 3]))
    kinds = [str(rng.choice(turning)) for _ in range(count)]
    # MuJoCo admits no rotation behind a ball joint of the same body.
    return [*(kind for kind in kinds if kind != "ball"), *(["ball"] if "ball" in kinds else [])]


def _unit(rng: np.random.Generator, size: int) -> tuple[float, ...]:
    x = rng.normal(size=size)
    return tuple((x / np.linalg.norm(x)).tolist())


def _body(rng: np.random.Generator, name: str, parent: str, *, fixed: bool) -> Body:
    A = rng.normal(size=(3, 3))
    J = A @ A.T
    J = (np.trace(J) * np.eye(3) - J) * 0.1 + 0.01 * np.eye(3)  # of a body: the triangle inequality holds
    return Body(
        name=name, parent=parent, position=tuple(rng.normal(size=3)), orientation=_unit(rng, 4),
        mass=float(rng.uniform(0.1, 3.0)), com=tuple(rng.normal(size=3) * 0.2),
        inertia=(J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]),
        weightless=float(rng.choice([0.0, 0.0, 1.0, 0.4])) if not fixed else 0.0,
    )  # fmt: skip


def _joint(rng: np.random.Generator, name: str, body: str, kind: str) -> Joint:
    single = kind in SINGLE
    return Joint(
        name=name, body=body, type=kind, axis=_unit(rng, 3),
        anchor=tuple(rng.normal(size=3)) if kind != "free" else (0.0, 0.0, 0.0),
        reference=float(rng.normal()) if single else 0.0, armature=float(rng.choice([0.0, 0.2])),
        damping=tuple(rng.uniform(0.0, 0.3, 3)) if kind != "free" else (0.0, 0.0, 0.0),
        stiffness=tuple(rng.uniform(0.0, 2.0, 3)) if kind != "free" else (0.0, 0.0, 0.0),
        rest=(float(rng.normal()),) if single else _unit(rng, 4),
        range=_range(rng, name, kind), margin=0.01,
        force_range=(-2.0, 3.0) if single and rng.random() < 0.3 else (-np.inf, np.inf),
    )  # fmt: skip


def _range(rng: np.random.Generator, name: str, kind: str) -> tuple[float, float]:
    if kind == "ball" and name.endswith("0"):
        return (0.0, 1.5)
    return (-20.0, 25.0) if kind in SINGLE and rng.random() < 0.3 else (-np.inf, np.inf)


def _strings(rng: np.random.Generator, made: Sequence[Body]) -> tuple[Tendon, ...]:
    """A bounded distance of two bodies, or of one and the world, with a spring and a damper along it."""
    if rng.random() < 0.5:
        return ()
    ends = (made[-1].name, str(rng.choice(["", *(body.name for body in made[:-1])])))
    points = tuple(tuple(rng.normal(size=3)) for _ in range(2))
    return (Tendon(name="rope", bodies=ends, positions=points, range=(0.1, 0.2), margin=0.01, stiffness=(2.0, 0.3, 0.1),
                   damping=(0.3, 0.1, 0.05), rest=(0.8, 1.6)),)  # fmt: skip


def _tendons(rng: np.random.Generator, single: Sequence[Joint]) -> tuple[Tendon, ...]:
    if len(single) < 2:
        return ()
    return (
        Tendon(
            name="tendon", joints=(single[0].name, single[-1].name), coefficients=(0.7, -1.3),
            stiffness=(3.0, 0.0, 0.0), damping=(0.4, 0.0, 0.0), rest=(-0.2, 0.1), range=(-30.0, 40.0),
        ),
        Tendon(name="string", joints=(single[1].name, single[0].name), coefficients=(-0.4, 1.1)),
    )  # fmt: skip


def _loops(rng: np.random.Generator, single: Sequence[Joint]) -> tuple[Loop, ...]:
    if len(single) < 3 or rng.random() < 0.5:
        return ()
    polynomial = (0.1, 0.8, 0.05, -0.02, 0.01)
    second = "tendon" if rng.random() < 0.5 else ""
    return (
        Loop(name="coupling", type="joint", first=single[1].name, second=single[2].name, polynomial=polynomial),
        Loop(name="lengths", type="tendon", first="string", second=second, polynomial=polynomial),
    )


def _joined(rng: np.random.Generator, made: Sequence[Body]) -> tuple[Loop, ...]:
    """Points of two bodies, or of one and the world, that are to meet; or their axes too."""
    if rng.random() < 0.5:
        return ()
    ends = (made[-1].name, str(rng.choice(["", *(body.name for body in made[:-1])])))
    loop = Loop(name="joined", type="connect", first=ends[0], second=ends[1], first_position=tuple(rng.normal(size=3)),
                second_position=tuple(rng.normal(size=3)))  # fmt: skip
    if rng.random() < 0.5:
        loop = replace(loop, type="weld", orientation=_unit(rng, 4), torque_scale=float(rng.uniform(0.1, 3.0)))
    return (loop,)


def _actuators(rng: np.random.Generator, joints: Sequence[Joint]) -> tuple[Actuator, ...]:
    made = []
    for i, joint in enumerate(joints):
        if joint.type == "free" or rng.random() < 0.4:
            continue
        made.append(Actuator(
            name=f"actuator {i}", joint=joint.name, gear=tuple(rng.normal(size=WIDTHS[joint.type][1])),
            gain=tuple(rng.normal(size=3) if joint.type in SINGLE else (1.0, 0.0, 0.0)),
            bias=tuple(rng.normal(size=3) if joint.type in SINGLE else (0.0, 0.0, 0.0)),
            control_range=(-1.0, 2.0), force_range=(-4.0, 4.0),
            armature=0.05, damping=0.3,
        ))  # fmt: skip
    return tuple(made)


def _winches(tendons: Sequence[Tendon]) -> tuple[Actuator, ...]:
    """One along every second tendon."""
    return tuple(
        Actuator(
            name=f"winch {tendon.name}", tendon=tendon.name, gear=(1.4,), gain=(0.8, -0.2, 0.1), bias=(0.3, -0.6, -0.2),
            damping=0.25, force_range=(-4.0, 4.0),
        )
        for tendon in tendons[::2]
    )  # fmt: skip


def _pushes(rng: np.random.Generator, joints: Sequence[Joint]) -> tuple[Push, ...]:
    """On two bodies that move, or twice on one."""
    bodies = rng.choice([joint.body for joint in joints], size=2 if rng.random() < 0.5 else 0)
    return tuple(Push(name=f"push {i}", body=str(body)) for i, body in enumerate(bodies))


def _contacts(rng: np.random.Generator, made: Sequence[Body], joints: Sequence[Joint]) -> dict[str, tuple]:
    """Return a plane and a shape on every body, and the pairs that have rows."""
    shapes = [_shape(rng, "floor", "", "plane")]
    shapes += [_shape(rng, f"shape {i}", body.name, str(rng.choice(KINDS))) for i, body in enumerate(made)]
    carriers = {"": ""}
    for body in made:
        moving = any(joint.body == body.name for joint in joints)
        carriers[body.name] = body.name if moving else carriers[body.parent]
    pairs = [
        Pair(name=f"{one.name}:{two.name}", first=one.name, second=two.name, margin=float(rng.uniform(0.0, 0.1)))
        for one, two in combinations(shapes, 2)
        if ((one.type, two.type) in PLACES or (two.type, one.type) in PLACES)
        and carriers[one.body] != carriers[two.body]
    ]
    hulls = [_hull(made[-1])] if carriers[made[-1].name] else []
    return {"shapes": (*shapes, *hulls), "pairs": (*pairs[::3], *(_over(shapes[0], hull) for hull in hulls))}


def _hull(body: Body) -> Shape:
    """Return an octahedron on a body; by numbers of its own, which leave those of the other parts as they were."""
    rng = np.random.default_rng(int(1e6 * body.mass))
    corners = np.concatenate([np.eye(3), -np.eye(3)]) * rng.uniform(0.1, 0.4, (6, 1))
    return Shape(
        name="hull", body=body.name, type="hull", corners=tuple(map(tuple, np.float32(corners).tolist())),
        position=tuple(rng.normal(size=3)), orientation=_unit(rng, 4),
    )  # fmt: skip


def _over(floor: Shape, hull: Shape) -> Pair:
    return Pair(name=f"{floor.name}:{hull.name}", first=floor.name, second=hull.name, margin=0.05)


def _shape(rng: np.random.Generator, name: str, body: str, kind: str) -> Shape:
    return Shape(
        name=name, body=body, type=kind, size=tuple(rng.uniform(0.1, 0.4, 3)), position=tuple(rng.normal(size=3)),
        orientation=_unit(rng, 4),
    )  # fmt: skip
