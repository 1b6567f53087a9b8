"""Motions of published robots by two witnesses that share neither dynamics, nor rows, nor location, nor integrator."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from places import ROBOTS
from published import MJCF

from crossbody import cases, engines
from crossbody.cases import Case, Outcome, Trajectory
from crossbody.cases.rotations import differences

PUSHED = {
    "agility_cassie/cassie": ("left-foot 0 0 60 0 .02", 0.006),
    "franka_emika_panda/panda": ("link5 0 40 0 0 .1", 0.06),
    "robotiq_2f85/2f85": ("left_pad 0 3 0 0 .1", 0.06),
    "unitree_go1/go1": ("FL_calf 5 10 -5 0 .1", 0.2),
    "universal_robots_ur5e/ur5e": ("forearm_link 10 20 0 0 .2", 0.3),
}
"""Robot -> a push that moves it off its rest or fall, and the horizon, s."""


def robot(name: str, **parameters: Any) -> Case:
    path = ROBOTS / f"{name}.xml"
    if not path.is_file():
        pytest.skip(f"The robot's file {path} is not here.")
    return cases.load(str(path), **{"without": "friction,contacts", "assemble": True, **parameters})


def ends(case: Case, rtol: float) -> list[Trajectory]:
    """Both witnesses at the end."""
    runs = []
    for engine, profile in (("reference", "compiled"), ("pinocchio", "law")):
        run = engines.load(engine).prepare(case, profile, rtol=rtol).run()
        assert run.outcome is Outcome.FINISHED, run.message
        runs.append(run)
    return runs


LONG = ("agility_cassie/cassie", "robotiq_2f85/2f85")
"""Robots whose least-norm rows in Python take seconds."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name in LONG else []) for name in PUSHED]
)
def test_both_witnesses_move_a_published_robot_alike(name: str) -> None:
    push, t_end = PUSHED[name]
    case = robot(name, push=push, t_end=t_end)
    ours, theirs = ends(case, 1e-10)
    assert np.abs(ours.q[-1] - ours.q[0]).max() > 1e-3
    assert differences(ours.q[-1:], theirs.q[-1:], case.quaternions).max() <= 1e-8


@pytest.mark.parametrize("name", ["unitree_go1/go1", "agility_cassie/cassie"])
def test_a_floating_robot_closes_its_account_of_energy(name: str) -> None:
    """Energy less the work of loops, inputs and dampers, to 1e-10 of its size; loops stay closed, quaternions long.

    Over 5 s it falls 120 m: what its bodies are to each other must not be told from places in the world.
    """
    t_end = 5.0
    case = robot(name, without="friction,contacts,limits,actuators", t_end=t_end)
    if "go1" in name:
        case = replace(case, v0=0.5 * np.random.default_rng(1).normal(size=len(case.v0)))
    run = engines.load("reference").prepare(case, "compiled", rtol=1e-11, samples=101, time_limit=20.0).run()
    assert run.outcome is Outcome.FINISHED, run.message
    assert run.ledger is not None
    done = run.ledger.contact.sum(axis=1) + run.ledger.input - run.ledger.dissipated
    account = run.total_energy - done
    assert np.abs(account - account[0]).max() <= 1e-10 * np.abs(run.energy).max()
    for at in case.quaternions:
        assert np.abs(np.linalg.norm(run.q[:, at : at + 4], axis=1) - 1.0).max() <= 1e-10
    assert np.abs(run.gap).max(initial=0.0) <= 1e-9


FLOOR = """<mujoco><worldbody><geom name="floor" type="plane" size="9 9 .1"/>
<body name="base" pos="0 0 .7" euler="10 20 0"><freejoint/>
<geom name="trunk" type="box" size=".2 .1 .05" mass="4" contype="0" conaffinity="0"/>
<body name="thigh" pos=".2 0 0"><joint name="hip" axis="0 1 0" damping=".1" stiffness="5"/>
<geom name="thigh" type="capsule" fromto="0 0 0 0 0 -.2" size=".03" mass=".6" contype="0" conaffinity="0"/>
<body name="shank" pos="0 0 -.2"><joint name="knee" axis="0 1 0" damping=".1" stiffness="3" springref=".5"/>
<geom name="shank" type="capsule" fromto="0 0 0 0 0 -.2" size=".02" mass=".3" contype="0" conaffinity="0"/>
<geom name="foot" type="sphere" pos="0 0 -.2" size=".03" mass=".1"/></body></body></body></worldbody>
<default><geom condim="1" solref="-4000 -10" solimp=".9999 .9999"/></default></mujoco>"""


def test_a_robot_meets_the_floor_at_the_same_instant_in_both_witnesses(tmp_path: Path) -> None:
    path = tmp_path / "leg.xml"
    path.write_text(FLOOR, encoding="utf-8")
    case = cases.load(str(path), t_end=0.4)
    ours, theirs = ends(case, 1e-11)
    touches = [[event.t for event in run.events if event.t > 0.0] for run in (ours, theirs)]
    assert len(touches[0]) > 0
    assert touches[0][0] == pytest.approx(touches[1][0], abs=1e-9)


SUITE = {
    "dm_control/pendulum": ([2.0], [0.5]),
    "dm_control/acrobot": ([0.5, -0.4], [1.0, 2.0]),
    "dm_control/cartpole": ([0.1, 0.4], [0.2, 1.0]),
    "dm_control/ball_in_cup": ([0.0, 0.0, 0.05, 0.02], [0.0, 0.0, 0.3, 0.5]),
}
"""File -> a start; the ball of the cup is thrown so that its string, slack at first, goes taut."""


@pytest.mark.parametrize("name", list(SUITE))
def test_both_witnesses_move_the_suite_alike(name: str) -> None:
    if name not in MJCF:
        pytest.skip("dm_control is not installed (extra `robots`).")
    q0, v0 = SUITE[name]
    case = cases.load(str(MJCF[name]), t_end=1.0, without="friction,contacts")
    case = replace(case, q0=np.array(q0), v0=np.array(v0))
    ours, theirs = ends(case, 1e-12)
    assert differences(ours.q[-1:], theirs.q[-1:], case.quaternions).max() <= 1e-10
    if "ball_in_cup" in name:
        assert len(ours.events) >= 1
