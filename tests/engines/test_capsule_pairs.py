"""Capsules side by side, as a cross, as a T: rows of both implementations against a minimum found by least squares."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from crossbody import cases
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Body, Joint, Pair, Scene, Shape
from crossbody.cases.scene_contacts import SAG
from crossbody.engines._contacts import FAR, Contacts
from crossbody.engines.equations import system_of
from crossbody.reference.pairs import layout
from crossbody.reference.tree import layout as tree
from crossbody.reference.tree.pair_rows import chosen, touch
from crossbody.reference.tree.quantities import posed

RADII = (0.02, 0.03)
EXACT = [0.0, 1e-16, 1e-13, 1e-10, 1e-7, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.4, 0.6, 1.0, np.pi / 2]
"""Angles, rad: parallel, nearly so at many scales, on either side of the steepest that count as along, and a T."""
Ends = tuple[Floats, Floats]


SIGN = st.sampled_from([-1.0, 1.0])
SHIFTS = st.sampled_from([0.0, 1e-12, 1e-3, 0.1, 0.3, 0.6])
HALF, COORDINATE, TURN = st.floats(0.03, 0.4), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0)
POSES = st.fixed_dictionaries({
    "halves": st.tuples(HALF, HALF), "slant": st.sampled_from(EXACT), "yaw": st.sampled_from(EXACT),
    "signs": st.tuples(SIGN, SIGN, SIGN), "shift": SHIFTS, "apart": st.floats(0.1, 0.6),
    "turn": st.tuples(TURN, TURN, TURN), "at": st.tuples(COORDINATE, COORDINATE, COORDINATE),
})  # fmt: skip
"""Two capsules, turned against each other in the plane of both and out of it, and shifted; the whole anywhere."""


def placed(drawn: dict[str, Any]) -> tuple[tuple[float, float], Ends, Ends]:
    """Half lengths, and centre and axis of either capsule."""
    slant, yaw, shift = np.array(drawn["signs"]) * [drawn["slant"], drawn["yaw"], drawn["shift"]]
    axis = Rotation.from_rotvec([0.0, 0.0, yaw]).apply(Rotation.from_rotvec([0.0, slant, 0.0]).apply([1.0, 0.0, 0.0]))
    apart = drawn["apart"] + drawn["halves"][1] * abs(axis[2])
    whole, at = Rotation.from_rotvec(drawn["turn"]), np.array(drawn["at"])
    first, second = (at, whole.apply([1.0, 0.0, 0.0])), (at + whole.apply([shift, 0.0, apart]), whole.apply(axis))
    return drawn["halves"], first, second


def rotation(axis: Floats) -> Floats:
    """A rotation whose third column is a unit vector."""
    beside = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    beside /= np.linalg.norm(beside)
    return np.column_stack([beside, np.cross(axis, beside), axis])


def nearest(halves: tuple[float, float], first: Ends, second: Ends) -> tuple[Floats, Floats]:
    """Nearest points of two axes, by bounded least squares."""
    (M, A), (N, B) = first, second
    found = lsq_linear(np.column_stack([A, -B]), N - M, (-np.array(halves), np.array(halves)), method="bvls", tol=1e-15)
    return M + found.x[0] * A, N + found.x[1] * B


class Rows:
    """Rows of the same pair: (gaps, normals, points) by an engine's shapes and by the reference's kernels."""

    def __init__(self, halves: tuple[float, float]) -> None:
        shapes = tuple(
            Shape(name=name, body=name, type="capsule", size=(radius, half, 0.0))
            for name, radius, half in zip(("one", "two"), RADII, halves, strict=True)
        )
        scene = Scene(
            bodies=tuple(Body(name=one.body, mass=1.0, inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0)) for one in shapes),
            joints=tuple(Joint(name=f"free {one.body}", body=one.body, type="free") for one in shapes),
            shapes=shapes, pairs=(Pair(name="pair", first="one", second="two"),),
        )  # fmt: skip
        self.met, self.system = Contacts(scene), system_of(cases.from_scene(scene))

    def engine(self, first: Ends, second: Ends) -> Any:
        place = {"one": (rotation(first[1]), first[0]), "two": (rotation(second[1]), second[0])}
        found = self.met.touches(place.__getitem__)
        return found.gap, found.normal, found.point

    def kernels(self, first: Ends, second: Ends) -> Any:
        turns = [np.roll(Rotation.from_matrix(rotation(axis)).as_quat(), 1) for _, axis in (first, second)]
        q = np.concatenate([first[0], turns[0], second[0], turns[1]])
        p = self.system.p.copy()
        w, pair = posed(q, np.zeros(12), p), int(p[tree.AT_PAIR])
        p[int(p[tree.AT_SIDE]) + int(p[pair + layout.LIES])] = chosen(p, w, pair)
        rows = [touch(p, w, pair, int(p[tree.AT_ROW]) + tree.ROW * place) for place in range(2)]
        return np.array([h[0] for h, _, _ in rows]), *(np.array([row[k] for row in rows]) for k in (1, 2))


@pytest.mark.parametrize("how", ["engine", "kernels"])
@settings(deadline=None)
@given(drawn=POSES)
def test_the_nearest_row_is_where_capsules_are_nearest(how: str, drawn: Any) -> None:
    """Its gap is the distance of the axes less both radii; where one place is nearest it is that, and so its normal."""
    halves, first, second = placed(drawn)
    K, L = nearest(halves, first, second)
    apart = L - K
    distance = np.linalg.norm(apart)
    gaps, normals, points = getattr(Rows(halves), how)(first, second)
    least = int(np.argmin(gaps))
    assert gaps[least] - (distance - sum(RADII)) == pytest.approx(0.0, abs=SAG * sum(RADII) + 1e-12)
    sine = np.linalg.norm(np.cross(first[1], second[1]))
    if sine > 0.1 and gaps[1 - least] > gaps[least] + 1e-3:
        np.testing.assert_allclose(normals[least], apart / distance, atol=1e-9)
        np.testing.assert_allclose(points[least], L - RADII[1] * normals[least], atol=1e-9)
    for gap, normal, point in zip(gaps, normals, points, strict=True):
        if (
            gap < FAR
        ):  # what a row calls its place is one: on the second surface, gap and first radius from the first axis
            on = second[0] + np.clip((point - second[0]) @ second[1], -halves[1], halves[1]) * second[1]
            foot = point - (gap + RADII[0]) * normal
            assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
            assert np.linalg.norm(point - on) <= RADII[1] + 1e-9
            on = first[0] + np.clip((foot - first[0]) @ first[1], -halves[0], halves[0]) * first[1]
            assert np.linalg.norm(foot - on) <= 1e-9


@pytest.mark.parametrize("how", ["engine", "kernels"])
@settings(deadline=None)
@given(drawn=POSES, seed=st.integers(0, 2**32 - 1))
def test_no_gap_of_capsules_hangs_on_rounding(how: str, drawn: Any, seed: int) -> None:
    """Either row's gap is the same at poses that differ by rounding, unless these lie otherwise to each other."""
    halves, first, second = placed(drawn)
    rows, rng = Rows(halves), np.random.default_rng(seed)
    axis = second[1] + 1e-14 * rng.normal(size=3)
    gaps = [getattr(rows, how)(first, other)[0] for other in (second, (second[0], axis / np.linalg.norm(axis)))]
    if (gaps[0][1] < FAR) == (gaps[1][1] < FAR):
        np.testing.assert_allclose(gaps[0], gaps[1], atol=1e-9)


def test_a_t_has_one_row() -> None:
    """In one plane at a right angle, as links of an arm: no end of the one is the same as an end of the other."""
    first, second = (np.zeros(3), np.array([1.0, 0.0, 0.0])), (np.array([0.05, 0.0, 0.4]), np.array([0.0, 0.0, 1.0]))
    for how in ("engine", "kernels"):
        gaps, _, points = getattr(Rows((0.2, 0.1)), how)(first, second)
        assert gaps == pytest.approx([0.3 - sum(RADII), FAR])
        np.testing.assert_allclose(points[0], [0.05, 0.0, 0.27], atol=1e-12)
