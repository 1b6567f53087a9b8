"""Friction of spheres on solids, and of capsules: the same motion by other shapes, and closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from friction_scenes import G, account, box_body, pair, run
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from crossbody.cases import Mode, Outcome
from crossbody.cases.scene import Body, Joint, RowLaw, Scene, Shape

RADIUS, SIDE = 0.1, 0.3
HALVES = (0.5, 0.4, SIDE)
BALL = Shape(name="one", body="one", type="sphere", size=(RADIUS, 0.0, 0.0))
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
ASIDE = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
"""z to x."""


def solid(kind: str, *size: float, orientation: tuple[float, ...] = UPRIGHT, z: float = 0.0) -> Shape:
    """Return the second shape."""
    sizes = (*size, 0.0, 0.0, 0.0)[:3]
    return Shape(name="two", body="two", type=kind, size=sizes, orientation=orientation, position=(0.0, 0.0, z))


def rod(kind: str, half: float = 0.2) -> Shape:
    """Return a capsule along x, or a sphere in the place of one of its ends."""
    if kind == "sphere":
        return replace(BALL, position=(-half, 0.0, 0.0))
    return Shape(name="one", body="one", type="capsule", size=(RADIUS, half, 0.0), orientation=ASIDE)


SAME: dict[str, tuple[Shape, Shape, Shape, Shape]] = {
    "box's face is a plane": (BALL, solid("box", *HALVES), BALL, solid("plane", z=SIDE)),
    "cylinder's cap is a plane": (BALL, solid("cylinder", 0.6, SIDE), BALL, solid("plane", z=SIDE)),
    "cylinder's side is a capsule's": (
        BALL, solid("cylinder", SIDE, 0.8, orientation=ASIDE), BALL, solid("capsule", SIDE, 0.8, orientation=ASIDE)
    ),
    "capsule's end is a sphere": (
        BALL, solid("capsule", 0.2, 0.1), BALL, solid("sphere", 0.2, z=0.1)
    ),
    "capsule's end on a capsule's side": (
        rod("capsule"), solid("capsule", SIDE, 0.8, orientation=ASIDE),
        rod("sphere"), solid("capsule", SIDE, 0.8, orientation=ASIDE),
    ),
    "thick capsule is another's side": (  # over a cylinder along it that is as wide
        BALL, solid("capsule", SIDE, 0.8, orientation=ASIDE), BALL, solid("capsule", SIDE, 0.9, orientation=ASIDE)
    ),
}  # fmt: skip


def scene_of(one: Shape, two: Shape, mu: float) -> Scene:
    """Return two free bodies whose shapes rub."""
    bodies = (replace(box_body("one", (0.1, 0.12, 0.15)), com=(0.01, 0.02, -0.01)), box_body("two", HALVES, 3.0))
    joints = tuple(Joint(name=f"of {body.name}", body=body.name, type="free") for body in bodies)
    return Scene(bodies=bodies, joints=joints, shapes=(one, two), pairs=(pair("one", "two", mu),), gravity=(0, 0, 0))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", SAME)
def test_the_same_motion_by_other_shapes(name: str, seed: int) -> None:
    """A body is thrown onto one that moves and turns; it slides, sticks and leaves."""
    rng, (one, two, other, instead) = np.random.default_rng(seed), SAME[name]
    frame, leans = Rotation.random(rng=rng), Rotation.from_euler("y", -1.0 if one.type == "capsule" else 0.0)
    at = np.array([0.0, 0.0, SIDE + RADIUS + 1e-3]) - leans.apply(other.position)  # of a rod its lower end
    q0 = [*frame.apply(at), *np.roll((frame * leans).as_quat(), 1), 0, 0, 0, *np.roll(frame.as_quat(), 1)]
    slide = 0.1 if "end is" in name else 0.5
    v0 = [*frame.apply([*(slide * rng.normal(size=2)), -1.0]), *rng.normal(size=3), *(0.1 * rng.normal(size=6))]
    ends = [run(scene_of(*shapes, 0.4), q0, v0, 0.1, rtol=1e-10) for shapes in ((one, two), (other, instead))]
    for end in ends:
        assert end.outcome is Outcome.FINISHED, end.message
        assert account(end) < 1e-8
    assert {Mode.STICK, Mode.SLIP} & {event.after for event in ends[0].events}
    assert np.abs(ends[0].q[-1] - ends[1].q[-1]).max() < 1e-8
    assert np.abs(ends[0].v[-1] - ends[1].v[-1]).max() < 1e-7


def fixed(shape: Shape, ball: Body, mu: float) -> Scene:
    """Return a free ball and a shape of the world's."""
    return Scene(
        bodies=(ball,), joints=(Joint(name="free", body="one", type="free"),), shapes=(BALL, replace(shape, body="")),
        pairs=(pair("one", "two", mu),),
    )  # fmt: skip


