"""Forces on the joints: springs, dampers, tendons and actuators; those between points come behind the poses."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import kernels
from crossbody.reference.cache import compiled
from crossbody.reference.kinds import Array
from crossbody.reference.tree import layout, strings


@kernels.helper
def clamped(x: Any, low: Any, high: Any) -> Any:
    """Return x within its bounds."""
    if x.real < low.real:
        return low + 0.0 * x
    return high + 0.0 * x if x.real > high.real else x


@compiled
def side(p: Array, bend: int) -> int:
    """Return on which side of the kink whose number stands at p[bend] a run is."""
    k = int(p[bend].real)
    return int(p[int(p[layout.AT_BEND].real) + k].real) if k >= 0 else layout.OPEN


@compiled
def held(x: Any, p: Array, o: int) -> Any:
    """Return x within the bounds at p[o:], as it is on the side of its kink that holds."""
    now = side(p, o + layout.BOUNDS_BEND)
    if now == layout.OPEN:
        return clamped(x, p[o], p[o + 1])
    if now == layout.INSIDE:
        return x
    return p[o + now - layout.LOW] + 0.0 * x


@kernels.helper
def turn(q: Array, at: int, p: Array, rest: int) -> tuple[Any, Any, Any]:
    """Return the rotation vector, in body axes, that leads from the quaternion at p[rest:] to the one at q[at:]."""
    a, b, c, d = p[rest], -p[rest + 1], -p[rest + 2], -p[rest + 3]
    e, f, g, h = q[at], q[at + 1], q[at + 2], q[at + 3]
    cos = a * e - b * f - c * g - d * h
    x, y, z = a * f + b * e + c * h - d * g, a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e
    square = x * x + y * y + z * z
    if square.real < 1e-24 * (cos * cos).real:
        return 2.0 * x / cos, 2.0 * y / cos, 2.0 * z / cos
    sin = np.sqrt(square)
    scale = 2.0 * np.arctan(sin / cos) / sin
    return scale * x, scale * y, scale * z


@kernels.helper
def spring(p: Array, k: int, x: Any) -> Any:
    """Return k0 x + k1 x^2 + k2 x^3 by the constants at p[k:]."""
    return x * (p[k] + x * (p[k + 1] + x * p[k + 2]))


@kernels.helper
def stored(p: Array, k: int, x: Any) -> Any:
    """Return the energy of such a spring."""
    return x * x * (p[k] / 2.0 + x * (p[k + 1] / 3.0 + x * p[k + 2] / 4.0))


@kernels.helper
def damper(p: Array, b: int, v: Any) -> Any:
    """Return b0 v + b1 v |v| + b2 v^3 by the constants at p[b:]."""
    now = side(p, b + layout.DAMPER_BEND)
    size = v if now == layout.HIGH or (now == layout.OPEN and v.real > 0.0) else -v
    return v * (p[b] + size * p[b + 1] + v * v * p[b + 2])


@kernels.helper
def length(q: Array, p: Array, o: int) -> Any:
    """Return the length of the tendon at p[o:]."""
    total = 0.0 * q[0]
    for j in range(int(p[o + layout.COUNT].real)):
        k = o + layout.FIRST + 3 * j
        total += p[k + 2] * q[int(p[k].real)]
    return total


@kernels.helper
def rate(v: Array, p: Array, o: int) -> Any:
    """Return how fast it changes."""
    total = 0.0 * v[0]
    for j in range(int(p[o + layout.COUNT].real)):
        k = o + layout.FIRST + 3 * j
        total += p[k + 2] * v[int(p[k + 1].real)]
    return total


@kernels.helper
def slack(p: Array, o: int, x: Any) -> Any:
    """Return how far a length is outside the dead band of the tendon at p[o:]."""
    return x - held(x, p, o + layout.BAND)


@kernels.helper
def tendon(p: Array, i: int) -> int:
    """Return where tendon i stands in p."""
    o = int(p[layout.AT_TENDON].real)
    for _ in range(i):
        o += layout.FIRST + 3 * abs(int(p[o + layout.COUNT].real))
    return o


@kernels.helper
def resisting(p: Array, o: int, x: Any, speed: Any) -> Any:
    """Return what spring and damper of the tendon at p[o:] do against its length."""
    return spring(p, o + layout.STIFF, slack(p, o, x)) + damper(p, o + layout.DAMP, speed)


@kernels.helper
def stretched(p: Array, w: Array, f: Array) -> None:
    """Add to f (n,) what springs and dampers between points do, by the poses in w."""
    for i in range(int(p[layout.TENDONS].real)):
        o = tendon(p, i)
        if p[o + layout.COUNT].real < 0.0:
            d = strings.between(p, o + layout.FIRST, w)[0]
            strings.along(p, o + layout.FIRST, w, -resisting(p, o, d[0], d[1]), f)


@kernels.helper
def measured(q: Array, v: Array, p: Array, w: Array, o: int) -> tuple[Any, Any]:
    """Return length and rate of the tendon at p[o:], by the poses in w if it is one between points."""
    if p[o + layout.COUNT].real < 0.0:
        d = strings.between(p, o + layout.FIRST, w)[0]
        return d[0], d[1]
    return length(q, p, o), rate(v, p, o)


@kernels.helper
def passive(q: Array, v: Array, p: Array, f: Array) -> None:
    """Fill f (n,) with what springs and dampers do, but those between points."""
    at_dof, at_node = int(p[layout.AT_DOF].real), int(p[layout.AT_NODE].real)
    for j in range(int(p[layout.DOFS].real)):
        f[j] = -damper(p, at_dof + layout.DOF * j + layout.DAMPING, v[j])
    for i in range(int(p[layout.NODES].real)):
        o = at_node + layout.NODE * i
        k = o + layout.STIFFNESS
        if p[k] == 0.0 and p[k + 1] == 0.0 and p[k + 2] == 0.0:
            continue
        at, j = int(p[o + layout.Q].real), int(p[o + layout.V].real)
        if p[o + layout.TYPE].real >= layout.SLIDE:
            f[j] -= spring(p, k, q[at] - p[o + layout.REST])
            continue
        if p[o + layout.TYPE].real == layout.FREE:
            at, j = at + 3, j + 3
        x, y, z = turn(q, at, p, o + layout.REST)
        size = np.sqrt(x * x + y * y + z * z)
        stiffness = p[k] + size * (p[k + 1] + size * p[k + 2])
        f[j], f[j + 1], f[j + 2] = f[j] - stiffness * x, f[j + 1] - stiffness * y, f[j + 2] - stiffness * z
    for i in range(int(p[layout.TENDONS].real)):
        o = tendon(p, i)
        if p[o + layout.COUNT].real > 0.0:
            pull(p, o, -resisting(p, o, length(q, p, o), rate(v, p, o)), f)


@kernels.helper
def pull(p: Array, o: int, force: Any, f: Array) -> None:
    """Add what a force along the tendon at p[o:] does to its joints."""
    for j in range(int(p[o + layout.COUNT].real)):
        k = o + layout.FIRST + 3 * j
        f[int(p[k + 1].real)] += p[k + 2] * force


@kernels.helper
def actuated(t: float, q: Array, v: Array, u: Array, p: Array, w: Array, sums: Array) -> None:
    """Add the actuators' forces to sums (n,), each within its own bounds; w holds poses if one acts between points.

    References to arrays are counted at every call of what is not small: one on a hinge or a slide is written out here.
    """
    for i in range(int(p[layout.ACTUATORS].real)):
        o = int(p[layout.AT_ACTUATOR].real) + layout.ACTUATOR * i
        if p[o + layout.SINGLE].real == 0.0:
            force = unbounded(t, q, v, u, p, w, i)
            exert(p, w, o, within(force, p, o + layout.FORCE), sums)
            continue
        j, gear = int(p[o + layout.WHICH].real), p[o + layout.GEAR]
        a = clamped(u[i], p[o + layout.CONTROL], p[o + layout.CONTROL + 1])
        force = by(p, o, a, gear * q[int(p[o + layout.ANGLE].real)], gear * v[j])
        sums[j] += gear * within(force, p, o + layout.FORCE)


@kernels.helper
def exert(p: Array, w: Array, o: int, force: Any, sums: Array) -> None:
    """Add what the force of the actuator at p[o:] does to the joints."""
    which = int(p[o + layout.WHICH].real)
    if p[o + layout.TARGET].real == layout.ON_JOINT:
        for k in range(6):
            if p[o + layout.GEAR + k] != 0.0 and which + k < len(sums):
                sums[which + k] += p[o + layout.GEAR + k] * force
        return
    at, force = tendon(p, which), p[o + layout.GEAR] * force
    if p[at + layout.COUNT].real < 0.0:
        strings.along(p, at + layout.FIRST, w, force, sums)
    else:
        pull(p, at, force, sums)


@kernels.helper
def moved(q: Array, v: Array, p: Array, w: Array, o: int) -> tuple[Any, Any]:
    """Return the length of the actuator at p[o:], 0 where its joint has none, and the rate of it."""
    which = int(p[o + layout.WHICH].real)
    if p[o + layout.TARGET].real == layout.ON_TENDON:
        x, speed = measured(q, v, p, w, tendon(p, which))
        return p[o + layout.GEAR] * x, p[o + layout.GEAR] * speed
    width, speed = 0, 0.0 * v[0]
    for k in range(6):
        if p[o + layout.GEAR + k] != 0.0 and which + k < len(v):
            speed += p[o + layout.GEAR + k] * v[which + k]
            width = k + 1
    return p[o + layout.GEAR] * q[int(p[o + layout.ANGLE].real)] if width == 1 else 0.0 * speed, speed


@compiled
def unheld(t: float, u: Array, p: Array, o: int, i: int) -> Any:
    """Return what drives actuator i at p[o:], but for the range of an activation, which follows from an instant on."""
    c = clamped(u[i], p[o + layout.CONTROL], p[o + layout.CONTROL + 1])
    kind = p[o + layout.ACTIVATION].real
    if kind == layout.DIRECT:
        return c
    k = int(p[o + layout.SINCE].real)
    since, a = t - u[k], u[k + 1]
    return a + c * since if kind == layout.INTEGRATOR else c + (a - c) * np.exp(-since / p[o + layout.TAU])


@kernels.helper
def by(p: Array, o: int, a: Any, x: Any, speed: Any) -> Any:
    """Return the force of the actuator at p[o:] before its bounds, by what drives it, its length and its rate."""
    gain = p[o + layout.GAIN] + p[o + layout.GAIN + 1] * x + p[o + layout.GAIN + 2] * speed
    return gain * a + p[o + layout.BIAS] + p[o + layout.BIAS + 1] * x + p[o + layout.BIAS + 2] * speed


@kernels.helper
def unbounded(t: float, q: Array, v: Array, u: Array, p: Array, w: Array, i: int) -> Any:
    """Return the force of actuator i before its bounds."""
    o = int(p[layout.AT_ACTUATOR].real) + layout.ACTUATOR * i
    a = unheld(t, u, p, o, i)
    if p[o + layout.ACTIVATION].real != layout.DIRECT:
        a = held(a, p, o + layout.SPAN)
    x, speed = moved(q, v, p, w, o)
    return by(p, o, a, x, speed)


@kernels.helper
def within(x: Any, p: Array, o: int) -> Any:
    """Return x within the bounds at p[o:], as `held`."""
    return held(x, p, o)


@kernels.helper
def driven(t: float, q: Array, v: Array, u: Array, p: Array, w: Array, sums: Array) -> None:
    """Fill sums (n,) with the actuators' forces on every velocity, within the bounds of their sum."""
    at_dof = int(p[layout.AT_DOF].real)
    sums[:] = 0.0
    actuated(t, q, v, u, p, w, sums)
    for j in range(len(sums)):
        sums[j] = held(sums[j], p, at_dof + layout.DOF * j + layout.SUM)
