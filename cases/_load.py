"""Finding a case's module and building the case from it."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType

from crossbody import cases
from crossbody.cases import _registry
from crossbody.cases._case import Case, Parameter, Value
from crossbody.cases._errors import SceneError, UnknownName


def module(name: str) -> ModuleType:
    """The module of a case: a plug-in's by its name, or a user's own by the path of its file."""
    found = _from_file(Path(name)) if name.endswith(".py") else _plugin(name)
    for wanted in ("PARAMETERS", "VARIANTS", "build"):
        if not hasattr(found, wanted):
            raise SceneError(f"Case file {found.__file__} does not define {wanted}.")
    return found


def _plugin(name: str) -> ModuleType:
    return _registry.load_plugin("case", cases.__name__, list(cases.__path__), name)


def _from_file(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"crossbody_case_{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise UnknownName("case file", str(path), cases.names())
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


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
    source = module(name)
    chosen = next(iter(source.VARIANTS)) if variant is None else variant
    if chosen not in source.VARIANTS:
        raise UnknownName(f"variant of {Path(name).stem}", chosen, source.VARIANTS)
    label = f"{Path(name).stem}:{chosen}"
    case: Case = source.build(chosen, resolve(label, source.PARAMETERS, source.VARIANTS[chosen], overrides))
    return case
