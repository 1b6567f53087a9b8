"""How far what an importer has made of a file is from what the file says: gaps of every quantity, with their places."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.files.urdf import PLANAR

FLOOR = 1e-4
"""Part of the largest force that is the scale of the smallest ones: rounding is that of the sums they stand in."""
STANDARD = 9.81
"""Gravity, m/s^2."""
SINGLE = 1e-6
"""Part of the reach within which corners of meshes are the same: files and engines have them in single precision."""
NUMBERS = {
    "armature": ("armature",), "damping": ("damping", "damping v|v|", "damping v^3"),
    "springs": ("stiffness", "stiffness x^2", "stiffness x^3", "rest"), "limits": ("lower", "upper"),
    "friction": ("friction",),
}  # fmt: skip
"""Quantity -> numbers of joints that make it up."""
USUAL = {"lower": -math.inf, "upper": math.inf}
"""What such a number is where nothing is said; of others 0."""


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


def gaps(
    found: Mapping[str, Any], wanted: Mapping[str, Any], joints: Sequence[Sequence[str]]
) -> Iterator[tuple[str, Sequence[Gap] | None]]:
    """Yield quantities in their order; None where the file has nothing of it, or where it cannot be compared."""
    off = [*((name, "missing") for name in found["missing"]), *((name, "more") for name in found["extra"])]
    count = len(joints)
    here = count - len(found["missing"]) + len(found["extra"])
    theirs = {name for name in wanted.get("planar", ()) if name in found["extra"]}
    ours = {name + end for name in theirs for end in PLANAR}
    if theirs and ours | theirs == {name for name, _ in off}:
        where = f"{' and '.join(sorted(theirs))} is planar: its three coordinates have no names to compare them by."
        yield "coordinates", [Gap(1.0, where, unseen=True)]
    else:
        yield "coordinates", [Gap(1.0, f"{name} is {how}", here, count, part=name) for name, how in off]
    if not off:
        names = [name for name, _, kind in joints for _ in range({"free": 6, "ball": 3}.get(kind, 1))]
        yield "bodies", _bodies(found["states"][0], wanted["states"][0])
        yield "inertia", _inertia(found["inertias"], wanted["inertias"])
        floor = 1.0 if found["precision"] else FLOOR
        M = _states(wanted, "M", names)
        yield "M", _matrix(_states(found, "M", names), M, names, floor)
        moved = _moved(wanted, M)
        for key in ("gravity", "bias"):
            yield key, _forces(_states(found, key, names), _states(wanted, key, names), names, floor, moved)
        yield "energy", _energy(found, wanted, names)
        yield "frames", _frames(found["states"], wanted["states"])
    for key in NUMBERS:
        yield key, _numbers(key, found["numbers"], wanted["numbers"])
    yield "tendons", _tendons(found, wanted)
    yield "loops", _loops(found, wanted)
    yield "actuators", _actuators(found, wanted, [] if off else names)
    if not off and "shapes" not in wanted["unseen"]:
        of = _matched(found, wanted)
        yield "shapes", _shapes(found, wanted, of)
        yield "contacts", _contacts(found, wanted, of)


def _lacks(answer: Mapping[str, Any], key: str) -> bool:
    """Return whether an importer has no such quantity, or does not show it."""
    return key in answer["hidden"] or key in answer["unseen"]


def _bodies(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[Gap]:
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


def _states(answer: Mapping[str, Any], key: str, names: Sequence[str]) -> Floats | None:
    if _lacks(answer, key):
        return None
    found = np.array([state[key] for state in answer["states"]])
    return found - np.diag(_armature(answer, names)) if key == "M" else found


def _matrix(found: Floats | None, wanted: Floats | None, names: Sequence[str], floor: float) -> list[Gap]:
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


def _moved(wanted: Mapping[str, Any], M: Floats | None) -> float:
    """Return the size of the sums that forces are, where these cancel: weights far out, and what velocities make."""
    v = np.array([state["v"] for state in wanted["states"]])
    weights: float = (
        STANDARD * sum(abs(inertia[0]) for inertia in wanted["inertias"].values()) * _reach(wanted["states"])
    )
    return weights if M is None else max(weights, float(np.abs(M).max(initial=0.0) * (v**2).max(initial=0.0)))


def _forces(
    found: Floats | None, wanted: Floats | None, names: Sequence[str], floor: float, moved: float
) -> list[Gap]:  # fmt: skip
    if found is None or wanted is None:
        return []
    largest = max(float(np.abs(wanted).max(initial=0.0)), moved)
    scale = np.maximum(np.abs(wanted).max(axis=0), floor * largest)
    scale = np.where(scale > 0.0, scale, 1.0)
    off = np.nan_to_num(np.abs(found - wanted) / scale, nan=math.inf)
    k, i = map(int, np.unravel_index(int(np.argmax(off)), off.shape))
    return [Gap(float(off[k, i]), names[i], float(found[k, i]), float(wanted[k, i]))]


def _energy(found: Mapping[str, Any], wanted: Mapping[str, Any], names: Sequence[str]) -> list[Gap]:
    if _lacks(found, "energy"):
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


def _frames(found: Sequence[Any], wanted: Sequence[Any]) -> list[Gap]:
    """The first body of the tree that stands elsewhere: those behind it do too."""
    worst, named = dict[str, Gap](), [name for name in wanted[0]["frames"] if name in found[0]["frames"]]
    reach = _reach(wanted)
    for mine, theirs in zip(found, wanted, strict=True):
        for name in named:
            (p, R), (p_w, R_w) = mine["frames"][name], theirs["frames"][name]
            off = np.abs(np.concatenate([np.subtract(p, p_w) / reach, np.subtract(R, R_w).ravel()]))
            k = int(np.argmax(np.nan_to_num(off, nan=math.inf)))
            if name not in worst or not off[k] <= worst[name].size:
                value, expected = (float([*p_, *np.ravel(R_)][k]) for p_, R_ in ((p, R), (p_w, R_w)))
                worst[name] = Gap(float(off[k]), name, value, expected, part=name)
    size = max((gap.size for gap in worst.values()), default=0.0)
    return [next((worst[name] for name in named if worst[name].size > 1e-3 * size), Gap(0.0))]


def _inertia(found: Mapping[str, Sequence[float]], wanted: Mapping[str, Sequence[float]]) -> list[Gap]:
    told = []
    for name in wanted.keys() & found.keys():
        mine, theirs = np.array(found[name]), np.array(wanted[name])
        m, J = abs(theirs[0]), np.abs(theirs[4:]).max()
        length = float(np.sqrt(J / m) + np.abs(theirs[1:4]).max()) if m else 1.0
        scale = np.array([m or 1.0, *[length or 1.0] * 3, *[J + m * length**2 or 1.0] * 6])
        off = np.nan_to_num(np.abs(mine - theirs) / scale, nan=math.inf)
        k = int(np.argmax(off))
        what = ("mass", "x of com", "y of com", "z of com", "Jxx", "Jyy", "Jzz", "Jxy", "Jxz", "Jyz")[k]
        told.append(Gap(float(off[k]), f"{name}: {what}", float(mine[k]), float(theirs[k]), part=name))
    return told


def _numbers(quantity: str, found: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[Gap] | None:
    """Every number of every joint that either has; one of an engine's stands for all velocities of a joint."""
    told, some = [], False
    for key in NUMBERS[quantity]:
        usual = USUAL.get(key, 0.0)
        for name, theirs in wanted[key].items():
            mine = found.get(key, {}).get(name, [])
            width = max(len(theirs), len(mine))
            x, y = (list(part) if len(part) == width else [*part, usual][:1] * width for part in (theirs, mine))
            some |= any(value != usual for value in (*x, *y))
            off = [_apart(a, b) for a, b in zip(x, y, strict=True)]
            if k := [i for i, one in enumerate(off) if one == max(off)]:
                i, what = k[0], name if key == quantity else f"{name}: {key}"
                told.append(Gap(off[i], what, y[i], x[i], part=name, key=key, lacks=all(one == usual for one in y)))
    return told if some else None


