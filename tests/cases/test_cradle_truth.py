"""The exact motion of the cradle under the frozen rules, and the answers of the others, against known numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crossbody import engines
from crossbody.cases import Case, Outcome, Tier, Value, load
from crossbody.cases.mechanisms.cradle.motion import Motion, delassus, pushes
from crossbody.cases.mechanisms.cradle.rules import RULES, answer, block, simultaneous
from crossbody.cases.mechanisms.cradle.scene import Row
from crossbody.reports import metrics
from crossbody.reports.judging.comparison import judged
from crossbody.reports.measuring.truth import from_run, sample_times
from crossbody.reports.runs import choice, jobs

ONE = Row(masses=np.full(5, 0.1), lifted=1, speed=1.0, gap=0.0, a0=1e6, zeta=0.0)
THREE = replace(ONE, masses=np.ones(3))


def heap(n: int, k: int, gap: float = 0.0) -> Motion:
    motion = load("newtons_cradle", n=n, lifted=k, gap=gap).closed_form
    assert isinstance(motion, Motion)
    return motion


@pytest.mark.parametrize("most", [1, 1000])
def test_a_motion_says_whether_it_holds_all_its_impacts(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("crossbody.cases.mechanisms.cradle.motion.MAX_IMPACTS", most)
    motion = heap(4, 2, 1e-3)
    assert (motion(np.zeros(1)).outcome is Outcome.FINISHED) == (most > 4)
    assert (motion(np.zeros(1)).message == "") == (most > 4)


@pytest.mark.parametrize("gap", [0.0, 1e-3])
@pytest.mark.parametrize("n", range(2, 11))
def test_as_many_out_as_in(n: int, gap: float) -> None:
    for k in range(1, n):
        motion = heap(n, k, gap)
        out = np.where(np.arange(n) < n - k, 0.0, 1.0)
        np.testing.assert_allclose(motion.final, out, atol=1e-12)
        assert len(motion.events) == 2 * k * (n - k)


def test_unequal_masses() -> None:
    motion = load("newtons_cradle", n=3, masses="4,2,1").closed_form
    assert isinstance(motion, Motion)
    np.testing.assert_allclose(motion.final, [1 / 3, 4 / 9, 16 / 9], rtol=1e-14)


@pytest.mark.parametrize("rule", ["sequential", "simultaneous"])
@pytest.mark.parametrize("zeta", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(5))
def test_impacts_keep_momentum_and_their_account(rule: str, zeta: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    row = Row(masses=rng.uniform(0.1, 3.0, 7), lifted=3, speed=1.0, gap=1e-3 * (seed % 2), a0=1e6, zeta=zeta)
    motion = Motion(row, rule)
    run = motion(np.linspace(0.0, 2.0 * motion.last + 1.0, 50))
    np.testing.assert_allclose(run.v @ row.masses, row.masses @ row.v0, rtol=1e-13)
    assert run.ledger is not None
    change = run.total_energy - run.total_energy[0]
    np.testing.assert_allclose(change, run.ledger.contact.sum(axis=1), atol=1e-14)
    assert (run.gap > -1e-12).all()
    assert (np.diff(motion.final) > -1e-11).all()
    assert all(event.impulse > 0.0 for event in run.events[1::2])
    if rule == "sequential":
        impulse = np.zeros(8)
        for event in run.events:
            impulse[event.contact + 1] += event.impulse
        np.testing.assert_allclose(row.masses * (motion.final - row.v0), -np.diff(impulse), atol=1e-12)


@pytest.mark.parametrize("n", range(2, 11))
def test_all_at_once_is_two_nths(n: int) -> None:
    row = replace(ONE, masses=np.ones(n))
    expected = np.r_[(2 - n) / n, np.full(n - 1, 2 / n)]
    np.testing.assert_allclose(simultaneous(row), expected, atol=1e-14)


@pytest.mark.parametrize("k", range(1, 6))
@pytest.mark.parametrize("zeta", [0.0, 0.5])
def test_balls_that_collide_at_once_are_blocks(k: int, zeta: float) -> None:
    row = Row(masses=np.array([3.0, 1.0, 2.0, 0.5, 4.0, 1.0]), lifted=k, speed=2.0, gap=0.0, a0=1e4, zeta=zeta)
    np.testing.assert_allclose(simultaneous(row), block(row), atol=1e-13)


def test_a_chain_of_three_springs() -> None:
    found = answer("linear", THREE)
    assert found is not None
    np.testing.assert_allclose(found, [-0.1303, 0.1502, 0.9800], atol=5e-5)
    assert found @ found == pytest.approx(1.0, abs=1e-10)
    assert found.sum() == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(("n", "k"), [(3, 1), (5, 1), (5, 2)])
@pytest.mark.parametrize("rule", ["linear", "hertz"])
def test_chains_keep_energy_and_momentum(rule: str, n: int, k: int) -> None:
    found = answer(rule, replace(ONE, masses=np.ones(n), lifted=k))
    assert found is not None
    assert found @ found == pytest.approx(k, abs=1e-9)
    assert found.sum() == pytest.approx(k, abs=1e-11)


def test_stiffness_does_not_matter_to_touching_chains() -> None:
    for rule in ("linear", "hertz"):
        soft, stiff = (answer(rule, replace(THREE, a0=a0, speed=v)) for a0, v in ((1e2, 1.0), (1e8, 3.0)))
        assert soft is not None
        assert stiff is not None
        np.testing.assert_allclose(3.0 * soft, stiff, atol=1e-10)


@pytest.mark.parametrize("rule", RULES)
def test_two_balls_collide_alike_under_every_rule(rule: str) -> None:
    found = answer(rule, replace(ONE, masses=np.array([2.0, 1.0])))
    assert found is not None
    np.testing.assert_allclose(found, [1 / 3, 4 / 3], atol=1e-9)


@pytest.mark.parametrize(("n", "s", "gain"), [(3, 0.2, 0.135), (5, 0.1, 0.27), (3, 1.6, 0.0)])
def test_energy_of_the_memoryless_law(n: int, s: float, gain: float) -> None:
    row = replace(ONE, masses=np.ones(n), gap=s / 1e3)
    found = answer("memoryless", row)
    assert found is not None
    assert found @ found - 1.0 == pytest.approx(gain, abs=1e-3)


@pytest.mark.parametrize("seed", range(20))
def test_pushes_solve_the_complementarity_problem(seed: int) -> None:
    rng = np.random.default_rng(seed)
    G, b = delassus(rng.uniform(0.1, 5.0, 8)), rng.normal(size=7)
    x = pushes(G, b)
    rest = G @ x + b
    assert x.min() >= 0.0
    assert rest.min() > -1e-12
    assert abs(x @ rest) < 1e-12


@pytest.mark.parametrize(("n", "k"), [(200, 1), (200, 3), (60, 30)])
@pytest.mark.parametrize("gap", [0.0, 1e-3])
def test_long_rows(n: int, k: int, gap: float) -> None:
    np.testing.assert_allclose(heap(n, k, gap).final, np.where(np.arange(n) < n - k, 0.0, 1.0), atol=1e-11)


def test_an_impact_stands_before_and_after_where_it_is_asked_twice() -> None:
    case: Case = load("newtons_cradle", n=2, gap=0.1)
    assert case.closed_form is not None
    run = case.closed_form(np.array([0.1, 0.1]))
    np.testing.assert_allclose(run.v, [[1.0, 0.0], [0.0, 1.0]], atol=1e-15)


def test_collapse_in_no_time_ends() -> None:
    row = replace(ONE, zeta=3.0)
    motion = Motion(row, "sequential")
    np.testing.assert_allclose(motion.final, 0.2, atol=1e-9)


def drawn(seed: int) -> dict[str, Value]:
    """A row of damped balls; damping beyond which touching ones collide without end is among it."""
    rng = np.random.default_rng([15, seed])
    n = int(rng.integers(2, 8))
    return {
        "n": n, "lifted": int(rng.integers(1, n)),
        "zeta": float(rng.uniform(0, 1.2)) if rng.random() < 0.9 else 0.0,
        "gap": float(rng.choice([0.0, 10.0 ** rng.uniform(-5, -2)])),
        "collisions": str(rng.choice(["sequential", "simultaneous"])),
    }  # fmt: skip


def apart(seed: int, solver: str) -> dict[str, float]:
    """What a solver of the law says of a drawn row against the closed form."""
    case = load("newtons_cradle", "sliders", **drawn(seed))
    motion = case.closed_form
    assert motion is not None
    truth = replace(from_run(motion(sample_times(motion(np.zeros(1)), case.t_end, 101, 3)), Tier.A, ""), at=motion)
    run = engines.load("reference").prepare(case, solver, time_limit=60.0).run()
    names = (
        "position",
        "touch_count",
        "release_count",
        "lam_impulse_path",
        "energy_drift",
        "gap_error",
        "contact_work",
    )
    found = {name: metrics.load(name).measure(truth, run, case) for name in names}
    return {name: abs(value) for name, value in found.items() if value is not None}


@pytest.mark.parametrize(("solver", "seeds"), [("compiled", range(30)), ("cvode", range(8))])
def test_every_solver_meets_the_closed_form_of_any_damped_row(solver: str, seeds: range) -> None:
    """Contacts are counted alike even where they accumulate: 33 were told too many at a damping ratio of .7."""
    assert {seed: wrong for seed in seeds if max((wrong := apart(seed, solver)).values()) > 1e-6} == {}


def test_balls_that_do_not_touch_are_not_held_against_those_that_do() -> None:
    case = load("newtons_cradle", "sliders", n=3, lifted=2, zeta=0.2, gap=1e-3, collisions="simultaneous")
    found = jobs.run_case(case, choice.picks(("reference:compiled",)), refine=False)
    assert [row.metric for row in judged(case, found.entries, found.truth, "") if row.verdict == "outside"] == []


@pytest.mark.slow
def test_all_but_few_random_rows_meet_the_closed_form() -> None:
    """Where rounding decides which of two gaps closes first, the motions part: one row in fifty."""
    assert sum(max(apart(seed, "compiled").values()) > 1e-6 for seed in range(40, 400)) < 18


@pytest.mark.parametrize(("n", "zeta"), [(3, 2.0), (4, 0.9), (5, 0.7), (6, 0.7)])
def test_touching_balls_of_small_restitution_collide_as_often_as_their_rates_say(n: int, zeta: float) -> None:
    """By hand: the fastest gap turns to -e of its rate, both beside it close by (1 + e)/2 of it; down to 1e-9.

    They collide without end where e < tan(pi/4 (1 - 2/n))^2: .072, .17, .26 and .33 of three, four, five and six balls.
    """
    row = replace(ONE, masses=np.ones(n), zeta=zeta)
    e = row.e
    assert e < np.tan(0.25 * np.pi * (1.0 - 2.0 / n)) ** 2
    rates, count = np.zeros(n + 1), 0  # of approach, with a gap beyond either end
    rates[1] = 1.0
    while rates[1:n].max() > 1e-9 and count < 100_000:
        k = 1 + int(np.argmax(rates[1:n] >= rates[1:n].max() * (1.0 - 1e-12)))
        hit, rates[k] = rates[k], -e * rates[k]
        rates[k - 1] += 0.5 * (1.0 + e) * hit
        rates[k + 1] += 0.5 * (1.0 + e) * hit
        rates[0] = rates[n] = 0.0
        count += 1
    motion = Motion(row, "sequential")
    assert len(motion.events) == 2 * count
    assert motion.final == pytest.approx(np.full(n, 1.0 / n), abs=1e-9)
