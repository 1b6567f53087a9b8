"""Feet of one body that turns cannot all stick: of sets of modes only one that all rows meet is a motion, if one is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from friction_scenes import PLANAR, pair
from mode_enumeration import Contact, enumerated

from crossbody import cases
from crossbody.cases import Mode, Outcome
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, RowLaw, Scene, Shape
from crossbody.reference import simulate
from crossbody.reference.sundials.equations import Equations
from crossbody.reference.sundials.sliding import Sliding
from crossbody.reference.tree.system import system

LADDER = """<mujoco><option cone="elliptic"/><worldbody>
  <geom name="floor" type="plane" size="5 5 .1" friction=".6 0 0"/>
  <geom name="wall" type="plane" size="5 5 .1" quat="0.70710678 0 0.70710678 0" friction=".3 0 0"/>
  <body name="rod" pos=".45 0 .65" euler="0 -30 0"><freejoint/>
    <geom name="rod" type="capsule" size=".05 .7" mass="1" friction=".3 0 0"/></body>
</worldbody></mujoco>"""
"""A rod slides down a wall, and up again while its foot sticks, as its top still returns to its law."""
RTOL, MOVES = 1e-9, 200.0
TURNS, FOOT, TOP = 0.1442766, 0, 3  # s, at which the slip of its top passes zero; rows


@pytest.fixture(scope="module")
def ladder(tmp_path_factory: pytest.TempPathFactory) -> cases.Case:
    path: Path = tmp_path_factory.mktemp("ladder") / "ladder.xml"
    path.write_text(LADDER)
    return cases.from_file(str(path), friction=1)


def test_one_set_alone_is_met_where_the_top_of_a_ladder_turns_round(ladder: cases.Case) -> None:
    made = system(ladder.scene, ladder.law)
    found = simulate(made, ladder.q0, ladder.v0, TURNS, rtol=1e-11)
    rows = Sliding(made, Equations(made), 1e-11)
    seen = rows.see(float(found.t[-1]), found.q[-1].copy(), found.v[-1].copy(), [FOOT, TOP])
    contacts = [Contact(seen.at[i], [seen.at[k] for k in rows.ways[i]], float(rows.mu[i])) for i in (FOOT, TOP)]
    agree = {one.modes for one in enumerated(seen.G, seen.bare, contacts) if one.margin > 0.0}
    assert agree == {("stick", "slip")}


@pytest.mark.parametrize(
    ("solver", "rtol"), [("compiled", 1e-6), ("compiled", 1e-9), ("compiled", 1e-11), ("cvode", 1e-9), ("cvode", 1e-10)]
)
def test_the_top_of_a_ladder_turns_round_without_a_stop(ladder: cases.Case, solver: str, rtol: float) -> None:
    made = system(ladder.scene, ladder.law)
    found = simulate(made, ladder.q0, ladder.v0, 0.2, rtol=rtol, solver=solver)
    assert found.outcome is Outcome.FINISHED, found.message
    assert not [e for e in found.events if e.t > TURNS - 1e-3 and e.before != e.after]
    assert found.unique_until == np.inf
    assert (int(found.mode[-1, FOOT]), int(found.mode[-1, TOP])) == (Mode.STICK, Mode.SLIP)


def cornered(seed: int) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Draw a box that moves in the plane and falls into the corner of a floor and a wall."""
    rng = np.random.default_rng([seed, 41])
    law = RowLaw(a0=10.0 ** rng.uniform(3, 5), a1=10.0 ** rng.uniform(0.7, 2.6))
    angle, (long, high) = rng.uniform(0.1, 1.4), (0.15, 0.1)
    upright = (float(np.cos(np.pi / 4)), 0.0, float(np.sin(np.pi / 4)), 0.0)
    shapes = (
        Shape(name="floor", type="plane"), Shape(name="wall", type="plane", orientation=upright),
        Shape(name="box", body="box", type="box", size=(long, 0.12, high)),
    )  # fmt: skip
    frictions = rng.uniform(0.2, 1.5, size=2).tolist()
    pairs = tuple(pair(name, "box", mu, law) for name, mu in zip(("floor", "wall"), frictions, strict=True))
    joints = tuple(Joint(name=name, body="box", type=kind, axis=axis) for name, axis, kind in PLANAR)
    scene = Scene(
        bodies=(Body(name="box", mass=1.0, inertia=(0.008, 0.01, 0.012, 0, 0, 0)),), joints=joints, shapes=shapes,
        pairs=pairs,
    )  # fmt: skip
    wide, tall = long * np.cos(angle) + high * np.sin(angle), long * np.sin(angle) + high * np.cos(angle)
    return scene, np.array([wide + 0.01, tall + 0.01, angle]), rng.normal(size=3) * rng.choice([0.0, 0.5, 2.0])


