"""Errors are the same in another process, which has only what is pickled of them."""

from __future__ import annotations

import inspect
import pickle

import pytest

from crossbody.cases import errors

KINDS = [one for _, one in inspect.getmembers(errors, inspect.isclass) if issubclass(one, errors.CrossbodyError)]
GIVEN = {
    errors.UnknownName: ("case", "bal", ("ball", "rod")),
    errors.NoFile: ("robot file", "gone/arm.xml"),
    errors.LogFormatError: ("log.csv", "is empty.", 3, "t"),
    errors.ColumnMapError: ("map.toml", "$.time", "is absent."),
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_error_is_the_same_in_another_process(kind: type[errors.CrossbodyError]) -> None:
    error = kind(*GIVEN.get(kind, ("What is wrong, and what would be valid.",)))
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is kind
    assert (str(again), again.args, vars(again)) == (str(error), error.args, vars(error))


@pytest.mark.parametrize(
    ("kind", "told"),
    [("case", "case 'x'"), ("variant of ball", "variant 'x' of ball"), ("name in a.py", "name 'x' in a.py"),
     ("engine (of a setting)", "engine 'x' (of a setting)")],
)  # fmt: skip
def test_a_name_stands_before_whose_it_is(kind: str, told: str) -> None:
    assert str(errors.UnknownName(kind, "x", ("abc",))) == f"There is no {told}. Known: abc."


@pytest.mark.parametrize("count", [errors.NAMED, 500])
def test_of_many_names_the_nearest_are_listed(count: int) -> None:
    names = [f"channel {k}" for k in range(count)]
    said = str(errors.UnknownName("channel", "chanel 7", names))
    assert "Did you mean 'channel 7'?" in said
    listed = said.split(": ")[-1].rstrip(".").split(", ")
    assert "channel 7" in listed
    assert len(listed) == (count if count <= errors.NAMED else errors.LISTED)
    assert (f"Known are {count}" in said) is (count > errors.NAMED)
