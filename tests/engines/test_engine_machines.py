"""The machines of the engines on more than one row: two sets of constants, followers, what pulls, inputs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from crossbody.cases import Law, Mode, Outcome

pin = pytest.importorskip("pinocchio")
from crossbody.engines._level_machine import EPS, LevelMachine, least_push  # noqa: E402 - they import the engine's package
from crossbody.engines._log import Log  # noqa: E402
from crossbody.engines.pinocchio._coordinates import World  # noqa: E402
from crossbody.engines.pinocchio._flow import Flow  # noqa: E402
from crossbody.engines.pinocchio._impulse import ImpulseMachine, Instant, sequential, simultaneous  # noqa: E402
from crossbody.engines.pinocchio._rows import PinRows  # noqa: E402

FREE, CONTACT, COLLISION, SEPARATED = Mode.FREE, Mode.CONTACT, Mode.COLLISION, Mode.COLLISION_SEPARATION
Array = np.ndarray[Any, Any]


def law(a0: Sequence[float], a1: Sequence[float], **fast: Any) -> Law:
    return Law(
        a0=np.array(a0), a1=np.array(a1), a2=np.zeros(len(a0)), unilateral=np.ones(len(a0), dtype=bool),
        **{name: np.array(value) for name, value in fast.items()},
    )  # fmt: skip


def rows(masses: Sequence[float], H: Array, start: Array, its_law: Law, force: Sequence[float], **more: Any) -> PinRows:
    """Rows h = start + H q on independent masses, q along one axis each, pushed by constant forces."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    for i, mass in enumerate(masses):
        joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), f"mass {i}")
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(mass, 0.1), pin.SE3.Identity())
    found = PinRows(
        model, jacobian=lambda q: H, heights=lambda q: start + H @ q, drift=lambda q, v: np.zeros(len(H)),
        law=its_law, **more,
    )  # fmt: skip
    found.tau[:] = force
    return found


def flow(machine: Any, q0: Sequence[float], v0: Sequence[float], t_end: float, world: World | None = None) -> Flow:
    n = len(q0)
    found = Flow(machine, Log(), 1e-12, np.full(2 * n, 1e-14), "Adams", 100_000, world)
    found.run(np.array(q0), np.array(v0), t_end)
    return found


@pytest.mark.parametrize(("b1", "height", "speed"), [(300.0, 0.01, 0.0), (60.0, 0.0, -0.05), (0.5, 0.0, -0.001)])
def test_a_collision_hands_over_when_its_elastic_part_is_spent(b1: float, height: float, speed: float) -> None:
    """Of a weakly damped one the rate counts by its frequency: else it would be spent where its gap passes zero."""
    b0, m, g = 1e4, 2.0, 9.81
    ball = rows([m], np.eye(1), np.zeros(1), law([100.0], [20.0], b0=[b0], b1=[b1]), [-m * g])
    found = flow(LevelMachine(ball), [height], [speed], 1.0)
    assert [(e.before, e.after) for e in found.log.events] == [(FREE, COLLISION), (COLLISION, CONTACT)]
    k = next(i for i, mode in enumerate(found.log.mode) if mode == (CONTACT,))
    _, q, v = found.log.motion[k - 1]
    elastic, lam = max(b1, b0**0.5) * abs(v[0]) + b0 * abs(q[0]), found.log.lam[k - 1][0]
    assert elastic == pytest.approx(EPS * lam / m, rel=1e-6)
    assert found.log.lam[-1][0] == pytest.approx(m * g, rel=1e-3)


def test_a_damped_collision_that_leaves_below_the_surface_is_a_collision_separation() -> None:
    ball = rows([1.0], np.eye(1), np.zeros(1), law([100.0], [20.0], b0=[1e4], b1=[20.0]), [-9.81])
    found = flow(LevelMachine(ball), [0.0], [-1.0], 0.1)
    assert [(e.before, e.after) for e in found.log.events] == [
        (FREE, COLLISION), (COLLISION, SEPARATED), (SEPARATED, FREE),
    ]  # fmt: skip


def test_a_row_that_follows_another_is_active_with_it() -> None:
    H = np.array([[0.0, 1.0], [1.0, 0.0]])  # a floor below y, and slip along x
    its_law = Law(a0=np.array([1e4, 0.0]), a1=np.array([0.0, 50.0]), a2=np.zeros(2), unilateral=np.array([True, True]))
    found = flow(
        LevelMachine(rows([1.0, 1.0], H, np.zeros(2), its_law, [0.0, 0.0], follows=(-1, 0))), [0, 0], [1, -1], 0.1
    )
    (touch, leave) = (e.t for e in found.log.events)
    assert {e.contact for e in found.log.events} == {0}
    assert leave - touch == pytest.approx(np.pi / 100, rel=1e-9)
    assert found.log.motion[-1][2][0] == pytest.approx(np.exp(-50 * (leave - touch)), rel=1e-9)
    assert all(mode[0] == mode[1] for mode in found.log.mode)


