"""The energy account: E(t) - E(0) = input - dissipated + work of every row."""

from dataclasses import replace

import numpy as np
import pytest
from friction_scenes import LAW, G, box_on_floor, run
from gusty import gusty
from mechanisms import ball, flyby, oscillator, sliders
from wall_pendulum import wall_pendulum

from crossbody import cases, engines
from crossbody.cases import Outcome
from crossbody.cases.scene import Body, Joint, Scene
from crossbody.reference import System, kernels, simulate

SCENES = {
    "listing": (ball(), [1.0], [0.0], {}),
    "elastic": (ball(a1=0.0), [1.0], [0.0], {}),
    "start below": (ball(), [-0.01], [0.0], {}),
    "oscillator": (oscillator(-0.5), [1.0], [0.0], {}),
    "pendulum": (flyby(1.0, 9.81, a0=25.0, a1=10.0, unilateral=False), [1.0, 0.0], [0.0, 0.0], {}),
    "sliders": (sliders(4, a1=30.0), [0.0, 0.01, 0.02, 0.03], [1.0, 0.0, 0.0, 0.0], {}),
    "stiff rest": (ball(a0=1e8, a1=2e4, a2=0.0), [0.01], [0.0], {}),
}


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("name", SCENES)
def test_ledger_closes(name, rtol):
    system, q0, v0, more = SCENES[name]
    run = simulate(system, q0, v0, 2.0, rtol=rtol, ledger=True, **more)
    assert run.outcome.ok, run.message
    account = run.ledger.input - run.ledger.dissipated + run.ledger.contact.sum(axis=1)
    residual = run.total_energy - run.total_energy[0] - account
    scale = run.energy[:, 0].max() + np.ptp(run.energy[:, 1])
    assert np.abs(residual).max() < 200.0 * rtol * scale + 1e-13


@pytest.mark.parametrize("pole", [1e3, 3e3, 1e4])
def test_ledger_closes_inside_long_steps_of_stiff_rows_too(pole):
    """At samples between the ends of implicit steps, while a force drives a pendulum through a fluid."""
    system, grid = wall_pendulum(5.0, pole=pole, drag=0.5), np.linspace(0.0, 2.0, 977)
    for rtol in (1e-6, 1e-7):
        run = simulate(
            system, [np.sin(-0.5), -np.cos(0.5)], [0.0, 0.0], 2.0, rtol=rtol, ledger=True, samples=grid,
            inputs=([0.0, 0.5], [[1.0], [-2.0]]),
        )  # fmt: skip
        assert run.counts["implicit_steps"] > 10
        account = run.ledger.input - run.ledger.dissipated + run.ledger.contact.sum(axis=1)
        residual = run.total_energy - run.total_energy[0] - account
        assert np.abs(residual).max() < 10.0 * rtol * run.energy[:, 0].max()


@pytest.mark.parametrize("seed", range(6))
def test_the_ledger_grows_by_the_power_at_every_instant(seed):
    """Of a force and a fluid, by hand, at samples in pairs inside steps of any method."""
    rng, rtol, apart, change = np.random.default_rng(seed), 1e-6, 1e-6, 0.503
    drag, force, start = rng.uniform(0.2, 2.0), 3.0 * rng.normal(size=2), rng.uniform(-1.0, 1.0)
    system, middle = wall_pendulum(5.0, pole=10.0 ** rng.uniform(3.0, 4.0), drag=drag), np.linspace(0.01, 1.99, 499)
    run = simulate(
        system, [np.sin(start), -np.cos(start)], [0.0, 0.0], 2.0, rtol=rtol, ledger=True,
        samples=np.sort(np.concatenate([middle - apart, middle, middle + apart])),
        inputs=([0.0, change], force[:, None]),
    )  # fmt: skip
    assert run.counts["implicit_steps"] > 10
    i = np.searchsorted(run.t, middle)
    powers = np.where(middle < change, *force) * run.v[i, 0], drag * np.sum(run.v[i] ** 2, axis=1)
    for taken, power in zip((run.ledger.input, run.ledger.dissipated), powers, strict=True):
        rate = (taken[i + 1] - taken[i - 1]) / (run.t[i + 1] - run.t[i - 1])
        assert np.abs(rate - power).max() <= 10.0 * rtol * np.abs(power).max()


