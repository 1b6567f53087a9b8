"""Directions in which contacts begin to slide: those of their accelerations."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.algebra import factor_lu, solve_lu
from crossbody.reference.core.coulomb import respond
from crossbody.reference.core.friction import decided_to, has_friction
from crossbody.reference.core.layout import SLIP, Model, Work
from crossbody.reference.core.mode_set import ahead, aside, evaluate_set, first_row

MOST_TURN = 0.5  # rad, of one of them
AROUND, HALVINGS = 24, 50  # directions that are looked at where that leads nowhere, and halvings between two


@compiled
def _turned_force(s: Any, m: Model, w: Work, j: int) -> None:
    """Fill w.trial with what a turn by one radian of the slip at the normal row in place j makes of all multipliers."""
    i = w.idx[j]
    c, force = first_row(m, w, i), -m.friction[i] * w.la[j]
    x, y = -w.along[c + 1], w.along[c]
    for a in range(s.na):
        w.r[a] = -force * (w.gram[a, c] * x + w.gram[a, c + 1] * y)
    respond(s, m, w, w.r, w.trial)
    w.trial[c] += force * x
    w.trial[c + 1] += force * y


@compiled
def _fill_turns(s: Any, m: Model, w: Work) -> int:
    """How the accelerations across contacts that begin to slide change with their directions, in w.turns; how many."""
    count = 0
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and w.stands[i] and w.state[i] == SLIP and m.tangents[i] > 1 and w.la[j] > 0.0:
            w.turning[count] = j
            count += 1
    for b in range(count):
        _turned_force(s, m, w, w.turning[b])
        for a in range(count):
            i = w.idx[w.turning[a]]
            c, total = first_row(m, w, i), 0.0
            for k in range(s.na):
                total += (w.along[c] * w.gram[c + 1, k] - w.along[c + 1] * w.gram[c, k]) * w.trial[k]
            w.turns[a, b] = total
        i = w.idx[w.turning[b]]
        w.turn_by[b] = -aside(m, w, i)
        w.turns[b, b] -= max(ahead(m, w, i), 0.0) + decided_to(s)  # definite where loads are shared
        if w.turns[b, b] > 0.0:
            s.unsteady = i
    return count


@compiled
def turn(s: Any, m: Model, w: Work) -> float:
    """Turn the directions of contacts that begin to slide towards their accelerations, by Newton; by how much at most.

    Directions taken from accelerations alone run away where these are small beside what friction does.
    """
    s.unsteady = -1
    count = _fill_turns(s, m, w)
    if factor_lu(w.turns, count, w.turned) != 0:
        return 0.0
    solve_lu(w.turns, count, w.turned, w.turn_by)
    most = 0.0
    for a in range(count):
        most = max(most, abs(w.turn_by[a]))
    for a in range(count):
        c = first_row(m, w, w.idx[w.turning[a]])
        by = w.turn_by[a] * min(1.0, MOST_TURN / most) if most > 0.0 else 0.0
        x, y = (
            w.along[c] * np.cos(by) - w.along[c + 1] * np.sin(by),
            w.along[c + 1] * np.cos(by) + w.along[c] * np.sin(by),
        )
        size = np.sqrt(x * x + y * y)
        if not size > 0.0:  # no force held it, so that none has a direction
            continue
        w.along[c], w.along[c + 1] = x / size, y / size
        w.way[w.idx[c]], w.way[w.idx[c + 1]] = x / size, y / size
    return float(most)


@compiled
def _face(s: Any, m: Model, w: Work, i: int, angle: float) -> float:
    """Let contact i begin to slide at an angle; its acceleration across that."""
    first = first_row(m, w, i)
    w.way[w.idx[first]], w.way[w.idx[first + 1]] = np.cos(angle), np.sin(angle)
    w.along[first], w.along[first + 1] = np.cos(angle), np.sin(angle)
    evaluate_set(s, m, w)
    return aside(m, w, i)


@compiled
def look_around(s: Any, m: Model, w: Work, i: int) -> None:
    """Search all directions for one in which contact i, once it slides, is accelerated, and towards which it turns.

    One from which it turns away is none in which it could begin. If there is none it keeps the one that it has.
    """
    first = first_row(m, w, i)
    kept = np.arctan2(w.along[first + 1], w.along[first])
    start, aside = 0.0, _face(s, m, w, i, 0.0)
    for k in range(1, AROUND + 1):
        low, high = start, 2.0 * np.pi * k / AROUND
        start, before, aside = high, aside, _face(s, m, w, i, high)
        if before > 0.0 >= aside:
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                if _face(s, m, w, i, middle) > 0.0:
                    low = middle
                else:
                    high = middle
            if ahead(m, w, i) > decided_to(s):
                return
    _face(s, m, w, i, kept)
