"""What an importer has made of a file beside what the file says: a row a quantity."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats

TOLERANCE = 1e-9
"""Of the largest entry: the same physics."""
FLOOR = 1e-4
"""Part of the largest force that is the scale of the smallest ones: rounding is that of the sums they stand in."""
OK, WRONG, UNSUPPORTED, FAILED, NONE = "ok", "wrong", "unsupported", "failed", "-"
QUANTITIES = (
    "reading", "coordinates", "inertia", "M", "gravity", "bias", "energy", "frames", "armature", "damping", "springs",
    "limits", "friction", "loops", "actuators",
)  # fmt: skip
"""Of rows, in their order."""
OWN = {"springs": ("stiffness", "rest"), "limits": ("lower", "upper")}
"""Quantity -> numbers of joints that make it up; of others it is their own name."""
SAID = re.compile(r"unsupported|not (yet )?(been )?(supported|implemented)|(will be |is |are )?ignored|ignoring", re.I)
"""How an importer says what it leaves out."""
WORDS = {
    "armature": "armature|rotor", "damping": "damping", "springs": "stiffness|spring", "limits": "range|limit",
    "friction": "friction", "loops": "equality|connect|weld|mimic|constraint", "gravity": "gravity|gravcomp",
    "actuators": "actuator|motor|transmission", "coordinates": "joint",
}  # fmt: skip
"""Quantity -> what such a sentence speaks of."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One quantity of one importer.

    Attributes:
        engine, version: whose.
        reader: own, for an engine's own reader.
        quantity: one of `QUANTITIES`.
        where: joint or body of the largest difference.
        value, expected: there.
        difference: part of the largest entry.
        verdict: ok, wrong, unsupported, failed; - where the file has nothing of it.
        why: a sentence, where there is one.
        cause: name of the feature that is read wrongly, where it is known.
        file, line: where that stands.
    """

    engine: str
    version: str = ""
    reader: str = "own"
    quantity: str
    where: str = ""
    value: float | None = None
    expected: float | None = None
    difference: float | None = None
    verdict: str = OK
    why: str = ""
    cause: str = ""
    file: str = ""
    line: int | None = None


@dataclass(frozen=True, slots=True)
class Gap:
    """The largest difference of two arrays of numbers with names."""

    size: float
    where: str = ""
    value: float = math.nan
    expected: float = math.nan


def rows(
    engine: str, found: Mapping[str, Any], wanted: Mapping[str, Any], joints: Sequence[Sequence[str]]
) -> list[Row]:
    """Return what an importer has made of a file, beside what it says.

    Args:
        engine: name of the importer.
        found: its answer.
        wanted: that of a reader without fault.
        joints: name, body and kind of each, in the order of the coordinates.
    """
    if found["status"] != "read":
        refused = FAILED if not SAID.search(found["why"]) else UNSUPPORTED
        return [
            Row(
                engine=engine,
                quantity="reading",
                verdict=refused if found["status"] == "failed" else UNSUPPORTED,
                why=found["why"],
            )
        ]
    told: list[Row] = [Row(engine=engine, version=found["version"], quantity="reading")]
    tolerance = max(TOLERANCE, found["precision"])
    for quantity, gap in _gaps(found, wanted, joints):
        told.append(_row(engine, found, quantity, gap, tolerance))
    return told


def _row(engine: str, found: Mapping[str, Any], quantity: str, gap: Gap | None, tolerance: float) -> Row:
    """Return one row; what the importer hides or says that it leaves out is not wrong."""
    common: dict[str, Any] = {"engine": engine, "version": found["version"], "quantity": quantity}
    hidden = [found["hidden"][key] for key in (quantity, *OWN.get(quantity, ())) if key in found["hidden"]]
    if gap is None:
        return Row(**common, verdict=NONE)
    numbers: dict[str, Any] = {
        "where": gap.where,
        "difference": gap.size,
        "value": _number(gap.value),
        "expected": _number(gap.expected),
    }
    if gap.size <= tolerance:
        return Row(**common, **numbers)
    if hidden:
        return Row(**common, where=gap.where, expected=_number(gap.expected), verdict=UNSUPPORTED, why=hidden[0])
    said = said_of(WORDS.get(quantity, ""), found["told"])
    return Row(**common, **numbers, verdict=UNSUPPORTED if said else WRONG, why=said)


def said_of(words: str, told: Sequence[str]) -> str:
    """Return the line in which an importer says that it leaves something out, by a pattern; empty where none does."""
    lines = (line for line in told if words and SAID.search(line) and re.search(rf"\b({words})s?\b", line, re.I))
    return next(lines, "")


def _number(value: float) -> float | None:
    return None if math.isnan(value) else float(value)


def _gaps(
    found: Mapping[str, Any], wanted: Mapping[str, Any], joints: Sequence[Sequence[str]]
) -> Iterator[tuple[str, Gap | None]]:
    """Quantities in their order; None where the file has nothing of it, or where it cannot be compared."""
    off = [*(f"{name} is missing" for name in found["missing"]), *(f"{name} is more" for name in found["extra"])]
    yield (
        "coordinates",
        Gap(
            float(len(off)), "; ".join(off[:3]), len(joints) - len(found["missing"]) + len(found["extra"]), len(joints)
        ),
    )
    if not off:
        names = [name for name, _, kind in joints for _ in range({"free": 6, "ball": 3}.get(kind, 1))]
        yield "inertia", _inertia(found["inertias"], wanted["inertias"])
        floor = 1.0 if found["precision"] else FLOOR
        M = _states(wanted, "M", names)
        yield "M", _matrix(_states(found, "M", names), M, names, floor)
        moved = _moved(wanted, M)
        for key in ("gravity", "bias"):
            yield key, _forces(_states(found, key, names), _states(wanted, key, names), names, floor, moved)
        yield "energy", _energy(found, wanted, names)
        yield "frames", _frames(found["states"], wanted["states"])
    for key in ("armature", "damping", "springs", "limits", "friction"):
        yield key, _numbers(key, found["numbers"], wanted["numbers"])
    loops = (found["loops"], wanted["loops"])
    yield "loops", Gap(float(loops[0] != loops[1]), "number of them", *loops) if any(loops) else None
    yield "actuators", _actuators(found["actuators"], wanted["actuators"])


def _armature(answer: Mapping[str, Any], names: Sequence[str]) -> Floats:
    """Return what joints add to the diagonal of M, which is a quantity by itself (nv,)."""
    own = answer["numbers"].get("armature", {})
    return np.array([own.get(name, [0.0])[0] for name in names])


def _states(answer: Mapping[str, Any], key: str, names: Sequence[str]) -> Floats | None:
    if key in answer["hidden"]:
        return None
    found = np.array([state[key] for state in answer["states"]])
    return found - np.diag(_armature(answer, names)) if key == "M" else found


def _matrix(found: Floats | None, wanted: Floats | None, names: Sequence[str], floor: float) -> Gap | None:
    if found is None or wanted is None:
        return None
    size = np.sqrt(np.abs(np.einsum("kii->ki", wanted)))
    scale = np.maximum(
        size[:, :, None] * size[:, None, :], min(floor, 1e-5) * float(np.abs(wanted).max(initial=1e-300))
    )
    off = np.nan_to_num(np.abs(found - wanted) / scale, nan=math.inf)
    k, i, j = map(int, np.unravel_index(int(np.argmax(off)), off.shape))
    where = names[i] if i == j else f"{names[i]}, {names[j]}"
    return Gap(float(off[k, i, j]), where, float(found[k, i, j]), float(wanted[k, i, j]))


def _moved(wanted: Mapping[str, Any], M: Floats | None) -> float:
    """Return the size of forces at the velocities of the states, where there are no larger ones."""
    v = np.array([state["v"] for state in wanted["states"]])
    return 0.0 if M is None else float(np.abs(M).max(initial=0.0) * (v**2).max(initial=0.0))


def _forces(
    found: Floats | None, wanted: Floats | None, names: Sequence[str], floor: float, moved: float
) -> Gap | None:  # fmt: skip
    if found is None or wanted is None:
        return None
    largest = max(float(np.abs(wanted).max(initial=0.0)), moved)
    scale = np.maximum(np.abs(wanted).max(axis=0), floor * largest)
    scale = np.where(scale > 0.0, scale, 1.0)
    off = np.nan_to_num(np.abs(found - wanted) / scale, nan=math.inf)
    k, i = map(int, np.unravel_index(int(np.argmax(off)), off.shape))
    return Gap(float(off[k, i]), names[i], float(found[k, i]), float(wanted[k, i]))


def _energy(found: Mapping[str, Any], wanted: Mapping[str, Any], names: Sequence[str]) -> Gap | None:
    if "energy" in found["hidden"]:
        return None
    v = np.array([state["v"] for state in wanted["states"]])
    mine, theirs = (
        np.array([state["energy"] for state in answer["states"]]) - v**2 @ _armature(answer, names) / 2
        for answer in (found, wanted)
    )
    mine, theirs = mine - mine[0], theirs - theirs[0]
    k = int(np.argmax(np.nan_to_num(np.abs(mine - theirs), nan=math.inf)))
    scale = float(np.abs(theirs).max()) or 1.0
    return Gap(float(abs(mine[k] - theirs[k])) / scale, "the whole", float(mine[k]), float(theirs[k]))


def _frames(found: Sequence[Any], wanted: Sequence[Any]) -> Gap:
    """The first body of the tree that stands elsewhere: those behind it do too."""
    worst, named = dict[str, Gap](), [name for name in wanted[0]["frames"] if name in found[0]["frames"]]
    reach = max((abs(x) for state in wanted for p, _ in state["frames"].values() for x in p), default=0.0) or 1.0
    for mine, theirs in zip(found, wanted, strict=True):
        for name in named:
            (p, R), (p_w, R_w) = mine["frames"][name], theirs["frames"][name]
            off = np.abs(np.concatenate([np.subtract(p, p_w) / reach, np.subtract(R, R_w).ravel()]))
            k = int(np.argmax(np.nan_to_num(off, nan=math.inf)))
            if name not in worst or not off[k] <= worst[name].size:
                values = (float([*p_, *np.ravel(R_)][k]) for p_, R_ in ((p, R), (p_w, R_w)))
                worst[name] = Gap(float(off[k]), name, *values)
    size = max((gap.size for gap in worst.values()), default=0.0)
    return next((worst[name] for name in named if worst[name].size > 1e-3 * size), Gap(0.0))


def _inertia(found: Mapping[str, Sequence[float]], wanted: Mapping[str, Sequence[float]]) -> Gap:
    worst = Gap(0.0)
    for name in wanted.keys() & found.keys():
        mine, theirs = np.array(found[name]), np.array(wanted[name])
        m, J = abs(theirs[0]), np.abs(theirs[4:]).max()
        length = float(np.sqrt(J / m) + np.abs(theirs[1:4]).max()) if m else 1.0
        scale = np.array([m or 1.0, *[length or 1.0] * 3, *[J + m * length**2 or 1.0] * 6])
        off = np.nan_to_num(np.abs(mine - theirs) / scale, nan=math.inf)
        k = int(np.argmax(off))
        if off[k] > worst.size:
            what = ("mass", "x of com", "y of com", "z of com", "Jxx", "Jyy", "Jzz", "Jxy", "Jxz", "Jyz")[k]
            worst = Gap(float(off[k]), f"{name}: {what}", float(mine[k]), float(theirs[k]))
    return worst


def _numbers(quantity: str, found: Mapping[str, Any], wanted: Mapping[str, Any]) -> Gap | None:
    worst, some = Gap(0.0), False
    for key in OWN.get(quantity, (quantity,)):
        theirs = {name: value[0] for name, value in wanted[key].items()}
        mine = {name: value[0] for name, value in found.get(key, {}).items()}
        usual = -math.inf if key == "lower" else math.inf if key == "upper" else 0.0
        some |= any(x != usual for x in (*theirs.values(), *mine.values()))
        for name, x in theirs.items():
            y = mine.get(name, usual)
            off = _apart(x, y)
            if off > worst.size:
                worst = Gap(min(off, 1e300), name, y, x)
    return worst if some else None


def _apart(x: float, y: float) -> float:
    """Difference of two numbers over the larger; 1 where one of them alone is infinite."""
    if x == y:
        return 0.0
    return abs(x - y) / max(abs(x), abs(y)) if math.isfinite(x) and math.isfinite(y) else 1.0


def _actuators(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> Gap | None:
    if not found and not wanted:
        return None
    off = [name for name in wanted if sorted(found.get(name, [""])) != sorted(wanted[name])]
    off += [name for name in found if name not in wanted]
    return Gap(float(len(off)), ", ".join(off[:3]), len(found), len(wanted))