PULLED = """
<mujoco><worldbody>
<geom name="floor" type="plane" size="5 5 1" friction="{mu} 0 0" condim="3" solref="-10000 -200"/>
<body pos="0 0 0.1"><joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
<joint name="z" type="slide" axis="0 0 1"/>
<geom type="sphere" size="0.1" mass="1" friction="{mu} 0 0" condim="3" solref="-10000 -200"/></body></worldbody>
<actuator><general name="px" joint="x" dyntype="integrator" gainprm="1"/>
<general name="py" joint="y" dyntype="integrator" gainprm="1"/></actuator>
<keyframe><key name="pulled" qpos="0 0 0" ctrl="{pull}"/></keyframe></mujoco>
"""


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
def test_ledger_closes_inside_steps_while_a_force_grows(seed, rtol, tmp_path):
    """A block is pulled ever harder, sticks and slides: steps are long, and work in them grows with t^4."""
    rng = np.random.default_rng(seed)
    pull, path = rng.uniform(15.0, 40.0, 2), tmp_path / "pulled.xml"
    path.write_text(PULLED.format(mu=0.3, pull=f"{pull[0]} {pull[1]}"), encoding="utf-8")
    case = cases.load(str(path), "pulled", t_end=0.4, friction=1)
    run = engines.load("reference").prepare(case, "compiled", rtol=rtol, samples=977).run()
    assert run.outcome.ok, run.message
    assert run.counts["implicit_steps"] > 0
    done = run.ledger.contact.sum(axis=1) + run.ledger.input - run.ledger.dissipated
    open_by = np.abs(run.total_energy - run.total_energy[0] - done)
    assert open_by.max() < 200.0 * rtol * (run.ledger.input.max() + run.energy[:, 0].max())


def test_work_of_one_bounce_is_the_law_s():
    # No gravity, linear law: the row takes m v^2 (1 - e^2) / 2.
    system = ball(a0=1e4, a1=40.0, a2=0.0, gravity=0.0)
    run = simulate(system, [0.01], [-1.0], 0.1, rtol=1e-11, ledger=True)
    assert run.ledger.contact[-1, 0] == pytest.approx(0.5 * (run.v[-1, 0] ** 2 - 1.0), rel=1e-9)


def test_input_force_does_no_work_without_a_power_kernel():
    run = simulate(gusty(), [0.5], [0.0], 0.1, ledger=True)
    assert np.all(run.ledger.input == 0.0)


@kernels.power
def _half_the_input(t, q, v, u, p, e):
    e[0], e[1] = 0.5 * u[0] * v[0], 0.0


def _pushed(power):
    base = gusty()
    return System(
        n=1, inputs=1, parameters=base.p, a0=base.a0, a1=base.a1, dynamics=base.dynamics, gaps=base.gaps,
        rows=base.rows, energy=base.energy, power=power,
    )  # fmt: skip


@kernels.power
def _all_of_the_input(t, q, v, u, p, e):
    e[0], e[1] = u[0] * v[0], 0.0


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-9, 1e-12])
def test_an_account_that_stays_open_is_not_finished(rtol):
    """What the power kernel leaves out is missing, and told; the same run with it closes."""
    inputs = ([0.0, 0.3, 0.6], [[2.0], [-3.0], [0.0]])
    wrong, right = (
        simulate(_pushed(power), [0.5], [0.0], 1.0, rtol=rtol, ledger=True, inputs=inputs)
        for power in (_half_the_input, _all_of_the_input)
    )
    assert wrong.outcome is Outcome.INCONSISTENT
    assert "energy account is open by" in wrong.message
    assert right.outcome.ok, right.message
    assert simulate(_pushed(_half_the_input), [0.5], [0.0], 1.0, rtol=rtol, inputs=inputs).outcome.ok


@kernels.dynamics
def _comet(t, q, v, u, p, M, f, w):
    r = np.sqrt(q[0] * q[0] + q[1] * q[1])
    for i in range(2):
        M[i, 0] = 1.0
        f[i] = -q[i] / r**3


@kernels.gaps
def _no_gaps(t, q, v, p, h, hd):
    pass


@kernels.rows
def _no_rows(t, q, v, p, w, idx, na, H, h, Hdv):
    pass


