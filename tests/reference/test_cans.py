"""Cylinders on a floor: standing on a cap, coming down on it, rocking and rolling on its rim, lying on the side."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from resting import FLOOR, LAW, apart, quaternion, run

from crossbody import cases, engines
from crossbody.cases import Case, Outcome, Trajectory
from crossbody.cases.scene import Body, Joint, Pair, Scene, Shape
from crossbody.cases.scene_contacts import LEVEL

RADIUS, HALF, WEIGHT = 0.05, 0.08, 9.81


def can(
    turn: Any = (0.0, 0.0, 0.0), *, height: float = 0.0, com: Any = (0.0, 0.0, 0.0), v: Any = None, t_end: float = 0.2,
    inertia: Any = (0.004, 0.005, 0.00125),
) -> Case:  # fmt: skip
    """Return a cylinder of 1 kg over a floor.

    Args:
        turn: its rotation vector.
        height: of its lowest point, m.
        com: its centre of mass, m.
        v: its velocities at the start.
        t_end: horizon, s.
        inertia: about its axes, kg m^2.
    """
    shape = Shape(name="can", body="can", type="cylinder", size=(RADIUS, HALF, 0.0))
    body = Body(name="can", mass=1.0, com=tuple(com), inertia=(*inertia, 0.0, 0.0, 0.0))
    scene = Scene(
        bodies=(body,), joints=(Joint(name="free", body="can", type="free"),), shapes=(FLOOR, shape),
        pairs=(Pair(name="can", first="floor", second="can", law=LAW),),
    )  # fmt: skip
    q = quaternion(turn)
    across = 2.0 * np.hypot(q[1] * q[3] + q[0] * q[2], q[2] * q[3] - q[0] * q[1])
    low = HALF * abs(1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2)) + RADIUS * across
    return cases.from_scene(scene, q0=[0.0, 0.0, height + low, *q], v0=v, t_end=t_end)


@pytest.mark.parametrize("profile", ["compiled", "cvode", "ida"])
@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (np.pi, 0.0, 0.0)], ids=["upright", "upside down"])
def test_a_can_stands_on_either_cap(turn: Any, profile: str) -> None:
    stands = run(can(turn, t_end=10.0 if profile == "compiled" else 0.5), profile, rtol=1e-10)
    assert np.abs(stands.q - stands.q[0]).max() <= 1e-12
    assert stands.lam[-1] == pytest.approx(np.full(4, WEIGHT / 4.0), rel=1e-6)
    assert stands.counts["redundant"] == 1


def test_a_can_lies_on_its_side() -> None:
    """On the lowest points of its caps, which share the weight as their levers have it."""
    lies = run(can((0.5 * np.pi, 0.0, 0.0), com=(0.0, 0.0, 0.02)), rtol=1e-10)
    assert np.abs(lies.q - lies.q[0]).max() <= 1e-9
    assert lies.lam[-1, [0, 2]] == pytest.approx([WEIGHT * 0.375, WEIGHT * 0.625], rel=1e-6)
    assert np.abs(lies.lam[-1, [1, 3]]).max() == 0.0


MOTIONS: dict[str, dict[str, Any]] = {
    "lands flat": dict(height=5e-3, com=(0.01, 0.0, 0.0)),
    "set down": dict(turn=(1e-3, 0.0, 0.0), height=1e-3),
    "set down tilted": dict(turn=(0.1, 0.0, 0.0)),
    "rolls on its rim": dict(turn=(0.06, 0.03, 0.2), v=[0.0, 0.0, 0.0, 0.3, 0.0, 1.0], t_end=0.1),
    "falls on its rim": dict(turn=(0.0, 1.0, 0.0), height=1e-2),
    "spins on its cap": dict(v=[0.0, 0.0, 0.0, 0.0, 0.0, 3.0]),
}


@pytest.mark.parametrize("motion", MOTIONS)
def test_cans_move_alike_in_two_solvers_and_their_account_closes(motion: str) -> None:
    case = can(**MOTIONS[motion])
    ours = run(case, rtol=1e-10)
    assert apart(case, ours, run(case, "cvode", rtol=1e-10)) <= 1e-8
    assert ours.ledger is not None
    open_ = ours.total_energy - ours.ledger.contact.sum(axis=1)
    assert np.abs(open_ - open_[0]).max() <= 1e-8 * np.abs(ours.energy).max()


@pytest.mark.parametrize("motion", [pytest.param(name, marks=pytest.mark.slow) for name in MOTIONS])
def test_pinocchio_moves_cans_alike(motion: str) -> None:
    """Its points of the rim are others: where a can rocks through level they differ by the tilt that counts as none."""
    case = can(**MOTIONS[motion] | {"t_end": 0.08})
    assert apart(case, run(case, rtol=1e-10), run(case, "law", "pinocchio", rtol=1e-10)) <= LEVEL


def test_mujoco_stands_a_can_alike() -> None:
    case = can(t_end=0.02)
    assert apart(case, run(case, rtol=1e-10), run(case, "matched", "mujoco", dt=1e-4)) <= 1e-5


def tilts(found: Trajectory) -> np.ndarray:
    """Return twice the sine of half its tilt at every row."""
    return 2.0 * np.linalg.norm(found.q[:, 4:6], axis=1)


@pytest.mark.parametrize("tilt", [1e-3, 1e-1])
def test_a_can_that_is_set_down_comes_to_rest(tilt: float) -> None:
    """It rocks from side to side in a plane; the law takes energy at every touch."""
    found = run(can((tilt, 0.0, 0.0), t_end=1.5), rtol=1e-9)
    assert tilts(found).max() <= 2.0 * tilt
    assert tilts(found)[found.t > 1.2].max() <= 1e-4 * tilt
    assert found.total_energy[-1] < found.total_energy[0]
    assert found.lam[-1].sum() == pytest.approx(WEIGHT, rel=1e-3)


def test_passing_through_level_in_a_plane_changes_no_gap() -> None:
    """The points of the rim count from the lowest one: that one, and the opposite one, stay what they were."""
    found = run(can((0.01, 0.0, 0.0)), rtol=1e-11)
    passed = [switch for switch in found.switches if switch.t > 0.0]
    assert len(passed) >= 2
    for switch in passed:
        before, after = (found.gap[np.flatnonzero(found.t == switch.t)[k]] for k in (0, -1))
        assert min(before) == pytest.approx(min(after), abs=1e-15)


@pytest.mark.parametrize("profile", ["compiled", "cvode"])
def test_rolling_through_level_is_ill_posed(profile: str) -> None:
    """By 1e-5 to one side it goes on, and turned round; at 1e-7 rigid rows do not say to which side."""
    for across, outcome in ((1e-5, Outcome.FINISHED), (1e-7, Outcome.ILL_POSED)):
        case = can((1e-2, 0.0, 0.0), v=[0.0, 0.0, 0.0, -0.3, 30.0 * across, 0.0], t_end=0.03)
        found = engines.load("reference").prepare(case, profile, rtol=1e-10).run()
        assert found.outcome is outcome, found.message
    assert "rolls on its rim" in found.message


def test_the_can_that_rolls_through_level_is_found_among_others() -> None:
    """Rows and variables count on from those of the shapes before it: of a ball, a box, and a can that stands."""
    alone = can((1e-2, 0.0, 0.0), v=[0.0, 0.0, 0.0, -0.3, 3e-6, 0.0], t_end=0.03)
    scene = alone.scene
    assert scene is not None
    sizes = {"sphere": (0.03, 0.0, 0.0), "box": (0.03, 0.04, 0.05), "cylinder": (RADIUS, HALF, 0.0)}
    low = {"sphere": 0.03, "box": 0.05, "cylinder": HALF}
    bodies = tuple(Body(name=kind, mass=1.0, inertia=(0.01, 0.01, 0.01, 0.0, 0.0, 0.0)) for kind in sizes)
    case = cases.from_scene(
        scene.replace(
            bodies=(*bodies, *scene.bodies),
            joints=(*(Joint(name=f"free {kind}", body=kind, type="free") for kind in sizes), *scene.joints),
            shapes=(*scene.shapes, *(Shape(name=k, body=k, type=k, size=size) for k, size in sizes.items())),
            pairs=(*(Pair(name=kind, first="floor", second=kind, law=LAW) for kind in sizes), *scene.pairs),
        ),
        q0=np.concatenate([*([1.0 + k, 0.0, low[kind], 1, 0, 0, 0] for k, kind in enumerate(sizes)), alone.q0]),
        v0=np.concatenate([np.zeros(6 * len(sizes)), alone.v0]), t_end=alone.t_end,
    )  # fmt: skip
    found = engines.load("reference").prepare(case, "compiled", rtol=1e-10).run()
    assert found.outcome is Outcome.ILL_POSED, found.message
    assert "Pair 'can' rolls on its rim" in found.message
