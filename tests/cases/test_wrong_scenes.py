"""What a part of a scene, and a scene, refuse: what is wrong, where, and what would be valid."""

from __future__ import annotations

import dataclasses
import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from crossbody.cases import SceneError
from crossbody.cases.scene import Actuator, Body, Joint, Loop, Pair, Push, RowLaw, Scene, Shape, Tendon

PARTS: dict[type, dict[str, Any]] = {
    Body: {"name": "a"},
    Joint: {"name": "a", "body": "b", "type": "hinge"},
    Shape: {"name": "a"},
    Pair: {"name": "a", "first": "b", "second": "c"},
    Loop: {"name": "a", "type": "connect", "first": "b"},
    Tendon: {"name": "a", "joints": ("b",), "coefficients": (1.0,)},
    Actuator: {"name": "a", "joint": "b"},
}
NUMBERS = [
    (kind, field.name, value)
    for kind, given in PARTS.items()
    for field in dataclasses.fields(kind)
    for value in [getattr(kind(**given), field.name)]
    if isinstance(value, float) or (isinstance(value, tuple) and value and isinstance(value[0], float))
]


@pytest.mark.parametrize(("kind", "field", "value"), NUMBERS)
@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_every_number_of_a_part_is_finite_but_what_is_no_bound(
    kind: type, field: str, value: Any, wrong: float
) -> None:
    """Of a range the lower may be missing, which is -inf, and the upper, which is inf."""
    for place in range(len(value) if isinstance(value, tuple) else 1):
        changed = wrong if isinstance(value, float) else (*value[:place], wrong, *value[place + 1 :])
        if field.endswith("range") and wrong == (-math.inf, math.inf)[place]:
            kind(**PARTS[kind], **{field: changed})
        else:
            with pytest.raises(SceneError, match=rf"{kind.__name__} 'a': (friction|{field})"):
                kind(**{**PARTS[kind], field: changed})


EVERY: dict[type, dict[str, Any]] = {
    **PARTS,
    Push: {"name": "a", "body": "b"},
    RowLaw: {"a0": 1.0, "a1": 1.0},
    Scene: {},
}
STRANGE: dict[str, Any] = {
    "text": "3", "none": None, "nan": math.nan, "inf": math.inf, "switch": True, "list": [1.0], "lists": [[1.0]],
    "complex": 1j, "array": np.ones((2, 2)), "row": np.ones((3, 1)), "bytes": b"abc", "texts": ("1", "2", "3"),
    "switches": (True, True, True), "complexes": (1j, 1j, 1j), "huge": 10**400, "mapping": {0.0: 1, 1.0: 2, 2.0: 3},
    "object": object(), "kind": float, "alone": np.array(1.0),
}  # fmt: skip
MEANT = {  # what is no mistake: text where a text is meant, a list of numbers where any number of them is
    "str": {"text"}, "bool": {"switch"}, "Vector": {"list"}, "tuple[str, ...]": {"texts"},
}  # fmt: skip


@pytest.mark.parametrize("strange", STRANGE)
@pytest.mark.parametrize("kind", EVERY)
def test_every_field_of_a_part_refuses_what_it_is_not_declared_as(kind: type, strange: str) -> None:
    for field in dataclasses.fields(kind):
        if strange not in MEANT.get(str(field.type), set()):
            with pytest.raises(SceneError, match=rf"^{kind.__name__}.*\b{field.name}\b"):
                kind(**{**EVERY[kind], field.name: STRANGE[strange]})


@pytest.mark.parametrize("kind", EVERY)
def test_every_number_of_a_part_is_a_float_whatever_real_number_it_was_given_as(kind: type) -> None:
    """Another type would stand in fingerprints and sentences as what it is."""
    made = {"a0": 1.0, "a1": 1.0} if kind is RowLaw else EVERY[kind]
    for field in dataclasses.fields(kind):
        if field.type == "float" and field.name != "time_constant":
            for one in (1, np.float32(1.0), np.int64(1), Fraction(1)):
                assert type(getattr(kind(**{**made, field.name: one}), field.name)) is float


