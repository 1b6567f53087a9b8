"""What a sweep says as a whole: one line a suite and engine, and the stability map."""

from __future__ import annotations

import json
import math
from typing import Any

import pandas as pd

from crossbody.cases import Outcome
from crossbody.reports.judging.verdict import Word
from crossbody.reports.sweep.execute import REFUSED, SKIPPED
from crossbody.reports.sweep.minimise import failures

STABILITY = "stiffness"  # the suite whose grid is the map
KNOBS = ("rtol", "dt")
MAP = ("engine", "profile", "knob", "setting", "a0", "runs", "finished", "worst_error", "worst_residual", "outcomes")


def summary(rows: pd.DataFrame, times: pd.DataFrame | None = None) -> pd.DataFrame:
    """One row a suite, engine and profile: how its runs ended, the worst of them, and how long they took."""
    found = []
    wall = None if times is None else times.set_index("index")["wall_ms"]
    for (suite, engine, profile), group in rows.groupby(["suite", "engine", "profile"], sort=False):
        about = {"suite": suite, "engine": engine, "profile": profile, "runs": len(group)}
        judged = group[group["tier"] != ""]
        about |= {
            "finished": int((group["outcome"] == Outcome.FINISHED).sum()),
            "not_run": int(group["outcome"].isin([SKIPPED, REFUSED]).sum()),
            "outside": int((group["verdict"] == Word.OUTSIDE).sum()), "with_truth": len(judged),
            "worst_error": _worst(judged["error"]), "worst_residual": _worst(group["residual"]),
            "outcomes": outcomes(group),
        }  # fmt: skip
        if wall is not None:
            about["seconds"] = float(wall.loc[group["index"]].sum()) / 1e3
        found.append(about)
    return pd.DataFrame(found)


def in_words(rows: pd.DataFrame) -> str:
    """Say how many runs end as they must, who does not and how, and the largest error that a truth knows."""
    bad, judged = failures(rows), rows[rows["tier"] != ""]
    ran = int((~rows["outcome"].isin([SKIPPED, REFUSED])).sum())
    good = rows.drop(index=bad.index)
    untold = int((good["verdict"] == Word.INFO).sum())
    ends = f"{ran - len(bad)} of {ran} runs end at their horizon"
    told = [
        f"{ends} and within their limits" if not untold else f"{ends}, {untold} of them without a limit: not judged"
    ]
    if len(bad):
        each = bad.groupby(bad["engine"] + ":" + bad["profile"], sort=False)
        told.append("; the others are " + "; ".join(f"{len(own)} of {who} ({_ends(own)})" for who, own in each))
    told.append(f". {len(judged)} had a truth")
    if not math.isnan(worst := _worst(judged["error"])):
        told.append(f", the largest relative error is {worst:.2g}")
    return "".join(told) + "."


ERROR = (
    "An error is that of position, relative to how far the coordinates move, or the largest shift of a touch over the "
    "horizon, if that is larger, up to the time to which the truth is known better than the run can be."
)


def varied(rows: pd.DataFrame) -> list[str]:
    """Say of each suite what was varied in its runs, and from where to where."""
    return [f"{suite}: {_varied(own['parameters'])}." for suite, own in rows.groupby("suite", sort=False)]


def _varied(parameters: pd.Series[str]) -> str:
    runs = pd.DataFrame([json.loads(one) for one in parameters.drop_duplicates()])
    told = []
    for name in runs.columns:
        values = runs[name].dropna()
        if values.astype(str).nunique() < 2:
            continue
        if pd.api.types.is_numeric_dtype(values):
            told.append(f"{name} from {values.min():.3g} to {values.max():.3g}")
        else:
            told.append(f"{name} ({values.astype(str).nunique()} values)")
    return f"varied are {', '.join(told)}" if told else "nothing is varied"


def unrun(rows: pd.DataFrame) -> list[str]:
    """Say which engines did not run how many times, one line a reason."""
    gone = rows[rows["outcome"].isin([SKIPPED, REFUSED])]
    return [
        f"{outcome}: {', '.join(f'{who} {count}' for who, count in _who(own).items())}. {why}"
        for (outcome, why), own in gone.groupby(["outcome", "why"], sort=False)
    ]


def _who(rows: pd.DataFrame) -> dict[str, int]:
    counted = (rows["engine"] + ":" + rows["profile"]).value_counts(sort=False)
    return {str(who): int(count) for who, count in counted.items()}


def _ends(bad: pd.DataFrame) -> str:
    """How runs that are not as they must be end, in words."""
    early = outcomes(bad)
    outside = int((bad["outcome"] == Outcome.FINISHED).sum())
    return ", ".join(part for part in (early, f"outside {outside}" * (outside > 0)) if part)


def outcomes(group: pd.DataFrame) -> str:
    """How often each other end than finished came, in words."""
    counts = group["outcome"].value_counts()
    return ", ".join(f"{name} {count}" for name, count in counts.items() if name != Outcome.FINISHED)


def _worst(values: pd.Series[float]) -> float:
    known = values.dropna()
    return float(known.max()) if len(known) else math.nan


def stability_map(rows: pd.DataFrame) -> pd.DataFrame:
    """Which engine at which tolerance or step on which stiffness: one row a cell, columns `MAP`.

    Errors are the worst over all other axes, infinite where a contact misses.
    """
    mapped = rows[rows["suite"] == STABILITY]
    cells: dict[tuple[Any, ...], list[int]] = {}
    for i, (engine, profile, settings, parameters) in enumerate(
        zip(mapped["engine"], mapped["profile"], mapped["settings"], mapped["parameters"], strict=True)
    ):
        used = json.loads(settings)
        knob = next((name for name in KNOBS if name in used), "")
        key = (engine, profile, knob, used.get(knob, math.nan), float(json.loads(parameters)["a0"]))
        cells.setdefault(key, []).append(i)
    found = []
    for key, places in sorted(cells.items()):
        group = mapped.iloc[places]
        found.append(
            (*key, len(group), int((group["outcome"] == Outcome.FINISHED).sum()), _worst(group["error"]),
             _worst(group["residual"]), outcomes(group))
        )  # fmt: skip
    return pd.DataFrame(found, columns=list(MAP))
