"""The sentence with which a study begins says what its tables say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from crossbody.cases import Outcome
from crossbody.reports.bench.headline import summary
from crossbody.reports.judging.verdict import Word
from crossbody.reports.maps import gapmap
from crossbody.reports.sweep.map import in_words


def compared(*rows: tuple[str, str, float, str | None]) -> pd.DataFrame:
    """(case, engine, ratio, ahead)."""
    return pd.DataFrame(rows, columns=["case", "engine", "ratio", "ahead"]).assign(
        profile="matched", ratio_native=np.nan
    )


def test_a_headline_says_who_is_slower_who_is_not_and_who_reaches_no_error() -> None:
    rows = compared(("a", "slow", 40.0, "yes"), ("a", "quick", 4.0, "no"), ("b", "slow", 7.5, "yes"))
    lost = compared(("a", "lost", np.nan, None), ("b", "lost", np.nan, None))
    assert summary(pd.concat([rows, lost], ignore_index=True)) == (
        "The compiled reference is faster at every error in 2 of 3 comparisons (4 to 40 times at the engine's best "
        "error, without what is Python of its run); not in quick:matched. 2 reach no error: lost:matched (2 cases)."
    )
    assert summary(rows.head(1)) == (
        "The compiled reference is faster at every error in 1 of 1 comparison (40 times at the engine's best "
        "error, without what is Python of its run)."
    )


def test_an_engine_is_told_by_its_own_loop_where_it_has_one() -> None:
    """What Python takes around every step is no time of the engine."""
    rows = compared(("a", "slow", 77.0, "yes"), ("b", "slow", 9.0, "yes")).assign(ratio_native=[5.8, np.nan])
    assert "(5.8 to 9 times at" in summary(rows)


@pytest.mark.parametrize("seed", range(10))
def test_every_engine_that_is_ahead_or_lost_is_named(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ahead = rng.choice(np.array(["yes", "no", None], dtype=object), 12)
    rows = compared(*[(f"c{i % 3}", f"e{i}", 2.0, word) for i, word in enumerate(ahead)])
    told = summary(rows)
    for i, word in enumerate(ahead):
        assert (f"e{i}:matched" in told) == (word != "yes")


def runs(*ends: tuple[Outcome | str, Word, float]) -> pd.DataFrame:
    """(outcome, verdict, error)."""
    found: list[dict[str, Any]] = [
        {"engine": "e", "profile": "p", "outcome": str(outcome), "verdict": word, "error": error, "tier": "A"}
        for outcome, word, error in ends
    ]
    return pd.DataFrame(found)


def test_a_sweep_says_how_many_end_as_they_must_and_who_does_not() -> None:
    good = (Outcome.FINISHED.value, Word.WITHIN, 1e-9)
    assert in_words(runs(good, good)) == (
        "2 of 2 runs end at their horizon and within their limits. 2 had a truth, the largest relative error is 1e-09."
    )
    untold = (Outcome.FINISHED.value, Word.INFO, np.nan)
    assert in_words(runs(good, untold, untold)).startswith(
        "3 of 3 runs end at their horizon, 2 of them without a limit: not judged."
    )
    bad = [(Outcome.FINISHED.value, Word.OUTSIDE, 0.5), (Outcome.STEP_TOO_SMALL.value, Word.WITHIN, np.nan)]
    told = in_words(runs(good, *bad, ("skipped", Word.WITHIN, np.nan)))
    assert told.startswith("1 of 3 runs end at their horizon and within their limits; the others are 2 of e:p (")
    assert "outside 1" in told
    assert Outcome.STEP_TOO_SMALL.value in told
    assert "largest relative error is 0.5" in told


def test_a_gap_map_says_who_creates_most_energy_and_who_follows_the_ideal_pattern() -> None:
    about = {"n": 3, "engine": "e", "profile": "p", "machine": "level", "at_touch": "", "why": ""}
    lines = pd.DataFrame([
        about | {"most": 0.25, "at_s": 0.3, "ideal_from": 1.5, "failed": 0},
        about | {"most": 0.1, "at_s": 0.1, "ideal_from": np.nan, "failed": 2, "profile": "q"},
    ])  # fmt: skip
    most, failed = gapmap.in_words(lines)
    assert most == (
        "3 balls: e:p (level) creates most, 25 % of the energy brought in, at s = 0.3; "
        "1 of 2 follow the ideal pattern, all of these from s = 1.5 on."
    )
    assert failed == "2 runs failed."
    nobody = gapmap.in_words(lines.assign(ideal_from=np.nan, most=np.nan, failed=0))
    assert nobody == []
