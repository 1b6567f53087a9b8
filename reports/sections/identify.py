"""Parameters identified from a log, with their intervals and what the data cannot tell."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from crossbody.cases.errors import several
from crossbody.reports.figures.section import Column, Kind, Plot, Section, Table, columns, records
from crossbody.reports.layout import unit_text
from crossbody.reports.runs.study import read_json

TITLE = "Identification"
ESTIMATES = columns(
    name="Parameter", value=("Estimate", Kind.NUMBER),
    half=("± (95 %)", Kind.NUMBER), low=("95 % from", Kind.NUMBER), high=("95 % to", Kind.NUMBER),
    unit="Unit", start=("Start", Kind.NUMBER), identifiable="Identifiable",
    first_half=("First half of the data", Kind.NUMBER), second_half=("Second half", Kind.NUMBER),
)  # fmt: skip
HELD = columns(
    error="Error", held_before=("Held-out windows, start", Kind.NUMBER),
    held_after=("Held-out windows, estimate", Kind.NUMBER), unit="Unit",
    change=("Change on held-out [%]", Kind.NUMBER), verdict=("Verdict", Kind.VERDICT),
    fitted_before=("Fitted windows, start", Kind.NUMBER), fitted_after=("Fitted windows, estimate", Kind.NUMBER),
    means=("Meaning", Kind.LONG),
)  # fmt: skip
MEANS = {
    "rmse": "root mean square of measured minus predicted",
    "end_median": "at the end of a window, median over windows",
    "end_90": "at the end of a window, 90 % quantile over windows",
}
JUDGED = {"within": "within the limit of its growth", "outside": "it has grown beyond its limit"}
OF_FIT = (
    "These residuals are what the fit leaves in its windows, from the starts that it fits, sample by sample: the "
    "intervals come from them, and are wider where they are correlated. Metrics and residuals of the replay below are "
    "of predictions of all windows from their measured starts, whose noise shifts whole windows."
)
PROFILE = (
    "The profile is how much the sum of squares rises, in % of that at the estimate, when one parameter is moved and "
    "all others are fitted again. If it meets the dashed line at both ends of the grey interval, it is a parabola, and "
    "the interval from derivatives can be trusted; if it is flat or asymmetric, it cannot. The data hardly "
    "separate parameters whose correlation is near 1 or -1."
)


def sections(out: Path) -> tuple[Section, ...]:
    """One section, if parameters were identified."""
    if not (out / "identify.json").is_file():
        return ()
    from crossbody.reports.replay import figure

    estimates, held = (pd.DataFrame(read_json(out / f"{name}.json")["rows"]) for name in ("identify", "held_out"))
    low, high = (estimates[end].astype(float) for end in ("low", "high"))  # None where a fit was stopped
    estimates["half"] = (high - low) / 2.0
    held["means"] = held["error"].map(MEANS)
    told = read_json(out / "identify.json")["provenance"]["fit"]
    windows = [len(told[name]) for name in ("fitted", "held")]
    how = f"Derivatives: {told['sensitivities']}. Intervals: {told['covariance']}."
    text = " ".join([*told["warnings"], how])
    says = summary(estimates, held, *windows)
    estimates["identifiable"] = estimates["identifiable"].map({True: "yes", False: "no"})
    tables = (
        Table(title="Estimates", columns=ESTIMATES, rows=records(_only(estimates, ESTIMATES)), file="identify.csv"),
        Table(title="Errors before and after", columns=HELD, rows=records(_only(held, HELD)), file="held_out.csv"),
    )
    drawn = {
        name: pd.DataFrame(read_json(out / f"identify-{name}.json")["rows"])
        for name in ("profile", "correlation", "residuals", "autocorrelation")
        if (out / f"identify-{name}.json").is_file()  # an earlier run has none
    }
    left, plots = [], []
    if len(drawn.get("residuals", ())):
        left = [
            Plot(name="identify-residual", figure=figure.residual(drawn["residuals"], {})),
            Plot(name="identify-autocorrelation", figure=figure.correlation(drawn["autocorrelation"])),
        ]
    if len(drawn.get("profile", ())):
        plots.append(Plot(name="identify-profile", figure=figure.profile(drawn["profile"], estimates)))
    if len(estimates) > 1 and len(drawn.get("correlation", ())):
        plots.append(Plot(name="identify-correlation", figure=figure.together(drawn["correlation"])))
    first = Section(name="identify", title="Identified parameters", says=says, text=text, tables=tables)
    shown = (
        Section(name="identify-left", title="Residuals of the fit", text=OF_FIT, plots=left),
        Section(name="identify-plots", title="How well they are determined", text=PROFILE, plots=plots),
    )
    return (first, *(section for section in shown if section.plots))


def one_unit(units: Sequence[str]) -> str:
    """Return the unit of what was measured; "mixed" where channels have several."""
    own = set(units)
    return own.pop() if len(own) == 1 else "mixed" if own else ""


def _only(rows: pd.DataFrame, shown: Sequence[Column]) -> pd.DataFrame:
    return rows.reindex(columns=[column.key for column in shown])


def summary(estimates: pd.DataFrame, held: pd.DataFrame, fitted: int, left: int) -> str:
    """Say what is identified, and whether it holds on windows that were left out of the fit.

    Args:
        estimates: with name, value, low, high, unit and identifiable of each parameter.
        held: with error, held_before and held_after, their unit, and verdict where it is judged.
        fitted: how many windows were fitted.
        left: how many were left out.
    """
    rows = records(estimates)
    known, lost = ([row for row in rows if bool(row["identifiable"]) == right] for right in (True, False))
    values = [
        f"{row['name']} = {row['value']:.5g} ± {(row['high'] - row['low']) / 2.0:.1g}{unit_text(str(row['unit']))}"
        for row in known
    ]
    of = f"{len(known)} of {several(len(rows), 'parameter')} {'is' if len(rows) == 1 else 'are'} identified"
    text = f"{of}{': ' * bool(values)}{', '.join(values)}"
    text += f"; not {', '.join(str(row['name']) for row in lost)}." if lost else "."
    if not left:
        return f"{text} No window of {fitted} was left out of the fit: nothing shows whether it holds on others."
    rmse = next((row for row in records(held) if row["error"] == "rmse"), None)
    if rmse is not None and rmse["held_before"] is not None and rmse["held_after"] is not None:
        unit = unit_text(str(rmse.get("unit") or "").replace("mixed", ""))
        judged = JUDGED.get(str(rmse.get("verdict")), "not judged")
        text += f" On held-out windows the rmse changed from {rmse['held_before']:.4g} to "
        text += f"{rmse['held_after']:.4g}{unit} ({judged})."
    return text
