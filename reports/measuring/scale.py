"""What errors are measured by: of a coordinate its own largest, or of its like where it rests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crossbody.cases import Coordinate, Trajectory
from crossbody.cases.arrays import Floats

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
