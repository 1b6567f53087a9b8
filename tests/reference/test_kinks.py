"""Forces bend at clamps, dead bands and rest, gaps where the nearest point leaves a face: instants of their own."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from friction_scenes import ON_TOP, RIDES, ball_on_solid
from random_scenes import random_scene, random_state

from crossbody.cases import Control, Law, Outcome
from crossbody.cases.scene import Actuator, Body, Joint, Scene, Tendon
from crossbody.cases.scene_contacts import rows_of
from crossbody.reference import System, simulate
from crossbody.reference.linear import linearise, sensitivity
from crossbody.reference.tree.system import system

KP, LOW, HIGH = 40.0, -3.0, 2.0
SIDES = {1: "inside", 2: "low", 3: "high"}


def made(scene: Scene, **more: Any) -> System:
    _, laws, unilateral = rows_of(scene)
    a0, a1 = (np.array([getattr(one, name) for one in laws]) for name in ("a0", "a1"))
    return system(scene, Law(a0=a0, a1=a1, a2=np.zeros(len(laws)), unilateral=unilateral), **more)


def across(one: System) -> System:
    """The same system, whose sides are told by values alone, so that steps go across."""
    parts = {name: getattr(one, name) for name in ("a0", "a1", "a2", "unilateral", "n", "nq", "above", "scratch")}
    parts |= {name: getattr(one, name) for name in ("dynamics", "gaps", "rows", "energy", "power", "inputs", "latched")}
    return System(**parts, parameters=one.parameters, discrete=one.discrete)


def on_a_rail(*, damping: tuple[float, ...] = (0.0, 0.0, 0.0), gravity: float = 0.0, **parts: Any) -> Scene:
    body = Body(name="cart", mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))
    joint = Joint(name="rail", body="cart", type="slide", axis=(1.0, 0.0, 0.0), damping=damping)
    return Scene(bodies=(body,), joints=(joint,), gravity=(gravity, 0.0, 0.0), **parts)


def servo(low: float = LOW, high: float = HIGH, kp: float = KP, kd: float = 0.0, **more: Any) -> Scene:
    actuator = Actuator(name="servo", joint="rail", gain=(kp, 0, 0), bias=(0, -kp, -kd), force_range=(low, high))
    return on_a_rail(actuators=(actuator,), **more)


def swing(t_end: float) -> tuple[list[float], float]:
    """Instants at which a unit mass that starts at 1 at rest meets the ends of -KP x in LOW .. HIGH; x at the end."""
    t, x, v, times, w, force, other = 0.0, 1.0, 0.0, [], np.sqrt(KP), LOW, HIGH
    while True:
        edge = -force / KP  # the force is constant until it is back there
        lasts = -v / force + np.sqrt((v / force) ** 2 + 2.0 * (edge - x) / force)
        if t + lasts >= t_end:
            s = t_end - t
            return times, x + v * s + 0.5 * force * s * s
        t, x, v = t + lasts, edge, v + force * lasts
        size, phase = np.hypot(x, v / w), np.arctan2(v / w, x)  # then it swings as a cosine, until the other bound
        turns = phase + np.arccos(-other / KP / size) * np.array([-1.0, 1.0])
        lasts = np.min(turns[turns > 0.0]) / w
        times.append(t)
        if t + lasts >= t_end:
            return times, size * np.cos(w * (t_end - t) - phase)
        t, x, v = t + lasts, -other / KP, -size * w * np.sin(w * lasts - phase)
        times.append(t)
        force, other = other, force


@pytest.mark.parametrize("solver", ["compiled", "cvode", "ida"])
def test_a_clamp_is_met_at_its_instant(solver: str) -> None:
    """The order over six tolerances, the instants to 1e-11 s, and the account of energy closed across them."""
    times, end = swing(5.0)
    one = made(servo())
    for rtol in 10.0 ** -np.arange(6.0, 13.0):
        run = simulate(one, [1.0], [0.0], 5.0, rtol=rtol, solver=solver, ledger=True)
        assert run.outcome is Outcome.FINISHED
        found = [switch.t for switch in run.switches]
        assert len(found) == len(times) == 6
        assert all(switch.smooth for switch in run.switches)
        assert np.abs(np.subtract(found, times)).max() <= 20.0 * rtol + 2e-13
        assert abs(run.q[-1, 0] - end) <= 50.0 * rtol + 1e-13
        energy, ledger = run.energy.sum(axis=1), run.ledger
        assert np.abs(energy - energy[0] - ledger.input + ledger.dissipated).max() <= 200.0 * rtol
    assert np.abs(np.subtract(found, times)).max() <= 1e-11


@pytest.mark.parametrize("rtol", [1e-8, 1e-10, 1e-12])
def test_a_step_up_to_a_clamp_is_cheaper_than_one_across(rtol: float) -> None:
    here, there = (simulate(one, [1.0], [0.0], 5.0, rtol=rtol) for one in (made(servo()), across(made(servo()))))
    assert there.outcome is Outcome.FINISHED
    assert here.counts["rhs"] < there.counts["rhs"]
    assert here.counts["rejected"] < there.counts["rejected"]
    end = swing(5.0)[1]
    assert abs(here.q[-1, 0] - end) <= max(abs(there.q[-1, 0] - end), 1e-13)


BOUNDED = {
    "force": servo(),
    "sum": servo(-9.0, 9.0).replace(
        joints=(replace(servo().joints[0], force_range=(-1.5, 2.5)),),
        actuators=(*servo(-9.0, 9.0).actuators, replace(servo(-2.0, 1.0, 7.0).actuators[0], name="second")),
    ),
    "dead band": on_a_rail(tendons=(
        Tendon(name="band", joints=("rail",), coefficients=(0.8,), stiffness=(30.0, 2.0, 5.0), rest=(-0.2, 0.3)),
    )),
    "string": on_a_rail(tendons=(
        Tendon(name="band", bodies=("", "cart"), positions=((-2.0, 0.1, 0.0), (0.0, 0.0, 0.0)), stiffness=(30.0, 0, 0),
               rest=(1.7, 2.2)),
    )),
    "drag": on_a_rail(
        damping=(0.0, 0.4, 0.0), tendons=(Tendon(name="spring", joints=("rail",), coefficients=(1.0,),
                                                 stiffness=(20.0, 0.0, 0.0), damping=(0.0, 0.3, 0.0)),),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BOUNDED)
def test_every_kink_is_met_at_its_order(name: str) -> None:
    """Both machines against steps of a hundredth, at a tolerance that no step across a kink is bound by."""
    one = made(BOUNDED[name])
    fine = simulate(across(one), [1.0], [0.3], 3.0, rtol=1e-13, max_step=1e-3)
    assert fine.outcome is Outcome.FINISHED
    ends = []
    for solver in ("compiled", "cvode"):
        run = simulate(one, [1.0], [0.3], 3.0, rtol=1e-10, solver=solver)
        assert run.switches
        assert np.abs(run.q[-1] - fine.q[-1]).max() <= 1e-8
        ends.append([switch.t for switch in run.switches])
    assert np.abs(np.subtract(*ends)).max() <= 1e-8


def test_what_has_no_kink_watches_nothing() -> None:
    """Bounds that a force cannot come to while its control holds, and springs without a dead band, are none."""
    motor = Actuator(name="motor", joint="rail", force_range=(-1.0, 1.0), control_range=(-2.0, 2.0))
    spring = Tendon(name="spring", joints=("rail",), coefficients=(1.0,), stiffness=(3.0, 0.0, 0.0), rest=(0.1, 0.1))
    for scene in (servo(-np.inf, np.inf), on_a_rail(actuators=(motor,), tendons=(spring,), damping=(1.0, 0.0, 0.2))):
        one = made(scene)
        assert one.guards == one.kinks == 0
        assert one.watch is None


@pytest.mark.parametrize("kp", [1e2, 1e6])
@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
@pytest.mark.parametrize("off", [0.0, 1e-12, -1e-9])
def test_a_force_that_comes_to_rest_at_its_clamp_stays_on_one_side(kp: float, rtol: float, off: float) -> None:
    """What carries the weight is the bound itself: the motion decays to the kink, and its noise crosses no band."""
    scene = servo(-50.0, 10.0 * (1.0 + off), kp, 2.0 * np.sqrt(kp), gravity=-10.0)
    for solver in ("compiled", "cvode"):
        run = simulate(made(scene), [0.01], [0.0], 20.0, rtol=rtol, solver=solver, max_steps=200_000)
        assert run.outcome is Outcome.FINISHED
        assert len(run.switches) <= 12


def test_a_controller_and_inputs_put_sides_anew() -> None:
    """Where the control jumps a force may jump across its bounds; an activation comes to its end between two ticks."""
    one = made(servo())
    table = ([0.0, 0.3, 0.7, 1.1], [[0.0], [0.2], [-3.0], [0.05]])
    fine = simulate(across(one), [0.2], [0.0], 2.0, rtol=1e-13, max_step=1e-3, inputs=table)
    for solver in ("compiled", "ida"):
        run = simulate(one, [0.2], [0.0], 2.0, rtol=1e-10, solver=solver, inputs=table)
        assert np.abs(run.q[-1] - fine.q[-1]).max() <= 1e-9
        assert {0.7, 1.1} <= {switch.t for switch in run.switches}
    lag = Actuator(name="lag", joint="rail", gain=(3.0, 0, 0), bias=(0, -2, 0), activation="integrator",
                   activation_range=(-0.1, 0.25))  # fmt: skip

    def pushes(t: float, q: Any, v: Any) -> list[float]:
        return [1.0 if t < 0.8 else -1.5]

    scene = on_a_rail(actuators=(lag,))
    run = simulate(made(scene, control=Control(pushes, tick=0.2, width=1)), [0.2], [0.0], 2.0, rtol=1e-11)
    times = [switch.t for switch in run.switches]
    assert np.abs(np.subtract(times, [0.25, 0.8, 0.8 + 0.35 / 1.5])).max() <= 1e-12
    given = simulate(made(scene), [0.2], [0.0], 2.0, rtol=1e-11, inputs=([0.0, 0.8], [[1.0], [-1.5]]))
    assert np.abs(given.q[-1] - run.q[-1]).max() <= 1e-10


def test_derivatives_go_through_a_clamp() -> None:
    """The force goes on at a kink, so that what is known of deviations does too; on each side a linear model holds."""
    one = made(servo(kd=0.5))
    run = sensitivity(one, [1.0], [0.0], 1.5)
    assert run.run.switches
    step = 1e-6
    ends = [simulate(one, [1.0 + s], [0.0], 1.5, rtol=1e-12) for s in (step, -step)]
    slope = [(a[-1, 0] - b[-1, 0]) / (2.0 * step) for a, b in ((ends[0].q, ends[1].q), (ends[0].v, ends[1].v))]
    assert np.abs(run.by_start[:, 0] - slope).max() <= 1e-6
    for q, stiffness in ((0.01, KP), (1.0, 0.0), (-1.0, 0.0)):
        assert np.abs(linearise(one, [q]).A - [[0.0, 1.0], [-stiffness, -0.5 * (stiffness > 0.0)]]).max() <= 1e-12


@pytest.mark.parametrize("name", RIDES)
def test_a_ball_goes_over_the_end_of_a_face_at_an_instant(name: str) -> None:
    """The gap's curvature jumps where the nearest point comes to an edge, and with it what presses."""
    one, q0, v0 = made(ball_on_solid(name)), [*ON_TOP], [0.6, 0.0]
    fine = simulate(across(one), q0, v0, 0.7, rtol=1e-13, max_step=1e-4)
    runs = [simulate(one, q0, v0, 0.7, rtol=1e-10, solver=solver) for solver in ("compiled", "cvode")]
    for run in runs:
        (edge,) = [switch for switch in run.switches if SIDES[switch.before] == "inside"]
        assert abs(edge.t - 0.5) <= 1e-9
        assert np.abs(run.q[-1] - fine.q[-1]).max() <= 1e-8
    loose = [simulate(each, q0, v0, 0.7, rtol=1e-10) for each in (one, across(one))]
    assert loose[0].counts["rhs"] <= loose[1].counts["rhs"]


