"""What a scene adds to an engine's own rigid bodies: springs, dampers, actuators and rows, in NumPy.

Written from the scene's definitions, not from the reference's kernels, so that an engine that uses it is a
witness. States are the scene's: x (nv,) is the coordinate of every slide and hinge in the place of its
velocity, and 0 in those of free and ball joints, whose springs act along the rotation from where they rest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from crossbody.cases import CaseUnsupported
from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import turned
from crossbody.cases.scene import WIDTHS, Actuator, Joint, Scene, Vector


def polynomial(constants: Any, x: Any) -> Any:
    """Return k0 x + k1 x^2 + k2 x^3."""
    k0, k1, k2 = constants
    return k0 * x + k1 * x**2 + k2 * x**3


def clamped(x: Any, bounds: Any) -> Any:
    """Return x within its bounds."""
    return np.minimum(np.maximum(x, bounds[0]), bounds[1])  # np.clip takes thrice the time


def drag(constants: Any, v: Any) -> Any:
    """Return b0 v + b1 v |v| + b2 v^3."""
    b0, b1, b2 = constants
    return b0 * v + b1 * v * np.abs(v) + b2 * v**3


def stored(constants: Vector, x: Floats) -> Floats:
    """Return the energy of a spring, J."""
    k0, k1, k2 = constants
    return k0 * x**2 / 2 + k1 * x**3 / 3 + k2 * x**4 / 4


def derivatives(c: Vector) -> tuple[Vector, Vector, Vector]:
    """Return the coefficients, from the constant on, of a polynomial and of its first two derivatives."""
    first = tuple(k * c[k] for k in range(1, len(c)))
    return c, first, tuple(k * first[k] for k in range(1, len(first)))


def horner(c: Vector, x: float) -> float:
    """Return the value of a polynomial."""
    value = 0.0
    for one in reversed(c):
        value = value * x + one
    return value


def places(scene: Scene) -> tuple[dict[str, int], dict[str, int]]:
    """Return joint -> first position, and joint -> first velocity."""
    widths = np.array([WIDTHS[joint.type] for joint in scene.joints]).reshape(-1, 2)
    firsts = np.cumsum(widths, axis=0) - widths
    names = [joint.name for joint in scene.joints]
    q, v = (dict(zip(names, column.tolist(), strict=True)) for column in firsts.T)
    return q, v


def masses(scene: Scene, of_bodies: Mapping[str, float] | None = None) -> Floats:
    """Return the mass, kg, of each body that a joint moves, with those that are fixed to it.

    The world's is left out. Bodies have the masses that an engine has of them, or the scene's own.
    """
    moved, to, total = {joint.body for joint in scene.joints}, {"": ""}, dict[str, float]()
    for body in scene.bodies:
        to[body.name] = body.name if body.name in moved else to[body.parent]
        own = body.mass if of_bodies is None else of_bodies[body.name]
        total[to[body.name]] = total.get(to[body.name], 0.0) + own
    return np.array([mass for name, mass in total.items() if name])


def angle_of(quaternion: Floats) -> Floats:
    """Return the rotation vector (..., 3), rad, of a quaternion (..., 4), at most half a turn long."""
    return turned(quaternion, np.array([1.0, 0.0, 0.0, 0.0]))


def tendons(scene: Scene) -> Floats:
    """Return dl/dx (nt, nv) of the tendons."""
    T = np.zeros((len(scene.tendons), scene.nv))
    places_v = places(scene)[1]
    for row, tendon in zip(T, scene.tendons, strict=True):
        for name, c in zip(tendon.joints, tendon.coefficients, strict=True):
            row[places_v[name]] += c
    return T


Stretch = tuple[Floats, Floats, Floats]
"""Lengths (nt,) of tendons, their rates, and their derivatives (nt, nv) along v."""


@dataclass
class Forces:
    """Forces of a scene's springs, dampers and actuators.

    Attributes:
        scene: whose.
        nv: number of its velocities.
        at: joint -> its first position.
        place: joint -> its first velocity.
        single (2, ns): positions and velocities of slides and hinges.
        u (nu,): controls in force. pushes (np, 3): forces at centres of mass, N. pushed: whether
            any is not 0.
        t: now, s; it counts where there are activations. since: when the controls were put in force, s.
        act (nu,): activations then, of the actuators that have one.
        T (nt, nv): dl/dx of the tendons, 0 of those between points.
        A (nu, nv): dl/dx of the actuators on joints, gear included.
        straight: whether all joints are slides and hinges: then x is q.
        plain (n,): positions of the joints whose bounds are all that there are; None where others have some.
        steady: whether what actuators do changes with the controls alone; held (nv,): that.
        none: whether nothing but pushes ever acts.
        spans: (q, v) -> lengths of the tendons between points, by an engine's own kinematics;
            None without them.
    """

    scene: Scene
    nv: int = field(init=False)
    at: dict[str, int] = field(init=False)
    place: dict[str, int] = field(init=False)
    single: Any = field(init=False)
    u: Floats = field(init=False)
    t: float = field(init=False, default=0.0)
    since: float = field(init=False, default=0.0)
    act: Floats = field(init=False)
    pushes: Floats = field(init=False)
    T: Floats = field(init=False)
    A: Floats = field(init=False)
    spans: Callable[[Floats, Floats], Stretch] | None = None

    def __post_init__(self) -> None:
        """Lay out which joint each part moves."""
        scene, n = self.scene, self.scene.nv
        self.nv = n
        self.at, self.place = places(scene)
        single = [joint.name for joint in scene.joints if joint.type in ("slide", "hinge")]
        self.single = np.array([(self.at[name], self.place[name]) for name in single], dtype=int).reshape(-1, 2).T
        self.act = np.zeros(len(scene.actuators))
        self.u, self.pushes = np.zeros(len(scene.actuators)), np.zeros((len(scene.pushes), 3))
        self.T = tendons(scene)
        self.turning = [one for one in scene.joints if one.type in ("free", "ball") and any(one.stiffness)]
        straight = [one for one in scene.joints if one.name in single]
        self.stiffness = np.array([one.stiffness for one in straight]).reshape(-1, 3).T
        self.rest = np.array([one.rest[0] for one in straight])
        self.damping, self.joint_range = np.zeros((3, n)), np.tile([[-np.inf], [np.inf]], n)
        for joint in scene.joints:
            self.damping[:, self.moved(joint)] = np.array(joint.damping)[:, None]
            self.joint_range[:, self.moved(joint)] = np.array(joint.force_range)[:, None]
        self.tendon_stiffness, self.tendon_damping = (
            np.array([getattr(one, name) for one in scene.tendons]).reshape(-1, 3).T
            for name in ("stiffness", "damping")
        )
        self.slack = np.array([one.rest for one in scene.tendons]).reshape(-1, 2).T
        self.along = any(scene.acts_along(tendon) for tendon in scene.tendons)
        self.straight = len(single) == len(scene.joints)
        own = any(any(joint.stiffness) or any(joint.damping) for joint in scene.joints)
        self.none = not (own or self.along or scene.actuators)
        self.springs, self.bent = self.stiffness.any(), self.damping[1:].any()
        self.spanning = [i for i, tendon in enumerate(scene.tendons) if tendon.bodies]
        self._lay_out_actuators()
        self._lay_out_bounds()
        self.still()

    def _lay_out_bounds(self) -> None:
        """Write the gap of every bound as sign x + offset, x a joint's coordinate or a tendon's length."""
        joints = self.scene.joints
        self.firsts = np.array([self.place[joint.name] for joint in joints], dtype=int)
        self.balls = [(i, self.at[joint.name]) for i, joint in enumerate(joints) if joint.type == "ball"]
        rows = [
            (i, sign, -sign * bound - part.margin)
            for i, part in enumerate(self.scene.bounded)
            for sign, bound in zip((1.0, -1.0), part.range, strict=True)
            if np.isfinite(bound)
        ]
        of, self.bound_sign, self.bound_at = np.array(rows).reshape(-1, 3).T
        self.bound_of = of.astype(int)
        bounded = [self.scene.bounded[i] for i in self.bound_of]
        single = all(isinstance(part, Joint) and part.type != "ball" for part in bounded)
        self.plain = np.array([self.at[part.name] for part in bounded], dtype=int) if single else None

    def _lay_out_actuators(self) -> None:
        scene, names = self.scene, [tendon.name for tendon in self.scene.tendons]
        parts = scene.actuators
        self.A, self.dragged = np.zeros((len(parts), self.nv)), np.zeros(self.nv)
        for row, actuator in zip(self.A, parts, strict=True):
            if not actuator.tendon:
                moved = self.reached(actuator)
                row[moved] = actuator.gear[: moved.stop - moved.start]
                self.dragged[moved] += actuator.gear[0] ** 2 * actuator.damping
        self.gear = np.array([actuator.gear[0] for actuator in parts])
        self.pulling = np.array([i for i, one in enumerate(parts) if one.tendon], dtype=int)
        self.pulled = np.array([names.index(one.tendon) for one in parts if one.tendon], dtype=int)
        self.pull_damping = np.array([one.damping if one.tendon else 0.0 for one in parts])
        self.gain, self.bias = (np.array([getattr(one, k) for one in parts]).reshape(-1, 3).T for k in ("gain", "bias"))
        self.force_range, self.control_range, self.activation_range = (
            np.array([getattr(one, k) for one in parts]).reshape(-1, 2).T
            for k in ("force_range", "control_range", "activation_range")
        )
        moving = self.gain[1:].any() or self.bias[1:].any() or self.dragged.any() or len(self.pulling)
        self.steady = not (moving or self.scene.activated)

    def x(self, q: Floats) -> Floats:
        """Return x (..., nv) of positions (..., nq); it may only be read."""
        if self.straight:
            return q
        x: Floats = np.zeros((*np.shape(q)[:-1], self.nv))
        x[..., self.single[1]] = q[..., self.single[0]]
        return x

    def moved(self, joint: Joint) -> slice:
        """Velocities of a joint."""
        first = self.place[joint.name]
        return slice(first, first + WIDTHS[joint.type][1])

    @property
    def armature(self) -> Floats:
        """What joints and actuators add to the diagonal of M (nv,)."""
        own: Floats = np.zeros(self.scene.nv)
        for joint in self.scene.joints:
            own[self.moved(joint)] += joint.armature
        for actuator in self.scene.actuators:
            if actuator.joint:
                own[self.reached(actuator)] += actuator.gear[0] ** 2 * actuator.armature
        return own

    def reached(self, actuator: Actuator) -> slice:
        """Velocities of the joint of an actuator."""
        return self.moved(next(joint for joint in self.scene.joints if joint.name == actuator.joint))

    def turned(self, joint: Joint, q: Floats) -> Floats:
        """Rotation (..., 3), rad, of a free or ball joint from where its spring rests."""
        first = self.at[joint.name] + (3 if joint.type == "free" else 0)
        rest = np.array(joint.rest if len(joint.rest) == 4 else (1.0, 0.0, 0.0, 0.0))
        return turned(q[..., first : first + 4], rest)

    def begin(self, act0: Floats) -> None:
        """Put no input in force, at t = 0, with activations (na,)."""
        self.still()
        self.act[list(self.scene.activated)] = act0

    def driven(self) -> Floats:
        """Return what drives the actuators now (nu,): controls, or the activations that follow them."""
        found: Floats = clamped(self.u, self.control_range)
        gone = self.t - self.since
        for i in self.scene.activated:
            part, a, c = self.scene.actuators[i], self.act[i], found[i]
            if part.activation == "integrator":
                found[i] = a + c * gone
            else:
                found[i] = a - (c - a) * np.expm1(-gone / part.time_constant)
        held: Floats = clamped(found, self.activation_range)
        return held

    def change(self, values: Floats, t: float) -> None:
        """Put inputs of the scene in force from t on, s: controls, then pushes."""
        self.t = t
        self.act, self.since = self.driven(), t
        count = len(self.u)
        self.u[:], self.pushes[:] = values[:count], values[count:].reshape(-1, 3)
        self._hold()

    def _hold(self) -> None:
        """Keep what motors do that feel neither state nor time, and whether anything pushes."""
        none, self.pushed = np.zeros(self.nv), bool(self.pushes.any())
        self.held = self.actuated(none, none) if self.steady and self.scene.actuators else none

    def still(self) -> None:
        """Put no input in force, and no activation."""
        self.u[:], self.pushes[:], self.act[:], self.t, self.since = 0.0, 0.0, 0.0, 0.0, 0.0
        self._hold()

    def __call__(self, q: Floats, v: Floats) -> Floats:
        """Return the generalised forces (nv,) at a state."""
        x = self.x(q)
        total: Floats = self.held - drag(self.damping, v) if self.bent else self.held - self.damping[0] * v
        if self.springs:
            total[self.single[1]] -= polynomial(self.stiffness, x[self.single[1]] - self.rest)
        for joint in self.turning:
            moved, turn = self.moved(joint), self.turned(joint, q)
            angle = float(np.linalg.norm(turn)) or 1.0
            total[moved.stop - 3 : moved.stop] -= polynomial(joint.stiffness, angle) / angle * turn
        if not self.along:
            return total if self.steady else total + self.actuated(x, v)
        lengths, rates, rows = self.stretch(q, v)
        spring = polynomial(self.tendon_stiffness, self.outside(lengths))
        total -= (spring + drag(self.tendon_damping, rates)) @ rows
        return total if self.steady else total + self.actuated(x, v, (lengths, rates, rows))

    def stretch(self, q: Floats, v: Floats) -> Stretch:
        """Return lengths of all tendons, their rates and derivatives."""
        lengths, rates, rows = self.T @ self.x(q), self.T @ v, self.T.copy()
        if self.spanning and self.spans is not None:
            lengths[self.spanning], rates[self.spanning], rows[self.spanning] = self.spans(q, v)
        return lengths, rates, rows

    def strokes(self, x: Floats, v: Floats, stretch: Stretch | None) -> Stretch:
        """Return lengths of all actuators, their rates and their derivatives (nu, nv), gear included."""
        A, lengths = self.A, self.A @ x
        if stretch is not None and len(self.pulling):
            gear, tendon, A = self.gear[self.pulling], self.pulled, A.copy()
            A[self.pulling], lengths[self.pulling] = gear[:, None] * stretch[2][tendon], gear * stretch[0][tendon]
        return lengths, A @ v, A

    def bounds(self, q: Floats, lengths: Floats) -> Floats:
        """Return the gaps (..., n) of all bounds, in their rows' order; lengths (..., nt) of the tendons."""
        if self.plain is not None:
            plain: Floats = self.bound_sign * q[..., self.plain] + self.bound_at
            return plain
        found = np.concatenate([self.x(q)[..., self.firsts], lengths], axis=-1)
        for i, at in self.balls:
            found[..., i] = np.linalg.norm(angle_of(q[..., at : at + 4]), axis=-1)
        gaps: Floats = self.bound_sign * found[..., self.bound_of] + self.bound_at
        return gaps

    def outside(self, lengths: Floats) -> Floats:
        """Return how far the lengths (..., nt) of tendons are outside their dead bands."""
        out: Floats = lengths - clamped(lengths, self.slack)
        return out

    def actuated(self, x: Floats, v: Floats, stretch: Stretch | None = None) -> Floats:
        """Return what the actuators do (nv,), each in its bounds, their sum in the joint's; less damping."""
        lengths, rates, A = self.strokes(x, v, stretch)
        (g0, g1, g2), (b0, b1, b2) = self.gain, self.bias
        force = (g0 + g1 * lengths + g2 * rates) * self.driven() + b0 + b1 * lengths + b2 * rates
        total: Floats = clamped(clamped(force, self.force_range) @ A, self.joint_range)
        return total - self.dragged * v - (self.pull_damping * rates) @ A

    def energy(self, q: Floats) -> Floats:
        """Return what the springs hold (n,), J, at states q (n, nq)."""
        total: Floats = np.zeros(len(q))
        x = self.x(q)
        for joint in self.scene.joints:
            if joint.type in ("slide", "hinge"):
                total += stored(joint.stiffness, x[:, self.place[joint.name]] - joint.rest[0])
            elif any(joint.stiffness):
                total += stored(joint.stiffness, np.linalg.norm(self.turned(joint, q), axis=-1))
        if self.tendon_stiffness.any():
            lengths = np.array([self.stretch(one, np.zeros(self.scene.nv))[0] for one in q]).T
            for tendon, length in zip(self.scene.tendons, lengths, strict=True):
                total += stored(tendon.stiffness, length - clamped(length, tendon.rest))
        return total


