"""Where the bodies of a scene are, at every sample at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import WIDTHS, Joint, Scene

Pose = tuple[Floats, Floats]  # origins (n, 3), m, and rotations (n, 3, 3) of one body


def body_poses(scene: Scene, q: Floats) -> Mapping[str, Pose]:
    """Return the pose at positions q (n, nq) of every body by its name, and of the world by the empty one."""
    found: dict[str, Pose] = {"": (np.zeros((len(q), 3)), np.tile(np.eye(3), (len(q), 1, 1)))}
    joints: dict[str, list[tuple[Joint, Floats]]] = {}
    at = 0
    for joint in scene.joints:
        width = WIDTHS[joint.type][0]
        joints.setdefault(joint.body, []).append((joint, q[:, at : at + width]))
        at += width
    for body in scene.bodies:
        pose = placed(found[body.parent], body.position, body.orientation)
        for joint, part in joints.get(body.name, ()):
            pose = _moved(pose, joint, part)
        found[body.name] = pose
    return found


def placed(pose: Pose, position: Sequence[float], orientation: Sequence[float]) -> Pose:
    """Return the pose of what stands so in a frame."""
    origin, rotation = pose
    return origin + rotation @ np.asarray(position), rotation @ matrices(np.asarray(orientation))


def _moved(pose: Pose, joint: Joint, q: Floats) -> Pose:
    """Return a body's pose behind one of its joints."""
    origin, rotation = pose
    if joint.type == "free":
        return q[:, :3], matrices(q[:, 3:])
    axis, anchor = np.asarray(joint.axis), np.asarray(joint.anchor)
    if joint.type == "slide":
        return origin + (q - joint.reference) * (rotation @ axis), rotation
    half = 0.5 * (q - joint.reference)
    turn = matrices(q if joint.type == "ball" else np.concatenate([np.cos(half), np.sin(half) * axis], axis=1))
    turned = rotation @ turn
    return origin + rotation @ anchor - turned @ anchor, turned
