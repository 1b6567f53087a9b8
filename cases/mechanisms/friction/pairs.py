"""Exact motions of a block on a belt, and of a block on a block."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.mechanisms.friction.blocks import CORNERS
from crossbody.cases.mechanisms.friction.motions import Motion, Rows, Stage, shares
from crossbody.cases.mechanisms.friction.scene import FINGER, GRIP, HIGH, LIFTED, LOW, MASS, UNEVEN
from crossbody.cases.trajectory import Mode

UP_ON_BOX = np.array([-8.0, -15.0, 17.0, 0.0]) / 17.0
"""Upwards along the tangential rows of either side of a box: Frisvad's frames, in axes that no symmetry of it meets."""
BASE = np.flatnonzero(CORNERS[:, 2] < 0.0)  # corners on which a box lies


def belt(p: Mapping[str, float]) -> Motion:
    """Return the motion of a block on a belt of speed V and a spring of rate w^2 from rest.

    It slides, sticks where it is as fast as the belt, and slides from where the spring pulls as
    much as friction gives, on a sine that grazes the belt's speed once a period and does not
    stick there. All of it is seen from the belt: q = (x, z), rows (n, t1, t2).
    """
    V, w, press = p["speed"], math.sqrt(p["stiffness"] / MASS), MASS * p["gravity"]
    reach = p["mu"] * press / p["stiffness"]
    sticks = math.asin(V / (reach * w)) / w if reach * w > V else math.inf
    place = reach * (1.0 - math.cos(w * sticks)) if math.isfinite(sticks) else 0.0

    def rows(begin: float, path: Callable[[Floats], tuple[Floats, Floats, Floats]]) -> Callable[[Floats], Rows]:
        def at(s: Floats) -> Rows:
            x, v, push = path(s)
            still, one = np.zeros(len(s)), np.ones(len(s))
            q, rates = np.stack([x - V * (begin + s), still], axis=1), np.stack([v - V, still], axis=1)
            return q, rates, np.zeros((len(s), 3)), np.stack([press * one, push, still], axis=1)

        return at

    def first(s: Floats) -> tuple[Floats, Floats, Floats]:
        return reach * (1.0 - np.cos(w * s)), reach * w * np.sin(w * s), np.full(len(s), p["mu"] * press)

    def held(s: Floats) -> tuple[Floats, Floats, Floats]:
        return place + V * s, np.full(len(s), V), p["stiffness"] * (place + V * s)

    def last(s: Floats) -> tuple[Floats, Floats, Floats]:
        return reach + V / w * np.sin(w * s), V * np.cos(w * s), np.full(len(s), p["mu"] * press)

    def energy(q: Floats, v: Floats) -> Floats:
        return np.stack([0.5 * MASS * v[:, 0] ** 2, np.full(len(q), press * p["radius"])], axis=1)

    stages = [(0.0, Mode.SLIP, first)]
    if math.isfinite(sticks):
        slips = sticks + (reach - place) / V
        stages += [(sticks, Mode.STICK, held), (slips, Mode.SLIP, last)]
    return Motion([Stage(t, (int(mode),) * 3, rows(t, path)) for t, mode, path in stages], 1, energy, p["t_end"])


def pushed(p: Mapping[str, float]) -> tuple[float, float]:
    """Return the accelerations of the lower and of the upper block, m/s^2, from rest under their pushes.

    One of both pushes is 0.
    """
    m1, m2, g = p["low_mass"], p["high_mass"], p["gravity"]
    floor, top = p["mu"] * (m1 + m2) * g, p["high_mu"] * m2 * g
    low, high = p["push_low"], p["push_high"]
    together = (low + high - floor) / (m1 + m2)
    if low > 0.0:
        if low <= floor:
            return 0.0, 0.0
        return (together, together) if m2 * together <= top else ((low - floor - top) / m1, top / m2)
    if high <= min(floor, top):
        return 0.0, 0.0
    if top <= floor:
        return 0.0, (high - top) / m2
    return (together, together) if high - m2 * together <= top else ((top - floor) / m1, (high - top) / m2)


