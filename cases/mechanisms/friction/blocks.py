"""Exact motions of a block on a slope: as a point, and as a box that lies on four corners."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.mechanisms.friction.motions import Motion, Rows, Stage, shares, slide
from crossbody.cases.mechanisms.friction.scene import MASS, field
from crossbody.cases.scene import Vector
from crossbody.cases.trajectory import Mode

CORNERS = np.array([[1.0 if k >> bit & 1 else -1.0 for bit in range(3)] for k in range(8)])
"""Signs of a box's corners, in the order of their rows."""


def accelerations(p: Mapping[str, float]) -> tuple[float, float]:
    """Return the acceleration downhill, and the most that friction gives, m/s^2."""
    down, _, press = field(p, p["slope"])
    return down, -p["mu"] * press


def point(p: Mapping[str, float]) -> Motion:
    """Return the motion of what touches at one place and never turns: q = (x, y, z), rows (n, t1, t2)."""
    down, _, press = field(p, p["slope"])

    def rows(path: Callable[[Floats], tuple[Floats, Floats, Floats]]) -> Callable[[Floats], Rows]:
        def at(s: Floats) -> Rows:
            place, v, push = path(s)
            still = np.zeros((len(s), 1))
            lam = np.concatenate([still - MASS * press, MASS * push], axis=1)
            return np.append(place, still, axis=1), np.append(v, still, axis=1), np.zeros((len(s), 3)), lam

        return at

    def energy(q: Floats, v: Floats) -> Floats:
        return np.stack(
            [0.5 * MASS * np.sum(v**2, axis=1), -MASS * down * q[:, 0] - MASS * press * p["radius"]], axis=1
        )

    stages = slide(*accelerations(p), p["speed"], math.radians(p["angle"]))
    return Motion([Stage(t, (int(mode),) * 3, rows(path)) for t, mode, path in stages], 1, energy, p["t_end"])


def box(p: Mapping[str, float], half: Vector) -> Motion:
    """Return the motion of a free box on its lower corners that does not tip: 8 normal rows, then 16."""
    down, _, press = field(p, p["slope"])
    low = np.flatnonzero(CORNERS[:, 2] < 0.0)
    arms = CORNERS[low, :2] * np.array(half[:2])

    def rows(path: Callable[[Floats], tuple[Floats, Floats, Floats]]) -> Callable[[Floats], Rows]:
        def at(s: Floats) -> Rows:
            place, v, push = path(s)
            q, lam, gap = np.zeros((len(s), 7)), np.zeros((len(s), 24)), np.zeros((len(s), 24))
            q[:, :2], q[:, 2], q[:, 3] = place, half[2], 1.0
            gap[:, np.setdiff1d(np.arange(8), low)] = 2.0 * half[2]
            # The force below the centre tips the box by its height: what is in front bears more.
            bear = shares(np.full(len(s), -MASS * press), arms, -MASS * half[2] * push)
            lam[:, low] = bear
            for k in (0, 1):
                lam[:, 8 + 2 * low + k] = bear * push[:, k : k + 1] / -press
            return q, np.concatenate([v, np.zeros((len(s), 4))], axis=1), gap, lam

        return at

    def energy(q: Floats, v: Floats) -> Floats:
        return np.stack([0.5 * MASS * np.sum(v**2, axis=1), -MASS * (down * q[:, 0] + press * q[:, 2])], axis=1)

    def modes(mode: Mode) -> tuple[int, ...]:
        normal = [int(mode if k in low else Mode.FREE) for k in range(8)]
        return (*normal, *(one for one in normal for _ in (0, 1)))

    stages = slide(*accelerations(p), p["speed"], math.radians(p["angle"]))
    return Motion([Stage(t, modes(mode), rows(path)) for t, mode, path in stages], 8, energy, p["t_end"])
