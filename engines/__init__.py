"""How a case is run: one module or folder an engine, found by its name, imported only when asked for.

An engine is a module here with one public name, `ENGINE`, an `Engine`.
"""

from __future__ import annotations

from crossbody.cases import EngineUnavailable, SceneError
from crossbody.cases.entry_points import checked_arguments
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
        SceneError: if its module does not define one.
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
            f"Engine {name!r} needs the package {package!r}, which is not installed: pip install {brings!r} brings it."
        ) from None
    engine = getattr(module, "ENGINE", None)
    if not isinstance(engine, Engine):
        raise SceneError(f"Engine file {module.__file__} does not define ENGINE, a crossbody.engines.Engine.")
    return engine