def _apart(x: float, y: float) -> float:
    """Difference of two numbers over the larger; 1 where one of them alone is infinite."""
    if x == y:
        return 0.0
    return abs(x - y) / max(abs(x), abs(y)) if math.isfinite(x) and math.isfinite(y) else 1.0


def _tendons(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[Gap] | None:
    if not found["tendons"] and not wanted["tendons"]:
        return None
    told = [Gap(1.0, f"{name} is more", part=name, lacks=False) for name in found["tendons"].keys() - wanted["tendons"]]
    for name, theirs in wanted["tendons"].items():
        mine = found["tendons"].get(name)
        if mine is None:
            told.append(Gap(1.0, f"{name} is missing", part=name))
            continue
        pairs = list(zip(theirs, mine, strict=True))
        for one, other in zip(wanted["states"], found["states"], strict=False):
            pairs.append((one["tendons"][name], other["tendons"][name]))
        x, y = max(pairs, key=lambda pair: _apart(*pair))
        told.append(Gap(_apart(x, y), name, y, x, part=name, lacks=False))
    return told


def _loops(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[Gap] | None:
    """Each loop of the file beside the one of the same type that is nearest: what it holds together, or couples."""
    mine, theirs = found["loops"], wanted["loops"]
    if not mine and not theirs:
        return None
    told, left, counts = [], list(range(len(mine))), (len(mine), len(theirs))
    blind = [i for i in left if not mine[i][0]]
    for k, (kind, of, _) in enumerate(theirs):
        named = f"{kind} {' and '.join(of)}".strip() if of else f"{kind} {k}"
        same = {i: _held_apart(found, i, wanted, k) for i in left if mine[i][0] == kind}
        if same:
            i = min(same, key=lambda one: same[one])
            left.remove(i)
            told.append(Gap(same[i], f"what {named} holds" if same[i] else named, part=of[0] if of else ""))
        elif blind:
            left.remove(blind.pop())
            told.append(Gap(1.0, "The engine tells the number of its loops alone.", unseen=True))
        else:
            told.append(Gap(1.0, f"{named} is missing", *counts, part=of[0] if of else ""))
    return [*told, *(Gap(1.0, f"{mine[i][0] or 'one'} is more", *counts, lacks=False) for i in left)]


def _held_apart(found: Mapping[str, Any], i: int, wanted: Mapping[str, Any], k: int) -> float:
    """Return how far two loops of one type are from each other, of the reach of the robot or of their numbers."""
    kind, of, numbers = wanted["loops"][k]
    _, named, others = found["loops"][i]
    if kind in ("joint", "tendon"):
        size = max(map(abs, numbers)) or 1.0
        return 1.0 if list(of) != list(named) else max(abs(a - b) for a, b in zip(numbers, others, strict=True)) / size
    ends = [(a["ends"][i], b["ends"][k]) for a, b in zip(found["states"], wanted["states"], strict=False)]
    turned = [_end_gap(kind, [(mine[::-1] if turn else mine, theirs) for mine, theirs in ends]) for turn in (0, 1)]
    return min(turned) / _reach(wanted["states"])


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


def _reach(states: Sequence[Any]) -> float:
    return max((abs(x) for state in states for p, _ in state["frames"].values() for x in p), default=0.0) or 1.0


def _actuators(found: Mapping[str, Any], wanted: Mapping[str, Any], names: Sequence[str]) -> list[Gap] | None:
    """Which joints each moves, its force for one of control, and that of all of them at no control."""
    mine, theirs = found["actuators"], wanted["actuators"]
    if not mine and not theirs:
        return None
    counts = (len(mine), len(theirs))
    told = [Gap(1.0, f"{name} is {'missing' if name not in mine else 'at other joints'}", *counts, part=name)
            for name in theirs if sorted(mine.get(name, [""])) != sorted(theirs[name])]  # fmt: skip
    told += [Gap(1.0, f"{name} is more", *counts, part=name, lacks=False) for name in mine if name not in theirs]
    if told or _lacks(found, "actuators") or not names:
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


def _matched(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> dict[int, tuple[int, float]]:
    """Return shape of the file -> the nearest of the importer's that is left, and how far it is: names may differ."""
    mine, theirs = (np.array([shape[3] for shape in one["shapes"]]) for one in (found, wanted))
    if not mine.size or not theirs.size:
        return {}
    off = np.nan_to_num(np.abs(theirs[:, None] - mine[None]).max(axis=(2, 3)) / _reach(wanted["states"]), nan=math.inf)
    kinds, by = (np.array([[a[k] != b[k] for b in found["shapes"]] for a in wanted["shapes"]]) for k in (1, 2))
    off[by] = math.inf
    of: dict[int, tuple[int, float]] = {}
    order = np.argsort(off + 1e-12 * kinds, axis=None, kind="stable")
    for k, i in zip(*np.unravel_index(order, off.shape), strict=True):
        if not by[k, i] and k not in of and i not in {one for one, _ in of.values()}:
            of[int(k)] = (int(i), float(off[k, i]))
    return of


def _shapes(found: Mapping[str, Any], wanted: Mapping[str, Any], of: Mapping[int, tuple[int, float]]) -> Any:
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


def _contacts(found: Mapping[str, Any], wanted: Mapping[str, Any], of: Mapping[int, tuple[int, float]]) -> Any:
    """Which shapes may touch each other, of those that both have."""
    if wanted["contacts"] is None:
        return None
    there, name = {i: k for k, (i, _) in of.items()}, [shape[0] for shape in wanted["shapes"]]
    mine = {frozenset((there[i], there[j])) for i, j in found["contacts"] if i in there and j in there}
    theirs = {frozenset(pair) for pair in wanted["contacts"] if set(pair) <= of.keys()}
    if not mine and not theirs:
        return None
    told = [*((pair, "may not touch") for pair in theirs - mine), *((pair, "may touch") for pair in mine - theirs)]
    named = sorted((" and ".join(sorted(name[k] for k in pair)), how) for pair, how in told)
    return [Gap(1.0, f"{both} {how}", len(mine), len(theirs)) for both, how in named]
