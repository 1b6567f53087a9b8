"""What a sweep must say of made-up runs: how far off they are, what their account leaves open, and its verdicts.

A ball that bounces has an exact motion; a run that is that motion, stretched by a known part, is off by it. An account
that leaves a known energy open, numbers that are not finite, runs that say that they finished and did not, have their
words. And an axis gives its ends and its middle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pandas as pd

from crossbody import cases
from crossbody.cases import Case, Outcome, Trajectory
from crossbody.cases.trajectory import Ledger
from crossbody.reports.judging.asked import Found, Within, unlike
from crossbody.reports.judging.verdict import Word
from crossbody.reports.suites.axis import Levels, Linear, Log, Whole
from crossbody.reports.sweep.execute import REFUSED, SKIPPED, Tried, row
from crossbody.reports.sweep.measure import Asked, Error, at_the_end, error, instants, residual
from crossbody.reports.sweep.minimise import failures
from crossbody.reports.sweep.spec import Spec

OFF, LIMIT, EXACT = 1e-4, 1e-6, 1e-9
"""By which part a run is off; the largest error that its judge allows; and what sums in another order differ by."""


OPEN = 40.0
"""How many times as much an account that is open leaves: ten would be a sum of all steps' errors."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return what, number, least and most, and of what, where it is another one."""
    return unlike((_errors, _accounts, _axes, _words, _failures), "sweep", "a made-up run that ends in")


@cache
def _exact() -> tuple[Case, Trajectory]:
    case = cases.load("bouncing_ball", "linear")
    assert case.closed_form is not None
    return case, case.closed_form(instants(case.t_end))


def _errors() -> Iterator[Within]:
    """Yield the error of the exact motion, and of those that are off in all places, at their end, or late."""
    case, run = _exact()
    asked = Asked(limit=1.0, near=lambda: case)
    yield "error", "the exact motion", error(case, run, asked).value, 0.0, 1e-12
    yield (
        "error",
        "a motion that is stretched",
        error(case, replace(run, q=(1.0 + OFF) * run.q), asked).value,
        OFF,
        EXACT,
    )
    fewer = replace(run, events=(), q=run.q + OFF * float(np.max(np.abs(run.q))))
    yield "error", "a motion without its contacts", error(case, fewer, asked).value, OFF, EXACT
    fast = float(np.max(np.abs(run.v)))
    yield "error", "a speed at the end", at_the_end(case, run.q[-1], run.v[-1] + OFF * fast).value, OFF, EXACT


def _accounts() -> Iterator[Within]:
    """Yield what is left open of energies that are drawn, by the largest that moved or was turned over."""
    _, run = _exact()
    draw, count = np.random.default_rng(7), len(run.t)
    book = Ledger(
        contact=draw.normal(size=(count, 1)), input=draw.normal(size=count), dissipated=draw.normal(size=count)
    )
    open_ = draw.uniform(0.0, 0.1, count)
    total = book.input - book.dissipated + book.contact[:, 0] + open_
    made = replace(run, energy=np.stack([np.abs(total), total - np.abs(total)], axis=1), ledger=book)
    largest = max(abs(x - open_[0]) for x in open_.tolist())
    turned = [max(x) - min(x) for x in (book.input, book.dissipated, book.contact[:, 0], made.energy[:, 1])]
    scale = max(*turned, max(made.energy[:, 0]))
    yield "residual", "an account that is open", residual(made), float(largest / scale), EXACT


def _axes() -> Iterator[Within]:
    """Yield values at the ends of axes, and amid them."""
    for axis, wanted in (
        (Linear(-1.0, 3.0), (-1.0, 1.0, 2.0)), (Log(1e-3, 1e5), (1e-3, 10.0, 1e3)), (Whole(2, 5), (2, 4, 5)),
        (Levels((4.0, 2.0, 9.0, 1.0)), (4.0, 9.0, 1.0)),
    ):  # fmt: skip
        for u, must in zip((0.0, 0.5, 0.75), wanted, strict=True):
            yield "axis", f"{type(axis).__name__} at {u:g}", float(axis.at(u)), float(must), EXACT * abs(must)


def _words() -> Iterator[Within]:
    """Yield 1 where a run's word is another one than it must be, else 0."""
    case, exact = _exact()
    none = Ledger(contact=np.zeros((len(exact.t), 1)), input=np.zeros(len(exact.t)), dissipated=np.zeros(len(exact.t)))
    still = replace(exact, ledger=none, energy=np.ones((len(exact.t), 2)))
    open_ = replace(still, energy=still.energy + np.linspace(0.0, OPEN * LIMIT, len(exact.t))[:, None])
    off, near = (Error(value=times * LIMIT, tier="A", until=case.t_end) for times in (2.0, 0.5))
    done: dict[str, Any] = {"outcome": Outcome.FINISHED.value, "case": case}
    lost = np.where(np.arange(len(exact.t))[:, None] == 1, np.nan, exact.q)
    short = replace(still, t=0.5 * still.t)
    for what, tried, error_, who, heard, wanted in (
        ("right", Tried(run=still, **done), near, "reference", [], Word.WITHIN),
        ("off", Tried(run=still, **done), off, "reference", [], Word.OUTSIDE),
        ("off, of another engine", Tried(run=still, **done), off, "mujoco", [], Word.INFO),
        ("without a truth", Tried(run=still, **done), Error(), "reference", [], Word.LEDGER),
        ("of an open account", Tried(run=open_, **done), near, "reference", [], Word.OUTSIDE),
        ("that is not finite", Tried(run=replace(still, q=lost), **done), Error(), "mujoco", [], Word.OUTSIDE),
        ("that ends early", Tried(run=short, **done), Error(), "mujoco", [], Word.OUTSIDE),
        ("that says something", Tried(run=still, **done), near, "reference", ["a warning"], Word.OUTSIDE),
        ("that must finish", Tried(outcome="diverged"), Error(), "reference", [], Word.OUTSIDE),
        ("that need not finish", Tried(outcome="diverged"), Error(), "mujoco", [], Word.INFO),
        ("that is refused", Tried(outcome="refused"), Error(), "reference", [], Word.SKIPPED),
    ):  # fmt: skip
        found = row(_spec(who), tried, error_, list(heard))["verdict"]
        yield "verdict", f"a run {what}", float(found != wanted.value), 0.0, 0.0


def _failures() -> Iterator[Within]:
    """Yield 1 where a row of a word and an outcome is among failures and must not be, or must and is not, else 0."""
    kinds = [
        (Word.OUTSIDE, Outcome.FINISHED.value, True), (Word.INFO, Outcome.DIVERGED.value, True),
        (Word.OUTSIDE, Outcome.STEP_LIMIT.value, True), (Word.WITHIN, Outcome.FINISHED.value, False),
        (Word.LEDGER, Outcome.FINISHED.value, False), (Word.SKIPPED, REFUSED, False), (Word.SKIPPED, SKIPPED, False),
    ]  # fmt: skip
    rows = pd.DataFrame([(str(word), outcome) for word, outcome, _ in kinds], columns=["verdict", "outcome"])
    found = set(failures(rows).index)
    for i, (word, outcome, told) in enumerate(kinds):
        yield "failures", f"a run that is {word} and {outcome}", float((i in found) != told), 0.0, 0.0


def _spec(engine: str) -> Spec:
    return Spec(
        suite="made up", index=0, draw=0, case="bouncing_ball", variant="linear", parameters={}, engine=engine,
        profile="compiled", rung=-1, ladder=None, seed=0, second=False, afford=False, limit=LIMIT, finishes=True,
        ends=False, max_steps=1000, time_limit=1.0,
    )  # fmt: skip
