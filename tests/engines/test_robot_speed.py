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
import pinocchio as pin
import pytest
from places import ROBOTS

from crossbody import cases, engines
from crossbody.cases import Case
from crossbody.cases.files.warned import captured
from crossbody.cases.rotations import differences
from crossbody.engines.mujoco._model import matched
from crossbody.engines.pinocchio._coordinates import Coordinates
from crossbody.engines.pinocchio._model import tree
from crossbody.reference.tree import layout

pytestmark = pytest.mark.bench
WANTED = 1e-9
ROBOT = {
    "franka_emika_panda/panda": 20.0, "universal_robots_ur5e/ur5e": 20.0, "unitree_go1/go1": 20.0,
    "agility_cassie/cassie": 3.0,
}  # fmt: skip
"""The least ratio."""


def cpu(call: Callable[[], object]) -> float:
    began = time.process_time()
    call()
    return time.process_time() - began


def thrown(name: str) -> Case:
    """A robot in the air without actuators and bounds; a biped falls with its loops, the others are thrown."""
    path = ROBOTS / f"{name}.xml"
    if not path.is_file():
        pytest.skip(f"The robot's file {path} is not here.")
    case = cases.load(str(path), t_end=2.0, without="friction,contacts,limits,actuators", assemble=True)
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


def lean(case: Case, profile: str, rtol: float) -> Any:
    """A run that records its end alone; the compiled one by code that is traced for the model."""
    traced = {"traced": "yes"} if profile == "compiled" else {}
    run = engines.load("reference").prepare(case, profile, rtol=rtol, samples=[case.t_end], ledger=False, **traced)
    assert not traced or run.inner.system.p[layout.TRACED] > 0.0
    return run


@pytest.mark.parametrize("name", list(ROBOT))
def test_a_robot_moves_faster_than_in_mujoco_at_the_same_error(name: str) -> None:
    case, reference = thrown(name), engines.load("reference")
    truth = reference.prepare(case, "compiled", rtol=1e-12).run()
    assert truth.outcome.ok

    def off(q: Any) -> float:
        return float(differences(q[None], truth.q[-1:], case.quaternions).max())

    tolerances = 10.0 ** -np.arange(5.0, 12.0, 0.25)
    prepared = (lean(case, "compiled", float(rtol)) for rtol in tolerances)
    ours = min((run for run in prepared if off(run.run().q[-1]) <= WANTED), key=lambda run: cpu(run.inner.go))
    theirs = native(case)
    rungs = (round(case.t_end / 4e-3 * 2.0 ** (k / 4)) for k in range(28))
    steps = next((steps for steps in rungs if off(theirs(steps)) <= WANTED), 0)
    assert steps, "MuJoCo does not reach the error."
    ratio = float(np.median([cpu(lambda: theirs(steps)) / cpu(ours.inner.go) for _ in range(7)]))
    print(f"\n{name}: {ratio:.1f} times as fast as MuJoCo in {steps} steps; rtol {ours.settings['rtol']:.1g}")
    assert ratio >= ROBOT[name]


@pytest.mark.parametrize("name", ["universal_robots_ur5e/ur5e", "unitree_go1/go1"])
def test_aba_alone_under_cvode_takes_less_than_ten_of_our_runs(name: str) -> None:
    """What Pinocchio under a compiled CVODE would take lies between two figures.

    From below its `aba` at every right-hand side of CVODE, and nothing else; from above beside it all that our own
    CVODE takes, with its equations and its calls from Python. The robots are those without rows, where `aba` is all.
    """
    case, reference = thrown(name), engines.load("reference")
    truth = reference.prepare(case, "compiled", rtol=1e-12).run()
    pairs = []
    for profile in ("compiled", "cvode"):
        prepared = (lean(case, profile, float(rtol)) for rtol in 10.0 ** -np.arange(5.0, 13.0, 0.25))
        pairs.append(next(
            (one, run) for one in prepared
            if differences((run := one.run()).q[-1:], truth.q[-1:], case.quaternions).max() <= WANTED
        ))  # fmt: skip
    (ours, _), (cvode, with_cvode) = pairs
    scene, count = case.scene, with_cvode.counts["rhs"]
    assert scene is not None
    model, to = tree(scene)[0], Coordinates(scene)
    data, q, tau = model.createData(), to.theirs(case.q0), np.zeros(scene.nv)
    v = to.back(q, case.v0)

    def dynamics() -> None:
        for _ in range(count):
            pin.aba(model, data, q, v, tau)

    taken = [(cpu(ours.inner.go), cpu(dynamics), cpu(cvode.run)) for _ in range(5)]
    own, aba, whole = np.median(taken, axis=0)
    print(f"\n{name}: {count} right-hand sides of CVODE; aba alone takes {aba / own:.1f} of our runs, "
          f"beside our CVODE {(aba + whole) / own:.1f}")  # fmt: skip
    assert aba / own < 10.0
