"""Motions of published robots to 1e-9 against MuJoCo's own loop, in one process: `make bench` prints and judges them.

MuJoCo gets the cheapest run that is as accurate: Runge-Kutta 4 by `mj_step(nstep)`, without record or events, steps in
the ratio 2^(1/4); the reference runs without record or energy account too, with the code of its sweeps traced for the
model (compiled once before). Both times are of the processor, in turns.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest
from places import ROBOTS

from crossbody import cases, engines
from crossbody.cases import Case
from crossbody.cases.files.warned import captured
from crossbody.cases.rotations import differences
from crossbody.engines.mujoco.scene import matched

pytestmark = pytest.mark.bench
WANTED = 1e-9
ROBOT = {
    "franka_emika_panda/panda": (2.0, 12.0), "universal_robots_ur5e/ur5e": (2.0, 15.0), "unitree_go1/go1": (2.0, 12.0),
    "agility_cassie/cassie": (0.5, 4.0),
}  # fmt: skip
"""Horizon, s, and the least ratio."""


def cpu(call: Callable[[], object]) -> float:
    began = time.process_time()
    call()
    return time.process_time() - began


def thrown(name: str) -> Case:
    """A robot in the air without actuators and bounds; a biped falls with its loops, the others are thrown."""
    path = ROBOTS / f"{name}.xml"
    if not path.is_file():
        pytest.skip(f"The robot's file {path} is not here.")
    case = cases.load(str(path), t_end=ROBOT[name][0], without="friction,contacts,limits,actuators", assemble=True)
    v0 = 0.5 * np.random.default_rng(0).normal(size=len(case.v0))
    if "panda" in name:
        v0[-2:] = 0.02  # its fingers move alike
    return case if "cassie" in name else replace(case, v0=v0)


def native(case: Case) -> Callable[[int], Any]:
    """MuJoCo's own loop: number of steps -> the positions at the end."""
    assert case.scene is not None
    model = matched(case.scene)
    data = mujoco.MjData(model)

    def run(steps: int) -> Any:
        model.opt.timestep = case.t_end / steps
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = case.q0, case.v0
        with captured():  # a step too long ends in warnings
            mujoco.mj_step(model, data, nstep=steps)
        return data.qpos

    return run


@pytest.mark.parametrize("name", list(ROBOT))
def test_a_robot_moves_faster_than_in_mujoco_at_the_same_error(name: str) -> None:
    case, reference = thrown(name), engines.load("reference")
    truth = reference.prepare(case, "compiled", rtol=1e-12).run()
    assert truth.outcome.ok

    def off(q: Any) -> float:
        return float(differences(q[None], truth.q[-1:], case.quaternions).max())

    tolerances = 10.0 ** -np.arange(5.0, 12.0, 0.25)
    prepared = (
        reference.prepare(case, "compiled", rtol=float(rtol), samples=[case.t_end], ledger=False) for rtol in tolerances
    )
    ours = next(run for run in prepared if off(run.run().q[-1]) <= WANTED)
    theirs = native(case)
    rungs = (round(case.t_end / 4e-3 * 2.0 ** (k / 4)) for k in range(28))
    steps = next((steps for steps in rungs if off(theirs(steps)) <= WANTED), 0)
    assert steps, "MuJoCo does not reach the error."
    ratio = float(np.median([cpu(lambda: theirs(steps)) / cpu(ours.inner.go) for _ in range(7)]))
    print(f"\n{name}: {ratio:.1f} times as fast as MuJoCo in {steps} steps; rtol {ours.settings['rtol']:.1g}")
    assert ratio >= ROBOT[name][1]
