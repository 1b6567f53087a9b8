"""Loops beside contacts with friction: the motion is that of the mechanism in coordinates that need no loops."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closed_loops import LOOP_LAW, apart, cut, drawn, placed, restated
from friction_oracle import tossed_rod
from friction_scenes import G, account, box_body, pair
from scipy.integrate import solve_ivp

from crossbody.cases import Mode, Outcome, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body as Link
from crossbody.cases.scene import Joint, Loop, RowLaw, Scene, Shape
from crossbody.reference import System, simulate
from crossbody.reference.tree.system import system

LAW = RowLaw(a0=1e4, a1=200.0)
QUICK = (0, 1, 3, 9)


def made(scene: Scene, q0: np.ndarray) -> System:
    """Return the system of a scene, less the rows of loops that follow from others."""
    return system(scene, case_of(scene).law, q0)


def followed(scene: Scene, q: np.ndarray, v: np.ndarray, t_end: float, rtol: float = 1e-10) -> Trajectory:
    """Run a scene, with its account, to rows at equal distances."""
    return simulate(made(scene, q), q, v, t_end, rtol=rtol, samples=np.linspace(0.0, t_end, 21), ledger=True)


def distance(one: Scene, run: Trajectory, other: Scene, its: Trajectory) -> float:
    """Return by how much two motions are apart, up to where both are known."""
    until = min(run.determined_until, its.determined_until, run.unique_until, its.unique_until)
    known = min(int(np.sum(run.t <= until)), len(its.t))
    return max(
        apart(placed(one, run.q[k], run.v[k]), placed(other, its.q[k], its.v[k])) for k in range(known)
    )  # fmt: skip


def switches(run: Trajectory, loops: int) -> list[tuple[float, int, Mode]]:
    """Return the instants, rows and new modes of a run's events, without what comes and goes at one instant."""
    found: list[tuple[float, int, Mode]] = []
    for event in run.events:
        found = [one for one in found if one[1] != event.contact - loops or event.t - one[0] > 1e-12]
        found.append((event.t, event.contact - loops, event.after))
    return sorted(found, key=lambda one: (round(one[0], 7), one[1]))


