"""Ladders that lean on a wall, at rest: whether they stay is a linear programme, and no tolerance has a say in it.

Speeds are then those of errors alone, and gaps those of rounding: neither must count as a slip, nor as a fall.
"""

from __future__ import annotations

import numpy as np
import pytest
from friction_obeyed import obeys
from friction_scenes import G, Joint, RowLaw, Scene, Shape, box_body, pair, run
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from crossbody.cases import Outcome

HALF = (0.02, 0.05, 0.4)
NEAR = 1e-2  # part of a coefficient by which a ladder is closer to where it begins to slide than is asked here
T_END = 0.2
MOST_ROWS = 500  # that a motion at rest writes: steps are bounded by the laws' own time scales alone
MOVES = 1e-3  # m/s, of one that cannot stay: it begins with a part NEAR of gravity


def leaning(mu: float, lean: float, law: RowLaw) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Return a ladder that touches the floor and a wall, its coordinates, and where it touches them, (2, 3)."""
    turn = Rotation.from_euler("y", -lean)
    corners = turn.apply([(x * HALF[0], y * HALF[1], z * HALF[2]) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    place = np.array([-corners[:, 0].min(), 0.0, -corners[:, 2].min()])
    wall = Rotation.from_euler("y", np.pi / 2).as_quat(scalar_first=True)
    scene = Scene(
        bodies=(box_body("ladder", HALF),), joints=(Joint(name="ladder", body="ladder", type="free"),),
        shapes=(
            Shape(name="floor", type="plane"), Shape(name="wall", type="plane", orientation=tuple(wall.tolist())),
            Shape(name="ladder", body="ladder", type="box", size=HALF),
        ),
        pairs=(pair("floor", "ladder", mu, law), pair("wall", "ladder", mu, law)),
    )  # fmt: skip
    feet = np.stack([corners[corners[:, 2].argmin()], corners[corners[:, 0].argmin()]])
    return scene, np.concatenate([place, turn.as_quat(scalar_first=True)]), feet


def may_stay(mu: float, feet: np.ndarray) -> bool:
    """Whether forces within their cones bear the weight: at the floor (x, z), at the wall (x, z)."""
    (x1, _, z1), (x2, _, z2) = feet
    balance = [[1, 0, 1, 0], [0, 1, 0, 1], [z1, -x1, z2, -x2]]  # moments about the centre of mass
    cones = [[1, -mu, 0, 0], [-1, -mu, 0, 0], [0, 0, -mu, 1], [0, 0, -mu, -1]]
    found = linprog(np.zeros(4), cones, np.zeros(4), balance, [0.0, G, 0.0], bounds=[(None, None)] * 4)
    return bool(found.status == 0)


@pytest.mark.parametrize("seed", range(30))
def test_a_ladder_stays_where_forces_can_hold_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mu, lean = float(rng.uniform(0.2, 2.0)), float(rng.uniform(0.2, 1.2))
    scene, q, feet = leaning(mu, lean, RowLaw(a0=float(10 ** rng.uniform(3, 5)), a1=float(10 ** rng.uniform(1, 2.5))))
    stays = may_stay(mu * (1.0 - NEAR), feet)
    if not stays and may_stay(mu * (1.0 + NEAR), feet):
        pytest.skip("the ladder leans at the very edge of where it may stay")
    for rtol in (1e-6, 1e-9, 1e-11):
        motion = run(scene, q, np.zeros(6), T_END, rtol=rtol)
        obeys(scene, motion, mu, rtol)
        fastest = float(np.abs(motion.v).max())
        if stays:
            assert motion.outcome is Outcome.FINISHED, motion.message
            assert fastest < 10.0 * rtol
            assert len(motion.t) < MOST_ROWS
        else:
            assert fastest > MOVES