def agree(seed: int) -> tuple[int, float]:
    """Switches of kinks in a random scene, and how far two machines that look for them apart end from each other."""
    scene = random_scene(seed, ("hinge", "slide", "ball"), bodies=3).replace(shapes=(), pairs=(), loops=())
    scene = scene.replace(joints=tuple(replace(joint, range=(-np.inf, np.inf)) for joint in scene.joints))
    tendons = tuple(replace(tendon, range=(-np.inf, np.inf)) for tendon in scene.tendons)
    one = made(scene.replace(tendons=tendons))
    q, v, u = random_state(scene, np.random.default_rng(seed))
    runs = [simulate(one, q, v, 0.5, rtol=1e-10, solver=solver, inputs=([0.0], [u]), max_steps=20_000)
            for solver in ("compiled", "cvode")]  # fmt: skip
    assert [run.outcome for run in runs] == [Outcome.FINISHED] * 2
    here, there = ([(switch.variable, switch.after) for switch in run.switches] for run in runs)
    assert here == there
    return len(here), float(np.abs(runs[0].q[-1] - runs[1].q[-1]).max() / np.abs(runs[0].q).max())


@pytest.mark.parametrize("seeds", [range(8), pytest.param(range(8, 150), marks=pytest.mark.slow)])
def test_machines_agree_on_random_kinks(seeds: range) -> None:
    found = [agree(seed) for seed in seeds]
    assert sum(count for count, _ in found) >= len(found)
    assert max(off for _, off in found) <= 1e-7


def test_what_is_never_met_changes_nothing() -> None:
    """Bounds of forces that no motion comes near: the same steps, to the last digit, as without them."""
    met = 0
    for seed in range(12):
        scene = random_scene(seed, ("hinge", "slide"), bodies=3).replace(shapes=(), pairs=(), loops=())
        ends = {"range": (-np.inf, np.inf)}
        joints = tuple(replace(one, force_range=(-np.inf, np.inf), **ends) for one in scene.joints)
        scene = scene.replace(joints=joints, tendons=tuple(replace(one, **ends) for one in scene.tendons))
        q, v, u = random_state(scene, np.random.default_rng(seed))
        runs = []
        for most in (1e6, np.inf):
            bounded = tuple(replace(one, force_range=(-most, most)) for one in scene.actuators)
            one = made(scene.replace(actuators=bounded))
            met += np.isfinite(most) and one.kinks > 0
            runs.append(simulate(one, q, v, 0.5, rtol=1e-9, inputs=([0.0], [u]), max_steps=20_000))
        assert runs[0].outcome is Outcome.FINISHED
        assert np.array_equal(runs[0].q, runs[1].q)
        assert runs[0].counts["rhs"] == runs[1].counts["rhs"]
    assert met > 6
