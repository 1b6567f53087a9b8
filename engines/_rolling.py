"""Whether a cylinder rolled on its rim through no tilt, where rigid rows do not say how it goes on.

The lowest point of a cap goes round its rim the faster, the less the tilt. What passes level by at
a least distance goes on by an angle that is not small, however small the distance, and on the other
side by the opposite one; what passes through level in a plane touches with the opposite point.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crossbody.cases import Outcome, Trajectory
from crossbody.cases.contacts import CLOSED
from crossbody.cases.scene import Scene
from crossbody.cases.scene_contacts import contacts

ROLLS = 1e-3  # of the rate of the tilt, what of it is across the tilt in a motion that is not in a plane
TILTED = 1  # value of the variable that says how a cylinder is, off its caps


def determined(scene: Scene, run: Trajectory) -> Trajectory:
    """Return the run, or one that is ill posed from where a cylinder rolled through no tilt."""
    told = [_rolled(run, variable, row, name) for variable, row, name in _cylinders(scene, run.gap.shape[1])]
    first = min(filter(None, told), default=None)
    if first is None or not run.outcome.ok:
        return run
    return replace(run, outcome=Outcome.ILL_POSED, message=first[1])


def _cylinders(scene: Scene, nc: int) -> list[tuple[int, int, str]]:
    """Return of every cylinder over a plane its variable, its first row, and the name of the pair."""
    met = contacts(scene)
    variable = sum(joint.type == "ball" and joint.limited for joint in scene.joints)
    row, found = nc - sum(len(contact.rows) for contact in met), []
    for contact in met:
        if contact.second.type == "cylinder" and contact.first.type == "plane":
            found.append((variable, row, contact.pair.name))
        variable, row = variable + (contact.parallel > 0.0), row + contact.places
    return found


def _rolled(run: Trajectory, variable: int, row: int, name: str) -> tuple[float, str] | None:
    """Return when a cylinder rolled through no tilt first, and what is said about it."""
    for switch in run.switches:
        if switch.variable != variable or switch.before != TILTED:
            continue
        there = np.flatnonzero(run.t == switch.t)
        if not len(there) or there[-1] + 1 >= len(run.t):
            continue  # only samples are kept
        k, cap = int(there[-1]), row + (0 if switch.after == TILTED + 1 else 2)
        before = run.mode[there[0]]
        if before[cap] not in CLOSED or before[cap + 1] in CLOSED:
            continue
        ahead, across = np.diff(run.gap[k : k + 2, row + 2 : row + 4] - run.gap[k : k + 2, row : row + 2], axis=0)[0]
        if abs(across) > ROLLS * np.hypot(ahead, across):
            return switch.t, (
                f"Pair {name!r} rolls on its rim through zero tilt at t = {switch.t:.12g} s: the rows do not determine "
                f"to which side the lowest point moves. {Outcome.ILL_POSED.advice}"
            )
    return None