class Rows:
    """Gaps of a scene's rows and their derivatives: loops of joints, then bounds of joints and of tendons.

    Args:
        scene: whose; loops in space an engine's own kinematics must give.
        forces: of the scene.

    Attributes:
        straight (nc, nv), offset (nc,): gaps are straight x + offset, but of those rows that bend.
        bends: whether there are such: loops by polynomials from the square on, and angles of ball joints.
    """

    def __init__(self, scene: Scene, forces: Forces) -> None:
        for loop in scene.loops:
            if loop.in_space:
                raise CaseUnsupported(f"Loop {loop.name!r} of type {loop.type} is not supported here.")
        self.scene, self.forces = scene, forces
        self.ends = [(self._end(loop.type, loop.first), self._end(loop.type, loop.second)) for loop in scene.loops]
        self.curves = [derivatives(loop.polynomial) for loop in scene.loops]
        self.curved = [i for i, loop in enumerate(scene.loops) if any(loop.polynomial[2:])]
        self._straighten()
        self.bends = bool(self.curved or self.balls)

    def _straighten(self) -> None:
        """Lay out the rows but bounds of distances; 0 of what bends, a ball joint's angle's offset."""
        forces, turning, count = self.forces, dict(self.forces.balls), len(self.ends)
        spanning = np.array(forces.spanning, dtype=int) + len(self.scene.joints)
        taken = ~np.isin(forces.bound_of, spanning)
        along = np.concatenate([np.eye(forces.nv)[forces.firsts], forces.T])
        along[list(turning)] = 0.0
        of, sign = forces.bound_of[taken], forces.bound_sign[taken]
        none = np.zeros(forces.nv)
        loops = [(0.0, none, 0.0) if i in self.curved else self._loop(i, none) for i in range(count)]
        self.straight = np.concatenate([np.array([row for _, row, _ in loops]).reshape(-1, forces.nv),
                                        sign[:, None] * along[of]])  # fmt: skip
        self.offset = np.concatenate([[h for h, _, _ in loops], forces.bound_at[taken]])
        self.balls = [(count + row, self.scene.joints[i], float(sign[row])) for row, i in enumerate(of) if i in turning]

    def heights(self, q: Floats) -> Floats:
        """Return h (nc,)."""
        x = self.forces.x(q)
        h: Floats = self.straight @ x + self.offset
        for i in self.curved:
            h[i] = self._loop(i, x)[0]
        for row, joint, sign in self.balls:
            h[row] += sign * self._angle(joint, q, np.zeros(self.forces.nv))[0]
        return h

    def jacobian(self, q: Floats) -> Floats:
        """Return H (nc, nv)."""
        x, H = self.forces.x(q), self.straight.copy()
        for i in self.curved:
            H[i] = self._loop(i, x)[1]
        for row, joint, sign in self.balls:
            H[row] = sign * self._angle(joint, q, np.zeros(len(x)))[1]
        return H

    def drift(self, q: Floats, v: Floats) -> Floats:
        """Return H' v (nc,)."""
        x, found = self.forces.x(q), np.zeros(len(self.offset))
        for i in self.curved:
            found[i] = -self._loop(i, x)[2] * float(self.ends[i][1][0] @ v) ** 2
        for row, joint, sign in self.balls:
            found[row] = sign * self._angle(joint, q, v)[2]
        return found

    def _angle(self, joint: Joint, q: Floats, v: Floats) -> tuple[float, Floats, float]:
        """Return the angle of a ball joint, its derivative along v (nv,), and its second along a steady v."""
        row, moved = np.zeros(self.forces.nv), self.forces.moved(joint)
        vector = angle_of(q[self.forces.at[joint.name] :][:4])
        angle = float(np.linalg.norm(vector))
        row[moved] = vector / angle if angle > 0.0 else 0.0
        across = v[moved] - row @ v * row[moved]
        bend = float(across @ across) / (2.0 * np.tan(angle / 2.0)) if angle > 0.0 else 0.0
        return angle, row, bend

    def _end(self, kind: str, name: str) -> tuple[Floats, float]:
        """Return the derivative (nv,) of a coordinate or a length, zero without a name, and its rest."""
        if not name:
            return np.zeros(self.forces.nv), 0.0
        if kind == "tendon":
            i = [tendon.name for tendon in self.scene.tendons].index(name)
            return self.forces.T[i], self.scene.rest_length(self.scene.tendons[i])
        reference = next(joint.reference for joint in self.scene.joints if joint.name == name)
        return np.eye(self.forces.nv)[self.forces.place[name]], reference

    def _loop(self, i: int, x: Floats) -> tuple[float, Floats, float]:
        """Return h, H and the second derivative of the polynomial."""
        (first, rest), (second, other) = self.ends[i]
        y = float(second @ x) - other
        value, slope, curve = (horner(one, y) for one in self.curves[i])
        return float(first @ x) - rest - value, first - slope * second, curve
