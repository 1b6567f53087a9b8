"""What a benchmark must say of made-up times and errors: orders, ratios, medians, and what was lost."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd

from crossbody.cases import Trajectory
from crossbody.reports.bench import against
from crossbody.reports.bench.errors import errors, hermite, known_to
from crossbody.reports.bench.headline import headline
from crossbody.reports.bench.measure import COLUMNS, Rung, row_of
from crossbody.reports.bench.order import orders
from crossbody.reports.bench.skip import ratio
from crossbody.reports.judging.asked import Asked, Found, unlike_by
from crossbody.reports.judging.known_answers import UNLIKE, answers
from crossbody.reports.judging.made_up import MadeUp, case_of
from crossbody.reports.runs.choice import Pick

EXACT = 1e-9
"""Part of a number by which sums in another order differ."""
SEED = 7


@cache
def wrong() -> tuple[Found, ...]:
    """Return which number, as it is, least and most, and of what, where it is another one."""
    kinds = (_orders, _ratios, _medians, _errors, _cubics, _lost, _held)
    return unlike_by(kinds, "benchmark", "tables that end in", EXACT, 1e-300)


def _timed(engine: str, settings: Any, off: Any, ms: Any, **more: Any) -> pd.DataFrame:
    """Return rows of an engine at some settings, with their errors and times."""
    table = pd.DataFrame({"setting": settings, "error": off, "median_ms": ms})
    told = {name: math.nan for name in COLUMNS if name not in table} | {
        "case": "made_up:a", "engine": engine, "profile": "compiled" if engine == "reference" else "p", "knob": "dt",
        "tier": "A", "against": "the case", "known_to": 0.0, "outcome": "finished", "interpreted": "", "touches": 0.0,
        "promised": 2.0,
    }  # fmt: skip
    return table.assign(**(told | {"call_ms": 2.0 * table["median_ms"], "native_ms": 0.5 * table["median_ms"]} | more))


SAID = {
    2.0: "converges", 1.0: "converges, but not with the promised order 2",
    0.2: "does not converge to the truth of the case",
}  # fmt: skip


def _orders() -> Iterator[Asked]:
    """Yield the orders of errors C h^p, of those that reach a floor, and of too few; and what is said of them."""
    h = np.array([8e-3, 4e-3, 2e-3, 1e-3, 5e-4])
    for p, said in SAID.items():
        (row,) = orders(_timed("e", h, 3.0 * h**p, h)).to_dict(orient="records")
        yield "order", f"errors of the order {p:g}", row["order"], p
        yield "what is said", f"errors of the order {p:g}", float(row["says"] == said), 1.0
    floored = np.maximum(3e4 * h**3, 5e-6)
    (row,) = orders(_timed("e", h, floored, h)).to_dict(orient="records")
    yield "order", "errors of the order 3 above a floor", row["order"], 3.0
    for off, said in (
        ([1e-3, 1e-4], "fewer than three runs have a finite error above rounding"),
        ([1e-12] * 5, "exact at every setting"),
    ):
        (row,) = orders(_timed("e", h[: len(off)], off, 1.0)).to_dict(orient="records")
        yield "what is said", said, float(row["says"] == said), 1.0


def _ratios() -> Iterator[Asked]:
    """Yield the ratio at the best error that an engine reaches to the cheapest of ours at least as accurate."""
    ours = _timed("reference", [1e-4, 1e-6, 1e-8], [2e-4, 3e-6, 4e-8], [1.0, 2.0, 5.0])
    theirs = _timed("e", [1e-2, 1e-3, 1e-4], [1e-3, 1e-5, 5e-8], [4.0, 12.0, 70.0])
    (row,) = headline(pd.concat([ours, theirs], ignore_index=True)).to_dict(orient="records")
    wanted = {
        "best_error": 5e-8, "engine_ms": 70.0, "reference_ms": 5.0, "reference_error": 4e-8, "ratio": 70.0 / 5.0,
        "ratio_call": 140.0 / 10.0, "ratio_native": 35.0 / 5.0, "least_ratio": 2.0, "least_error": 1e-3,
    }  # fmt: skip
    for name, value in wanted.items():
        yield name, "an engine beside the reference", row[name], value
    yield "ahead", "a reference that is faster everywhere", float(row["ahead"] == "yes"), 1.0
    slow = ours.assign(median_ms=[1.0, 20.0, 50.0])
    (row,) = headline(pd.concat([slow, theirs], ignore_index=True)).to_dict(orient="records")
    yield "ahead", "a reference that is slower once", float(row["ahead"] == "no"), 1.0
    yield "least_ratio", "a reference that is slower once", row["least_ratio"], 6.0 / 20.0


def _medians() -> Iterator[Asked]:
    """Yield medians and quartiles of times that were noted, in ms, and what else stands in a row."""
    inner, call = [3e-3, 1e-3, 2e-3, 9e-3, 4e-3], [5e-3, 6e-3, 4e-3, 8e-3, 7e-3]
    made = MadeUp(case_of(*UNLIKE, SEED), SEED)
    rung = Rung(
        pick=Pick(engine="e", profile="p"), against="the case", truth=made.truth, knob="rtol", setting=1e-6,
        run=SimpleNamespace(native=iter((6e-3, 5e-3, 7e-3)).__next__), first=replace(made.run, steps=17),
        errors={"error": 4e-6}, promised=2.0, between=3.0, interpreted="",
    )  # fmt: skip
    for own, whole, cpu in zip(inner, call, (1.0, 1.2, 1.1, 2.0, 1.3), strict=True):
        rung.note(replace(made.run, wall_s=own, control_s=0.1 * own), whole, cpu)
    row, told = row_of(made.case, rung), "times of five runs"
    wanted = {
        "median_ms": 3.0, "iqr_ms": 2.0, "call_ms": 6.0, "native_ms": 5.0, "control_ms": 0.3, "cores": 1.2,
        "honesty": 4.0, "error": 4e-6, "steps": 17.0, "repeats": 5.0, "error_between": 3.0, "setting": 1e-6,
    }  # fmt: skip
    for name, value in wanted.items():
        yield name, told, float(row[name]), value


def _errors() -> Iterator[Asked]:
    """Yield the parts of the error of a made-up run, and the larger of its position and event times."""
    made = MadeUp(case_of(("m", "m"), (True, True), SEED), SEED)
    known, found = answers(made), errors(made.truth, made.run, made.case)
    names = {
        "error_q": "position", "error_v": "velocity", "error_impulse": "lam_impulse", "error_energy": "energy_drift",
        "error_times": "event_times",
    }  # fmt: skip
    for part, name in names.items():
        yield part, "a made-up run", found[part], known[name] or math.nan
    larger = max(known["position"] or math.nan, (known["event_times"] or math.nan) / made.case.t_end)
    yield "error", "a made-up run", found["error"], larger
    missed = errors(made.truth, replace(made.run, events=made.run.events[3:]), made.case)
    yield "error", "a run that misses a touch", float(missed["error"] == math.inf), 1.0
    apart = replace(made.truth, agreement={"position": 1e-9, "event_times": 4e-9 * made.case.t_end})
    yield "known_to", "two sources", known_to(made.case, apart), 4e-9


def _cubics() -> Iterator[Asked]:
    """Yield what stands between the steps of a cubic: itself."""
    t, grid = np.array([0.0, 0.4, 1.0, 1.7]), np.linspace(0.0, 1.7, 9)
    q, v = (2.0 * t**3 - t**2 + 0.5)[:, None], (6.0 * t**2 - 2.0 * t)[:, None]
    none = np.zeros((4, 0))
    run = Trajectory(t=t, q=q, v=v, gap=none, lam=none, energy=np.zeros((4, 2)), mode=none.astype(np.int8))
    found = hermite(run, grid).q[:, 0]
    for one, at in zip(found.tolist(), grid.tolist(), strict=True):
        yield "error_between", f"a cubic at {at:g}", one, 2.0 * at**3 - at**2 + 0.5


def _lost() -> Iterator[Asked]:
    """Yield how many numbers are lost: errors more than three times, and ratios less than half of what they were."""
    base = _timed("e", [1e-2, 1e-3], [1e-3, 1e-5], 1.0)
    line = pd.DataFrame({"case": ["made_up:a"], "engine": ["e"], "profile": ["p"], "ratio": [8.0]})
    for worse, less, wanted in ((2.9, 0.6, 0.0), (3.1, 0.6, 2.0), (2.9, 0.4, 1.0), (math.inf, math.nan, 3.0)):
        now = base.assign(error=base["error"] * worse)
        lost = against.lost(now, line.assign(ratio=8.0 * less if less == less else -math.inf), base, line)
        yield "lost", f"errors {worse:g} times as large, ratios {less:g} times", float(len(lost)), wanted


def _held() -> Iterator[Asked]:
    """Yield whether ratios on both sides of a limit are held, of a largest one and of a least."""
    asked = ((1.1, 1.2, False, 1), (1.3, 1.2, False, 0), (1.3, 1.2, True, 1), (1.1, 1.2, True, 0))
    for value, limit, least, wanted in asked:
        row = ratio("made up", value, limit, "", "", least=least)
        yield "held", f"{value:g} beside a limit of {limit:g}", float(row["held"]), float(wanted)
        yield "value", "a ratio", float(row["value"]), value
