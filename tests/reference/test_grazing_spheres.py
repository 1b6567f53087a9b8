"""Balls that graze each other, or fixed bodies: what presses is found in free steps of any length."""

from __future__ import annotations

import numpy as np
import pytest
from friction_scenes import run

from crossbody.cases import Trajectory
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape

RADIUS, MASS = 0.05, 1.0
TARGETS = {"ball": ("sphere", (RADIUS, 0.0, 0.0)), "fixed ball": ("sphere", (RADIUS, 0.0, 0.0)),
           "box": ("box", (0.05, 0.05, 0.05)), "capsule": ("capsule", (RADIUS, 0.1, 0.0))}  # fmt: skip
STEPS = 1000  # of a passage at most, of the motion that is compared with
ALIKE = 1e-4  # of the velocity


def ball(name: str) -> tuple[Body, Joint, Shape]:
    """A free ball, its joint and its shape."""
    moment = 0.4 * MASS * RADIUS**2
    return (
        Body(name=name, mass=MASS, inertia=(moment, moment, moment, 0.0, 0.0, 0.0)),
        Joint(name=name, body=name, type="free"),
        Shape(name=name, body=name, type="sphere", size=(RADIUS, 0.0, 0.0)),
    )


def thrown(seed: int, target: str, gravity: float) -> tuple[Scene, np.ndarray, np.ndarray, float, float]:
    """A ball that flies at a target with an offset, its start, when it has passed, and a longer horizon."""
    rng = np.random.default_rng([seed, *map(ord, target)])
    speed, offset = 10.0 ** rng.uniform(-0.5, 1.5), 0.1 * rng.uniform(0.2, 0.98)
    rate = speed / (RADIUS * rng.uniform(0.05, 0.7))  # at which it goes no deeper than that
    law, mu = RowLaw(a0=rate**2, a1=2.0 * rate * 10.0 ** rng.uniform(-3.0, -0.5)), float(rng.choice([0.0, 0.3]))
    kind, size = TARGETS[target]
    bodies, joints, shapes = zip(*([ball("a"), ball("b")] if target == "ball" else [ball("a")]), strict=True)
    if target != "ball":
        turned = (0.9, 0.3, 0.2, 0.1) if kind == "box" else (1.0, 0.0, 0.0, 0.0)
        shapes += (Shape(name="b", body="", type=kind, size=size, orientation=turned),)
    pair = Pair(name="p", first="a", second="b", friction=(mu, mu, 0.0, 0.0, 0.0), dimension=3 if mu else 1, law=law)
    scene = Scene(bodies=bodies, joints=joints, shapes=shapes, pairs=(pair,), gravity=(0.0, 0.0, -gravity))
    reaches = 0.5 / speed
    fallen = 0.0 if target == "ball" else 0.5 * gravity * reaches**2
    start = [
        -0.5,
        0.0,
        offset + fallen,
        1.0,
        0.0,
        0.0,
        0.0,
        *([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0] if target == "ball" else []),
    ]
    velocity = np.zeros(6 * len(bodies))
    velocity[0] = speed
    return scene, np.array(start), velocity, 1.4 * reaches, float(rng.choice([2.8, 8.0, 80.0])) * reaches


def last(found: Trajectory, until: float) -> np.ndarray:
    return np.asarray(found.v[np.flatnonzero(found.t == until)[-1]])


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-11])
@pytest.mark.parametrize("gravity", [0.0, 9.81])
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("seed", [*range(6), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(6, 100))])
def test_a_passage_does_not_depend_on_how_long_a_step_may_be(
    seed: int, target: str, gravity: float, rtol: float
) -> None:
    scene, q0, v0, passed, horizon = thrown(seed, target, gravity)
    fine = run(scene, q0, v0, passed, rtol=1e-9, max_step=passed / STEPS, samples=[0.0, passed])
    found = run(scene, q0, v0, horizon, rtol=rtol, samples=[0.0, passed, horizon])
    if fine.outcome.ok and found.t[-1] >= passed:
        assert np.abs(last(found, passed) - last(fine, passed)).max() < max(ALIKE, 1e3 * rtol) * np.abs(v0).max()
