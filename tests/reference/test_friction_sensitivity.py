"""Derivatives of motions that stick and slide: closed forms, and differences of runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from friction_scenes import G, on_floor, pair, point, rod_on_floor, rubbed_tree, tossed

from crossbody.cases import Mode, Outcome, SceneError, UnknownName
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, RowLaw, Scene, Shape
from crossbody.reference import kernels, simulate
from crossbody.reference.linear import _slipping, sensitivity
from crossbody.reference.linear.differences import differences
from crossbody.reference.tree.system import system

ALPHA = float(np.arctan(0.4))
CLOSE = 1e-8


def kinds(found):
    return [(jump.before.name, jump.after.name) for jump in found.jumps]


def test_slide_and_stop_by_speed_and_friction():
    """x = v0^2/(2 b) and t = v0/b, with b = g (mu cos a - sin a)."""
    found = sensitivity(point(0.5, ALPHA), [0, 0], [1.0, 0], 1.5, parameters=["mu[0]"])
    b, b_mu = G * (0.5 * np.cos(ALPHA) - np.sin(ALPHA)), G * np.cos(ALPHA)
    assert kinds(found) == [("SLIP", "STICK")]
    np.testing.assert_allclose(found.by_start[:, 2], [1.0 / b, 0.0, 0.0, 0.0], atol=CLOSE)
    np.testing.assert_allclose(found.by_start[0, 0], 1.0, rtol=1e-12)
    np.testing.assert_allclose(found.by_parameters[:, 0], [-0.5 * b_mu / b**2, 0.0, 0.0, 0.0], atol=CLOSE)
    (jump,) = found.jumps
    np.testing.assert_allclose(jump.matrix[2], [0.0, 0.0, 0.0, 0.0], atol=1e-12)  # all of the slip's deviation


def test_a_turn_on_a_slope():
    """Up with v0/u, then down: v = d (T - v0/u), x = -v0^2/(2 u) + d (T - v0/u)^2/2."""
    mu, T = 0.3, 1.0
    found = sensitivity(point(mu, ALPHA), [0, 0], [-1.0, 0], T, parameters=["mu[0]"])
    u, d = (G * (np.sin(ALPHA) + sign * mu * np.cos(ALPHA)) for sign in (1.0, -1.0))
    u_mu, t = G * np.cos(ALPHA), T - 1.0 / u
    assert kinds(found) == [("SLIP", "SLIP")]
    np.testing.assert_allclose(found.by_start[[0, 2], 2], [1.0 / u + d * t / u, d / u], rtol=CLOSE)  # v0 = -1
    by_mu = [0.5 * u_mu / u**2 - 0.5 * u_mu * t**2 + d * t * u_mu / u**2, -u_mu * t + d * u_mu / u**2]
    np.testing.assert_allclose(found.by_parameters[[0, 2], 0], by_mu, rtol=CLOSE)


def belt(mu=0.3, speed=0.1, stiffness=100.0):
    return point(mu, 0.0, spring=[stiffness, 0.0], drift=speed)


def test_belt_and_spring_forget_their_start_in_sticking():
    """Behind it x = mu g/w^2 + V/w sin(w (t - t2)), t2 = t1 + (mu g/w^2 - x1)/V, with x1, t1 of the first slide."""
    mu, V, w, T = 0.3, 0.1, 10.0, 0.6
    found = sensitivity(belt(mu, V), [0, 0], [0, 0], T, parameters=["mu[0]", "drift[1]"])
    assert kinds(found) == [("SLIP", "STICK"), ("STICK", "SLIP")]

    def end(y):  # start x0, v0, and mu, V; complex
        x0, v0, mu_, V_ = y
        c = mu_ * G / w**2
        r, phase = np.sqrt((x0 - c) ** 2 + (v0 / w) ** 2), np.arctan((v0 / w) / (x0 - c))  # x - c = -r cos(w t + phase)
        t1 = (np.arcsin(V_ / (w * r)) + phase) / w
        x1 = c - r * np.cos(w * t1 - phase)
        t2 = t1 + (c - x1) / V_
        return np.array([c + V_ / w * np.sin(w * (T - t2)), V_ * np.cos(w * (T - t2))])

    y = np.array([0.0, 0.0, mu, V])
    expected = np.stack([end(y + 1e-30j * e).imag / 1e-30 for e in np.eye(4)], axis=-1)
    np.testing.assert_allclose(end(y), found.state[[0, 2]], atol=1e-10)
    got = np.hstack([found.by_start[[0, 2]][:, [0, 2]], found.by_parameters[[0, 2]]])
    np.testing.assert_allclose(got, expected, atol=CLOSE * np.abs(expected).max())


def test_a_sine_that_grazes_the_belt_has_no_derivative():
    found = sensitivity(belt(), [0, 0], [0, 0], 1.2)
    assert found.outcome is Outcome.ILL_POSED
    assert "row 0, which has friction, is grazed at t = 0.939" in found.message
    assert np.isnan(found.by_start).all()


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("off", [0.0, 1e-12, -1e-12])
def test_a_start_at_the_limit_of_sticking_has_no_derivative(off: float, space: bool) -> None:
    """On one side of it the block stays, on the other it slides."""
    rest = np.zeros(3 if space else 2)
    found = sensitivity(point(0.4 * (1.0 + off), ALPHA, space=space), rest, rest, 1.0, parameters=["mu[0]"])
    assert found.outcome is Outcome.ILL_POSED
    assert "Row 0, which has friction, is at its bound at the start, t = 0 s" in found.message
    assert np.isnan(np.hstack([found.by_start, found.by_parameters])).all()


@kernels.dynamics
def _fed(t, q, v, u, p, M, f, w):  # type: ignore[no-untyped-def]
    """As `linear` has it, with a force along x that grows with the speed."""
    for i in range(2):
        M[i, 1 - i], M[i, i] = 0.0, 1.0
        f[i] = p[1 + i] - p[3 + i] * q[i]
    f[0] += 1.0 * v[0]


def test_a_cycle_of_stick_and_slip_keeps_its_phase_alone():
    """A belt feeds a spring: over a period what shifts the time comes back, and all else is forgotten in sticking."""
    made = replace(belt(), dynamics=_fed)
    run = simulate(made, [0, 0], [0, 0], 4.0, rtol=1e-12, dense=True)
    slides = [e.t for e in run.events if e.after is Mode.SLIP and e.t > 1.0]
    period = slides[1] - slides[0]
    q, v = run.sol(slides[0] + 0.2)
    found = sensitivity(made, q, v, 2.0 * period, parameters=["mu[0]"])
    assert kinds(found) == 2 * [("SLIP", "STICK"), ("STICK", "SLIP")]
    np.testing.assert_allclose(found.state, [*q, *v], atol=1e-9)
    along = [0, 2]  # what would lift it off has no derivative
    assert np.isnan(found.by_start).all(axis=0).tolist() == [False, True, False, True]
    values = np.sort(np.abs(np.linalg.eigvals(found.by_start[np.ix_(along, along)])))
    np.testing.assert_allclose(values, [0.0, 1.0], atol=1e-6)
    flow = np.array([*v, -100.0 * q[0] + v[0] + 0.3 * G, 0.0])
    np.testing.assert_allclose(found.by_start[:, along] @ flow[along], flow, atol=1e-7 * np.abs(flow).max())


def ends(made, q, v, t_end, rtol=1e-12):
    run = simulate(made, q, v, t_end, rtol=rtol)
    assert run.outcome is Outcome.FINISHED
    return run.q[-1], run.v[-1]


def compared(made, q, v, t_end, *, ways=3, step=1e-5, seed=0, close=1e-6, rtol=1e-9, runs=1e-12):
    """Derivatives along drawn directions of the start, and by mu, with central differences of runs."""
    n = made.n
    contacts = [i for i in np.flatnonzero(made.tangents) if not made.dry[i]]
    names = [f"mu[{i}]" for i in contacts]
    found = sensitivity(made, q, v, t_end, parameters=names, rtol=rtol)
    known = np.isfinite(found.by_start).all(axis=0)
    if found.outcome is not Outcome.FINISHED and "only touch" not in found.message:
        return found
    N = np.stack([made.displacement(found.state[: made.nq], e) for e in np.eye(n)], axis=-1)
    here = np.stack([made.displacement(np.asarray(q, dtype=float), e) for e in np.eye(n)], axis=-1)
    rng = np.random.default_rng(seed)

    def tangent(far):
        values = {k: far(k * step) for k in (-2, -1, 1, 2)}
        rate = [(8.0 * (values[1][j] - values[-1][j]) - (values[2][j] - values[-2][j])) / (12.0 * step) for j in (0, 1)]
        return np.concatenate([np.linalg.lstsq(N, rate[0], rcond=None)[0], rate[1]])

    for _ in range(ways):
        d = rng.normal(size=2 * n) * known
        expected = tangent(lambda s, d=d: ends(made, q + here @ d[:n] * s, v + d[n:] * s, t_end, runs))
        assert np.abs(found.by_start[:, known] @ d[known] - expected).max() < close * max(np.abs(expected).max(), 1.0)
    if names:
        expected = tangent(
            lambda s: ends(replace(made, mu=np.where(np.isfinite(made.mu), made.mu + s, made.mu)), q, v, t_end, runs)
        )
        total = found.by_parameters.sum(axis=1)
        assert np.abs(total - expected).max() < close * max(np.abs(expected).max(), 1.0)
    return found


def test_oblique_slide_in_space():
    """A slip that turns all the way to its stop."""
    th = np.radians(150.0)
    v = np.array([np.cos(th), np.sin(th), 0.0])
    found = compared(point(0.5, ALPHA, space=True), np.zeros(3), v, 0.4, ways=0)
    assert kinds(found) == [("SLIP", "STICK")]
    c, s, kappa, A = np.cos(th), np.sin(th), 0.5 / 0.4, G * np.sin(ALPHA)
    t_stop = (kappa + c) / (A * (kappa**2 - 1.0))  # of v0 = 1, and t v0 in general
    assert abs(found.run.events[-1].t - t_stop) < 1e-10
    where = lambda v: ends(point(0.5, ALPHA, space=True), np.zeros(3), np.array([*v, 0.0]), 0.4)[0]  # noqa: E731
    scaled = found.by_start[:3, 3:5] @ [c, s]  # along the speed: places grow with its square
    np.testing.assert_allclose(scaled, 2.0 * where([c, s]), atol=1e-8)
    np.testing.assert_allclose(found.by_start[:2, 3:5], differences(lambda v: where(v)[:2], v[:2], 1e-4), atol=1e-8)


def struck(seed):
    """A ball that slides or rolls into one at rest on the same floor, drawn."""
    rng, radius = np.random.default_rng(seed), 0.03
    mu, between = rng.uniform(0.1, 0.4), rng.uniform(0.05, 0.2)
    laws = [RowLaw(a0=10 ** rng.uniform(4, 6), a1=rng.uniform(5, 100)) for _ in range(2)]
    sphere = Shape(name="first", body="first", type="sphere", size=(radius, 0, 0))
    first = on_floor(Body(name="first", mass=0.2, inertia=(7.2e-5,) * 3 + (0, 0, 0)), sphere, mu)
    second = [replace(part, name="second", body="second") for part in (first.joints[0], sphere)]
    pairs = (
        pair("floor", "first", mu, laws[0]),
        pair("floor", "second", mu, laws[0]),
        pair("first", "second", between, laws[1]),
    )
    scene = replace(
        first, bodies=(*first.bodies, replace(first.bodies[-1], name="second")), joints=(*first.joints, second[0]),
        shapes=(*first.shapes, second[1]), pairs=pairs,
    )  # fmt: skip
    q = [0, 0, radius, 1, 0, 0, 0, 2 * radius + 0.01, 0.5 * rng.uniform(-1, 1) * radius, radius, 1, 0, 0, 0]
    return scene, q, [1.5, 0, 0, *rng.normal(scale=20, size=3), *np.zeros(6)]


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 10))])
def test_a_ball_that_is_struck(seed):
    """Its slip grows from nothing; where it turns slowly enough one arc ends at the very slip where the next begins."""
    scene, q, v = struck(seed)
    made = system(scene, case_of(scene).law)
    found = compared(made, q, v, 0.012, ways=0, step=2e-5, runs=1e-13)
    assert found.outcome is Outcome.FINISHED or "only touch" in found.message


def test_derivatives_that_take_too_long_say_how_far_they_came():
    scene, q, v = struck(0)
    found = sensitivity(system(scene, case_of(scene).law), q, v, 0.012, time_limit=0.2)
    assert found.outcome is Outcome.TIME_LIMIT
    assert "took 0.2 s up to t = " in found.message
    assert np.isnan(found.by_start).all()


@pytest.mark.parametrize("seed", [3, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 4, 5, 6, 7))])
def test_tossed_bodies(seed):
    """Touches with friction, slips that turn, stops, slides out of sticking and releases, in space."""
    scene, q, v, _ = tossed(seed, most=1)
    made = system(scene, case_of(scene).law)
    found = compared(made, q, v, 0.3, seed=seed, rtol=1e-10, step=3e-4, runs=1e-13)
    assert ("FREE", "SLIP") in kinds(found)


def test_a_slide_out_of_sticking_that_lifts_at_once():
    """It lasts 71 us: the direction of its slip turns while the slip still has none that its velocity tells."""
    scene, q, v, _ = tossed(0, most=1)
    made = system(scene, case_of(scene).law)
    found = compared(made, q, v, 0.19, step=1e-4, close=1e-7, runs=1e-13)
    assert kinds(found)[-2:] == [("STICK", "SLIP"), ("SLIP", "BALLISTIC")]


@pytest.mark.slow
@pytest.mark.parametrize("mu", [1.5, 2.0])
def test_a_stop_beyond_which_the_rod_would_jam(mu):
    """A trial step past the stop meets the opposite slip, which jams; the motion does not."""
    rod = rod_on_floor(mu)
    made = system(rod, case_of(rod).law)
    q = np.array([0.0, 0.0, 0.6])
    q[1] -= made.gap(q, np.zeros(3))[0].min()
    assert compared(made, q, np.array([0.3, 0, 0]), 0.1, ways=0).outcome is Outcome.FINISHED


def test_a_slide_of_nanoseconds_is_refused():
    """Of 85 out of sticking: its slip never comes out of the rounding of the velocities."""
    scene, q, v, _ = tossed(1, most=1)
    with pytest.raises(SceneError, match=r"row 0 slides at t = 0\.09256\d* s for so short a time"):
        sensitivity(system(scene, case_of(scene).law), q, v, 0.3, rtol=1e-10)


def test_a_slide_of_no_length_is_refused(monkeypatch):
    """As if rounding were of the size of the slips themselves."""
    scene, q, v, _ = tossed(0, most=1)
    made = system(scene, case_of(scene).law)
    monkeypatch.setattr(_slipping, "FLEETING", 1e-3)
    with pytest.raises(SceneError, match=r"row 0 slides at t = 0\.184\d* s for so short a time"):
        sensitivity(made, q, v, 0.19, rtol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_rods_in_a_plane(seed):
    """Two round ends that touch a floor."""
    rng = np.random.default_rng(seed)
    made = system(scene := rod_on_floor(float(rng.uniform(0.2, 0.6))), case_of(scene).law)
    tilt = float(rng.uniform(-0.4, 0.4))
    q = np.array([0.0, 0.5 * abs(np.sin(tilt)) + 0.02, np.pi / 2 + tilt])
    assert ("FREE", "SLIP") in kinds(compared(made, q, np.array([1.0, -0.3, 0.5]), 0.2, seed=seed))


@pytest.mark.parametrize("seed", range(5))
def test_dry_joints(seed):
    """Several rows with a bound of their own stop, turn back and begin to slide, one after the other."""
    scene, q, v = rubbed_tree(seed)
    made = system(scene, case_of(scene).law)
    found = compared(made, q, v, 0.2, ways=2, seed=seed)
    assert found.outcome is Outcome.FINISHED
    assert {after for _, after in kinds(found)} <= {"STICK", "SLIP"}
    assert found.jumps


def test_a_slip_in_space_that_turns_back_through_zero_is_refused():
    """Straight uphill and back again; beside it a block turns round without coming to rest."""
    with pytest.raises(SceneError, match="turns back through zero"):
        sensitivity(point(0.3, ALPHA, space=True), np.zeros(3), [-1.0, 0.0, 0.0], 0.3, rtol=1e-9)


def test_a_rest_that_a_deviation_leaves_forgets_it():
    """A block that sticks from the start on a slope: a slip of the start dies out within a time of its own size."""
    found = sensitivity(point(0.5, ALPHA), [0, 0], [0, 0], 0.2)
    np.testing.assert_allclose(found.by_start[[0, 2], 2], 0.0, atol=1e-12)
    step = 1e-6
    far = [ends(point(0.5, ALPHA), [0, 0], [sign * step, 0], 0.2)[0][0] for sign in (1.0, -1.0)]
    assert abs(far[0] - far[1]) / (2.0 * step) < 1e-5  # second order in the deviation


def test_stops_by_parameters_of_a_scene_and_wrong_names():
    made = point(0.5, ALPHA)
    found = sensitivity(made, [0, 0], [1.0, 0], 1.5, parameters=["mu[0]", "p[1]"], rtol=1e-9)
    b = G * (0.5 * np.cos(ALPHA) - np.sin(ALPHA))  # p[1] is the force downhill
    np.testing.assert_allclose(found.by_parameters[0], [-0.5 * G * np.cos(ALPHA) / b**2, 0.5 / b**2], rtol=1e-6)
    for name in ("mu[1]", "drift[0]", "mu[7]"):
        with pytest.raises(UnknownName, match="mu"):
            sensitivity(made, [0, 0], [1.0, 0], 0.1, parameters=[name])


@pytest.mark.parametrize("seed", range(12))
def test_a_slide_of_a_dry_hinge_that_begins_from_rest_is_one_sided_by_its_speed(seed: int) -> None:
    """Differences to both sides tell it: the ones that agree are derivatives, and the others none."""
    draw = np.random.default_rng([seed, 19])
    mass, loss = draw.uniform(0.5, 2.0), draw.uniform(0.2, 0.8)
    body = Body(name="rod", mass=mass, com=(0.0, 0.0, -0.5), inertia=(0.01, 0.01, 0.01, 0.0, 0.0, 0.0))
    hinge = Joint(name="hinge", body="rod", type="hinge", axis=(0, 1, 0), friction_loss=loss)
    scene = Scene(bodies=(body,), joints=(hinge,))
    made, t_end = system(scene, case_of(scene).law), 0.4
    start = [float(draw.choice([-1.0, 1.0]) * draw.uniform(0.6, 2.0)), float(draw.choice([0.0, 0.0, 0.3]))]

    def end(q: float, v: float) -> np.ndarray:
        run = simulate(made, [q], [v], t_end, rtol=1e-13)
        return np.concatenate([run.q[-1], run.v[-1]])

    found, step = sensitivity(made, start[:1], start[1:], t_end), 1e-5
    for k, way in enumerate(np.eye(2)):
        sides = [(end(*(start + s * step * way)) - end(*start)) / (s * step) for s in (1.0, -1.0)]
        agree = np.abs(sides[0] - sides[1]).max() < 1e-3
        assert bool(np.isnan(found.by_start[:, k]).all()) is not agree
        if agree:
            np.testing.assert_allclose(found.by_start[:, k], 0.5 * (sides[0] + sides[1]), atol=1e-6)
    assert found.outcome is (Outcome.ILL_POSED if start[1] == 0.0 else Outcome.FINISHED), found.message
