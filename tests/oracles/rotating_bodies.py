"""Bodies whose positions are quaternions: kernels of their own, with the pull to length 1 as a parameter."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import System, kernels
from crossbody.reference.kinds import Array, Index

GRAVITY = 9.81
PULL = 0.1


@kernels.helper
def rotated(q: Array, at: int, a: Any, b: Any, c: Any) -> tuple[Any, Any, Any]:
    """Return a body's vector in world axes."""
    w, x, y, z = q[at], q[at + 1], q[at + 2], q[at + 3]
    n = 2.0 / (w * w + x * x + y * y + z * z)
    i, j, k = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        a + n * (w * i + y * k - z * j),
        b + n * (w * j + z * i - x * k),
        c + n * (w * k + x * j - y * i),
    )


@kernels.helper
def turning(q: Array, at: int, v: Array, to: int, pull: Any, qd: Array) -> None:
    """Fill q' = q w / 2 + pull (1 - |q|^2) q."""
    w, x, y, z = q[at], q[at + 1], q[at + 2], q[at + 3]
    a, b, c = 0.5 * v[to], 0.5 * v[to + 1], 0.5 * v[to + 2]
    g = pull * (1.0 - w * w - x * x - y * y - z * z)
    qd[at] = g * w - x * a - y * b - z * c
    qd[at + 1] = g * x + w * a + y * c - z * b
    qd[at + 2] = g * y + w * b + z * a - x * c
    qd[at + 3] = g * z + w * c + x * b - y * a


@kernels.dynamics
def free_dynamics(t: float, q: Array, v: Array, u: Array, p: Array, M: Array, f: Array, w: Array) -> None:
    """A body about its centre: velocity in the world, angular velocity in the body; p = m, I1, I2, I3, pull, g."""
    M[:, :] = 0.0
    for i in range(3):
        M[i, i], M[3 + i, 3 + i] = p[0], p[1 + i]
        f[i] = 0.0
    f[2] = -p[0] * p[5]
    f[3] = (p[2] - p[3]) * v[4] * v[5]
    f[4] = (p[3] - p[1]) * v[5] * v[3]
    f[5] = (p[1] - p[2]) * v[3] * v[4]


@kernels.velocity
def free_velocity(t: float, q: Array, v: Array, p: Array, qd: Array) -> None:
    """Position by the velocity, quaternion by the angular one."""
    for i in range(3):
        qd[i] = v[i]
    turning(q, 3, v, 3, p[4], qd)


@kernels.energy
def free_energy(q: Array, v: Array, p: Array, e: Array) -> None:
    """Of both motions; the height."""
    e[0] = 0.5 * p[0] * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    for i in range(3):
        e[0] += 0.5 * p[1 + i] * v[3 + i] * v[3 + i]
    e[1] = p[0] * p[5] * q[2]


@kernels.helper
def height(q: Array, at: int, a: Any, b: Any, c: Any) -> Any:
    """Return the vertical component of a body's vector."""
    return rotated(q, at, a, b, c)[2]


@kernels.gaps
def point_gaps(t: float, q: Array, v: Array, p: Array, h: Array, hd: Array) -> None:
    """Heights of points that are fixed to the body, at p[6:], over the floor."""
    for i in range(len(h)):
        o = 6 + 3 * i
        a, b, c = v[4] * p[o + 2] - v[5] * p[o + 1], v[5] * p[o] - v[3] * p[o + 2], v[3] * p[o + 1] - v[4] * p[o]
        h[i], hd[i] = q[2] + height(q, 3, p[o], p[o + 1], p[o + 2]), v[2] + height(q, 3, a, b, c)


@kernels.rows
def point_rows(
    t: float, q: Array, v: Array, p: Array, w: Array, idx: Index, na: int, H: Array, h: Array, Hdv: Array
) -> None:
    """h' = v_z + n (w x r) with the vertical n in body axes, so that H has r x n for the angular velocity."""
    none = 0.0 * q[0]
    n0, n1, n2 = (
        height(q, 3, none + 1, none, none),
        height(q, 3, none, none + 1, none),
        height(q, 3, none, none, none + 1),
    )
    for j in range(na):
        o = 6 + 3 * idx[j]
        r0, r1, r2 = p[o], p[o + 1], p[o + 2]
        h[j] = q[2] + height(q, 3, r0, r1, r2)
        H[j, 2] = 1.0
        H[j, 3], H[j, 4], H[j, 5] = r1 * n2 - r2 * n1, r2 * n0 - r0 * n2, r0 * n1 - r1 * n0
        a, b, c = v[4] * r2 - v[5] * r1, v[5] * r0 - v[3] * r2, v[3] * r1 - v[4] * r0
        Hdv[j] = n0 * (v[4] * c - v[5] * b) + n1 * (v[5] * a - v[3] * c) + n2 * (v[3] * b - v[4] * a)


@kernels.dynamics
def top_dynamics(t: float, q: Array, v: Array, u: Array, p: Array, M: Array, f: Array, w: Array) -> None:
    """A body on a ball joint, its centre below by p[0] along its third axis; p = lever m g, I1, I2, I3, pull."""
    M[:, :] = 0.0
    for i in range(3):
        M[i, i] = p[1 + i]
    none = 0.0 * q[0]
    x, y = height(q, 0, none + 1, none, none), height(q, 0, none, none + 1, none)
    f[0] = (p[2] - p[3]) * v[1] * v[2] - p[0] * y
    f[1] = (p[3] - p[1]) * v[2] * v[0] + p[0] * x
    f[2] = (p[1] - p[2]) * v[0] * v[1]
    if len(u) > 0:
        f[2] += u[0]


@kernels.velocity
def top_velocity(t: float, q: Array, v: Array, p: Array, qd: Array) -> None:
    """The quaternion alone."""
    turning(q, 0, v, 0, p[4], qd)


def free_body(
    inertia: tuple[float, float, float], *, mass: float = 1.0, gravity: float = 0.0, pull: float = PULL, **given: Any
) -> System:
    """A rigid body, q = (position, quaternion), v = (velocity in the world, angular velocity in the body)."""
    parameters = [mass, *inertia, pull, gravity]
    return System(
        n=6, nq=7, dynamics=free_dynamics, velocity=free_velocity, energy=free_energy, quaternions=[3],
        parameters=parameters, **given,
    )  # fmt: skip


def body_on_floor(points: Any, inertia: tuple[float, float, float], **given: Any) -> System:
    """A rigid body of mass 1 in gravity with points that may touch the floor."""
    parameters = [1.0, *inertia, PULL, GRAVITY, *np.ravel(points)]
    return System(
        n=6, nq=7, dynamics=free_dynamics, velocity=free_velocity, energy=free_energy, quaternions=[3],
        gaps=point_gaps, rows=point_rows, parameters=parameters, **given,
    )  # fmt: skip


def top(inertia: tuple[float, float, float], *, torque: float = 0.0, pull: float = PULL, **given: Any) -> System:
    """A body on a ball joint, q = quaternion, v = angular velocity in the body; `torque` is lever times weight."""
    return System(
        n=3, nq=4, dynamics=top_dynamics, velocity=top_velocity, parameters=[torque, *inertia, pull], **given,
    )  # fmt: skip
