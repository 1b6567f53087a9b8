"""Whether a slip that dies out jams before it stops, written apart from the compiled machine's rule."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from crossbody.cases import Mode
from crossbody.reference.kinds import Floats
from crossbody.reference.sundials.sliding import Seen, Sliding

AROUND = 1440  # directions of a full turn


def _alike(seen: Seen, count: int) -> Seen:
    """The same instant `count` times."""
    arrays = {f.name: getattr(seen, f.name) for f in fields(seen) if f.name not in ("rows", "at")}
    alike: dict[str, Any] = {name: np.broadcast_to(a, (count, *a.shape)) for name, a in arrays.items()}
    return replace(seen, **alike)


def dies_into_jam(
    sliding: Sliding, seen: Seen, modes: Mapping[int, Mode], ways: Mapping[int, Floats], i: int, course: Floats
) -> bool:  # fmt: skip
    """Tell whether the slip z of contact i, as z' = a(z / |z|) turns it from `course` on, comes to where det A < 0.

    Args:
        sliding: the rows' algebra.
        seen: rows of the contacts that press.
        modes: of these.
        ways: directions (1,) or (2,) of those that slide.
        i: a contact that slides in space, and whose slip is about to vanish.
        course: its direction (2,) where that was last clear of zero.
    """
    angles = np.arctan2(course[1], course[0]) + np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    way = np.column_stack([np.cos(angles), np.sin(angles)])
    every = {k: np.broadcast_to(own, (AROUND, len(own))) for k, own in ways.items()}
    balance = sliding.balance(_alike(seen, AROUND), modes, {**every, i: way})
    clear = np.prod(balance.jam(i), axis=-1).real > 0.0
    if clear.all() or not clear[0]:
        return False
    lam = balance.forces()
    moved = (seen.G @ lam[..., None])[..., 0] - seen.bare
    x, y = (moved[:, seen.at[t]] for t in sliding.ways[i])
    across = way[:, 0] * y - way[:, 1] * x
    order = np.arange(AROUND) if across[0] > 0.0 else -np.arange(AROUND)
    pressing = lam[:, [seen.at[k] for k in modes if k not in sliding.dry]]
    ends = ~clear[order] | (across[order] * across[0] <= 0.0)
    ends |= pressing.min(axis=1)[order] < 0.0  # it lets go on the way, and what follows is another set's
    return bool(ends.any() and not clear[order][np.argmax(ends)])
