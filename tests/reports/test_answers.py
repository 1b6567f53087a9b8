"""A truth that is asked for at many instants is integrated once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crossbody.cases import Ledger, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports.judging import answers

JUMP = 3.0
"""Instant of an event, where an instant that is asked for again stands behind it."""


def motion(times: Floats) -> Trajectory:
    """A motion whose velocity jumps at the event."""
    again = np.concatenate([[False], times[1:] == times[:-1]])
    v = np.where((times > JUMP) | again, -1.0, 1.0)[:, None]
    account = np.stack([times, 2.0 * times], axis=1)
    return Trajectory(
        t=times, q=times[:, None] ** 2, v=v, gap=account, lam=-account, energy=account,
        mode=np.zeros((len(times), 2), dtype=np.int8), ledger=Ledger(contact=account, input=times, dissipated=-times),
    )  # fmt: skip


some = st.lists(st.sampled_from(np.linspace(0.0, 5.0, 11).tolist()), min_size=1, max_size=30).map(sorted)


@settings(deadline=None)
@given(st.lists(some, min_size=1, max_size=4), st.booleans())
def test_what_is_taken_from_an_answer_is_what_would_have_been_integrated(asked: list[list[float]], told: bool) -> None:
    questions = [np.array([t for i, t in enumerate(times) if t == JUMP or t not in times[:i]]) for times in asked]
    questions = [q[np.concatenate([[True, True], q[2:] > q[:-2]])[: len(q)]] for q in questions]  # twice at most
    count = [0]

    def integrate(times: Floats) -> Trajectory:
        count[0] += 1
        return motion(times)

    found = answers.Answers(integrate)
    if told:
        found.expect(iter(questions))
    for times in questions:
        here, right = found(times), motion(times)
        for name in ("t", "q", "v", "gap", "lam", "energy", "mode"):
            assert np.array_equal(getattr(here, name), getattr(right, name)), name
        assert here.ledger is not None
        assert right.ledger is not None
        assert np.array_equal(here.ledger.contact, right.ledger.contact)
        assert np.array_equal(here.ledger.dissipated, right.ledger.dissipated)
    if told:
        assert count[0] == 1


def test_without_room_each_question_is_answered_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(answers, "ROOM", 1 << 14)
    sizes: list[int] = []

    def integrate(times: Floats) -> Trajectory:
        sizes.append(len(times))
        return motion(times)

    found = answers.Answers(integrate)
    wide = np.linspace(0.0, 1.0, answers.ROOM // 16 + 2)
    found(np.zeros(1))
    found.expect([wide[::2], wide[1::2]])
    assert sizes == [1]
    found(wide), found(wide)
    assert sizes == [1, len(wide)]


def test_only_what_no_answer_has_is_integrated() -> None:
    """Both sides of an event that is known from one alone are asked for anew, together."""
    asked: list[list[float]] = []

    def integrate(times: Floats) -> Trajectory:
        asked.append(times.tolist())
        return motion(times)

    found = answers.Answers(integrate)
    found(np.array([0.0, 1.0, JUMP]))
    found(np.array([2.0, 4.0]))
    mixed = found(np.array([0.0, 2.0, JUMP, JUMP, 4.0, 5.0]))
    assert asked == [[0.0, 1.0, JUMP], [2.0, 4.0], [JUMP, JUMP, 5.0]]
    assert np.array_equal(mixed.v, motion(mixed.t).v)
    assert mixed.ledger is not None
    assert np.array_equal(mixed.ledger.input, mixed.t)
    found(np.array([1.0, JUMP, JUMP, 4.0]))
    assert len(asked) == 3


def test_a_motion_that_ends_is_told_as_far_as_it_gets() -> None:
    found = answers.Answers(lambda times: motion(times[times <= JUMP]))
    found(np.array([1.0, 2.0]))
    assert found(np.array([1.0, 2.0, 2.5, 4.0])).t.tolist() == [1.0, 2.0, 2.5]
    assert found(np.array([1.0, 5.0])).t.tolist() == [1.0]
