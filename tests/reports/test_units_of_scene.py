"""Units of coordinates are those of their joints, in every case that is shipped, and another one is seen."""

from __future__ import annotations

from dataclasses import replace

import pytest

from crossbody import cases
from crossbody.cases import Case
from crossbody.reports.judging.units_of_scene import units_of_scene


def called(case: Case, field: str, k: int, unit: str) -> Case:
    """The case with another unit of one coordinate or velocity."""
    named = list(getattr(case, field))
    named[k] = replace(named[k], unit=unit)
    return replace(case, **{field: tuple(named)})


@pytest.mark.parametrize("name", cases.names())
def test_no_unit_is_another_than_that_of_its_joint(name: str) -> None:
    for variant in cases.variants(name):
        case = cases.load(name, variant)
        (row,) = units_of_scene(case)
        assert row.ok, row
        for field in ("coordinates", "velocities"):
            for k in range(len(getattr(case, field))):
                for unit in ("cm", "mm", "deg", "km", "g", "ms", "inch"):
                    assert not units_of_scene(called(case, field, k, unit))[0].ok, (field, k, unit)
                if case.scene is not None:
                    other = "m" if getattr(case, field)[k].unit == "rad" else "rad"
                    assert not units_of_scene(called(case, field, k, other))[0].ok


@pytest.mark.parametrize("unit", ["m s", "N s", "1", "m/s^2", "kg m^2", "N*m", "rad s^-1", "V/(m s)", "K"])
def test_what_is_of_the_si_may_be_a_unit_of_ones_own(unit: str) -> None:
    case = cases.load("soft_contact", "axis")
    assert units_of_scene(called(case, "coordinates", 1, unit))[0].ok
