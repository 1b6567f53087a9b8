"""Whether parameters of a case have the units of what they set: a start that moves as a parameter does has its unit.

A label is compared with nothing by any run. But a coordinate or a velocity of the start that changes by just as much as
a parameter, is that parameter, and so of its unit.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from crossbody import cases
from crossbody.cases import Case, CaseUnsupported
from crossbody.cases.errors import InvalidValue
from crossbody.cases.loading import module
from crossbody.reports.judging.asked import Found, Within, unlike

PART, SAME = 1e-3, 1e-9
"""Part of a parameter, or SI unit, by which it is moved, and part by which two changes are the same one."""


@cache
def wrong(name: str) -> tuple[Found, ...]:
    """Return which parameters, 0 and 1, and of what, have another unit than what they set.

    Args:
        name: of one of crossbody's own cases.
    """
    return unlike((lambda: _units(name),), "unit", f"the parameters of {name}, which end in")


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
