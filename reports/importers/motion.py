"""Gaps of what moves a robot: inertias, M, forces, energy and places at states."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.reports.importers.parts import Gap, lacks, reach

FLOOR = 1e-4
"""Part of the largest force that is the scale of the smallest ones: rounding is that of their sums."""
ROUNDED = 1e-6
"""Part of the reach of a robot below which lengths have lost digits: what is far out is rounded so."""
STANDARD = 9.81  # gravity, m/s^2


def bodies(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[Gap]:
    """Return a gap for every body that an importer lacks."""
    counts = (len(found["frames"].keys() & wanted["frames"].keys()), len(wanted["frames"]))
    return [Gap(1.0, f"{name} is missing", *counts, part=name) for name in wanted["frames"] if name not in
            found["frames"]]  # fmt: skip


def _armature(answer: Mapping[str, Any], names: Sequence[str]) -> Floats:
    """Return what joints add to the diagonal of M, which is a quantity by itself (nv,)."""
    own = answer["numbers"].get("armature", {})
    values: list[float] = []
    for name in dict.fromkeys(names):
        width, listed = names.count(name), own.get(name, [0.0])
        values += listed if len(listed) == width else listed[:1] * width
    return np.array(values)


def states(answer: Mapping[str, Any], key: str, names: Sequence[str]) -> Floats | None:
    """Return a quantity at all states, M without what joints add to it; None where there is none."""
    if lacks(answer, key):
        return None
    found = np.array([state[key] for state in answer["states"]])
    return found - np.diag(_armature(answer, names)) if key == "M" else found


def matrix(found: Floats | None, wanted: Floats | None, names: Sequence[str], floor: float) -> list[Gap]:
    """Return the gap of M, of the geometric mean of two diagonal entries."""
    if found is None or wanted is None:
        return []
    size = np.sqrt(np.abs(np.einsum("kii->ki", wanted)))
    scale = np.maximum(
        size[:, :, None] * size[:, None, :], min(floor, 1e-5) * float(np.abs(wanted).max(initial=1e-300))
    )
    off = np.nan_to_num(np.abs(found - wanted) / scale, nan=math.inf)
    k, i, j = map(int, np.unravel_index(int(np.argmax(off)), off.shape))
    where = names[i] if i == j else f"{names[i]}, {names[j]}"
    return [Gap(float(off[k, i, j]), where, float(found[k, i, j]), float(wanted[k, i, j]))]


def moved(wanted: Mapping[str, Any], M: Floats | None) -> float:
    """Return the size of sums that forces are, where they cancel: weights far out, what velocities make."""
    v = np.array([state["v"] for state in wanted["states"]])
    weights: float = (
        STANDARD * sum(abs(inertia[0]) for inertia in wanted["inertias"].values()) * reach(wanted["states"])
    )
    return weights if M is None else max(weights, float(np.abs(M).max(initial=0.0) * (v**2).max(initial=0.0)))


def forces(
    found: Floats | None, wanted: Floats | None, names: Sequence[str], floor: float, moved: float
) -> list[Gap]:  # fmt: skip
    """Return the gap of forces, of the largest at that coordinate or what they are sums of."""
    if found is None or wanted is None:
        return []
    largest = max(float(np.abs(wanted).max(initial=0.0)), moved)
    scale = np.maximum(np.abs(wanted).max(axis=0), floor * largest)
    scale = np.where(scale > 0.0, scale, 1.0)
    off = np.nan_to_num(np.abs(found - wanted) / scale, nan=math.inf)
    k, i = map(int, np.unravel_index(int(np.argmax(off)), off.shape))
    return [Gap(float(off[k, i]), names[i], float(found[k, i]), float(wanted[k, i]))]


def energy(found: Mapping[str, Any], wanted: Mapping[str, Any], names: Sequence[str]) -> list[Gap]:
    """Return the gap of energies over states, armature aside."""
    if lacks(found, "energy"):
        return []
    v = np.array([state["v"] for state in wanted["states"]])
    mine, theirs = (
        np.array([state["energy"] for state in answer["states"]]) - v**2 @ _armature(answer, names) / 2
        for answer in (found, wanted)
    )
    mine, theirs = mine - mine[0], theirs - theirs[0]
    k = int(np.argmax(np.nan_to_num(np.abs(mine - theirs), nan=math.inf)))
    scale = float(np.abs(theirs).max()) or 1.0
    return [Gap(float(abs(mine[k] - theirs[k])) / scale, "the whole", float(mine[k]), float(theirs[k]))]


def frames(found: Sequence[Any], wanted: Sequence[Any]) -> list[Gap]:
    """The first body of the tree that stands elsewhere: those behind it do too."""
    worst, named = dict[str, Gap](), [name for name in wanted[0]["frames"] if name in found[0]["frames"]]
    far = reach(wanted)
    for mine, theirs in zip(found, wanted, strict=True):
        for name in named:
            (p, R), (p_w, R_w) = mine["frames"][name], theirs["frames"][name]
            off = np.abs(np.concatenate([np.subtract(p, p_w) / far, np.subtract(R, R_w).ravel()]))
            k = int(np.argmax(np.nan_to_num(off, nan=math.inf)))
            if name not in worst or not off[k] <= worst[name].size:
                value, expected = (float([*p_, *np.ravel(R_)][k]) for p_, R_ in ((p, R), (p_w, R_w)))
                worst[name] = Gap(float(off[k]), name, value, expected, part=name)
    size = max((gap.size for gap in worst.values()), default=0.0)
    return [next((worst[name] for name in named if worst[name].size > 1e-3 * size), Gap(0.0))]


def inertia(found: Mapping[str, Sequence[float]], wanted: Mapping[str, Sequence[float]], far: float) -> list[Gap]:
    """Return a gap for what every joint moves: mass, centre, moments."""
    told = []
    for name in wanted.keys() & found.keys():
        mine, theirs = np.array(found[name]), np.array(wanted[name])
        m, J = abs(theirs[0]), np.abs(theirs[4:]).max()
        length = float(np.sqrt(J / m) + np.abs(theirs[1:4]).max()) if m else 1.0
        length = max(length, ROUNDED * far)
        scale = np.array([m or 1.0, *[length or 1.0] * 3, *[J + m * length**2 or 1.0] * 6])
        off = np.nan_to_num(np.abs(mine - theirs) / scale, nan=math.inf)
        k = int(np.argmax(off))
        what = ("mass", "x of com", "y of com", "z of com", "Jxx", "Jyy", "Jzz", "Jxy", "Jxz", "Jyz")[k]
        told.append(Gap(float(off[k]), f"{name}: {what}", float(mine[k]), float(theirs[k]), part=name))
    return told
