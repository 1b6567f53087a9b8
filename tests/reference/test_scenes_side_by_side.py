"""What slides on its own does not know what presses on a body that nothing couples it to."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody.cases import Mode, Outcome, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Pair, Push, RowLaw, Scene, Shape
from crossbody.reference import simulate
from crossbody.reference.tree.system import system

G, RADIUS = 9.81, 0.05
OBLIQUE = np.radians(150.0)
STOPS = 0.18736133037705  # of v0, s: slope .4, friction .5, launched at 150 degrees from downhill
ENDS = np.array([-0.05063281014555, 0.04271259886070])  # of v0 v0, m
CLEAR = 100.0  # times the tolerance, of the largest speed: ten times what has no direction
CONE = 1e-6
STIFF = RowLaw(a0=2500.0, a1=100.0)


def point(name: str, mass: float, mu: float, law: RowLaw) -> tuple[Body, tuple[Joint, ...], Shape, Pair]:
    axes = (("x", (1, 0, 0)), ("y", (0, 1, 0)), ("z", (0, 0, 1)))
    joints = tuple(Joint(name=name + n, body=name, type="slide", axis=axis) for n, axis in axes)
    shape = Shape(name=f"on {name}", body=name, size=(RADIUS, 0, 0))
    pair = Pair(name=name, first="floor", second=shape.name, friction=(mu, mu, 0, 0, 0), dimension=3, law=law)
    return Body(name=name, mass=mass), joints, shape, pair


def on_a_slope(slope: float, *points: tuple[Body, tuple[Joint, ...], Shape, Pair]) -> Scene:
    bodies, joints, shapes, pairs = zip(*points, strict=True)
    pushes = tuple(Push(name=f"on {body.name}", body=body.name) for body in bodies)
    return Scene(
        bodies=bodies, joints=sum(joints, ()), shapes=(Shape(name="floor", type="plane"), *shapes), pairs=pairs,
        pushes=pushes, gravity=(G * slope / np.hypot(1, slope), 0.0, -G / np.hypot(1, slope)),
    )  # fmt: skip


def moves(scene: Scene, q: list[float], v: list[float], t_end: float, rtol: float, inputs: tuple) -> Trajectory:
    found = simulate(system(scene, case_of(scene).law), q, v, t_end, rtol=rtol, inputs=inputs)
    assert found.outcome is Outcome.FINISHED, found.message
    return found


def sticks_at(run: Trajectory) -> float:
    return max(e.t for e in run.events if e.contact == 0 and e.after is Mode.STICK)


def obeys(scene: Scene, run: Trajectory, rtol: float) -> None:
    """Check that sticks are within their cones, and that friction of slips points against them."""
    made, instants = system(scene, case_of(scene).law), {e.t for e in run.events}
    least = max(1e-8, CLEAR * rtol) * np.abs(run.v).max()
    for t, q, v, lam, mode in zip(run.t, run.q, run.v, run.lam, run.mode, strict=True):
        rate = np.asarray(made.gap(q, v)[1])
        for i in np.flatnonzero(made.tangents) if t not in instants else ():
            ways = np.flatnonzero(np.asarray(made.follows) == i)
            most, slip = made.mu[ways[0]] * lam[i], float(np.linalg.norm(rate[ways]))
            if mode[i] == Mode.STICK:
                assert np.linalg.norm(lam[ways]) <= most + CONE * np.abs(lam).max(), (t, i)
            elif mode[i] == Mode.SLIP and slip > least:
                assert np.abs(lam[ways] + most * rate[ways] / slip).max() <= CONE * most, (t, i, slip)


@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
@pytest.mark.parametrize("force", [20.0, 200.0])
@pytest.mark.parametrize("law", [STIFF, RowLaw(a0=100.0, a1=20.0)], ids=["stiff", "soft"])
@pytest.mark.parametrize("speed", [0.1, 0.03])
def test_an_oblique_slide_stops_where_it_does_while_a_light_body_is_pressed_down(
    speed: float, law: RowLaw, force: float, rtol: float
) -> None:
    scene = on_a_slope(0.4, point("block", 1.0, 0.5, STIFF), point("puck", 1e-3, 0.3, law))
    q, v = (
        [0.0, 0.0, RADIUS, 5.0, 0.0, RADIUS + 1e-4],
        [*speed * np.array([np.cos(OBLIQUE), np.sin(OBLIQUE)]), 0, 0, 0, 0],
    )
    inputs = (np.array([0.0, 0.06 * speed]), np.array([np.zeros(6), [0, 0, 0, 0, 0, -force]]))
    run = moves(scene, q, v, 0.3 * speed, rtol, inputs)
    obeys(scene, run, rtol)
    fastest = np.abs(run.v).max()
    assert sticks_at(run) == pytest.approx(STOPS * speed, abs=CLEAR * rtol * fastest)
    assert np.abs(run.q[-1, :2] - ENDS * speed**2).max() < CLEAR * rtol * fastest * speed


def test_what_pressed_once_is_forgotten() -> None:
    """A puck is pressed for a millisecond; much later the load of a block that slides jumps by next to nothing."""
    scene = on_a_slope(0.4, point("block", 1.0, 0.5, STIFF), point("puck", 1e-3, 0.3, STIFF))
    q, v = [0.0, 0.0, RADIUS, 5.0, 0.0, RADIUS], [np.cos(OBLIQUE), np.sin(OBLIQUE), 0.0, 0.0, 0.0, 0.0]
    forces = np.zeros((4, 6))
    forces[:, 5], forces[3, 2] = [-1e-3, -200.0, 0.0, 0.0], 1e-9
    run = moves(scene, q, v, 0.3, 1e-6, (np.array([0.0, 1e-3, 2e-3, 0.17]), forces))
    obeys(scene, run, 1e-6)
    assert sticks_at(run) == pytest.approx(STOPS, abs=1e-6)
    assert np.abs(run.q[-1, :2] - ENDS).max() < 1e-6


@pytest.mark.parametrize("seed", [*range(60), *(pytest.param(k, marks=pytest.mark.slow) for k in range(60, 600))])
def test_a_body_moves_as_alone_beside_one_that_nothing_couples_it_to(seed: int) -> None:
    draw = np.random.default_rng([seed, 8])
    slope, rtol, speed = draw.uniform(0.0, 0.5), 10.0 ** draw.uniform(-9, -6), 10.0 ** draw.uniform(-2, 0.5)
    mu, heading = slope + draw.uniform(0.1, 0.8), draw.uniform(0.0, 2 * np.pi)
    slowing = G * (mu - slope) / np.hypot(1, slope)
    laws = [RowLaw(a0=float(10 ** draw.uniform(2, 5)), a1=float(10 ** draw.uniform(1, 2.5))) for _ in range(2)]
    block = point("block", 10.0 ** draw.uniform(-1, 1), mu, laws[0])
    puck = point("puck", 10.0 ** draw.uniform(-5, 0), draw.uniform(0.1, 1.0), laws[1])
    t_end = 1.5 * speed / slowing
    when = np.array([0.0, *np.sort(draw.uniform(0.0, t_end, 3))])
    forces = np.zeros((4, 6))
    forces[1:, 5] = -(10.0 ** draw.uniform(-1, 2.5, 3)) * draw.choice([1.0, 1.0, -1e-3], 3)
    forces[1:, 2] = 1e-9 * draw.normal(size=3)
    start = [*speed * np.array([np.cos(heading), np.sin(heading)]), 0.0]
    above = RADIUS + draw.choice([0.0, 1e-5, 1e-3])
    alone = moves(on_a_slope(slope, block), [0, 0, RADIUS], start, t_end, 1e-11, (when, forces[:, :3]))
    scene = on_a_slope(slope, block, puck)
    beside = moves(scene, [0, 0, RADIUS, 5, 0, above], [*start, 0, 0, 0], t_end, rtol, (when, forces))
    obeys(scene, beside, rtol)
    known = CLEAR * rtol * max(np.abs(beside.v).max(), 1.0)
    assert sticks_at(beside) == pytest.approx(sticks_at(alone), abs=known / slowing)
    assert np.abs(beside.q[-1, :2] - alone.q[-1, :2]).max() < known * t_end
