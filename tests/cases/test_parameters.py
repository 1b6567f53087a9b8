"""Parameters that are lists, or numbers that a word may stand for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from crossbody import cases
from crossbody.cases import InvalidValue, Parameter, UnknownName
from crossbody.cases.parameters import NumberOrWord, Numbers, spread
from crossbody.reports.runs.choice import load_cases, parse_settings

MASSES = Numbers(default="0.1", unit="kg", low=0.0, open_low=True)
HORIZON = NumberOrWord(default="auto", unit="s", low=0.0, open_low=True, choices=("auto",))


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ("4,2,1", "4,2,1"),
        (" 4, 2.0 ,1e-3", "4,2,0.001"),
        (0.1, "0.1"),
        (2, "2"),
        ((4.0, 2.0, 1.0), "4,2,1"),
        ("3", "3"),
    ],
)
def test_numbers_have_one_text(given: Any, text: str) -> None:
    assert MASSES.checked("masses", given) == text
    assert MASSES.checked("masses", text) == text


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("4,,1", "masses[1]"), ("4,x,1", "masses[1] is 'x'"), ("4,0,1", "masses[1] is 0; valid: (0"), ("", "number"),
        ("nan", "valid"), ("1,inf", "masses[1]"), (-1.0, "valid: (0"), ((), "empty"),
    ],
)  # fmt: skip
def test_bad_numbers_are_named(given: Any, says: str) -> None:
    with pytest.raises(InvalidValue, match="masses") as told:
        MASSES.checked("masses", given)
    assert says in str(told.value)


def test_numbers_are_given_on_the_command_line() -> None:
    assert MASSES.checked("masses", parse_settings(["masses=4,2,1"])["masses"]) == "4,2,1"
    assert MASSES.checked("masses", parse_settings(["masses=0.5"])["masses"]) == "0.5"


def test_one_number_serves_all() -> None:
    assert spread("masses", "0.5", 3).tolist() == [0.5, 0.5, 0.5]
    assert spread("masses", "4,2,1", 3).tolist() == [4.0, 2.0, 1.0]
    with pytest.raises(InvalidValue, match="lists 2 numbers; valid: one for all, or 3"):
        spread("masses", "4,2", 3)


def test_a_word_stands_for_a_number() -> None:
    assert HORIZON.checked("t_end", "auto") == "auto"
    assert HORIZON.checked("t_end", "2.5") == 2.5
    for wrong in ("soon", 0.0, -1.0):
        with pytest.raises(InvalidValue, match="or: auto"):
            HORIZON.checked("t_end", wrong)


ROBOT = """<mujoco><worldbody><body><joint name="j" type="slide"/><geom size=".1"/></body></worldbody>
<keyframe><key name="low" qpos="-1"/><key name="high" qpos="2"/></keyframe></mujoco>"""


@pytest.mark.parametrize("name", cases.names())
def test_a_case_and_its_variant_are_one_word_wherever_a_case_is_taken(name: str) -> None:
    for variant in cases.variants(name):
        both = f"{name}:{variant}"
        assert cases.variants(both) == (variant,)
        assert cases.load(both).label == cases.load(name, variant).label == cases.load(both, variant).label == both
        assert [case.label for case in load_cases([both], None, {})] == [both]
    with pytest.raises(UnknownName, match=f"no variant 'nope' of {name}"):
        cases.load(f"{name}:nope")
    with pytest.raises(InvalidValue, match="give one of them"):
        cases.load(both, "nope")


def test_so_are_a_robots_file_and_its_keyframe(tmp_path: Path) -> None:
    path = tmp_path / "with:colon.xml"
    path.write_text(ROBOT)
    assert [cases.load(f"{path}:{key}").q0[0] for key in ("low", "high")] == [-1.0, 2.0]
    assert len(load_cases([str(path)], None, {})) > 1
    with pytest.raises(UnknownName, match="nope"):
        cases.load(f"{path}:nope")


@pytest.mark.parametrize(("unit", "told"), [("", "(0, inf)."), ("kg", "(0, inf) kg.")])
def test_what_is_valid_has_its_unit_and_no_space_without(unit: str, told: str) -> None:
    with pytest.raises(InvalidValue) as error:
        Parameter(default=1.0, unit=unit, low=0.0, open_low=True).checked("mu", -1.0)
    assert str(error.value) == f"mu is -1; valid: {told}"
