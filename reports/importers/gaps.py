"""How far what an importer has made of a file is from what the file says: gaps of every quantity."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from crossbody.cases.files.urdf import PLANAR
from crossbody.reports.importers import motion, parts, solids
from crossbody.reports.importers.gap import Gap, reach


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
        of = solids.matched(found, wanted)
        yield "shapes", solids.shapes(found, wanted, of)
        yield "contacts", solids.contacts(found, wanted, of)
        yield "surfaces", solids.surfaces(found, wanted, of)
    if not off:
        yield "softness", parts.softness(found, wanted)
        yield "keyframes", parts.keyframes(found, wanted)
