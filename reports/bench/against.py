"""A benchmark against an earlier one: what has become less accurate, and which lead was lost."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from pyarrow import ArrowException

from crossbody.cases import InvalidValue, OutputError
from crossbody.reports.bench.order import FLOOR
from crossbody.reports.runs.files import open_inside
from crossbody.reports.runs.output import recover

ACCURACY = 3.0
"""An error this many times the earlier one is lost accuracy; errors below rounding count as rounding."""
RATIO = 2.0
"""A ratio of run times this many times smaller than the earlier one is lost; seconds are never compared."""
RUNG = ["case", "engine", "profile", "knob", "setting"]
LINE = ["case", "engine", "profile"]
NEEDED = {"bench": [*RUNG, "error", "outcome"], "headline": [*LINE, "ratio"]}


def read(base: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Timings and headline of an earlier benchmark."""
    recover(base)
    if not base.is_dir():
        raise OutputError(f"--against {base} is not a folder; name one that crossbody bench wrote.")
    found = []
    for name, wanted in NEEDED.items():
        rows = _table(base / f"{name}.parquet")
        if missing := [column for column in wanted if column not in rows.columns]:
            raise OutputError(
                f"--against {base}: {name} has no column {', '.join(missing)}; it is of another version, "
                "run crossbody bench again for a base."
            )
        found.append(rows)
    return found[0], found[1]


def _table(path: Path) -> pd.DataFrame:
    try:
        with open_inside(path.parent, path.name) as file:
            return pd.read_parquet(file)
    except (OSError, ValueError, KeyError, ArrowException):  # not there, a link, or not Parquet
        raise OutputError(f"--against: {path} cannot be read; name a folder that crossbody bench wrote.") from None


def check_common(base_rows: pd.DataFrame, labels: Iterable[str]) -> None:
    """Before anything is run: whether an earlier benchmark has one of these cases, under the same parameters."""
    known = base_rows["case"].unique().tolist()
    if not set(labels) & set(known):
        raise InvalidValue(f"--against: the earlier benchmark has none of these cases; it has: {', '.join(known)}.")


def lost(
    rows: pd.DataFrame, headline: pd.DataFrame, base_rows: pd.DataFrame, base_headline: pd.DataFrame
) -> pd.DataFrame:
    """What was lost: one row a loss, columns case, engine, profile, what, before, now, why; empty if nothing was."""
    both = rows.merge(base_rows, on=RUNG, suffixes=("", "_before"))
    if not len(both):
        raise InvalidValue("--against: the two benchmarks have no case, engine and setting in common.")
    lines = headline.merge(base_headline, on=LINE, suffixes=("", "_before"))
    found = [*_accuracy(both), *_ratios(lines)]
    return pd.DataFrame(found, columns=[*LINE, "what", "before", "now", "why"])


def _accuracy(both: pd.DataFrame) -> Iterator[dict[str, object]]:
    for row in both.to_dict(orient="records"):
        now, before = (_number(row[name]) for name in ("error", "error_before"))
        if np.isfinite(before) and not now <= ACCURACY * max(before, FLOOR):
            why = f"error {now:.2g} at {row['knob']} = {row['setting']:g} where it was {before:.2g} ({row['outcome']})"
            yield {name: row[name] for name in LINE} | {"what": "accuracy", "before": before, "now": now, "why": why}


def _ratios(lines: pd.DataFrame) -> Iterator[dict[str, object]]:
    for row in lines.to_dict(orient="records"):
        now, before = (_number(row[name]) for name in ("ratio", "ratio_before"))
        if np.isfinite(before) and before > 1.0 and not now >= before / RATIO:
            why = f"the reference is {now:.3g} times as fast at its best error where it was {before:.3g} times"
            yield {name: row[name] for name in LINE} | {"what": "ratio", "before": before, "now": now, "why": why}


def _number(value: object) -> float:
    """A number of a table; where there is none, infinity."""
    number = float(str(value))
    return float(np.inf) if np.isnan(number) else number
