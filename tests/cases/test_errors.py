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
