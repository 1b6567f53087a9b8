"""What errors are measured by: of a coordinate its own largest, or of its like where it rests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crossbody.cases import Case, Coordinate, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import WIDTHS, Scene

RESTS = 1e-4
"""Coordinates of one unit that all stay below this, in SI, rest: what is left of their motion is known to
absolute tolerances alone. Those are 1e-12 by default, so a relative 1e-6 of this is a hundred of them."""
ROUNDING = 1e-6
"""Part of the largest coordinate, or of a metre: gaps that never open beyond it are known to its tolerance alone,
and on those below it, as of closures, two programs agree to rounding alone, which is 1e-10 of it."""
IDLE = 1e-3
"""Part of the forces that move a mechanism below which its rows carry nothing but noise."""
STILL = 1e-9
"""Part of a coordinate, or of a metre or radian, that is rounding and what tolerances leave, not motion."""
SMALL = 1e-6
"""Least that a coordinate of which others like it move is measured by, m or rad."""
KNOWN = 1e-8
"""Part of an energy that must move to measure what it is off by: rounding of the rest is 1e-7 of it."""


def energy(run: Trajectory) -> float:
    """Return what energies are measured by, J: the largest kinetic energy, or the swing of the potential.

    A robot that stands sags by its servos at hardly any speed: its energy turns over in springs and
    weights. Where every coordinate rests, by what it, and what its rows carry, would turn over if they
    moved by as much as they are measured by themselves, and by what rounding leaves of the largest energy.
    """
    known = KNOWN * float(np.max(np.abs(run.energy)))
    moved = _moved(run)
    rests = max(1.0, RESTS / moved) if moved > 0.0 else 1.0
    carried = RESTS * float(np.nanmax(np.abs(run.lam), initial=0.0)) if moved < RESTS else 0.0
    return max(rests * float(run.energy[:, 0].max()), rests * float(np.ptp(run.energy[:, 1])), carried, known)


def still(run: Trajectory) -> bool:
    """Return whether nothing moves: coordinates stay where they start, to rounding, and rates at zero."""
    sizes = np.maximum(1.0, np.abs(run.q).max(axis=0, initial=0.0))
    rests = bool((np.ptp(run.q, axis=0) <= STILL * sizes).all()) if len(run.t) else False
    return rests and float(np.max(np.abs(run.v), initial=0.0)) * float(run.t[-1] - run.t[0]) <= STILL * sizes.max()


def of_like(largest: Floats, named: Sequence[Coordinate]) -> Floats:
    """Largest value (n,) of all coordinates that share a unit, from that of each coordinate (n,)."""
    units = np.array([coordinate.unit for coordinate in named])
    return np.array([largest[units == unit].max() for unit in units])


def least(named: Sequence[Coordinate], rates: bool = False) -> Floats:
    """What coordinates, or their rates, are measured by at least (n,), SI."""
    known = [coordinate.rate if rates else coordinate.size for coordinate in named]
    return np.maximum(of_like(np.array(known), named), RESTS)


def scale_of(exact: Trajectory, case: Case) -> Floats:
    """Return what positions are measured by (nq,): the largest |q| of each; of its like, for one that rests.

    The joints of a scene, a robot's, are measured by the largest of their unit: one that hardly
    moves in the truth, by the balance of others, tells of an engine that moves it how far that
    is, and not how still it ought to be. But not by where bodies float, nor by more than a
    radian, what other rotations are measured by: a robot far from the origin, or the turns of a
    wheel, would hide what a finger does. Of what floats, each body is measured by where it is
    itself. Where all of these rest, what the case says of their size. Errors below 1e-12, what
    absolute tolerances are, pass the usual limit of 1e-6.
    """
    own: Floats = np.max(np.abs(exact.q), axis=0)
    smallest = least(case.coordinates)
    shared = of_like(own, case.coordinates)
    if case.scene is not None:
        own = shared = _of_joints(own, case, case.scene)
    scale = np.where(shared < smallest, smallest, np.where(own > STILL * shared, np.maximum(own, SMALL), shared))
    scale[list(case.quaternions)] = 1.0  # rad
    return scale


def _of_joints(own: Floats, case: Case, scene: Scene) -> Floats:
    """Return what each coordinate (nq,) of a scene is measured by: its own largest, or that of the joints like it."""
    widths = [WIDTHS[joint.type][0] for joint in scene.joints]
    floats = np.repeat([joint.type == "free" for joint in scene.joints], widths)
    turns = np.array([coordinate.unit == "rad" for coordinate in case.coordinates])
    joints = of_like(np.where(floats, 0.0, own), case.coordinates)
    shared = np.where(turns, np.minimum(joints, 1.0), joints)
    for at in np.cumsum([0, *widths[:-1]])[[joint.type == "free" for joint in scene.joints]]:
        shared[at : at + 3] = own[at : at + 3].max()
    return np.maximum(own, shared)


def scale_of_rates(exact: Trajectory, case: Case) -> Floats:
    """Return what velocities are measured by (nv,): the largest |v| of all that share a unit.

    Of a scene joints are measured by the joints alone, those that turn little beside a wheel by as much less as their
    positions are; and a floating body by itself, or by what brings it as far as its place is measured by over the
    horizon. Where all of a unit rest, and the case names no larger rate, 1e-9 rad/s of a box that slides without
    turning say nothing of how far another rate is off. What matters of that is where it leads: it is measured by the
    rate that brings a coordinate as far as its position is measured by, over the horizon. A rotation is measured by a
    radian.
    """
    own: Floats = np.max(np.abs(exact.v), axis=0, initial=0.0)
    known = np.maximum(of_like(own, case.velocities), least(case.velocities, rates=True))
    sizes = scale_of(exact, case)
    for at in case.quaternions:
        sizes[at : at + 4] = 1.0
    leads = np.delete(sizes, [at + 3 for at in case.quaternions]) / case.t_end
    found = np.where(known > RESTS, known, np.maximum(known, leads))
    return found if case.scene is None else np.minimum(found, _rates_of_joints(own, leads, exact, case, case.scene))


def _rates_of_joints(own: Floats, leads: Floats, exact: Trajectory, case: Case, scene: Scene) -> Floats:
    """Return what each velocity (nv,) of a scene is measured by at most, by the largest of each and where they lead."""
    places, rates = (np.array([WIDTHS[joint.type][k] for joint in scene.joints], dtype=int) for k in (0, 1))
    kinds = np.array([joint.type for joint in scene.joints])
    joints = of_like(np.where(np.repeat(kinds == "free", rates), 0.0, own), case.velocities)
    joints = np.maximum(joints, least(case.velocities, rates=True))  # what the case says of its rates
    most = np.where(joints > RESTS, joints, np.maximum(joints, leads))
    starts = np.cumsum(rates) - rates
    turned = np.abs(exact.q).max(axis=0)[(np.cumsum(places) - places)[kinds == "hinge"]]
    most[starts[kinds == "hinge"]] *= np.maximum(turned, 1.0) / max(1.0, turned.max(initial=0.0))
    most = np.maximum(most, own)
    for at in (start + k for start in starts[kinds == "free"] for k in (0, 3)):
        most[at : at + 3] = max(own[at : at + 3].max(), leads[at : at + 3].max())
    return most


def rounded(q: Floats) -> float:
    """Return what gaps are measured by at least, m or rad: coordinates may all be zero where lengths are not.

    Args:
        q: of a motion (n, nq).
    """
    return ROUNDING * max(1.0, float(np.max(np.abs(q), initial=0.0)))


def idle(run: Trajectory) -> float:
    """Return the multiplier, N or N m, below which errors are not measured by what rows carry.

    The force is the energy over the way that it moves things: of what falls, its weight. A robot whose
    couplings have nothing to hold in free fall has multipliers of 1e-13 N, and an error of as much is none.
    """
    return IDLE * energy(run) / max(_moved(run), RESTS)


def _moved(run: Trajectory) -> float:
    return float(np.ptp(run.q, axis=0).max(initial=0.0))
