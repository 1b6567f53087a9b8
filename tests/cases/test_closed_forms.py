"""The closed forms of one contact: against mpmath to the last digits, and against plain integration."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from crossbody.cases import closed_forms as cf

ZETAS = [0.0, 1e-9, 0.02, 0.3, 0.9, 0.98, 1 - 1e-6, 1 - 1e-12, 1.0, 1 + 1e-12, 1 + 1e-6, 1.02, 1.5, 2.0, 2.1, 3.0, 40.0]


def exact_half_angle(zeta: float) -> mpmath.mpf:
    with mpmath.workdps(50):
        z = mpmath.mpf(zeta)
        if z == 1:
            return mpmath.mpf(1)
        root = mpmath.sqrt(abs(1 - z * z))
        return (mpmath.acos(z) if z < 1 else mpmath.acosh(z)) / root


@pytest.mark.parametrize("zeta", [*ZETAS, 1e4, 1e9, 1e200])
def test_half_angle_and_restitution_keep_their_digits(zeta: float) -> None:
    exact = exact_half_angle(zeta)
    assert cf.half_angle(zeta) == pytest.approx(float(exact), rel=1e-15)
    with mpmath.workdps(50):
        e = mpmath.exp(-2 * mpmath.mpf(zeta) * exact)
    assert cf.restitution(zeta) == pytest.approx(float(e), rel=2e-15 * (1 + 2 * zeta * float(exact)), abs=5e-324)


def test_double_pole_leaves_with_exp_minus_two() -> None:
    assert cf.restitution(1.0) == math.exp(-2)


def integrate(a0: float, a1: float, v0: float, gravity: float, t_end: float, max_step: float = np.inf):
    def force(_t: float, x: np.ndarray) -> float:
        return gravity - a1 * x[1] - a0 * x[0]

    force.terminal = True  # type: ignore[attr-defined]
    force.direction = -1  # type: ignore[attr-defined]

    def turn(_t: float, x: np.ndarray) -> float:
        return x[1]

    return solve_ivp(
        lambda _t, x: [x[1], -a1 * x[1] - a0 * x[0]], (0, t_end), [0.0, -v0],
        method="DOP853", rtol=1e-13, atol=1e-16 * v0, events=[force, turn], max_step=max_step,
    )  # fmt: skip


@pytest.mark.parametrize("a0", [1e2, 1e6])
@pytest.mark.parametrize("zeta", [0.02, 0.5, 0.999, 1.0, 1.001, 3.0])
def test_one_impact_without_gravity_agrees_with_integration(zeta: float, a0: float) -> None:
    w, v0 = math.sqrt(a0), 2.5
    a1 = 2 * zeta * w
    found = integrate(a0, a1, v0, 0.0, 20 / w)
    assert found.t_events[0][0] == pytest.approx(cf.contact_time(a0, a1), rel=1e-9)
    h_out, v_out = found.y_events[0][0]
    assert h_out == pytest.approx(cf.separation_gap(a0, a1, v0), rel=1e-8)
    assert v_out == pytest.approx(cf.restitution(zeta) * v0, rel=1e-8)
    assert -found.y_events[1][0][0] == pytest.approx(cf.depth(a0, a1, v0), rel=1e-9)
    assert found.t_events[1][0] == pytest.approx(cf.contact_time(a0, a1) / 2, rel=1e-8)
    assert -h_out / v_out == pytest.approx(cf.ballistic_time(a0, a1), rel=1e-8)


@pytest.mark.parametrize("zeta", [0.0, 0.1, 0.7, 1.0, 2.0])
def test_threshold_speed_from_both_sides(zeta: float) -> None:
    a0, gravity = 400.0, 9.81
    a1 = 2 * zeta * math.sqrt(a0)
    v_star = cf.threshold_speed(a0, a1, gravity)
    assert integrate(a0, a1, 1.001 * v_star, gravity, 0.5, 5e-4).status == 1, "above the threshold it leaves"
    assert integrate(a0, a1, 0.999 * v_star, gravity, 0.5, 5e-4).status == 0, "below it, it never leaves"


@pytest.mark.parametrize(("a0", "a2"), [(100.0, 1e6), (0.0, 1e6), (100.0, 0.0), (1e8, 1e-3), (1e-3, 1e12)])
def test_undamped_contact_lets_go_where_the_spring_carries_the_weight(a0: float, a2: float) -> None:
    h = cf.elastic_separation_gap(a0, a2, 9.81)
    assert a0 * h + a2 * h**3 == pytest.approx(9.81, rel=1e-14)


def test_contact_work_is_the_change_of_energy() -> None:
    mass, gravity, a0, a1, a2 = 0.7, 9.81, 400.0, 3.0, 1e4

    def rates(_t: float, x: np.ndarray) -> list[float]:
        h, v, _ = x
        return [v, -a1 * v - a0 * h - a2 * h**3, v * v]

    found = solve_ivp(rates, (0, 0.2), [-0.01, -2.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-14)
    h, v, speed2 = found.y[:, -1]
    energy = mass * (v * v - 4.0) / 2 + mass * gravity * (h + 0.01)
    assert cf.contact_work(mass, gravity, a0, a1, a2, -0.01, h, speed2) == pytest.approx(energy, rel=1e-9)


def test_damper_without_spring() -> None:
    assert cf.damping_ratio(0.0, 1.0) == math.inf
    assert cf.restitution(math.inf) == 0.0
    assert cf.damping_ratio(0.0, 0.0) == 0.0
