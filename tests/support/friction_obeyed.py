"""What every row of a motion with friction, or beside it, must show: cones, power of friction, nothing that pulls."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from friction_scenes import account

from crossbody.cases import Mode, Outcome, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Scene
from crossbody.reference import System
from crossbody.reference.tree.system import system

STILL = 1e4  # times rtol, of the speeds of a motion: below, a slip that begins counts from what counted as none
DRIFT = 1e3  # times rtol, of the same: a contact that sticks is no faster
BELOW = 1e4  # times rtol, of the largest coordinate: a contact that is FREE is no deeper
RANK = 1e-9  # of rows of size 1: below, one depends on others
JAMMED = 1e-8  # determinant, of rows of size 1
SHARED = 4.0  # times the least norm of forces that are shared in many ways, in which they may be
PULLS = 1e-5  # of the largest multiplier: rounding of loads that are shared


def obeys(scene: Scene, run: Trajectory, mu: float, rtol: float) -> int:
    """Check every row of a motion but those at the instants of events, which belong to two sets of modes.

    Returns:
        How many slips had a power to check.
    """
    instants = {event.t for event in run.events}
    made, count = system(scene, case_of(scene).law), 0
    most, gained = float(np.abs(run.lam).max(initial=0.0)), _gained(scene, made)
    for t, q, v, lam, mode in zip(run.t, run.q, run.v, run.lam, run.mode, strict=True):
        if t in instants or (run.outcome is Outcome.PAINLEVE and t == run.t[-1]):  # where no set of modes is known
            continue
        assert np.all(np.isfinite(lam))
        gap, rate = made.gap(q, v)
        small = rtol * max(float(np.abs(run.v).max()), gained)
        count += _rubs(_Rows(made, q, v, mode, lam, rate, mu), small)
        _presses(made, lam, mode, gap, most, rtol * max(1.0, float(np.abs(run.q).max())))
    assert account(run) < 1e3 * rtol * max(1.0, float(np.abs(run.total_energy).max()))
    return count


def _gained(scene: Scene, made: System) -> float:
    """What a body gains by gravity while a contact returns to its law, m/s: at rest speeds tell of errors alone."""
    returns = np.maximum(made.a1, np.sqrt(made.a0))[np.asarray(made.unilateral, dtype=bool)]
    return float(np.linalg.norm(scene.gravity) / returns.min(initial=np.inf))


@dataclass(frozen=True)
class _Rows:
    """The rows in contact at an instant; the multipliers of `unknown` follow from laws of their own."""

    made: System
    q: np.ndarray
    v: np.ndarray
    mode: np.ndarray
    lam: np.ndarray
    rate: np.ndarray
    mu: float

    @cached_property
    def follows(self) -> np.ndarray:
        return np.asarray(self.made.follows)

    def ways(self, i: int) -> np.ndarray:
        return np.flatnonzero(self.follows == i)

    def dry(self, i: int) -> bool:
        return bool(self.made.dry[i])

    @cached_property
    def unknown(self) -> np.ndarray:
        """Rows of what holds, presses and sticks, but none of what slides."""
        mode = self.mode[np.where(self.follows < 0, np.arange(len(self.mode)), self.follows)]
        known = (mode == Mode.SLIP) & ((self.follows >= 0) | np.asarray(self.made.dry, dtype=bool))
        return np.flatnonzero((mode != Mode.FREE) & (mode != Mode.BALLISTIC) & ~known)

    @cached_property
    def all(self) -> np.ndarray:
        """Return H of all rows."""
        return self.made.constraint(self.q, self.v)[0]

    @cached_property
    def moved(self) -> np.ndarray:
        """M^-1 H^T of the unknown rows."""
        return np.linalg.solve(self.made.mass_matrix(self.q, self.v), self.all[self.unknown].T)

    @cached_property
    def size(self) -> np.ndarray:
        """Return the square roots of the accelerations of the unknown rows by their own multipliers of 1."""
        size = np.sqrt(np.einsum("ij,ji->i", self.all[self.unknown], self.moved))
        return np.where(size > 0.0, size, 1.0)

    @cached_property
    def matrices(self) -> tuple[np.ndarray, np.ndarray]:
        """How the unknown rows accelerate with their multipliers alone, and with the friction of slips beside them."""
        forces = self.all[self.unknown]
        for a, i in enumerate(self.unknown):
            force = self.lam[self.ways(i)]
            if self.mode[i] == Mode.SLIP and np.any(force):
                forces[a] += self.mu * force / np.linalg.norm(force) @ self.all[self.ways(i)]
        scale = np.outer(self.size, self.size)
        return self.all[self.unknown] @ self.moved / scale, (forces @ self.moved).T / scale

    def jammed(self) -> float:
        """Determinant of the rows that do not depend on each other: negative where contacts have passed a jam."""
        alone, rubs = self.matrices
        sizes, ways = np.linalg.eigh(alone)
        ways = ways[:, sizes > RANK]
        return float(np.linalg.det(ways.T @ rubs @ ways))

    def pull(self) -> float:
        """What brings contacts that stick, and drift, back to rest makes of all friction.

        It is small but where rows nearly depend on each other, so that they could hardly move as they drift.
        """
        stick = (self.follows[self.unknown] >= 0) & (self.mode[self.unknown] == Mode.STICK)
        wanted = np.where(stick, np.asarray(self.made.a1)[self.unknown] * self.rate[self.unknown], 0.0)
        found = np.linalg.lstsq(self.matrices[1], wanted / self.size, rcond=RANK)[0]
        return float(np.linalg.norm((found / self.size)[stick]))


def _rubs(rows: _Rows, small: float) -> int:
    """Check what sticks and slides; return how many slips had a power to check."""
    count, slides = 0, False
    for i in np.flatnonzero((rows.mode == Mode.STICK) | (rows.mode == Mode.SLIP)):
        force, slip, sticks = rows.lam[rows.ways(i)], rows.rate[rows.ways(i)], rows.mode[i] == Mode.STICK
        size = float(np.linalg.norm(slip))
        bound = rows.made.friction_loss[i] if rows.dry(i) else rows.mu * max(rows.lam[i], 0.0)
        assert not sticks or rows.dry(i) or size < DRIFT * small
        beyond = np.linalg.norm(force) - bound * (1.0 + 1e-9) - 1e-9
        assert beyond <= (SHARED * rows.pull() if sticks and beyond > 0.0 else 0.0)
        if not sticks and size > STILL * small:
            assert abs(force @ slip + bound * size) <= 1e-9 * bound * size + 1e-12
            count += 1
        slides = slides or not (sticks or rows.dry(i))
    assert not slides or rows.jammed() > -JAMMED
    return count


def _presses(made: System, lam: np.ndarray, mode: np.ndarray, gap: np.ndarray, most: float, small: float) -> None:
    """Check that no contact pulls, and that none is below the surface that has not touched it."""
    contacts = np.asarray(made.unilateral, dtype=bool) & (np.asarray(made.follows) < 0)
    assert np.all(gap[contacts & (mode == Mode.FREE)] > -BELOW * small)
    assert np.all(lam[contacts & (mode != Mode.FREE)] >= -PULLS * most - 1e-9)
