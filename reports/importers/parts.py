"""Gaps between what an importer has made of the parts of a robot and what its file says."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats

NUMBERS = {
    "armature": ("armature",), "damping": ("damping", "damping v|v|", "damping v^3"),
    "springs": ("stiffness", "stiffness x^2", "stiffness x^3", "rest"), "limits": ("lower", "upper"),
    "friction": ("friction",), "effort": ("least force", "most force"),
}  # fmt: skip
"""Quantity -> numbers of joints that make it up."""
USUAL = {"lower": -math.inf, "upper": math.inf, "least force": -math.inf, "most force": math.inf}
"""What such a number is where nothing is said; of others 0."""
SINGLE = 1e-6
"""Part of the reach within which corners of meshes are the same: both have them in single precision."""
PARTS = ("slide", "slide", "spin", "roll", "roll", "margin")
"""Of a pair that may touch: friction along two tangents, about the normal and about them, margin."""


@dataclass(frozen=True, slots=True)
class Gap:
    """A difference.

    Attributes:
        size: part of the largest entry.
        where: joint, body or shape, and what of it.
        value, expected: there.
        part: name of the part alone; empty for the whole.
        key: which of `NUMBERS`, where it is one.
        lacks: whether the importer has nothing there.
        unseen: whether nobody can look there: `where` says why.
    """

    size: float
    where: str = ""
    value: float = math.nan
    expected: float = math.nan
    part: str = ""
    key: str = ""
    lacks: bool = True
    unseen: bool = False


def lacks(answer: Mapping[str, Any], key: str) -> bool:
    """Return whether an importer has no such quantity, or does not show it."""
    return key in answer["hidden"] or key in answer["unseen"]


def reach(states: Sequence[Any]) -> float:
    """Return how far the places of bodies reach, m."""
    return max((abs(x) for state in states for p, _ in state["frames"].values() for x in p), default=0.0) or 1.0


def apart(x: float, y: float) -> float:
    """Difference of two numbers over the larger; 1 where one of them alone is infinite."""
    if x == y:
        return 0.0
    return abs(x - y) / max(abs(x), abs(y)) if math.isfinite(x) and math.isfinite(y) else 1.0


def numbers(quantity: str, found: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[Gap] | None:
    """Every number of every joint that either has; an engine's one stands for all velocities."""
    told, some = [], False
    for key in NUMBERS[quantity]:
        usual = USUAL.get(key, 0.0)
        for name, theirs in wanted[key].items():
            mine = found.get(key, {}).get(name, [])
            width = max(len(theirs), len(mine))
            x, y = (list(part) if len(part) == width else [*part, usual][:1] * width for part in (theirs, mine))
            some |= any(value != usual for value in (*x, *y))
            off = [apart(a, b) for a, b in zip(x, y, strict=True)]
            if k := [i for i, one in enumerate(off) if one == max(off)]:
                i, what = k[0], name if key == quantity else f"{name}: {key}"
                told.append(Gap(off[i], what, y[i], x[i], part=name, key=key, lacks=all(one == usual for one in y)))
    return told if some else None


