"""Joints that rest on their bounds are in contact from the start in every engine, however little presses them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from crossbody import engines
from crossbody.cases import Case, Event, Mode, Tier, Trajectory
from crossbody.cases.contacts import contacts
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Actuator, Body, Joint, Loop, Scene
from crossbody.engines.mujoco import _switched
from crossbody.reports import metrics
from crossbody.reports.measuring.truth import from_run

ENGINES = (("reference", "compiled"), ("reference", "cvode"), ("mujoco", "matched"), ("pinocchio", "law"))
LEAST, MOST = -9.0, 0.0
"""Powers of ten of the loads, N or N m."""
STILL = 1e-10


def pressed(seed: int, *, coupled: bool = False, unloaded: bool = False) -> tuple[Case, list[float]]:
    """Return a chain without gravity, each joint held to one of its bounds by an actuator, and the loads.

    Args:
        seed: of the chain.
        coupled: whether a loop joins the first two, so that one bound is enough to hold both.
        unloaded: whether nothing presses the last.
    """
    rng = np.random.default_rng(seed)
    bodies, joints, actuators = [], [], []
    loads = (10.0 ** rng.uniform(LEAST, MOST, 3)).tolist()
    upper = [True, True, bool(rng.random() < 0.5)] if coupled else (rng.random(3) < 0.5).tolist()
    start = np.repeat(rng.uniform(-1.0, 1.0), 3) if coupled else rng.uniform(-1.0, 1.0, 3)
    if unloaded:
        loads[2] = 0.0
    for i, (high, at) in enumerate(zip(upper, start.tolist(), strict=True)):
        size = rng.uniform(0.2, 0.4, 3)
        bodies.append(Body(
            name=f"body {i}", parent=f"body {i - 1}" if i and not coupled else "", position=tuple(rng.normal(size=3)),
            mass=float(rng.uniform(0.1, 3.0)), com=tuple(rng.normal(size=3) * 0.2), inertia=(*size, 0.0, 0.0, 0.0),
        ))  # fmt: skip
        joints.append(Joint(
            name=f"joint {i}", body=f"body {i}", type=str(rng.choice(["hinge", "slide"])),
            axis=tuple(rng.normal(size=3)), range=(at - 1.0, at) if high else (at, at + 1.0),
        ))  # fmt: skip
        actuators.append(Actuator(name=f"motor {i}", joint=f"joint {i}", bias=((2 * high - 1) * loads[i], 0.0, 0.0)))
    loops = (Loop(name="coupling", type="joint", first="joint 0", second="joint 1"),) if coupled else ()
    scene = Scene(
        bodies=tuple(bodies), joints=tuple(joints), actuators=tuple(actuators), loops=loops, gravity=(0.0, 0.0, 0.0)
    )
    return case_of(scene, q0=start, t_end=0.3), loads


def at_bounds(case: Case) -> list[int]:
    """Return the rows that are at their surface at the start."""
    assert case.scene is not None
    rows = [(joint, bound) for joint in case.scene.joints for bound in joint.range]
    at = {joint.name: q for joint, q in zip(case.scene.joints, case.q0, strict=True)}
    loops = len(case.scene.loops)
    return [loops + i for i, (joint, bound) in enumerate(rows) if bound == at[joint.name]]


@pytest.mark.parametrize(("engine", "profile"), ENGINES)
@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_what_is_pressed_on_its_bound_stays_there(engine: str, profile: str, coupled: bool, seed: int) -> None:
    case, loads = pressed(seed, coupled=coupled)
    run = engines.load(engine).prepare(case, profile).run()
    assert run.outcome.ok
    assert np.abs(run.q - case.q0).max() < STILL
    found = contacts(run, joined=True)
    assert [c.row for c in found] == at_bounds(case)
    assert all(c.touch == 0.0 and np.isinf(c.release) for c in found)
    borne = np.abs(run.lam[-1][at_bounds(case)])
    if coupled:  # one bound may bear what both are pressed with
        borne, loads = np.array([borne[:2].sum(), borne[2]]), [loads[0] + loads[1], loads[2]]
    rounding = 2e-6 if engine == "mujoco" else 1e-10  # MuJoCo's solver ends at a cost, whatever the load
    assert borne == pytest.approx(loads, rel=0.0, abs=1e-6 * max(loads) + rounding)


@pytest.mark.parametrize("seed", range(3))
def test_what_bears_nothing_is_counted_alike(seed: int) -> None:
    """Whether a row that bears nothing pushes is rounding: it is at its surface in all engines."""
    case, _ = pressed(seed, unloaded=True)
    runs = [engines.load(engine).prepare(case, profile).run() for engine, profile in ENGINES]
    truth = replace(from_run(runs[0], Tier.D, "the first"), joined=True)
    for run in runs[1:]:
        for name in ("touch_count", "release_count", "event_times"):
            assert metrics.load(name).measure(truth, run, case) == 0.0, name


def test_rows_of_mujoco_at_rest_want_their_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without it a row that stands above its surface by rounding touches behind the start."""
    case, _ = pressed(0)
    heavy = case.scene.actuators[0]  # type: ignore[union-attr]
    others = case.scene.actuators[1:]  # type: ignore[union-attr]
    heavy = replace(heavy, bias=(np.sign(heavy.bias[0]), 0.0, 0.0))
    scene = case.scene.replace(actuators=(heavy, *others))  # type: ignore[union-attr]
    middle = np.array([np.mean(joint.range) for joint in scene.joints])
    case = replace(case, scene=scene, q0=np.nextafter(case.q0, middle))
    touches = []
    for reach in (_switched.REACH, 0.0):
        monkeypatch.setattr(_switched, "REACH", reach)
        run = engines.load("mujoco").prepare(case, "matched").run()
        assert np.abs(run.q - case.q0).max() < STILL
        touches.append(sum(event.t > 0.0 for event in run.events))
    assert touches[0] == 0 < touches[1]


