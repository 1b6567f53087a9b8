"""A scene that is written as MuJoCo's model and read again is the same scene, part by part."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest
from random_scenes import SINGLE, random_scene

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
    return [
        found for i, (a, b) in enumerate(zip(mine, theirs, strict=True)) for found in differences(a, b, f"{path}[{i}]")
    ]


USED = {"plane": 0, "sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}
"""Sizes that a shape has."""


def told(scene: Scene) -> Scene:
    """Return what of a scene a file can say: pushes, shapes that meet nothing and unused numbers left out."""
    met = {name for pair in scene.pairs for name in (pair.first, pair.second)}
    turning = {"axis": (0.0, 0.0, 1.0)}
    joints = [
        joint
        if joint.type in SINGLE
        else replace(joint, **turning, **({} if joint.type == "ball" else {"rest": (1.0, 0.0, 0.0, 0.0)}))
        for joint in scene.joints
    ]
    shapes = [
        replace(s, size=(*s.size[: USED[s.type]], *(0.0,) * (3 - USED[s.type]))) for s in scene.shapes if s.name in met
    ]
    gears = [(*actuator.gear, *(0.0,) * (6 - len(actuator.gear))) for actuator in scene.actuators]
    return scene.replace(
        joints=tuple(joints), shapes=tuple(shapes), pushes=(),
        actuators=tuple(replace(a, gear=gear) for a, gear in zip(scene.actuators, gears, strict=True)),
        pairs=tuple(replace(pair, friction=(0.0,) * 5) for pair in scene.pairs),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(30))
def test_a_scene_is_read_as_it_was_written(seed: int) -> None:
    scene = random_scene(seed)
    assert differences(told(scene_of(compiled(spec_of(scene), scene))), told(scene)) == []
