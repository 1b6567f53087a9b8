"""Gaps of shapes and of which of them may touch."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from crossbody.reports.importers.gap import Gap, apart, lacks, reach

SINGLE = 1e-6
"""Part of the reach within which corners of meshes are the same: both have them in single precision."""


def matched(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> dict[int, tuple[int, float]]:
    """Return shape of the file -> the nearest of the importer's that is left, and how far it is: names may differ."""
    mine, theirs = (np.array([shape[3] for shape in one["shapes"]]) for one in (found, wanted))
    if not mine.size or not theirs.size:
        return {}
    far = max(reach(wanted["states"]), float(np.abs(theirs).max()))
    off = np.nan_to_num(np.abs(theirs[:, None] - mine[None]).max(axis=(2, 3)) / far, nan=math.inf)
    kinds, by = (np.array([[a[k] != b[k] for b in found["shapes"]] for a in wanted["shapes"]]) for k in (1, 2))
    off[by] = math.inf
    of: dict[int, tuple[int, float]] = {}
    order = np.argsort(off + 1e-12 * kinds, axis=None, kind="stable")
    for k, i in zip(*np.unravel_index(order, off.shape), strict=True):
        if not by[k, i] and k not in of and i not in {one for one, _ in of.values()}:
            of[int(k)] = (int(i), float(off[k, i]))
    return of


def shapes(found: Mapping[str, Any], wanted: Mapping[str, Any], of: Mapping[int, tuple[int, float]]) -> Any:
    """Each shape of the file beside the nearest of the importer's: kind, and the boxes about it."""
    mine, theirs = found["shapes"], wanted["shapes"]
    if not mine and not theirs:
        return None
    told, counts = [], (len(mine), len(theirs))
    for k, (shape, kind, joint, _) in enumerate(theirs):
        name = f"{shape} behind {joint}" if joint else f"{shape} on the world"
        if k not in of:
            told.append(Gap(1.0, f"{name} is missing", *counts, part=joint))
            continue
        i, off = of[k]
        if mine[i][1] != kind:
            told.append(Gap(1.0, f"{name} is a {mine[i][1]} and not a {kind}", part=joint))
        told.append(Gap(0.0 if kind == "mesh" and off < SINGLE else off, f"{name}: size or place", part=joint))
    more = set(range(len(mine))) - {i for i, _ in of.values()}
    return [*told, *(Gap(1.0, f"{mine[i][0]} is more", *counts, lacks=False) for i in sorted(more))]


def contacts(found: Mapping[str, Any], wanted: Mapping[str, Any], of: Mapping[int, tuple[int, float]]) -> Any:
    """Which shapes may touch each other, of those that both have."""
    if wanted["contacts"] is None:
        return None
    there, name = {i: k for k, (i, _) in of.items()}, [shape[0] for shape in wanted["shapes"]]
    mine = {frozenset((there[i], there[j])) for i, j in found["contacts"] if i in there and j in there}
    theirs = {frozenset(pair) for pair in wanted["contacts"] if set(pair) <= of.keys()}
    if not mine and not theirs:
        return [] if lacks(found, "contacts") and len(wanted["shapes"]) > 1 else None
    told = [*((pair, "may not touch") for pair in theirs - mine), *((pair, "may touch") for pair in mine - theirs)]
    named = sorted((" and ".join(sorted(name[k] for k in pair)), how) for pair, how in told)
    return [Gap(1.0, f"{both} {how}", len(mine), len(theirs)) for both, how in named]


PARTS = ("slide", "slide", "spin", "roll", "roll", "margin")
"""Of a pair that may touch: friction along two tangents, about the normal and about them, margin."""


def surfaces(found: Mapping[str, Any], wanted: Mapping[str, Any], of: Mapping[int, tuple[int, float]]) -> Any:
    """Friction and margin of every pair of shapes that may touch, of those that both have."""
    if not wanted["contacts"]:
        return None
    name, by, told = [shape[0] for shape in wanted["shapes"]], [shape[2] for shape in wanted["shapes"]], list[Gap]()
    if lacks(found, "surfaces"):
        return [Gap(1.0)]
    mine = {frozenset(pair): own for pair, own in zip(found["contacts"], found["surfaces"], strict=False)}
    for pair, theirs in zip(wanted["contacts"], wanted["surfaces"], strict=True):
        own = mine.get(frozenset(of[k][0] for k in pair if k in of))
        if own is None:  # which may touch is another quantity
            continue
        where, part = " and ".join(name[k] for k in pair), next(filter(None, (by[k] for k in pair)), "")
        if np.isnan(own).any():
            told.append(Gap(1.0, f"The engine shows nothing of {where}.", unseen=True))
            continue
        for key, x, y in zip(PARTS, theirs, own, strict=True):
            told.append(Gap(apart(x, y), f"{where}: {key}", y, x, part=part, key=key, lacks=y == 0.0))
    return told or None
