"""A replayed log as tables and motions, the measurement as the truth of each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from crossbody.cases import InvalidValue, Limit, UnknownName
from crossbody.cases.arrays import distinct
from crossbody.cases.errors import several
from crossbody.hw import Comparison, Fit, Log, Prediction
from crossbody.hw.replaying.comparison import Row
from crossbody.hw.windows.whiteness import autocorrelation
from crossbody.reports.judging.verdict import COLUMNS, Verdict, Word, judge, limit_for
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.runs.store import Trace, save

HELD = "held_out_worse"
WORSE = Limit(
    metric=HELD, value=5.0,
    why="A fit that is worse than its start on held-out windows matches the fitted ones by chance, or compensates a "
    "defect of the model by its parameters; the scatter of estimates costs a few percent at most.",
)  # fmt: skip
WHOLE = 100.0  # what a share in percent would be at best
FAILED = "A run that ends early predicts nothing after its end."
MEASURED, SYNTHETIC = "measurement", "SYNTHETIC, no measurement"
CALLED = "measured"  # what plots call a log, which stands where other cases have their truth
CORRELATIONS = ("who", "channel", "input", "lag", "lag_s", "value", "band")
RESIDUALS = ("who", "channel", "unit", "window", "t", "measured", "value")


def parse(pairs: Sequence[str]) -> tuple[Limit, ...]:
    """Limits from NAME=VALUE."""
    return tuple(_parsed(pair) for pair in pairs)


def _parsed(pair: str) -> Limit:
    name, _, text = pair.partition("=")
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not name.strip() or not 0.0 <= value < math.inf:
        raise InvalidValue(
            f"--limit {pair!r} is not NAME=VALUE with a value of at least 0, for example --limit fit=90."
        )
    if at_best(name.strip()) and value > WHOLE:
        raise InvalidValue(f"--limit {pair!r}: a share is at most {WHOLE:g} %.")
    return Limit(metric=name.strip(), value=value, why="Asked for by --limit.")


def at_best(metric: str) -> float:
    """What a metric would be at best: 100 % for shares, else 0."""
    return WHOLE if metric.split("_")[0] == "fit" or "_inside" in metric else 0.0


def check(limits: Sequence[Limit], found: Comparison, more: Sequence[str] = ()) -> None:
    """Raise UnknownName for a limit on a metric that no replay of this log has."""
    rows = found.rows()
    known = {row.metric for row in rows} | {label(row) for row in rows} | set(more)
    for limit in limits:
        if rows and limit.metric not in known:
            raise UnknownName(f"metric of a replay on {found.model}", limit.metric, known)


def label(row: Row) -> str:
    """Metric and channel in one word."""
    return f"{row.metric}_{row.channel}" if row.channel else row.metric


def judged(row: Row, limits: Sequence[Limit]) -> tuple[Word, str, float, float]:
    """Word, reason, what it would be at best, and how far it may be from that, of one number.

    A limit on one channel (`rmse_th1`) speaks before one on all of them (`rmse`). Of a share a
    limit names the least that is within, of any other metric the largest size.
    """
    if row.metric == "windows_failed" and row.value > 0.0:
        return Word.OUTSIDE, FAILED, 0.0, 0.0
    limit = limit_for(limits, label(row), row.engine, row.profile) or limit_for(
        limits, row.metric, row.engine, row.profile
    )
    return against(row.value, limit)


def against(value: float, limit: Limit | None) -> tuple[Word, str, float, float]:
    """The same of a number and its limit; without one nothing is judged."""
    if limit is None:
        return Word.INFO, "", math.nan, math.nan
    best = at_best(limit.metric)
    allowed = WHOLE - limit.value if best else limit.value
    off = Limit(metric=limit.metric, value=allowed, why=limit.why, known=limit.known, known_size=limit.known_size)
    word, why = judge(value - best, off, None)
    return word, why, best, allowed


def tier(log: Log) -> str:
    """What a log is: a measurement, or made by another engine."""
    return SYNTHETIC if log.provenance.synthetic else MEASURED


def variant(log: Log) -> str:
    """Name of a log in tables: its file, and the number of the run in it."""
    stem = Path(log.provenance.file).stem.strip("()") or "log"
    part = "" if log.provenance.part is None else f"_{log.provenance.part}"
    return f"{'' if not log.provenance.synthetic or 'synthetic' in stem else 'synthetic_'}{stem}{part}"


def verdicts(found: Comparison, command: str, given: Sequence[Limit] = (), fit: Fit | None = None) -> pd.DataFrame:
    """Every metric of every engine, judged where the model or the command has a limit on it.

    Args:
        found: the replay.
        command: what reproduces it.
        given: limits that go before those of the model.
        fit: the identification that the parameters come from, whose held-out error is judged too.
    """
    rules = (*found.limits, *given)
    source = f"{found.kind}, {several(len(found.windows), 'window')} of {found.log.provenance.file}"

    def row(engine: str, profile: str, **more: Any) -> Verdict:
        return Verdict(
            case=found.model, variant=variant(found.log), engine=engine, profile=profile,
            tier=tier(found.log), command=command, **more,
        )  # fmt: skip

    rows = []
    for r in found.rows():
        word, why, best, allowed = judged(r, rules)
        rows.append(row(
            r.engine, r.profile, metric=label(r), value=r.value, unit=r.unit,
            verdict=word, expected=best, limit=allowed, why=why or source,
        ))  # fmt: skip
    if fit is not None and not np.isnan(fit.worse):
        rule = limit_for((WORSE, *rules), HELD, "*", "*")
        word, why, best, allowed = against(fit.worse, rule)
        for p in found.predictions[:1]:
            rows.append(row(
                p.engine, p.profile, metric=HELD, value=fit.worse, unit="%",
                verdict=word, expected=best, limit=allowed, why=why,
            ))  # fmt: skip
    rows += [
        row(engine, profile, metric="-", value=np.nan, unit="", verdict=Word.SKIPPED, why=why)
        for (engine, profile), why in found.skipped.items()
    ]
    return pd.DataFrame([row.row() for row in rows], columns=list(COLUMNS))


def findings(found: Comparison) -> pd.DataFrame:
    """What the checks noticed about the log, what was repaired, and what is left over behind the last window."""
    told = [
        {"what": f.check, "channel": f.channel, "row": f.row, "t": f.t, "text": f.text} for f in found.log.findings
    ]  # fmt: skip
    told += [
        {"what": "repair", "channel": "", "row": r.row, "t": r.t, "text": f"{r.name}: {r.rows} rows"}
        for r in found.log.provenance.repairs
    ]
    last = int(np.searchsorted(found.log.time, found.time.max()))
    if (unused := found.log.time[-1] - found.log.time[last]) > 0.0:
        text = (
            f"The last {unused:g} s ({len(found.log) - 1 - last} samples) are shorter than a window and are not used."
        )
        told.append({"what": "windows", "channel": "", "row": last + 1, "t": found.log.time[last + 1], "text": text})
    return pd.DataFrame(told, columns=["what", "channel", "row", "t", "text"])


def correlations(found: Comparison) -> pd.DataFrame:
    """Residual tests: every lag, also in s, of every autocorrelation and of every correlation with an input."""
    rows = [row for prediction in found.predictions for row in _correlations(found, prediction)]
    return pd.DataFrame(rows, columns=list(CORRELATIONS))


def _correlations(found: Comparison, prediction: Prediction) -> Iterator[dict[str, Any]]:
    if prediction.failed:
        return
    who = f"{prediction.engine}:{prediction.profile}"
    for i, c in enumerate(found.coordinates):
        if not found.tells(i):
            continue
        tests = {"": found.autocorrelation(prediction, i)}
        count = found.windows[0].u.shape[1]
        tests |= {f"input {j + 1}": found.crosscorrelation(prediction, i, j) for j in range(count)}
        for name, test in tests.items():
            for lag, value in zip(test.lags.tolist(), test.values.tolist(), strict=True):
                yield {
                    "who": who, "channel": c.name, "input": name, "lag": lag,
                    "lag_s": lag * test.stride * found.log.sample_time, "value": value, "band": test.band,
                }  # fmt: skip


def residuals(found: Comparison, points: int = 2000) -> pd.DataFrame:
    """Measured minus predicted (`value`) and measured, at even samples of all windows, ends included."""
    windows = np.repeat(np.arange(len(found.windows)), [len(w.t) for w in found.windows])
    at = distinct(np.linspace(0, len(windows) - 1, min(points, len(windows))).astype(int))
    rows = [pd.DataFrame(columns=list(RESIDUALS))] if not found.predictions else []
    for prediction in found.predictions:
        who, left = f"{prediction.engine}:{prediction.profile}", found.residual(prediction)
        for i, c in enumerate(found.coordinates):
            told = (who, c.name, c.unit, windows[at], found.time[at], found.measured[at, i], left[at, i])
            rows.append(pd.DataFrame(dict(zip(RESIDUALS, told, strict=True))))
    return pd.concat(rows, ignore_index=True)


def left_by_fit(fit: Fit, found: Comparison, points: int = 2000) -> pd.DataFrame:
    """What a fit leaves in its windows (`value`), at even samples of all of them, as `residuals` has it of a replay."""
    rows = [pd.DataFrame(columns=list(RESIDUALS))]
    if fit.left:
        t, left = (np.concatenate(parts) for parts in zip(*fit.left, strict=True))
        windows = np.repeat(fit.fitted, [len(one) for one, _ in fit.left])
        at = distinct(np.linspace(0, len(t) - 1, min(points, len(t))).astype(int))
        for i, (name, unit) in enumerate(_channels(fit, found)):
            told = (_who(found), name, unit, windows[at], t[at], math.nan, left[at, i])
            rows.append(pd.DataFrame(dict(zip(RESIDUALS, told, strict=True))))
    return pd.concat(rows, ignore_index=True)


def correlations_of_fit(fit: Fit, found: Comparison) -> pd.DataFrame:
    """Autocorrelation of what a fit leaves, sample by sample: what its intervals take for white, or not."""
    rows = []
    for i, (name, _) in enumerate(_channels(fit, found) if fit.left else ()):
        test = autocorrelation([left[:, i] for _, left in fit.left])
        step = float(np.median(np.concatenate([np.diff(t) for t, _ in fit.left])))
        rows += [
            {"who": _who(found), "channel": name, "input": "", "lag": lag, "lag_s": lag * step, "value": value,
             "band": test.band}
            for lag, value in zip(test.lags.tolist(), test.values.tolist(), strict=True)
        ]  # fmt: skip
    return pd.DataFrame(rows, columns=list(CORRELATIONS))


def _who(found: Comparison) -> str:
    """Who runs the model."""
    return next((f"{one.engine}:{one.profile}" for one in found.predictions), "")


def _channels(fit: Fit, found: Comparison) -> list[tuple[str, str]]:
    """Names and units of what a fit compares: coordinates, but of what turns in space three angles."""
    if fit.left[0][1].shape[1] == len(found.coordinates):
        return [(c.name, c.unit) for c in found.coordinates]
    return [(f"difference {k + 1}", "") for k in range(fit.left[0][1].shape[1])]


def profile(fit: Fit) -> pd.DataFrame:
    """One row a value of a parameter at which the cost was found."""
    rows = [
        {"name": name, "value": value, "cost": cost}
        for name, (values, costs) in fit.profile.items()
        for value, cost in zip(values.tolist(), costs.tolist(), strict=True)
    ]
    return pd.DataFrame(rows, columns=["name", "value", "cost"])


def correlation(fit: Fit) -> pd.DataFrame:
    """One row a pair of estimates."""
    names = [one.name for one in fit.estimates]
    rows = [
        {"name": name, "other": other, "value": float(fit.correlation[i, j])}
        for i, name in enumerate(names)
        for j, other in enumerate(names)
    ]
    return pd.DataFrame(rows, columns=["name", "other", "value"])


def log_about(found: Comparison) -> dict[str, Any]:
    """Provenance of the log, for that of the report."""
    p = found.log.provenance
    return {
        "file": p.file, "sha256": p.sha256, "format": p.format, "library": p.library, "part": p.part,
        "synthetic": p.synthetic, "about": p.about, "columns": p.columns, "delay": found.delay,
        "repairs": [f"{r.name}: {r.rows} rows from row {r.row}" for r in p.repairs],
    }  # fmt: skip


def save_motions(folder: Path, found: Comparison) -> None:
    """The measurement as the truth, and every prediction beside it, into an empty folder."""
    measured = found.measurement()
    origin = found.log.provenance
    told = ". ".join(filter(None, (origin.file, origin.about)))
    source = {"tier": tier(found.log), "source": told, "called": CALLED}
    save(folder / "0000.parquet", Trace(about=_about(found, TRUTH, "") | source, run=measured))
    for i, prediction in enumerate(found.predictions, start=1):
        about = _about(found, prediction.engine, prediction.profile) | {"settings": dict(prediction.settings)}
        run = found.trajectory(prediction)
        save(folder / f"{i:04d}.parquet", Trace(about=about, run=run, truth=measured))


def _about(found: Comparison, engine: str, profile: str) -> dict[str, Any]:
    return {
        "case": found.model, "variant": variant(found.log), "title": found.title, "mechanism": "",
        "engine": engine, "profile": profile, "contacts": [], "parameters": dict(found.parameters),
        "coordinates": [{"name": c.name, "unit": c.unit} for c in found.coordinates],
        "units": dict(found.units),
    }  # fmt: skip
