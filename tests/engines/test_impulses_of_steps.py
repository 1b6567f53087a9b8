"""What engines say of their forces is what changed momenta and energies: of a sphere that is thrown on a floor."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from friction_scenes import G, sphere_on_floor

from crossbody import cases, engines
from crossbody.cases import Acts, Case, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.files.case import case_of
from crossbody.reports.measuring.friction import rubbed
from crossbody.reports.measuring.impulse import cumulated, cumulative

RADIUS = 0.1
STEPPED: Mapping[tuple[str, str], Acts] = {
    ("mujoco", "default"): Acts.BEHIND, ("pinocchio", "admm"): Acts.BEFORE, ("drake", "matched"): Acts.BEFORE,
    ("drake", "default"): Acts.BEFORE, ("dart", "matched"): Acts.BEFORE, ("dart", "default"): Acts.BEFORE,
}  # fmt: skip
ROUNDING = {"mujoco": 1e-12, "pinocchio": 1e-9, "drake": 1e-9, "dart": 1e-9}
"""By the largest momentum: what each solver leaves open of its own equations."""


def thrown(seed: int) -> Case:
    """Return a sphere of 1 kg above a floor, which it meets at least once, slips on and is turned by."""
    draw = np.random.default_rng(seed)
    v = [*draw.uniform(-3.0, 3.0, 2), draw.uniform(-2.0, 0.0), *draw.uniform(-20.0, 20.0, 3)]
    scene = sphere_on_floor(draw.uniform(0.1, 0.8), RADIUS)
    return case_of(scene, q0=[0, 0, RADIUS + draw.uniform(0.0, 0.2), 1, 0, 0, 0], v0=v, t_end=0.6, name="thrown")


def ran(who: tuple[str, str], case: Case, **settings: Any) -> Trajectory:
    try:
        return engines.load(who[0]).prepare(case, who[1], **settings).run()
    except cases.EngineUnavailable as error:
        pytest.skip(str(error))


def momentum(run: Trajectory) -> Floats:
    """Return what forces of contacts gave to a mass of 1 kg since the start (n, 3), N s: up, and along the floor."""
    gained = run.v[:, :3] - run.v[0, :3] + np.outer(run.t, [0.0, 0.0, G])
    return gained[:, [2, 0, 1]]


def energy(run: Trajectory) -> Floats:
    """Return the kinetic energy that friction alone changes (n,), J."""
    turns = run.v[:, 3:] ** 2
    return 0.5 * (run.v[:, 0] ** 2 + run.v[:, 1] ** 2 + 0.4 * RADIUS**2 * turns.sum(axis=1))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("who", STEPPED)
def test_impulses_are_what_momenta_gained_and_work_is_what_energy_did(who: tuple[str, str], seed: int) -> None:
    case = thrown(seed)
    run = ran(who, case)
    assert run.acts == STEPPED[who]
    found, wanted = cumulative(run), momentum(run)
    pressed = np.abs(wanted[:, 0]).max()
    assert pressed > 1.0
    np.testing.assert_allclose(found[:, 0], wanted[:, 0], atol=ROUNDING[who[0]] * pressed)
    np.testing.assert_allclose(
        np.linalg.norm(found[:, 1:], axis=1), np.linalg.norm(wanted[:, 1:], axis=1), atol=ROUNDING[who[0]] * pressed
    )
    rubs = rubbed(run, case)
    assert rubs is not None
    works = cumulated(run, rubs.force[:, 0], rubs.slip[:, 0]).sum(axis=1)
    gained, lever = energy(run), -float(run.gap[:, 0].min()) / RADIUS  # an engine's force acts within the overlap
    np.testing.assert_allclose(works, gained - gained[0], atol=(lever + 10.0 * ROUNDING[who[0]]) * gained[0])


BALL = """<mujoco><option integrator="{}" timestep="0.003"/><worldbody><geom name="floor" type="plane" size="1 1 1"/>
<body name="ball" pos="0 0 .15"><freejoint/><geom type="sphere" size=".1" mass="1"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
def test_every_method_of_first_order_tells_the_force_of_the_next_step(integrator: str, tmp_path: Path) -> None:
    path = tmp_path / "ball.xml"
    path.write_text(BALL.format(integrator))
    run = ran(("mujoco", "as_is"), cases.from_file(path, t_end=0.6, friction=1))
    assert run.acts == (Acts.GRID if integrator == "RK4" else Acts.BEHIND)
    off = np.abs(cumulative(run)[:, 0] - momentum(run)[:, 0]).max() / momentum(run)[:, 0].max()
    assert off < (0.2 if integrator == "RK4" else 1e-9)


@pytest.mark.parametrize("t_end", [1.0, *np.random.default_rng(15).uniform(0.9, 1.1, 3)])  # ends within a step too
@pytest.mark.parametrize("variant", ["linear", "resting"])
@pytest.mark.parametrize(
    "who", [("mujoco", "default"), ("pinocchio", "admm"), ("dart", "matched"), ("pymunk", "matched")]
)
def test_impulses_of_a_bouncing_ball_are_what_its_momentum_gained(
    who: tuple[str, str], variant: str, t_end: float
) -> None:
    case = cases.load("bouncing_ball", variant, t_end=t_end)
    run = ran(who, case, dt=3e-3)
    assert run.acts in (Acts.BEFORE, Acts.BEHIND)
    mass = float(case.parameters["mass"])
    gained = mass * (run.v[:, 0] - run.v[0, 0] + float(case.parameters["gravity"]) * run.t)
    np.testing.assert_allclose(cumulative(run)[:, 0], gained, atol=1e-9 * np.abs(gained).max())
