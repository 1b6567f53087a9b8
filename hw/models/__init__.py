"""What a log can be replayed on: one module a model, found by its name, imported only when asked for.

A model is a module here with one public name, `MODEL`, a `Model`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from crossbody.cases import arguments
from crossbody.cases.entry_points import checked_arguments
from crossbody.cases.registry import Registry

if TYPE_CHECKING:
    from crossbody.hw.models.contract import Model as Model

__all__ = ["chosen", "load", "names", "summary"]


_REGISTRY = Registry("model", __name__, hidden=("contract",))
names = _REGISTRY.names


@checked_arguments
def summary(name: str) -> str:
    """What a model is, in one line; imports nothing."""
    return _REGISTRY.summary(name)


def load(name: str) -> Model:
    """Import a model.

    Raises:
        UnknownName: if there is no such model; the message lists the names.
    """
    model: Model = _REGISTRY.load(name).MODEL
    return model


def chosen(model: str | Model) -> Model:
    """A model by its name, or itself."""
    from crossbody.hw.models.contract import Model

    return load(model) if isinstance(model, str) else arguments.instance("model", model, Model, "a model or its name")
