"""Planar linkages that are closed by points in space, drawn at random."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crossbody import cases
from crossbody.cases import Case
from crossbody.cases.scene import STIFF, Body, Joint, Loop, RowLaw, Scene


def four_bar(seed: int, law: RowLaw = STIFF, t_end: float = 0.5) -> Case:
    """A crank, a coupler and a rocker in the plane y = 0, closed by a point in space; the rocker comes to a bound."""
    rng = np.random.default_rng(seed)
    crank, ground = rng.uniform(0.3, 0.5), rng.uniform(0.8, 1.2)
    angle, reach = rng.uniform(0.3, 1.2), rng.uniform(0.9, 1.3)
    elbow = crank * np.array([np.cos(angle), np.sin(angle)])
    tip = np.array([ground, 0.0]) + reach * rng.uniform(0.6, 0.9) * np.array([-0.2, 1.0])
    inertia = (0.02, 0.02, 0.02, 0.0, 0.0, 0.0)

    def at(point: np.ndarray) -> tuple[float, float, float]:
        return float(point[0]), 0.0, float(point[1])

    bodies = (
        Body(name="crank", mass=1.0, com=at(elbow / 2.0), inertia=inertia),
        Body(
            name="coupler", parent="crank", position=at(elbow), mass=0.7, com=at((tip - elbow) / 2.0), inertia=inertia
        ),
        Body(name="rocker", position=(ground, 0.0, 0.0), mass=1.3, com=(0.0, 0.0, 0.4), inertia=inertia),
    )  # fmt: skip
    joints = tuple(Joint(name=one.name, body=one.name, type="hinge", axis=(0.0, 1.0, 0.0)) for one in bodies)
    bounded = replace(joints[2], range=(-0.05, 0.08))
    loop = Loop(
        name="loop", type="connect", first="coupler", second="rocker", first_position=at(tip - elbow),
        second_position=at(tip - np.array([ground, 0.0])), law=law,
    )  # fmt: skip
    scene = Scene(bodies=bodies, joints=(*joints[:2], bounded), loops=(loop,))
    return cases.from_scene(scene, t_end=t_end)
