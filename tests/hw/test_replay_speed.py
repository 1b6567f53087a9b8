"""How much faster than real time a log of the rig is replayed: processor time against the log's own."""

from __future__ import annotations

import time

import pytest

from crossbody import hw

pytest.importorskip("mujoco")
pytestmark = pytest.mark.bench


def test_a_minute_of_the_rig_takes_less_than_a_fiftieth() -> None:
    """60 s at 1136 Hz, as torques through the model and as the reference through model and controller."""
    log = hw.delta_log(hw.delta_plant(t_end=60.0))
    assert len(log) == 68182
    for asked in ({"restart": 0.0}, {"kind": "closed_loop"}):
        hw.replay(log.window(0.0, 1.0), "delta", **asked)  # compiles
        spans = []
        for _ in range(5):  # nothing makes a run faster than it is
            began = time.process_time()
            found = hw.replay(log, "delta", **asked)
            spans.append(time.process_time() - began)
        ratio = 60.0 / min(spans)
        print(f"{asked}: {ratio:.0f} times faster than real time")
        assert found.predictions[0].failed == 0
        assert ratio > 50.0
