"""How engines write the coordinates of joints, and the rotations that stand behind that.

Velocities of the scene are v = J v_e of the engine's, with v' = J v_e' + bend: M_e = J^T M J, b_e
= J^T (b + M bend).
"""

from __future__ import annotations

from typing import Any

import numpy as np


def rotation(quaternion: Any) -> Any:
    """Return the matrix of a quaternion (w first)."""
    w, x, y, z = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def rotation_vector(quaternion: Any) -> Any:
    """Return axis times angle of a quaternion (w first)."""
    unit = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    unit = -unit if unit[0] < 0.0 else unit
    length = np.linalg.norm(unit[1:])
    return unit[1:] * (2.0 * np.arctan2(length, unit[0]) / length if length else 2.0)


def roll_pitch_yaw(quaternion: Any) -> Any:
    """Return the angles about fixed axes x, y, z of a quaternion (w first)."""
    R = rotation(quaternion)
    return np.array(
        [np.arctan2(R[2, 1], R[2, 2]), np.arcsin(np.clip(-R[2, 0], -1.0, 1.0)), np.arctan2(R[1, 0], R[0, 0])]
    )


def _x_first(quaternion: Any) -> Any:
    return np.roll(quaternion, -1)


def _free_body(q: Any, v: Any) -> Any:
    R, J, bend = rotation(q[3:]), np.eye(6), np.zeros(6)
    J[:3, :3] = R
    bend[:3] = R @ np.cross(v[3:], v[:3])
    return np.concatenate([q[:3], _x_first(q[3:])]), J, bend


def _free_world(q: Any, angles_first: Any) -> Any:
    J = np.zeros((6, 6))
    J[:3, 3:], J[3:, :3] = np.eye(3), rotation(q[3:]).T
    return np.concatenate([angles_first, q[:3]]), J, np.zeros(6)


CONVENTIONS: dict[str, Any] = {
    "mujoco": lambda q, v: (np.asarray(q, dtype=float), np.eye(len(v)), np.zeros(len(v))),
    "p, xyzw; body, body": _free_body,
    "wxyz, p; world, world": lambda q, v: _free_world(q, q[3:]),
    "rotation vector, p; world, world": lambda q, v: _free_world(q, rotation_vector(q[3:])),
    "p, xyzw; world, world": lambda q, v: (
        np.concatenate([q[:3], _x_first(q[3:])]), np.block([[np.eye(3), np.zeros((3, 3))],
                                                            [np.zeros((3, 3)), rotation(q[3:]).T]]), np.zeros(6)),
    "xyzw; body": lambda q, v: (_x_first(q), np.eye(3), np.zeros(3)),
    "xyzw; parent": lambda q, v: (_x_first(q), rotation(q).T, np.zeros(3)),
    "rpy; parent": lambda q, v: (roll_pitch_yaw(q), rotation(q).T, np.zeros(3)),
    "rotation vector; body": lambda q, v: (rotation_vector(q), np.eye(3), np.zeros(3)),
    "unbounded": lambda q, v: (np.array([np.cos(q[0]), np.sin(q[0])]), np.eye(1), np.zeros(1)),
}  # fmt: skip
"""How an engine writes a joint -> (q, v of the scene) -> its q, J, J' v_e."""
