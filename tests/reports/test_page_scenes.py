"""Pictures: what is drawn touches exactly where the mechanism's own gap says it does, and forces act there."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from unpacked import numbers

from crossbody import cases
from crossbody.cases import Case, Event, Mode, Trajectory
from crossbody.cases.mechanisms.maze.geometry import maze_of
from crossbody.cases.scene import Body, Joint, Pair, Scene, Shape
from crossbody.cases.scene_plain import plain
from crossbody.engines import load
from crossbody.reports import scenes
from crossbody.reports.measuring.equations import equations
from crossbody.reports.measuring.impulse import with_collisions
from crossbody.reports.pages.case_page import PLOTTED
from crossbody.reports.pages.figures import FIGURES, led, points_for
from crossbody.reports.pages.html import packed_value
from crossbody.reports.pages.playback import packed, peaks, pictures, playback
from crossbody.reports.runs import study
from crossbody.reports.runs.store import Trace

CASES = (
    ("bouncing_ball", "listing"), ("newtons_cradle", "sliders"), ("newtons_cradle", "pendulums"),
    ("red_body", "resolved"), ("soft_contact", "axis"), ("soft_contact", "delta"), ("ball_maze", "inside"),
    ("delta_impulse", "light"),
)  # fmt: skip


def states(case: Case, n: int = 5) -> np.ndarray:
    """Near the start and, more and more, far from it: a radian."""
    rng = np.random.default_rng(3)
    return case.q0 + np.geomspace(1e-3, 1.0, n)[:, None] * rng.standard_normal((n, len(case.q0)))


def trace_of(case: Case, n: int = 50) -> Trace:
    q, nc = states(case, n), len(case.contacts)
    zero = np.zeros((n, nc))
    run = Trajectory(
        t=np.linspace(0.0, case.t_end, n), q=q, v=0.0 * q, gap=zero, lam=zero + 1.0, energy=np.zeros((n, 2)),
        mode=zero.astype(np.int8),
    )  # fmt: skip
    about = study._about(case, "truth", "")
    return Trace(about=about, run=run)


def gaps(case: Case, q: np.ndarray) -> np.ndarray:
    """By the reference's own kernel (n, nc)."""
    from crossbody.engines import load

    system = load("reference").prepare(case, "compiled").system
    found = np.zeros((len(q), len(case.contacts)))
    rate = np.zeros(len(case.contacts))
    for i, row in enumerate(q):
        system.gaps(0.0, row, np.zeros(len(row)), np.array(system.p), found[i], rate)
    return found


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_every_mechanism_has_a_picture(name: str, variant: str) -> None:
    case = cases.load(name, variant)
    scene = scenes.load(case.mechanism)
    stage, q = scene.stage(case.parameters), states(case)
    poses = scene.poses(q, case.parameters)
    arrows = scene.arrows(q, np.ones((len(q), len(case.contacts))), case.parameters)
    assert poses.shape[0] == arrows.shape[0] == len(q)
    assert poses.shape[2] == 3
    assert arrows.shape[2] == 2 * stage.dimensions
    assert np.isfinite(poses).all()
    assert np.isfinite(arrows).all()
    if stage.lines:
        assert max(max(line) for line in stage.lines) < poses.shape[1]
    else:
        assert poses.shape[1] == len(stage.bodies)


@pytest.mark.parametrize("variant", ["sliders", "pendulums"])
def test_balls_are_as_far_apart_as_their_gap(variant: str) -> None:
    case = cases.load("newtons_cradle", variant, gap=2e-3)
    q = states(case)
    centres = scenes.load(case.mechanism).poses(q, case.parameters)[:, :, :2]
    apart = np.linalg.norm(np.diff(centres, axis=1), axis=2) - 2 * case.number("radius")
    in_order = (np.diff(centres[:, :, 0], axis=1) > 0.0).all(axis=1) | (variant == "pendulums")  # on one line
    assert in_order.sum() >= 3
    assert np.allclose(apart[in_order], gaps(case, q)[in_order], atol=1e-13)


def test_forces_of_a_pair_are_opposite() -> None:
    case = cases.load("newtons_cradle", "pendulums")
    q = states(case)
    lam = np.random.default_rng(1).random((len(q), len(case.contacts)))
    arrows = scenes.load(case.mechanism).arrows(q, lam, case.parameters)
    left, right = np.split(arrows[:, :, 2:], 2, axis=1)
    assert np.allclose(left, -right)
    assert np.allclose(np.linalg.norm(right, axis=2), lam)


