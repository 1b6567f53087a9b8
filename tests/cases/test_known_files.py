"""All that a file may say of a part of a scene is asked for by every run of a file, and what is lost is seen."""

from __future__ import annotations

import dataclasses
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import scene as parts
from crossbody.cases.files import mjcf
from crossbody.reports.judging import known_files, known_margins
from crossbody.reports.judging.audit import audit

pytest.importorskip("mujoco")
GROUPS = {
    "joints": "_joint", "bodies": "_body", "shapes": "_shape", "tendons": "_tendon", "loops": "_loop",
    "actuators": "_actuator",
}  # fmt: skip
OTHERS = {"name", "corners", "body", "parent", "type", "activation"}
"""Names, words, and the corners of hulls, which are those of a mesh beside the file."""


def lost(own: Any, field: str) -> Any:
    """A reader of a part that leaves a field as it is by itself."""

    def read(*given: Any) -> Any:
        part = own(*given)
        usual = next(one.default for one in dataclasses.fields(part) if one.name == field)
        return part if usual is dataclasses.MISSING else replace(part, **{field: usual})

    return read


FIELDS = [
    (group, field.name)
    for group, kind in (("joints", parts.Joint), ("bodies", parts.Body), ("shapes", parts.Shape),
                        ("tendons", parts.Tendon), ("loops", parts.Loop), ("actuators", parts.Actuator))
    for field in dataclasses.fields(kind) if field.name not in OTHERS and field.default is not dataclasses.MISSING
]  # fmt: skip


@pytest.mark.parametrize(("group", "field"), FIELDS)
def test_a_field_that_is_lost_is_seen(group: str, field: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mjcf, GROUPS[group], lost(getattr(mjcf, GROUPS[group]), field))
    for module in (known_files, known_margins):
        module.wrong.cache_clear()
    try:
        assert known_files.wrong() or known_margins.wrong()
    finally:
        monkeypatch.undo()
        for module in (known_files, known_margins):
            module.wrong.cache_clear()


@pytest.mark.parametrize("text", [known_files.MJCF, known_margins.MJCF])
def test_a_bound_that_is_never_reached_is_compared_all_the_same(text: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(text)
    case = cases.from_file(path, friction=1)
    shown = engines.load("mujoco").prepare(case, "as_is").audit()
    assert case.scene is not None
    for group in ("joints", "tendons"):
        for k, part in enumerate(getattr(case.scene, group)):
            if not np.isfinite(part.range).any():
                continue
            low, high = part.range
            for changes in ({"margin": part.margin + 1e-3}, {"range": (low, high + 1e-3)}, {"range": parts.UNBOUNDED}):
                other = list(getattr(case.scene, group))
                other[k] = replace(part, **changes)
                scene = case.scene.replace(**{group: tuple(other)})
                found = {one.quantity: one.ok for one in audit(shown, {}, replace(case, scene=scene))}
                assert not found["bounds"], (part.name, changes)
    assert all(row.ok for row in audit(shown, {}, case))
