"""Switches on which a motion goes on while a force may jump, as where the gap of a solid bends at the end of a face.

The side of a kink is a discrete variable that the kernels read (`System.kinks`); 0 leaves it to the state's own
values. On the arcs beside such an instant the side is held as the run has it, so that neither arc reaches across.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crossbody.cases import Switch, Trajectory
from crossbody.reference._system import System
from crossbody.reference.kinds import Floats
from crossbody.reference.linear._point import Point, directions
from crossbody.reference.linear._variation import Theta
from crossbody.reference.linear.differences import differences

STEP = 1e-4  # of differences, as a part of a variable that is larger than 1


def smooth_switches(run: Trajectory) -> list[Switch]:
    """Return the switches on the way of a motion on which it goes on."""
    return [switch for switch in run.switches if switch.smooth and switch.t > 0.0]


def sided(at: Point, run: Trajectory, start: float, end: float) -> Point:
    """Return the point with the sides of kinks as they are on an arc of a motion, where one of its ends is a switch."""
    sides = {s.variable: s.after for s in smooth_switches(run) if s.t == start < end}
    sides |= {s.variable: s.before for s in smooth_switches(run) if s.t == end}
    return with_sides(at, sides)


def with_sides(at: Point, sides: dict[int, int]) -> Point:
    """Return the point with discrete variables that have these values, and all other kinks left to the state."""
    system = at.system
    if not system.kinks:
        return at
    p, first = np.array(system.p), _first(system)
    for variable, side in sides.items():
        p[first + variable] = side
    return replace(at, p=p)


def watched_gradient(at: Point, over: Theta, switch: Switch, rtol: float) -> Floats:
    """Return the gradient, by (dq, v, theta, t), of what a switch is looked for in: by differences, as it is real."""
    system, n, N = at.system, at.system.n, directions(at.system, at.q)
    base = np.array(with_sides(at, {switch.variable: switch.before}).given("p"))
    base[len(base) - len(at.u) - 1 :] = [rtol, *at.u]
    moved = [place for field, place in over.places if field == "p"]
    which = system.guards - (np.size(system.discrete) - switch.variable)
    sizes = np.ones(2 * n + len(moved))
    sizes[2 * n :] = np.maximum(np.abs(base[moved]), 1e-12)

    def value(x: Floats) -> Floats:
        p, found = base.copy(), np.zeros(system.guards)
        p[moved] += (sizes * x)[2 * n :]
        system.watch(at.t, at.q + N @ x[:n], at.v + x[n : 2 * n], p, found)
        return found[which : which + 1]

    slopes = differences(value, np.zeros(len(sizes)), STEP)[0] / sizes
    whole = np.zeros(2 * n + len(over.places) + 1)
    whole[: 2 * n] = slopes[: 2 * n]
    whole[[2 * n + k for k, (field, _) in enumerate(over.places) if field == "p"]] = slopes[2 * n :]
    return whole


def _first(system: System) -> int:
    """Return where the discrete variables stand in p."""
    return len(system.p) - system.latched - int(np.size(system.discrete))
