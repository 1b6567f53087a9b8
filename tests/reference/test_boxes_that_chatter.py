"""Boxes that spin on a plane end soon: a chatter of their corners' modes is an outcome, with its place and time."""

from __future__ import annotations

import time

import numpy as np
import pytest
from friction_scenes import box_body, on_floor
from scipy.spatial.transform import Rotation

from crossbody.cases import Outcome, Trajectory
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import RowLaw, Shape
from crossbody.reference import simulate
from crossbody.reference.tree.system import system

T_END, MOST = 1.5, 2.0  # s, and s of processor time
CHATTERS = (210,)  # 14,867 instants within 7e-5 s
BLOCK, BLOCKS = 20, 10


def drawn(seed: int) -> Trajectory:
    """Return the motion of a box: flat with a spin, from a little above, or tumbling."""
    rng = np.random.default_rng((77, seed))
    half, mass = tuple(map(float, rng.uniform(0.05, 0.2, 3))), float(rng.uniform(0.2, 3))
    zeta, a0 = rng.uniform(0.3, 1.0), 10 ** rng.uniform(3.5, 5)
    law, mu = RowLaw(a0=float(a0), a1=float(2 * zeta * np.sqrt(a0))), float(rng.uniform(0.1, 1.2))
    q, z, v = [1.0, 0.0, 0.0, 0.0], half[2], [*rng.normal(size=2), 0.0]
    if seed % 3 == 0:
        v += [0.0, 0.0, rng.normal() * 3]
    elif seed % 3 == 1:
        z, v = z + 0.05, [*v, *rng.normal(size=3)]
    else:
        z, q = 0.4, Rotation.from_quat(rng.normal(size=4), scalar_first=True).as_quat(scalar_first=True).tolist()
        v = [*rng.normal(size=2), 0.0, *rng.normal(size=3) * 3]
    scene = on_floor(box_body("b", half, mass), Shape(name="b", body="b", type="box", size=half), mu, law=law)
    return simulate(system(scene, case_of(scene).law), [0, 0, z, *q], v, T_END, rtol=1e-9, ledger=True, time_limit=20.0)


def ends_soon(seed: int) -> Trajectory:
    began = time.process_time()
    run = drawn(seed)
    assert time.process_time() - began <= MOST, (seed, run.outcome, run.t[-1])
    return run


@pytest.mark.parametrize("seed", CHATTERS)
def test_a_chatter_ends_with_its_place_and_time(seed: int) -> None:
    run = ends_soon(seed)
    assert run.outcome is Outcome.MODE_CYCLE
    assert "Rows [" in run.message
    assert f"t = {run.t[-1]:.6g}"[:8] in run.message


@pytest.mark.slow
@pytest.mark.parametrize("block", range(BLOCKS))
def test_two_hundred_boxes_that_spin_end_soon(block: int) -> None:
    drawn(0)
    for seed in range(BLOCK * block, BLOCK * (block + 1)):
        ends_soon(seed)
