"""Loops carry a row on where nothing can hold it: dry friction of a slide turns round at its dead centres, unstuck."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from crossbody.cases import Mode, Outcome, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Loop, Scene, Tendon
from crossbody.reference import simulate
from crossbody.reference.tree.system import system

CRANK, ROD = 0.2, 0.5  # m
LASTS = 0.05  # s
Losses = tuple[float, float, float]  # dry friction of crank and rod, N m, and of the slide, N


def slider_crank(losses: Losses, mass: float, gravity: float = 0.0) -> Scene:
    """A crank of 1 kg, a rod of 1 kg and a slide, whose joints have dry friction."""
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
    return Scene(bodies=bodies, joints=joints, loops=(closed,), gravity=(0, 0, -gravity))


def geometry(angle: float) -> tuple[float, float, float]:
    """Angle of the rod, what it turns by for one radian of the crank, and how far the slide moves, m."""
    rod = np.arcsin(CRANK * np.sin(angle) / ROD)
    turns = CRANK * np.cos(angle) / (ROD * np.cos(rod))
    return float(rod), float(turns), float(-CRANK * np.sin(angle) - ROD * np.sin(rod) * turns)


def moved(
    angle: float, speed: float, losses: Losses, mass: float, t_end: float, gravity: float = 0.0
) -> tuple[float, float]:
    """Angle and speed of the crank by Lagrange's equation of its single coordinate."""

    def inertia(at: float) -> float:
        rod, turns, slides = geometry(at)
        middle = np.array([-CRANK * np.sin(at) - ROD / 2 * np.sin(rod) * turns, CRANK / 2 * np.cos(at)])
        return float(0.01 + (CRANK / 2) ** 2 + middle @ middle + 0.02 * turns**2 + mass * slides**2)

    def rate(_t: float, y: np.ndarray) -> list[float]:
        e = 1e-4
        steep = (inertia(y[0] - 2 * e) - 8 * inertia(y[0] - e) + 8 * inertia(y[0] + e) - inertia(y[0] + 2 * e)) / 12 / e
        _, turns, slides = geometry(y[0])
        force = -np.sign(y[1] or -gravity) * (losses[0] + losses[1] * abs(1.0 + turns) + losses[2] * abs(slides))
        force -= gravity * CRANK * np.cos(y[0])  # of the crank's middle and the rod's, 1 kg each
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


@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
@pytest.mark.parametrize("slide", [0.1, 1.0, 10.0])
def test_a_crank_falls_from_rest_at_its_dead_centre(slide: float, rtol: float) -> None:
    """Nothing asks the slide to move there, and it sticks; what it bears once it could move is not left unseen."""
    losses, mass, gravity = (0.05, 0.0, slide), 0.5, 9.81
    scene = slider_crank(losses, mass, gravity)
    q, v = np.zeros(3), np.zeros(3)
    found = simulate(system(scene, case_of(scene).law, q), q, v, LASTS, rtol=rtol)
    assert found.outcome is Outcome.FINISHED, found.message
    ends = moved(0.0, 0.0, losses, mass, LASTS, gravity)
    np.testing.assert_allclose((found.q[-1, 0], found.v[-1, 0]), ends, rtol=100 * rtol)


@pytest.mark.parametrize("solver", ["compiled", "cvode"])
@pytest.mark.parametrize("seed", range(24))
def test_a_tendon_turns_round_where_it_is_shortest(seed: int, solver: str) -> None:
    """There its friction moves nothing: one body on a hinge, of which a point is tied to one that does not move."""
    rng = np.random.default_rng([seed, 3])
    far, near, mass, inertia = 1.0, 0.4, 1.0, 0.02 + 0.09
    angle, speed = float(rng.choice([0.0, -0.3, -1e-3])), float(10.0 ** rng.uniform(-0.3, 1.3))
    tendon, hinge = float(rng.choice([0.1, 1.0, 10.0])), float(rng.choice([0.0, 0.01, 0.1]))
    scene = Scene(
        bodies=(Body(name="arm", mass=mass, com=(0.3, 0, 0), inertia=(0.02, 0.02, 0.02, 0, 0, 0)),),
        joints=(Joint(name="hinge", body="arm", type="hinge", axis=(0, -1, 0), friction_loss=hinge),),
        tendons=(Tendon(name="tie", bodies=("", "arm"), positions=((far, 0, 0), (near, 0, 0)), friction_loss=tendon),),
        gravity=(0, 0, 0),
    )
    q, v, t_end = np.array([angle]), np.array([speed]), 0.2 / speed
    found = simulate(system(scene, case_of(scene).law, q), q, v, t_end, rtol=1e-9, solver=solver)
    assert found.outcome is Outcome.FINISHED, found.message

    def length(at: float) -> float:
        return float(np.sqrt(far**2 + near**2 - 2.0 * far * near * np.cos(at)))

    # Of a body that only turns forward: friction takes what its path asks for, and no integration is needed.
    ends = float(found.q[-1, 0])
    way = (
        abs(length(ends) - length(0.0)) + abs(length(angle) - length(0.0))
        if angle < 0.0 < ends
        else (abs(length(ends) - length(angle)))
    )
    left = 0.5 * inertia * speed**2 - tendon * way - hinge * abs(ends - angle)
    assert 0.5 * inertia * found.v[-1, 0] ** 2 == pytest.approx(left, abs=1e-7 * inertia * speed**2)


