"""Units in which a case says that its coordinates count, held against the joints that they are of.

Numbers do not tell a unit: a height in metres that is called centimetres is compared as well, and shown a hundred times
too small. What a slide moves counts in metres, and what a hinge turns in radians; a coordinate of another kind (of a
mechanism of its own) is that of a joint where it changes as that one does, and counts in units of the SI in any case.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np

from crossbody.cases import Case, CaseUnsupported
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.reports.judging.audit import AuditRow

OF_JOINTS = {
    "slide": (("m",), ("m",)), "hinge": (("rad",), ("rad",)), "ball": (("1",) * 4, ("rad",) * 3),
    "free": (("m",) * 3 + ("1",) * 4, ("m",) * 3 + ("rad",) * 3),
}  # fmt: skip
"""Kind of a joint -> units of its positions, and those of its velocities times s."""
SI = frozenset(
    ("m", "kg", "s", "A", "K", "mol", "cd", "rad", "sr", "Hz", "N", "Pa", "J", "W", "C", "V", "F", "Ohm", "T", "H")
)  # fmt: skip
_BETWEEN, _POWER = re.compile(r"[\s*/()·]+"), re.compile(r"\^?[-+]?\d+$")
SAME = 1e-9
"""Part by which a coordinate may change otherwise than the joint that it is."""


def units_of_scene(case: Case) -> tuple[AuditRow, ...]:
    """Return a row for the parity audit: the units of coordinates and velocities, and what they must be."""
    mine = [[one.unit for one in named] for named in (case.coordinates, case.velocities)]
    theirs = [
        [known or unit for known, unit in zip(*both, strict=True)] for both in zip(_known(case), mine, strict=True)
    ]
    off = [unit for unit in (*mine[0], *mine[1]) if not _is_si(unit)]
    same = mine == theirs and not off
    said = f"of the SI, not {', '.join(dict.fromkeys(off))}" if off else _words(theirs)
    return (
        AuditRow(quantity="units", mine=_words(mine), theirs=said, difference=0.0 if same else np.inf, tolerance=0.0),
    )


def _is_si(unit: str) -> bool:
    """Whether a unit is a product of those of the SI, without prefixes; nothing is none."""
    return all(_POWER.sub("", part) in SI or part in ("", "1") for part in _BETWEEN.split(unit))


def _words(units: Sequence[Sequence[str]]) -> str:
    return "; ".join(" ".join(unit.replace(" ", "*") or "-" for unit in some) for some in units)


def _known(case: Case) -> list[list[str]]:
    """Return the units of coordinates and of velocities that joints tell; "" of those that they do not."""
    nothing = [[""] * len(case.coordinates), [""] * len(case.velocities)]
    if case.scene is not None and case.form is None:
        found = _of_joints(case.scene)
        return found if [*map(len, found)] == [*map(len, nothing)] else nothing
    if case.form is None:
        return nothing
    try:
        form = case.form(case, True, False)
    except CaseUnsupported:
        return nothing
    scene, force = form.case.scene, form.case.force
    assert scene is not None
    units = _of_joints(scene, () if force is None else force.states)[1]
    rates = [*_alike(form.rate_matrix(form.case.q0), units)]
    return [rates if len(rates) == len(one) else one for one in nothing]


def _of_joints(scene: Scene, states: Sequence[str] = ()) -> list[list[str]]:
    """Return the units of positions and of velocities of a scene; "" of bodies that stand for other states."""
    return [
        ["" if joint.body in states else unit for joint in scene.joints for unit in OF_JOINTS[joint.type][k]]
        for k in (0, 1)
    ]


def _alike(rates: Floats, units: Sequence[str]) -> Iterator[str]:
    """Yield the unit of the velocity that each is, by how velocities of a case change with those of joints."""
    for row in np.abs(rates):
        (moved,) = np.nonzero(row > SAME)
        yield units[moved[0]] if len(moved) == 1 and abs(row[moved[0]] - 1.0) <= SAME else ""