def test_neighbours_that_touch_at_rest_are_free_until_they_are_pressed() -> None:
    H = np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]])
    chain = rows([1.0, 1.0, 1.0], H, np.zeros(2), law([1e4, 1e4], [0.0, 0.0]), [0.0] * 3)
    settled = LevelMachine(chain).settle(np.zeros(3), np.array([1.0, 0.0, 0.0]), (FREE, FREE))
    assert settled.modes == (CONTACT, FREE)
    assert LevelMachine(chain).settle(np.zeros(3), np.zeros(3), (FREE, FREE)).modes == (FREE, FREE)


# A bar on supports at -1 and 1 (height y, tilt of inertia J), struck from above at b by a third mass: rows y -+ tilt
# and z - y - b tilt. Beyond a support the bar tilts over it and leaves the other.
BAR = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0]])


def bar(b: float) -> PinRows:
    H = np.vstack((BAR, [-1.0, -b, 1.0]))
    slow = law([100.0] * 3, [20.0] * 3)
    return rows([2.0, 0.5, 1.0], H, np.zeros(3), slow, [-20.0, 0.0, 0.0]).rigid()


def exact_strike(b: float, held: Sequence[int]) -> Array:
    """V+ = v - 2 h_n' M^-1 Ha^T (Ha M^-1 Ha^T)^-1 e_n of an elastic strike at -1 m/s."""
    H, inverse = np.vstack((BAR[list(held)], [-1.0, -b, 1.0])), np.diag([0.5, 2.0, 1.0])
    G, end = H @ inverse @ H.T, np.eye(len(held) + 1)[-1]
    v: Array = np.array([0.0, 0.0, -1.0]) + 2.0 * inverse @ H.T @ np.linalg.solve(G, end)
    return v


@pytest.mark.parametrize(("b", "held"), [(0.5, (0, 1)), (1.5, (1,)), (-1.5, (0,))])
def test_a_held_row_that_would_pull_is_let_go_by_a_strike(b: float, held: tuple[int, ...]) -> None:
    machine = ImpulseMachine(bar(b), [1e4] * 3, [1.0] * 3)
    settled = machine.settle(np.zeros(3), np.array([0.0, 0.0, -1.0]), (CONTACT, CONTACT, FREE))
    np.testing.assert_allclose(settled.v, exact_strike(b, held), atol=1e-12)
    assert [i for i, mode in enumerate(settled.modes) if mode == CONTACT] == list(held)
    let_go = {i for i, before, after, _ in settled.passed if (before, after) == (CONTACT, FREE)}
    assert let_go == {0, 1} - set(held)
    bounced = [p for i, before, _, p in settled.passed if i == 2 and before == COLLISION]
    assert bounced == [pytest.approx(1.0 * (settled.v[2] + 1.0))]


def test_what_is_struck_at_once_solves_its_complementarity_problem() -> None:
    """0 <= p, H v+ + e H v >= 0, and one of both is 0 for every touching row, at random rows and masses."""
    rng, several = np.random.default_rng(3), 0
    for _ in range(60):
        n = int(rng.integers(2, 6))
        nc = int(rng.integers(2, n + 1))
        H, e = rng.normal(size=(nc, n)), rng.uniform(0.0, 1.0, nc)
        its_law, masses = law([1e4] * nc, [0.0] * nc), 10.0 ** rng.uniform(-1.0, 1.0, n)
        machine = ImpulseMachine(rows(masses, H, np.zeros(nc), its_law, [0.0] * n).rigid(), [1e4] * nc, e.tolist())
        v = rng.normal(size=n)
        instant = Instant(machine.rows, np.zeros(n), v.copy(), (FREE,) * nc)
        instant.touching, before = list(range(nc)), H @ v
        if not simultaneous(instant, [1e4] * nc, e.tolist()):
            assert before.min() >= 0.0
            continue
        p = np.zeros(nc)
        for i, _, _, impulse in instant.passed:
            p[i] += impulse
        np.testing.assert_allclose(masses * (instant.v - v), H.T @ p, atol=1e-11)
        parts = H @ instant.v + e * before
        assert p.min() >= 0.0
        assert parts.min() >= -1e-9
        assert np.abs(p * parts).max() < 1e-9
        several += int((p > 0.0).sum() > 1 and (p == 0.0).any())
    assert several > 5


@pytest.mark.parametrize("rule", [sequential, simultaneous])
def test_a_slow_strike_is_captured_and_a_pressed_row_is_held(rule: Any) -> None:
    H, m, g = np.array([[1.0, 0.0], [-1.0, 1.0]]), 1.0, 9.81
    stack = rows([m, m], H, np.zeros(2), law([1e4] * 2, [0.0] * 2), [-m * g, -m * g]).rigid()
    machine = ImpulseMachine(stack, [1e4] * 2, [1.0] * 2, rule)
    settled = machine.settle(np.zeros(2), np.array([0.0, -0.01]), (FREE, FREE))
    assert settled.modes == (CONTACT, CONTACT)
    np.testing.assert_allclose(settled.v, 0.0, atol=1e-12)


