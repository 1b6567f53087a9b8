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
    "case", "engine", "profile", "tier", "against", "knob", "setting", "best_error",
    "engine_ms", "reference_error", "reference_ms", "ratio", "ratio_call", "ratio_native",
    "least_ratio", "least_error", "interpreted", "ahead", "says",
]  # fmt: skip


def headline(rows: pd.DataFrame) -> pd.DataFrame:
    """One row an engine and profile on a case: ratio of its time to the reference's at its best error.

    Args:
        rows: as of `crossbody.reports.bench.measure.bench`, with those of the compiled reference.

    Returns:
        ratio: of the runs themselves; ratio_call: of the whole calls from Python; ratio_native: of the
            engine's own loop over the same steps, without what is `interpreted` in its run; least_ratio: the
            smallest of these, or of ratio where there are none, of all error levels that the engine reaches,
            which is that of least_error; ahead: "yes" where the reference is faster at every one of them, else
            "no" and `says` why; nothing where an engine reaches none. An error below rounding, or below what
            the truth is known to, counts as that.
    """
    found = [row for _, group in rows.groupby("case", sort=False) for row in _case(group)]
    return pd.DataFrame(found, columns=COLUMNS)


def summary(rows: pd.DataFrame) -> str:
    """Say of a headline how often the compiled reference is faster, by how much, and how many reach no error."""
    reached = rows[rows["ahead"].notna()]
    best = rows["ratio"].astype(float)
    if "ratio_native" in rows:  # an older table has none
        best = rows["ratio_native"].astype(float).fillna(best)
    told = [f"The compiled reference is faster at every error in {_of(rows['ahead'] == 'yes', reached)}"]
    if best.notna().any():
        told.append(f" ({_range(best)} times at the engine's best error, without what is Python of its run)")
    behind = reached[reached["ahead"] == "no"]
    if len(behind):
        told.append(f"; not in {_named(behind)}")
    if len(lost := rows[rows["ahead"].isna()]):
        told.append(f". {len(lost)} {'reaches' if len(lost) == 1 else 'reach'} no error: {_named(lost)}")
    return "".join(told) + "."


def _range(best: pd.Series[float]) -> str:
    low, high = f"{best.min():.3g}", f"{best.max():.3g}"
    return low if low == high else f"{low} to {high}"


def _of(part: pd.Series[bool], whole: pd.DataFrame) -> str:
    return f"{int(part.sum())} of {len(whole)} comparison{'s' * (len(whole) != 1)}"


def _named(rows: pd.DataFrame) -> str:
    """Engines and profiles, each with its cases where there are several."""
    several = rows["case"].nunique() > 1
    who = rows.groupby(["engine", "profile"], sort=False)["case"]
    return ", ".join(
        f"{engine}:{profile}" + f" ({len(cases)} cases)" * (several and len(cases) > 1)
        for (engine, profile), cases in who
    )


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
        return about | {"says": _failed(rungs.iloc[-1])}
    rows = done.to_dict(orient="records")
    levels = [_level(ours, rung) for rung in rows]
    # Of errors that the truth does not tell apart the cheapest counts, of an engine as of the reference.
    best = min(zip(rows, levels, strict=True), key=lambda pair: (_known(pair[0]), pair[1]["engine_ms"]))[1]
    least = min(levels, key=lambda level: (math.isfinite(level["ratio"]), _fair(level)))
    found = {
        "least_ratio": _fair(least),
        "least_error": least["best_error"],
        "ahead": "yes" if _fair(least) > 1.0 else "no",
    }
    return about | best | found | {"says": _says(least, ours)}


def _fair(level: Mapping[str, Any]) -> float:
    """The ratio to an engine's own loop where it has one that runs without Python, else to its run."""
    native = float(level.get("ratio_native", math.nan))
    return native if math.isfinite(native) else float(level["ratio"])


def _failed(finest: pd.Series[Any]) -> str:
    """Why an engine reaches no error, by its finest run."""
    at = f"at {finest['knob']} = {finest['setting']:g}" if finest["knob"] else "as it is"
    if finest["touches"] and math.isfinite(finest["touches"]):
        return f"reaches no error: {at} its touches differ from the truth's by {finest['touches']:+g}"
    return f"reaches no error: {at} its run ends {finest['outcome']}"


def _known(rung: Mapping[Any, Any]) -> float:
    """The error of a rung as far as that is known: not below rounding, nor below what the truth is known to."""
    return max(float(rung["error"]), FLOOR, float(rung["known_to"]))


def _level(ours: pd.DataFrame, rung: Mapping[Any, Any]) -> dict[str, Any]:
    """The reference's cheapest run at least as accurate as one rung, as far as that is known."""
    error = _known(rung)
    found = {
        "knob": rung["knob"], "setting": rung["setting"], "best_error": float(rung["error"]),
        "engine_ms": float(rung["median_ms"]), "ratio": math.nan, "interpreted": rung.get("interpreted", ""),
    }  # fmt: skip
    good = ours[ours["error"].astype(float) <= error]
    if not len(good):
        return found
    cheapest = good.iloc[int(np.argmin(good["median_ms"].astype(float)))]
    ms, call = float(cheapest["median_ms"]), float(good["call_ms"].astype(float).min())
    return found | {
        "reference_error": float(cheapest["error"]), "reference_ms": ms,
        "ratio": float(rung["median_ms"]) / ms, "ratio_call": float(rung["call_ms"]) / call,
        "ratio_native": float(rung.get("native_ms", math.nan)) / ms,
    }  # fmt: skip


def _says(least: Mapping[str, Any], ours: pd.DataFrame) -> str:
    """Why the reference is not ahead at every error level; nothing where it is."""
    if not len(ours):
        return "the compiled reference was not run, or reached no error"
    if math.isnan(least["ratio"]):
        smallest = float(ours["error"].astype(float).min())
        return f"the reference does not get below {smallest:.1e} on the case's own law"
    if _fair(least) > 1.0:
        return ""
    level, ms, error = (float(least[name]) for name in ("best_error", "reference_ms", "reference_error"))
    if ms <= float(ours["median_ms"].astype(float).min()):
        return f"at error {level:.1e} the reference can do no less than its cheapest run, {ms:.3g} ms at {error:.1e}"
    return f"at error {level:.1e} the reference needs {ms:.3g} ms, with error {error:.1e}"
