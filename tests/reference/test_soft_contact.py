"""A block between soft fingers on one axis: its equations, its run, and what the run must show."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import InvalidValue, Mode, Outcome, SceneError, UnknownName
from crossbody.cases.mechanisms.soft import claims as closed
from crossbody.cases.mechanisms.soft.claims import invariant
from crossbody.cases.mechanisms.soft.scene import numbers
from crossbody.engines import load
from crossbody.reference import simulate
from crossbody.reference.systems import soft_contact as mechanism
from crossbody.reports import metrics

STEP = 1e-30


def run(rtol=1e-9, **parameters):
    case = cases.load("soft_contact", **parameters)
    return case, load("reference").prepare(case, rtol=rtol).run()


@pytest.fixture(scope="module")
def pushed():
    return run(kstar=0.0)


@pytest.fixture(scope="module")
def felt():
    return run(kstar=20.0)


@pytest.fixture
def states():
    rng = np.random.default_rng(6)
    return list(zip(rng.normal(size=(10, 8)), rng.normal(size=(10, 8)), rng.normal(size=(10, 1)), strict=True))


@pytest.mark.parametrize(("kp", "ks"), [(1e3, 10.0), (5e4, 300.0)])
@pytest.mark.parametrize("variant", ["axis", "delta"])
def test_a_sensor_is_measured_by_the_momentum_that_its_lag_keeps_back(variant, kp, ks):
    """Of the least force that it feels, a part of what squeezes; stiffer fingers do not make it smaller."""
    case = cases.load("soft_contact", variant, kp=kp, ks=ks)
    sensors = [one for one in case.coordinates if one.unit == "N s"]
    assert sensors
    for one in sensors:
        assert one.rate == pytest.approx(0.05 * kp * case.parameters["squeeze"])
        assert one.size == pytest.approx(one.rate / ks)


def test_rows_are_the_derivatives_of_the_gaps(states):
    case = cases.load("soft_contact")
    system = mechanism.build(case.parameters, case.law)
    for q, v, _ in states:
        H, h, drift = system.constraint(q, v)
        gap, rate, p = np.zeros(2, complex), np.zeros(2, complex), system.p.astype(complex)
        for k, e in enumerate(np.eye(8)):
            mechanism.gaps(0.0, q + 1j * STEP * e, v.astype(complex), p, gap, rate)
            np.testing.assert_allclose(gap.imag / STEP, H[:, k], atol=1e-15)
        np.testing.assert_allclose([h, H @ v], system.gap(q, v), atol=1e-14)
        assert not drift.any()


def test_power_balances_the_energy(states):
    """T' = inputs - dissipation + lam . h' at any instant, with the jaws moving and the probe on."""
    case = cases.load("soft_contact", probe=0.3, probe_rate=5.0)
    p = mechanism.build(case.parameters, case.law).p
    masses = np.array([0.7, 0.01, 0.01, 0.1])
    for t, (q, v, u) in zip(np.linspace(0.0, 4.0, 10), states, strict=True):
        M, f, e = np.zeros((8, 1)), np.zeros(8), np.zeros(2)
        mechanism.dynamics(t, q, v, u, np.array(p), M, f, np.zeros(0))
        mechanism.power(t, q, v, u, np.array(p), e)
        np.testing.assert_allclose(M[:, 0], [*masses, 1.0, 1.0, 1.0, 1.0])
        np.testing.assert_allclose(f[:4] @ v[:4], e[0] - e[1], rtol=1e-10)


def test_sensors_follow_the_contact_forces():
    """y' = ks (lam - y), of which the mechanism carries another form, along a run with both modes."""
    case = cases.load("soft_contact")
    system = mechanism.build(case.parameters, case.law)
    t = np.linspace(1.79, 1.89, 2001)
    found = simulate(system, case.q0, case.v0, 1.89, rtol=1e-11, samples=t, collisions="resolved")
    y = found.v[:, 6] + case.number("ks") * case.number("pad_mass") * found.v[:, 2]
    assert found.lam[0, 1] == 0.0 < found.lam[-1, 1]
    h, force = t[1] - t[0], found.lam[:, 1]
    after = np.searchsorted(t, found.events[0].t) + 1
    slope = (y[after + 2 :] - y[after:-2]) / (2 * h)
    np.testing.assert_allclose(slope, 100.0 * (force - y)[after + 1 : -1], atol=2e-3 * np.abs(slope).max())


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize(("kstar", "left"), [(0.0, 2.80418), (20.0, 2.80260)])
def test_two_touches_and_no_chatter(rtol, kstar, left):
    _, found = run(rtol, kstar=kstar)
    assert found.outcome is Outcome.FINISHED
    assert [(e.contact, e.after) for e in found.events] == [(1, Mode.CONTACT), (0, Mode.CONTACT)]
    assert [e.t for e in found.events] == pytest.approx([1.81511, left], abs=1e-5)


