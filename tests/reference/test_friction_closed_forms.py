"""Contacts with friction against closed forms: what no agreement of tolerances or of programs could tell."""

from __future__ import annotations

import numpy as np
import pytest
from friction_scenes import G, account, box_on_floor, point, rod_on_floor, run, sphere_on_floor, stack
from scipy.special import ellipk, ellipkinc

from crossbody.cases import Mode, Outcome, Trajectory
from crossbody.reference import simulate

ALPHA = float(np.arctan(0.4))
TIME, STATE = 1e-11, 1e-9


def moved(run: Trajectory, row: int = 0) -> list[tuple[float, str, str]]:
    """Return when a contact changed its mode, but at the start."""
    return [(e.t, e.before.name, e.after.name) for e in run.events if e.contact == row and e.t > 0.0]


def test_block_rests_on_a_slope() -> None:
    run_ = run(box_on_floor(0.5, tilt=ALPHA), [0, 0, 0.1, 1, 0, 0, 0], np.zeros(6), 1.0)
    assert run_.outcome is Outcome.FINISHED
    assert np.abs(run_.q - run_.q[0]).max() < 1e-13
    assert set(run_.mode[-1, :4]) == {Mode.STICK}
    assert not [e for e in run_.events if e.t > 0.0]


@pytest.mark.parametrize("kappa", [0.99, 1.01])
def test_all_corners_share_a_load_up_to_the_bound(kappa: float) -> None:
    """By plain least norm corners that carry less would slide at 0.8 of it."""
    run_ = run(box_on_floor(0.4 * kappa, tilt=ALPHA), [0, 0, 0.1, 1, 0, 0, 0], np.zeros(6), 0.1)
    mode = Mode.STICK if kappa > 1.0 else Mode.SLIP
    assert set(run_.mode[-1, :4]) == {mode}
    down = max(G * (np.sin(ALPHA) - 0.4 * kappa * np.cos(ALPHA)), 0.0)
    assert run_.v[-1, 0] == pytest.approx(down * 0.1, abs=1e-11)


def test_block_slides_down_and_stops() -> None:
    run_ = simulate(point(0.5, ALPHA), [0, 0], [1.0, 0], 1.5, rtol=1e-11, ledger=True)
    brake = G * (0.5 * np.cos(ALPHA) - np.sin(ALPHA))
    [(t, *modes)] = moved(run_)
    assert modes == ["SLIP", "STICK"]
    assert abs(t - 1.0 / brake) < TIME
    assert abs(run_.q[-1, 0] - 0.5 / brake) < STATE
    assert account(run_) < STATE


def test_block_turns_on_a_slope() -> None:
    run_ = simulate(point(0.3, ALPHA), [0, 0], [-1.0, 0], 1.0, rtol=1e-11, ledger=True)
    up, down = (G * (np.sin(ALPHA) + sign * 0.3 * np.cos(ALPHA)) for sign in (1.0, -1.0))
    [(t, *_)] = moved(run_)
    assert abs(t - 1.0 / up) < TIME
    assert abs(run_.v[-1, 0] - down * (1.0 - 1.0 / up)) < STATE
    assert account(run_) < STATE


STOPS = {150.0: (0.18736133037705, (-0.05063281014555, 0.04271259886070)), 60.0: (0.853916721031635, None)}


@pytest.mark.parametrize("degrees", STOPS)
def test_oblique_slide(degrees: float) -> None:
    """|v| = C tan(th/2)^kappa / sin th, th from downhill."""
    th, (t, place) = np.radians(degrees), STOPS[degrees]
    run_ = simulate(point(0.5, ALPHA, space=True), [0, 0, 0], [np.cos(th), np.sin(th), 0], 1.0, rtol=1e-11)
    [(found, *modes)] = moved(run_)
    assert modes == ["SLIP", "STICK"]
    assert abs(found - t) < TIME
    if place:
        assert np.abs(run_.q[-1, :2] - place).max() < STATE


def test_oblique_slide_converges_with_its_tolerance() -> None:
    th, (t, _) = np.radians(150.0), STOPS[150.0]
    system = point(0.5, ALPHA, space=True)
    errors = [
        abs(moved(simulate(system, [0, 0, 0], [np.cos(th), np.sin(th), 0], 1.0, rtol=rtol))[0][0] - t)
        for rtol in (1e-6, 1e-8, 1e-10)
    ]
    assert all(error < 10.0 * rtol for error, rtol in zip(errors, (1e-6, 1e-8, 1e-10), strict=True))


def stops_at(kappa: float, tangent: float, speed: float, th: float) -> tuple[float, float]:
    """Return when an oblique slide stops by the closed form, and how fast friction and weight brake it at its end."""
    pull = G * np.sin(np.arctan(tangent))
    return speed * (kappa + np.cos(th)) / (pull * (kappa**2 - 1.0)), pull * (kappa - 1.0)


