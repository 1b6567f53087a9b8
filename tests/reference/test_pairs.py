"""Gaps of shapes against MuJoCo's distances, and their derivatives against complex steps, at random poses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest

from crossbody.reference.pairs import planes, solids

STEP = 1e-30
SEEDS = range(60)


class Frame:
    """A shape's frame in a motion with constant velocity, acceleration and angular velocity."""

    def __init__(self, rng: np.random.Generator, far: float = 1.0, *, fixed: bool = False) -> None:
        self.p, q = far * rng.normal(size=3), rng.normal(size=4)
        self.q = q / np.linalg.norm(q)
        self.v, self.a, self.w = rng.normal(size=(3, 3)) * (0.0 if fixed else 1.0)
        R = np.zeros(9)
        mujoco.mju_quat2Mat(R, self.q)
        self.R = R.reshape(3, 3)

    def at(self, t: Any) -> tuple[Any, Any]:
        """Origin and axes (3, 3), as three vectors of jets each, at any time, complex ones too."""
        p = self.p + self.v * t + 0.5 * self.a * t * t
        size = np.linalg.norm(self.w)
        R = self.R
        if size > 0.0:
            K = np.cross(np.eye(3), self.w / size)
            R = (np.eye(3) + np.sin(size * t) * K + (1.0 - np.cos(size * t)) * (K @ K)) @ self.R
        origin = tuple((p[i], self.v[i] + self.a[i] * t, self.a[i] + 0.0 * t) for i in range(3))
        axes = []
        for k in range(3):
            x = R[:, k] + 0.0 * t
            first = np.cross(self.w, x)
            second = np.cross(self.w, first)
            axes.append(tuple((x[i], first[i], second[i]) for i in range(3)))
        return origin, axes

    def speed(self, x: Any) -> Any:
        """Velocity of its material point at x now."""
        return self.v + np.cross(self.w, np.asarray(x) - self.p)


def told(found: Any) -> Any:
    """Return a distance and the direction along which it is."""
    d, D, length = found
    return d, solids.unit(D, length)


def segments(t: Any, one: Frame, two: Frame) -> Any:
    (M, (_, _, A)), (N, (_, _, B)) = one.at(t), two.at(t)
    K, L = solids.segments(M, A, SIZE[1], N, B, LONG)
    return *told(solids.point(L, K)), solids.value(K)


SIZE, LONG = np.array([0.31, 0.43, 0.57]), 0.61
GEOM = mujoco.mjtGeom
SOLIDS: dict[str, tuple[Any, Any, float, Callable[..., Any]]] = {
    "point": (GEOM.mjGEOM_SPHERE, [0.3, 0, 0], 0.3, lambda C, M, X: told(solids.point(C, M))),
    "capsule": (GEOM.mjGEOM_CAPSULE, SIZE, SIZE[0], lambda C, M, X: told(solids.segment(C, M, X[2], SIZE[1]))),
    "box": (GEOM.mjGEOM_BOX, SIZE, 0.0, lambda C, M, X: told(solids.box(C, M, *X, tuple(SIZE)))),
    "cylinder": (GEOM.mjGEOM_CYLINDER, SIZE, 0.0, lambda C, M, X: told(solids.cylinder(C, M, X[2], *SIZE[:2]))),
}


def distance(one: Frame, kind: Any, size: Any, two: Frame, kind2: Any, size2: Any) -> float:
    spec = mujoco.MjSpec()
    for frame, what, how in ((one, kind, size), (two, kind2, size2)):
        body = spec.worldbody.add_body(pos=frame.p, quat=frame.q)
        if what != GEOM.mjGEOM_PLANE:
            body.add_freejoint()
        else:
            spec.worldbody.add_geom(type=what, size=[0, 0, 1], pos=frame.p, quat=frame.q)
            continue
        body.add_geom(type=what, size=how)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return float(mujoco.mj_geomDistance(model, data, 0, 1, 100.0, None))


def check_derivatives(gap: Callable[[Any], Any]) -> None:
    now, stepped = gap(0.0)[0], gap(STEP * 1j)[0]
    scale = 1.0 + abs(now[1]) + abs(now[2])
    assert abs(stepped[0].imag / STEP - now[1]) < 1e-11 * scale
    assert abs(stepped[1].imag / STEP - now[2]) < 1e-11 * scale