@pytest.mark.parametrize("rule", [sequential, simultaneous])
def test_what_is_caught_stays_and_what_is_not_comes_back(rule: Any) -> None:
    """By Newton's law for each row alone: masses that nothing joins, pressed, at random speeds and restitutions."""
    rng, n, a0, force = np.random.default_rng(4), 6, 1e4, 9.81
    for _ in range(20):
        masses, e, v = rng.uniform(0.1, 3.0, n), rng.uniform(0.2, 1.0, n), 10.0 ** rng.uniform(-3.0, 1.0, n)
        its_law = law([a0] * n, [0.0] * n)
        apart = rows(masses.tolist(), np.eye(n), np.zeros(n), its_law, (-force * masses).tolist()).rigid()
        found = ImpulseMachine(apart, [a0] * n, e.tolist(), rule).settle(np.zeros(n), -v, (FREE,) * n)
        caught = v < force / (np.sqrt(a0) * e**1.5)
        assert [mode == CONTACT for mode in found.modes] == caught.tolist()
        np.testing.assert_allclose(found.v, np.where(caught, 0.0, e * v), atol=1e-12)
        given = {i: impulse for i, _, after, impulse in found.passed if after != COLLISION}
        np.testing.assert_allclose([given[i] for i in range(n)], masses * (found.v + v), rtol=1e-9)


def test_inputs_change_where_they_are_told_to() -> None:
    mass = rows([2.0], np.eye(1), np.array([10.0]), law([1e4], [0.0]), [0.0])

    def change(t: float, _q: Array, _v: Array) -> None:
        mass.tau[:] = {0.0: 2.0, 0.5: -4.0}[t]

    found = flow(LevelMachine(mass), [0.0], [0.0], 1.0, World(instants=(0.0, 0.5), change=change))
    t, _, v = found.log.motion[-1]
    assert (t, v[0]) == (1.0, pytest.approx(0.5 * 1.0 - 0.5 * 2.0, abs=1e-10))
    assert sum(t == 0.5 for t, _, _ in found.log.motion) == 2


def test_a_state_that_the_scene_cannot_reach_is_an_outcome() -> None:
    mass = rows([1.0], np.eye(1), np.array([10.0]), law([1e4], [0.0]), [1.0])
    world = World(safe=lambda q, _v: bool(q[0] < 0.1))
    found = flow(LevelMachine(mass), [0.0], [0.0], 10.0, world)
    assert found.outcome is Outcome.DIVERGED
    assert "t = " in found.message


@pytest.mark.parametrize("seed", range(30))
def test_the_least_push_leaves_no_row_behind_its_law(seed: int) -> None:
    """lam >= 0, G lam >= demand, and what is above its demand does not push: also where rows depend on each other."""
    rng = np.random.default_rng(seed)
    n, rank = int(rng.integers(1, 30)), int(rng.integers(1, 7))
    C = np.column_stack([rng.uniform(0.1, 1.0, n), rng.normal(size=(n, rank - 1))])  # all of them can be lifted
    G, demand = C @ C.T, 10.0 ** rng.uniform(-3.0, 4.0) * rng.normal(size=n)
    lam = least_push(G, demand)
    left, size = G @ lam - demand, np.abs(demand).max()
    assert lam.min() >= 0.0
    assert left.min() >= -1e-9 * size
    assert np.abs(lam * left).max() <= 1e-9 * size * max(float(lam.max()), size)


@pytest.mark.parametrize("seed", range(40))
def test_the_row_bears_whose_law_asks_for_most(seed: int) -> None:
    """A mass below several surfaces, thrown up too slowly: as it turns all could be caught, and one must be.

    It is fast enough for every damping to ask for a pull, so that all rows let it go at the start.
    """
    rng = np.random.default_rng(seed)
    n, g = int(rng.integers(2, 5)), 9.81
    H, a0, a1 = rng.uniform(0.3, 1.0, (n, 1)), 10 ** rng.uniform(2.0, 3.0, n), rng.uniform(200.0, 400.0, n)
    if seed % 2:
        H, a0, a1 = np.ones((n, 1)) + 1e-15 * rng.normal(size=(n, 1)), np.full(n, a0[0]), np.full(n, a1[0])
    start = -rng.uniform(0.05, 0.08, n)
    speed = 1.2 * float((g / H[:, 0] + a0 * -start / H[:, 0]).max() / a1.min())
    assert speed < 0.9 * float(np.sqrt(2.0 * g * (-start / H[:, 0]).min())), "it turns below all of them"
    found = flow(LevelMachine(rows([1.0], H, start, law(a0, a1), [-g])), [0.0], [speed], 3.0 * speed / g)
    asks = a0 * -(start + H[:, 0] * speed**2 / (2.0 * g)) / H[:, 0]
    assert all(m == Mode.BALLISTIC for m in found.log.mode[0])
    after = next(mode for mode in found.log.mode if any(m == Mode.CONTACT for m in mode))
    assert [i for i in range(n) if after[i] == Mode.CONTACT] == [int(np.argmax(asks))]
