"""What a file and its user ask for is what is run: keyframes, tables of controls, and pushes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import Case
from crossbody.reports.judging.start_of_file import start_of_file

BOX = Path(__file__).parents[1] / "support" / "driven_box.xml"
START = ("q of the file", "v of the file", "activations of the file", "controls of the file")
PUSH = "box 1 0 2 .01 .03; arm 0 0 1 .02 inf; box 1 1 1 7 8"


def wrong(case: Case) -> list[str]:
    return [row.quantity for row in start_of_file(case) if not row.ok]


@pytest.mark.parametrize("variant", ["one", "two"])
@pytest.mark.parametrize("push", ["", PUSH])
def test_a_start_is_that_of_its_keyframe(variant: str, push: str) -> None:
    case = cases.load(str(BOX), variant, t_end=0.1, push=push)
    assert wrong(case) == []
    assert [row.quantity for row in start_of_file(case)][:4] == list(START)


@pytest.mark.parametrize(
    ("quantity", "name"), [("q of the file", "q0"), ("v of the file", "v0"), ("activations of the file", "act0")]
)
def test_a_start_of_another_keyframe_is_told(quantity: str, name: str) -> None:
    case, other = (cases.load(str(BOX), variant) for variant in ("two", "one"))
    assert wrong(replace(case, **{name: getattr(other, name)})) == [quantity]


def test_controls_of_another_keyframe_are_told() -> None:
    case, other = (cases.load(str(BOX), variant) for variant in ("two", "one"))
    assert wrong(replace(case, inputs=other.inputs)) == ["controls of the file"]


@pytest.mark.parametrize("variant", ["one", "two"])
def test_a_start_is_what_was_asked_for_in_place_of_the_keyframe(variant: str) -> None:
    plain = cases.load(str(BOX), variant)
    case = cases.load(str(BOX), variant, start="z .25; turn -1.5", rate="turn 3")
    assert case.q0.tolist() == [plain.q0[0], 0.25, -1.5]
    assert case.v0.tolist() == [*plain.v0[:2], 3.0]
    assert wrong(case) == []
    assert [row.quantity for row in start_of_file(case)][4:] == ["start as asked", "rate as asked"]
    assert wrong(replace(case, q0=plain.q0)) == ["q of the file", "start as asked"]
    assert wrong(replace(case, v0=case.v0[::-1].copy())) == ["v of the file", "rate as asked"]


@pytest.mark.parametrize("seed", range(4))
def test_constants_of_the_law_are_those_that_were_asked_for(seed: int) -> None:
    draw = np.random.default_rng(seed)
    asked = {name: float(10.0 ** draw.uniform(-1.0, 4.0)) for name in ("a0", "a1") if draw.random() < 0.6} or {
        "a1": 0.0
    }
    case, plain = cases.load(str(BOX), "two", friction=1, **asked), cases.load(str(BOX), "two", friction=1)
    assert wrong(case) == []
    for name in ("a0", "a1"):
        other = replace(case, law=replace(case.law, **{name: getattr(plain.law, name)}))
        assert wrong(other) == [f"{name} as asked"] * (name in asked)


def changed(case: Case, times: Any = None, values: Any = None) -> Case:
    assert case.inputs is not None
    inputs = replace(
        case.inputs, times=case.inputs.times if times is None else times,
        values=case.inputs.values if values is None else values,
    )  # fmt: skip
    return replace(case, inputs=inputs)


def test_a_push_that_does_not_end_or_acts_on_another_body_is_told() -> None:
    case = cases.load(str(BOX), "two", t_end=0.1, push=PUSH)
    assert case.inputs is not None
    assert case.scene is not None
    held = np.maximum.accumulate(case.inputs.values)
    assert wrong(changed(case, values=held)) == ["impulse of pushes"]
    assert "force of pushes" in wrong(changed(case, values=np.roll(case.inputs.values, 3, axis=1)))
    pushes = tuple(reversed(case.scene.pushes[:2])) + case.scene.pushes[2:]
    assert wrong(replace(case, scene=case.scene.replace(pushes=pushes))) == ["force of pushes"]


def test_a_table_that_comes_a_row_late_is_told(tmp_path: Path) -> None:
    path = tmp_path / "controls.csv"
    path.write_text("integrator,t,filter,bounded,weak\n0,0,1,0,0\n.2,.01,.5,0,1\n.3,.02,.4,1,0\n")
    case = cases.load(str(BOX), "two", ctrl=str(path))
    assert case.inputs is not None
    assert wrong(case) == []
    assert wrong(changed(case, values=np.roll(case.inputs.values, 1, axis=0))) == ["controls of the table"]
    assert wrong(changed(case, times=case.inputs.times + 0.007)) == ["controls of the table"]


def test_a_case_of_no_file_and_one_that_is_assembled_have_no_start_to_be_read_again() -> None:
    assert start_of_file(cases.load("bouncing_ball", "linear")) == ()
    rows = start_of_file(cases.load(str(BOX), "two", assemble=1))
    assert [row.quantity for row in rows] == [*START[2:]]
