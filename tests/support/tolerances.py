"""By how much a motion depends on its tolerance, beyond what its start makes of it, before it says more of itself."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from friction_scenes import run

from crossbody.cases import Outcome, Trajectory
from crossbody.cases.scene import Scene
from crossbody.reference.kinds import Floats

INSTANTS, STEPS = 201, 150_000
FINE = 1e-11
MOVED = (1e-9, 1e-5)
"""Parts of the largest speed by which a start is moved to see how fast motions part: an error grows as either does, one
choice that rounding makes as the first alone."""
ALLOWED = 1e3
KNOWN_TO = 1e-8
"""The finest tolerance that counts: a slip below 1e-9 of the largest speed has no direction at any, and its friction is
then either a bound or what holds it."""


def known_until(motion: Trajectory) -> float:
    """Return the first instant of which a run says that others may follow, or that no more than one was looked for."""
    return min(motion.determined_until, motion.unique_until)


def ended(motion: Trajectory) -> float:
    """Return where a run ends, s: no sample need be there."""
    if motion.outcome is Outcome.FINISHED or "t = " not in motion.message:
        return float(motion.t[-1])
    return float(motion.message.split("t = ")[1].split(" s")[0])


class Tolerances:
    """One start at its finest tolerance, and beside it."""

    def __init__(self, scene: Scene, q: Floats, v: Floats, t_end: float) -> None:
        self.scene, self.q, self.v, self.at = scene, q, v, np.linspace(0.0, t_end, INSTANTS)
        self.fine = self.run(FINE, v)
        self.known, self.grown = known_until(self.fine), np.full(INSTANTS, math.inf)
        self.truth = self.places(self.fine)
        for moved in MOVED:
            self.grown = np.minimum(self.grown, self._growth(moved))

    def run(self, rtol: float, v: Floats) -> Trajectory:
        return run(self.scene, self.q, v, float(self.at[-1]), rtol=rtol, samples=self.at, max_steps=STEPS, ledger=False)

    def places(self, motion: Trajectory) -> Floats:
        """Return q at the instants up to where a motion ends."""
        count = int(np.searchsorted(self.at, motion.t[-1], side="right"))
        return motion.q[np.searchsorted(motion.t, self.at[:count], side="right") - 1]

    def _growth(self, moved: float) -> Floats:
        """By how much errors of the start have grown at every instant; infinite where a neighbour gets no further."""
        most = np.ones(INSTANTS)
        for seed in range(2):
            off = moved * float(np.abs(self.v).max())
            way = np.random.default_rng(seed).choice([-1.0, 1.0], size=len(self.v))
            beside = self.run(FINE, self.v + off * way)
            places, apart = self.places(beside), np.full(INSTANTS, math.inf)
            count = min(len(places), len(self.truth))
            apart[:count] = np.abs(places[:count] - self.truth[:count]).max(axis=1) / off
            most = np.maximum(most, np.maximum.accumulate(apart))
            self.known = min(self.known, known_until(beside))
        return most

    def parted(self, rtol: float) -> tuple[float, Any]:
        """By how many times rtol, and what its start makes of that, a run is off before either says anything.

        Returns:
            That, infinite for one that ends elsewhere, and what is to be shown of it.
        """
        motion = self.run(rtol, self.v)
        known, places = min(self.known, known_until(motion)), self.places(motion)
        count = min(len(places), len(self.truth))
        part = np.abs(places[:count] - self.truth[:count]).max(axis=1) / max(1.0, float(np.abs(self.truth).max()))
        finest = max(rtol, KNOWN_TO)
        worst = float((part / self.grown[:count] / finest)[self.at[:count] < known].max(initial=0.0))
        ends = ended(motion), ended(self.fine)
        last = float(self.grown[count - 1])
        if min(ends) < known and abs(ends[0] - ends[1]) > ALLOWED * finest * last:
            worst = math.inf
        return worst, (rtol, worst, ends, motion.outcome, self.fine.outcome, known)
