"""The compiled reference beside every engine: how much faster it is at each error that the engine reaches."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from crossbody.reports.bench.order import FLOOR

REFERENCE = ("reference", "compiled")
COLUMNS = [
    "case", "engine", "profile", "tier", "against", "best_error", "engine_ms", "reference_error", "reference_ms",
    "ratio", "ratio_call", "least_ratio", "says",
]  # fmt: skip


def headline(rows: pd.DataFrame) -> pd.DataFrame:
    """One row an engine and profile on a case: ratio of its time to the reference's at its best error.

    Args:
        rows: as of `crossbody.reports.bench.ladder.bench`, with those of the compiled reference.

    Returns:
        ratio: of the runs themselves; ratio_call: of the whole calls from Python; least_ratio: the smallest of all
        error levels that the engine reaches. NaN where an engine fails or the reference is missing.
    """
    found = [row for _, group in rows.groupby("case", sort=False) for row in _case(group)]
    return pd.DataFrame(found, columns=COLUMNS)


def _case(group: pd.DataFrame) -> Iterator[dict[str, Any]]:
    mine = (group["engine"] == REFERENCE[0]) & (group["profile"] == REFERENCE[1])
    ours = group[mine & np.isfinite(group["error"].astype(float))]
    for (engine, profile), rungs in group[~mine].groupby(["engine", "profile"], sort=False):
        about = {"case": group["case"].iloc[0], "engine": engine, "profile": profile}
        yield about | _ratios(ours, rungs)


def _ratios(ours: pd.DataFrame, rungs: pd.DataFrame) -> dict[str, Any]:
    about = {"tier": rungs["tier"].iloc[0], "against": rungs["against"].iloc[0]}
    done = rungs[np.isfinite(rungs["error"].astype(float))]
    if not len(done):
        return about | {"says": f"no run reaches the truth's events: {', '.join(sorted(set(rungs['outcome'])))}"}
    levels = [_level(ours, rung) for rung in done.to_dict(orient="records")]
    best = min(levels, key=lambda level: (level["best_error"], level["engine_ms"]))
    least = min((level["ratio"] for level in levels), default=math.nan)
    return about | best | {"least_ratio": least, "says": _says(best, least, ours)}


def _level(ours: pd.DataFrame, rung: Mapping[Any, Any]) -> dict[str, Any]:
    """The cheapest run of the reference that is at least as accurate (rounding apart) as one rung."""
    error = max(float(rung["error"]), FLOOR)
    found = {"best_error": float(rung["error"]), "engine_ms": float(rung["median_ms"]), "ratio": math.nan}
    good = ours[ours["error"].astype(float) <= error]
    if not len(good):
        return found
    cheapest = good.iloc[int(np.argmin(good["median_ms"].astype(float)))]
    ms, call = float(cheapest["median_ms"]), float(good["call_ms"].astype(float).min())
    return found | {
        "reference_error": float(cheapest["error"]), "reference_ms": ms, "ratio": float(rung["median_ms"]) / ms,
        "ratio_call": float(rung["call_ms"]) / call,
    }  # fmt: skip


def _says(best: dict[str, Any], least: float, ours: pd.DataFrame) -> str:
    if not len(ours):
        return "the compiled reference was not run"
    if math.isnan(best["ratio"]):
        smallest = float(ours["error"].astype(float).min())
        return f"more accurate than the reference at its tightest ({smallest:.1e}), against its own law"
    if least > 1.0:
        return "behind at every error level"
    return f"ahead where the error is large: the least ratio is {least:.2g}"
