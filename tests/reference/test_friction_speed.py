"""Cost of a right-hand side with friction over that without: `make bench` prints and judges it, all in one run."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from friction_scenes import standing

from crossbody.cases.files.case import case_of
from crossbody.reference import Options, prepare
from crossbody.reference.cache import compiled
from crossbody.reference.core.acceleration import OWN, accelerate, activate
from crossbody.reference.core.layout import open_buffers, open_kernels, open_model, open_work
from crossbody.reference.tree.system import system

pytestmark = pytest.mark.bench
MOST, MANY, REPEATS = 3.0, 500, 40


def _evaluations(functions, state, model, work, buffers, count):  # type: ignore[no-untyped-def]
    s = state[0]
    K, m, w, b = open_kernels(functions), open_model(model), open_work(work), open_buffers(buffers)
    activate(s, m, w, b.mode)
    for _ in range(count):
        accelerate(K.dynamics, K.rows, K.solve, s, m, w, s.t, w.y[: s.nq], w.y[s.nq :], OWN)


EVALUATE = compiled(_evaluations)


def begun(bodies: int, feet: int, mu: float, speed: float) -> Any:
    """Return a run that has taken one step."""
    scene = standing(bodies, feet, mu)
    q, v = np.zeros(7 * bodies), np.zeros(6 * bodies)
    q[0::7], q[2::7], q[3::7] = np.arange(bodies), 0.15 - 1e-4, 1.0
    v[0::6], v[1::6] = speed, 0.3 * speed
    run = prepare(system(scene, case_of(scene).law), q, v, Options(t_end=1.0, rtol=1e-9))
    run.start()
    run.slice(1)
    return run


@pytest.mark.parametrize("speed", [0.0, 1.0])
@pytest.mark.parametrize(("bodies", "feet"), [(16, 1), (1, 16), (5, 3), (4, 4)])
def test_sixteen_contacts_cost_three_times_what_they_do_without_friction(bodies: int, feet: int, speed: float) -> None:
    """The median of ratios of processor times in alternating pairs: another process's load touches both of a pair."""
    runs = [begun(bodies, feet, mu, speed) for mu in (0.0, 0.5)]
    given = [(run.call.args[0], run.state, *run.tables) for run in runs]
    took = np.zeros((REPEATS, 2))
    for pair in took:
        for k, one in enumerate(given):
            began = time.thread_time()
            EVALUATE(*one, MANY)
            pair[k] = time.thread_time() - began
    ratio = float(np.median(took[:, 1] / took[:, 0]))
    print(f"\n{bodies} bodies on {feet} feet at {speed} m/s: {1e6 * np.median(took[:, 0]) / MANY:.1f} us without "
          f"friction, {ratio:.2f} times that with it")  # fmt: skip
    assert ratio <= MOST
