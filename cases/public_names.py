"""What makes a module a plug-in: the public names of each kind, and what is valid for each of them."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple

from crossbody.cases.errors import SceneError, shown


class Public(NamedTuple):
    """What a public name may be, in words, and whether a value is that."""

    valid: str
    admits: Callable[[Any], bool]


class Kind(NamedTuple):
    """What plug-ins of one group are called, and their public names."""

    name: str
    defines: Mapping[str, Public]


def function(*arguments: str) -> Public:
    """Return what a function of these arguments, given in their order, is."""
    return Public(f"a function of ({', '.join(arguments)})", lambda value: _takes(value, arguments))


def _takes(value: Any, arguments: tuple[str, ...]) -> bool:
    try:
        inspect.signature(value).bind(*arguments)
    except TypeError:
        return False
    except ValueError:  # compiled code need not say what it takes
        return callable(value)
    return True


def _instance(place: str) -> Public:
    """An instance of a class, which is imported when a value is looked at."""
    module, _, name = place.rpartition(".")
    return Public(f"a {place}", lambda value: isinstance(value, getattr(import_module(module), name)))


def _texts(value: Any) -> bool:
    return isinstance(value, tuple) and bool(value) and all(isinstance(one, str) and one for one in value)


def maps_to_texts(value: Any) -> bool:
    """Return whether a value is a mapping whose names and values are texts."""
    return isinstance(value, Mapping) and all(isinstance(one, str) for pair in value.items() for one in pair)


def _parameters(value: Any) -> bool:
    from crossbody.cases.case import Parameter

    return isinstance(value, Mapping) and all(
        isinstance(name, str) and isinstance(one, Parameter) for name, one in value.items()
    )


def _variants(value: Any) -> bool:
    named = isinstance(value, Mapping) and all(isinstance(name, str) and name for name in value)
    return named and bool(value) and all(isinstance(changed, Mapping) for changed in value.values())


def _options(value: Any) -> bool:
    import msgspec

    if not (isinstance(value, type) and issubclass(value, msgspec.Struct)):
        return False
    return all(field.required is False for field in msgspec.structs.fields(value))


TEXT = Public("a text", lambda value: isinstance(value, str) and bool(value))
KINDS = {
    "crossbody.cases": Kind("case", {
        "PARAMETERS": Public("a mapping from names to crossbody.cases.Parameter", _parameters),
        "VARIANTS": Public("a mapping from one variant or more to the parameters that each changes", _variants),
        "build": function("variant", "parameters"),
    }),
    "crossbody.engines": Kind("engine", {"ENGINE": _instance("crossbody.engines.Engine")}),
    "crossbody.engines.importers": Kind("importer", {
        "FORMATS": Public("a tuple of 'mjcf', 'urdf'", lambda value: _texts(value) and {*value} <= {"mjcf", "urdf"}),
        "PACKAGE": TEXT, "MODULE": TEXT, "open_robot": function("path", "urdf"),
    }),
    "crossbody.hw.formats": Kind("log format", {
        "SUFFIXES": Public("a tuple of texts, for example ('.npz',)", _texts),
        "Options": Public("a msgspec.Struct whose fields have defaults", _options),
        "recognises": function("path", "head"), "open_log": function("path", "options"),
    }),
    "crossbody.hw.models": Kind("model", {"MODEL": _instance("crossbody.hw.models.contract.Model")}),
    "crossbody.reports.metrics": Kind("metric", {
        "UNIT": Public("a text, '1' for a ratio or a count", TEXT.admits),
        "CLAIMED": Public("True or False", lambda value: isinstance(value, bool)),
        "measure": function("truth", "run", "case"),
    }),
    "crossbody.reports.scenes": Kind("picture", {
        "stage": function("p"), "poses": function("q", "p"), "arrows": function("q", "lam", "p"),
    }),
    "crossbody.reports.sections": Kind("study", {"TITLE": TEXT, "sections": function("out")}),
    "crossbody.reports.suites": Kind("suite", {"SUITE": _instance("crossbody.reports.suites.contract.Suite")}),
}  # fmt: skip
"""Group of entry points -> the kind of its plug-ins."""


def groups_of(module: ModuleType) -> list[str]:
    """Return the groups all of whose public names a module has."""
    return [group for group, kind in KINDS.items() if not lacking(module, kind)]


def lacking(module: ModuleType, kind: Kind) -> list[str]:
    """Return the public names of a kind that a module does not have."""
    return [name for name in kind.defines if not hasattr(module, name)]


def what_is_missing(module: ModuleType) -> str:
    """Return what a module that is no plug-in lacks: of the kind that it is most of, else of every kind."""
    kind = min(KINDS.values(), key=lambda kind: len(lacking(module, kind)) / len(kind.defines))
    absent = {name: kind.defines[name].valid for name in lacking(module, kind)}
    if 2 * len(absent) <= len(kind.defines):
        told = "; ".join(f"{name} ({valid})" for name, valid in absent.items())
        return f"is not yet a plug-in: a {kind.name} also defines {told}."
    wanted = "; ".join(f"{kind.name}: {', '.join(kind.defines)}" for kind in KINDS.values())
    return f"defines none. Public names of a plug-in, by its kind: {wanted}."


def check(module: ModuleType, group: str) -> None:
    """Refuse a plug-in that cannot be one of its kind."""
    kind = KINDS[group]
    check_values(f"The {kind.name} file {module.__file__}", module, kind.defines)


def check_values(where: str, owner: object, wanted: Mapping[str, Public], prefix: str = "") -> None:
    """Refuse what has not all the attributes that are wanted, or a wrong one."""
    for name, public in wanted.items():
        if not hasattr(owner, name):
            raise SceneError(f"{where} does not define {prefix}{name}; valid: {public.valid}.")
        if not public.admits(value := getattr(owner, name)):
            raise SceneError(f"{where}: {prefix}{name} is {_named(value)}; valid: {public.valid}.")


def _named(value: object) -> str:
    return f"a function of {inspect.signature(value)}" if inspect.isfunction(value) else shown(value)