@pytest.mark.parametrize("seed", [pytest.param(s, marks=() if s in QUICK else pytest.mark.slow) for s in range(60)])
def test_bodies_that_loops_join_move_as_on_joints(seed: int) -> None:
    scene, q0, v0 = drawn(seed)
    loose, q, v = cut(scene, q0, v0, [body.name for body in scene.bodies[1:]])
    tree, loops = followed(scene, q0, v0, 0.5), followed(loose, q, v, 0.5)
    assert tree.outcome is Outcome.FINISHED
    if loops.outcome is Outcome.ILL_POSED:  # rows that were left out at the start are needed where hinges have turned
        assert "redundant" in loops.counts
        return
    assert loops.outcome is Outcome.FINISHED, loops.message
    coarse = followed(scene, q0, v0, 0.5, 1e-9), followed(loose, q, v, 0.5, 1e-9)
    own = max(distance(scene, tree, scene, coarse[0]), distance(loose, loops, loose, coarse[1]))
    assert distance(scene, tree, loose, loops) < max(1e-8, 2.0 * own)
    assert account(loops) < 1e-7
    if own < 1e-8 and "not_unique" not in tree.counts:
        first, second = switches(tree, 0), switches(loops, sum(loop.width for loop in loose.loops))
        assert [one[1:] for one in first] == [one[1:] for one in second]
        assert np.allclose([one[0] for one in first], [one[0] for one in second], rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("seed", range(1, 9))
def test_loops_that_say_what_joints_do_change_nothing(seed: int) -> None:
    scene, q0, v0 = drawn(seed)
    joints = {joint.body: joint for joint in scene.joints}
    again = [loop for body in scene.bodies[1:] for loop in restated(body, joints.get(body.name))]
    tree, loops = (followed(one, q0, v0, 0.4) for one in (scene, scene.replace(loops=tuple(again))))
    assert loops.outcome is tree.outcome is Outcome.FINISHED
    assert np.abs(loops.q - tree.q).max() < 1e-12
    assert switches(loops, sum(loop.width for loop in again)) == switches(tree, 0)
    assert np.all(np.isnan(loops.lam[:, : sum(loop.width for loop in again)]))  # they are one of many


def welded_rod(mu: float, half: float, radius: float, a1: float) -> Scene:
    """Return a rod of 1 kg in two halves, each with a round end, that a weld holds together in a plane."""
    law, names = RowLaw(a0=1e4, a1=a1), ("low", "high")
    inertia = (half**2 / 24, half**2 / 24, 1e-3, 0.0, 0.0, 0.0)
    ways = (("x", (1, 0, 0), "slide"), ("z", (0, 0, 1), "slide"), ("turn", (0, 1, 0), "hinge"))
    ends = {"low": -half / 2, "high": half / 2}
    return Scene(
        bodies=tuple(Link(name=name, mass=0.5, inertia=inertia) for name in names),
        joints=tuple(Joint(name=f"{name} {way}", body=name, type=kind, axis=axis)
                     for name in names for way, axis, kind in ways),
        shapes=(Shape(name="floor", type="plane"),
                *(Shape(name=name, body=name, type="sphere", size=(radius, 0, 0), position=(0.0, 0.0, end))
                  for name, end in ends.items())),
        pairs=tuple(pair("floor", name, mu, law) for name in names),
        loops=(Loop(name="weld", type="weld", first="low", second="high", law=LOOP_LAW,
                    first_position=(0.0, 0.0, half / 2), second_position=(0.0, 0.0, -half / 2)),),
    )  # fmt: skip


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 5, 6, 8])
def test_a_rod_of_two_halves_moves_as_a_second_machine_moves_one(seed: int) -> None:
    (mu, half, radius, a1), q0, v0, t_end, (q, v, log) = tossed_rod(seed)
    scene = welded_rod(mu, half, radius, a1)
    low, high = (half / 2 * sign * np.array([np.sin(q0[2]), np.cos(q0[2]), 0.0]) for sign in (-1.0, 1.0))
    turn = np.array([low[1], -low[0], 0.0]) * v0[2]
    start, speed = np.r_[q0 + low, q0 + high], np.r_[v0 + turn, v0 - turn]
    found = simulate(made(scene, start), start, speed, t_end, rtol=1e-10)
    assert found.outcome is Outcome.FINISHED
    assert np.abs((found.q[-1, :3] + found.q[-1, 3:]) / 2 - q).max() < 1e-9
    assert np.abs((found.v[-1, :3] + found.v[-1, 3:]) / 2 - v).max() < 1e-7
    times = np.array([event.t for event in found.events])
    assert all(np.abs(times - t).min() < 1e-9 for t, _ in log[1:])


