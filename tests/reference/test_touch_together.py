"""Rows that touch at one instant, but for rounding: the motion keeps the symmetry that it has.

Legs around an axis, all alike, come to their bounds while their feet carry the body. Which of them a computer has come
first is chance; what the first one exchanges would let other feet go for good, as the level machine has it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, Mode, Outcome, Tier
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape
from crossbody.reports import metrics
from crossbody.reports.measuring.truth import from_run


def squatting(seed: int) -> tuple[Case, int]:
    """Return a body that is let fall on two to five feet, whose knees then come to their bounds; and their number."""
    rng = np.random.default_rng(seed)
    legs, arm, shank = int(rng.integers(2, 6)), rng.uniform(0.2, 0.4), rng.uniform(0.3, 0.5)
    start, room, turned = rng.uniform(0.5, 0.8), rng.uniform(0.15, 0.3), rng.uniform(0.0, 1.0)
    laws = [RowLaw(a0=float(rng.uniform(1e3, 5e3)), a1=float(rng.uniform(60.0, 150.0))) for _ in range(2)]
    around = [
        Body(name="trunk", mass=float(rng.uniform(1.0, 5.0)), inertia=(0.2, 0.2, 0.3, 0.0, 0.0, 0.0),
             position=(0.0, 0.0, float(shank * np.sin(start) + 0.05 + rng.uniform(0.02, 0.2)))),
    ]  # fmt: skip
    joints, shapes, pairs = [Joint(name="free", body="trunk", type="free")], [Shape(name="floor", type="plane")], []
    damping, mass = float(rng.uniform(0.0, 0.3)), float(rng.uniform(0.05, 0.3))
    for i in range(legs):
        angle = turned + 2.0 * np.pi * i / legs
        out, name = (float(np.cos(angle)), float(np.sin(angle)), 0.0), f"leg {i}"
        around.append(Body(
            name=name, parent="trunk", position=tuple(arm * x for x in out), mass=mass,
            orientation=(float(np.cos(0.5 * angle)), 0.0, 0.0, float(np.sin(0.5 * angle))),
            com=(0.5 * shank, 0.0, 0.0), inertia=(1e-3, 5e-3, 5e-3, 0.0, 0.0, 0.0),
        ))  # fmt: skip
        joints.append(Joint(
            name=f"knee {i}", body=name, type="hinge", axis=(0.0, 1.0, 0.0), damping=(damping, 0.0, 0.0),
            range=(float(start - room), np.inf), law=laws[0],
        ))  # fmt: skip
        shapes.append(Shape(name=f"foot {i}", body=name, type="sphere", size=(0.05, 0.0, 0.0),
                            position=(float(shank), 0.0, 0.0)))  # fmt: skip
        pairs.append(Pair(name=f"floor {i}", first="floor", second=f"foot {i}", law=laws[1]))
    scene = Scene(bodies=tuple(around), joints=tuple(joints), shapes=tuple(shapes), pairs=tuple(pairs),
                  gravity=(0.0, 0.0, -9.81))  # fmt: skip
    q0 = [*around[0].position, 1.0, 0.0, 0.0, 0.0, *[float(start)] * legs]
    return cases.from_scene(scene, q0=q0, t_end=0.8), legs


def both_touched(run: Any, legs: int) -> bool:
    """Whether all feet and all knees were in contact at once."""
    return bool((run.mode[:, : 2 * legs] == Mode.CONTACT).all(axis=1).any())


def uneven(run: Any, legs: int) -> float:
    """How far the knees are apart, rad."""
    return float(np.ptp(run.q[:, -legs:], axis=1).max())


@pytest.mark.parametrize("rtol", [1e-7, 1e-10, 1e-12])
def test_a_symmetric_body_stays_symmetric(rtol: float) -> None:
    seen = 0
    for seed in range(40):
        case, legs = squatting(seed)
        run = engines.load("reference").prepare(case, "compiled", rtol=rtol).run()
        assert run.outcome is Outcome.FINISHED, (seed, run.message)
        assert uneven(run, legs) <= 1e3 * rtol, seed
        seen += both_touched(run, legs)
    assert seen > 10


@pytest.mark.parametrize(("engine", "profile"), [("reference", "cvode"), ("reference", "ida"), ("pinocchio", "law")])
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2, 3))])
def test_every_solver_keeps_it(engine: str, profile: str, seed: int) -> None:
    case, legs = squatting(seed)
    exact = engines.load("reference").prepare(case, "compiled", rtol=1e-12).run()
    run = engines.load(engine).prepare(case, profile, rtol=1e-9).run()
    assert run.outcome is Outcome.FINISHED
    assert uneven(run, legs) <= 1e-6
    assert run.lam.min() >= -1e-6 * run.lam.max(), "no foot pulls"
    assert np.abs(run.q[-1] - exact.q[-1]).max() <= 1e-6
    off = metrics.load("law_residual").measure(from_run(exact, Tier.D, "compiled"), run, case)
    assert off is not None
    assert off <= 1e-8, "how rows depend on each other turns with the legs, and with it how they share a load"
