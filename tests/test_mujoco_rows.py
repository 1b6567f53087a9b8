"""MuJoCo's matched rows hold the law at random states, strings and contacts of one place alike."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from random_scenes import random_scene, random_state

from crossbody.cases.files.case import case_of
from crossbody.cases.scene_contacts import contacts
from crossbody.engines import load
from crossbody.engines._equations import system_of
from crossbody.engines.mujoco._globals import hooked

STATES = 6
SAME = 1e-5
"""MuJoCo's rows keep 1e-7 of their softness."""


@pytest.mark.parametrize("seed", range(10))
def test_a_row_that_pushes_follows_the_law(seed: int) -> None:
    """H v' + H'v + a1 h' + a0 h = 0 at MuJoCo's v', by the reference's rows, with all terms of their curvature."""
    scene = random_scene(seed).replace(loops=())
    # Of a deep corner MuJoCo tells a point halfway to the surface, which may be another corner's.
    several = {row for contact in contacts(scene) if contact.places > 1 for row in contact.rows}
    case = case_of(scene)
    prepared, system, rng = load("mujoco").prepare(case, "matched").scene, system_of(case), np.random.default_rng(seed)
    mine = np.array([name not in several for name in case.contacts], dtype=bool)
    with hooked(prepared.hook):
        for _ in range(STATES):
            q, v, _ = random_state(scene, rng)
            prepared.data.qpos[:], prepared.data.qvel[:] = q, v
            mujoco.mj_forward(prepared.model, prepared.data)
            on = (prepared.lam() > 0.0) & mine
            H, h, Hdv = (part[on] for part in system.constraint(q, v))
            a0, a1, _ = system.alpha[on].T
            terms = np.array([H @ prepared.data.qacc, Hdv, a1 * (H @ v), a0 * h])
            assert (np.abs(terms.sum(axis=0)) <= SAME * np.abs(terms).sum(axis=0)).all()
