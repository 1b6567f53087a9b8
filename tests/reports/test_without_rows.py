"""What has no rows is judged as anything else: no metric crashes, and none of forces has a number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases.splines import straight
from crossbody.reports import metrics
from crossbody.reports.judging.truth import truth_of

ARM = """<mujoco><option integrator="{}"/><worldbody><body name="arm" pos="0 0 1"><joint name="j" axis="0 1 0"/>
<geom type="capsule" size=".03" fromto="0 0 0 0 0 -.4" mass="1"/></body></worldbody>
<keyframe><key name="up" qpos="1"/></keyframe></mujoco>"""


@pytest.mark.parametrize("who", ["reference:compiled", "mujoco:as_is", "mujoco:matched", "pinocchio:law"])
@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "RK4"])
def test_no_metric_crashes(who: str, integrator: str, tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(ARM.format(integrator))
    case = cases.from_file(str(tmp_path / "arm.xml"), key="up", t_end=0.2)
    run = engines.load(who.split(":")[0]).prepare(case, who.split(":")[1]).run()
    truth = truth_of(case)
    found = {name: metric.measure(truth, run, case) for name, metric in metrics.of(case).items()}
    assert found["position"] is not None
    assert found["lam_impulse"] is None
    assert found["lam_impulse_path"] is None


def test_straight_lines_through_no_columns_have_none() -> None:
    assert straight(np.arange(3.0), np.zeros((3, 0)), np.array([0.5, 1.5])).shape == (2, 0)