def tendons(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[Gap] | None:
    """Return a gap for every tendon: its numbers and its lengths."""
    if not found["tendons"] and not wanted["tendons"]:
        return None
    told = [Gap(1.0, f"{name} is more", part=name, lacks=False) for name in found["tendons"].keys() - wanted["tendons"]]
    for name, theirs in wanted["tendons"].items():
        if (mine := found["tendons"].get(name)) is None:
            told.append(Gap(1.0, f"{name} is missing", part=name))
            continue
        pairs = list(zip(theirs, mine, strict=True))
        for one, other in zip(wanted["states"], found["states"], strict=False):
            pairs.append((one["tendons"][name], other["tendons"][name]))
        x, y = max(pairs, key=lambda pair: apart(*pair))
        told.append(Gap(apart(x, y), name, y, x, part=name, lacks=False))
    return told


def loops(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[Gap] | None:
    """Each loop of the file beside the one of the same type nearest to it: what it holds or couples."""
    mine, theirs = found["loops"], wanted["loops"]
    if not mine and not theirs:
        return None
    told, left, counts = [], list(range(len(mine))), (len(mine), len(theirs))
    blind = [i for i in left if not mine[i][0]]
    for k, (kind, of, _) in enumerate(theirs):
        named = f"{kind} {' and '.join(of)}".strip() if of else f"{kind} {k}"
        if same := {i: _held_apart(found, i, wanted, k) for i in left if mine[i][0] == kind}:
            i = min(same, key=lambda one: same[one])
            left.remove(i)
            told.append(Gap(same[i], f"what {named} holds" if same[i] else named, part=of[0] if of else ""))
        elif blind:
            left.remove(blind.pop())
            told.append(Gap(1.0, "The engine shows only the number of its loops.", unseen=True))
        else:
            told.append(Gap(1.0, f"{named} is missing", *counts, part=of[0] if of else ""))
    return [*told, *(Gap(1.0, f"{mine[i][0] or 'one'} is more", *counts, lacks=False) for i in left)]


def _held_apart(found: Mapping[str, Any], i: int, wanted: Mapping[str, Any], k: int) -> float:
    """Return how far two loops of one type are from each other, of the robot's reach or of their numbers."""
    kind, of, numbers = wanted["loops"][k]
    _, named, others = found["loops"][i]
    if kind in ("joint", "tendon"):
        size = max(map(abs, numbers)) or 1.0
        return 1.0 if list(of) != list(named) else max(abs(a - b) for a, b in zip(numbers, others, strict=True)) / size
    ends = [(a["ends"][i], b["ends"][k]) for a, b in zip(found["states"], wanted["states"], strict=False)]
    turned = [_end_gap(kind, [(mine[::-1] if turn else mine, theirs) for mine, theirs in ends]) for turn in (0, 1)]
    return min(turned) / reach(wanted["states"])


def _end_gap(kind: str, ends: Sequence[tuple[Any, Any]]) -> float:
    """Return how far two points are from two others, or what brings one frame to the other from what does for others.

    Every frame that is fixed to a body may stand for a weld: X_1 X_2^-1 is the same for all of them.
    """
    worst = 0.0
    for mine, theirs in ends:
        if kind == "connect":
            worst = max(
                worst, *(float(np.abs(np.subtract(a[0], b[0])).max()) for a, b in zip(mine, theirs, strict=True))
            )
            continue
        between = []
        for (p, R), (p_2, R_2) in (mine, theirs):
            turn = np.array(R) @ np.array(R_2).T
            between.append(np.concatenate([np.array(p) - turn @ np.array(p_2), turn.ravel()]))
        worst = max(worst, float(np.abs(between[0] - between[1]).max()))
    return worst


def softness(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[Gap] | None:
    """Return a gap for every row that has a law: a0 and a1."""
    told = []
    for name, theirs in wanted["softness"].items():
        mine = found["softness"].get(name, [0.0, 0.0])
        worst = max(zip(theirs, mine, ("a0", "a1"), strict=True), key=lambda part: apart(*part[:2]))
        told.append(Gap(apart(*worst[:2]), f"{name}: {worst[2]}", worst[1], worst[0], part=name))
    return told or None


def keyframes(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[Gap] | None:
    """Return a gap for the positions of every keyframe, in the engine's own coordinates."""
    told, counts = [], (len(found["keys"]), len(wanted["keys"]))
    for name in wanted["keys"]:
        if name not in found["keys"]:
            told.append(Gap(1.0, f"{name} is missing", *counts, part=name))
            continue
        mine, theirs = map(np.array, found["keys"][name])
        off = np.nan_to_num(np.abs(mine - theirs) / np.maximum(1.0, np.abs(theirs)), nan=math.inf)
        k = int(np.argmax(off))
        told.append(Gap(float(off[k]), f"{name}: position {k}", float(mine[k]), float(theirs[k]), part=name))
    return told or None


def actuators(found: Mapping[str, Any], wanted: Mapping[str, Any], names: Sequence[str]) -> list[Gap] | None:
    """Which joints each moves, its force for one of control, and that of all of them at no control."""
    mine, theirs = found["actuators"], wanted["actuators"]
    if not mine and not theirs:
        return None
    counts = (len(mine), len(theirs))
    told = [Gap(1.0, f"{name} is {'missing' if name not in mine else 'at other joints'}", *counts, part=name)
            for name in theirs if sorted(mine.get(name, [""])) != sorted(theirs[name])]  # fmt: skip
    told += [Gap(1.0, f"{name} is more", *counts, part=name, lacks=False) for name in mine if name not in theirs]
    if told or lacks(found, "actuators") or not names:
        return told
    for name in theirs:
        one, other = (np.array([state["driven"][name] for state in one["states"]]) for one in (found, wanted))
        told += _of_forces(one, other, f"{name}: force of 1 at", names, name)
    one, other = (np.array([state["held"] for state in one["states"]]) for one in (found, wanted))
    return told + _of_forces(one, other, "no control at", names, "")


def _of_forces(found: Floats, wanted: Floats, what: str, names: Sequence[str], part: str) -> list[Gap]:
    size = float(np.abs(wanted).max(initial=0.0))
    off = np.nan_to_num(np.abs(found - wanted), nan=math.inf)
    k, i = map(int, np.unravel_index(int(np.argmax(off)), off.shape))
    values = (float(found[k, i]), float(wanted[k, i]))
    return [Gap(float(off[k, i]) / (size or 1.0), f"{what} {names[i]}", *values, part=part, lacks=False)]


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
