"""The soft contact linearised: closed forms, a sine sweep in time, poles, and what the tactile loop must do."""

from __future__ import annotations

import json

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import InvalidValue, Mode, Outcome
from crossbody.cases.mechanisms.soft import claims as closed
from crossbody.cases.mechanisms.soft.scene import numbers
from crossbody.reference import simulate
from crossbody.reference.systems import soft_contact as mechanism
from crossbody.reports.analysis import bode

W = [0.5, 2.0, 10.0, 30.0, 60.0, 300.0, 2000.0]
FORCE = {
    0.0: [20.412, 24.162, 7.8745, 11.420, 15.407, 35.377, 54.360],
    20.0: [4.016, 4.111, 2.7917, 5.249, 10.238, 37.000, 54.672],
}
BLOCK = {
    0.0: [1.0206, 1.2080, 0.39323, 0.56469, 0.73785, 0.98118, 0.27045],
    20.0: [0.20080, 0.20554, 0.13941, 0.25957, 0.49032, 1.0262, 0.27200],
}
"""Magnitudes of a prototype, N/(m/s) and 1, at W, rad/s."""


def response(omega, kstar=20.0, **parameters):
    return bode.soft_contact(kstar, **parameters).model.response(omega)[:, :, 0].T


def growth(kstar, mode, **parameters):
    return float(bode.growths(bode.poles([bode.soft_contact(kstar, mode, **parameters)]))["growth"].iloc[0])


def ratio(omega, **parameters):
    """Magnitude with feedback over magnitude without, of force and block velocity."""
    return np.abs(response(omega, 20.0, **parameters)) / np.abs(response(omega, 0.0, **parameters))


