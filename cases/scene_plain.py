"""A scene as plain values and back: what a file in JSON can hold."""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Mapping
from typing import Any

from crossbody.cases.errors import SceneError
from crossbody.cases.scene import RowLaw, Scene


def plain(scene: Scene) -> dict[str, Any]:
    """Return a scene as dicts, lists, texts and numbers; what stands as by default is left out."""
    return {field.name: _plain(getattr(scene, field.name)) for field in dataclasses.fields(scene)}


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return {
            field.name: _plain(got)
            for field in dataclasses.fields(value)
            if (got := getattr(value, field.name)) != field.default
        }
    return [_plain(part) for part in value] if isinstance(value, tuple) else value


def scene_from(values: Any) -> Scene:
    """Return the scene that `plain` has written."""
    groups = _parts()
    try:
        parts = {name: tuple(map(kind, values.get(name, ()))) for name, kind in groups.items()}
        return Scene(gravity=values["gravity"], friction=bool(values.get("friction", False)), **parts)
    except (TypeError, KeyError, AttributeError) as error:
        raise SceneError(f"This is not a scene: {error}.") from None


def _parts() -> dict[str, Any]:
    """Return what makes one part of each group of a scene from plain values."""
    hints = typing.get_type_hints(Scene)
    return {
        field.name: _maker(typing.get_args(hints[field.name])[0])
        for field in dataclasses.fields(Scene)
        if field.name not in ("gravity", "friction")
    }


def _maker(kind: type) -> Any:
    hints = typing.get_type_hints(kind)

    def made(values: Mapping[str, Any]) -> Any:
        return kind(**{name: _value(hints.get(name), value) for name, value in values.items()})

    return made


def _value(hint: Any, value: Any) -> Any:
    if hint is RowLaw and isinstance(value, dict):
        return RowLaw(**value)
    return _tuple(value) if isinstance(hint, types.GenericAlias) else value


def _tuple(value: Any) -> Any:
    return tuple(map(_tuple, value)) if isinstance(value, list) else value
