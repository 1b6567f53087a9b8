"""The deck's ball: its transitions against forty digits, the order of the method, its rest."""

import high_precision
import numpy as np
import pytest
from mechanisms import ball

from crossbody.cases import Mode, Outcome
from crossbody.reference import simulate


@pytest.fixture(scope="module")
def truth():
    found = high_precision.transitions(100, 20, 10**6, "9.81", 1, 7)
    return np.array([float(t) for t, _, _ in found])


@pytest.mark.parametrize("shortcuts", [True, False])
@pytest.mark.parametrize(("rtol", "bound"), [(1e-6, 1e-6), (1e-9, 1e-9), (1e-12, 1e-11), (1e-13, 1e-12)])
def test_seven_transitions_at_the_right_times(truth, rtol, bound, shortcuts):
    run = simulate(ball(), [1.0], [0.0], 5.0, rtol=rtol, shortcuts=shortcuts)
    assert [e.after for e in run.events] == [Mode.CONTACT, Mode.BALLISTIC, Mode.FREE] * 2 + [Mode.CONTACT]
    assert np.abs(np.array([e.t for e in run.events]) - truth).max() < bound


def test_rests_at_its_weight():
    run = simulate(ball(mass=2.5), [1.0], [0.0], 5.0, rtol=1e-9)
    assert run.outcome is Outcome.FINISHED
    assert abs(run.gap[-1, 0]) < 1e-12
    assert run.lam[-1, 0] == pytest.approx(2.5 * 9.81, rel=1e-9)


def test_transitions_do_not_depend_on_mass():
    light, heavy = (simulate(ball(mass=m), [1.0], [0.0], 2.0, rtol=1e-12) for m in (1e-3, 1e3))
    assert [e.t for e in light.events] == pytest.approx([e.t for e in heavy.events], abs=1e-12)


def test_observed_order_is_eight():
    # One smooth arc of the contact, fixed steps: the tolerance is loose, so the longest step decides.
    reference = simulate(ball(), [0.0], [-1.0], 0.01, rtol=1e-14, shortcuts=False, samples=[0.01]).q[-1, 0]
    counts = np.array([2, 3, 4, 6])
    errors = []
    for count in counts:
        run = simulate(
            ball(), [0.0], [-1.0], 0.01, rtol=1e-1, atol=1e3, max_step=0.01 / count, shortcuts=False, samples=[0.01]
        )
        assert run.steps == count
        errors.append(abs(run.q[-1, 0] - reference))
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order == pytest.approx(8.0, abs=1.0), errors


def test_elastic_gains_the_energy_of_the_law_at_every_bounce():
    # a1 = 0: it leaves where a0 h + a2 h^3 = g, whatever its speed, and takes m (g h - a0 h^2/2 - a2 h^4/4) with it.
    run = simulate(ball(a1=0.0), [1.0], [0.0], 130.0, rtol=1e-13)
    exits = [e for e in run.events if e.before is Mode.CONTACT][:100]
    assert len(exits) == 100
    assert all(e.after is Mode.FREE for e in exits)
    assert 4.35 < exits[4].t < 4.37
    h = max(r.real for r in np.roots([1e6, 0.0, 100.0, -9.81]) if abs(r.imag) < 1e-12)
    gain = 9.81 * h - 50.0 * h**2 - 2.5e5 * h**4
    at = [np.searchsorted(run.t, e.t) for e in exits]
    gaps = run.gap[at, 0]
    assert np.abs(gaps / h - 1.0).max() < 1e-9
    energy = run.total_energy[at]
    created = energy - 9.81
    assert np.abs(created / (gain * np.arange(1, 101)) - 1.0).max() < 1e-9
