"""Whether parameters of a case have the units and axes of what they set: a start that moves as one does has its unit.

A label is compared with nothing by any run. But a coordinate or a velocity of the start that changes by just as much as
a parameter, is that parameter, and so of its unit. And what is said to be along x moves no number along another axis.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache

import numpy as np

from crossbody import cases
from crossbody.cases import Case, CaseUnsupported
from crossbody.cases.errors import InvalidValue
from crossbody.cases.loading import module
from crossbody.reports.judging.asked import Found, Within, unlike

_AXIS = re.compile(r"(?:along|about) ([xyz])\b")
PART, SAME = 1e-3, 1e-9
"""Part of a parameter, or SI unit, by which it is moved, and part by which two changes are the same one."""


@cache
def wrong(name: str) -> tuple[Found, ...]:
    """Return which parameters, 0 and 1, and of what, have another unit than what they set.

    Args:
        name: of one of crossbody's own cases.
    """
    kinds = (lambda: _units(name), lambda: _axes(name))
    return unlike(kinds, "unit", f"the parameters of {name}, which end in")


def _units(name: str) -> Iterator[Within]:
    """Yield 1 for a parameter whose unit is another one than that of what it sets in the first variant, else 0."""
    source = module(name)
    variant = next(iter(source.VARIANTS))
    case = cases.load(name, variant)
    units = [*(one.unit for one in case.coordinates), *(f"{one.unit}/s" for one in case.velocities)]
    for key, parameter in source.PARAMETERS.items():
        if parameter.unit and isinstance(parameter.default, float):
            set_ = {unit for unit, same in zip(units, _follows(case, key), strict=True) if same}
            yield "unit", f"{key} of {name}, {parameter.unit}", float(bool(set_ - {parameter.unit})), 0.0, 0.0


def _axes(name: str) -> Iterator[Within]:
    """Yield 1 for a parameter that moves something along another axis than it says, or nothing at all, else 0."""
    for key, parameter in module(name).PARAMETERS.items():
        if not (told := _AXIS.search(parameter.doc)) or not isinstance(parameter.default, float):
            continue
        moved = {axis for variant in cases.variants(name) for axis in _moved(cases.load(name, variant), key)}
        yield "unit", f"{key} of {name}, {told[0]}", float(moved != {told[1]}), 0.0, 0.0


def _moved(case: Case, key: str) -> Iterator[str]:
    """Yield the axes along which what has one changes with a parameter: centres of masses, speeds, pushes."""
    try:
        other = cases.load(case.name, case.variant, **{key: case.number(key) + PART})
    except InvalidValue:  # beside another one
        return
    pairs = [(one.name, a, b) for one, a, b in zip(case.velocities, case.v0, other.v0, strict=True)]
    if case.inputs is not None and other.inputs is not None:
        columns = zip(case.inputs.names, case.inputs.values.T, other.inputs.values.T, strict=True)
        pairs += [(name.partition(" [")[0], np.abs(a).sum(), np.abs(b).sum()) for name, a, b in columns]
    if case.scene is not None and other.scene is not None:
        for one, two in zip(case.scene.bodies, other.scene.bodies, strict=True):
            pairs += zip("xyz", one.com, two.com, strict=True)
    for name, before, after in pairs:
        if before != after and name[-1:] in ("x", "y", "z"):
            yield name[-1]


def _follows(case: Case, key: str) -> list[bool]:
    """Return which positions and velocities of the start change by as much as a parameter does."""
    start, value = np.concatenate([case.q0, case.v0]), case.number(key)
    for by in (PART * max(abs(value), 1.0), -PART * max(abs(value), 1.0)):
        try:
            other = cases.load(case.name, case.variant, **{key: value + by})
        except (InvalidValue, CaseUnsupported):  # beyond its bounds, on that side
            continue
        moved = np.concatenate([other.q0, other.v0])
        if moved.shape == start.shape:
            off = np.abs(np.abs(moved - start) - abs(by))
            return [bool(one) for one in off <= SAME * np.maximum(np.abs(start), abs(by))]
    return [False] * len(start)
