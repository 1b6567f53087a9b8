"""What a scene adds to an engine's own rigid bodies: springs, dampers, actuators and rows, in NumPy.

Written from the scene's definitions, not from the reference's kernels, so that an engine that uses it is a witness.
Coordinates are the scene's; slides and hinges alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from crossbody.cases import CaseUnsupported
from crossbody.cases._arrays import Floats
from crossbody.cases.scene import Joint, Loop, Scene, Tendon, Vector


def polynomial(constants: Vector, x: Any) -> Any:
    """Return k0 x + k1 x^2 + k2 x^3."""
    k0, k1, k2 = constants
    return k0 * x + k1 * x**2 + k2 * x**3


def clamped(x: Any, bounds: Vector) -> Any:
    """Return x within its bounds."""
    return np.clip(x, bounds[0], bounds[1])


def drag(constants: Vector, v: Any) -> Any:
    """Return b0 v + b1 v |v| + b2 v^3."""
    b0, b1, b2 = constants
    return b0 * v + b1 * v * np.abs(v) + b2 * v**3


def stored(constants: Vector, x: Floats) -> Floats:
    """Return the energy of a spring, J."""
    k0, k1, k2 = constants
    total: Floats = k0 * x**2 / 2 + k1 * x**3 / 3 + k2 * x**4 / 4
    return total


def tendons(scene: Scene) -> Floats:
    """Return dl/dq (nt, nv) of the tendons."""
    T = np.zeros((len(scene.tendons), scene.nv))
    places = {joint.name: i for i, joint in enumerate(scene.joints)}
    for row, tendon in zip(T, scene.tendons, strict=True):
        for name, c in zip(tendon.joints, tendon.coefficients, strict=True):
            row[places[name]] += c
    return T


@dataclass(slots=True)
class Forces:
    """Forces of a scene's springs, dampers and actuators.

    Attributes:
        scene: whose.
        u (nu,): controls in force.
        T (nt, nv): dl/dq of the tendons.
        A (nu, nv): dl/dq of the actuators, gear included.
    """

    scene: Scene
    u: Floats = field(init=False)
    T: Floats = field(init=False)
    A: Floats = field(init=False)

    def __post_init__(self) -> None:
        """Lay out which joint each part moves."""
        scene, n = self.scene, self.scene.nv
        if scene.nq != n:
            raise CaseUnsupported("Free and ball joints are not built here.")
        place = {joint.name: i for i, joint in enumerate(scene.joints)}
        self.u, self.T = np.zeros(len(scene.actuators)), tendons(scene)
        named = {tendon.name: row for tendon, row in zip(scene.tendons, self.T, strict=True)}
        rows = [
            actuator.gear[0] * (named[actuator.tendon] if actuator.tendon else np.eye(n)[place[actuator.joint]])
            for actuator in scene.actuators
        ]
        self.A = np.array(rows).reshape(len(rows), n)

    @property
    def armature(self) -> Floats:
        """What joints and actuators add to the diagonal of M (nv,)."""
        own = np.array([joint.armature for joint in self.scene.joints])
        for actuator in self.scene.actuators:
            for i, joint in enumerate(self.scene.joints):
                own[i] += actuator.gear[0] ** 2 * actuator.armature * (joint.name == actuator.joint)
        return own

    def change(self, values: Floats) -> None:
        """Put controls (nu,) in force."""
        self.u[:] = values

    def __call__(self, q: Floats, v: Floats) -> Floats:
        """Return the generalised forces (nv,) at a state."""
        total: Floats = np.zeros(len(v))
        for i, joint in enumerate(self.scene.joints):
            total[i] -= polynomial(joint.stiffness, q[i] - joint.rest[0]) + drag(joint.damping, v[i])
        for row, tendon in zip(self.T, self.scene.tendons, strict=True):
            spring = polynomial(tendon.stiffness, self.outside(tendon.rest, row @ q))
            total -= row * (spring + drag(tendon.damping, row @ v))
        return total + self.actuated(q, v)

    @staticmethod
    def outside(rest: Vector, length: Floats) -> Floats:
        """Return how far a length is outside its dead band."""
        out: Floats = length - clamped(length, rest)
        return out

    def actuated(self, q: Floats, v: Floats) -> Floats:
        """Return what the actuators do (nv,), each within its bounds and their sum within the joint's."""
        total: Floats = np.zeros(len(v))
        for row, actuator, given in zip(self.A, self.scene.actuators, self.u, strict=True):
            terms = np.array([1.0, row @ q, row @ v])
            force = np.dot(actuator.gain, terms) * clamped(given, actuator.control_range) + np.dot(actuator.bias, terms)
            total += row * clamped(force, actuator.force_range)
            if actuator.joint:
                total -= row**2 * actuator.damping * v
        bounds = np.array([joint.force_range for joint in self.scene.joints])
        return np.clip(total, bounds[:, 0], bounds[:, 1])

    def energy(self, q: Floats) -> Floats:
        """Return what the springs hold (n,), J, at states q (n, nq)."""
        total: Floats = np.zeros(len(q))
        for i, joint in enumerate(self.scene.joints):
            total += stored(joint.stiffness, q[:, i] - joint.rest[0])
        for row, tendon in zip(self.T, self.scene.tendons, strict=True):
            total += stored(tendon.stiffness, self.outside(tendon.rest, q @ row))
        return total


