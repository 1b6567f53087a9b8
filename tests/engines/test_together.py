"""What does not touch moves together in one scene as each alone, whatever rows and velocities come before it."""

from __future__ import annotations

import numpy as np
import pytest
from pieces import case_of, drawn

from crossbody import engines
from crossbody.cases import Case, Outcome, Trajectory

HORIZON = 0.6  # s
STEPS = {"reference": {"rtol": 1e-10}, "mujoco": {"dt": 1e-3}, "pinocchio": {"rtol": 1e-10}}
"""Engine -> what it is given, so that a scene of several takes the steps of each."""


def ran(case: Case, engine: str, profile: str) -> Trajectory:
    run = engines.load(engine).prepare(case, profile, **STEPS[engine]).run()
    assert run.outcome is Outcome.FINISHED, run.message
    return run


def instants(run: Trajectory, case: Case) -> dict[str, list[tuple[int, int, float]]]:
    """Changes of the modes of each row, by its name."""
    found: dict[str, list[tuple[int, int, float]]] = {name: [] for name in case.contacts}
    for event in run.events:
        found[case.contacts[event.contact]].append((event.before, event.after, event.t))
    return found


@pytest.mark.parametrize(
    ("engine", "profile", "rough", "seed", "off"),
    [
        *(("reference", "compiled", True, seed, 1e-7) for seed in range(16)),
        *(("reference", "cvode", False, seed, 1e-7) for seed in range(3)),
        *(("mujoco", "matched", False, seed, 1e-9) for seed in range(4)),
        ("pinocchio", "law", False, 1, 1e-6),
        pytest.param("pinocchio", "law", False, 0, 1e-6, marks=pytest.mark.slow),
    ],
)
def test_pieces_move_together_as_each_alone(engine: str, profile: str, rough: bool, seed: int, off: float) -> None:
    pieces = drawn(seed, 3, rough)
    cases, whole = [case_of([piece], HORIZON) for piece in pieces], case_of(pieces, HORIZON)
    alone, together = [ran(case, engine, profile) for case in cases], ran(whole, engine, profile)
    for signal in ("q", "v"):
        ends = np.concatenate([getattr(run, signal)[-1] for run in alone])
        assert np.abs(getattr(together, signal)[-1] - ends).max() <= off, signal
    rows = {name: k for k, name in enumerate(whole.contacts)}
    told = instants(together, whole)
    for case, run in zip(cases, alone, strict=True):
        at = [rows[name] for name in case.contacts]
        for signal in ("gap", "lam"):
            mine, theirs = getattr(run, signal)[-1], getattr(together, signal)[-1, at]
            assert mine == pytest.approx(theirs, rel=1e3 * off, abs=1e3 * off), signal
        for name, changes in instants(run, case).items():
            assert [one[:2] for one in told[name]] == [one[:2] for one in changes]
            assert [one[2] for one in told[name]] == pytest.approx([one[2] for one in changes], abs=1e2 * off)
    assert together.energy[-1] == pytest.approx(np.sum([run.energy[-1] for run in alone], axis=0), abs=1e2 * off)
    if together.ledger is not None:
        for account in ("input", "dissipated"):
            total = sum(getattr(run.ledger, account)[-1] for run in alone)
            assert getattr(together.ledger, account)[-1] == pytest.approx(total, abs=1e2 * off)