@pytest.mark.parametrize("name", SOLIDS)
def test_a_sphere_against_a_solid(name: str) -> None:
    kind, size, r, measure = SOLIDS[name]
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        one, two = Frame(rng), Frame(rng)

        def gap(t: Any, one: Frame = one, two: Frame = two) -> Any:
            return measure(one.at(t)[0], *two.at(t))

        d, n = gap(0.0)
        assert abs(np.linalg.norm(n) - 1.0) < 1e-14
        if d[0] - r > 0.1:
            theirs = distance(two, kind, size, one, GEOM.mjGEOM_SPHERE, [0.1, 0, 0])
            assert d[0] - r - 0.1 == pytest.approx(theirs, abs=1e-6)  # to which theirs is converged
        foot = one.p - d[0] * np.array(n)
        assert d[1] == pytest.approx(np.dot(n, one.v - two.speed(foot)), rel=1e-12, abs=1e-12)
        check_derivatives(gap)


@pytest.mark.parametrize("kind", [1.0, 1.0 + 0.0j])
@pytest.mark.parametrize("seed", range(5))
def test_shapes_whose_middles_meet_have_no_direction_in_real_and_complex_kernels(seed: int, kind: complex) -> None:
    """Nothing raises, and nothing is a number that says where they part; gaps are still known."""
    rng = np.random.default_rng(seed)
    one = Frame(rng, fixed=True)
    M, (_, _, A) = one.at(0.0 * kind)
    two = Frame(rng, fixed=True)
    two.p = one.p
    N, (_, _, B) = two.at(0.0 * kind)
    K, L = solids.segments(M, A, SIZE[1], N, B, LONG)
    for d, n in map(told, (solids.point(M, M), solids.segment(M, M, A, SIZE[1]), solids.point(L, K))):
        assert d[0] == 0.0
        assert np.isnan(d[1:]).all()
        assert np.isnan(n).all()
    d, n = told(solids.cylinder(M, M, A, SIZE[0], 3.0 * SIZE[0]))
    assert d[0] == -SIZE[0]
    assert np.isnan(n).all()


