"""No switch is missed by the SUNDIALS solvers: their search is their own, and is held against short steps."""

from __future__ import annotations

import numpy as np
import pytest
from springs import drawn, known

from crossbody.cases import Mode, Outcome
from crossbody.reference import simulate
from crossbody.reference.sundials import roots
from crossbody.reference.sundials.run import SundialsRun

BOUNDED = {"rtol": 1e-12, "max_step": 1e-3}  # a step of a millisecond has no room for an event between its nodes


@pytest.mark.parametrize("solver", ["cvode", "ida"])
@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10])
def test_a_window_between_two_nodes_is_found(rtol: float, solver: str) -> None:
    """The position at 1 s is 2.238691 if the row is caught again below its surface, and 2.219080 if not."""
    system, q0, v0 = known()
    run = simulate(system, q0, v0, 1.0, rtol=rtol, solver=solver, samples=[1.0])
    assert run.outcome.ok, run.message
    assert run.q[-1, 0] == pytest.approx(2.2386906796, abs=1e-8 + 10.0 * rtol)


@pytest.mark.parametrize("rtol", [9.07e-12, 9.98e-12, 1e-9])
def test_a_touch_that_does_not_press_does_not_flicker(rtol: float) -> None:
    """A spring pulls the body off while it closes: at its touch it is let go, and rounding does not open it."""
    system, q0, v0 = drawn(5380)
    run = simulate(system, q0, v0, 0.02, rtol=rtol, solver="ida")
    assert run.outcome.ok, run.message
    assert [event.after for event in run.events] == [Mode.CONTACT, Mode.BALLISTIC]


@pytest.mark.parametrize("solver", ["cvode", "ida"])
@pytest.mark.parametrize("seed", [215, 217, 586, 627, 652])
def test_a_row_that_is_let_go_while_it_closes_is_not_caught_on_the_spot(seed: int, solver: str) -> None:
    assert compared(seed, solver) < 1e-6


def compared(seed: int, solver: str) -> float:
    """Difference of the ends between a solver at its own steps and the compiled loop at short ones."""
    system, q0, v0 = drawn(seed)
    run = simulate(system, q0, v0, 1.0, rtol=1e-9, solver=solver, samples=[1.0])
    truth = simulate(system, q0, v0, 1.0, samples=[1.0], **BOUNDED)
    assert run.outcome is truth.outcome, (seed, run.message, truth.message)
    return float(np.abs(run.q[-1] - truth.q[-1]).max()) if run.outcome.ok else 0.0


@pytest.mark.parametrize("solver", ["cvode", "ida"])
def test_random_springs_and_walls_end_where_short_steps_do(solver: str) -> None:
    assert max(compared(seed, solver) for seed in range(25)) < 1e-6


@pytest.mark.slow
def test_many_random_springs_and_walls_end_where_short_steps_do() -> None:
    wrong = {seed: error for seed in range(2000) if not (error := compared(seed, "cvode")) < 1e-6}
    assert not wrong


@pytest.mark.parametrize("solver", ["cvode", "ida"])
def test_a_run_that_never_goes_on_from_a_change_of_its_inputs_ends(
    solver: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever leaves a stop where it was, steps of no length are counted: an outcome, and no hang."""
    take = SundialsRun._take_inputs
    monkeypatch.setattr(SundialsRun, "_take_inputs", lambda run: max(min(take(run), 0.25), run.state.t))
    system, q0, v0 = known()
    run = simulate(system, q0, v0, 1.0, solver=solver, time_limit=20.0)
    assert run.outcome is Outcome.STEP_TOO_SMALL
    assert run.t[-1] == 0.25


@pytest.mark.parametrize("seed", range(40))
def test_the_first_window_of_two_smooth_functions_is_found(seed: int) -> None:
    """Against a fine grid: sums of sines shifted so that the windows are narrow."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 4))
    sizes, rates = rng.normal(size=(count, 3)), rng.uniform(0.5, 9.0, (count, 3))
    phases = rng.uniform(0.0, 6.0, (count, 3))
    grid = np.linspace(0.0, 1.0, 200_001)
    values = (sizes[:, :, None] * np.sin(rates[:, :, None] * grid + phases[:, :, None])).sum(axis=1)
    shift = -values.max(axis=0).min() - 10.0 ** rng.uniform(-7.0, -1.0) * rng.choice([-1.0, 1.0], p=[0.3, 0.7])

    def terms(t: float) -> np.ndarray:
        found: np.ndarray = (sizes * np.sin(rates * t + phases)).sum(axis=1) + shift
        return found

    inside = values.max(axis=0) + shift <= 0.0
    place = roots.first(terms, 0.0, 1.0, 1e-12, np.zeros(count))
    if not inside.any():
        assert place is None or terms(place).max() <= 1e-9  # narrower than the grid
    elif inside[0]:
        assert place == 0.0
    else:
        assert place is not None
        assert grid[np.argmax(inside)] - 5e-6 - 1e-12 <= place <= grid[np.argmax(inside)] + 1e-12


def test_a_guard_of_the_mechanism_must_rise_before_it_fires() -> None:
    def terms(t: float) -> np.ndarray:
        return np.array([np.sin(7.0 * t - 1.0)])

    assert roots.first(terms, 0.0, 1.0, 1e-12, np.zeros(1), armed=False) == pytest.approx(
        (np.pi + 1.0) / 7.0, abs=1e-15
    )
    assert roots.first(terms, 0.0, 0.5, 1e-12, np.zeros(1), armed=False) is None
    assert roots.first(terms, 0.0, 1.0, 1e-12, np.zeros(1), armed=True) == 0.0
