"""The Runge-Kutta march through which parameters are identified, beside the reference's integrator."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases.scene import Body, Joint, Loop, RowLaw, Scene
from crossbody.engines.equations import system_of
from crossbody.hw.fitting.rk4 import march
from crossbody.reference import simulate


@pytest.mark.parametrize("seed", range(4))
def test_a_march_ends_where_the_reference_does(seed: int) -> None:
    """Three links whose joints are coupled by two rows that start far off: each with a law of its own, cubic too."""
    random = np.random.default_rng(seed)
    mass, inertia, damping, a0, a1, a2, q0, v0 = random.uniform(0.5, 2.0, size=(8, 3))
    names = ("one", "two", "three")
    laws = [RowLaw(a0=20.0 * a0[i], a1=4.0 * a1[i], a2=30.0 * a2[i]) for i in range(2)]
    scene = Scene(
        bodies=tuple(
            Body(name=name, parent=names[i - 1] if i else "", position=(0.0, 0.0, -0.5 * (i > 0)), mass=mass[i],
                 com=(0.0, 0.0, -0.3), inertia=(*inertia, 0.0, 0.0, 0.0)) for i, name in enumerate(names)
        ),
        joints=tuple(
            Joint(name=name, body=name, type="hinge", axis=(0.0, 1.0, 0.0), damping=(float(damping[i]), 0.0, 0.0))
            for i, name in enumerate(names)
        ),
        loops=tuple(
            Loop(name=f"to {name}", type="joint", first=names[i], second=name, law=laws[i])
            for i, name in enumerate(names[1:])
        ),
    )  # fmt: skip
    case = cases.from_scene(scene, q0=q0, v0=v0, t_end=0.4)
    system, times = system_of(case), np.linspace(0.0, case.t_end, 21)
    out = np.zeros((len(times), 2 * system.n), np.complex128)
    out[0] = [*q0, *v0]
    march(
        system.dynamics, system.rows, times, 16, np.zeros((len(times), system.inputs), np.complex128),
        system.p.astype(np.complex128), np.array(system.alpha), system.mass_block, system.scratch, out,
    )  # fmt: skip
    run = simulate(system, q0, v0, case.t_end, rtol=1e-11, consistent=False)
    assert out[-1].real == pytest.approx([*run.q[-1], *run.v[-1]], abs=1e-7)
    assert np.abs(run.gap[0]).min() > 1e-3
