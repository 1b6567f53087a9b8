"""Columns of balls that cannot turn rest on each other: rows that fall alike are off their laws by rounding alone."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, Outcome
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
RADIUS, G = 0.25, 9.81


def column(seed: int) -> tuple[Case, np.ndarray]:
    """A column of balls on slides, each upon the last, some pressed sideways by less than friction holds; the loads."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 5))
    names, masses = [f"ball {i}" for i in range(count)], rng.uniform(0.2, 3.0, count)
    ways = [str(rng.choice(["z", "xz", "yz", "xyz"])) for _ in names]
    mu = np.where(rng.random(count) < 0.3, 0.0, rng.uniform(0.3, 1.0, count))
    side = 0.05 * G if (mu > 0.0).all() and rng.random() < 0.5 else 0.0
    bodies = tuple(
        Body(
            name=name, mass=float(m), inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0), position=(0.0, 0.0, RADIUS * (2 * i + 1))
        )
        for i, (name, m) in enumerate(zip(names, masses, strict=True))
    )
    joints = tuple(
        Joint(name=f"{name} {k}", body=name, type="slide", axis=AXES[k])
        for name, way in zip(names, ways, strict=True) for k in way
    )  # fmt: skip
    balls = tuple(Shape(name=name, body=name, size=(RADIUS, 0.0, 0.0)) for name in names)
    pairs = tuple(
        Pair(name=f"{below}:{above}", first=below, second=above, friction=(float(m), float(m), 0.0, 0.0, 0.0),
             dimension=3 if m else 1, law=RowLaw(a0=1e4, a1=200.0))
        for below, above, m in zip(["floor", *names], names, mu, strict=False)
    )  # fmt: skip
    scene = Scene(
        bodies=bodies, joints=joints, shapes=(Shape(name="floor", type="plane"), *balls), pairs=pairs,
        gravity=(side, 0.0, -G),
    )  # fmt: skip
    loads = G * np.cumsum(masses[::-1])[::-1]
    return cases.from_scene(scene, q0=np.zeros(scene.nq), t_end=0.3), loads


@pytest.mark.parametrize("profile", ["compiled", "cvode"])
@pytest.mark.parametrize("seed", [*range(12), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(12, 100))])
def test_what_stands_rests_and_bears_its_load(seed: int, profile: str) -> None:
    """A row between two that fall alike has no drive: nothing but rounding was allowed to be off, and that was none."""
    case, loads = column(seed)
    run = engines.load("reference").prepare(case, profile, time_limit=60.0).run()
    assert run.outcome is Outcome.FINISHED, run.message
    assert np.abs(run.q).max() < 1e-9
    np.testing.assert_allclose(run.lam[-1, : len(loads)], loads, rtol=1e-6)
