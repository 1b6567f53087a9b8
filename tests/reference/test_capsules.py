"""Capsules that lie along each other: two rows where they end, one where they cross, and what changes between."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from resting import LAW, apart, quaternion, run
from scipy.optimize import lsq_linear

from crossbody import cases, engines
from crossbody.cases import Case
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Body, Joint, Pair, Scene, Shape
from crossbody.cases.scene_contacts import SAG
from crossbody.engines._contacts import FAR

ALONG_X = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
RADIUS, HALF, WEIGHT = 0.02, 0.2, 9.81


def rods(
    turn: Any = (0.0, 0.0, 0.0), *, height: float = 0.0, com: float = 0.0, half: float = HALF, v: Any = None,
    t_end: float = 0.2,
) -> Case:  # fmt: skip
    """Return a capsule of 1 kg over a fixed one, both along x.

    Args:
        turn: rotation vector of the upper one.
        height: of its axis above where it lies, m.
        com: place of its centre of mass along its axis, m.
        half: its half length, m.
        v: its velocities at the start.
        t_end: horizon, s.
    """
    low = Shape(name="low", type="capsule", size=(RADIUS, HALF, 0.0), orientation=ALONG_X)
    top = Shape(name="top", body="rod", type="capsule", size=(RADIUS, half, 0.0), orientation=ALONG_X)
    body = Body(name="rod", mass=1.0, com=(com, 0.0, 0.0), inertia=(0.0004, 0.0133, 0.0133, 0.0, 0.0, 0.0))
    scene = Scene(
        bodies=(body,), joints=(Joint(name="free", body="rod", type="free"),), shapes=(low, top),
        pairs=(Pair(name="rods", first="low", second="top", law=LAW),),
    )  # fmt: skip
    return cases.from_scene(scene, q0=[0.0, 0.0, 2.0 * RADIUS + height, *quaternion(turn)], v0=v, t_end=t_end)


@pytest.mark.parametrize("seed", range(12))
def test_axes_that_meet_outside_have_the_gap_of_their_segments(seed: int) -> None:
    """In one plane but at an angle: they cross nowhere, and a foot may lie beyond the other segment's end."""
    draw, s = np.random.default_rng(seed), np.linspace(-1.0, 1.0, 401)
    case = rods((0.0, draw.uniform(-1.3, 1.3), 0.0), height=0.5, half=draw.uniform(0.05, 0.3), t_end=1e-4)
    case = replace(case, q0=[draw.uniform(-0.5, 0.5), *case.q0[1:]])
    seen = [run(case), run(case, "law", "pinocchio")]
    assert case.scene is not None
    turned = matrices(np.array(case.q0[3:])) @ [1.0, 0.0, 0.0]
    low = HALF * s[:, None] * [1.0, 0.0, 0.0]
    top = np.array(case.q0[:3]) + case.scene.shapes[1].size[1] * s[:, None] * turned
    distance = np.linalg.norm(low[:, None] - top, axis=2).min() - 2.0 * RADIUS
    for found in seen:
        assert 0.0 <= distance - found.gap[0].min() + 1e-9 < 1e-4
    assert seen[0].gap[0] == pytest.approx(seen[1].gap[0], abs=1e-12)


@pytest.mark.parametrize("height", [0.6, 0.3], ids=["out of reach", "within reach"])
@pytest.mark.parametrize("spin", [(0.0, 8.0, 0.0), (0.0, 0.0, 8.0), (3.0, 5.0, 4.0)], ids=["T", "cross", "any"])
def test_records_of_capsules_that_turn_tell_their_distance(height: float, spin: Any) -> None:
    """They begin along each other and turn through a T or a cross: in their plane no end is ever the other's."""
    case = rods(height=height, v=[0.0, 0.0, 2.5, *spin], t_end=0.3)
    runs = [run(case), run(case, "cvode"), run(case, "law", "pinocchio"), run(case, "matched", "mujoco", dt=1e-3)]
    assert runs[0].switches[0].after == 2
    for found in runs:
        assert (found.gap[found.t > 0.1, 1] == FAR).all()
        for q, gap in zip(found.q, found.gap, strict=True):
            turned = matrices(q[3:]) @ [1.0, 0.0, 0.0]
            A = np.column_stack([[1.0, 0.0, 0.0], -turned])
            reach = lsq_linear(A, q[:3], (-HALF, HALF), method="bvls")
            assert gap.min() == pytest.approx(np.sqrt(2.0 * reach.cost) - 2.0 * RADIUS, abs=SAG * 2.0 * RADIUS + 1e-12)


def test_a_capsule_rests_on_another_at_both_ends() -> None:
    case = rods(com=0.05)
    for profile in ("compiled", "cvode", "ida"):
        rest = run(case, profile, rtol=1e-10)
        assert rest.lam[-1] == pytest.approx([WEIGHT * (0.5 - 0.125), WEIGHT * (0.5 + 0.125)], rel=1e-6)
        assert np.abs(rest.q - rest.q[0]).max() <= 1e-12