def test_the_robot_moves_and_not_the_block(pushed, felt):
    """f_L = f_R at the end both times: what differs is who moved."""
    (case, still), (_, moved) = pushed, felt
    assert still.q[-1, [0, 3]] == pytest.approx([0.0, 0.0], abs=1e-4)
    assert moved.q[-1, [0, 3]] == pytest.approx([6.4e-3, 6.4e-3], abs=1e-6)
    assert still.q[:, 0].max() == pytest.approx(1.29e-3, abs=5e-6)
    assert still.q[:, 0].min() == pytest.approx(-1.05e-3, abs=5e-6)
    assert moved.q[:, 0].min() >= -1e-9
    assert abs(moved.q[-1, 3] - moved.q[-1, 0]) < 1e-9
    for (_, found), forces, largest in ((pushed, [1.998, 2.002], 0.231), (felt, [1.99999, 2.00001], 0.210)):
        assert found.lam[-1] == pytest.approx(forces, abs=5e-4)
        assert np.abs(found.lam[:, 0] - found.lam[:, 1]).max() == pytest.approx(largest, abs=2e-3)
    p = numbers(case.parameters)
    assert closed.final_position({**p, "k": 0.2}) == pytest.approx(6.4e-3, rel=1e-12)
    assert closed.held_force(p) == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize("kstar", [0.0, 5.0, 20.0])
def test_what_the_loop_keeps(kstar):
    case, found = run(kstar=kstar, offset=-5e-3)
    kept = invariant(found, case)
    assert np.abs(kept - kept[0]).max() < 1e-12


def test_the_ledger_closes(felt):
    _, found = felt
    book = found.ledger.contact.sum(axis=1) + found.ledger.input - found.ledger.dissipated
    assert np.abs(found.total_energy - found.total_energy[0] - book).max() < 1e-9 * np.abs(found.ledger.input).max()


def test_cvode_gives_the_same_run(felt):
    case, found = felt
    other = load("reference").prepare(case, "cvode", rtol=1e-8).run()
    assert [e.t for e in other.events] == pytest.approx([e.t for e in found.events], abs=1e-7)
    np.testing.assert_allclose(other.q[-1, :4], found.q[-1, :4], atol=1e-8)


def test_claims_come_out(pushed, felt):
    for case, found in (pushed, felt):
        assert {c.metric for c in case.claims} >= {"touch_left", "touch_right", "tactile_invariant"}
        allowed = {limit.metric: limit.value for limit in case.limits}
        for claim in case.claims:
            value = metrics.of(case)[claim.metric].measure(None, found, case)
            assert abs(value - claim.expected) <= allowed[claim.metric], claim.metric


def _asked_of_all(case: cases.Case) -> set[str]:
    return {limit.metric for limit in case.limits if limit.engine == "*"}


def test_claims_are_void_once_a_parameter_is_changed():
    changed = cases.load("soft_contact", block_mass=0.2)
    assert not changed.claims
    assert _asked_of_all(changed) == {"velocity"}


@pytest.mark.parametrize("variant", ["axis", "delta"])
@pytest.mark.parametrize("kstar", [0.0, 20.0])
def test_no_limit_asks_for_zero_of_what_is_not_claimed(variant, kstar):
    case = cases.load("soft_contact", variant, kstar=kstar)
    claimed = {claim.metric for claim in case.claims}
    assert _asked_of_all(case) == claimed | {"velocity"} | ({"energy_drift"} if variant == "delta" else set())


def test_a_mirrored_block_mirrors_the_run(felt):
    """Left and right exchange: the block starts on the other side."""
    _, found = felt
    _, mirror = run(offset=-8e-3)
    assert [(e.contact, e.t) for e in mirror.events] == [
        (1 - e.contact, pytest.approx(e.t, abs=1e-9)) for e in found.events
    ]
    np.testing.assert_allclose(mirror.q[-1, [0, 3]], -found.q[-1, [0, 3]], atol=1e-9)


@pytest.mark.parametrize(
    ("wrong", "error", "said"),
    [
        ({"block_mass": 0.0}, InvalidValue, "block_mass"),
        ({"block_mass": -1.0}, InvalidValue, "block_mass"),
        ({"ks": 0.0}, InvalidValue, "ks"),
        ({"pad_mass": 0.0}, InvalidValue, "pad_mass"),
        ({"kp": -1.0}, InvalidValue, "kp"),
        ({"bt": -1.0}, InvalidValue, "bt"),
        ({"width": float("nan")}, InvalidValue, "width"),
        ({"offset": 0.02}, SceneError, "inside the block"),
        ({"close_end": 0.5}, InvalidValue, "later"),
        ({"release": 2.0}, InvalidValue, "release"),
        ({"l1": 0.3}, InvalidValue, "variant delta"),
        ({"variant": "delta", "flange_mass": 1.0}, InvalidValue, "variant axis"),
        ({"variant": "delta", "low": 2.0}, InvalidValue, "reach"),
        ({"variant": "delta", "rise": 0.5}, InvalidValue, "rise"),
        ({"kstarr": 1.0}, UnknownName, "kstar"),
        ({"variant": "axes"}, UnknownName, "axis"),
    ],
)
def test_bad_input_is_told(wrong, error, said):
    with pytest.raises(error, match=said) as told:
        cases.load("soft_contact", **wrong)
    assert str(told.value).count("\n") == 0
