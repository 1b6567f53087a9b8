"""How far contacts are from their bounds, or from a jam, and what is watched of that along a step."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core import jams
from crossbody.reference.core.coulomb import solve
from crossbody.reference.core.filters import STAGES_RANGE
from crossbody.reference.core.friction import bound, has_friction, is_tangent, most_drift, slip
from crossbody.reference.core.layout import NODES, Model, Work
from crossbody.reference.kinds import Array

UNKNOWN = 1e3  # times what modes are decided to, by which a force may be off at a step's end


@compiled
def without_pull(s: Any, m: Model, w: Work) -> None:
    """Solve again without what pulls sticking rows back, whose noise would move the instant at which they slip."""
    for j in range(s.na):
        i = w.idx[j]
        if is_tangent(m, i) and not w.slides[i]:
            w.r[j] += w.law[i, 1] * w.hda[j]
    solve(s, m, w, w.r, w.la)


@compiled
def watch_friction(s: Any, m: Model, w: Work, out: Array) -> None:
    """Write how far every contact is from sliding, or one that slides from a jam, after an evaluation."""
    without_pull(s, m, w)
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and not w.slides[i]:
            out[i] = margin(s, m, w, i)
    jams.watch(s, m, w, out)


@compiled
def _within_bound(m: Model, i: int, lam: Array, normal: int, first: int) -> float:
    """By how much friction of contact i is below its bound; its rows stand at `normal` and from `first` on in lam."""
    square = 0.0
    for t in range(first, first + m.tangents[i]):
        square += lam[t] * lam[t]
    return float(bound(m, i, lam[normal]) - np.sqrt(square))


@compiled
def holds_on(s: Any, m: Model, w: Work, i: int) -> bool:
    """Whether a contact that sticks stays clear of its bound, as far as the stages tell, and where it is."""
    if slip(m, w, i, w.rates[NODES - 1]) > most_drift(s, w, i):
        return False
    low, high = np.inf, -np.inf
    for stage in range(s.end + 1):
        lam = w.lams[0] if stage == 0 else (w.lam_at[stage] if stage < s.end else w.lams[NODES - 1])
        value = _within_bound(m, i, lam, i, m.tangent[i])
        low, high = min(low, value), max(high, value)
    return bool(low > 0.0 and low > STAGES_RANGE * (high - low))


@compiled
def within_bound(m: Model, w: Work, i: int) -> float:
    """By how much friction of contact i is below its bound, from the multipliers in w.la."""
    return float(_within_bound(m, i, w.la, w.listed[i], w.listed[m.tangent[i]]))


@compiled
def margin(s: Any, m: Model, w: Work, i: int) -> float:
    """How far contact i is from what ends its sticking as it does: its bound, or that rows depend on each other."""
    until_apart = bound(m, i, w.la[w.listed[i]]) * (1.0 - s.growth)
    return float(min(within_bound(m, w, i), until_apart) if s.growth > 0.0 else within_bound(m, w, i))


@compiled
def beyond_bound(s: Any, m: Model, w: Work) -> int:
    """Return the contact that sticks at the step's end by far more than its bound, -1 if none does.

    No event has ended that: its rows became others' on the way, or a guard was lost. Shared loads are left to theirs.
    """
    lam = w.lams[NODES - 1]
    for j in range(s.na if s.dependent_rows == 0 else 0):
        i = w.idx[j]
        if has_friction(m, i) and not w.slides[i] and w.gram[j, j] > 0.0:
            pull = m.alpha[m.tangent[i], 1] * most_drift(s, w, i) / w.gram[j, j]
            most = bound(m, i, max(lam[i], 0.0)) + pull + UNKNOWN * w.tolerated[i]
            if _within_bound(m, i, lam, i, m.tangent[i]) < -most:
                return int(i)
    return -1
