"""Arguments of the entry points, checked before anything is computed with them: by their annotations, in one place.

Arrays are checked where their shapes are known (`cases._arrays.frozen`), and ranges where they have a meaning.
"""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from importlib import import_module
from typing import Any, ParamSpec, TypeVar, cast

import numpy as np

from crossbody.cases import InvalidValue, SceneError
from crossbody.cases._arguments import flag, instance, real, shown, texts, whole
from crossbody.reference._kinds import Index

_P = ParamSpec("_P")
_R = TypeVar("_R")
CLASSES = dict.fromkeys(("System", "Options"), "crossbody.reference") | {"Trajectory": "crossbody.cases"}
CLASSES |= dict.fromkeys(("LinearModel", "Unknown"), "crossbody.reference.linear")
LOWEST = -(2**63)
LARGEST = 1e100  # of a deviation: its square is still a number


def checked_arguments(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Make a function check the type of each argument before it runs, and tell a wrong one in a sentence.

    The call raises `InvalidValue`, naming function and argument.
    """
    signature = inspect.signature(function)
    kinds = {name: _check_of(str(one.annotation)) for name, one in signature.parameters.items() if _is_single(one)}

    @functools.wraps(function)
    def call(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        bound = signature.bind(*args, **kwargs)
        for name, check in kinds.items():
            if check is not None and name in bound.arguments:
                where = f"{function.__qualname__}.{name}"
                bound.arguments[name] = check(where, bound.arguments[name])
        return function(*bound.args, **bound.kwargs)

    return call


def finite(where: str, value: object) -> float:
    """Return a finite number as a float.

    Raises:
        InvalidValue: if it is none.
    """
    number = real(where, value)
    if not math.isfinite(number):
        raise InvalidValue(f"{where} is {shown(value)}; it must be finite.")
    return number


def different(where: str, given: Sequence[int], below: int) -> Index:
    """Return indices as an array.

    Raises:
        SceneError: if one comes twice, or lies outside of 0 .. below - 1.
    """
    found = np.asarray(given, dtype=np.int64)
    if np.any(found < 0) or np.any(found >= below) or len(np.unique(found)) != len(found):
        raise SceneError(f"{where} is {found.tolist()}; valid: different ones below {below}.")
    return found


def _is_single(parameter: inspect.Parameter) -> bool:
    return parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)


def _check_of(annotation: str) -> Callable[[str, Any], Any] | None:
    """Return what checks a value of an annotation; None for arrays and what else is checked elsewhere."""
    kind, _, rest = annotation.partition(" | ")
    check = _CHECKS.get(kind) or (functools.partial(_of_class, kind) if kind in CLASSES else None)
    if check is None or rest != "None":
        return check
    return lambda where, value: None if value is None else check(where, value)


def _of_class(name: str, where: str, value: object) -> object:
    home = CLASSES[name]
    return instance(where, value, cast("type", getattr(import_module(home), name)), f"a {home}.{name}")


def wholes(where: str, value: object) -> tuple[int, ...]:
    """Return whole numbers as a tuple.

    Raises:
        InvalidValue: if it is no list of whole numbers.
    """
    listed = isinstance(value, Collection) and not isinstance(value, (str, bytes, Mapping, set))
    if not listed or len(getattr(value, "shape", (0,))) != 1:
        raise InvalidValue(f"{where} is {shown(value)}; it must be a list of whole numbers.")
    return tuple(whole(f"{where}[{i}]", one, LOWEST) for i, one in enumerate(cast("Collection[object]", value)))


def _callable(where: str, value: object) -> object:
    if not callable(value):
        raise InvalidValue(f"{where} is {shown(value)}; it must be a function.")
    return value


def _named(where: str, value: object) -> Mapping[str, Any]:
    found = instance(where, value, Mapping, "a mapping of names to values")
    texts(f"The keys of {where}", list(found))
    return found


_CHECKS: dict[str, Callable[[str, Any], Any]] = {
    "float": finite, "int": lambda where, value: whole(where, value, LOWEST), "bool": flag, "Sequence[int]": wholes,
    "Callable[[float], LinearModel]": _callable, "Sequence[str]": texts, "Mapping[str, ArrayLike]": _named,
}  # fmt: skip
