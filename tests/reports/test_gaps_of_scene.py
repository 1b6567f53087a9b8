"""Gaps and slips of pairs are held against nearest points of their own, whatever else contradicts none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from friction_scenes import pair
from scipy.spatial.transform import Rotation

from crossbody import cases
from crossbody.cases import Case
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Scene, Shape
from crossbody.cases.scene_contacts import PLACES
from crossbody.engines import equations
from crossbody.reports.judging import gaps_of_scene as judge

SUPPORT = Path(__file__).parents[1] / "support"
NAMES = ("one", "two")


def drawn(types: tuple[str, str], seed: int) -> Case:
    """Return two shapes on two free bodies, with friction."""
    rng = np.random.default_rng(seed)
    corners = tuple(map(tuple, Rotation.random(6, rng=rng).apply([0.3, 0.0, 0.0]).tolist()))
    shapes = tuple(
        Shape(name=name, body=name, type=kind, size=tuple(rng.uniform(0.2, 0.5, 3)),
              corners=corners if kind == "hull" else (), position=tuple(0.1 * rng.normal(size=3)))
        for name, kind in zip(NAMES, types, strict=True)
    )  # fmt: skip
    scene = Scene(
        bodies=tuple(Body(name=name, mass=1.0, inertia=(0.1, 0.2, 0.25, 0.0, 0.0, 0.0)) for name in NAMES),
        joints=tuple(Joint(name=f"free {name}", body=name, type="free") for name in NAMES),
        shapes=shapes, pairs=(pair(*NAMES, 0.5),), friction=True,
    )  # fmt: skip
    start = np.concatenate([[0.0, 0.0, 0.0], Rotation.random(rng=rng).as_quat(), [0.9, 0.5, 0.6]])
    start = np.concatenate([start, Rotation.random(rng=rng).as_quat()])
    return replace(case_of(scene, name="drawn", t_end=0.5), q0=start)


@pytest.mark.parametrize("types", PLACES)
def test_gaps_and_slips_of_any_pair_are_those_of_its_shapes(types: tuple[str, str]) -> None:
    for seed in range(4):
        rows = judge.gaps_of_scene(drawn(types, seed))
        assert [row.quantity for row in rows] == ["gaps of pairs", "slips of pairs"]
        assert all(row.ok and row.mine != "none" for row in rows), rows


OFF: dict[str, tuple[dict[str, Any], str]] = {
    "a radius": ({"size": (0.3001, 0.31, 0.32)}, "gaps of pairs"),
    "a place": ({"position": (0.0, 0.0, 0.001)}, "slips of pairs"),
}


@pytest.mark.parametrize("what", OFF)
@pytest.mark.parametrize("types", [("sphere", "box"), ("capsule", "capsule"), ("plane", "ellipsoid")])
def test_equations_of_other_shapes_are_told(types: tuple[str, str], what: str) -> None:
    case, (changes, quantity) = drawn(types, 1), OFF[what]
    assert case.scene is not None
    shapes = (case.scene.shapes[0], replace(case.scene.shapes[1], **changes))
    other = equations.system_of(replace(case, scene=case.scene.replace(shapes=shapes)))
    assert quantity in [row.quantity for row in judge.gaps_against(case, other) if not row.ok]


@pytest.mark.parametrize("name", ["crossed_beams.xml", "sliding_egg.xml"])
def test_slips_to_another_side_are_told(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    case = cases.from_file(SUPPORT / name, friction=1)
    assert all(row.ok for row in judge.gaps_of_scene(case))
    exact = judge._equations
    monkeypatch.setattr(
        judge, "_equations", lambda *given: (exact(*given)[0], 1.001 * exact(*given)[1], exact(*given)[2])
    )
    system = equations.system_of(case)
    assert [row.quantity for row in judge.gaps_against(case, system) if not row.ok] == ["slips of pairs"]


def test_scenes_without_pairs_have_no_rows() -> None:
    assert judge.gaps_of_scene(cases.load("bouncing_ball", "linear")) == ()