@pytest.mark.parametrize("seed", range(60))
def test_what_sticks_does_not_move(seed: int) -> None:
    """Nor does it where a box comes to rest between a floor and a wall, and its feet contradict each other slightly."""
    scene, q, v = cornered(seed)
    made = system(scene, case_of(scene).law, q)
    found = simulate(made, q, v, 0.4, rtol=RTOL, samples=np.linspace(0.0, 0.4, 400))
    assert found.outcome in (Outcome.FINISHED, Outcome.PAINLEVE), found.message
    rates = np.array([made.gap(*state)[1] for state in zip(found.q, found.v, strict=True)])
    for row, own in enumerate(np.asarray(made.follows).tolist()):
        if own >= 0 and own != row:
            sticks = found.mode[:, own] == Mode.STICK
            assert np.abs(rates[sticks, row]).max(initial=0.0) <= MOVES * RTOL * max(1.0, np.abs(found.v).max())


ARM = """<mujoco><compiler angle="radian"/><default><geom friction="{mu} 0 0" solref=".01 .5" solimp=".9 .9 .001"/>
  <joint axis="0 1 0" limited="true" solreflimit=".01 .5" solimplimit=".9 .9 .001"/></default><worldbody>
  <geom name="floor" type="plane" size="5 5 1"/>
  <body name="upper" pos="0 0 .5"><joint name="a" frictionloss="{dry[0]}" range="-2 .9"/>
    <geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03" contype="0" conaffinity="0" mass="1"/>
    <body name="lower" pos="0 0 -.3"><joint name="b" frictionloss="{dry[1]}" range="-.8 2"/>
      <geom type="capsule" fromto="0 0 0 0 0 -.25" size=".03" contype="0" conaffinity="0" mass=".6"/>
      <geom name="tip" type="sphere" pos="0 0 -.25" size=".04" mass=".2"/></body></body></worldbody>
  <tendon><fixed name="t" frictionloss="{dry[2]}">
    <joint joint="a" coef="1"/><joint joint="b" coef="{coef}"/></fixed></tendon>
  <actuator><motor name="m" joint="a"/><motor name="n" joint="b"/></actuator></mujoco>"""
"""An arm of two dry hinges and a dry tendon whose tip, where it sticks to the floor, leaves it no freedom."""
PUSHED, BRIEF = 0.16, 1e-5  # s: each pair of torques, and a stick that only a jump of these may end


WEDGED = (19, 155, 198)
"""Arms whose tip sticks where their limit and the floor move it towards where it jams."""


def pushed(seed: int, tmp_path: Path, solver: str = "compiled", rtol: float = 1e-10) -> cases.Trajectory:
    """Run a drawn arm under torques that jump."""
    rng = np.random.default_rng([seed, 43])
    dry = [float(rng.choice(sizes)) for sizes in ([0.1, 1.0], [0.1, 1.0], [0.0, 0.3])]
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(mu=rng.choice([0.3, 0.7]), dry=dry, coef=rng.uniform(-1, 1)))
    case = cases.from_file(str(path), friction=1)
    made = system(case.scene, case.law, np.array([0.5, 0.3]))
    inputs = (PUSHED * np.arange(4), 3.0 * rng.normal(size=(4, 2)))
    start = np.array([0.5, 0.3]), 3.0 * rng.normal(size=2)
    return simulate(made, *start, 0.5, rtol=rtol, inputs=inputs, solver=solver)


@pytest.mark.parametrize("seed", range(40))
def test_dry_joints_that_a_contact_moves_turn_round_at_once(seed: int, tmp_path: Path) -> None:
    """What prescribes a motion takes a dry joint through zero: it has no time to stick."""
    found = pushed(seed, tmp_path)
    assert found.outcome in (Outcome.FINISHED, Outcome.PAINLEVE), found.message
    sticks: dict[int, float] = {}
    for event in found.events:
        if event.after is Mode.STICK:
            sticks[event.contact] = event.t
        elif event.before is Mode.STICK and event.t not in PUSHED * np.arange(4) and event.t < found.t[-1]:
            assert event.t - sticks.get(event.contact, -np.inf) > BRIEF, event


@pytest.mark.parametrize(
    "first", [40, pytest.param(160, marks=pytest.mark.slow), pytest.param(280, marks=pytest.mark.slow)]
)
def test_no_arm_switches_for_ever(first: int, tmp_path: Path) -> None:
    """Nor does one where the floor, a limit and its dry joints contradict each other: it goes on, or it jams."""
    for seed in range(first, first + 120):
        found = pushed(seed, tmp_path)
        assert found.outcome in (Outcome.FINISHED, Outcome.PAINLEVE), (seed, found.message)


@pytest.mark.parametrize("seed", WEDGED)
def test_a_tip_that_is_wedged_jams_where_the_second_machine_says_so(seed: int, tmp_path: Path) -> None:
    found, other = pushed(seed, tmp_path, rtol=1e-9), pushed(seed, tmp_path, "cvode", 1e-9)
    assert found.outcome is other.outcome is Outcome.PAINLEVE
    assert found.t[-1] == pytest.approx(other.t[-1], abs=1e-8)
    assert "sticks_contradict" not in found.message
