"""Arguments of the entry points: a wrong type is told in a sentence, not in a traceback from inside."""

from __future__ import annotations

import math
import numbers
import os
from collections.abc import Collection
from typing import Any, TypeGuard, TypeVar, cast

from crossbody.cases.errors import InvalidValue
from crossbody.cases.errors import shown as shown  # a name of this module too

_Kind = TypeVar("_Kind")
LONGEST_NAME, LONGEST_PATH = 255, 4095  # bytes that file systems take of a name, and of a whole path


def instance(where: str, value: object, kind: type[_Kind] | tuple[type[_Kind], ...], wanted: str) -> _Kind:
    """Return a value of a type."""
    if not isinstance(value, kind):
        raise InvalidValue(f"{where} is {shown(value)}; it must be {wanted}.")
    return value


def path(where: str, value: object) -> str:
    """Return a path as text."""
    if not isinstance(value, (str, os.PathLike)) or "\0" in (text := str(value)) or not text:
        raise InvalidValue(f"{where} is {shown(value)}; it must be a path.")
    try:
        raw = os.fsencode(text)
    except UnicodeError:
        raise InvalidValue(f"{where} is {shown(value)}; no file system can have such a path.") from None
    if len(raw) > LONGEST_PATH or any(len(part) > LONGEST_NAME for part in raw.split(os.fsencode(os.sep))):
        raise InvalidValue(
            f"{where} is {shown(value)}; a name has at most {LONGEST_NAME} bytes, a path {LONGEST_PATH}."
        )
    return text


def texts(where: str, value: object) -> tuple[str, ...]:
    """Return names as a tuple."""
    listed = isinstance(value, Collection) and not isinstance(value, (str, bytes)) and not hasattr(value, "dtype")
    if not listed or not all(isinstance(one, str) for one in cast("Collection[object]", value)):
        raise InvalidValue(f"{where} is {shown(value)}; it must be a list of names.")
    return tuple(cast("Collection[str]", value))


def whole(where: str, value: object, low: int = 1) -> int:
    """Return a whole number."""
    if not isinstance(value, numbers.Integral) or not low <= int(value) < 2**63:
        raise InvalidValue(f"{where} is {shown(value)}; it must be a whole number from {low} on.")
    return int(value)


def real(where: str, value: object) -> float:
    """Return a number as a float; infinite ones too."""
    if not _is_number(value):
        raise InvalidValue(f"{where} is {shown(value)}; it must be a number.")
    try:
        found = float(value)
    except OverflowError:
        found = math.nan
    if math.isnan(found):
        raise InvalidValue(f"{where} is {shown(value)}; it must be a number of double precision.")
    return found


def _is_number(value: Any) -> TypeGuard[float]:
    """Return whether this is a real number, one of NumPy included, whose switches are no `numbers.Real`."""
    return isinstance(value, numbers.Real) or (getattr(value, "dtype", "") == "bool" and value.ndim == 0)


def flag(where: str, value: Any) -> bool:
    """Return a switch."""
    if not _is_number(value) or value not in (0, 1):
        raise InvalidValue(f"{where} is {shown(value)}; valid: True, False.")
    return bool(value)
