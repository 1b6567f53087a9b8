"""Parameters that are lists, or numbers that a word may stand for."""

from __future__ import annotations

from typing import Any

import pytest

from crossbody.cases import InvalidValue
from crossbody.cases.parameters import NumberOrWord, Numbers, spread
from crossbody.reports.runs.jobs import parse_settings

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
