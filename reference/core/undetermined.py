"""How far bodies may move by what the law leaves open: loads of contacts that slide, which may be shared in many ways.

Multipliers z of rows in contact with A z = 0 change none of the rows that are solved for. Where they accelerate bodies
all the same, along contacts that slide, one share of a load is as good as another as long as no contact pulls. A motion
is undetermined once that has moved it by more than contacts that stick may drift. Three things bound it:

    the shares      0 <= lam + c z
    the slip        which a share that brakes it stops, so that it lasts no longer than that takes
    what sticks     it takes back what has slid with it, as an impulse would
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.complete import factor_complete
from crossbody.reference.core.coulomb import respond
from crossbody.reference.core.friction import has_friction, is_dry, is_tangent, most_drift
from crossbody.reference.core.layout import Model, Work
from crossbody.reference.core.loops import complete
from crossbody.reference.core.unknowns import fill

MOVES = 1e-9  # part of the terms of a change of v' above which it is none of rounding
MOST = 1e3  # times the largest load: what contacts that press on each other may carry has no bound of its own


@compiled
def _change_nothing(s: Any, m: Model, w: Work, rank: int, k: int) -> None:
    """Fill w.trial with the multipliers by column k of the factors, behind their rank, that change no row."""
    for a in range(rank - 1, -1, -1):  # A z = 0
        value = -w.matrix[a, k]
        for c in range(a + 1, rank):
            value -= w.matrix[a, c] * w.beside[c]
        w.beside[a] = value / w.matrix[a, a]
    for j in range(s.na):
        w.trial[j] = 0.0
    for a in range(rank + 1):
        b = w.across[a if a < rank else k]
        j = w.unknown[b]
        i = w.idx[j]
        w.trial[j] = (w.beside[a] if a < rank else 1.0) / w.size[b]
        if has_friction(m, i) and w.slides[i]:
            for c in range(w.listed[m.tangent[i]], w.listed[m.tangent[i]] + m.tangents[i]):
                w.trial[c] = -m.friction[i] * w.trial[j] * w.along[c]


@compiled
def _move(s: Any, m: Model, w: Work) -> bool:
    """Whether the multipliers in w.trial move anything; those of contacts that stick together never do."""
    moved, size = 0.0, 0.0
    for c in range(s.n):
        change, terms = 0.0, 0.0
        for j in range(s.na):
            i = w.idx[j]
            if m.span[i, 0] <= c < m.span[i, 1]:
                change += w.X[j, c] * w.trial[j]
                terms += abs(w.X[j, c] * w.trial[j])
        moved, size = max(moved, abs(change)), max(size, terms)
    return bool(moved > MOVES * size)


@compiled
def _range(s: Any, m: Model, w: Work) -> float:
    """By how many times w.trial two shares differ at most of which none pulls; w.lam0 has the one that is taken."""
    least, most, load, size = -np.inf, np.inf, 0.0, 0.0
    for j in range(s.na):
        i, z = w.idx[j], w.trial[j]
        if m.unilateral[i] and not is_tangent(m, i) and z != 0.0:
            lam = max(w.lam0[i], 0.0)
            load, size = max(load, lam), max(size, abs(z))
            if z > 0.0:
                least = max(least, -lam / z)
            else:
                most = min(most, -lam / z)
    return float(min(most - least, MOST * load / size)) if size > 0.0 else 0.0


@compiled
def _add(s: Any, m: Model, w: Work, x: Any, factor: float, out: Any) -> None:
    """Add to out (n,), by sign towards what it is already, what multipliers x of the rows in contact do to v'."""
    for turn in range(2):
        ahead = 0.0
        for j in range(s.na):
            i = w.idx[j]
            for c in range(m.span[i, 0], m.span[i, 1]):
                if turn == 0:
                    ahead += w.X[j, c] * x[j] * out[c]
                else:
                    out[c] += factor * w.X[j, c] * x[j]
        if ahead < 0.0:
            factor = -factor


