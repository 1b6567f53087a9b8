"""Rows in contact that are factored island by island: the same multipliers as those of all of them together."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from friction_scenes import drawn, standing

from crossbody.cases.files.case import case_of
from crossbody.reference import Options, prepare
from crossbody.reference.cache import compiled
from crossbody.reference.core.acceleration import OWN, accelerate, activate
from crossbody.reference.core.layout import SLIP, open_buffers, open_kernels, open_model, open_work
from crossbody.reference.tree.system import system

SAME = 1e-11  # part of the largest acceleration to which both agree
STEPS = 40


def _both_ways(functions, state, model, work, buffers, together):  # type: ignore[no-untyped-def]
    """Evaluate the right-hand side at the present state island by island, or all together as if something slid."""
    s = state[0]
    K, m, w, b = open_kernels(functions), open_model(model), open_work(work), open_buffers(buffers)
    activate(s, m, w, b.mode)
    accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[: s.nq], w.y[s.nq :], OWN)
    if together:
        s.calm, s.held_unknowns = 0, -1
        w.calm[:] = 0
        accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[: s.nq], w.y[s.nq :], OWN)


EVALUATE = compiled(_both_ways)


def evaluated(run: Any, together: bool) -> tuple[np.ndarray, np.ndarray, int]:
    """Return v' and multipliers of the rows in contact, and how many islands are calm."""
    EVALUATE(run.call.args[0], run.state, *run.tables, together)
    count = int(run.state["na"][0])
    return run.work["vd"].copy(), run.work["la"][:count].copy(), int(run.state["calm"][0])


def agree(run: Any) -> int:
    """Check that both ways agree at the present state; return how many islands were calm."""
    apart, forces, calm = evaluated(run, together=False)
    whole, others, none = evaluated(run, together=True)
    assert none == 0
    assert np.abs(apart - whole).max() <= SAME * (1.0 + np.abs(whole).max())
    q, v = np.split(run.work["y"], [run.system.nq])
    H = run.system.constraint(q, v)[0][run.work["idx"][: len(forces)]]
    pushes = np.linalg.solve(run.system.mass_matrix(q, v), H.T).T
    assert np.abs(run.work["X"][: len(forces)] - pushes).max(initial=0.0) <= SAME * np.abs(pushes).max(initial=1.0)
    gram = np.diag(run.work["gram"])[: len(forces)]
    size = 1.0 + np.abs(others * gram).max(initial=0.0)
    assert np.abs((forces - others) * gram).max(initial=0.0) <= 1e3 * SAME * size
    return calm


@pytest.mark.parametrize("seed", range(10_000, 10_040))
def test_islands_move_as_all_rows_together(seed: int) -> None:
    """Where something slides the load of a calm island is none of it: both ways leave the same accelerations."""
    scene, q, v, _, _ = drawn(seed)
    run = prepare(system(scene, case_of(scene).law), q, v, Options(t_end=2.0, rtol=1e-8))
    run.start()
    for _ in range(STEPS):
        if run.slice(5) < 1:
            break
        agree(run)


@pytest.mark.parametrize(("bodies", "feet"), [(4, 1), (3, 2), (3, 3), (4, 4), (1, 7)])
@pytest.mark.parametrize("sliding", range(2))
def test_bodies_that_stand_apart_are_islands_of_their_own(bodies: int, feet: int, sliding: int) -> None:
    """The first one slides or all stand; each of the others is calm, whatever its feet share."""
    scene, rng = standing(bodies, feet), np.random.default_rng([bodies, feet])
    q, v = np.zeros(7 * bodies), np.zeros(6 * bodies)
    q[0::7], q[2::7], q[3::7] = np.arange(bodies), 0.15 - 1e-3 * rng.uniform(0.1, 1.0, bodies), 1.0
    v[0] = float(sliding)
    run = prepare(system(scene, case_of(scene).law), q, v, Options(t_end=1.0, rtol=1e-8))
    run.start()
    for k in range(5):
        run.slice(1 + k)
        slide = {one for one in range(bodies) if np.any(run.buffers["mode"][feet * one : feet * (one + 1)] == SLIP)}
        assert agree(run) == bodies - len(slide)
    held = 3 * feet - {1: 3, 2: 5}.get(feet, 6)  # about the line through two feet nothing holds a body
    assert run.state["dependent_rows"][0] == (bodies - len(slide)) * held + len(slide) * max(0, feet - 3)
