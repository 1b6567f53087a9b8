"""Loops carry a row on where nothing can hold it: dry friction of a slide turns round at its dead centres, unstuck."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from crossbody.cases import Mode, Outcome, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Loop, Scene
from crossbody.reference import simulate
from crossbody.reference.tree.system import system

CRANK, ROD = 0.2, 0.5  # m
LASTS = 0.05  # s
Losses = tuple[float, float, float]  # dry friction of crank and rod, N m, and of the slide, N


def slider_crank(losses: Losses, mass: float) -> Scene:
    """A crank of 1 kg, a rod of 1 kg and a slide, whose joints have dry friction, without gravity."""
    bodies = (
        Body(name="crank", mass=1.0, com=(CRANK / 2, 0, 0), inertia=(0.01, 0.01, 0.01, 0, 0, 0)),
        Body(name="rod", parent="crank", mass=1.0, com=(ROD / 2, 0, 0), inertia=(0.02, 0.02, 0.02, 0, 0, 0),
             position=(CRANK, 0, 0)),
        Body(name="slide", mass=mass, inertia=(0.01, 0.01, 0.01, 0, 0, 0), position=(CRANK + ROD, 0, 0)),
    )  # fmt: skip
    joints = (
        Joint(name="crank", body="crank", type="hinge", axis=(0, -1, 0), friction_loss=losses[0]),
        Joint(name="rod", body="rod", type="hinge", axis=(0, -1, 0), friction_loss=losses[1]),
        Joint(name="slide", body="slide", type="slide", axis=(1, 0, 0), friction_loss=losses[2]),
    )
    closed = Loop(name="pin", type="connect", first="rod", second="slide", first_position=(ROD, 0, 0))
    return Scene(bodies=bodies, joints=joints, loops=(closed,), gravity=(0, 0, 0))


def geometry(angle: float) -> tuple[float, float, float]:
    """Angle of the rod, what it turns by for one radian of the crank, and how far the slide moves, m."""
    rod = np.arcsin(CRANK * np.sin(angle) / ROD)
    turns = CRANK * np.cos(angle) / (ROD * np.cos(rod))
    return float(rod), float(turns), float(-CRANK * np.sin(angle) - ROD * np.sin(rod) * turns)


def moved(angle: float, speed: float, losses: Losses, mass: float, t_end: float) -> tuple[float, float]:
    """Angle and speed of the crank by Lagrange's equation of its single coordinate."""

    def inertia(at: float) -> float:
        rod, turns, slides = geometry(at)
        middle = np.array([-CRANK * np.sin(at) - ROD / 2 * np.sin(rod) * turns, CRANK / 2 * np.cos(at)])
        return float(0.01 + (CRANK / 2) ** 2 + middle @ middle + 0.02 * turns**2 + mass * slides**2)

    def rate(_t: float, y: np.ndarray) -> list[float]:
        e = 1e-4
        steep = (inertia(y[0] - 2 * e) - 8 * inertia(y[0] - e) + 8 * inertia(y[0] + e) - inertia(y[0] + 2 * e)) / 12 / e
        _, turns, slides = geometry(y[0])
        force = -np.sign(y[1]) * (losses[0] + losses[1] * abs(1.0 + turns) + losses[2] * abs(slides))
        return [y[1], (force - 0.5 * steep * y[1] ** 2) / inertia(y[0])]

    found = solve_ivp(rate, (0.0, t_end), [angle, speed], rtol=1e-11, atol=1e-13, method="DOP853", max_step=1e-3)
    return float(found.y[0, -1]), float(found.y[1, -1])


def run(angle: float, speed: float, losses: Losses, mass: float, t_end: float, rtol: float, solver: str) -> Trajectory:
    """The same as three bodies in a loop."""
    rod, turns, slides = geometry(angle)
    q = np.array([angle, -rod - angle, CRANK * np.cos(angle) + ROD * np.cos(rod) - CRANK - ROD])
    v = speed * np.array([1.0, -turns - 1.0, slides])
    scene = slider_crank(losses, mass)
    return simulate(system(scene, case_of(scene).law, q), q, v, t_end, rtol=rtol, solver=solver)


@pytest.mark.parametrize("solver", ["compiled", "cvode"])
@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
@pytest.mark.parametrize("seed", range(40))
def test_a_slide_turns_round_at_its_dead_centre_without_a_stop(seed: int, rtol: float, solver: str) -> None:
    rng = np.random.default_rng(seed)
    angle, speed = -rng.uniform(0.1, 0.4) * (seed % 4 > 0), rng.uniform(5.0, 15.0)
    losses = rng.choice([0.0, 0.02, 0.3]), rng.choice([0.0, 0.05]), 10.0 ** rng.uniform(-1, 0.5)
    mass = float(rng.uniform(0.1, 2.0))
    if seed % 2:
        angle, speed = -angle, -speed
    found = run(angle, speed, losses, mass, LASTS, rtol, solver)
    assert found.outcome is Outcome.FINISHED, found.message
    ends = moved(angle, speed, losses, mass, LASTS)
    np.testing.assert_allclose((found.q[-1, 0], found.v[-1, 0]), ends, rtol=30 * rtol)
    assert not [event for event in found.events if event.t > 0.0 and Mode.STICK in (event.before, event.after)]