def four_bar(lengths: np.ndarray, ground: float, turned: np.ndarray) -> Scene:
    """A chain of three links (of 1 kg each) on hinges, the end of which is pinned `ground` away from its beginning.

    At rest positions it lies along x; `turned` is the axis of all hinges, which the whole stands at right angles to.
    """
    along = np.linalg.svd(turned[None])[2][1]
    bodies, joints, above, reach = [], [], "", np.zeros(3)
    for k, length in enumerate(lengths):
        middle = tuple(0.5 * length * along)
        bodies.append(Body(name=f"link{k}", parent=above, mass=1.0, com=middle, inertia=(0.01, 0.01, 0.01, 0, 0, 0),
                           position=tuple(reach)))  # fmt: skip
        joints.append(Joint(name=f"hinge{k}", body=f"link{k}", type="hinge", axis=tuple(turned)))
        above, reach = f"link{k}", length * along
    pin = Loop(name="pin", type="connect", first=above, second="", first_position=tuple(reach),
               second_position=tuple(ground * along))  # fmt: skip
    return Scene(bodies=tuple(bodies), joints=tuple(joints), loops=(pin,), gravity=tuple(3.0 * np.cross(turned, along)))


def closed(lengths: np.ndarray, ground: float, angle: float) -> np.ndarray:
    """Angles of the hinges of a four-bar whose first link stands at an angle, by the two circles that its pin is on."""
    first, last = lengths[0] * np.exp(1j * angle), complex(ground)
    between = last - first
    size = abs(between)
    part = (lengths[1] ** 2 - lengths[2] ** 2 + size**2) / (2.0 * size)
    knee = first + between / size * (part + 1j * np.sqrt(lengths[1] ** 2 - part**2))
    ways = np.angle([first, knee - first, last - knee])
    return np.diff(ways, prepend=0.0)


@pytest.mark.parametrize("solver", ["compiled", "cvode"])
@pytest.mark.parametrize("seed", range(12))
def test_links_that_start_aligned_are_at_a_dead_centre(seed: int, solver: str) -> None:
    """Whichever of them fold back: one row more holds beside it, and a motion that leaves it is ill posed."""
    rng = np.random.default_rng([seed, 5])
    lengths, turned = rng.uniform(0.1, 1.0, 3), rng.normal(size=3)
    signs = np.array([1.0, rng.choice([-1.0, 1.0]), rng.choice([-1.0, 1.0])])
    ground, q = float(signs @ lengths), np.pi * (np.diff(signs, prepend=1.0) != 0.0)
    scene = four_bar(lengths, ground, turned / np.linalg.norm(turned))
    made = system(scene, case_of(scene).law, q)
    assert "dead_centre: at the start the rows of loops have lost rank" in made.findings[0], made.findings
    found = simulate(made, q, np.zeros(3), 1.0, solver=solver)
    assert found.outcome is Outcome.ILL_POSED, found.message
    assert "dead_centre" in found.message


@pytest.mark.parametrize("tilt", [0.0, 1e-8, 1e-7, 1e-6])
@pytest.mark.parametrize("seed", range(6))
def test_links_that_start_at_an_angle_are_at_none(seed: int, tilt: float) -> None:
    """Rows across the plane follow from the others there too, but for a hinge that is hardly tilted, all along."""
    rng = np.random.default_rng([seed, 6])
    lengths, turned = np.array([0.3, 1.0, 0.8]) * rng.uniform(0.8, 1.2, 3), rng.normal(size=3)
    ground, angle = float(rng.uniform(0.8, 1.0)), float(rng.uniform(0.2, 1.5) * rng.choice([-1.0, 1.0]))
    scene, q = four_bar(lengths, ground, turned / np.linalg.norm(turned)), closed(lengths, ground, angle)
    tilted = replace(scene.joints[1], axis=tuple(scene.joints[1].axis + tilt * rng.normal(size=3)))
    scene = replace(scene, joints=(scene.joints[0], tilted, scene.joints[2]))
    made = system(scene, case_of(scene).law, q)
    assert len(np.asarray(made.redundant)) == 1
    assert not [text for text in made.findings if "dead_centre" in text]
    assert simulate(made, q, np.zeros(3), 0.05).outcome is Outcome.FINISHED
