"""Continuous servos on the three motors: PD towards a reference that moves once, smoothly.

    u_i = kp (y_ref,i - y_i) + kd (y_ref,i' - y_i') + feed-forward

The feed-forward, if asked for, is the torque that holds the symmetric pose at y_ref with the
flange on the axis.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import kernels
from crossbody.reference.delta.kernels.arm import SIZE, geometry, weights
from crossbody.reference.kinds import Array

# Places in the parameter array, behind those of the mechanism.
NAMES = ("servo_kp", "servo_kd", "servo_start", "servo_end", "servo_feedforward")
FROM = SIZE + len(NAMES)
TO = FROM + 3
END = TO + 3
_KP, _KD, _START, _STOP, _FORWARD = range(SIZE, FROM)


@kernels.helper
def symmetric_torque(p: Array, y: Any) -> Any:
    """Torque on each motor that holds all three at y with the flange on the axis, N m.

    There l2 c2 = -(R + l1 cos y) and dq2/dy = -l1 sin y/(l2 s2), so that
    dV/dy = -k1 cos y + k2 c2 l1 sin y/(l2 s2).
    """
    r, l1, l2, _ = geometry(p)
    k1, k2 = weights(p)
    c2 = -(r + l1 * np.cos(y)) / l2
    return -k1 * np.cos(y) + k2 * c2 * l1 * np.sin(y) / (l2 * np.sqrt(1 - c2 * c2))


@kernels.helper
def ramp(t: float, p: Array) -> Any:
    """How far the reference has moved at t, 0 to 1, and its rate; speed and acceleration vanish at both ends."""
    start, stop = p[_START].real, p[_STOP].real
    if t >= stop:
        return 1.0, 0.0
    if t <= start:
        return 0.0, 0.0
    x, y = (t - start) / (stop - start), (stop - t) / (stop - start)
    return x * x * x * (10 - 15 * x + 6 * x * x), 30 * x * x * y * y / (stop - start)


@kernels.helper
def servo(p: Array, moved: Any, i: int, y: Any, yd: Any) -> Any:
    """Torque of the servo of arm i at its angle y and rate yd, N m; `moved` is the ramp at this time."""
    span = p[TO + i] - p[FROM + i]
    target = p[FROM + i] + moved[0] * span
    torque = p[_KP] * (target - y) + p[_KD] * (moved[1] * span - yd)
    return torque + symmetric_torque(p, target) if p[_FORWARD].real != 0.0 else torque
