"""Parameters have the units of what they set at the start; one that has another is told, in every case."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import pytest

from crossbody import cases
from crossbody.cases.loading import module
from crossbody.reports.judging import known_dimensions, known_units


@pytest.mark.parametrize("name", sorted(cases.REGISTRY.own()))
def test_units_of_every_case_are_those_of_what_its_parameters_set(name: str) -> None:
    assert known_units.wrong(name) == ()
    assert known_dimensions.wrong(name) == ()


@pytest.mark.parametrize(
    ("name", "key"), [("rolling_sphere", "spin_y"), ("bouncing_ball", "height"), ("newtons_cradle", "speed")]
)
def test_a_parameter_with_another_unit_is_told(name: str, key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    own = module(name)
    other = {**own.PARAMETERS, key: replace(own.PARAMETERS[key], unit="kg")}
    monkeypatch.setattr(own, "PARAMETERS", MappingProxyType(other))
    known_units.wrong.cache_clear()
    try:
        assert [what for *_, what in known_units.wrong(name)] == [f"{key} of {name}, kg"]
    finally:
        known_units.wrong.cache_clear()


@pytest.mark.parametrize(
    ("name", "key", "unit"),
    [("tossed_cube", "off", "rad/s"), ("delta_singularity", "start", "m/s"), ("newtons_cradle", "radius", "kg"),
     ("bouncing_ball", "a0", "1/s"), ("stacked_blocks", "push_low", "kg"), ("sliding_block", "speed", "m")],
)  # fmt: skip
def test_a_parameter_whose_unit_is_not_that_of_what_is_made_of_it_is_told(
    name: str, key: str, unit: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = module(name)
    other = {**own.PARAMETERS, key: replace(own.PARAMETERS[key], unit=unit)}
    monkeypatch.setattr(own, "PARAMETERS", MappingProxyType(other))
    known_dimensions.wrong.cache_clear()
    try:
        assert known_dimensions.wrong(name)
    finally:
        known_dimensions.wrong.cache_clear()


@pytest.mark.parametrize(
    ("name", "key"), [("tossed_cube", "off"), ("delta_impulse", "jz"), ("rolling_sphere", "speed")]
)
def test_a_parameter_that_moves_another_axis_than_it_says_is_told(
    name: str, key: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = module(name)
    other = {**own.PARAMETERS, key: replace(own.PARAMETERS[key], doc="along y")}
    monkeypatch.setattr(own, "PARAMETERS", MappingProxyType(other))
    known_units.wrong.cache_clear()
    try:
        assert [what for *_, what in known_units.wrong(name)] == [f"{key} of {name}, along y"]
    finally:
        known_units.wrong.cache_clear()