PUSHED = {
    "bouncing_ball listing": [(0, 0, 0)],
    "newtons_cradle sliders": [(0, 0, 0), (1, 0, 1)],
    "newtons_cradle pendulums": [(k, k % 4, k % 4 + k // 4) for k in range(8)],
    "red_body resolved": [(0, 0, 1), (1, 1, 1), (2, 2, 0), (3, 3, 0), (4, 4, 0)],
    "soft_contact axis": [(0, 0, 3), (1, 1, 3)],
    "ball_maze inside": [(3, 3, 1)],
}
"""Arrow, row and body; of the maze the wall that the ball rolls on."""


def slopes(of: Callable[[np.ndarray], np.ndarray], q: np.ndarray) -> np.ndarray:
    """Central differences of a function of the coordinates (n,), the first index that of the coordinate."""
    ways = 1e-6 * np.eye(len(q))
    ahead, behind = np.split(of(np.concatenate([q + ways, q - ways])), 2)
    return (ahead - behind) / 2e-6


def from_outline(shapes: Sequence[Mapping[str, Any]], pose: np.ndarray, at: tuple[float, float]) -> float:
    """Distance of a point, from a body's origin, to what is drawn of the body."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    x = np.array(at) @ [[c, -s], [s, c]]
    found = [
        abs(float(np.hypot(*(x - shape["circle"][:2]))) - shape["circle"][2]) for shape in shapes if "circle" in shape
    ]
    for shape in shapes:
        points = np.array(shape.get("points", []))
        for a, b in zip(points, np.roll(points, -1, axis=0), strict=True):
            share = np.clip((x - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
            found.append(float(np.linalg.norm(a + share * (b - a) - x)))
    return min(found)


@pytest.mark.parametrize("name", PUSHED)
def test_a_drawn_force_opens_the_gap_of_its_row(name: str) -> None:
    """On the outline of its body, and where that moves alone the power is lam times the gap's rate."""
    case = cases.load(*name.split(), **({"n": 2} if name.endswith("sliders") else {}))
    scene, rng = scenes.load(case.mechanism), np.random.default_rng(4)
    q = case.q0 + 0.05 * rng.standard_normal(len(case.q0))
    lam = rng.uniform(1.0, 2.0, len(case.contacts))
    arrows, pose = (part[0] for part in (scene.arrows(q[None], lam[None], case.parameters),
                                         scene.poses(q[None], case.parameters)))  # fmt: skip
    stage = scene.stage(case.parameters)
    gap, rates = slopes(partial(gaps, case), q), slopes(lambda x: scene.poses(x, case.parameters), q)
    for arrow, row, body in PUSHED[name]:
        (x, y), force = arrows[arrow, :2] - pose[body, :2], arrows[arrow, 2:]
        assert case.mechanism == "maze" or from_outline(stage.bodies[body], pose[body], (x, y)) < 1e-9
        power = (rates[:, body, :2] + rates[:, body, 2:] * (-y, x)) @ force
        alone = np.abs(np.delete(rates, body, axis=1)).max(axis=(1, 2), initial=0.0) < 1e-9
        assert np.abs(power[alone]).max() > 0.1
        assert np.allclose(power[alone], lam[row] * gap[alone, row], atol=1e-6)
        assert case.mechanism == "maze" or force @ (x, y) < 0.0, "into the body, which is not drawn beyond the other"


@pytest.mark.parametrize("seed", range(12))
def test_a_drawn_force_of_a_tip_pushes_the_ball_away_from_its_drawn_end(seed: int) -> None:
    """As hard as its multiplier says, at any angle of the maze, and whichever wall the tip is of."""
    case, rng = cases.load("ball_maze", "solve"), np.random.default_rng(seed)
    scene, maze = scenes.load(case.mechanism), maze_of(case.parameters)
    ring = maze.rings[int(rng.choice([i for i, ring in enumerate(maze.rings) if ring.gaps]))]
    gap, end = int(rng.integers(ring.gaps)), int(rng.integers(2))
    theta, lean = rng.uniform(-np.pi, np.pi), rng.uniform(-1.2, 1.2)
    angle = theta + ring.tips(gap)[end]
    into = angle + (0.5 - end) * np.pi + lean  # towards the gap
    ball = ring.middle * np.array([np.cos(angle), np.sin(angle)])
    ball += (ring.cap + maze.ball) * np.array([np.cos(into), np.sin(into)])
    q, lam = np.array([theta, *ball, 0.0]), rng.uniform(1.0, 2.0, len(case.contacts))
    arrows, pose = scene.arrows(q[None], lam[None], case.parameters)[0], scene.poses(q[None], case.parameters)[0]
    walls = [shape for shape in scene.stage(case.parameters).bodies[0] if "points" in shape]
    for row in (1, 2, 4, 5):
        force = arrows[row, 2:]
        assert np.linalg.norm(force) == pytest.approx(lam[row])
        away, near = (from_outline(walls, pose[0], tuple(ball + s * 1e-4 * force / lam[row])) for s in (1.0, -1.0))
        assert (away - near) / 2e-4 == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_what_is_drawn_higher_weighs_more(name: str, variant: str) -> None:
    """Potential energy and the mean height of all that is drawn rise together over moves at random."""
    case = cases.load(name, variant)
    scene, rng = scenes.load(case.mechanism), np.random.default_rng(7)
    q = case.q0 + 0.05 * rng.standard_normal((40, len(case.q0)))
    stage, poses = scene.stage(case.parameters), scene.poses(q, case.parameters)
    height = poses[:, :, stage.dimensions - 1].mean(axis=1) * (-1.0 if stage.down else 1.0)
    system, energy = load("reference").prepare(case, "compiled").system, np.zeros((40, 2))
    for row, one in zip(energy, q, strict=True):
        system.energy(np.array(one), np.zeros(len(case.v0)), np.array(system.p), row)
    if np.ptp(energy[:, 1]) > 1e-9 and np.ptp(height) > 1e-9:
        assert np.corrcoef(height, energy[:, 1])[0, 1] > 0.3


def test_a_drawn_force_of_a_delta_robot_closes_its_loop() -> None:
    """Drawn at the wrist of another arm is the force on the first: with that arm alone it moves against the gap."""
    case = cases.load("delta_impulse", "light")
    scene, q = scenes.load(case.mechanism), states(case, 1)[0]
    lam = np.random.default_rng(6).normal(size=(1, 6))
    arrows = scene.arrows(q[None], lam, case.parameters)[0]
    gap = slopes(partial(gaps, case), q)
    ends = slopes(lambda x: scene.arrows(x, np.repeat(lam, len(x), axis=0), case.parameters)[:, :, :3], q)
    points = scene.poses(q[None], case.parameters)[0]
    for k in range(2):
        alone, rows = slice(3 * k + 3, 3 * k + 6), slice(3 * k, 3 * k + 3)
        assert np.abs(points - arrows[k, :3]).sum(axis=1).min() == 0.0
        assert np.allclose(ends[alone, k] @ arrows[k, 3:], -gap[alone, rows] @ lam[0, rows], atol=1e-6)
        assert np.abs(gap[alone, rows] @ lam[0, rows]).max() > 0.01


def test_every_ball_of_a_cradle_hangs_on_a_thread_of_its_length() -> None:
    case = cases.load("newtons_cradle", "pendulums")
    scene, q = scenes.load(case.mechanism), states(case)
    threads = scene.stage(case.parameters).threads
    assert [body for *_, body in threads] == list(range(len(case.q0)))
    poses = scene.poses(q, case.parameters)
    spans = poses[:, :, :2] - np.array([thread[:2] for thread in threads])
    assert np.allclose(np.linalg.norm(spans, axis=2), case.number("length"), atol=1e-13)
    assert np.allclose(np.arctan2(spans[:, :, 0], -spans[:, :, 1]), poses[:, :, 2], atol=1e-13)


def test_the_red_body_touches_where_its_gaps_say() -> None:
    case = cases.load("red_body", "resolved")
    q = states(case)
    lam = np.ones((len(q), 5))
    arrows = scenes.load("red_body").arrows(q, lam, case.parameters)
    h = gaps(case, q)
    assert np.allclose(arrows[:, :2, 1], h[:, :2], atol=1e-14)
    assert np.allclose(case.number("wall") - arrows[:, 4, 0], h[:, 4], atol=1e-14)
    normal, slab = arrows[:, 2, 2:], q[:, 3:5]
    for k in (2, 3):
        above = np.sum(normal * (arrows[:, k, :2] - slab), axis=1) - case.number("slab_half_height")
        assert np.allclose(above, h[:, k], atol=1e-14)


def test_the_arms_of_the_delta_robot_close_where_its_gaps_do() -> None:
    case = cases.load("delta_impulse", "light")
    q = states(case)
    points = scenes.load("delta").poses(q, case.parameters)
    apart = np.concatenate([_tip(points, 0, case) - _tip(points, i, case) for i in (1, 2)], axis=1)
    assert np.allclose(apart, gaps(case, q), atol=1e-13)


def _tip(points: np.ndarray, i: int, case: Case) -> np.ndarray:
    """Centre of the flange as arm i has it: its wrist, less the flange's radius along the arm."""
    hinge = points[:, 3 * i]
    return points[:, 3 * i + 2] - case.number("r_flange") * hinge / np.linalg.norm(hinge, axis=1, keepdims=True)


def test_the_soft_block_is_touched_where_its_gaps_say() -> None:
    case = cases.load("soft_contact", "axis")
    q = states(case)
    arrows = scenes.load("soft_contact").arrows(q, np.ones((len(q), 2)), case.parameters)
    poses = scenes.load("soft_contact").poses(q, case.parameters)
    h = gaps(case, q)
    assert np.allclose(arrows[:, 0, 0] - poses[:, 1, 0], h[:, 0], atol=1e-14)
    assert np.allclose(poses[:, 2, 0] - arrows[:, 1, 0], h[:, 1], atol=1e-14)


def test_peaks_miss_no_blow() -> None:
    lam = np.zeros((1000, 2))
    lam[437, 1], lam[10, 0], lam[998, 0] = -50.0, np.nan, 7.0
    t = np.linspace(0.0, 1.0, 1000)
    event = Event(t=0.25, contact=0, before=Mode.FREE, after=Mode.CONTACT)
    shown = pictures([cast(Trajectory, SimpleNamespace(t=t, events=(event,)))], 40)
    assert (shown[0], shown[-1]) == (0.0, 1.0)
    assert {t[248], t[250], t[251], t[253]} <= set(shown)
    found = peaks(lam, np.maximum(np.searchsorted(t, shown, side="right"), 1))
    assert found[:, 1].min() == -50.0
    assert found[:, 0].max() == 7.0
    assert np.isfinite(found).all()


@pytest.mark.parametrize("seed", range(10))
def test_a_difference_made_larger_is_that_of_the_motions_and_not_of_their_chords(seed: int) -> None:
    """Two runs of one fall, each with steps of its own: at any instant their pictures are in one place."""
    rng = np.random.default_rng(seed)
    case = cases.load("bouncing_ball", "linear")
    trace = trace_of(case)

    def seen() -> Trace:
        t = np.unique(np.concatenate([[0.0, 0.4], rng.uniform(0.0, 0.4, rng.integers(2, 30))]))
        q, v = (1.0 - 0.5 * 9.81 * t**2)[:, None], (-9.81 * t)[:, None]
        rows = {name: np.zeros((len(t), 1)) for name in ("gap", "lam")}
        own = replace(
            trace.run,
            t=t,
            q=q,
            v=v,
            mode=np.zeros((len(t), 1), dtype=int),
            events=(),
            energy=np.zeros((len(t), 2)),
            ledger=None,
            **rows,
        )
        return replace(trace, run=own)

    one, two = packed([seen(), seen()], scenes.load(case.mechanism))["tracks"]
    places = []
    for track in (one, two):
        t = numbers(track["t"])
        poses = numbers(track["poses"]).reshape(len(t), -1)
        heights = poses[:, np.argmax(np.ptp(poses, axis=0))]
        assert np.ptp(heights) > 0.7
        places.append(np.interp(np.linspace(0.0, 0.4, 997), t, heights))
    np.testing.assert_allclose(*places, rtol=0.0, atol=1e-6)  # single precision of 1 m


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_playback_is_small_and_holds_the_motion(name: str, variant: str) -> None:
    case = cases.load(name, variant)
    trace = trace_of(case)
    many = [trace] * 10
    (section,) = playback(many)
    assert len(packed_value(section.context["scene"])) < 450e3
    track = packed(many, scenes.load(case.mechanism))["tracks"][0]
    t = numbers(track["t"])
    assert t[0] == 0.0
    assert t[-1] == pytest.approx(case.t_end, rel=1e-6)


def test_collisions_that_take_no_time_are_drawn_as_impulses() -> None:
    case = cases.load("red_body", "frozen")
    trace = trace_of(case)
    events = (
        Event(t=0.05, contact=2, before=Mode.FREE, after=Mode.COLLISION),
        Event(t=0.05, contact=2, before=Mode.COLLISION, after=Mode.CONTACT, impulse=3.0),
    )
    struck = replace(trace, run=replace(trace.run, events=events, lam=0.0 * trace.run.lam))
    scene = scenes.load(case.mechanism)
    found = packed([struck], scene)
    assert (found["force"], found["impulse"]) == (0.0, 3.0)
    (track,) = found["tracks"]
    blows = numbers(track["blows"]).reshape(-1, 4)
    at = numbers(track["struck"])
    assert at == pytest.approx([0.05], abs=case.t_end / 49)
    i = int(np.searchsorted(trace.run.t, 0.05))
    wanted = scene.arrows(trace.run.q[i : i + 1], 3.0 * np.eye(len(case.contacts))[2:3], case.parameters)[0]
    wanted = wanted[(wanted[:, 2:] != 0.0).any(axis=1)]  # a contact that never pushes has no arrow
    assert len(wanted) == 1
    assert np.allclose(blows, wanted, atol=1e-6)
    step = with_collisions(struck.run, events)
    assert np.allclose(step[:, 2], np.where(struck.run.t >= 0.05, 3.0, 0.0))


def test_plots_of_many_engines_and_events_stay_in_their_room() -> None:
    case, n = cases.load("newtons_cradle", "pendulums"), 3000
    rng, t = np.random.default_rng(5), np.linspace(0.0, case.t_end, n)
    events = tuple(Event(t=float(at), contact=0, before=Mode.FREE, after=Mode.CONTACT) for at in t[::40])
    q, wide = rng.standard_normal((n, len(case.q0))), rng.random((n, len(case.contacts)))
    run = Trajectory(
        t=t, q=q, v=q, gap=-wide, lam=wide, energy=rng.random((n, 2)), mode=(wide > 0.5).astype(np.int8), events=events
    )  # fmt: skip
    many = [Trace(about=study._about(case, "e", str(i)), run=run, truth=run) for i in range(10)]
    points = points_for(many, PLOTTED)
    drawn = {name: len(json.dumps(draw(many, points))) for name, (_, draw) in FIGURES.items()}
    assert sum(size for name, size in drawn.items() if name not in ("modes", "steps")) < 1.1 * PLOTTED
    assert points > 100


def test_an_unknown_mechanism_is_told() -> None:
    trace = trace_of(cases.load("bouncing_ball", "listing"))
    (section,) = playback([replace(trace, about=dict(trace.about) | {"mechanism": "../x"})])
    assert "no picture of the mechanism ../x" in section.text
    assert section.template == "section.html"


@pytest.mark.parametrize("size", [1e-16, 1e-1])
def test_a_force_of_rounding_is_no_arrow(size: float) -> None:
    """A scale of 1e-16 N beside a robot that falls freely says nothing."""
    given = trace_of(cases.load("bouncing_ball", "listing"))
    run = given.run
    energy = np.c_[run.t, run.t]
    given = replace(given, run=replace(run, lam=size * np.ones_like(run.lam), energy=energy))
    found = packed([given], scenes.load("ball"))
    drawn = size > 1e-9
    assert (found["force"] > 0.0) == drawn
    assert bool(found["tracks"][0]["arrows"]["bdata"]) == drawn


@pytest.mark.parametrize("types", [("plane", "sphere"), ("plane", "box"), ("plane", "cylinder"), ("sphere", "box"),
                                   ("sphere", "sphere"), ("capsule", "capsule")])  # fmt: skip
@pytest.mark.parametrize("seed", range(3))
def test_the_whole_force_of_a_contact_has_the_power_of_all_its_rows(types: tuple[str, str], seed: int) -> None:
    """On the second body, and as large against the first: what the equations make of multipliers and rates of rows."""
    rng = np.random.default_rng(seed)
    turned = Rotation.random(2, rng=rng).as_quat(scalar_first=True)
    shapes = [
        Shape(name=f"s{i}", body=f"b{i}", type=kind, size=tuple(rng.uniform(0.1, 0.3, 3)))
        for i, kind in enumerate(types)
    ]
    pair = Pair(name="p", first="s0", second="s1", dimension=3, friction=(0.7, 0.7, 0.0, 0.0, 0.0))
    scene = Scene(
        bodies=tuple(Body(name=f"b{i}", mass=1.0, inertia=(0.1, 0.2, 0.25, 0.0, 0.0, 0.0)) for i in range(2)),
        joints=tuple(Joint(name=f"j{i}", body=f"b{i}", type="free") for i in range(2)),
        shapes=tuple(shapes), pairs=(pair,),
    )  # fmt: skip
    x = rng.normal(size=(2, 3))
    q = np.concatenate([np.concatenate([at, turn]) for at, turn in zip(x, turned, strict=True)])
    v = rng.normal(size=12)
    case = cases.from_scene(scene, q0=q, v0=v, t_end=1.0)
    system = equations(case)
    assert system is not None
    own = {"scene": plain(scene)}
    for _ in range(3):  # until both touch, where they meet on either is one place
        gap, _ = system.gaps_along(q[None], v[None])
        at = scenes.load("scene").arrows(q[None], np.eye(1, gap.shape[1], 0), own)[0]
        q[7:10] -= gap[0, 0] * at[0, 3:]
    rates, lam = system.gaps_along(q[None], v[None])[1][0], rng.uniform(1.0, 2.0, gap.shape[1])
    count = gap.shape[1] // 3
    pushed = scenes.load("scene").arrows(q[None], np.repeat([[1.0, 0.0]], [count, 2 * count], axis=1), own)[0]
    missing = np.flatnonzero(~pushed[:, 3:].any(axis=1))  # capsules that cross meet at one place alone
    lam[[*missing, *(count + 2 * missing), *(count + 2 * missing + 1)]] = 0.0
    arrows = scenes.load("scene").arrows(q[None], lam[None], own)[0]
    turns = Rotation.from_quat(np.array([q[3:7], q[10:14]]), scalar_first=True)
    spin = turns.apply(v.reshape(2, 6)[:, 3:])
    moved = [v.reshape(2, 6)[i, :3] + np.cross(spin[i], arrows[:, :3] - q.reshape(2, 7)[i, :3]) for i in range(2)]
    power = ((moved[1] - moved[0]) * arrows[:, 3:]).sum()
    assert power == pytest.approx(lam @ rates, rel=1e-6, abs=1e-6)
    assert np.abs(lam[len(arrows) :] @ rates[len(arrows) :]) > 1e-3, "of friction, too"


def test_friction_is_drawn_of_the_instant_at_which_its_contact_presses_most() -> None:
    rng = np.random.default_rng(8)
    lam, ends = rng.uniform(-1.0, 1.0, (60, 4)), np.array([1, 20, 45, 60])
    for before, end, found in zip(
        [0, *ends[:-1]], ends, peaks(lam, ends, led(["a", "b", "a t1", "a t2"])), strict=True
    ):
        part = lam[before:end]
        at = np.abs(part[:, 0]).argmax()
        assert found.tolist() == [part[at, 0], part[np.abs(part[:, 1]).argmax(), 1], *part[at, 2:]]


@pytest.mark.parametrize("kind", ["sphere", "cylinder", "capsule"])
def test_a_mark_of_what_is_round_lies_on_it_and_no_turn_leaves_it_where_it_is(kind: str) -> None:
    shape = Shape(name="s", body="b", type=kind, size=(0.3, 0.5, 0.0), position=(0.1, 0.2, 0.3))
    scene = Scene(bodies=(Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)),),
                  joints=(Joint(name="j", body="b", type="free"),), shapes=(shape,))  # fmt: skip
    (solid,) = scenes.load("scene").stage({"scene": plain(scene)}).solids
    marks = np.concatenate([np.array(line) for line in solid["marks"]]) - [*shape.position, 0.0, 0.0, 0.0]
    at, out = marks[:, :3], marks[:, 3:]
    if kind == "sphere":
        assert np.allclose(np.linalg.norm(at, axis=1), 0.3, atol=1e-4)
        assert np.allclose(out, at / 0.3, atol=1e-3)
    elif kind == "cylinder":
        assert np.allclose(np.abs(at[:, 2]), 0.5)
        assert np.allclose(out[:, 2], np.sign(at[:, 2]))
    else:
        assert np.allclose(np.hypot(at[:, 0], at[:, 1]), 0.3)
    for axis in np.eye(3):
        there = Rotation.from_rotvec(0.4 * axis).apply(at)
        assert max(np.linalg.norm(at - one, axis=1).min() for one in there) > 0.05
