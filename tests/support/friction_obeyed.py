"""What every row of a motion with friction, or beside it, must show: cones, power of friction, nothing that pulls."""

from __future__ import annotations

import numpy as np
from friction_scenes import account

from crossbody.cases import Mode, Outcome, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Scene
from crossbody.reference import System
from crossbody.reference.tree.system import system

STILL = 1e4  # times rtol, of the largest speed: below, a slip that begins counts from what counted as none
DRIFT = 1e3  # times rtol, of the largest speed: a contact that sticks is no faster
BELOW = 1e4  # times rtol, of the largest coordinate: a contact that is FREE is no deeper
HEAVIER = 4.0  # than all bodies together is what a contact moves whose neighbours brake it
PULLS = 1e-5  # of the largest multiplier: rounding of loads that are shared


def obeys(scene: Scene, run: Trajectory, mu: float, rtol: float) -> int:
    """Check every row of a motion but those at the instants of events, which belong to two sets of modes.

    Returns:
        How many slips had a power to check.
    """
    instants = {event.t for event in run.events}
    made, count = system(scene, case_of(scene).law), 0
    most, mass = float(np.abs(run.lam).max(initial=0.0)), sum(body.mass for body in scene.bodies)
    for t, q, v, lam, mode in zip(run.t, run.q, run.v, run.lam, run.mode, strict=True):
        if t in instants or (run.outcome is Outcome.PAINLEVE and t == run.t[-1]):  # where no set of modes is known
            continue
        assert np.all(np.isfinite(lam))
        gap, rate = made.gap(q, v)
        count += _rubs(made, mass, lam, mode, rate, mu, rtol * float(np.abs(run.v).max()))
        _presses(made, lam, mode, gap, most, rtol * max(1.0, float(np.abs(run.q).max())))
    assert account(run) < 1e3 * rtol * max(1.0, float(np.abs(run.total_energy).max()))
    return count


def _rubs(
    made: System, mass: float, lam: np.ndarray, mode: np.ndarray, rate: np.ndarray, mu: float, small: float
) -> int:
    """Check what sticks and slides; return how many slips had a power to check."""
    follows, law, count = np.asarray(made.follows), np.asarray(made.a1), 0
    held = np.flatnonzero((follows >= 0) & (mode[np.maximum(follows, 0)] == Mode.STICK))
    pull = HEAVIER * mass * float((law[held] * np.abs(rate[held])).sum())  # what holds drifts down is no friction
    for i in np.flatnonzero((mode == Mode.STICK) | (mode == Mode.SLIP)):
        ways, dry = np.flatnonzero(follows == i), bool(made.dry[i])
        force, slip = lam[ways], rate[ways]
        size, bound = float(np.linalg.norm(slip)), made.friction_loss[i] if dry else mu * max(lam[i], 0.0)
        assert mode[i] == Mode.SLIP or dry or size < DRIFT * small
        assert np.linalg.norm(force) <= bound * (1.0 + 1e-9) + 1e-9 + (pull if mode[i] == Mode.STICK else 0.0)
        if mode[i] == Mode.SLIP and size > STILL * small:
            assert abs(force @ slip + bound * size) <= 1e-9 * bound * size + 1e-12
            count += 1
    return count


def _presses(made: System, lam: np.ndarray, mode: np.ndarray, gap: np.ndarray, most: float, small: float) -> None:
    """Check that no contact pulls, and that none is below the surface that has not touched it."""
    contacts = np.asarray(made.unilateral, dtype=bool) & (np.asarray(made.follows) < 0)
    assert np.all(gap[contacts & (mode == Mode.FREE)] > -BELOW * small)
    assert np.all(lam[contacts & (mode != Mode.FREE)] >= -PULLS * most - 1e-9)
