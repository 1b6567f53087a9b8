"""The mode strip: one bar a contact and engine, coloured by the state of the row."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from crossbody.cases import Mode, Trajectory
from crossbody.reports.figures.section import Figure
from crossbody.reports.figures.styles import label, plain
from crossbody.reports.runs.store import Trace

MODE_COLOURS = {
    Mode.FREE: "#9aa5b1", Mode.CONTACT: "#0072B2", Mode.BALLISTIC: "#E69F00", Mode.COLLISION: "#D55E00",
    Mode.COLLISION_SEPARATION: "#CC79A7", Mode.BILATERAL: "#009E73",
    Mode.STICK: "#56B4E9", Mode.SLIP: "#F0E442",
}  # fmt: skip
LONGEST = 150  # intervals of one mode in one bar; of more, the longest are drawn
MOST_CONTACTS = 8


def modes(traces: Sequence[Trace], points: int = LONGEST, limits: object = None) -> Figure:
    """One strip a contact and engine; contacts that are in one mode throughout are named instead."""
    moving, still = changing(traces)
    bars: list[dict[str, Any]] = []
    shown: set[int] = set()
    for k, contact in reversed(moving[:MOST_CONTACTS]):
        for trace in reversed(traces):
            for mode, spans in _by_mode(trace.run, k).items():
                name = label(trace) if len(moving) == 1 else f"{contact}, {label(trace)}"
                bars.append(_bar(trace, name, mode, spans[:LONGEST]) | {"showlegend": mode not in shown})
                shown.add(mode)
    named = f". Throughout, in every engine: {', '.join(still)}" if still else ""
    layout = {
        "title": {"text": f"Modes of the state machine{named}"}, "barmode": "overlay", "bargap": 0.25,
        "height": 150 + 18 * len({bar["y"][0] for bar in bars}),
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom"},
        "xaxis": {"title": {"text": "time [s]"}, "range": [0.0, float(traces[0].run.t[-1])]},
        "yaxis": {"automargin": True, "tickfont": {"size": 10}},
    }  # fmt: skip
    return {"data": bars, "layout": layout}


def changing(traces: Sequence[Trace]) -> tuple[list[tuple[int, str]], list[str]]:
    """Contacts (index, name) whose mode changes or differs among engines, and "name MODE" of the others."""
    moving, still = [], []
    for k, contact in enumerate(traces[0].about["contacts"]):
        seen = {int(m) for trace in traces for m in np.unique(trace.run.mode[:, k]) if m >= 0}
        if len(seen) > 1:
            moving.append((k, contact))
        else:
            still += [f"{contact} {Mode(m).name}" for m in seen]
    return moving, still


def _bar(trace: Trace, name: str, mode: Mode, spans: Sequence[tuple[float, float]]) -> dict[str, Any]:
    starts, widths = np.array(spans).T
    return {
        "type": "bar", "y": [plain(name)] * len(starts), "base": starts.tolist(), "x": widths.tolist(),
        "orientation": "h", "marker": {"color": MODE_COLOURS[mode], "line": {"width": 0}},
        "name": mode.name, "legendgroup": mode.name, "meta": label(trace),
        "hovertemplate": f"{mode.name} from %{{base:.9g}} s for %{{x:.6g}} s<extra></extra>",
    }  # fmt: skip


def _spans(run: Trajectory, row: int) -> Iterator[tuple[float, float, int]]:
    """(from, to, mode) for every interval of constant mode of one row."""
    modes = run.mode[:, row]
    cuts = np.flatnonzero(modes[1:] != modes[:-1]) + 1
    for a, b in zip([0, *cuts], [*cuts, len(modes) - 1], strict=True):
        yield float(run.t[a]), float(run.t[b]), int(modes[a])


def _by_mode(run: Trajectory, row: int) -> dict[Mode, list[tuple[float, float]]]:
    """(start, length) of the intervals of every mode, the longest first."""
    found: dict[Mode, list[tuple[float, float]]] = {}
    for a, b, mode in _spans(run, row) if len(run.t) else ():
        if mode >= 0:
            found.setdefault(Mode(mode), []).append((a, b - a))
    return {mode: sorted(spans, key=lambda span: -span[1]) for mode, spans in found.items()}