MOTIONS: dict[str, dict[str, Any]] = {
    "lands along": dict(height=5e-3, com=0.03, t_end=0.1),
    "lands tilted": dict(turn=(0.0, 0.01, 0.0), height=5e-3, half=0.15, t_end=0.08),
    "lands almost along": dict(turn=(0.0, 0.0, 1e-3), height=1e-3, com=0.03, t_end=0.018),
    "lands crossed": dict(turn=(0.0, 0.0, 0.3), height=5e-3, com=0.01, t_end=0.08),
    "turns through along": dict(turn=(0.0, 0.0, -0.01), com=0.02, v=[0.0, 0.0, 0.0, 0.0, 0.0, 0.5], t_end=0.04),
}


@pytest.mark.parametrize("motion", MOTIONS)
def test_capsules_move_alike_in_two_solvers(motion: str) -> None:
    case = rods(**MOTIONS[motion])
    assert apart(case, run(case, rtol=1e-10), run(case, "cvode", rtol=1e-10)) <= 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("motion", [name for name in MOTIONS if name != "turns through along"])
def test_pinocchio_moves_capsules_alike(motion: str) -> None:
    case = rods(**MOTIONS[motion])
    theirs = run(case, "law", "pinocchio", rtol=1e-10)
    assert apart(case, run(case, rtol=1e-10), theirs) <= 1e-6


@pytest.mark.slow
def test_pinocchio_locates_how_capsules_lie() -> None:
    """They lie along each other for a tenth of a millisecond, which both find by rules of their own."""
    case = rods(**(MOTIONS["turns through along"] | {"t_end": 0.0202}))
    ours, theirs = run(case, rtol=1e-10), run(case, "law", "pinocchio", rtol=1e-10)
    assert [(e.contact, e.after) for e in ours.events] == [(e.contact, e.after) for e in theirs.events]
    assert len(ours.events) == 5
    assert np.abs([a.t - b.t for a, b in zip(ours.events, theirs.events, strict=True)]).max() <= 1e-9
    assert apart(case, ours, theirs) <= 1e-6


def test_mujoco_lays_a_capsule_along_another_alike() -> None:
    """Where two lie along each other it has a contact at either end; where they touch it is of first order."""
    case = rods(height=1e-3, com=0.03, t_end=0.04)
    theirs = run(case, "matched", "mujoco", dt=1e-4)
    assert apart(case, run(case, rtol=1e-10), theirs) <= 1e-4
    assert (theirs.lam.max(axis=0) > 0.0).all()


def test_turning_through_along_makes_no_energy() -> None:
    """Less than the weight does over what the gap is too large by where rows change."""
    found = run(rods((0.0, 0.0, -0.05), com=0.02, v=[0.0, 0.0, 0.0, 0.0, 0.0, 0.5]), rtol=1e-11)
    assert [switch.after for switch in found.switches if switch.t > 0.0] == [2, 1]
    energy = found.total_energy
    assert np.abs(energy - energy[0]).max() <= WEIGHT * SAG * 2.0 * RADIUS


@pytest.mark.parametrize("sine", [0.0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2])
def test_rows_of_capsules_are_what_they_say_at_any_angle(sine: float) -> None:
    """Gaps, H and H' v by differences, exactly abreast of each other and at random states."""
    from crossbody.reference._check import check_kernels

    system = engines.load("reference").prepare(rods(), "compiled").system
    for seed in range(4):
        rng = np.random.default_rng(seed)
        q = np.array([0.1 * rng.normal() if seed or sine else 0.0, 0.0, 0.05,
                      *quaternion((0.0, 0.3 * sine, sine))])  # fmt: skip
        check_kernels(system, q, rng.normal(size=6), seed=seed)


@pytest.mark.parametrize("height", [0.0, 0.3], ids=["within reach", "out of reach"])
@pytest.mark.parametrize("half", [HALF, 0.1])
def test_capsules_that_start_parallel_are_admitted(height: float, half: float) -> None:
    """Legs of a robot that stands are: which of their places is nearest is no function of their pose."""
    found = run(rods(height=height, half=half, t_end=0.01))
    assert found.switches[0].after == 2


@pytest.mark.parametrize("seed", [0, 5, 13, 16, 17, 18, 19, 21, 26, 27, 31, 33])
def test_capsules_that_lie_along_each_other_but_for_a_trace_are_not_refused(seed: int) -> None:
    """Their rows change within less than any difference resolves: of 60 drawn so 22 were, these among them."""
    rng = np.random.default_rng(seed)
    turn = 10.0 ** -rng.uniform(6.0, 11.0) * rng.normal(size=3)
    height, com = rng.uniform(0.01, 0.3), rng.uniform(-0.02, 0.02)
    case = rods(turn, height=height, com=com, v=rng.normal(size=6), t_end=1e-3)
    assert run(case).outcome.ok