@kernels.energy
def _comet_energy(q, v, p, e):
    e[0] = 0.5 * (v[0] * v[0] + v[1] * v[1])
    e[1] = -1.0 / np.sqrt(q[0] * q[0] + q[1] * q[1])


@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-6])
@pytest.mark.parametrize("aside", [1e-1, 1e-2, 1e-3, 1e-4])
def test_energy_that_is_lost_in_an_instant_of_far_more_is_told(aside, rtol):
    """A comet that falls within aside^2 / 2 of its sun has as many times its energy there: it may leave with any."""
    system = System(n=2, mass_block=1, dynamics=_comet, gaps=_no_gaps, rows=_no_rows, energy=_comet_energy)
    run = simulate(system, [1.0, 0.0], [0.0, aside], 2.0, rtol=rtol, ledger=True)
    energy = run.total_energy
    if run.outcome is Outcome.FINISHED:
        assert abs(energy[-1] - energy[0]) < 2.0 * abs(energy[0])
    else:
        assert aside < 1e-1
        assert run.outcome is Outcome.STEP_TOO_SMALL or "there was far more energy before" in run.message


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(60))
def test_random_runs_close_their_account_by_far(seed):
    """What is taken for open lies far above what steps leave, whatever stiffness, tolerance and start."""
    rng = np.random.default_rng(seed)
    a0 = 10.0 ** rng.uniform(2, 9)
    system = ball(
        a0=a0, a1=rng.uniform(0, 3) * a0**0.5, a2=rng.choice([0.0, 1e6]), mass=10.0 ** rng.uniform(-3, 3),
        gravity=rng.uniform(1, 20),
    )  # fmt: skip
    rtol = 10.0 ** rng.uniform(-11, -3)
    run = simulate(system, [rng.uniform(-0.01, 2)], [rng.normal()], 2.0, rtol=rtol, ledger=True, shortcuts=False)
    assert run.outcome.ok, run.message


def test_a_first_step_that_is_some_tolerances_off_contradicts_nothing():
    """A stiff ball begins inside the floor: its first step is fourteen times off what the tolerance adds."""
    values = {"a0": 121796.9705728013, "a1": 570.2599202694515, "height": -0.005680055905624148}
    case = cases.load("bouncing_ball", "linear", t_end=0.5, speed=-0.9301994487774878, **values)
    assert engines.load("reference").prepare(case, "compiled").run().outcome.ok


@pytest.mark.parametrize("mu", [0.0, 0.5])
@pytest.mark.parametrize("sunk", [0.0, 0.25])
def test_what_rests_without_any_energy_has_an_account(mu: float, sunk: float) -> None:
    """Loads over the tolerance of positions are work too: of a weight at height 0 there is no other."""
    scene = box_on_floor(mu)
    floor, box = scene.shapes
    low = scene.replace(shapes=(floor, replace(box, position=(0.0, 0.0, 0.1))))
    found = run(low, [0, 0, -sunk * G / LAW.a0, 1, 0, 0, 0], np.zeros(6), 0.2, rtol=1e-9)
    assert found.outcome is Outcome.FINISHED, found.message


@pytest.mark.parametrize("kind", ["slide", "hinge"])
@pytest.mark.parametrize("seed", range(3))
def test_a_spring_stores_the_work_that_its_force_takes_from_where_it_rests(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    k, rest, q0 = rng.uniform(1.0, 20.0, 3), float(rng.normal()), float(rng.normal())
    body = Body(name="mass", mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))
    joint = Joint(name="way", body="mass", type=kind, axis=(0.0, 0.0, 1.0), stiffness=tuple(k), rest=(rest,))
    case = cases.from_scene(Scene(bodies=(body,), joints=(joint,), gravity=(0.0, 0.0, 0.0)), q0=[q0], t_end=1.0)
    motion = engines.load("reference").prepare(case, "compiled").run()
    x = motion.q[:, 0] - rest
    stored = k[0] * x**2 / 2.0 + k[1] * x**3 / 3.0 + k[2] * x**4 / 4.0
    assert np.ptp(x) > 0.1
    assert motion.energy[:, 1] == pytest.approx(stored, rel=1e-9, abs=1e-12 * stored.max())