@pytest.mark.parametrize("sine", [1e-1, 1e-2, 1e-3, 1.1e-4])
def test_capsules_that_are_nearly_parallel_part_as_their_points_do(sine: float) -> None:
    """Where the nearest points run along, the distance does not: its rate is that of the points where they meet."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        one, two = Frame(rng), Frame(rng)
        axis = np.cross(one.R[:, 2], rng.normal(size=3))
        turn = axis / np.linalg.norm(axis) * sine
        two.R = one.R + np.cross(turn, one.R.T).T
        two.R /= np.linalg.norm(two.R, axis=0)
        (d, n, K), (stepped, _, _) = segments(0.0, one, two), segments(1j * STEP, one, two)
        met = np.array(K) + d[0] * np.array(n)
        assert d[1] == pytest.approx(np.dot(n, two.speed(met) - one.speed(K)), rel=1e-10, abs=1e-10)
        assert stepped[1].imag / STEP == pytest.approx(d[2], rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("sine", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
def test_capsules_side_by_side_part_where_they_end(sine: float) -> None:
    """Their rates are those of the points, at any angle, also where ends are abreast; their least is the distance."""
    for seed in SEEDS[:24]:
        rng = np.random.default_rng(seed)
        one, two = Frame(rng), Frame(rng)
        normal = np.cross(one.R[:, 2], rng.normal(size=3))
        normal /= np.linalg.norm(normal)
        two.R = one.R + sine * np.cross(normal, one.R.T).T
        two.R /= np.linalg.norm(two.R, axis=0)
        half = SIZE[1] if seed % 2 else LONG
        two.p = one.p + 0.5 * normal + (0.0 if seed % 4 == 0 else rng.uniform(-0.3, 0.3)) * one.R[:, 2]
        distances = []
        for sign in (-1.0, 1.0):

            def gap(t: Any, one: Frame = one, two: Frame = two, half: float = half, sign: float = sign) -> Any:
                (M, (_, _, A)), (N, (_, _, B)) = one.at(t), two.at(t)
                K, L = solids.ends(M, A, half, N, B, LONG, sign)
                return *told(solids.point(L, K)), solids.value(K)

            d, n, K = gap(0.0)
            met = np.array(K) + d[0] * np.array(n)
            assert d[1] == pytest.approx(np.dot(n, two.speed(met) - one.speed(K)), rel=1e-12, abs=1e-12)
            if seed % 4:  # abreast, a complex step does not say which way the motion takes
                check_derivatives(gap)
            distances.append(d[0])
        nearest = min(distances) - between(one, half, two, LONG)
        assert -1e-12 <= nearest <= (2.0 * min(half, LONG)) ** 2 * sine**2 / (8.0 * 0.5) + 1e-12


def between(one: Frame, half: float, two: Frame, other: float) -> float:
    """Distance of two segments: what is nearest to points of the first, by golden section of a convex function."""

    def off(s: float) -> float:
        x = one.p + s * one.R[:, 2]
        t = np.clip(two.R[:, 2] @ (x - two.p), -other, other)
        return float(np.linalg.norm(x - two.p - t * two.R[:, 2]))

    low, high = -half, half
    for _ in range(80):
        a, b = high - 0.618 * (high - low), low + 0.618 * (high - low)
        low, high = (low, b) if off(a) <= off(b) else (a, high)
    return min(off(0.5 * (low + high)), off(-half), off(half))


def test_a_capsule_against_a_capsule() -> None:
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        one, two = Frame(rng), Frame(rng)

        def gap(t: Any, one: Frame = one, two: Frame = two) -> Any:
            return segments(t, one, two)

        d, n, K = gap(0.0)
        if d[0] > 0.3:
            theirs = distance(
                one, GEOM.mjGEOM_CAPSULE, [0.1, SIZE[1], 0], two, GEOM.mjGEOM_CAPSULE, [0.2, LONG, 0]
            )  # fmt: skip
            assert d[0] - 0.3 == pytest.approx(theirs, abs=1e-6)
        met = np.array(K) + d[0] * np.array(n)
        assert d[1] == pytest.approx(np.dot(n, two.speed(met) - one.speed(K)), rel=1e-12, abs=1e-12)
        check_derivatives(gap)


LOWEST: dict[str, tuple[Any, Any, Callable[..., Any]]] = {
    "sphere": (GEOM.mjGEOM_SPHERE, SIZE, lambda P, N, C, X: [planes.sphere(P, N, C, SIZE[0])]),
    "capsule": (GEOM.mjGEOM_CAPSULE, SIZE, lambda P, N, C, X: [
        planes.sphere(P, N, planes.moved(C, s * SIZE[1], X[2]), SIZE[0]) for s in (-1.0, 1.0)
    ]),
    "cylinder": (GEOM.mjGEOM_CYLINDER, SIZE, lambda P, N, C, X: [
        planes.rim(P, N, planes.moved(C, s * SIZE[1], X[2]), X[0], X[1], r)
        for s in (-1.0, 1.0) for r in (SIZE[0], -SIZE[0])
    ]),
    "box": (GEOM.mjGEOM_BOX, SIZE, lambda P, N, C, X: [
        planes.sphere(P, N, planes.moved(planes.moved(planes.moved(
            C, a * SIZE[0], X[0]), b * SIZE[1], X[1]), c * SIZE[2], X[2]), 0.0)
        for a in (-1.0, 1.0) for b in (-1.0, 1.0) for c in (-1.0, 1.0)
    ]),
    "ellipsoid": (GEOM.mjGEOM_ELLIPSOID, SIZE, lambda P, N, C, X: [planes.ellipsoid(P, N, C, *X, tuple(SIZE))]),
}  # fmt: skip


@pytest.mark.parametrize("name", LOWEST)
def test_a_solid_against_a_half_space(name: str) -> None:
    kind, size, measure = LOWEST[name]
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        floor, solid = Frame(rng), Frame(rng)

        def gaps(t: Any, floor: Frame = floor, solid: Frame = solid) -> Any:
            P, (_, _, N) = floor.at(t)
            return measure(P, N, *solid.at(t))

        found = gaps(0.0)
        lowest = min(h[0] for h, _, _ in found)
        if lowest > 0.0:
            assert lowest == pytest.approx(distance(floor, GEOM.mjGEOM_PLANE, size, solid, kind, size), abs=1e-6)
        for k, (h, n, low) in enumerate(found):
            assert h[1] == pytest.approx(np.dot(n, solid.speed(low) - floor.speed(low)), rel=1e-12, abs=1e-12)
            assert np.dot(n, np.array(low) - floor.p) == pytest.approx(h[0], abs=1e-12)
            check_derivatives(lambda t, k=k, gaps=gaps: gaps(t)[k])
