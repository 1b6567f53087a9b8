"""Forces of motors and dampers that a truth has, held against the scene's own numbers by sums written out here.

All sources of a truth take them from the same kernels, so that no source contradicts another: a force that is not cut
at its range, say, moves all of them alike. What controls and activations add to the equations at a state, and what
turning all velocities round takes from them, is theirs alone: neither weight nor springs do that, and what turns with
the bodies is even in their velocities.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.cases.remembered import remembered
from crossbody.cases.rotations import normalised
from crossbody.cases.scene import WIDTHS, Actuator, Joint, Scene, Tendon, Vector
from crossbody.reports.judging.audit import AuditRow
from crossbody.reports.measuring.equations import equations

if TYPE_CHECKING:
    from crossbody.reference import System

SIZES = (0.3, 3.0, 30.0, 300.0)
"""Of controls: within any range, and beyond it."""
ROUNDS, NEAR, FAST, SEED = 3, 0.3, 2.0, 20240917
"""Draws of each size; how far a state is from the start, m or rad, and how fast it moves, SI; and of what is drawn."""
AGE = 0.07
"""How long ago an activation was told, s."""
EXACT = 1e-9
"""Part of the largest force in the equations by which sums in another order differ."""
STEP, SMOOTH = 1e-5, 1e-6
"""By which positions are put off, m or rad, and part of a force that is left of slopes by so much."""
LENGTHS = ("slide", "hinge")


@remembered(2)
def forces_of_scene(case: Case) -> tuple[AuditRow, ...]:
    """Return rows for the parity audit of a scene with motors or dampers: their forces at states beside the start."""
    system = equations(case)
    plain = case.general and not (case.force or case.form or case.gates)
    return forces_against(case, system) if plain and system is not None else ()


def forces_against(case: Case, system: System) -> tuple[AuditRow, ...]:
    """Return the same rows of equations that may be others' (as `forces_of_scene` of the case's own)."""
    assert case.scene is not None
    own = Forces(case.scene)
    rows = []
    if own.driven:
        rows.append(_compared("forces of motors", *_of_motors(case, system, own)))
    if not own.unknown:
        if own.drags:
            rows.append(_compared("forces of dampers", *_of_dampers(case, system, own)))
        if system.energy is not None and own.told.any():
            rows.append(_compared("forces at rest", *_at_rest(case, system, own), tolerance=SMOOTH))
    return tuple(rows)


class Forces:
    """What a scene's numbers say of forces along slides, hinges and sums of these.

    Attributes:
        along (parts, nv): by joint and tendon, how their lengths change with velocities. positions: with coordinates.
        driven: actuators along these. unknown: whether others, or others' dampers, act too.
        told (nv,): velocities of slides and hinges.
        drags: whether anything is damped.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene, self.along, self.positions = scene, dict[str, Floats](), dict[str, Floats]()
        self.told = np.zeros(scene.nv, dtype=bool)
        q, v = 0, 0
        for joint in scene.joints:
            nq, nv = WIDTHS[joint.type]
            if joint.type in LENGTHS:
                self.along[f"joint {joint.name}"] = np.eye(scene.nv)[v]
                self.positions[f"joint {joint.name}"] = np.eye(scene.nq)[q]
                self.told[v] = True
            q, v = q + nq, v + nv
        for tendon in (tendon for tendon in scene.tendons if tendon.joints):
            for ways in (self.along, self.positions):
                parts = [c * ways[f"joint {name}"] for name, c in zip(tendon.joints, tendon.coefficients, strict=True)]
                ways[f"tendon {tendon.name}"] = np.sum(parts, axis=0)
        self.driven = [i for i, one in enumerate(scene.actuators) if _part(one) in self.along]
        in_space = any(any(tendon.damping) for tendon in scene.tendons if not tendon.joints)
        self.unknown = in_space or len(self.driven) < len(scene.actuators)
        every: tuple[Joint | Tendon, ...] = (*scene.joints, *scene.tendons)
        self.drags = any(any(part.damping) for part in every) or any(
            one.damping or one.bias[2] for one in scene.actuators
        )

    def of_motors(self, q: Floats, v: Floats, u: Floats, a: Mapping[int, float]) -> Floats:
        """Return the forces (nv,) of actuators at controls u, where they have one at activations a."""
        total = np.zeros(self.scene.nv)
        for i in self.driven:
            one = self.scene.actuators[i]
            gear, way = one.gear[0], self.along[_part(one)]
            state = np.array([1.0, gear * self.positions[_part(one)] @ q, gear * way @ v])
            level = a[i] if one.activation else _within(u[i], one.control_range)
            total += gear * way * _within(float(level * (one.gain @ state) + one.bias @ state), one.force_range)
        place = 0
        for joint in self.scene.joints:
            if joint.type in LENGTHS:
                total[place] = _within(total[place], joint.force_range)
            place += WIDTHS[joint.type][1]
        return total

    def of_dampers(self, v: Floats) -> Floats:
        """Return the forces (nv,) of dampers of joints, tendons and actuators."""
        total = np.zeros(self.scene.nv)
        more = {name: 0.0 for name in self.along}
        for one in (self.scene.actuators[i] for i in self.driven):
            more[_part(one)] += one.gear[0] ** 2 * one.damping
        for kind, parts in (("joint", self.scene.joints), ("tendon", self.scene.tendons)):
            for part in (part for part in parts if f"{kind} {part.name}" in self.along):
                way, (b0, b1, b2) = self.along[f"{kind} {part.name}"], part.damping
                rate = float(way @ v)
                total -= way * ((b0 + more[f"{kind} {part.name}"]) * rate + b1 * rate * abs(rate) + b2 * rate**3)
        return total


