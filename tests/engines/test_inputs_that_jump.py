"""Inputs that jump open and close rows at their instants: modes and events of every engine tell the same story."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import CaseUnsupported, EngineUnavailable
from crossbody.engines._formed import form_of
from crossbody.reports import metrics
from crossbody.reports.measuring.truth import from_run

ARM = """<mujoco><compiler angle="radian"/><option timestep="1e-3" gravity="0 0 0"/><worldbody>
<body name="upper"><joint name="shoulder" axis="0 1 0" limited="true" range="-.05 .05" damping=".5"/>
<geom type="capsule" size=".02" fromto="0 0 0 0 0 -.4" mass="1"/>
<body name="lower" pos="0 0 -.4"><joint name="elbow" axis="0 1 0" limited="true" range="-.05 .05" damping=".5"/>
<geom type="capsule" size=".02" fromto="0 0 0 0 0 -.4" mass="1"/></body></body></worldbody>
<actuator><motor name="s" joint="shoulder"/><motor name="e" joint="elbow"/></actuator></mujoco>"""


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", engines.names())
def test_every_mode_is_left_by_an_event(name: str, seed: int, tmp_path: Path) -> None:
    file, table, rng = tmp_path / "arm.xml", tmp_path / "u.csv", np.random.default_rng(seed)
    file.write_text(ARM, encoding="utf-8")
    times = np.arange(0.0, 0.5, 0.02)
    pushed = np.column_stack([times, rng.uniform(-20.0, 20.0, size=(len(times), 2))])
    np.savetxt(table, pushed, delimiter=",", header="t,s,e", comments="")
    case = cases.load(str(file), ctrl=str(table), t_end=0.5)
    try:
        engine = engines.load(name)
    except EngineUnavailable as error:
        pytest.skip(str(error))
    for profile in engine.profiles:
        try:
            run = engine.prepare(case, profile).run()
        except CaseUnsupported:
            continue
        assert run.outcome.ok, profile
        truth = from_run(run, cases.Tier.D, "itself")
        assert metrics.load("mode_residual").measure(truth, run, case) in (None, 0.0), profile
        if (run.mode >= 0).all() and run.events:
            assert len(run.events) > 4, profile


@pytest.mark.parametrize(("name", "profile"), [("mujoco", "matched"), ("mujoco", "default"), ("pinocchio", "law")])
def test_no_step_crosses_an_instant_at_which_a_force_is_not_smooth(name: str, profile: str) -> None:
    """Across it a method has order 2 at most, which the errors of such a motion do not tell from its own."""
    case = cases.load("soft_contact", close_start=0.10037, close_end=0.70071, t_end=0.8)
    form = form_of(case)
    assert form is not None
    assert form.case.force is not None
    kinks = form.case.force.breaks
    assert len(kinks) == 2
    assert np.isin(kinks, engines.load(name).prepare(case, profile).run().t).all()
