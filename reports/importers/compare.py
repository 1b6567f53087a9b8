"""What an importer has made of a file beside what the file says: a row a quantity."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Any

from crossbody.cases.files.urdf import PLANAR
from crossbody.reports.importers import motion, parts
from crossbody.reports.importers.parts import Gap, reach

TOLERANCE = 1e-9  # of the largest entry: the same physics
OK, WRONG, UNSUPPORTED, FAILED, NONE, UNSEEN = "ok", "wrong", "unsupported", "failed", "-", "not shown"
QUANTITIES = (
    "reading", "coordinates", "bodies", "inertia", "M", "gravity", "bias", "energy", "frames",
    "armature", "damping", "springs", "limits", "friction", "effort", "tendons", "loops",
    "actuators", "shapes", "contacts", "surfaces", "softness", "keyframes",
)  # fmt: skip
"""Of rows, in their order."""
SAID = re.compile(r"unsupported|not (yet )?(been )?(supported|implemented)|(will be |is |are )?ignored|ignoring", re.I)
"""How an importer says what it leaves out."""
GENERAL = re.compile(r"the tag '\w+' found as a child of '\w+'", re.I)
"""How one says that it leaves all of a tag out, once; the line of the file is that of the first."""
WORDS = {
    "armature": "armature|rotor", "damping": "damping", "springs": "stiffness|spring",
    "limits": "range|limit", "friction": "friction(loss)?", "effort": "actuatorfrcrange|effort",
    "keyframes": "keyframe", "surfaces": "friction|condim|margin",
    "softness": "solref|solimp|solreflimit|solimplimit|timestep",
    "loops": "equality|connect|weld|mimic|constraint", "actuators": "actuator|motor|transmission",
    "coordinates": "joint", "tendons": "tendon|spatial", "shapes": "mesh|shape|collision",
    "contacts": "exclude|contype|conaffinity|pair",
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
        verdict: ok, wrong, unsupported, failed, not shown; - where the file has nothing of it.
        why: a sentence, where there is one.
        cause: name of the feature that is read wrongly, where it is known.
        file, line: where that stands.
        doubt: perhaps, where leaving the feature out alone does not make the importer agree.
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
    doubt: str = ""


def rows(
    engine: str, found: Mapping[str, Any], wanted: Mapping[str, Any], joints: Sequence[Sequence[str]],
    named: Mapping[int, Mapping[str, Set[str]]] | None = None,
) -> list[Row]:  # fmt: skip
    """Return what an importer has made of a file, its answer, beside that of a reader without fault.

    Joints are name, body and kind in the order of the coordinates; `named` is line of the file ->
    tag -> names of the parts that stand there.
    """
    if found["status"] != "read":
        error = [found.get("error", found["why"]), *(line for line in found["told"][-1:] if "error" in line.lower())]
        refused = UNSUPPORTED if any(map(SAID.search, error)) else FAILED
        return [
            Row(
                engine=engine,
                version=found.get("version", ""),
                quantity="reading",
                verdict=refused if found["status"] == "failed" else UNSUPPORTED,
                why=found["why"],
            )
        ]
    told = [Row(engine=engine, version=found["version"], quantity="reading")]
    tolerance = max(TOLERANCE, found["precision"], wanted["precision"])
    bodies = {name: {name, body} for name, body, _ in joints}
    parts = {name for name, body, _ in joints for name in (name, body)} | {*wanted["actuators"], *wanted["tendons"]}
    said = Said(found["told"], named or {}, parts)
    for quantity, own in gaps(found, wanted, joints):
        told.append(_row(engine, found, quantity, own, tolerance, said, bodies))
    return told


@dataclass(frozen=True, slots=True)
class Said:
    """What an importer says while it reads, each line once, beside the names of the file's parts.

    `named` is line of the file -> tag -> names of the parts that stand there.
    """

    lines: Sequence[str]
    named: Mapping[int, Mapping[str, Set[str]]]
    parts: Set[str]

    def excuse(self, words: str, names: Set[str]) -> str:
        """Return the line in which it says that it leaves something out; empty where none does.

        A line that names parts, or the line of the file where they stand, excuses these alone. The
        words are a pattern of what it speaks of; the names are of the part that differs and of its
        body.
        """
        for line in self.lines:
            if words and SAID.search(line) and re.search(rf"\b({words})s?\b", line, re.I):
                about = self.about(line)
                if not about or not names or about & names:
                    return line
        return ""

    def about(self, line: str) -> set[str]:
        """Return the names of the parts that a line speaks of; none where it speaks of all with a tag or attribute."""
        if GENERAL.search(line):
            return set()
        quoted = {word for found in re.findall(r"'([^']*)'|\"([^\"]*)\"|\[([^\]]*)\]", line) for word in found}
        places = [self.named.get(int(number), {}) for number in re.findall(r":(\d+):", line)]
        places = [{tag: place[tag] for tag in place.keys() & quoted} or place for place in places]
        return ({name for place in places for own in place.values() for name in own} | quoted) & self.parts


def _row(
    engine: str, found: Mapping[str, Any], quantity: str, own: Iterable[Gap] | None,
    tolerance: float, said: Said, bodies: Mapping[str, Set[str]],
) -> Row:  # fmt: skip
    """Return one row; what the importer hides, or says of each that it leaves it out, is not wrong."""
    common: dict[str, Any] = {"engine": engine, "version": found["version"], "quantity": quantity}
    hidden, unseen = found["hidden"], found["unseen"]
    if own is None:
        return Row(**common, verdict=NONE)
    if quantity in unseen:
        verdict = FAILED if quantity in found.get("refused", ()) else UNSEEN
        return Row(**common, verdict=verdict, why=unseen[quantity])
    told = sorted(own, key=lambda gap: -gap.size)
    if not (off := [gap for gap in told if not gap.size <= tolerance]):
        return Row(**common, **_numbers(told[0])) if told else Row(**common)
    words = WORDS.get(quantity, "")
    why = [_hidden(hidden, quantity, gap) or said.excuse(words, bodies.get(gap.part, {gap.part} - {""})) for gap in off]
    wrong = [gap for gap, reason in zip(off, why, strict=True) if not reason]
    if seen := [gap for gap in wrong if not gap.unseen]:
        return Row(**common, **_numbers(seen[0]), verdict=WRONG)
    if wrong:
        return Row(**common, verdict=UNSEEN, why=wrong[0].where)
    return Row(**common, **_numbers(off[0]), verdict=UNSUPPORTED, why=why[0])


def _hidden(hidden: Mapping[str, str], quantity: str, gap: Gap) -> str:
    """Return why an engine does not have it; what it has all the same is another matter."""
    reason = hidden.get(gap.key or quantity, hidden.get(quantity, ""))
    return str(reason) if gap.lacks or not gap.key else ""


def _numbers(gap: Gap) -> dict[str, Any]:
    value, expected = (None if math.isnan(one) else float(one) for one in (gap.value, gap.expected))
    return {"where": gap.where, "difference": min(gap.size, 1e300), "value": value, "expected": expected}


def gaps(
    found: Mapping[str, Any], wanted: Mapping[str, Any], joints: Sequence[Sequence[str]]
) -> Iterator[tuple[str, Sequence[Gap] | None]]:
    """Yield quantities in their order; None where the file has nothing of it, or it cannot be compared."""
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
        yield "bodies", motion.bodies(found["states"][0], wanted["states"][0])
        yield "inertia", motion.inertia(found["inertias"], wanted["inertias"], reach(wanted["states"]))
        floor = 1.0 if found["precision"] or wanted["precision"] else motion.FLOOR
        M = motion.states(wanted, "M", names)
        yield "M", motion.matrix(motion.states(found, "M", names), M, names, floor)
        moved = motion.moved(wanted, M)
        for key in ("gravity", "bias"):
            mine, own = (motion.states(answer, key, names) for answer in (found, wanted))
            yield key, motion.forces(mine, own, names, floor, moved)
        yield "energy", motion.energy(found, wanted, names)
        yield "frames", motion.frames(found["states"], wanted["states"])
    for key in parts.NUMBERS:
        yield key, parts.numbers(key, found["numbers"], wanted["numbers"])
    yield "tendons", parts.tendons(found, wanted)
    yield "loops", parts.loops(found, wanted)
    yield "actuators", parts.actuators(found, wanted, [] if off else names)
    if not off and "shapes" not in wanted["unseen"]:
        of = parts.matched(found, wanted)
        yield "shapes", parts.shapes(found, wanted, of)
        yield "contacts", parts.contacts(found, wanted, of)
        yield "surfaces", parts.surfaces(found, wanted, of)
    if not off:
        yield "softness", parts.softness(found, wanted)
        yield "keyframes", parts.keyframes(found, wanted)