ROUND = Body(name="one", mass=1.0, inertia=(*(0.4 * RADIUS**2,) * 3, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("kind", ["capsule", "cylinder", "sphere"])
def test_a_ball_rolls_off_a_round_top_until_it_slips(kind: str) -> None:
    """7/10 (R + r) th'^2 = g (cos th0 - cos th); it slips where 2 sin th = mu (17 cos th - 10 cos th0)."""
    mu, th0, far = 0.5, 0.2, SIDE + RADIUS
    made = solid("sphere", SIDE) if kind == "sphere" else solid(kind, SIDE, 1.0, orientation=ASIDE)
    q0 = [0.0, far * np.sin(th0), far * np.cos(th0), *UPRIGHT]
    found = run(fixed(made, ROUND, mu), q0, np.zeros(6), 0.75, rtol=1e-11)
    [slips] = [event for event in found.events if event.before is Mode.STICK and event.after is Mode.SLIP]
    k = int(np.flatnonzero(found.t == slips.t)[0])
    angle = np.arctan2(*found.q[k, 1:3])
    lean = np.hypot(17.0 * mu, 2.0)
    expected = np.arccos(10.0 * mu * np.cos(th0) / lean) - np.arctan2(2.0, 17.0 * mu)
    assert angle == pytest.approx(expected, abs=1e-8)

    def pace(u: float) -> float:  # th = th0 + u^2, whose rate does not vanish at rest
        th = th0 + u * u
        part = np.sinc(0.5 * u * u / np.pi) * np.sin(th0 + 0.5 * u * u)  # (cos th0 - cos th)/u^2
        assert th < np.pi
        return float(2.0 / np.sqrt(10.0 / 7.0 * G / far * part))

    assert slips.t == pytest.approx(quad(pace, 0.0, np.sqrt(expected - th0), epsabs=1e-13)[0], abs=1e-8)


@pytest.mark.parametrize("made", [solid("box", *HALVES), solid("cylinder", 0.6, SIDE)], ids=lambda one: one.type)
def test_a_ball_slides_then_rolls_on_a_face(made: Shape) -> None:
    v0, spin, mu = np.array([0.4, 0.0]), np.array([3.0, -5.0, 4.0]), 0.2
    found = run(fixed(made, ROUND, mu), [0, 0, SIDE + RADIUS, *UPRIGHT], [*v0, 0, *spin], 0.5)
    u0 = v0 + RADIUS * np.array([-spin[1], spin[0]])
    [t] = [event.t for event in found.events if event.after is Mode.STICK]
    assert abs(t - np.linalg.norm(u0) / (3.5 * mu * G)) < 1e-11
    assert found.v[-1, :2] == pytest.approx(v0 - 2.0 * u0 / 7.0, abs=1e-9)


UPPER, LOWER, ALONG_X, ALONG_Y = 0.125, 0.25, 0.02, 0.005
"""Radii of two capsules across each other, and moments of inertia of the upper one."""


def crossed(mu: float) -> Scene:
    """Return a capsule along y that lies across one along x, which is the world's."""
    body = Body(name="one", mass=1.0, inertia=(ALONG_X, ALONG_Y, 0.02, 0.0, 0.0, 0.0))
    upper = Shape(name="one", body="one", type="capsule", size=(UPPER, 0.3, 0.0),
                  orientation=(np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0))  # fmt: skip
    lower = Shape(name="two", type="capsule", size=(LOWER, 0.5, 0.0), orientation=ASIDE)
    joints = (Joint(name="free", body="one", type="free"),)
    return Scene(bodies=(body,), joints=joints, shapes=(upper, lower), pairs=(pair("one", "two", mu),))


def test_a_capsule_slides_to_a_stop_along_another_across_it() -> None:
    """In x it comes to roll on its side: the slip falls at mu g (1 + m r^2/I_y), and v at mu g."""
    v0, mu, ratio = 0.5, 0.3, 1.0 + UPPER**2 / ALONG_Y
    lies = UPPER + LOWER - 1e-15  # lower than rounding: it does not fall for a nanosecond
    found = run(crossed(0.3), [0, 0, lies, *UPRIGHT], [v0, 0, 0, 0, 0, 0], 0.3, rtol=1e-11)
    [t] = [event.t for event in found.events if event.after is Mode.STICK]
    assert abs(t - v0 / (mu * G * ratio)) < 1e-11
    assert found.v[-1, 0] == pytest.approx(v0 * (1.0 - 1.0 / ratio), abs=1e-9)
    assert found.v[-1, 4] == pytest.approx(found.v[-1, 0] / UPPER, abs=1e-8)


def test_a_capsule_rocks_on_another_across_it() -> None:
    """Its underside rolls on a round back: where it leans by th, the contact has gone R th along it.

    Its centre is (R + r) cos th + R th sin th high, and it turns about the contact with I + m (r^2 + (R th)^2).
    """
    th0, far = 0.3, UPPER + LOWER
    y, z = far * np.sin(th0) - LOWER * th0 * np.cos(th0), far * np.cos(th0) + LOWER * th0 * np.sin(th0)
    q0 = [0.0, -y, z, np.cos(0.5 * th0), np.sin(0.5 * th0), 0.0, 0.0]
    found = run(crossed(5.0), q0, np.zeros(6), 1.0, rtol=1e-11)
    assert found.outcome is Outcome.FINISHED, found.message
    th = 2.0 * np.arctan2(found.q[:, 4], found.q[:, 3])
    height = far * np.cos(th) + LOWER * th * np.sin(th)
    inertia = ALONG_X + UPPER**2 + (LOWER * th) ** 2
    assert found.q[:, 2] == pytest.approx(height, abs=1e-8)
    assert 0.5 * inertia * found.v[:, 3] ** 2 + G * height == pytest.approx(G * z, abs=1e-8)
    assert th.min() < -0.29


def egg(rng: np.random.Generator) -> tuple[Scene, np.ndarray, np.ndarray]:
    """A heavy ellipsoid that lies on stiff ground, slides and begins to rock."""
    half, mass = rng.uniform(0.08, 0.2, 3), rng.uniform(0.5, 2.0)
    inertia = mass * (np.sum(half**2) - half**2) / 5.0
    law, mu = RowLaw(a0=1e6, a1=4e3), float(rng.uniform(0.2, 0.6))
    scene = Scene(
        bodies=(Body(name="b", mass=mass, inertia=(*map(float, inertia), 0.0, 0.0, 0.0)),),
        joints=(Joint(name="free", body="b", type="free"),),
        shapes=(
            Shape(name="floor", type="plane"),
            Shape(name="b", body="b", type="ellipsoid", size=tuple(map(float, half))),
        ),
        pairs=(pair("floor", "b", mu, law),),
    )  # fmt: skip
    return (
        scene,
        np.array([0.0, 0.0, half[2], 1.0, 0.0, 0.0, 0.0]),
        np.array([0.8, 0.3, 0.0, *rng.uniform(0.5, 2.0, 3)]),
    )


@pytest.mark.parametrize("rtol", [1e-6, 1e-7])
@pytest.mark.parametrize("seed", range(4))
def test_multipliers_between_the_ends_of_long_steps_are_no_further_off_than_there(seed: int, rtol: float) -> None:
    """A gap that the interpolant of a long step knows to the tolerance would put them off by a0."""
    scene, q, v = egg(np.random.default_rng([seed, 61]))
    ends = np.unique(run(scene, q, v, 0.2, rtol=rtol).t)
    times = np.unique(np.r_[ends, 0.5 * (ends[1:] + ends[:-1])])
    found, exact = (run(scene, q, v, 0.2, rtol=one, samples=times) for one in (rtol, 1e-12))
    events = np.array([0.0, *(event.t for event in exact.events)])
    clear = np.abs(times[:, None] - events).min(axis=1) > 5e-3  # there either side counts
    off, at_end = np.abs(found.lam - exact.lam)[:, 0], np.isin(times, ends)
    assert found.counts["implicit_steps"] > 20
    assert off[clear & ~at_end].max() <= off[clear & at_end].max()