@pytest.mark.parametrize("block", range(4))
def test_any_oblique_slide_stops_on_time(block: int) -> None:
    """Also where a step ends just beyond the stop, and where friction is hardly more than the weight pulls.

    What the tolerance leaves open in the speed takes so much the longer to be lost.
    """
    rng = np.random.default_rng((75, block))
    for _ in range(25):
        kappa, tangent = 1.0 + 10.0 ** rng.uniform(-2.3, 0.5), rng.uniform(0.1, 0.8)
        speed, th = 10.0 ** rng.uniform(-1.0, 0.5), np.radians(rng.uniform(3.0, 177.0))
        t, brake = stops_at(kappa, tangent, speed, th)
        system = point(kappa * tangent, np.arctan(tangent), space=True)
        errors, rtols = list[float](), (1e-7, 1e-9, 1e-11)
        for rtol in rtols:
            run_ = simulate(system, [0, 0, 0], [speed * np.cos(th), speed * np.sin(th), 0], 1.2 * t, rtol=rtol)
            [(found, *_)] = moved(run_)
            errors.append(abs(found - t))
        lost = speed / brake
        assert errors[-1] < TIME * max(1.0, t, lost), (kappa, th)
        assert all(off < 10.0 * rtol * max(t, lost) for off, rtol in zip(errors, rtols, strict=True)), (kappa, th)


def test_the_second_machine_stops_an_oblique_slide_on_time() -> None:
    """Also where friction is hardly more than the weight pulls."""
    rng, rtol = np.random.default_rng(76), 1e-10
    for _ in range(8):
        kappa, tangent = 1.0 + 10.0 ** rng.uniform(-2.3, 0.0), rng.uniform(0.1, 0.8)
        speed, th = 10.0 ** rng.uniform(-1.0, 0.5), np.radians(rng.uniform(3.0, 177.0))
        t, brake = stops_at(kappa, tangent, speed, th)
        system = point(kappa * tangent, np.arctan(tangent), space=True)
        start = [speed * np.cos(th), speed * np.sin(th), 0]
        [(found, *_)] = moved(simulate(system, [0, 0, 0], start, 1.2 * t, rtol=rtol, solver="cvode"))
        assert abs(found - t) < 10.0 * rtol * max(t, speed / brake), (kappa, th)


def test_box_stops_flat_at_one_event() -> None:
    run_ = run(box_on_floor(0.3), [0, 0, 0.1, 1, 0, 0, 0], [1.0, 0, 0, 0, 0, 0], 0.6)
    stops = {e.t for e in run_.events if e.t > 0.0}
    assert len(stops) == 1
    assert abs(stops.pop() - 0.339789330615) < TIME
    assert set(run_.mode[-1, :4]) == {Mode.STICK}
    assert abs(run_.q[-1, 0] - 0.169894665308) < STATE
    assert "indeterminate" not in run_.counts


@pytest.mark.parametrize("turn", [0.0, 0.7])
@pytest.mark.parametrize("spin", [(0.0, 0.0, 0.0), (3.0, -5.0, 4.0)])
def test_sphere_slides_then_rolls(spin: tuple[float, ...], turn: float) -> None:
    radius, mu, v0 = 0.1, 0.2, np.array([2.0, 0.0])
    scene = sphere_on_floor(mu, radius, turn=turn)
    run_ = run(scene, [0, 0, radius, 1, 0, 0, 0], [*v0, 0, *spin], 1.0)
    u0 = v0 + radius * np.array([-spin[1], spin[0]])
    [(t, *modes)] = moved(run_)
    assert modes == ["SLIP", "STICK"]
    assert abs(t - np.linalg.norm(u0) / (3.5 * mu * G)) < TIME
    assert np.abs(run_.v[-1, :2] - (v0 - 2.0 * u0 / 7.0)).max() < STATE
    assert account(run_) < 1e-10


def test_rocking_block() -> None:
    b, h = 0.1, 0.5
    al, R = np.arctan(b / h), np.hypot(b, h)
    th = 0.5 * al
    body_inertia = (b * b + h * h) / 3.0
    p, k = np.sqrt(G * R / (body_inertia + R * R)), np.cos(0.5 * (al - th))
    quarter = (ellipk(k * k) - ellipkinc(np.arcsin(np.cos(0.5 * al) / k), k * k)) / p
    assert quarter == pytest.approx(0.34709358678889, abs=1e-13)
    q0 = [R * np.sin(th - al), R * np.cos(al - th), th]
    run_ = run(box_on_floor(0.5, half=(b, 0.15, h), planar=True), q0, np.zeros(3), 0.347)
    assert not [e for e in run_.events if e.t > 0.0]
    assert account(run_) < 1e-10
    run_ = run(box_on_floor(0.5, half=(b, 0.15, h), planar=True), q0, np.zeros(3), 0.3471)
    assert abs(next(e.t for e in run_.events if e.t > 0.0) - quarter) < TIME