def halves(mu: float, alpha: float) -> Scene:
    """Return a flat block on a slope that falls in x, of two boxes that a weld holds together."""
    size = (0.1, 0.1, 0.05)
    return Scene(
        bodies=tuple(box_body(name, size) for name in ("back", "front")),
        joints=tuple(Joint(name=name, body=name, type="free") for name in ("back", "front")),
        shapes=(Shape(name="floor", type="plane"),
                *(Shape(name=name, body=name, type="box", size=size) for name in ("back", "front"))),
        pairs=tuple(pair("floor", name, mu, LAW) for name in ("back", "front")),
        loops=(Loop(name="weld", type="weld", first="back", second="front", first_position=(0.1, 0.0, 0.0),
                    second_position=(-0.1, 0.0, 0.0), law=LOOP_LAW, torque_scale=0.2),),
        gravity=(G * np.sin(alpha), 0.0, -G * np.cos(alpha)),
    )  # fmt: skip


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(("mu", "alpha"), [(0.8, 0.4), (0.3, 0.0), (0.45, 0.4), (0.2, 0.4)])
def test_a_block_of_two_halves_slides_and_stops_where_one_does(mu: float, alpha: float, way: float) -> None:
    v0, down, brake = way, G * np.sin(alpha), G * mu * np.cos(alpha)
    q = np.r_[-0.1, 0.0, 0.05, 1.0, np.zeros(3), 0.1, 0.0, 0.05, 1.0, np.zeros(3)]
    v = np.r_[v0, np.zeros(5), v0, np.zeros(5)]
    run = simulate(made(halves(mu, alpha), q), q, v, 1.0, rtol=1e-10)
    assert run.outcome is Outcome.FINISHED, run.message
    slows = way * down - brake  # of the size of the velocity
    stop = -1.0 / slows if slows < 0.0 else np.inf
    if stop > 1.0:
        x, speed = way * (1.0 + 0.5 * slows), way * (1.0 + slows)
    else:
        after, left = max(down - brake, 0.0), 1.0 - stop
        x, speed = way * stop / 2 + 0.5 * after * left**2, after * left
        stops = {event.t for event in run.events if event.t > 0.0}
        assert min(abs(t - stop) for t in stops) < 1e-10
        assert len(stops) == 1
    assert np.allclose(run.q[-1, [0, 7]], [x - 0.1, x + 0.1], rtol=0.0, atol=1e-9)
    assert np.allclose(run.v[-1, [0, 6]], speed, rtol=0.0, atol=1e-8)
    assert np.abs(run.q[-1, [1, 2, 8, 9]] - [0.0, 0.05, 0.0, 0.05]).max() < 1e-9


CRANK, LOSS = 0.7, 1.2


def parallelogram(loss: float) -> Scene:
    """Return two cranks that hang side by side, their ends joined by a bar, the first with dry friction."""
    rod = (CRANK**2 / 12, CRANK**2 / 12, 1e-4, 0.0, 0.0, 0.0)
    hang = (0.0, 0.0, -CRANK / 2)
    return Scene(
        bodies=(
            Link(name="one", mass=1.0, com=hang, inertia=rod),
            Link(name="bar", parent="one", position=(0.0, 0.0, -CRANK), mass=2.0, com=(0.25, 0.0, 0.0),
                 inertia=(1e-3, 0.05, 0.05, 0.0, 0.0, 0.0)),
            Link(name="two", position=(0.5, 0.0, 0.0), mass=1.0, com=hang, inertia=rod),
        ),
        joints=(
            Joint(name="one", body="one", type="hinge", axis=(0, 1, 0), friction_loss=loss, law=RowLaw(a0=400, a1=40)),
            Joint(name="bar", body="bar", type="hinge", axis=(0, 1, 0)),
            Joint(name="two", body="two", type="hinge", axis=(0, 1, 0)),
        ),
        loops=(Loop(name="end", type="connect", first="bar", second="two", first_position=(0.5, 0.0, 0.0),
                    second_position=(0.0, 0.0, -CRANK), law=LOOP_LAW),),
    )  # fmt: skip


def swung(loss: float, th0: float, t_end: float) -> tuple[float, list[float]]:
    """Return the angle of cranks at the end and the instants at which they turned, by SciPy in that one angle."""
    J, K = 2.0 * CRANK**2 / 3.0 + 2.0 * CRANK**2, 9.81 * (CRANK + 2.0 * CRANK)
    t, th, turns = 0.0, th0, list[float]()
    while t < t_end and K * abs(np.sin(th)) > loss:
        way = -np.sign(np.sin(th))

        def stops(_: float, y: np.ndarray, way: float = way) -> float:
            return float(way * y[1])

        stops.terminal, stops.direction = True, -1.0  # type: ignore[attr-defined]
        run = solve_ivp(
            lambda _, y, way=way: [y[1], (-K * np.sin(y[0]) - way * loss) / J], (t, t_end), [th, 0.0],
            method="DOP853", rtol=1e-13, atol=1e-14, events=stops,
        )  # fmt: skip
        t, th = float(run.t[-1]), float(run.y[0, -1])
        if len(run.t_events[0]):
            turns.append(t)
    return th, turns