def told(gap: list[float], modes: list[Mode]) -> Trajectory:
    """Return a motion of one row with an event where its mode changes."""
    n = len(gap)
    column = np.array(gap)[:, None]
    pairs = list(pairwise(modes))
    return Trajectory(
        t=np.arange(float(n)), q=column, v=np.zeros((n, 1)), gap=column, lam=np.array(modes)[:, None] * 1.0,
        energy=np.zeros((n, 2)), mode=np.array(modes, np.int8)[:, None],
        events=tuple(Event(t=float(i + 1), contact=0, before=b, after=a) for i, (b, a) in enumerate(pairs) if a != b),
    )  # fmt: skip


F, C = Mode.FREE, Mode.CONTACT


@pytest.mark.parametrize(
    ("gap", "modes", "expected"),
    [
        ([1.0, 0.0, -0.1, 0.0, 1e-8, 0.0, 0.0], [F, C, C, F, F, C, C], [(1.0, 3.0), (5.0, np.inf)]),  # a small bounce
        ([1.0, 0.0, -0.1, 0.0, 1e-12, 0.0, 0.0], [F, C, C, F, F, C, C], [(1.0, np.inf)]),
        ([0.0, 0.0, 1e-12, 0.5, 1.0], [F, C, C, F, F], [(1.0, 3.0)]),
        ([0.0, 1e-13, 0.0, 0.0], [F, F, F, F], [(0.0, np.inf)]),
        ([0.0, 1e-3, 0.5, 1.0], [F, F, F, F], []),  # it leaves at once
    ],
)
def test_a_contact_ends_where_its_gap_opens(gap: list[float], modes: list[Mode], expected: list[object]) -> None:
    assert [(c.touch, c.release) for c in contacts(told(gap, modes), joined=True)] == expected


@pytest.mark.parametrize("t", [2.0, 2.5])
def test_what_is_tried_at_one_instant_is_no_contact_and_ends_none(t: float) -> None:
    """A row that lands and is ballistic at once, or lets go and is caught at once, sampled there or not."""
    run = told([1.0, 0.5, -0.1, -0.5, -0.6], [F, F, F, F, F])
    tried = (Event(t=t, contact=0, before=F, after=C), Event(t=t, contact=0, before=C, after=Mode.BALLISTIC))
    assert contacts(replace(run, events=tried), joined=True) == ()
    held = told([1.0, 0.0, -0.1, -0.1, 0.1], [F, C, C, C, F])
    again = (
        Event(t=t, contact=0, before=C, after=Mode.BALLISTIC),
        Event(t=t, contact=0, before=Mode.BALLISTIC, after=C),
    )
    whole = (held.events[0], *again, held.events[1])
    assert [(c.touch, c.release) for c in contacts(replace(held, events=whole), joined=True)] == [(1.0, 4.0)]
