"""Finding a case's module, or a file of a user's own, and building the case from it."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from crossbody import cases
from crossbody.cases import _registry
from crossbody.cases._arguments import path
from crossbody.cases._case import Case, Parameter, Value
from crossbody.cases._errors import CrossbodyError, SceneError, UnknownName
from crossbody.cases.files.case import open_file
from crossbody.cases.files.reading import SUFFIXES as ROBOT_FILES


def module(name: str) -> Any:
    """What defines a case: a plug-in or an installed one by its name, a user's own or a robot's file by its path."""
    if name.endswith(ROBOT_FILES):
        return open_file(name)
    found = from_file("case", Path(name)) if name.endswith(".py") else _named(name)
    for wanted in ("PARAMETERS", "VARIANTS", "build"):
        if not hasattr(found, wanted):
            raise SceneError(f"Case file {found.__file__} does not define {wanted}.")
    return found


def _named(name: str) -> ModuleType:
    return _registry.load_plugin("case", cases.__name__, list(cases.__path__), name, cases._VOCABULARY)


def from_file(kind: str, path: Path) -> ModuleType:
    """Import a file of a user's own.

    Args:
        kind: what it holds, "case" or "mechanism".
        path: of the file.

    Raises:
        UnknownName: if it is not there.
        SceneError: if it cannot be imported, with the line.
    """
    spec = importlib.util.spec_from_file_location(f"crossbody_{kind}_{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise UnknownName(f"{kind} file", str(path), cases.names() if kind == "case" else ())
    loaded = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = loaded  # dataclasses look their module up there
    try:
        spec.loader.exec_module(loaded)
    except (CrossbodyError, KeyboardInterrupt):
        del sys.modules[spec.name]
        raise
    except (Exception, SystemExit) as error:
        del sys.modules[spec.name]
        raise SceneError(_failed(kind, path, error)) from error
    return loaded


def _failed(kind: str, path: Path, error: BaseException) -> str:
    """Why a file of a user's own cannot be imported, and the last of its lines that was reached."""
    if isinstance(error, SyntaxError):
        file, line, why = error.filename or str(path), error.lineno, error.msg
    else:
        own = [frame for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == path.absolute()]
        file, line, why = str(path), own[-1].lineno if own else None, str(error)
    where = file if line is None else f"{file}, line {line}"
    what = type(error).__name__
    return f"The {kind} file {path} cannot be imported: {what}{f' ({why[:300]})' if why else ''} in {where}."


def resolve(
    where: str, parameters: Mapping[str, Parameter], preset: Mapping[str, Value], overrides: Mapping[str, Value]
) -> dict[str, Value]:
    """Every parameter's value: default, then the variant's, then the user's."""
    for name in overrides:
        if name not in parameters:
            raise UnknownName(f"parameter of {where}", name, parameters)
    given = {**preset, **overrides}
    return {k: p.checked(f"{where}: {k}", given.get(k, p.default)) for k, p in parameters.items()}


def build(name: str, variant: str | None, overrides: Mapping[str, Value]) -> Case:
    """See `crossbody.cases.load`."""
    name = path("case", name)
    source = module(name)
    chosen = next(iter(source.VARIANTS)) if variant is None else variant
    if not isinstance(chosen, str) or chosen not in source.VARIANTS:
        raise UnknownName(f"variant of {Path(name).stem}", chosen, source.VARIANTS)
    label = f"{Path(name).stem}:{chosen}"
    numbers = resolve(label, source.PARAMETERS, source.VARIANTS[chosen], overrides)
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            case: Case = source.build(chosen, numbers)
    except CrossbodyError:
        raise
    except (ArithmeticError, ValueError) as error:  # a root of what is below 0, a number beyond double precision
        raise SceneError(f"{label}: no scene has these parameters ({error}).") from error
    return case
