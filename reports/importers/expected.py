"""What a robot file says, computed from its scene by the reference's own dynamics: the yardstick of all importers.

It has the form of an importer's answer (`crossbody.engines.importers`), so that one may stand for the other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.scene import WIDTHS, Body, Joint, Scene
from crossbody.engines.importers.process import composite
from crossbody.reports.scenes._kinematics import body_poses

SEED, DRAWN = 20241123, 4
"""Of the random states, and their number."""


def job_of(scene: Scene, starts: Sequence[Floats] = ()) -> dict[str, Any]:
    """Return joints and states at which importers are compared: random ones, and those given, with random velocities.

    Args:
        scene: whose coordinates they are.
        starts: positions (nq,), keyframes say.
    """
    draw = np.random.default_rng(SEED)
    joints = [[joint.name, joint.body, joint.type] for joint in scene.joints]
    positions = [[_drawn(joint, draw) for joint in scene.joints] for _ in range(DRAWN)]
    ends = np.cumsum([0, *(WIDTHS[joint.type][0] for joint in scene.joints)])
    positions += [[q[a:b].tolist() for a, b in pairwise(ends)] for q in starts]
    widths = [WIDTHS[joint.type][1] for joint in scene.joints]
    states = [{"q": q, "v": [draw.normal(size=width).tolist() for width in widths]} for q in positions]
    return {"joints": joints, "states": states}


def _drawn(joint: Joint, draw: np.random.Generator) -> list[float]:
    """Return positions of a joint; turns stay below the ones at which three angles are singular."""
    if joint.type in ("slide", "hinge"):
        return [joint.reference + float(draw.uniform(-1.0, 1.0))]
    turn = draw.uniform(-0.6, 0.6, 3)
    angle = float(np.linalg.norm(turn))
    quaternion = [float(np.cos(angle / 2)), *(np.sin(angle / 2) * turn / angle).tolist()]
    return [*draw.uniform(-1.0, 1.0, 3).tolist(), *quaternion] if joint.type == "free" else quaternion


def expected(scene: Scene, job: dict[str, Any]) -> dict[str, Any]:
    """Return the answer of a reader without fault."""
    states = [
        (np.concatenate([np.zeros(0), *state["q"]]), np.concatenate([np.zeros(0), *state["v"]]))
        for state in job["states"]
    ]
    poses = body_poses(scene, np.array([q for q, _ in states]))
    frames = [
        {name: [p[k].tolist(), R[k].tolist()] for name, (p, R) in poses.items() if name} for k in range(len(states))
    ]
    return {
        "status": "read", "version": "", "hidden": {}, "missing": [], "extra": [], "told": [], "precision": 0.0,
        "numbers": _numbers(scene),
        "actuators": {part.name: _moved(part.joint, part.tendon, scene) for part in scene.actuators},
        "loops": len(scene.loops),
        "inertias": _inertias(scene, frames[0]),
        "states": [at | {"frames": here} for at, here in zip(_dynamics(scene, states, frames), frames, strict=True)],
    }  # fmt: skip


def _moved(joint: str, tendon: str, scene: Scene) -> list[str]:
    return [joint] if joint else sorted(next(part for part in scene.tendons if part.name == tendon).joints)


def _numbers(scene: Scene) -> dict[str, dict[str, list[float]]]:
    def single(joint: Joint) -> bool:
        return joint.type in ("slide", "hinge")

    motors = {
        joint.name: sum(a.gear[0] ** 2 * a.armature for a in scene.actuators if a.joint == joint.name)
        for joint in scene.joints
    }
    of: dict[str, Callable[[Joint], float]] = {
        "armature": lambda j: j.armature + motors[j.name], "damping": lambda j: j.damping[0],
        "stiffness": lambda j: j.stiffness[0], "rest": lambda j: j.rest[0] if single(j) and any(j.stiffness) else 0.0,
        "lower": lambda j: j.range[0] if single(j) else -np.inf, "upper": lambda j: j.range[1],
        "friction": lambda j: j.friction_loss,
    }  # fmt: skip
    return {key: {joint.name: [float(value(joint))] for joint in scene.joints} for key, value in of.items()}


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


def _dynamics(scene: Scene, states: Sequence[tuple[Floats, Floats]], frames: Sequence[Any]) -> list[dict[str, Any]]:
    """Return M, bias, gravity and energy at every state."""
    from crossbody.reference.tree import mechanism
    from crossbody.reference.tree.table import tabulate

    nothing: dict[str, Any] = {"damping": (0.0,) * 3, "stiffness": (0.0,) * 3, "friction_loss": 0.0}
    bare = scene.replace(
        joints=tuple(replace(joint, **nothing) for joint in scene.joints), tendons=(), loops=(), pairs=(), shapes=(),
        pushes=(), actuators=(),
    )  # fmt: skip
    table = tabulate(bare)
    w, n = np.zeros(table.scratch), scene.nv
    widths = [WIDTHS[joint.type][1] for joint in scene.joints]
    motors = np.repeat([value for (value,) in _numbers(scene)["armature"].values()], widths)
    own = np.repeat([joint.armature for joint in scene.joints], widths)

    def of(q: Floats, v: Floats) -> tuple[Floats, Floats]:
        M, f = np.zeros((n, n)), np.zeros(n)
        mechanism.dynamics(0.0, q, v, np.zeros(0), table.p, M, f, w)
        return M + np.diag(motors - own), -f

    found = []
    for (q, v), here in zip(states, frames, strict=True):
        M, bias = of(q, v)
        weight = sum(m * np.array(scene.gravity) @ c for m, c, _ in (_placed(b, here[b.name]) for b in scene.bodies))
        found.append(
            {
                "M": M.tolist(),
                "bias": bias.tolist(),
                "gravity": of(q, np.zeros(n))[1].tolist(),
                "energy": float(v @ M @ v / 2 - weight),
                "v": v.tolist(),
            }
        )
    return found
