"""Rows that carry nothing: their multipliers are noise, and noise is no error; what carries little is judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import Case
from crossbody.cases.scene import Body, Joint, Loop, Scene
from crossbody.reports import metrics
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.verdict import Word
from crossbody.reports.runs import jobs, study
from crossbody.reports.runs.choice import Pick

FORCES = ("lam_error", "lam_impulse", "lam_impulse_path", "law_residual")


def falling(seed: int, lighter: float = 0.0) -> Case:
    """Two bodies that fall along tilted rails and are held beside each other, which needs no force but for damping."""
    rng = np.random.default_rng(seed)
    masses, tilt = 10.0 ** rng.uniform(-1.0, 1.0, 2), float(rng.uniform(0.0, 1.2))
    axis = (float(np.sin(tilt)), 0.0, float(np.cos(tilt)))
    bodies = tuple(Body(name=name, mass=float(mass), com=(0.0,) * 3, inertia=(1e-2,) * 3 + (0.0,) * 3)
                   for name, mass in zip("ab", masses, strict=True))  # fmt: skip
    drag = (lighter, 0.0)
    joints = tuple(Joint(name=f"rail {name}", body=name, type="slide", axis=axis, damping=(d, 0.0, 0.0))
                   for name, d in zip("ab", drag, strict=True))  # fmt: skip
    held = Loop(name="held", type="joint", first="rail a", second="rail b", polynomial=(0.0, 1.0, 0.0, 0.0, 0.0))
    scene = Scene(bodies=bodies, joints=joints, loops=(held,), gravity=(0.0, 0.0, -9.81))
    return cases.from_scene(scene, v0=[0.3, 0.3], t_end=0.5)


@pytest.mark.parametrize("seed", range(3))
def test_noise_of_rows_that_hold_nothing_is_within(seed: int) -> None:
    case = falling(seed)
    picks = [Pick(engine="reference", profile=name) for name in ("compiled", "cvode", "ida")]
    result = jobs.run_case(case, picks, refine=False)
    rows = study.judge([result], {case.label: "again"})
    assert not [(row["profile"], row["metric"], row["value"]) for row in rows if row["verdict"] == Word.OUTSIDE]
    assert any(row["metric"] in FORCES for row in rows)


@pytest.mark.parametrize("lighter", [1e-1, 1e-4])
def test_twice_the_force_is_seen_where_it_is_little(lighter: float) -> None:
    case = falling(0, lighter)
    truth = truth_of(case)
    run = truth.trajectory
    doubled = replace(run, lam=2.0 * run.lam)
    sizes = {name: [metrics.load(name).measure(truth, one, case) for one in (run, doubled)] for name in FORCES}
    told = {name: pair for name, pair in sizes.items() if None not in pair}
    assert set(told) >= {"lam_impulse_path", "law_residual"}, sizes
    for name, (right, value) in told.items():
        assert value > 1e-5 > 100.0 * right, name
