"""What a robot file says, computed from its scene by the reference's own dynamics: the yardstick of all importers.

It has the form of an importer's answer (`crossbody.engines.importers`), so that one may stand for the other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import accumulate, pairwise
from types import MappingProxyType
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import UNBOUNDED, UPRIGHT, WIDTHS, Body, Joint, Scene, Shape, Tendon
from crossbody.cases.scene_contacts import softness
from crossbody.engines.importers.beside.solids import boxes, composite, posed
from crossbody.reports.scenes.scene import body_poses

SEED, DRAWN, KEYS = 20241123, 4, 4
"""Of the random states, their number, and how many keyframes stand beside them."""


def job_of(scene: Scene, keys: Mapping[str, Floats] = MappingProxyType({})) -> dict[str, Any]:
    """Return joints, keyframes, and states at which importers are compared: at random and at the first keyframes.

    Args:
        scene: whose coordinates they are.
        keys: name of every keyframe -> positions (nq,).
    """
    draw = np.random.default_rng(SEED)
    joints = [[joint.name, joint.body, joint.type] for joint in scene.joints]
    positions = [[_drawn(joint, draw) for joint in scene.joints] for _ in range(DRAWN)]
    ends = np.cumsum([0, *(WIDTHS[joint.type][0] for joint in scene.joints)])
    held = {name: [np.asarray(q)[a:b].tolist() for a, b in pairwise(ends)] for name, q in keys.items()}
    positions += [*held.values()][:KEYS]
    widths = [WIDTHS[joint.type][1] for joint in scene.joints]
    states = [{"q": q, "v": [draw.normal(size=width).tolist() for width in widths]} for q in positions]
    return {"joints": joints, "states": states, "keys": held}


def _drawn(joint: Joint, draw: np.random.Generator) -> list[float]:
    """Return positions of a joint; turns stay below the ones at which three angles are singular."""
    if joint.type in ("slide", "hinge"):
        return [joint.reference + float(draw.uniform(-1.0, 1.0))]
    turn = draw.uniform(-0.6, 0.6, 3)
    angle = float(np.linalg.norm(turn))
    quaternion = [float(np.cos(angle / 2)), *(np.sin(angle / 2) * turn / angle).tolist()]
    return [*draw.uniform(-1.0, 1.0, 3).tolist(), *quaternion] if joint.type == "free" else quaternion


def expected(scene: Scene, job: dict[str, Any], touching: Sequence[str] | None = None) -> dict[str, Any]:
    """Return the answer of a reader without fault.

    Of shapes some may touch something; without their names neither shapes nor contacts are told.
    """
    states = [
        (np.concatenate([np.zeros(0), *state["q"]]), np.concatenate([np.zeros(0), *state["v"]]))
        for state in job["states"]
    ]
    poses = body_poses(scene, np.array([q for q, _ in states]))
    frames = [
        {name: [p[k].tolist(), R[k].tolist()] for name, (p, R) in poses.items() if name} for k in range(len(states))
    ]
    solids = [shape for shape in scene.shapes if shape.name in (touching or ())]
    numbers, by = {shape.name: k for k, shape in enumerate(solids)}, moved_by(scene)
    moved = {joint.name: joint.body for joint in scene.joints}
    pairs = [pair for pair in scene.pairs if pair.first in numbers and pair.second in numbers]
    of_states = [
        at | {"frames": here, "ends": _ends(scene, here),
              "tendons": {part.name: _length(part, scene, q, here) for part in scene.tendons}}
        for at, here, (q, _) in zip(_dynamics(scene, states, frames), frames, states, strict=True)
    ]  # fmt: skip
    return {
        "status": "read", "version": "", "hidden": {}, "missing": [], "extra": [], "told": [],
        "precision": 0.0, "unseen": {} if touching is not None else {"shapes": "", "contacts": ""},
        "numbers": _numbers(scene),
        "actuators": {part.name: _moved(part.joint, part.tendon, scene) for part in scene.actuators},
        "loops": [[loop.type, [] if loop.in_space else [one for one in (loop.first, loop.second) if one],
                   [] if loop.in_space else list(loop.polynomial)] for loop in scene.loops],
        "tendons": {part.name: [*part.damping, *part.stiffness, part.friction_loss, *part.rest, *part.range]
                    for part in scene.tendons},
        "shapes": [[shape.name, "mesh" if shape.corners else shape.type, by.get(shape.body, ""),
                    _boxes(shape, frames[0], moved.get(by.get(shape.body, "")))] for shape in solids],
        "contacts": [[numbers[pair.first], numbers[pair.second]] for pair in pairs],
        "surfaces": [
            [*(mu if k < pair.dimension - 1 else 0.0 for k, mu in enumerate(pair.friction)), pair.margin]
            for pair in pairs
        ],
        "softness": softness(scene, pairs),
        "inertias": _inertias(scene, frames[0]),
        "keys": {name: [np.concatenate(q).tolist()] * 2 for name, q in job["keys"].items()},
        "states": of_states,
    }  # fmt: skip


def _standing(frame: Any, position: Sequence[float], orientation: Sequence[float]) -> tuple[Floats, Floats]:
    p, R = map(np.array, frame)
    return p + R @ np.array(position), R @ matrices(np.array(orientation))


WORLD = [[0.0] * 3, np.eye(3).tolist()]


def _ends(scene: Scene, frames: Any) -> list[Any]:
    """Return of each loop the frames whose origins or which it holds together; of coupled joints none."""
    told = []
    for loop in scene.loops:
        sides = ((loop.first, loop.first_position, loop.orientation), (loop.second, loop.second_position, UPRIGHT))
        placed = [posed(*_standing(frames.get(body, WORLD), at, turn)) for body, at, turn in sides]
        told.append(placed if loop.in_space else [])
    return told


def _boxes(shape: Shape, frames: Any, body: str | None) -> list[list[float]]:
    place = _standing(frames.get(shape.body, WORLD), shape.position, shape.orientation)
    kind = "mesh" if shape.corners else shape.type
    return boxes(kind, shape.size, shape.corners, *place, frames.get(body, WORLD))


def _length(tendon: Tendon, scene: Scene, q: Floats, frames: Any) -> float:
    if tendon.bodies:
        ends = [_standing(frames.get(body, WORLD), at, UPRIGHT)[0] for body, at in zip(tendon.bodies, tendon.positions,
                                                                                       strict=True)]  # fmt: skip
        return float(np.linalg.norm(ends[1] - ends[0]))
    at = dict(zip((joint.name for joint in scene.joints), accumulate(
        (WIDTHS[joint.type][0] for joint in scene.joints), initial=0), strict=False))  # fmt: skip
    return float(sum(c * q[at[name]] for name, c in zip(tendon.joints, tendon.coefficients, strict=True)))


def _moved(joint: str, tendon: str, scene: Scene) -> list[str]:
    """Return the joints of an actuator; on a tendon of two points none is named."""
    return [joint] if joint else sorted(next(part for part in scene.tendons if part.name == tendon).joints)


def _numbers(scene: Scene) -> dict[str, dict[str, list[float]]]:
    def single(joint: Joint) -> bool:
        return joint.type in ("slide", "hinge")

    def of_motors(key: str, joint: Joint) -> float:
        return float(sum(a.gear[0] ** 2 * getattr(a, key) for a in scene.actuators if a.joint == joint.name))

    of: dict[str, Callable[[Joint], Any]] = {
        "armature": lambda j: j.armature + of_motors("armature", j), "friction": lambda j: j.friction_loss,
        "damping": lambda j: j.damping[0] + of_motors("damping", j), "damping v|v|": lambda j: j.damping[1],
        "damping v^3": lambda j: j.damping[2], "stiffness": lambda j: j.stiffness[0],
        "stiffness x^2": lambda j: j.stiffness[1], "stiffness x^3": lambda j: j.stiffness[2],
        "rest": lambda j: j.rest if any(j.stiffness) and j.type != "free" else (),
        "lower": lambda j: j.range[0] if single(j) else -np.inf, "upper": lambda j: j.range[1],
        "least force": lambda j: j.force_range[0], "most force": lambda j: j.force_range[1],
    }  # fmt: skip
    return {
        key: {joint.name: [float(x) for x in np.atleast_1d(value(joint))] for joint in scene.joints}
        for key, value in of.items()
    }


def moved_by(scene: Scene) -> dict[str, str]:
    """Return for every body that moves the last joint above it or of its own."""
    own = {joint.body: joint.name for joint in scene.joints}
    found: dict[str, str] = {}
    for body in scene.bodies:
        joint = own.get(body.name) or found.get(body.parent)
        if joint:
            found[body.name] = joint
    return found


def _inertias(scene: Scene, frames: dict[str, Any]) -> dict[str, Any]:
    by, parts = moved_by(scene), dict[str, list[Any]]()
    for body in scene.bodies:
        if body.name in by:
            parts.setdefault(by[body.name], []).append((by[body.name], *_placed(body, frames[body.name])))
    last = {joint.name: joint.body for joint in scene.joints if joint.name in parts}
    return {name: composite(parts[name], *frames[body]) for name, body in last.items()}


def _placed(body: Body, frame: Any) -> tuple[float, Floats, Floats]:
    p, R = map(np.array, frame)
    xx, yy, zz, xy, xz, yz = body.inertia
    return body.mass, p + R @ np.array(body.com), R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T


def _light(scene: Scene) -> Scene:
    """Return the scene with bodies of unit inertia and no weight, in whose forces those of actuators lose no digits."""
    unit: dict[str, Any] = {"mass": 1.0, "com": (0.0,) * 3, "inertia": (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)}
    return scene.replace(bodies=tuple(replace(body, **unit) for body in scene.bodies), gravity=(0.0,) * 3)


def _dynamics(scene: Scene, states: Sequence[tuple[Floats, Floats]], frames: Sequence[Any]) -> list[dict[str, Any]]:
    """Return M, bias, gravity and energy at every state."""
    from crossbody.reference.tree import mechanism
    from crossbody.reference.tree.table import tabulate

    nothing: dict[str, Any] = {"damping": (0.0,) * 3, "stiffness": (0.0,) * 3, "friction_loss": 0.0,
                               "force_range": UNBOUNDED}  # fmt: skip
    slack = {key: value for key, value in nothing.items() if key != "force_range"} | {"range": UNBOUNDED}
    plain: dict[str, Any] = {"armature": 0.0, "damping": 0.0, "activation": "", "time_constant": 0.0} | dict.fromkeys(
        ("control_range", "force_range", "activation_range"), UNBOUNDED)  # fmt: skip
    bare = scene.replace(
        joints=tuple(replace(joint, **nothing) for joint in scene.joints), loops=(), pairs=(),
        shapes=(), pushes=(), tendons=tuple(replace(part, **slack) for part in scene.tendons),
        actuators=tuple(replace(part, **plain) for part in scene.actuators),
    )  # fmt: skip
    heavy, light, n = tabulate(bare), tabulate(_light(bare)), scene.nv
    none, units = np.zeros(len(scene.actuators)), np.eye(len(scene.actuators))
    widths = [WIDTHS[joint.type][1] for joint in scene.joints]
    motors = np.repeat([value for (value,) in _numbers(scene)["armature"].values()], widths)
    own = np.repeat([joint.armature for joint in scene.joints], widths)

    def of(q: Floats, v: Floats, u: Floats, table: Any = heavy) -> tuple[Floats, Floats]:
        M, f = np.zeros((n, n)), np.zeros(n)
        mechanism.dynamics(0.0, q, v, u, table.p, M, f, np.zeros(table.scratch))
        return M + np.diag(motors - own), f

    found = []
    for (q, v), here in zip(states, frames, strict=True):
        M, free = of(q, v, np.zeros(0))
        held, alone = (of(q, v, u, light)[1] for u in (none, np.zeros(0)))
        weight = sum(m * np.array(scene.gravity) @ c for m, c, _ in (_placed(b, here[b.name]) for b in scene.bodies))
        found.append(
            {
                "M": M.tolist(),
                "bias": (-free).tolist(),
                "gravity": (-of(q, np.zeros(n), np.zeros(0))[1]).tolist(),
                "energy": float(v @ M @ v / 2 - weight),
                "v": v.tolist(),
                "held": (held - alone).tolist(),
                "driven": {
                    part.name: (of(q, v, unit, light)[1] - held).tolist()
                    for part, unit in zip(scene.actuators, units, strict=True)
                },
            }
        )
    return found