WRONG: list[tuple[type, dict[str, Any], str]] = [
    (Shape, {"size": (-1.0, 0.0, 0.0)}, r"Shape 'a': size is .*; valid: lengths of at least 0 m"),
    (Body, {"name": ""}, "Body.name is ''; it must be a text"),
    (Body, {"com": (0.0, 0.0)}, "com is .*; it must be 3 numbers"),
    (Body, {"mass": "1", "com": "abc"}, "com is 'abc'; it must be 3 numbers"),
    *[
        (kind, {"orientation": (size, 0.0, 0.0, 0.0)}, "a quaternion has a length above 0")
        for kind in (Body, Shape, Loop) for size in (0.0, 1e-200, 1e200)
    ],
    (Joint, {"type": "ball", "rest": (0.0,) * 4}, "rest .* a quaternion has a length above 0"),
    (Joint, {"type": "screw"}, "type is 'screw'; valid: "),
    (Joint, {"axis": (0.0, 0.0, 0.0)}, "axis is .* must not be zero"),
    (Joint, {"range": (1.0, -1.0)}, "range is .*; it must be the lowest and the highest"),
    (Joint, {"type": "free", "range": (0.0, 1.0)}, "a free joint has no bounds"),
    (Joint, {"type": "ball", "range": (0.5, 1.0)}, "a ball joint has 0 and its largest angle"),
    (Joint, {"friction_loss": -1.0}, "friction_loss is -1.0; it must be at least 0"),
    (Shape, {"type": "hull"}, "has 0 corners; only a hull"),
    (Shape, {"type": "hull", "corners": [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]}, "lie in one plane"),
    (Shape, {"type": "hull", "corners": [(0.0, 0.0, math.inf)]}, "corners: point 0 is .* must be finite"),
    (Pair, {"dimension": 2}, "dimension is 2; valid: "),
    (Pair, {"friction": (1e300, *[0.0] * 4)}, "friction is .* at most 1e.100"),
    (Pair, {"friction": (-0.1, *[0.0] * 4)}, "friction is .* at least 0"),
    (Shape, {"friction": (-0.5, 0.0, 0.0)}, "friction is .* at least 0"),
    (Loop, {"type": "glue"}, "type is 'glue'; valid: "),
    (Tendon, {"rest": (1.0, 0.5)}, "rest is .*; it must be the shortest and the longest length"),
    (Tendon, {"bodies": ("b", "c")}, "it needs either"),
    (Tendon, {"joints": (), "coefficients": (), "bodies": ("b", "c")}, "positions is .* a point of each body"),
    (Tendon, {"coefficients": (1.0, 2.0)}, "coefficients is .*; it must be 1 numbers"),
    (Actuator, {"activation": "spring"}, "activation is 'spring'; valid: "),
    (Actuator, {"activation_range": (1.0, 0.0)}, "activation_range is .*; it must be the lowest and the highest"),
    (Actuator, {"joint": "", "tendon": "t", "armature": 0.1}, "armature on a tendon"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "changes", "told"), WRONG)
def test_a_part_says_what_is_wrong_with_it_and_what_would_be_valid(
    kind: type, changes: dict[str, Any], told: str
) -> None:
    with pytest.raises(SceneError, match=told):
        kind(**{**PARTS[kind], **changes})


ROD = Body(name="rod", mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))
HINGE = Joint(name="hinge", body="rod", type="hinge")
SHAPES = (Shape(name="floor", type="plane"), Shape(name="ball", body="rod"))
MEET = Pair(name="meet", first="floor", second="ball")
ARM, TIP = Body(name="arm"), Body(name="tip", parent="rod")


@pytest.mark.parametrize(("parts", "told"), [
    ({"bodies": (ROD, ROD)}, "bodies has the name 'rod' twice"),
    ({"gravity": (0.0, 0.0, math.inf)}, "Scene.gravity is .* must be finite"),
    ({"joints": (dataclasses.replace(HINGE, body="bar"),)}, "Joint 'hinge': body is 'bar', which does not exist"),
    ({"bodies": (ROD, dataclasses.replace(TIP, parent="bar"))}, "Body 'tip': parent is 'bar', which does not exist"),
    ({"bodies": (ROD, TIP), "joints": (Joint(name="free", body="tip", type="free"),)}, "a free joint is only possible"),
    ({"bodies": (ROD, ARM), "joints": (Joint(name="x", body="arm", type="slide"), HINGE)}, "the order of the bodies"),
    ({"bodies": (ROD, ARM, TIP)}, "branch by branch"),
    ({"shapes": SHAPES, "pairs": (MEET, dataclasses.replace(MEET, name="again", first="ball", second="floor"))},
     "Pairs 'meet' and 'again' are of the same shapes, 'ball' and 'floor'"),
])  # fmt: skip
def test_a_scene_says_which_of_its_parts_do_not_go_together(parts: dict[str, Any], told: str) -> None:
    with pytest.raises(SceneError, match=told):
        Scene(**{"bodies": (ROD,), "joints": (HINGE,), **parts})
