"""Arguments of the public entry points, checked by their annotations before anything is computed with them.

Numbers, switches, texts, functions, objects of our own, and lists and tables of them are checked
here, in one place. Arrays are checked where their shapes are known (`cases._arrays`), and ranges
where they have a meaning. Nothing heavy is imported: a class is looked up where the function that
names it stands, and one that is imported there for the type checker alone is known by its name.
"""

from __future__ import annotations

import ast
import builtins
import functools
import inspect
import math
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any, ParamSpec, TypeVar

from crossbody.cases.arguments import flag, instance, real, shown, texts, whole
from crossbody.cases.errors import InvalidValue

_P = ParamSpec("_P")
_R = TypeVar("_R")
_T = TypeVar("_T")
Check = Callable[[str, Any], Any]
LOWEST = -(2**63)
LISTS = ("Sequence", "Iterable", "Collection", "tuple")


def checked_arguments(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Make a function check the type of each argument before it runs, and tell a wrong one in a sentence.

    The call raises `InvalidValue`, naming function and argument. A float must be finite, unless
    its default is not.
    """

    @functools.cache
    def checks() -> dict[str, tuple[str, Check | None]]:
        parameters = inspect.signature(function).parameters.values()
        place = function.__qualname__.removesuffix(".__init__")
        return {one.name: (f"{place}.{one.name}", _check_of(function, one)) for one in parameters}

    @functools.wraps(function)
    def call(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        known, given = checks(), list(args)
        for i, ((where, check), value) in enumerate(zip(known.values(), args, strict=False)):
            if check is not None:
                given[i] = check(where, value)
        for name, value in kwargs.items():
            where, check = known.get(name, ("", None))
            if check is not None:
                kwargs[name] = check(where, value)
        return function(*given, **kwargs)  # type: ignore[arg-type]

    return call


def checked_fields(of: type[_T]) -> type[_T]:
    """Make a dataclass check its fields before anything else, as `checked_arguments` does for a function."""
    of.__init__ = checked_arguments(of.__init__)  # type: ignore[method-assign]
    return of


def _check_of(function: Callable[..., Any], parameter: inspect.Parameter) -> Check | None:
    """Return what checks an argument; None for arrays and what else is checked elsewhere."""
    if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD) or parameter.annotation is parameter.empty:
        return None
    if isinstance(parameter.default, float) and not math.isfinite(parameter.default):
        return real
    space = vars(builtins) | getattr(function, "__globals__", {})
    return _check_of_type(ast.parse(str(parameter.annotation), mode="eval").body, space)


def _check_of_type(node: ast.expr, space: Mapping[str, Any]) -> Check | None:
    if isinstance(node, ast.BinOp):
        return _check_of_union(node, space)
    if isinstance(node, ast.Name):
        return _PLAIN[node.id] if node.id in _PLAIN else _check_of_class(node.id, space)
    if not isinstance(node, ast.Subscript) or not isinstance(node.value, ast.Name):
        return None
    head, parts = node.value.id, node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    if head == "Callable":
        return _callable
    if head == "Mapping":
        key, item = (_check_of_type(part, space) for part in parts)
        return functools.partial(_table, key, item)
    if head not in LISTS:
        return _check_of_class(head, space)
    if isinstance(parts[0], ast.Name) and parts[0].id in _LISTED:
        items = _LISTED[parts[0].id]
    else:
        items = functools.partial(_list, _check_of_type(parts[0], space))
    several = head == "tuple" and not isinstance(parts[-1], ast.Constant)
    return functools.partial(_counted, items, len(parts)) if several else items


def _check_of_union(node: ast.BinOp, space: Mapping[str, Any]) -> Check | None:
    """Return what tries each of several types; None if one of them is not known."""
    if isinstance(node.right, ast.Constant):
        check = _check_of_type(node.left, space)
        return None if check is None else lambda where, value: None if value is None else check(where, value)
    first, second = _check_of_type(node.left, space), _check_of_type(node.right, space)
    if first is None or second is None:
        return None
    return functools.partial(_either, ast.unparse(node), (first, second))


def _either(wanted: str, checks: Iterable[Check], where: str, value: object) -> object:
    for check in checks:
        try:
            return check(where, value)
        except InvalidValue:
            continue
    raise InvalidValue(f"{where} is {shown(value)}; valid: {wanted}.")


def _check_of_class(name: str, space: Mapping[str, Any]) -> Check | None:
    """Return what checks that a value is of a class; None for what is none, a protocol or an alias."""
    if (found := space.get(name)) is None:
        return functools.partial(_of_name, name)
    if not isinstance(found, type) or found is Any or getattr(found, "_is_protocol", False):
        return None
    return lambda where, value: instance(where, value, found, f"a {_full_name(found)}")


def _full_name(of: type) -> str:
    """The name of a class where it is imported from: of the first packages that are public."""
    public = of.__module__.partition("._")[0]
    return of.__name__ if public == "builtins" else f"{public}.{of.__name__}"


def _of_name(name: str, where: str, value: object) -> object:
    if all(of.__name__ != name for of in type(value).__mro__):
        raise InvalidValue(f"{where} is {shown(value)}; it must be a {name}.")
    return value


def _list(check: Check | None, where: str, value: Any) -> tuple[Any, ...]:
    """Return a list as a tuple, each of its items checked."""
    if not isinstance(value, Iterable) or isinstance(value, (str, bytes, bytearray, Mapping)):
        raise InvalidValue(f"{where} is {shown(value)}; it must be a list.")
    if getattr(value, "ndim", 1) == 0:
        raise InvalidValue(f"{where} is {shown(value)}, a number alone; it must be a list.")
    items = tuple(value)
    return items if check is None else tuple(check(f"{where}[{i}]", one) for i, one in enumerate(items))


def _counted(check: Check, count: int, where: str, value: Any) -> Any:
    items = check(where, value)
    if len(items) != count:
        raise InvalidValue(f"{where} is {shown(value)}; it must have {count} items.")
    return items


def _table(key: Check | None, check: Check | None, where: str, value: Any) -> Mapping[Any, Any]:
    found = instance(where, value, Mapping, "a mapping of names to values")
    if key is not None:
        _list(key, f"The keys of {where}", list(found))
    if check is None:
        return found
    return {name: check(f"{where}[{name!r}]", one) for name, one in found.items()}


def finite(where: str, value: object) -> float:
    """Return a finite number as a float."""
    number = real(where, value)
    if not math.isfinite(number):
        raise InvalidValue(f"{where} is {shown(value)}; it must be finite.")
    return number


def wholes(where: str, value: object) -> tuple[int, ...]:
    """Return whole numbers as a tuple."""
    listed = isinstance(value, Collection) and not isinstance(value, (str, bytes, Mapping, set))
    if not listed or len(getattr(value, "shape", (0,))) != 1:
        raise InvalidValue(f"{where} is {shown(value)}; it must be a list of whole numbers.")
    return tuple(whole(f"{where}[{i}]", one, LOWEST) for i, one in enumerate(value))  # type: ignore[arg-type, var-annotated]


def _callable(where: str, value: object) -> object:
    if not callable(value):
        raise InvalidValue(f"{where} is {shown(value)}; it must be a function.")
    return value


_PLAIN: dict[str, Check | None] = {
    "float": finite, "int": lambda where, value: whole(where, value, LOWEST), "bool": flag,
    "str": lambda where, value: instance(where, value, str, "a text"), "Any": None, "object": None,
}  # fmt: skip
_LISTED: dict[str, Check] = {"int": wholes, "str": texts}
