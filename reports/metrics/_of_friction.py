"""Numbers of contacts with friction, which every run is measured by that has some: every function is a metric."""

from __future__ import annotations

import numpy as np

from crossbody.cases import Case, Mode, Trajectory
from crossbody.reports.measuring.friction import directed, rubbing, sliding

UNITS = {"creep_speed": "m/s", "friction_angle": "rad", "friction_power": "W"}
ALWAYS = True


def cone_violation(run: Trajectory, case: Case) -> float | None:
    """How far friction exceeds mu times the normal force, over the largest bound, where slips have directions."""
    if (found := rubbing(run, case)) is None:
        return None
    bound = found.mu * found.normal
    most = float(np.max(bound, initial=0.0))
    over = (np.linalg.norm(found.force, axis=-1) - bound)[directed(run, found)]
    return float(np.max(over, initial=0.0)) / most if most > 0.0 else None


def creep_speed(run: Trajectory, case: Case) -> float | None:
    """Largest slip speed at the end of sticking contacts: zero if friction holds, whatever the bound on its force."""
    if (found := rubbing(run, case)) is None:
        return None
    held = run.mode[-1, found.rows] == Mode.STICK
    return float(np.linalg.norm(found.slip[-1, held], axis=-1).max()) if held.any() else None


def friction_angle(run: Trajectory, case: Case) -> float | None:
    """Largest angle between friction and the direction opposite to the slip, where one slides and all have some."""
    if (found := rubbing(run, case)) is None:
        return None
    slides, speed, force = sliding(run, found)
    slides &= directed(run, found)[:, None]
    if not slides.any():
        return None
    off = found.slip[slides] / speed[slides][:, None] + found.force[slides] / force[slides][:, None]
    return float(2.0 * np.arcsin(0.5 * np.linalg.norm(off, axis=-1)).max())


def friction_power(run: Trajectory, case: Case) -> float | None:
    """Largest power that friction of a pair of shapes supplies: zero if it opposes the slip."""
    if (found := rubbing(run, case)) is None:
        return None
    return float(np.max(found.of_pairs(np.sum(found.force * found.slip, axis=-1)), initial=0.0))
