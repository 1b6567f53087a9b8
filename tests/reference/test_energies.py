"""Energies of every mechanism with kernels of its own: they change by the power of what acts, whatever the state."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody import cases, hw
from crossbody.cases import Case
from crossbody.engines.equations import builder, system_of
from crossbody.hw.models.contract import Segment

STEP = 1e-30
OWN = {
    case.mechanism: case
    for name in cases.names()
    for case in (cases.load(name, variant) for variant in cases.variants(name))
    if builder(case.mechanism) is not None
}


def chain(links: int) -> Case:
    """A chain of so many links, with numbers of its own for each."""
    rng, model = np.random.default_rng(links), hw.models.load(f"{('single', 'double')[links - 1]}_pendulum")
    numbers = {name: value * float(rng.uniform(0.5, 2.0)) for name, value in model.numbers().items()}
    return model.build(numbers, Segment(y=rng.normal(size=links), yd=rng.normal(size=links), t_end=1.0))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("case", [*OWN.values(), chain(1), chain(2)], ids=lambda case: f"{case.mechanism} {case.name}")
def test_energy_changes_by_the_power_of_forces_and_inputs(case: Case, seed: int) -> None:
    """Of a motion that no row holds, v' = M^-1 f, by complex steps; M is that of the kinetic energy."""
    system, rng = system_of(case), np.random.default_rng(seed)
    q, v = case.q0 + 0.1 * rng.normal(size=len(case.q0)), rng.normal(size=len(case.v0))
    u = rng.normal(size=system.inputs)
    M, f = system.terms(q, v, u)
    e, power, p = np.zeros(2, dtype=complex), np.zeros(2), np.array(system.p)
    system.energy(q.astype(complex), v.astype(complex), p.astype(complex), e)
    if not case.mechanism.startswith("soft"):  # whose filters and integrals are coordinates without a mass
        assert e[0].real == pytest.approx(0.5 * v @ M @ v, rel=1e-12)
    ahead = q + 1j * STEP * system.rates(q, v), v + 1j * STEP * np.linalg.solve(M, f)
    system.energy(*ahead, p.astype(complex), e)
    if system.power is not None:
        system.power(0.0, q, v, u, p, power)
    size = max(np.abs(e.imag).max() / STEP, np.abs(power).max())
    assert e.imag.sum() / STEP == pytest.approx(power[0] - power[1], abs=1e-10 * size)
