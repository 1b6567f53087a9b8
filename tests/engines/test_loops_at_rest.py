"""What hangs from closed loops at rest carries its weight in every engine, at all samples, to what laws are held to."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody import engines
from crossbody.cases import Case, Outcome, Tier
from crossbody.cases.defaults import default_limits
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Loop, Scene
from crossbody.reports import metrics
from crossbody.reports.judging.acting import misacting
from crossbody.reports.measuring.truth import from_run


def hung(seed: int) -> Case:
    """Return a pendulum that hangs, and a body that a weld or a pin joins to its end, at rest."""
    rng = np.random.default_rng(seed)
    long, pinned = float(rng.uniform(0.2, 1.0)), bool(seed % 2)
    inertia = tuple(rng.uniform(2e-3, 4e-3, 3).tolist())
    bodies = (
        Body(name="above", mass=float(rng.uniform(0.1, 5.0)), com=(0.0, 0.0, -0.5 * long), inertia=(*inertia, 0, 0, 0)),
        Body(name="below", position=(0.0, 0.0, -long), mass=float(10.0 ** rng.uniform(-1.0, 1.0)),
             com=(0.0 if pinned else 0.1, 0.0, -0.1), inertia=(*inertia, 0, 0, 0)),
    )  # fmt: skip
    joints = (
        Joint(name="swing", body="above", type="hinge", axis=(0.0, 1.0, 0.0)),
        Joint(name="loose", body="below", type="free"),
    )
    loop = Loop(
        name="held", type="connect" if pinned else "weld", first="above", second="below",
        first_position=(0.0, 0.0, -long),
    )  # fmt: skip
    scene = Scene(bodies=bodies, joints=joints, loops=(loop,))
    a, b = bodies  # their weight is below the pivot
    swing = float(np.arctan2(b.com[0] * b.mass, b.mass * (long + 0.1) + 0.5 * long * a.mass))
    at, turn = (-long * np.sin(swing), 0.0, -long * np.cos(swing)), (np.cos(0.5 * swing), 0.0, np.sin(0.5 * swing), 0.0)
    return case_of(scene, q0=np.array([swing, *at, *turn]), t_end=0.4)


LIMIT = next(x.value for x in default_limits(hung(0)) if x.metric == "law_residual")


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("spec", ["mujoco:matched", "pinocchio:law", "reference:cvode"])
def test_multipliers_follow_the_law_at_rest(spec: str, seed: int) -> None:
    """Newton's method of MuJoCo ends below a step of 1e-15: with hard rows that was 1.7e-5 of a weight."""
    case, (name, profile) = hung(seed), spec.split(":")
    engine = engines.load(name).prepare(case, profile)
    truth, run = engines.load("reference").prepare(case, "compiled").run(), engine.run()
    assert truth.outcome == Outcome.FINISHED
    assert run.outcome == Outcome.FINISHED
    assert float(np.ptp(truth.q, axis=0).max()) < 1e-6
    off = metrics.of(case)["law_residual"].measure(from_run(truth, Tier.C, "the reference"), run, case)
    assert off is not None
    assert off <= LIMIT
    assert list(misacting(case, engine.settings, run)) == []