@dataclass(slots=True)
class Rows:
    """Gaps of a scene's rows and their derivatives: loops of joints, then bounds of joints and of tendons."""

    scene: Scene
    forces: Forces

    def __post_init__(self) -> None:
        """Refuse loops in space, which an engine's own kinematics must give."""
        for loop in self.scene.loops:
            if loop.type != "joint":
                raise CaseUnsupported(f"Loop {loop.name!r} of type {loop.type} is not built here.")

    def heights(self, q: Floats) -> Floats:
        """Return h (nc,)."""
        h = [self._loop(loop, q)[0] for loop in self.scene.loops]
        for part, x in self._bounded(q):
            low, high = part.range
            h += [x - low - part.margin] if np.isfinite(low) else []
            h += [high - x - part.margin] if np.isfinite(high) else []
        return np.array(h)

    def jacobian(self, q: Floats) -> Floats:
        """Return H (nc, nv)."""
        H = [self._loop(loop, q)[1] for loop in self.scene.loops]
        for (part, _), row in zip(self._bounded(q), (*np.eye(len(q)), *self.forces.T), strict=True):
            H += [sign * row for sign, bound in zip((1.0, -1.0), part.range, strict=True) if np.isfinite(bound)]
        return np.array(H).reshape(-1, len(q))

    def drift(self, q: Floats, v: Floats) -> Floats:
        """Return H' v (nc,)."""
        drift = np.zeros(len(self.heights(q)))
        for i, loop in enumerate(self.scene.loops):
            drift[i] = -self._loop(loop, q)[2] * (v[self._place(loop.second)] ** 2 if loop.second else 0.0)
        return drift

    def _bounded(self, q: Floats) -> list[tuple[Joint | Tendon, float]]:
        return list(zip(self.scene.bounded, [*q, *(self.forces.T @ q)], strict=True))

    def _place(self, joint: str) -> int:
        return next(i for i, one in enumerate(self.scene.joints) if one.name == joint)

    def _loop(self, loop: Loop, q: Floats) -> tuple[float, Floats, float]:
        """Return h, H and the second derivative of the polynomial."""
        first = self._place(loop.first)
        y = q[self._place(loop.second)] - self.scene.joints[self._place(loop.second)].reference if loop.second else 0.0
        P = np.polynomial.Polynomial(loop.polynomial)
        H = np.zeros(len(q))
        H[first] = 1.0
        if loop.second:
            H[self._place(loop.second)] -= P.deriv()(y)
        return q[first] - self.scene.joints[first].reference - P(y), H, P.deriv(2)(y)
