"""Closed-form arcs of an affine scene: M, H constant, f constant between inputs, every active row linear.

Each active gap obeys its own scalar equation whatever the masses, and the motion follows from the gaps. With
a_c = M^-1 (f - H^T G^-1 H M^-1 f), the acceleration that holds the active rows,

    q(t) = q + v t + a_c t^2/2 + M^-1 H^T G^-1 (h(t) - h - h' t)
    v(t) = v + a_c t           + M^-1 H^T G^-1 (h'(t) - h')
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.acceleration import GENERAL, accelerate, push_rows
from crossbody.reference.core.algebra import inverse_diagonal, solve_schur
from crossbody.reference.core.layout import Model, Work
from crossbody.reference.kinds import Array, Bytes

NEGLIGIBLE = 1e-3  # part of the tolerance that the cubic term may cost


@compiled
def linear_arc(a0: float, a1: float, h: float, hd: float, t: float) -> tuple[float, float]:
    """Gap and rate after time t of h'' + a1 h' + a0 h = 0, accurate through critical damping."""
    sigma = 0.5 * a1
    gap = sigma * sigma - a0
    x = np.sqrt(abs(gap)) * t
    if gap > 0.0 and x > 1.0:
        fast = -(sigma + np.sqrt(gap))
        slow = a0 / fast
        c = (hd - fast * h) / (slow - fast)
        e_fast, e_slow = np.exp(fast * t), np.exp(slow * t)
        return (h - c) * e_fast + c * e_slow, (h - c) * fast * e_fast + c * slow * e_slow
    if x < 1e-4:
        sign = 1.0 if gap > 0.0 else -1.0
        even, odd = 1.0 + sign * x * x / 2.0, 1.0 + sign * x * x / 6.0
    elif gap > 0.0:
        even, odd = np.cosh(x), np.sinh(x) / x
    else:
        even, odd = np.cos(x), np.sin(x) / x
    decay = np.exp(-sigma * t)
    return decay * (h * even + (hd + sigma * h) * t * odd), decay * (hd * even - (sigma * hd + a0 * h) * t * odd)


@compiled
def _half_contact(a0: float, a1: float) -> float:
    """Half the duration of a contact that starts at h = 0 (docs/explanation/model.md): the natural length of an arc."""
    if a0 == 0.0:
        return np.inf if a1 == 0.0 else 1.0 / a1
    omega = np.sqrt(a0)
    zeta = 0.5 * a1 / omega
    if abs(zeta - 1.0) < 1e-6:
        return float(1.0 / omega)
    if zeta < 1.0:
        return float(np.arccos(zeta) / np.sqrt(1.0 - zeta * zeta) / omega)
    return float(np.arccosh(zeta) / np.sqrt(zeta * zeta - 1.0) / omega)


@compiled
def is_linear(s: Any, w: Work) -> bool:
    """Whether the cubic term of every active row is absent, or below the tolerance from here on."""
    for j in range(s.na):
        i = w.idx[j]
        a0, a2 = w.law[i, 0], w.law[i, 2]
        if a2 != 0.0:
            if a0 <= 0.0:
                return False
            size2 = w.gaps[0, i] ** 2 + w.rates[0, i] ** 2 / a0
            if a2 * size2 > NEGLIGIBLE * s.rtol * a0:
                return False
    return True


@compiled
def _stays(s: Any, w: Work, unilateral: Bytes) -> bool:
    """Whether no active multiplier can vanish any more: its resting part exceeds all that the gaps still hold.

    sqrt(h'^2 + a0 h^2) never grows, so |a1 h' + a0 h| stays below (a1 + sqrt(a0)) times it.
    """
    for j in range(s.na):
        i = w.idx[j]
        a0, a1 = w.law[i, 0], w.law[i, 1]
        w.r[j] = (a1 + np.sqrt(a0)) * np.sqrt(w.rates[0, i] ** 2 + a0 * w.gaps[0, i] ** 2)
    for j in range(s.na):
        if unilateral[w.idx[j]]:
            rest = w.lam0[w.idx[j]]
            diagonal = inverse_diagonal(w.G, s.na, w.reach, j, w.scale)
            for b in range(s.na):
                rest -= 2.0 * w.r[b] * np.sqrt(diagonal * inverse_diagonal(w.G, s.na, w.reach, b, w.scale))
            if not rest > 0.0:
                return False
    return True


@compiled
def plan(s: Any, w: Work, unilateral: Bytes) -> float:
    """Longest arc that may be taken in closed form from here; 0 if none."""
    if not s.affine or s.dependent > 0 or s.idle > 0 or (s.na > 0 and (s.ledger or s.has_solve or not is_linear(s, w))):
        return 0.0
    length = np.inf
    if s.na > 0 and not (s.na == s.nc and _stays(s, w, unilateral)):
        for j in range(s.na):
            i = w.idx[j]
            length = min(length, _half_contact(w.law[i, 0], w.law[i, 1]))
    return length


@compiled
def begin(K: Any, s: Any, m: Model, w: Work) -> None:
    """Leave in g the acceleration that holds the active rows; k[0] must be that of the arc's start."""
    n = s.n
    for a in range(n):
        w.g[a] = w.k[0, n + a]
    if s.na == 0:
        return
    accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[:n], w.y[n:], GENERAL)
    if s.na == n:  # every coordinate is held: what rounding leaves of a_c would grow with t^2
        w.g[:] = 0.0
        return
    for j in range(s.na):
        i = w.idx[j]
        w.r[j] = -w.law[i, 1] * w.rates[0, i] - w.law[i, 0] * w.gaps[0, i]
    _push(s, m, w, -1.0, w.g)


@compiled
def _push(s: Any, m: Model, w: Work, sign: float, out: Array) -> None:
    """Out += sign M^-1 H^T G^-1 r."""
    solve_schur(w.G, s.na, w.reach, w.r, w.la)
    push_rows(m, w, s.na, w.la, sign, out)


@compiled
def evaluate(s: Any, m: Model, w: Work, t: float, out: Array) -> None:
    """Out = (q, v) after time t on the arc."""
    n = s.n
    q, v = out[:n], out[n:]
    y, g = w.y, w.g
    for a in range(n):
        v[a] = y[n + a] + g[a] * t
        q[a] = y[a] + (y[n + a] + 0.5 * g[a] * t) * t
    if s.na == 0:
        return
    for j in range(s.na):
        i = w.idx[j]
        h, hd = w.gaps[0, i], w.rates[0, i]
        w.ha[j], w.hda[j] = linear_arc(w.law[i, 0], w.law[i, 1], h, hd, t)
        w.r[j] = w.ha[j] - h - hd * t
    _push(s, m, w, 1.0, q)
    for j in range(s.na):
        w.r[j] = w.hda[j] - w.rates[0, w.idx[j]]
    _push(s, m, w, 1.0, v)
