"""What a sweep says as a whole beside counts and maxima of rows that were drawn."""

from __future__ import annotations

import json
import math
from collections import Counter

import numpy as np
import pandas as pd
import pytest

from crossbody.cases import Outcome
from crossbody.reports.judging.verdict import Word
from crossbody.reports.sweep.execute import REFUSED, SKIPPED
from crossbody.reports.sweep.map import STABILITY, stability_map, summary

ENDS = (Outcome.FINISHED.value, Outcome.DIVERGED.value, Outcome.STEP_LIMIT.value, SKIPPED, REFUSED)


def drawn(seed: int, count: int = 120) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    error, residual = 10.0 ** rng.uniform(-12.0, 0.0, (2, count))
    error[rng.random(count) < 0.2], residual[rng.random(count) < 0.2] = np.nan, np.nan
    knobs = [{"rtol": 1e-9}, {"rtol": 1e-6, "max_steps": 5}, {"dt": 1e-3}, {}]
    return pd.DataFrame({
        "index": rng.permutation(count), "suite": rng.choice([STABILITY, "balls"], count),
        "engine": rng.choice(["one", "two"], count), "profile": rng.choice(["a", "b"], count),
        "settings": [json.dumps(knobs[k]) for k in rng.integers(4, size=count)],
        "parameters": [json.dumps({"a0": float(a0), "mass": 2.0}) for a0 in rng.choice([10.0, 100.0], count)],
        "outcome": rng.choice(ENDS, count), "verdict": rng.choice([Word.WITHIN, Word.OUTSIDE, Word.INFO], count),
        "tier": rng.choice(["", "A", "C"], count), "error": error, "residual": residual,
    })  # fmt: skip


def largest(values: list[float]) -> float:
    return max((value for value in values if not math.isnan(value)), default=math.nan)


def ends(rows: list[dict[str, object]]) -> Counter[object]:
    return Counter(row["outcome"] for row in rows if row["outcome"] != Outcome.FINISHED.value)


def told(text: str) -> Counter[str]:
    return Counter({part.rpartition(" ")[0]: int(part.rpartition(" ")[2]) for part in text.split(", ") if part})


@pytest.mark.parametrize("seed", range(3))
def test_a_summary_counts_its_rows(seed: int) -> None:
    rows = drawn(seed)
    wall = np.random.default_rng(seed).uniform(1.0, 9.0, len(rows))
    times = pd.DataFrame({"index": np.arange(len(rows)), "wall_ms": wall})
    found = summary(rows, times)
    assert len(found) == 8
    for line in found.to_dict("records"):
        key = ("suite", "engine", "profile")
        own = [row for row in rows.to_dict("records") if all(row[name] == line[name] for name in key)]
        wanted = {
            "runs": len(own),
            "finished": sum(row["outcome"] == "finished" for row in own),
            "not_run": sum(row["outcome"] in (SKIPPED, REFUSED) for row in own),
            "outside": sum(row["verdict"] == Word.OUTSIDE for row in own),
            "with_truth": sum(row["tier"] != "" for row in own),
            "worst_error": largest([row["error"] for row in own if row["tier"] != ""]),
            "worst_residual": largest([row["residual"] for row in own]),
            "seconds": sum(wall[row["index"]] for row in own) / 1e3,
        }
        assert {name: line[name] for name in wanted} == pytest.approx(wanted, nan_ok=True)
        assert told(line["outcomes"]) == ends(own)


@pytest.mark.parametrize("seed", range(3))
def test_a_cell_of_the_map_is_its_runs(seed: int) -> None:
    rows = drawn(seed)
    cells = stability_map(rows)
    mapped = [row for row in rows.to_dict("records") if row["suite"] == STABILITY]
    assert cells["runs"].sum() == len(mapped)
    for cell in cells.to_dict("records"):
        knob = {} if cell["knob"] == "" else {cell["knob"]: cell["setting"]}
        own = [
            row for row in mapped
            if (row["engine"], row["profile"]) == (cell["engine"], cell["profile"])
            and {k: v for k, v in json.loads(row["settings"]).items() if k in ("rtol", "dt")} == knob
            and json.loads(row["parameters"])["a0"] == cell["a0"]
        ]  # fmt: skip
        assert (cell["runs"], cell["finished"]) == (len(own), sum(row["outcome"] == "finished" for row in own))
        assert cell["worst_error"] == pytest.approx(largest([row["error"] for row in own]), nan_ok=True)
        assert cell["worst_residual"] == pytest.approx(largest([row["residual"] for row in own]), nan_ok=True)
        assert told(cell["outcomes"]) == ends(own)