@pytest.mark.parametrize("loss", [LOSS, 4.0])
def test_a_four_bar_with_dry_friction_swings_as_the_one_angle_that_it_has(loss: float) -> None:
    scene, q = parallelogram(loss), np.array([1.0, -1.0, 1.0])
    run = simulate(made(scene, q), q, np.zeros(3), 6.0, rtol=1e-11)
    assert run.outcome is Outcome.FINISHED, run.message
    th, turns = swung(loss, 1.0, 6.0)
    assert run.q[-1] == pytest.approx([th, -th, th], abs=1e-9)
    times = sorted({event.t for event in run.events})
    assert np.allclose(times[-len(turns) :], turns, rtol=0.0, atol=1e-9)


def test_a_four_bar_that_folds_flat_is_ill_posed_beside_friction() -> None:
    q, v = np.array([1.2, -1.2, 1.2]), np.array([4.0, -4.0, 4.0])
    run = simulate(made(parallelogram(LOSS), q), q, v, 1.0, rtol=1e-9)
    assert run.outcome is Outcome.ILL_POSED
    assert run.q[-1, 0] == pytest.approx(np.pi / 2, abs=0.1)


@pytest.mark.parametrize(
    "seed", [pytest.param(s, marks=() if s == 0 else pytest.mark.slow) for s in (*range(9), *range(12, 16))]
)
def test_the_second_machine_moves_bodies_in_loops_alike(seed: int) -> None:
    scene, q0, v0 = drawn(seed, most=3)
    loose, q, v = cut(scene, q0, v0, [body.name for body in scene.bodies[1:]])
    at = np.linspace(0.0, 0.35, 8)
    one, other = (
        simulate(made(loose, q), q, v, 0.35, rtol=1e-10, samples=at, solver=solver) for solver in ("compiled", "cvode")
    )
    assert one.outcome is other.outcome
    if one.outcome is Outcome.FINISHED:
        assert np.abs(one.q - other.q).max() < 1e-8
        known = ~np.isnan(one.lam) & ~np.isnan(other.lam)
        assert known.any()
        assert np.abs(one.lam - other.lam)[known].max() < 1e-4 * np.abs(one.lam[known]).max()
        events = switches(one, 0), switches(other, 0)
        assert [event[1:] for event in events[0]] == [event[1:] for event in events[1]]
        assert np.allclose([event[0] for event in events[0]], [event[0] for event in events[1]], rtol=0.0, atol=1e-7)


def test_a_motion_is_determined_as_long_as_that_of_one_body() -> None:
    """Of a flat block that slides and spins on the corners of both its halves: their loads are open."""
    size = (0.1, 0.1, 0.05)
    scene = Scene(
        bodies=(box_body("back", size), replace(box_body("front", size), parent="back", position=(0.2, 0.0, 0.0))),
        joints=(Joint(name="free", body="back", type="free"),),
        shapes=(Shape(name="floor", type="plane"),
                *(Shape(name=name, body=name, type="box", size=size) for name in ("back", "front"))),
        pairs=tuple(pair("floor", name, 0.3, LAW) for name in ("back", "front")),
    )  # fmt: skip
    q0, v0 = np.r_[0.0, 0.0, 0.05, 1.0, np.zeros(3)], np.r_[1.0, 0.0, 0.0, 0.0, 0.0, 3.0]
    loose, q, v = cut(scene, q0, v0, ["front"])
    one, two = followed(scene, q0, v0, 0.3), followed(loose, q, v, 0.3)
    assert one.outcome is two.outcome is Outcome.FINISHED
    assert 0.0 < one.determined_until < 0.3
    assert 0.5 < two.determined_until / one.determined_until < 2.0  # what moves most is told by its coordinates
