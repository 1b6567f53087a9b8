"""Motor torques for an acceleration of the delta robot's flange, for runs on a scene, which must not borrow those.

From the equations of the robot alone, as in `controller`: with y the motor angles, x the six others,
h(y, x) = 0 the closed loops and S = [I; -h_x^-1 h_y],

    u = My Jy^-1 a + tau_g     My = S^T M S     Jy = dz/dy along the loops     tau_g = S^T dV/dq
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from crossbody.cases.arrays import Floats

COS = (1.0, -0.5, -0.5)
SIN = (0.0, -(0.75**0.5), 0.75**0.5)
"""Of what turns each arm's frame into the base's about z, the sine times the robot's sign."""


def numbers(p: Mapping[str, float]) -> Floats:
    """Return what `motor_torque` reads: thin uniform rods, a third of the flange at each tip."""
    m1, m2, m3, l1, l2 = (p[name] for name in ("m1", "m2", "m3", "l1", "l2"))
    inertia = (m1 / 3 + m2 + m3 / 3) * l1**2 + p["jm"], (m2 / 2 + m3 / 3) * l1 * l2, (m2 + m3) / 3 * l2**2
    weight = (m1 / 2 + m2 + m3 / 3) * l1 * p["gravity"], (m2 / 2 + m3 / 3) * l2 * p["gravity"]
    return np.array([l1, l2, p["sign"], *inertia, *weight], dtype=np.float64)


def motor_torque(y: Floats, x: Floats, asked: Floats, p: Floats, u: Floats) -> None:
    """Write the torques (3,), N m; NaN where the loops or the flange lose a direction.

    Args:
        y: motor angles (3,).
        x: the six other angles, arm by arm.
        asked: acceleration of the flange (3,), m/s^2.
        p: `numbers` of the robot.
        u: receives the torques.
    """
    l1, l2, sign, a, b, c, upper, lower = p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7]
    J, M, pull = np.zeros((3, 3, 3)), np.zeros((9, 9)), np.empty(9)
    for i in range(3):
        c1, s1, k = np.cos(y[i]), np.sin(y[i]), 3 * i
        c2, s2, c3, s3 = np.cos(x[2 * i]), np.sin(x[2 * i]), np.cos(x[2 * i + 1]), np.sin(x[2 * i + 1])
        J[i, 0, 1], J[i, 0, 2] = l2 * c2 * s3, l2 * s2 * c3
        J[i, 1, 0], J[i, 1, 1] = -l1 * s1, -l2 * s2
        J[i, 2, 0], J[i, 2, 1], J[i, 2, 2] = l1 * c1, l2 * c2 * c3, -l2 * s2 * s3
        cs, sn = COS[i], sign * SIN[i]
        for j in range(3):
            along, across = J[i, 0, j], J[i, 1, j]
            J[i, 0, j], J[i, 1, j] = cs * along - sn * across, sn * along + cs * across
        coupled, sideways = b * (s1 * s2 + c1 * c2 * c3), -b * c1 * s2 * s3
        M[k, k], M[k + 1, k + 1], M[k + 2, k + 2] = a, c, c * s2 * s2
        M[k, k + 1] = M[k + 1, k] = coupled
        M[k, k + 2] = M[k + 2, k] = sideways
        pull[k], pull[k + 1], pull[k + 2] = -upper * c1, -lower * c2 * c3, lower * s2 * s3
    hx, hy, S, Jy = np.zeros((6, 6)), np.zeros((6, 3)), np.zeros((9, 3)), np.zeros((3, 3))
    for r in range(3):
        hy[r, 0] = hy[3 + r, 0] = J[0, r, 0]
        hy[r, 1], hy[3 + r, 2] = -J[1, r, 0], -J[2, r, 0]
        for j in range(2):
            hx[r, j] = hx[3 + r, j] = J[0, r, 1 + j]
            hx[r, 2 + j], hx[3 + r, 4 + j] = -J[1, r, 1 + j], -J[2, r, 1 + j]
    u[:] = np.nan
    if np.linalg.det(hx) == 0.0:
        return
    X = np.linalg.solve(hx, hy)
    for i in range(3):
        S[3 * i, i] = 1.0
        S[3 * i + 1], S[3 * i + 2] = -X[2 * i], -X[2 * i + 1]
        Jy += J[i] @ S[3 * i : 3 * i + 3] / 3.0
    if np.linalg.det(Jy) == 0.0:
        return
    St = np.ascontiguousarray(S.T)
    u[:] = St @ (M @ (S @ np.linalg.solve(Jy, asked))) + St @ pull
