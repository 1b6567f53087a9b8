"""A log replayed: what each engine leaves over of the measurement, and whether that is noise."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

import pandas as pd

from crossbody.reports.figures.section import Kind, Plot, Section, Table, columns, records
from crossbody.reports.layout import unit_text, valid
from crossbody.reports.replay.meanings import meaning
from crossbody.reports.runs.study import read_json

TITLE = "Replay"
TEXT = (
    "In each window the model starts from the measured state and is driven by the recorded "
    "inputs, held between their recorded times. Residuals are averaged over a twelfth of the "
    "motion's period; if they are noise, plus an error no larger than the noise of one "
    "sample, 99 of 100 correlations lie within the band. Grey bands are two standard "
    "deviations of the measurement noise; windows held out of an identification are shaded."
)
METRICS = columns(
    who="Engine", metric="Metric", channel="Channel",
    value=("Value", Kind.NUMBER), unit="Unit", verdict=("Verdict", Kind.VERDICT),
    means=("Meaning", Kind.LONG), valid="Valid",
)  # fmt: skip
JUDGED = ("outside", "crashed", "within")
"""Words of verdicts, the worst first."""
FINDINGS = columns(
    what="Check", channel="Channel", row=("Row", Kind.NUMBER), t=("Time [s]", Kind.NUMBER), text=("Comment", Kind.LONG)
)


NEXT_STEP = "crossbody identify fits parameters of the model to this log."
EXPLAINED = 99.0  # share of the motion, %, below which it is said what may be done


def sections(out: Path) -> tuple[Section, ...]:
    """Verdicts, what was measured and predicted, and what the log's checks found, if a log was replayed."""
    if not (out / "replay.json").is_file():
        return ()
    from crossbody.reports.replay import figure

    metrics, found, left, correlated = (
        pd.DataFrame(read_json(out / f"{name}.json")["rows"])
        for name in ("replay", "findings", "residuals", "correlations")
    )
    metrics = metrics.reindex(
        columns=[*(column.key for column in METRICS), "expected", "limit"]
    )  # none was judged once
    numbers = metrics[["expected", "limit"]].astype(float)
    metrics["valid"] = [valid(*pair) for pair in zip(numbers["expected"], numbers["limit"], strict=True)]
    metrics["means"] = metrics["metric"].map(meaning)
    metrics["unit"] = metrics["unit"].map(lambda unit: unit_text(unit, "{}"))
    told = read_json(out / "replay.json")["provenance"]
    about, held = told["log"], told.get("fit", {}).get("held", ())
    noise = {str(row["channel"]): float(row["value"]) for row in records(metrics) if row["metric"] == "noise"}
    plots = []
    if len(left):
        seen = {"replay-motion": figure.motion} if "measured" in left else {}
        limits = {
            str(row["channel"]): float(row["limit"]) for row in records(metrics)
            if row["metric"] == "largest" and row["limit"] is not None and row["limit"] > 0.0
        }  # fmt: skip
        for name, draw in (seen | {"replay-residual": partial(figure.residual, limits=limits)}).items():
            plots.append(Plot(name=name, figure=draw(left, noise, held), time=True))
    plots += [Plot(name="replay-correlation", figure=figure.correlation(correlated))] if len(correlated) else []
    origin = "SYNTHETIC, no measurement" if about["synthetic"] else "a measurement"
    text = f"The log {about['file']} is {origin}{about['about'] and ': '}{about['about'].rstrip('.')}."
    says = "" if held else summary(metrics)  # windows held out of a fit are judged with it
    shown = [
        Section(name="replay", title="Log and model", says=says, text=text, tables=tables(metrics)),
        Section(name="replay-plots", title="Measured and predicted", text=TEXT, plots=plots),
    ]
    if len(found):
        table = Table(
            title="Findings about the log", columns=FINDINGS, rows=records(found), file="findings.csv", once=True
        )
        shown.append(Section(name="replay-log", title="Checks of the log", tables=(table,)))
    return tuple(shown)


def tables(metrics: pd.DataFrame) -> tuple[Table, ...]:
    """Return the numbers that are judged, the worst first, and folded all others."""
    words = metrics["verdict"].map(str)
    rank = words.map({word: k for k, word in enumerate(JUDGED)})
    known, rest = metrics[rank.notna()].loc[rank.dropna().sort_values(kind="stable").index], metrics[rank.isna()]
    shown = [
        Table(title="Verdicts of the replay", columns=METRICS, rows=records(known), file="replay.csv", once=True)
    ] if len(known) else []  # fmt: skip
    plain = [column for column in METRICS if column.key not in ("valid", "verdict")]
    title = "Metrics that are not judged"
    more = Table(title=title, columns=plain, rows=records(rest), file="replay.csv", folded=True, once=True)
    return (*shown, more) if len(rest) else tuple(shown)


def summary(metrics: pd.DataFrame) -> str:
    """Say whether limits are met, if there are any, how much of the motion is explained, and what may be done."""
    said = [explained(metrics), judged(metrics)]
    least = metrics.loc[metrics["metric"] == "fit", "value"].min()
    told = said if metrics["limit"].isna().all() else said[::-1]
    return " ".join(filter(None, [*told, NEXT_STEP if least < EXPLAINED else ""]))


def explained(metrics: pd.DataFrame) -> str:
    """Say how much of the motion each engine explains where it explains least, and by how much it is off there."""
    fits = metrics[(metrics["metric"] == "fit") & metrics["value"].notna()].sort_values("value", kind="stable")
    largest = metrics[metrics["metric"] == "largest"].set_index(["who", "channel"])["value"]
    units = metrics[metrics["metric"] == "largest"].set_index(["who", "channel"])["unit"]
    told: dict[str, list[str]] = {}
    for who, channel, value in fits.drop_duplicates("who")[["who", "channel", "value"]].itertuples(index=False):
        off = largest.get((who, channel), math.nan)
        size = "" if math.isnan(off) else f", off by up to {off:.3g}{unit_text(units[who, channel])}"
        told.setdefault(f"{_share(value)} {channel}{size}", []).append(who)
    head = "Explained least" if fits["channel"].nunique() > 1 else "Explained"
    lines = [f"{text} ({', '.join(whom)})" for text, whom in told.items()]
    return f"{head}: {'; '.join(lines)}." if lines else ""


def _share(fit: float) -> str:
    """How much of a motion is explained, in words where that is less than nothing."""
    if fit >= 0.0:
        return f"{fit:.3g} % of"
    if math.isinf(fit):
        return "nothing, since nothing was measured to move, of"
    return f"nothing, since it is off {1.0 - fit / 100.0:.2g} times as much as the measured mean would be, of"


def judged(metrics: pd.DataFrame) -> str:
    """What all verdicts say together, first what is outside."""
    rows = metrics.fillna({"verdict": ""})
    rows = rows[rows["verdict"].isin(["within", "outside"])]
    if rows.empty:
        return "Nothing is judged, since no limit was given (for example --limit fit=90)."
    off = rows[rows["verdict"] == "outside"]
    those = [
        f"{row.who} {row.metric} {row.channel}".strip() + f" = {row.value:.4g}{unit_text(str(row.unit))} ({row.valid})"
        for row in off.itertuples()
    ]
    return f"{len(rows) - len(off)} of {len(rows)} limits are met." + (
        f" Outside: {', '.join(those)}." if those else ""
    )
