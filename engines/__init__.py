"""How a case is run: one module or folder an engine, found by its name, imported only when asked for.

An engine is a module here with one public name, `ENGINE`, an `Engine`.
"""

from __future__ import annotations

from collections.abc import Mapping

from crossbody.cases import EngineUnavailable
from crossbody.cases.entry_points import checked_arguments
from crossbody.cases.public_names import TEXT, Public, check_values, maps_to_texts
from crossbody.cases.registry import Registry
from crossbody.engines.contract import QUANTITIES, Engine, Run

__all__ = ["QUANTITIES", "Engine", "Run", "load", "names", "summary"]


REGISTRY = Registry("engine", __name__, hidden=("contract", "equations", "importers", "linear", "nearest", "settings"))


def names() -> tuple[str, ...]:
    """Names of all engines, installed or not; imports none of them."""
    return REGISTRY.names()


@checked_arguments
def summary(name: str) -> str:
    """What an engine is, in one line; imports nothing."""
    return REGISTRY.summary(name)


def load(name: str) -> Engine:
    """Import an engine.

    Raises:
        UnknownName: if there is no such engine; the message lists the names.
        SceneError: if its module does not define one, or one that is incomplete.
        EngineUnavailable: if its third-party package is not installed. A broken import of our own stays loud.
    """
    try:
        module = REGISTRY.load(name)
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package in ("", "crossbody"):
            raise
        known = name in REGISTRY.own()
        brings = f"crossbody[{name}]" if known else package
        raise EngineUnavailable(
            f"Engine {name!r} needs the package {package!r}, which is not installed; install it with: pip "
            f"install {brings!r}"
        ) from None
    engine: Engine = module.ENGINE
    check_values(f"The engine file {module.__file__}", engine, _ATTRIBUTES, "ENGINE.")
    return engine


_ATTRIBUTES = {
    "name": TEXT,
    "profiles": Public(
        "a mapping from profiles to a sentence each", lambda value: maps_to_texts(value) and bool(value)
    ),
    "versions": Public("a mapping from packages to their versions", maps_to_texts),
    "hidden": Public(
        'a mapping from profiles ("*" for all) to mappings from quantities to reasons',
        lambda value: isinstance(value, Mapping) and all(map(maps_to_texts, value.values())),
    ),
}
