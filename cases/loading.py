"""Finding a case's module and building the case from it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from crossbody import cases
from crossbody.cases.arguments import path, shown
from crossbody.cases.case import Case, Parameter, Value
from crossbody.cases.errors import CrossbodyError, InvalidValue, SceneError, UnknownName
from crossbody.cases.files.case import UNNAMED, case_of, open_file
from crossbody.cases.files.reading import SUFFIXES as ROBOT_FILES
from crossbody.cases.installed import from_file
from crossbody.cases.public_names import check
from crossbody.cases.scene import Scene

OF_USERS = (".py", *ROBOT_FILES)  # how the paths of files with cases of users' own end


def parted(name: str) -> tuple[str, str | None]:
    """Return what CASE, FILE, CASE:VARIANT or FILE:KEY names, and the variant; None without one."""
    case, colon, variant = name.rpartition(":")
    return (case, variant) if colon and not name.endswith(OF_USERS) else (name, None)


def chosen(name: str, variant: str | None = None) -> tuple[str, str | None]:
    """Return a case's name and the variant that is asked for, by the name or beside it."""
    case, own = parted(name)
    if own is not None and variant not in (None, own):
        raise InvalidValue(f"The case is {name!r}, and the variant {shown(variant)}; give one of them.")
    return case, variant if own is None else own


def module(name: str) -> Any:
    """What defines a case: a plug-in or an installed one by its name, a user's own or a robot's file by its path."""
    if name.endswith(ROBOT_FILES):
        return open_file(name)
    if not name.endswith(".py"):
        if name not in cases.names() and (os.path.exists(name) or os.path.splitext(name)[1]):
            endings = ", ".join(OF_USERS)
            raise InvalidValue(f"The case {shown(name)} is not a case file; its path must end in {endings}.")
        return cases.REGISTRY.load(name)
    found = from_file("case", Path(name), cases.names())
    check(found, "crossbody.cases")
    return found


def resolve(
    where: str, parameters: Mapping[str, Parameter], preset: Mapping[str, Value], overrides: Mapping[str, Value]
) -> dict[str, Value]:
    """Every parameter's value: default, then the variant's, then the user's."""
    for name in (*preset, *overrides):
        if name not in parameters:
            raise UnknownName(f"parameter of {where}", name, parameters)
    given = {**preset, **overrides}
    return {k: p.checked(f"{where}: {k}", given.get(k, p.default)) for k, p in parameters.items()}


def build(name: str, variant: str | None, overrides: Mapping[str, Value]) -> Case:
    """See `crossbody.cases.load`."""
    name, variant = chosen(path("case", name), variant)
    source = module(name)
    variant = next(iter(source.VARIANTS)) if variant is None else variant
    if not isinstance(variant, str) or variant not in source.VARIANTS:
        raise UnknownName(f"variant of {_called(name)}", variant, source.VARIANTS)
    label = f"{_called(name)}:{variant}"
    numbers = resolve(label, source.PARAMETERS, source.VARIANTS[variant], overrides)
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            made = source.build(variant, numbers)
            return named(made, label, numbers)
    except CrossbodyError:
        raise
    except (ArithmeticError, ValueError) as error:  # a root of what is below 0, a number beyond double precision
        raise SceneError(f"{label}: no scene has these parameters ({error}).") from error


def _called(name: str) -> str:
    """What a case is called: a robot's file with its ending, as its rows are labelled."""
    return Path(name).name if name.endswith(ROBOT_FILES) else Path(name).stem


def named(made: object, label: str, numbers: Mapping[str, Value]) -> Case:
    """Return what a file's `build` has made as a case: a scene starts at rest in its reference pose.

    The label CASE:VARIANT names a case that has no name; t_end of the numbers is a scene's horizon,
    s.
    """
    if isinstance(made, Scene):
        made = case_of(made, t_end=float(numbers.get("t_end", 1.0)))
    if not isinstance(made, Case):
        raise SceneError(f"{label}: build returns {shown(made)}; valid: a Case or a Scene.")
    if made.scene is not None and made.name == UNNAMED:
        name, _, variant = label.partition(":")
        return replace(made, name=name, variant=variant, parameters=numbers)
    return made
