"""Fields of the parts of a scene, checked by what they are declared as: each refusal names part, field and value."""

from __future__ import annotations

import dataclasses
import math
import numbers
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from crossbody.cases.errors import SceneError, shown

Vector = tuple[float, ...]


def check_fields(part: Any, what: str) -> None:
    """Bring every number of a part to a float, names to a tuple, and check the type of what is no vector.

    Args:
        part: of a frozen dataclass.
        what: what stands before the name of a field in messages.

    Raises:
        SceneError: naming the field.
    """
    for field in dataclasses.fields(part):
        where, value = what + field.name, getattr(part, field.name)
        if field.type == "float":
            object.__setattr__(part, field.name, real(where, value))
        elif field.type == "tuple[str, ...]":
            object.__setattr__(part, field.name, names(where, value))
        elif field.type in _TYPES:
            kind, wanted = _TYPES[cast("str", field.type)]
            if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
                raise SceneError(f"{where} is {shown(value)}; it must be {wanted}.")


_TYPES: dict[str, tuple[type, str]] = {
    "str": (str, "a text"), "bool": (bool, "True or False"), "int": (numbers.Integral, "a whole number"),
}  # fmt: skip


def real(where: str, value: Any) -> float:
    """Return a finite number."""
    found = _floats((value,))
    if found is None or not math.isfinite(found[0]):
        raise SceneError(f"{where} is {shown(value)}; it must be {'a number' if found is None else 'finite'}.")
    return found[0]


def names(where: str, value: Any) -> tuple[str, ...]:
    """Return names as a tuple."""
    if not isinstance(value, Sequence) or isinstance(value, str) or not all(isinstance(one, str) for one in value):
        raise SceneError(f"{where} is {shown(value)}; it must be a list of names.")
    return tuple(value)


def parts(where: str, value: Any, kind: type) -> tuple[Any, ...]:
    """Return parts of one kind as a tuple."""
    if not isinstance(value, Sequence) or not all(isinstance(one, kind) for one in value):
        raise SceneError(f"{where} is {shown(value)}; it must be a list, each of its entries a {kind.__name__}.")
    return tuple(value)


def vector(where: str, value: Any, size: int | None = None) -> Vector:
    """Return finite numbers; without a size as many as there are."""
    found = _numbers(where, value, size)
    if not all(map(math.isfinite, found)):
        raise SceneError(f"{where} is {shown(value)}; it must be finite.")
    return found


def turn(where: str, value: Any, size: int) -> Vector:
    """Return a quaternion, of any length that is a number."""
    found = vector(where, value, size)
    if not 0.0 < sum(number * number for number in found) < math.inf:
        raise SceneError(f"{where} is {shown(value)}; a quaternion has a length above 0 that is finite.")
    return found


def bounds(where: str, value: Any, size: int) -> Vector:
    """Return the lowest and the highest value that something may have; infinite where there is no such bound."""
    low, high = found = _numbers(where, value, size)
    if not (low <= high and low < math.inf and high > -math.inf):
        raise SceneError(f"{where} is {shown(value)}; it must be the lowest and the highest value.")
    return found


def points(where: str, value: Any) -> tuple[Vector, ...]:
    """Return points, each of three numbers."""
    if not isinstance(value, (Sequence, np.ndarray)) or np.ndim(value) == 0:
        raise SceneError(f"{where} is {shown(value)}; it must be a list of points, each of 3 numbers.")
    return tuple(vector(f"{where}: point {k}", point, 3) for k, point in enumerate(value))


def _numbers(where: str, value: Any, size: int | None) -> Vector:
    listed = not isinstance(value, (str, bytes, bytearray, Mapping, set, frozenset))
    found = _floats(value) if listed else None
    if found is None or len(found) != (len(found) if size is None else size) or any(map(math.isnan, found)):
        raise SceneError(f"{where} is {shown(value)}; it must be {'' if size is None else f'{size} '}numbers.")
    return found


def _floats(value: Any) -> Vector | None:
    """Return real numbers as floats; None where one is none: text, a switch, a complex number, an array."""
    try:
        given = tuple(value)
        if all(isinstance(one, numbers.Real) and not isinstance(one, bool) for one in given):
            return tuple(map(float, given))
    except (TypeError, ValueError, OverflowError):
        pass
    return None
