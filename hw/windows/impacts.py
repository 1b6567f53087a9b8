"""Impacts in sampled positions: when, how large the impulse is, and which belong together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crossbody.cases.arrays import Floats

PART = 0.25  # of the largest acceleration of the measurement: what is smaller is no impact
CLEAR = 6.0  # times the noise of the second difference
TOGETHER = 0.05  # largest distance of impacts that are the same one, s


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Impacts:
    """Impacts of one motion: centroid of each acceleration, s, and change of the rate in it, m/s."""

    t: Floats
    jump: Floats


def impacts(t: Floats, y: Floats, least: float) -> Impacts:
    """Stretches in which the second difference of positions y, m, at t, s, stays above `least`, m/s^2."""
    rate, middle = np.diff(y) / np.diff(t), 0.5 * (t[1:] + t[:-1])
    step = np.diff(middle)
    jump, hit = np.diff(rate), np.zeros(len(t), dtype=bool)
    hit[1:-1] = jump / step > least
    edges = np.flatnonzero(np.diff(hit.astype(np.int8)))
    found = []
    for a, b in zip(edges[::2], edges[1::2], strict=False):
        weights = jump[a:b]
        found.append((float(np.average(t[a + 1 : b + 1], weights=weights)), float(weights.sum())))
    times, jumps = np.array(found).reshape(-1, 2).T
    return Impacts(t=times, jump=jumps)


def least_of(t: Floats, y: Floats) -> float:
    """An acceleration that only an impact has here, m/s^2: a part of the largest, above the noise."""
    if len(t) < 3:
        return np.inf
    acceleration = np.diff(np.diff(y) / np.diff(t)) / np.diff(0.5 * (t[1:] + t[:-1]))
    noise = 1.4826 * float(np.median(np.abs(acceleration - np.median(acceleration))))
    return max(PART * float(np.max(acceleration, initial=0.0)), CLEAR * noise)


def matched(one: Impacts, other: Impacts) -> tuple[Floats, Floats]:
    """Offsets in time (k,), s, and in the change of rate (k,), m/s, of impacts that belong together."""
    if not len(one.t) or not len(other.t):
        return np.zeros(0), np.zeros(0)
    apart = other.t[None, :] - one.t[:, None]
    nearest, back = np.argmin(np.abs(apart), axis=1), np.argmin(np.abs(apart), axis=0)
    own = np.flatnonzero(back[nearest] == np.arange(len(one.t)))
    own = own[np.abs(apart[own, nearest[own]]) <= TOGETHER]
    return apart[own, nearest[own]], other.jump[nearest[own]] - one.jump[own]