@compiled
def _row(m: Model, w: Work, j: int, x: Any) -> float:
    """What x (n,) is along the row in place j."""
    total = 0.0
    for c in range(m.span[w.idx[j], 0], m.span[w.idx[j], 1]):
        total += w.H[j, c] * x[c]
    return float(total)


@compiled
def _fastest(s: Any, m: Model, w: Work) -> float:
    """The fastest slip, m/s; leaves in s.open_gain how fast w.open_rate changes any."""
    fastest, s.open_gain = 0.0, 0.0
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and w.slides[i] and not is_dry(m, i):
            slip, gain = 0.0, 0.0
            for c in range(w.listed[m.tangent[i]], w.listed[m.tangent[i]] + m.tangents[i]):
                slip += w.hda[c] ** 2
                gain += _row(m, w, c, w.open_rate) ** 2
            fastest, s.open_gain = max(fastest, np.sqrt(slip)), max(s.open_gain, np.sqrt(gain))
    return float(fastest)


@compiled
def _take_shares(s: Any, m: Model, w: Work) -> None:
    """Leave in w.open_rate by how much v' of two shares may differ, for the rows last factored."""
    w.open_rate[:] = 0.0
    if s.na > 0 and s.short > 0:
        s.spent_factors = 1
        fill(s, m, w)
        rank = factor_complete(w.matrix, s.unknowns, s.unknowns, w.down, w.across, s.unknowns)
        for k in range(rank, s.unknowns):
            _change_nothing(s, m, w, rank, k)
            if _move(s, m, w):
                if s.loops:
                    complete(s, m, w, w.r, w.trial, False)
                _add(s, m, w, w.trial, _range(s, m, w), w.open_rate)
    s.open_slip, size = _fastest(s, m, w), 0.0
    for c in range(s.n):
        size = max(size, abs(w.open_rate[c]))
    if s.open_gain > 0.0:
        s.open_lever = s.open_gain / size


@compiled
def _account(s: Any, m: Model, w: Work) -> None:
    """Add the way that shares may have made since the last account; note when that is more than a drift."""
    dt, before, gain = s.t - s.open_t, s.open_way, s.open_gain
    if gain > 0.0:
        s.open_for = min(s.open_for + dt, max(s.open_slip, _fastest(s, m, w)) / gain)
    speed = 0.0
    for c in range(s.n):
        speed = max(speed, abs(w.open_v[c]) + abs(w.open_rate[c]) * s.open_for)
    s.open_way += s.open_lever * speed * dt
    most = 0.0
    for i in range(s.nc):
        most = max(most, most_drift(s, w, i) * s.t_end)
    if s.open_way > most and not s.indeterminate:
        s.indeterminate, s.determined_until = 1, s.open_t + dt * max(most - before, 0.0) / (s.open_way - before)
    s.open_t = s.t


@compiled
def _take_back(s: Any, m: Model, w: Work) -> None:
    """Take from the velocities that are open what contacts that stick do not let them have."""
    for j in range(s.na):
        i = w.idx[j]
        w.r[j] = -_row(m, w, j, w.open_v) if is_tangent(m, i) and not w.slides[i] else 0.0
    respond(s, m, w, w.r, w.la)
    if s.loops:
        complete(s, m, w, w.r, w.la, False)
    for j in range(s.na):
        for c in range(m.span[w.idx[j], 0], m.span[w.idx[j], 1]):
            w.open_v[c] += w.X[j, c] * w.la[j]


@compiled
def follow_shares(s: Any, m: Model, w: Work, settled: bool) -> None:
    """Account for what is open at the end of a step, or where modes have `settled`; rows as they were last evaluated.

    Leaves s.indeterminate and s.determined_until, and in s.open_way how far apart two shares may have moved anything.
    """
    if s.loops_press:
        return
    _account(s, m, w)
    if settled:
        ahead = 0.0
        for c in range(s.n):
            ahead += w.open_v[c] * w.open_rate[c]
        for c in range(s.n):
            w.open_v[c] += w.open_rate[c] * (-s.open_for if ahead < 0.0 else s.open_for)
        s.open_for = 0.0
        _take_back(s, m, w)
    _take_shares(s, m, w)
