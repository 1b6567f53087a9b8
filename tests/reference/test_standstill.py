"""A force that grows without bound holds a run at one instant: switches there lead nowhere, and it ends painleve."""

from __future__ import annotations

from pathlib import Path

import pytest

from crossbody import cases, engines
from crossbody.cases import Outcome

CAPSULES = """
<mujoco><option timestep="0.001" cone="elliptic"/>
<worldbody>
<geom name="floor" type="plane" size="5 5 .1" friction="2" condim="1" solref="0.005 0.5" euler="15.907
-1.1468 0"/>
<body name="b0"><freejoint/>
<geom type="capsule" size="0.0754 0.0713" mass="1.58" friction="2" condim="3" priority="0" solref="0.02
1.0"/></body>
<body name="b1"><freejoint/>
<geom type="capsule" size="0.0667 0.104" mass="0.521" friction="1" solref="0.05 1.0"/></body>
<body name="b2"><freejoint/>
<geom type="capsule" size="0.0411 0.154" mass="1.61" friction="1" condim="3"/></body>
</worldbody>
<keyframe><key name="k" qpos="0.01292 -0.00072089 0.15 0.70711 0 0.70711 0 -6.9737e-06 -0.022482 0.35 0.66482
-0.24085 0.66482 0.24085 0.0036756 -0.010577 0.55 -0.57739 -0.67241 -0.32241 0.33246" qvel="-0 -0 0 -0 -0 0 0
0 0 -1.6991 -0.046311 0.062494 -0 -0 -0 0 0 -0"/></keyframe></mujoco>
"""
"""Three that fall onto a slope; one slides on another."""
JAM = 0.168262
"""s, to which runs at 1e-7, 1e-8 and 1e-9 agree."""


@pytest.mark.parametrize("rtol", [1e-6, 1e-7])
def test_switches_at_one_instant_end(rtol: float, tmp_path: Path) -> None:
    path = tmp_path / "capsules.xml"
    path.write_text(CAPSULES, encoding="utf-8")
    case = cases.from_file(str(path), friction=1, without="rolling", t_end=0.2)
    run = engines.load("reference").prepare(case, "compiled", rtol=rtol, time_limit=60.0).run()
    assert run.outcome is Outcome.PAINLEVE, run.message
    assert run.t[-1] == pytest.approx(JAM, abs=1e-6)
    assert run.counts["guards"] < 1_000_000