@pytest.mark.parametrize(("off", "slides"), [(-1e-3, True), (1e-6, False)])
def test_rocking_needs_so_much_friction(off: float, slides: bool) -> None:
    b, h = 0.1, 0.5
    al, R = np.arctan(b / h), np.hypot(b, h)
    q0 = [-R * np.sin(0.5 * al), R * np.cos(0.5 * al), 0.5 * al]
    scene = box_on_floor(0.147354499014 + off, half=(b, 0.15, h), planar=True)
    assert any(e.after is Mode.SLIP for e in run(scene, q0, np.zeros(3), 0.347).events) == slides


def test_belt_and_spring() -> None:
    """One stick phase, then a sine that grazes the belt's speed once a period and must not stick there."""
    system = point(0.3, 0.0, spring=[100.0, 0.0], drift=0.1)
    run_ = simulate(system, [0, 0], [0, 0], 2.0, rtol=1e-11, ledger=True)
    stick, slip = moved(run_)
    assert abs(stick[0] - 0.0346692891616231) < TIME
    assert abs(slip[0] - 0.311458902406051) < TIME
    assert abs(run_.q[-1, 0] - 0.0201936922945194) < STATE
    assert abs(run_.v[-1, 0] + 0.0383283445633638) < STATE
    assert account(run_) < 1e-10


M1, M2 = 2.0, 1.0
M = M1 + M2


def pushed_low(force: float, mu1: float, mu2: float) -> tuple[float, float]:
    """Accelerations of both blocks with a force on the lower one."""
    if force <= mu1 * M * G:
        return 0.0, 0.0
    if force <= (mu1 + mu2) * M * G:
        return ((force - mu1 * M * G) / M,) * 2
    return (force - mu1 * M * G - mu2 * M2 * G) / M1, mu2 * G


def pushed_high(force: float, mu1: float, mu2: float) -> tuple[float, float]:
    """Accelerations of both blocks with a force on the upper one."""
    if force <= min(mu1 * M * G, mu2 * M2 * G):
        return 0.0, 0.0
    if mu2 * M2 <= mu1 * M:
        return 0.0, (force - mu2 * M2 * G) / M2
    if force <= M * M2 * G * (mu2 - mu1) / M1:
        return ((force - mu1 * M * G) / M,) * 2
    return (mu2 * M2 - mu1 * M) * G / M1, (force - mu2 * M2 * G) / M2


@pytest.mark.parametrize("part", [0.7, 1.5, 3.0])
@pytest.mark.parametrize(
    ("law", "mu"), [(pushed_low, (0.2, 0.3)), (pushed_high, (0.1, 0.5)), (pushed_high, (0.3, 0.5))]
)
def test_stacked_blocks(law, mu: tuple[float, float], part: float) -> None:  # type: ignore[no-untyped-def]
    force, forces = part * min(mu[0] * M, M if law is pushed_low else mu[1] * M2) * G, np.zeros(6)
    forces[0 if law is pushed_low else 3] = force
    q0 = [0, 0, 0.1, 1, 0, 0, 0, 0, 0, 0.3, 1, 0, 0, 0]
    run_ = run(stack(*mu), q0, np.zeros(12), 0.2, rtol=1e-10, inputs=([0.0], [forces]))
    assert run_.outcome is Outcome.FINISHED, run_.message
    assert run_.v[-1, [0, 6]] / 0.2 == pytest.approx(law(force, *mu), abs=STATE)
    assert account(run_) < 1e-9


@pytest.mark.parametrize(("mu", "jams"), [(1.3, False), (1.6, True)])
def test_rod_jams_beyond_four_thirds(mu: float, jams: bool) -> None:
    """Painleve's rod: where a force would press it further in there is no motion, and it never falls through."""
    z = 0.5 * np.cos(0.5) + 1e-3
    run_ = run(rod_on_floor(mu), [0, z, -0.5], [1.5, 0, 0], 0.3, rtol=1e-9)
    assert (run_.outcome is Outcome.PAINLEVE) == jams
    assert run_.gap[:, :2].min() > -0.02
    assert not jams or "Rows [0]" in run_.message


def test_without_friction_there_are_no_tangential_rows() -> None:
    scene = box_on_floor(0.0)
    assert run(scene, [0, 0, 0.1, 1, 0, 0, 0], [1.0, 0, 0, 0, 0, 0], 0.1).lam.shape[1] == 8


def test_order_of_contacts_changes_nothing() -> None:
    scene = stack(0.2, 0.3)
    other = scene.replace(pairs=scene.pairs[::-1])
    q0, v0 = [0, 0, 0.1, 1, 0, 0, 0, 0, 0, 0.3, 1, 0, 0, 0], [1.0, 0.2, 0, 0, 0, 0, 0, 0.1, 0, 0, 0, 0]
    ends = [run(one, q0, v0, 0.3, rtol=1e-10) for one in (scene, other)]
    assert np.abs(ends[0].q[-1] - ends[1].q[-1]).max() < STATE
