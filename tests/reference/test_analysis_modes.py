"""Linear models in every set of modes that the cases visit, against differences of what the simulator integrates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Law, Mode, SceneError
from crossbody.reference import System
from crossbody.reference.linear import linearise
from crossbody.reference.linear.differences import differences
from crossbody.reference.sundials.equations import Equations
from crossbody.reference.systems import link_chain
from crossbody.reports.analysis.places import ON, build

SHORT = {
    "ball_maze:solve": {"t_end": 13.0}, "delta_free": {"t_end": 1.0}, "delta_tracking": {"t_end": 0.05},
    "delta_singularity": {"t_end": 12.0},
}  # fmt: skip
STEP = 2e-4
"""Of the differences, as a part of a coordinate."""
RESOLVED = [("newtons_cradle", "pendulums", {"collisions": "resolved", "t_end": 0.3, "gap": 1e-3})]
EVERY = [
    (name, variant, {}) for name in cases.names() for variant in cases.variants(name)
    if not cases.load(name, variant).rubs
] + RESOLVED  # fmt: skip
"""Linear models refuse friction."""


def visited(case):
    """One moving state (t, q, v, modes, discrete variables) in every set of rows that a run has on."""
    run = engines.load("reference").prepare(case, "compiled").run()
    assert run.outcome.ok
    found = {}
    for k, modes in enumerate(run.mode.tolist()):
        on = tuple((i, mode) for i, mode in enumerate(modes) if mode in ON)
        found.setdefault(on, []).append(k)
    for places in found.values():
        k = places[len(places) // 2]
        yield float(run.t[k]), run.q[k], run.v[k], run.mode[k].tolist(), discrete(case, run, float(run.t[k]))


def discrete(case, run, t):
    """Values of the discrete variables at t."""
    now = dict(enumerate(np.asarray(build(case).discrete).tolist()))
    for switch in run.switches:
        if switch.t <= t:
            now[switch.variable] = float(switch.after)
    return list(now.values())


@pytest.mark.parametrize(("name", "variant", "changed"), EVERY, ids=[f"{n}:{v} {c}" for n, v, c in EVERY])
def test_every_set_of_modes(name, variant, changed):
    short = SHORT.get(f"{name}:{variant}", SHORT.get(name, {}))
    case = cases.load(name, variant, **{**short, **changed})
    plant, sets = build(case), 0
    for t, q, v, modes, values in visited(case):
        system = replace(plant, discrete=values) if values else plant
        agrees(system, q, v, np.zeros(system.inputs), modes, t)
        sets += 1
    assert sets


def agrees(system, q, v, u, modes, t):
    n, equations = system.n, Equations(system)
    equations.activate(modes)
    equations.u[:] = u
    rows = [i for i, mode in enumerate(modes) if mode in ON]
    scale = np.concatenate([sizes(q), sizes(v)])

    def rate(x):
        return equations.accelerate(t, x[:n] * scale[:n], x[n:] * scale[n:])[0].copy()

    expected = differences(rate, np.concatenate([q, v]) / scale, STEP) / scale
    colliding = [i for i in rows if modes[i] == Mode.COLLISION and equations.has_fast[i]]
    found = linearise(system, q, v, u, rows, t=t, colliding=colliding).A[n:]
    size = np.abs(expected).max(axis=1, keepdims=True)
    floor = 1e-6 * size.max(initial=0.0) + 1e-9
    assert np.abs((found - expected) / np.maximum(size, floor)).max() < 1e-7


def sizes(x):
    return np.clip(np.abs(x), 1e-2, 1.0)


@pytest.mark.parametrize("links", [1, 2, 5])
def test_chain_of_links(links):
    rng = np.random.default_rng(links)
    system = chain(links)
    q, v = rng.normal(size=system.n), rng.normal(size=system.n)
    agrees(system, q, v, rng.normal(size=system.inputs), [Mode.BILATERAL] * system.nc, 0.0)


def chain(links) -> System:
    numbers = {"links": links, "gravity": 9.81, "slip": 0.3}
    for i in range(1, links + 1):
        numbers |= {f"m{i}": 0.2, f"a{i}": 0.1, f"L{i}": 0.25, f"I{i}": 2e-3, f"k{i}": 0.01, f"s{i}": 0.02}
    rows = np.ones(2 * links)
    law = Law(a0=400.0 * rows, a1=40.0 * rows, a2=0.0 * rows, unilateral=rows == 0.0)
    return link_chain.build(numbers, law)


def test_rows_that_collide_must_be_on():
    case = cases.load("red_body")
    with pytest.raises(SceneError, match="colliding"):
        linearise(build(case), case.q0, active=[0], colliding=[2])
