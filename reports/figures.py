"""The figures of a case's page, as plain plotly dictionaries; every axis has its unit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from crossbody.cases import Mode, Trajectory
from crossbody.cases._arrays import Floats
from crossbody.reports.metrics._impulse import cumulative
from crossbody.reports.store import Trace
from crossbody.reports.thin import keep

TRUTH = "truth"
# Okabe and Ito's colours: told apart by colour-blind readers, on light and on dark.
COLOURS = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#8C6D00", "#7F7FFF", "#999999")
DASHES = ("solid", "dash", "dot", "dashdot")
MODE_COLOURS = {
    Mode.FREE: "#9aa5b1", Mode.CONTACT: "#0072B2", Mode.BALLISTIC: "#E69F00", Mode.COLLISION: "#D55E00",
    Mode.COLLISION_SEPARATION: "#CC79A7", Mode.BILATERAL: "#009E73",
}  # fmt: skip

Signal = Callable[[Trajectory], Floats]


def label(trace: Trace) -> str:
    """Engine and profile; "truth" for the truth."""
    return f"{trace.about['engine']}:{trace.about['profile']}" if trace.about["engine"] != TRUTH else TRUTH


def _style(i: int) -> dict[str, Any]:
    return {"color": COLOURS[i % len(COLOURS)], "dash": DASHES[i % len(DASHES)], "width": 1.8}


def _line(trace: Trace, y: Floats, i: int, *, legend: bool = True) -> go.Scatter:
    run = trace.run
    at = keep(run.t, y, np.array([e.t for e in run.events]))
    style = {"color": "#888888", "width": 4} if label(trace) == TRUTH else _style(i)
    return go.Scatter(
        x=run.t[at], y=y[at], name=label(trace), legendgroup=label(trace), showlegend=legend,
        mode="lines", line=style, opacity=0.6 if label(trace) == TRUTH else 1.0,
    )  # fmt: skip


def _frame(rows: Sequence[str], title: str) -> go.Figure:
    """Stacked plots over one time axis."""
    figure = make_subplots(rows=len(rows), cols=1, shared_xaxes=True, vertical_spacing=min(0.06, 0.3 / len(rows)))
    for i, name in enumerate(rows, start=1):
        figure.update_yaxes(title_text=name, row=i, col=1)
    figure.update_xaxes(title_text="time [s]", row=len(rows), col=1)
    figure.update_layout(title_text=title, height=150 + 210 * len(rows))
    return figure


def _error(mine: Floats, theirs: Floats) -> Floats:
    """|difference| for a logarithmic axis: a gap where both agree to the last bit."""
    difference = np.abs(mine - theirs)
    return np.where(difference > 0.0, difference, np.nan)


def motion(traces: Sequence[Trace]) -> go.Figure:
    """Every coordinate of every engine, and under it log |difference to the truth| at the same instants."""
    about = traces[0].about
    names = [(c["name"], c["unit"]) for c in about["coordinates"]]
    rows = [row for name, unit in names for row in (f"{name} [{unit}]", f"|{name} - truth| [{unit}]")]
    figure = _frame(rows, "Motion, and its difference to the truth at the same instant")
    for i, trace in enumerate(traces):
        for k in range(len(names)):
            figure.add_trace(_line(trace, trace.run.q[:, k], i, legend=k == 0), row=2 * k + 1, col=1)
            if trace.truth is not None:
                apart = _error(trace.run.q[:, k], trace.truth.q[:, k])
                figure.add_trace(_line(trace, apart, i, legend=False), row=2 * k + 2, col=1)
    for k in range(len(names)):
        figure.update_yaxes(type="log", exponentformat="power", row=2 * k + 2, col=1)
    return figure


def force(traces: Sequence[Trace]) -> go.Figure:
    """Multipliers, their cumulative impulse, and its difference to the truth's."""
    contacts = traces[0].about["contacts"]
    each = ("lam {} [N]", "impulse {} [N s]", "|impulse {} - truth| [N s]")
    figure = _frame([text.format(name) for name in contacts for text in each], "Contact force and cumulative impulse")
    for i, trace in enumerate(traces):
        if np.isnan(trace.run.lam).all():
            continue
        impulse = cumulative(trace.run)
        for k in range(len(contacts)):
            figure.add_trace(_line(trace, trace.run.lam[:, k], i, legend=k == 0), row=3 * k + 1, col=1)
            figure.add_trace(_line(trace, impulse[:, k], i, legend=False), row=3 * k + 2, col=1)
            if trace.truth is not None:
                apart = _error(impulse[:, k], cumulative(trace.truth)[:, k])
                figure.add_trace(_line(trace, apart, i, legend=False), row=3 * k + 3, col=1)
    for k in range(len(contacts)):
        figure.update_yaxes(type="log", exponentformat="power", row=3 * k + 3, col=1)
    return figure


