"""Controls of runs at none of whose samples all is quiet: they ask nothing there, and end in no fault of ours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.reports.judging.planted_forces import forces
from crossbody.reports.judging.planted_friction import friction, unturned
from crossbody.reports.judging.planting import Plain
from crossbody.reports.measuring.truth import taken

BOX = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1" friction=".4 0 0"/>
<body name="box" pos="0 0 .05"><freejoint name="f"/><geom name="box" type="box" size=".12 .1 .05" mass="1"
friction=".4 0 0"/></body></worldbody>
<keyframe><key name="go" qpos="0 0 .05 1 0 0 0" qvel="1 .3 0 0 0 .5"/></keyframe></mujoco>"""


@pytest.mark.parametrize("count", [1, 2, 3, 40])
def test_a_box_that_slides_and_turns_on_a_floor(count: int, tmp_path: Path) -> None:
    (tmp_path / "box.xml").write_text(BOX)
    case = cases.from_file(str(tmp_path / "box.xml"), key="go", t_end=0.3, friction=1)
    run = taken(engines.load("reference").prepare(case, "compiled").run(), np.arange(count))
    plain = Plain(case, run)
    assert bool(len(plain.quiet)) == (count > 2)
    assert all(len(control.run.t) for control in (*friction(plain), *forces(plain)))
    assert unturned(case, run) in (True, False)
