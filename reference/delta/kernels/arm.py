"""One arm of the delta robot: position, Jacobian, inertia and forces.

The proximal link moves its end along n = (0, -s1, c1); the distal link points along d = (s2 s3, c2, s2
c3) and turns about it along e2 = (c2 s3, -s2, c2 c3) and e3 = (c3, 0, -s3), which are orthonormal with
d. A sextuple `T` holds (c1, s1, c2, s2, c3, s3); everything is a scalar, so that nothing is allocated.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import kernels
from crossbody.reference.kinds import Array

# Places in the parameter array.
NAMES = ("r_base", "r_flange", "l1", "l2", "m1", "m2", "m3", "jm", "g", "d1", "d2", "d3", "sign")
SIZE = len(NAMES)

_THIRD = 1 / 3
_COS = (1.0, -0.5, -0.5)
_SIN = (0.0, -(0.75**0.5), 0.75**0.5)


@kernels.helper
def geometry(p: Array) -> Any:
    """R = r_base - r_flange, l1, l2 and the sign of the arms' rotation."""
    return p[0] - p[1], p[2], p[3], p[12]


@kernels.helper
def inertia(p: Array) -> Any:
    """Inertias of the upper link and what it carries, of both together, and of the lower link, kg m^2."""
    l1, l2, m1, m2, m3 = p[2], p[3], p[4], p[5], p[6]
    third = m3 * _THIRD
    return (m1 * _THIRD + m2 + third) * l1 * l1 + p[7], (0.5 * m2 + third) * l1 * l2, (m2 * _THIRD + third) * l2 * l2


@kernels.helper
def weights(p: Array) -> Any:
    """(m1/2 + m2 + m3/3) g l1 and (m2/2 + m3/3) g l2: V = -(first s1 + second s2 c3), N m."""
    third = p[6] * _THIRD
    return (0.5 * p[4] + p[5] + third) * p[8] * p[2], (0.5 * p[5] + third) * p[8] * p[3]


@kernels.helper
def _cosine_and_sine(a: Any) -> Any:
    """Of the real part, continued by their derivatives: a complex step needs no more, and both cost one evaluation."""
    c, s, step = np.cos(a.real), np.sin(a.real), a - a.real
    return c - s * step, s + c * step


@kernels.helper
def trig(q: Array, i: int) -> Any:
    """T of arm i."""
    c1, s1 = _cosine_and_sine(q[3 * i])
    c2, s2 = _cosine_and_sine(q[3 * i + 1])
    c3, s3 = _cosine_and_sine(q[3 * i + 2])
    return c1, s1, c2, s2, c3, s3


@kernels.helper
def turn(i: int, sign: Any) -> Any:
    """Cosine and sine of the rotation of arm i about z: 0, -sign 120, +sign 120 degrees."""
    return _COS[i], sign * _SIN[i]


@kernels.helper
def rotate(cs: Any, a: Any) -> Any:
    """Rz a."""
    return cs[0] * a[0] - cs[1] * a[1], cs[1] * a[0] + cs[0] * a[1], a[2]


@kernels.helper
def rotate_back(cs: Any, a: Any) -> Any:
    """Rz^T a."""
    return cs[0] * a[0] + cs[1] * a[1], cs[0] * a[1] - cs[1] * a[0], a[2]


@kernels.helper
def psi(T: Any, r: Any, l1: Any, l2: Any) -> Any:
    """Tip of the arm in its own frame, m."""
    c1, s1, c2, s2, c3, s3 = T
    return l2 * s2 * s3, r + l1 * c1 + l2 * c2, l1 * s1 + l2 * s2 * c3


@kernels.helper
def dpsi(T: Any, l1: Any, l2: Any) -> Any:
    """The three rows of dpsi/dq_i."""
    c1, s1, c2, s2, c3, s3 = T
    zero = 0.0 * l1
    return (
        (zero, l2 * c2 * s3, l2 * s2 * c3),
        (-l1 * s1, -l2 * s2, zero),
        (l1 * c1, l2 * c2 * c3, -l2 * s2 * s3),
    )


@kernels.helper
def tip(T: Any, l1: Any, l2: Any, a: Any, b: Any, ws: Any) -> Any:
    """The tip's velocity for the rates a, b and ws = s2 w: l1 n a + l2 (e2 b + e3 ws), m/s."""
    c1, s1, c2, s2, c3, s3 = T
    x, y = l2 * b, l2 * ws
    return c2 * s3 * x + c3 * y, -l1 * s1 * a - s2 * x, l1 * c1 * a + c2 * c3 * x - s3 * y


@kernels.helper
def velocity(T: Any, l1: Any, l2: Any, a: Any, b: Any, w: Any) -> Any:
    """The tip's velocity dpsi v, m/s."""
    return tip(T, l1, l2, a, b, T[3] * w)


@kernels.helper
def curvature(T: Any, l1: Any, l2: Any, a: Any, b: Any, w: Any) -> Any:
    """(dpsi)' v, the tip's acceleration at constant v, m/s^2."""
    c1, s1, c2, s2, c3, s3 = T
    turning, bending = b * b + w * w, 2 * c2 * b * w
    return (
        l2 * (-s2 * s3 * turning + bending * c3),
        -l1 * c1 * a * a - l2 * c2 * b * b,
        -l1 * s1 * a * a - l2 * (s2 * c3 * turning + bending * s3),
    )


@kernels.helper
def pull_back(T: Any, l1: Any, l2: Any, g: Any) -> Any:
    """Dpsi^T g: the generalised force of a force g at the tip, the third component divided by s2."""
    c1, s1, c2, s2, c3, s3 = T
    return (
        l1 * (c1 * g[2] - s1 * g[1]),
        l2 * (c2 * s3 * g[0] - s2 * g[1] + c2 * c3 * g[2]),
        l2 * (c3 * g[0] - s3 * g[2]),
    )


@kernels.helper
def gravity(T: Any, k1: Any, k2: Any) -> Any:
    """DV/dq of the arm for the weights k1, k2, N m."""
    c1, _, c2, s2, c3, s3 = T
    return -k1 * c1, -k2 * c2 * c3, k2 * s2 * s3


@kernels.helper
def centrifugal(T: Any, B: Any, C: Any, a: Any, b: Any, w: Any) -> Any:
    """The terms that are quadratic in the velocities, N m."""
    c1, s1, c2, s2, c3, s3 = T
    return (
        B * ((s1 * c2 - c1 * s2 * c3) * b * b - c1 * s2 * c3 * w * w - 2 * c1 * c2 * s3 * b * w),
        B * (c1 * s2 - s1 * c2 * c3) * a * a - C * s2 * c2 * w * w,
        B * s1 * s2 * s3 * a * a + 2 * C * s2 * c2 * b * w,
    )


@kernels.helper
def mass(T: Any, B: Any) -> Any:
    """M12 = Bc P and M13 = Bc Q."""
    c1, s1, c2, s2, c3, s3 = T
    return B * (s1 * s2 + c1 * c2 * c3), -B * c1 * s2 * s3