@pytest.mark.parametrize("kstar", [0.0, 5.0, 20.0])
@pytest.mark.parametrize(
    "changed", [{}, {"block_mass": 0.3, "cp": 12.0, "ks": 40.0, "gain_p": 90.0, "flange_mass": 2.0}]
)
def test_state_space_is_the_closed_form(kstar, changed):
    omega = np.geomspace(1e-2, 1e4, 61)
    p = numbers(cases.load("soft_contact", kstar=kstar, **changed).parameters)
    for found, expected in zip(response(omega, kstar, **changed), closed.responses(p, omega), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("kstar", [0.0, 20.0])
def test_magnitudes_of_the_table(kstar):
    force, block = np.abs(response(W, kstar))
    np.testing.assert_allclose(force, FORCE[kstar], rtol=2e-4)
    np.testing.assert_allclose(block, BLOCK[kstar], rtol=2e-4)


def test_the_laws_constants_show_in_no_curve():
    """The contacts' law makes the gaps autonomous: a0 is not a stiffness that a hand feels."""
    np.testing.assert_allclose(response(W), response(W, a0=4e6, a1=300.0), rtol=1e-9)


def swept(omega, kstar, settle=9.0, speed=0.02):
    """The responses from a run of the full model: least squares of a sine over two periods."""
    case = cases.load("soft_contact", kstar=kstar, probe=speed, probe_rate=omega)
    numbers_ = {**case.parameters, "close_start": -2.0, "close_end": -1.0}
    system = mechanism.build(numbers_, case.law)
    end = settle + 4 * np.pi / omega
    t = np.linspace(settle, end, 400)
    q, v = closed.grasp(numbers(case.parameters))
    run = simulate(system, q, v, end, rtol=1e-9, samples=t, collisions="resolved")
    assert run.outcome is Outcome.FINISHED
    assert set(run.mode.ravel()) == {Mode.CONTACT}
    assert run.lam.min() > 1.3
    columns = np.column_stack([np.sin(omega * t), np.cos(omega * t), np.ones_like(t)])
    signals = np.column_stack([run.lam[:, 0] - run.lam[:, 1], run.v[:, 3]])
    a, b, _ = np.linalg.lstsq(columns, signals, rcond=None)[0]
    return (a + 1j * b) / speed


_SWEEP = [pytest.param(w, marks=[] if w in (10.0, 60.0) else pytest.mark.slow) for w in W]


@pytest.mark.parametrize("omega", _SWEEP)
@pytest.mark.parametrize("kstar", [0.0, 20.0])
def test_a_sine_sweep_of_the_full_model(omega, kstar):
    np.testing.assert_allclose(swept(omega, kstar), response([omega], kstar)[:, 0], rtol=1e-4)


@pytest.mark.parametrize(
    ("kstar", "expected", "defective"),
    [
        (20.0, [-2.84 + 2.35j, -2.84 - 2.35j, -87.1 + 59.1j, -87.1 - 59.1j, -347 + 510j, -347 - 510j], 5),
        (0.0, [-1.50 + 2.28j, -1.50 - 2.28j, -39.6, -365 + 504j, -365 - 504j], 6),
    ],
)
def test_poles_of_the_grasp(kstar, expected, defective):
    """Two at 0 (shift of the fingers, what the loop keeps); at -100 the law's double poles and the sensors."""
    poles = bode.soft_contact(kstar).model.poles()
    law = np.abs(poles + 100.0) < 0.1
    zero = np.abs(poles) < 1e-9
    assert (law.sum(), zero.sum()) == (defective, 2)
    rest = poles[~law & ~zero]
    assert len(rest) == len(expected)
    for pole in expected:
        assert np.abs(rest - pole).min() < 0.006 * abs(pole)


def test_impedance_falls_to_a_fifth_below_the_bandwidth_and_is_equal_above():
    np.testing.assert_allclose(ratio([1e-2]), 1.0 / (1.0 + 0.2 * 20.0), rtol=1e-3)
    below, above, far = np.geomspace(1e-2, 66.0, 200), np.geomspace(150.0, 1e4, 400), np.geomspace(1e3, 1e4, 200)
    assert ratio(below).max() < 0.71
    assert ratio(np.geomspace(1e-2, 147.0, 400)).max() < 1.0
    assert np.abs(ratio(above) - 1.0).max() < 0.10
    assert np.abs(ratio(far) - 1.0).max() < 0.03
    peak = ratio([537.0])
    np.testing.assert_allclose(peak, 1.060, atol=1e-3)


@pytest.mark.parametrize("mode", ["grasp", "left finger", "right finger", "free"])
@pytest.mark.parametrize("ks", [20.0, 50.0, 100.0, 200.0, 500.0])
def test_the_loop_is_stable_in_every_mode(mode, ks):
    assert growth(20.0, mode, ks=ks) < -1.0


def test_a_single_contact_limits_the_gain_and_the_grasp_does_not():
    """Unstable from k = 6.0 (m/s)/N on, 30 times the nominal gain."""
    for finger in ("left finger", "right finger"):
        assert growth(590.0, finger) < 0.0 < growth(600.0, finger)
    assert growth(800.0, "grasp") < -1.0


@pytest.mark.parametrize(
    ("ks", "bandwidth"), [(20.0, 26.0), (50.0, 46.0), (100.0, 67.0), (200.0, 93.0), (500.0, 137.0)]
)
def test_bandwidth_follows_the_sensors(ks, bandwidth):
    omega = np.geomspace(1.0, 1e3, 3001)
    above = ratio(omega, ks=ks)[0] >= np.sqrt(0.5)
    assert omega[np.argmax(above)] == pytest.approx(bandwidth, rel=0.02)
    assert 1.05 < ratio(np.geomspace(10.0, 1e4, 1001), ks=ks).max() < 1.135


def test_a_gain_read_in_metres_is_stable_in_the_grasp_alone():
    """20 (m/s)/N with bt 0.2 has the same product k bt: always look at both mode sets."""
    assert growth(2000.0, "grasp", bt=0.2) == pytest.approx(-2.42, abs=0.01)
    assert growth(2000.0, "right finger", bt=0.2) == pytest.approx(53.0, abs=1.0)


def test_linear_stability_does_not_show_a_stable_approach():
    """Both mode sets are stable, yet the block is knocked between the fingers, faster every time."""
    trap = {"bt": 0.2, "rate_share": 0.0, "offset": 7e-3}
    for mode in ("grasp", "left finger", "right finger"):
        assert growth(2000.0, mode, **trap) == pytest.approx(-2.28, abs=0.01)
    case = cases.load("soft_contact", kstar=2000.0, **trap)
    system = mechanism.build(case.parameters, case.law)
    run = simulate(system, case.q0, case.v0, 2.5, rtol=1e-8, collisions="resolved")
    touches = [e for e in run.events if e.after == Mode.CONTACT][:5]
    assert [e.contact for e in touches] == [1, 0, 1, 0, 1]
    speeds = []
    for e in touches:
        _, rate = system.gap(*(x[np.searchsorted(run.t, e.t)] for x in (run.q, run.v)))
        speeds.append(-rate[e.contact])
    assert speeds == pytest.approx([0.011, 0.114, 0.594, 1.49, 2.67], rel=0.02)


def test_the_command_writes_tables_and_a_page(tmp_path, capsys):
    from crossbody.reports.commands.analyse import bode as command

    out = tmp_path / "out"
    assert command(["ks=50"], out, "crossbody bode soft_contact") == 0
    assert "grasp" in capsys.readouterr().out
    rows = json.loads((out / "bode.json").read_text())["rows"]
    assert len(rows) == 2 * 2 * bode.POINTS
    assert {row["output"]: row["unit"] for row in rows} == bode.UNITS
    assert "bode-soft-contact" in (out / "index.html").read_text()
    with pytest.raises(InvalidValue, match="kstar"):
        command(["kstar=3"], out, "")
