"""Rows of any texts and numbers come back from all three files of a table."""

from __future__ import annotations

import csv
import json
import math
import string
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from crossbody.reports.runs.study import write_rows, write_table

SIGNS = [*string.printable, "é", "μ", "\u2028", '"', "\n", "\r\n", ",", ""]
NUMBERS = [0.0, -0.0, 5e-324, 1.7976931348623157e308, 0.1, 1.0 / 3.0, -math.pi, math.nan, math.inf, -math.inf, 1e22]
WORDS = ["", "nan", "NA", "null", "inf", "-1.5", "True", " ", "#"]
KINDS = {"name": str, "why": str, "value": float, "limit": float}


@pytest.mark.parametrize("seed", range(20))
def test_rows_are_what_was_written(seed: int, tmp_path: Path) -> None:
    """To the last digit; what is no number is nothing, and in JSON what is not finite."""
    random = np.random.default_rng(seed)

    def text() -> str:
        drawn = "".join(random.choice(SIGNS, random.integers(0, 12)))
        return str(random.choice(WORDS)) if random.random() < 0.3 else drawn

    rows = [
        {"name": text(), "why": text(), "value": float(random.choice(NUMBERS)), "limit": float(random.normal())}
        for _ in range(random.integers(1, 9))
    ]
    write_rows(tmp_path / "table", rows, KINDS, {"command": "a\nb"})
    table = pq.read_table(tmp_path / "table.parquet")
    assert json.loads(table.schema.metadata[b"provenance"]) == {"command": "a\nb"}
    for name, kind in KINDS.items():
        given, found = ([row[name] for row in each] for each in (rows, table.to_pylist()))
        if kind is float:
            assert [math.nan if x is None else x for x in found] == pytest.approx(given, rel=0.0, abs=0.0, nan_ok=True)
            assert [math.copysign(1.0, x) for x in found if x is not None] == [
                math.copysign(1.0, x) for x in given if not math.isnan(x)
            ]
        else:
            assert found == given
    with (tmp_path / "table.csv").open(encoding="utf-8", newline="") as file:
        told = list(csv.DictReader(file))
    assert [[row["name"], row["why"]] for row in told] == [[row["name"], row["why"]] for row in rows]
    plain = json.loads((tmp_path / "table.json").read_text(encoding="utf-8"))["rows"]
    assert [[row["name"], row["limit"]] for row in plain] == [[row["name"], row["limit"]] for row in rows]
    assert [row["value"] for row in plain] == [x if math.isfinite(x) else None for x in (r["value"] for r in rows)]


def test_a_carriage_return_ends_no_line_of_a_frame(tmp_path: Path) -> None:
    rows = pd.DataFrame({"why": ["one\rtwo", 'three, "four"'], "value": [1.5, 2.0]})
    write_table(tmp_path / "table", rows, {})
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "table.csv"), rows)
    with (tmp_path / "table.csv").open(encoding="utf-8", newline="") as file:
        assert [row["why"] for row in csv.DictReader(file)] == rows["why"].tolist()
