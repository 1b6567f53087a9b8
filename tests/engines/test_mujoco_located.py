"""MuJoCo's matched steps are cut where rows of a scene touch and let go: events are the law's, the order is four."""

from __future__ import annotations

import numpy as np
import pytest
from resting import apart, plate, run

from crossbody import cases, engines
from crossbody.cases import Case, Mode, Trajectory
from crossbody.cases.scene import Body, Joint, RowLaw, Scene, Tendon

FINE = 1e-8
"""An error below which what MuJoCo keeps of its softness hides the order: 1e-7 of that of contacts, 1e-4 of bounds."""


def chain(seed: int) -> Case:
    """Return three bodies on joints that swing and slide against their bounds, and a sum of joints with bounds."""
    rng = np.random.default_rng(seed)
    law = RowLaw(a0=float(rng.uniform(2e3, 2e4)), a1=float(rng.uniform(20.0, 150.0)))
    bodies, joints = [], []
    for i in range(3):
        size = rng.uniform(0.05, 0.1, 3)
        bodies.append(Body(
            name=f"body {i}", parent=f"body {i - 1}" if i else "", position=tuple(rng.normal(size=3) * 0.3),
            mass=float(rng.uniform(0.5, 2.0)), com=tuple(rng.normal(size=3) * 0.2), inertia=(*size, 0.0, 0.0, 0.0),
        ))  # fmt: skip
        joints.append(Joint(
            name=f"joint {i}", body=f"body {i}", type="slide" if i == seed % 3 else "hinge",
            axis=tuple(rng.normal(size=3)), range=(-0.15, 0.15), law=law,
        ))  # fmt: skip
    both = Tendon(name="both", joints=("joint 0", "joint 1"), coefficients=(1.0, 0.7), range=(-0.2, 0.2), law=law)
    scene = Scene(bodies=tuple(bodies), joints=tuple(joints), tendons=(both,))
    return cases.from_scene(scene, q0=rng.uniform(-0.1, 0.1, 3), v0=rng.normal(size=3) * 2.0, t_end=0.4)


def dropped(seed: int) -> Case:
    """Return a plate on three feet that lands on one of them, another, and the last."""
    feet = np.array([(0.1, 0.0, 0.0), (-0.1, 0.1, 0.0), (-0.1, -0.1, 0.0)])
    rng = np.random.default_rng(seed)
    law = RowLaw(a0=1e4, a1=float(rng.uniform(20.0, 150.0)))
    return plate(feet, height=0.02, turn=rng.uniform(-0.2, 0.2, 3), v=rng.normal(size=6) * 0.3, t_end=0.3, law=law)


def changes(motion: Trajectory) -> list[tuple[int, Mode]]:
    """Return rows and modes behind every instant of events, those of one instant in the order of the rows."""
    found: dict[tuple[float, int], Mode] = {}
    for event in motion.events:
        found[round(event.t, 7), event.contact] = event.after
    return [(row, mode) for (_, row), mode in sorted(found.items())]


@pytest.mark.parametrize(("made", "seed"), [*((chain, seed) for seed in range(6)), (dropped, 0), (dropped, 2)])
def test_events_are_located_and_the_order_survives_them(made: object, seed: int) -> None:
    case: Case = made(seed)  # type: ignore[operator]
    truth = run(case, rtol=1e-12)
    assert len(truth.events) >= 3
    off = []
    for dt in (5e-4, 2.5e-4):
        found = run(case, "matched", "mujoco", dt=dt)
        assert changes(found) == changes(truth)
        assert found.events[0].t == pytest.approx(truth.events[0].t, rel=0.0, abs=1e-8)
        off.append(apart(case, truth, found))
    assert off[1] <= max(off[0] / 8.0, FINE)


def test_a_row_that_pushes_outlives_its_gap() -> None:
    """A pendulum that falls onto a bound without leaving it leaves it where its multiplier ends, not where it opens."""
    law = RowLaw(a0=1e3, a1=5.0)
    rod = Body(name="rod", mass=1.0, com=(0.0, 0.0, 0.5), inertia=(0.1, 0.1, 0.01, 0.0, 0.0, 0.0))
    hinge = Joint(name="hinge", body="rod", type="hinge", axis=(0.0, 1.0, 0.0), range=(-3.0, 1.2), law=law)
    case = cases.from_scene(Scene(bodies=(rod,), joints=(hinge,)), q0=[0.3], t_end=2.0)
    truth, found = run(case, rtol=1e-11), run(case, "matched", "mujoco", dt=2.5e-4)
    left = [next(e for e in one.events if e.before.name == "CONTACT") for one in (truth, found)]
    assert left[1].after == left[0].after
    assert left[1].t == pytest.approx(left[0].t, rel=0.0, abs=1e-7)
    above = [float(one.gap[np.searchsorted(one.t, e.t), 1]) for one, e in zip((truth, found), left, strict=True)]
    assert above[1] == pytest.approx(above[0], rel=1e-4)
    assert engines.load("mujoco").prepare(case, "matched").settings["located_events"]
