"""A scene that is written as MuJoCo's model and read again is the same scene, part by part."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest
from random_scenes import random_scene, with_own_laws

from crossbody.cases.files.case import overruled
from crossbody.cases.files.mjcf import scene_of
from crossbody.cases.scene import Scene
from crossbody.engines.mujoco._build import compiled, spec_of


def differences(mine: Any, theirs: Any, path: str = "scene") -> list[str]:
    """Where two trees of dataclasses, tuples and values are not the same to rounding."""
    if is_dataclass(theirs):
        pairs = [(field.name, getattr(mine, field.name), getattr(theirs, field.name)) for field in fields(theirs)]
        return [found for name, a, b in pairs for found in differences(a, b, f"{path}.{name}")]
    if isinstance(theirs, str | int) or theirs is None:
        return [] if mine == theirs else [f"{path}: {mine!r} and not {theirs!r}"]
    if isinstance(theirs, float):
        return [] if np.isclose(mine, theirs, rtol=1e-9, atol=1e-12) else [f"{path}: {mine!r} and not {theirs!r}"]
    if len(mine) != len(theirs):
        return [f"{path}: {len(mine)} and not {len(theirs)}"]
    pairs = enumerate(zip(mine, theirs, strict=True))
    return [found for i, (a, b) in pairs for found in differences(a, b, f"{path}[{i}]")]


USED = {"plane": 0, "sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3, "hull": 0}
"""Sizes that a shape has."""


def told(scene: Scene) -> Scene:
    """Return what of a scene a file can say, pairs and corners sorted.

    Pushes, shapes that meet nothing and unused numbers are left out, and whether friction has rows: a file is asked.
    """
    met = {name for pair in scene.pairs for name in (pair.first, pair.second)}
    sizes = {s.name: (*s.size[: USED[s.type]], *(0.0,) * (3 - USED[s.type])) for s in scene.shapes if s.name in met}
    gears = {a.name: (*a.gear, *(0.0,) * (6 - len(a.gear))) for a in scene.actuators}
    unused = {
        "free": {"axis": (0.0, 0.0, 1.0), "rest": (1.0, 0.0, 0.0, 0.0)}, "ball": {"axis": (0.0, 0.0, 1.0)},
    }  # fmt: skip
    return scene.replace(
        joints=tuple(replace(joint, **unused.get(joint.type, {})) for joint in scene.joints),
        shapes=tuple(
            replace(s, size=sizes[s.name], corners=tuple(sorted(s.corners))) for s in scene.shapes if s.name in sizes
        ),
        actuators=tuple(replace(a, gear=gears[a.name]) for a in scene.actuators),
        pairs=tuple(sorted((replace(pair, friction=(0.0,) * 5) for pair in scene.pairs), key=lambda pair: pair.name)),
        pushes=(),
        friction=False,
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(10))
def test_a_scene_is_read_as_it_was_written(seed: int) -> None:
    scene = random_scene(seed)
    assert differences(told(scene_of(compiled(spec_of(scene), scene))), told(scene)) == []


@pytest.mark.parametrize(("a0", "a1"), [(1e3, -1.0), (-1.0, 7.0), (1e3, 7.0), (0.0, 0.0), (-1.0, -1.0)])
def test_constants_that_are_given_for_all_rows_change_nothing_else(a0: float, a1: float) -> None:
    """Each by itself: one that is below 0 stays every row's own."""
    own = with_own_laws(random_scene(3), 3)
    found = overruled(own, a0, a1)
    given = {name: value for name, value in (("a0", a0), ("a1", a1)) if value >= 0.0}
    for group in ("joints", "pairs", "loops", "tendons"):
        for one, other in zip(getattr(own, group), getattr(found, group), strict=True):
            assert other == replace(one, law=replace(one.law, **given))