def _within(x: float, bounds: Vector) -> float:
    return min(max(float(x), float(bounds[0])), float(bounds[1]))


def _later(one: Actuator, a: float, c: float) -> float:
    """Return the activation that was a AGE before, under a control: tau a' = c - a of a filter, a' = c else."""
    still = c + (a - c) * math.exp(-AGE / one.time_constant) if one.activation == "filter" else a + c * AGE
    return _within(still, one.activation_range)


def _part(actuator: Actuator) -> str:
    return f"joint {actuator.joint}" if actuator.joint else f"tendon {actuator.tendon}"


def _states(case: Case) -> tuple[np.random.Generator, Floats, Floats]:
    """Return what draws, positions (m, nq) and velocities (m, nv) beside the start."""
    draw, count = np.random.default_rng(SEED), ROUNDS * len(SIZES)
    q = [normalised(case.q0 + draw.uniform(-NEAR, NEAR, len(case.q0)), case.quaternions) for _ in range(count)]
    return draw, np.array(q), draw.uniform(-FAST, FAST, (count, len(case.v0)))


def _of_motors(case: Case, system: System, own: Forces) -> tuple[Floats, Floats, Floats]:
    """Return what controls and activations add (m, nv), in the equations and by the scene, and the largest force."""
    draw, q, v = _states(case)
    activated, still = own.scene.activated, np.zeros(system.inputs)
    found, wanted, sizes = [], [], []
    for k, (at, rate) in enumerate(zip(q, v, strict=True)):
        u, size = still.copy(), SIZES[k % len(SIZES)]
        u[own.driven] = size * draw.uniform(-1.0, 1.0, len(own.driven))
        a = {i: float(size * draw.uniform(-1.0, 1.0)) if i in own.driven else 0.0 for i in activated}
        for place, i in enumerate(activated):  # behind all others t0 and a0 of each
            one, began = own.scene.actuators[i], len(still) - 2 * len(activated) + 2 * place
            a[i] = _within(a[i], one.activation_range)
            u[began], u[began + 1] = -AGE, a[i]
            a[i] = _later(one, a[i], _within(u[i], one.control_range))
        none = {i: 0.0 for i in activated}
        before, behind = (system.terms(at, rate, inputs)[1] for inputs in (still, u))
        found.append(behind - before)
        wanted.append(own.of_motors(at, rate, u, a) - own.of_motors(at, rate, still, none))
        sizes.append(max(float(np.max(np.abs(behind))), float(np.max(np.abs(before)))))
    return np.array(found), np.array(wanted), np.array(sizes)


def _of_dampers(case: Case, system: System, own: Forces) -> tuple[Floats, Floats, Floats]:
    """Return half of what turning velocities round takes (m, k), in the equations and by the scene, and the largest."""
    _, q, v = _states(case)
    none, still = {i: 0.0 for i in own.scene.activated}, np.zeros(system.inputs)
    forth, back = (
        np.array([system.terms(at, way * rate)[1] for at, rate in zip(q, v, strict=True)]) for way in (1, -1)
    )

    def said(at: Floats, rate: Floats) -> Floats:
        return own.of_dampers(rate) + own.of_motors(at, rate, still, none)

    wanted = [0.5 * (said(at, rate) - said(at, -rate)) for at, rate in zip(q, v, strict=True)]
    sizes = np.max(np.abs(np.concatenate([forth, back], axis=1)), axis=1)
    return 0.5 * (forth - back)[:, own.told], np.array(wanted)[:, own.told], sizes


def _at_rest(case: Case, system: System, own: Forces) -> tuple[Floats, Floats, Floats]:
    """Return forces at rest (m, k), in the equations and by slopes of the potential energy, and the largest force.

    A spring whose force is not that of its energy is wrong in either.
    """
    q, none, still = _states(case)[1], {i: 0.0 for i in own.scene.activated}, np.zeros(system.inputs)
    rest, places = np.zeros(len(case.v0)), [way for name, way in own.positions.items() if name.startswith("joint ")]

    def potential(at: Floats) -> float:
        out = np.zeros(2)
        system.energy(np.array(at), rest, np.array(system.p), out)
        return float(out[1])

    found = np.array([system.terms(at, rest)[1] - own.of_motors(at, rest, still, none) for at in q])
    slopes = [[(potential(at - STEP * way) - potential(at + STEP * way)) / (2.0 * STEP) for way in places] for at in q]
    sizes = np.maximum(np.max(np.abs(found), axis=1), np.array([abs(potential(at)) for at in q]))
    return found[:, own.told], np.array(slopes), sizes


def _compared(quantity: str, found: Floats, wanted: Floats, sizes: Floats, tolerance: float = EXACT) -> AuditRow:
    """Return the largest difference, by the largest force of its state."""
    off = np.max(np.abs(found - wanted), axis=1, initial=0.0) / np.where(sizes > 0.0, sizes, 1.0)
    worst = int(np.argmax(off))
    told = (" ".join(f"{x + 0.0:.6g}" for x in one[worst]) for one in (found, wanted))
    value = float(off[worst]) if np.isfinite(off).all() else np.inf
    return AuditRow(quantity=quantity, mine=next(told), theirs=next(told), difference=value, tolerance=tolerance)