def energy(traces: Sequence[Trace]) -> go.Figure:
    """Total energy, work of the contacts, and what neither they nor inputs nor damping explain."""
    rows = ["total energy [J]", "work of contacts [J]", "|unexplained energy| [J]"]
    figure = _frame(rows, "Energy ledger: what the law made, and what the integrator made")
    for i, trace in enumerate(traces):
        run = trace.run
        figure.add_trace(_line(trace, run.total_energy, i), row=1, col=1)
        if run.ledger is None:
            continue
        work = run.ledger.contact.sum(axis=1)
        figure.add_trace(_line(trace, work, i, legend=False), row=2, col=1)
        book = work + run.ledger.input - run.ledger.dissipated
        rest = _error(run.total_energy - run.total_energy[0], book - book[0])
        if np.isfinite(rest).any():
            figure.add_trace(_line(trace, rest, i, legend=False), row=3, col=1)
    figure.update_yaxes(type="log", exponentformat="power", row=3, col=1)
    return figure


def penetration(traces: Sequence[Trace]) -> go.Figure:
    """Depth of every contact below its surface, logarithmic."""
    contacts = traces[0].about["contacts"]
    figure = _frame([f"penetration {name} [m]" for name in contacts], "Penetration")
    for i, trace in enumerate(traces):
        for k in range(len(contacts)):
            depth = np.where(trace.run.gap[:, k] < 0.0, -trace.run.gap[:, k], np.nan)
            figure.add_trace(_line(trace, depth, i, legend=k == 0), row=k + 1, col=1)
    figure.update_yaxes(type="log", exponentformat="power")
    return figure


def _spans(run: Trajectory, row: int) -> Iterator[tuple[float, float, int]]:
    """(from, to, mode) for every interval of constant mode of one row."""
    modes = run.mode[:, row]
    cuts = np.flatnonzero(modes[1:] != modes[:-1]) + 1
    for a, b in zip([0, *cuts], [*cuts, len(modes) - 1], strict=True):
        yield float(run.t[a]), float(run.t[b]), int(modes[a])


def modes(traces: Sequence[Trace]) -> go.Figure:
    """One strip a contact and engine, coloured by mode."""
    figure = go.Figure()
    shown: set[int] = set()
    for trace in reversed(traces):
        for k, contact in enumerate(trace.about["contacts"]):
            for mode, spans in _by_mode(trace.run, k).items():
                starts, widths = np.array(spans).T
                figure.add_trace(
                    go.Bar(
                        y=[f"{label(trace)} {contact}"] * len(starts), base=starts, x=widths, orientation="h",
                        marker={"color": MODE_COLOURS[mode], "line": {"width": 0}}, name=mode.name,
                        legendgroup=mode.name, showlegend=mode not in shown,
                        hovertemplate=f"{mode.name} from %{{base:.9g}} s for %{{x:.6g}} s<extra></extra>",
                    )
                )  # fmt: skip
                shown.add(mode)
    figure.update_layout(
        title_text="Modes of the state machine", barmode="overlay", height=170 + 32 * len(traces), bargap=0.25
    )
    figure.update_xaxes(title_text="time [s]")
    figure.update_yaxes(title_text="engine and contact [-]", automargin=True)
    return figure


def _by_mode(run: Trajectory, row: int) -> dict[Mode, list[tuple[float, float]]]:
    found: dict[Mode, list[tuple[float, float]]] = {}
    for a, b, mode in _spans(run, row):
        if mode >= 0:
            found.setdefault(Mode(mode), []).append((a, b - a))
    return found


def steps(traces: Sequence[Trace]) -> go.Figure:
    """Length of every step at its start: small while a collision lasts, large again when it is over."""
    figure = _frame(["step size [s]"], "Step size of each engine")
    for i, trace in enumerate(traces):
        starts, lengths = trace.about.get("steps", ((), ()))
        if len(starts):
            name = label(trace)
            figure.add_trace(
                go.Scatter(
                    x=starts, y=lengths, name=name, legendgroup=name, mode="lines", line=_style(i) | {"shape": "hv"}
                )
            )
    figure.update_yaxes(type="log", exponentformat="power")
    return figure


FIGURES: dict[str, Callable[[Sequence[Trace]], go.Figure]] = {
    "motion": motion,
    "force": force,
    "energy": energy,
    "modes": modes,
    "penetration": penetration,
    "steps": steps,
}