def stack(p: Mapping[str, float]) -> Motion:
    """Return the motion of both blocks: q of two free joints, 16 normal rows, then 32."""
    m1, m2, g = p["low_mass"], p["high_mass"], p["gravity"]
    a1, a2 = pushed(p)
    on_high = m2 * a2 - p["push_high"]
    on_low = m1 * a1 + m2 * a2 - p["push_low"] - p["push_high"]

    def at(s: Floats) -> Rows:
        one = np.ones(len(s))
        q, v, gap, lam = (np.zeros((len(s), n)) for n in (14, 12, 48, 48))
        q[:, 0], q[:, 7], q[:, 2], q[:, 9] = 0.5 * a1 * s**2, 0.5 * a2 * s**2, LOW[2], 2.0 * LOW[2] + HIGH[2]
        q[:, 3] = q[:, 10] = 1.0
        v[:, 0], v[:, 6] = a1 * s, a2 * s
        off = q[:, 7] - q[:, 0]
        # About the middle of the base; the upper block's weight, off it, and what it drags at its own base.
        tops = np.stack([-HIGH[2] * on_high * one, 0.0 * one], axis=1)
        tipped = LOW[2] * (on_low + on_high) + HIGH[2] * on_high
        floors = np.stack([m2 * g * off - tipped, 0.0 * one], axis=1)
        for first, half, load, force, torque in (
            (0, LOW, (m1 + m2) * g, on_low, floors), (8, HIGH, m2 * g, on_high, tops),
        ):  # fmt: skip
            rows = first + BASE
            gap[:, np.setdiff1d(np.arange(first, first + 8), rows)] = 2.0 * half[2]
            lam[:, rows] = shares(load * one, CORNERS[BASE, :2] * np.array(half[:2]), torque)
            lam[:, 16 + 2 * rows] = lam[:, rows] * force / load
        return q, v, gap, lam

    def energy(q: Floats, v: Floats) -> Floats:
        moving = 0.5 * m1 * v[:, 0] ** 2 + 0.5 * m2 * v[:, 6] ** 2
        return np.stack([moving, g * (m1 * q[:, 2] + m2 * q[:, 9])], axis=1)

    modes = np.full(16, int(Mode.FREE))
    modes[BASE] = int(Mode.SLIP if a1 > 0.0 else Mode.STICK)
    modes[8 + BASE] = int(Mode.SLIP if a1 != a2 else Mode.STICK)
    return Motion([Stage(0.0, (*modes.tolist(), *np.repeat(modes, 2).tolist()), at)], 16, energy, p["t_end"])


def held(p: Mapping[str, float]) -> Motion:
    """Motion of a weight between two fingers: q = (x, z, left, right), rows (n1, n2, four tangential).

    Those of a box that springs press on begin with what mirrors the fingers, which passes on what the left spring has
    over the press; a third normal one is that between the fingers.
    """
    g, press, most, sprung = p["gravity"], p["press"], p["mu"] * p["press"], p["stiffness"] > 0.0
    slips, rubs = MASS * g > 2.0 * most, 4 * (most > 0.0)
    force = most if slips else 0.5 * MASS * g
    falls = g - 2.0 * force / MASS if slips else 0.0
    up = UP_ON_BOX if sprung else np.array([0.0, -1.0, 0.0, -1.0])
    ends = ([-2.0 * UNEVEN * press], [0.0]) if sprung else ([], [])
    lam = np.concatenate([ends[0], [press, press], ends[1], force * up[:rubs]])
    gap = np.where(np.arange(len(lam)) == 3, 2.0 * GRIP, 0.0) if sprung else np.zeros(len(lam))
    kept = sum((2.0 * (0.5 + way * UNEVEN) * press) ** 2 for way in (1, -1)) / (2.0 * p["stiffness"]) if sprung else 0.0
    mode = Mode.CONTACT if not rubs else Mode.SLIP if slips else Mode.STICK
    modes = (*[int(Mode.BILATERAL)] * sprung, *[int(mode)] * 2, *[int(Mode.FREE)] * sprung, *[int(mode)] * rubs)

    def at(s: Floats) -> Rows:
        q, v = np.zeros((len(s), 4)), np.zeros((len(s), 4))
        q[:, 1], v[:, 1] = -0.5 * falls * s**2, -falls * s
        return q, v, np.tile(gap, (len(s), 1)), np.tile(lam, (len(s), 1))

    def energy(q: Floats, v: Floats) -> Floats:
        height = (MASS + 2.0 * FINGER) * g * LIFTED + kept
        return np.stack([0.5 * MASS * v[:, 1] ** 2, MASS * g * q[:, 1] + height], axis=1)

    return Motion([Stage(0.0, modes, at)], len(lam) - rubs, energy, p["t_end"], held=int(sprung))
