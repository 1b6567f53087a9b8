"""Stacked plots over one time axis, and the mode strip, as plain dictionaries: quick."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crossbody.cases import Mode, Trajectory
from crossbody.cases.arrays import Floats, distinct
from crossbody.reports.figures.section import Figure
from crossbody.reports.figures.styles import called, coded, label, level, logarithmic, number, plain, single, style
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.runs.store import Trace
from crossbody.reports.runs.thin import AROUND, keep

FINE = 2e-5  # distance of samples over the horizon below which times are written in double precision
EVENTS, SHARE = 40, 0.4
"""Events around which all samples stay, the first if very many, and their share of a line."""
TOP, BOTTOM, PLOT, TALL, CLOSE, APART = 34, 50, 128, 320, 16, 46
"""Above and below the plots of a figure, a plot, one of sixteen decades, between plots of one
group, between groups (with times), pixels."""
NAME = 12  # height of the name of a line beside its plot, pixels
SEEN = 6  # height of a band that is seen around the truth, pixels
USUAL = "limit"  # what the limit of most engines is called
NARROW = 4  # limits around the truth that are said, where they are narrower than its line
LONG = 0.02  # part of the horizon: a line of errors is broken where a run has no sample for longer
LEAP = 100.0  # times a floor: a line that goes from there farther within one sample is broken
PARTS, EACH = 60, 8
"""Parts of the horizon, at most, of each of which the least, largest and mean of a comb is drawn, and how often it goes
up or down in one: fewer would draw the comb itself."""
DIGITS = 12  # of the mantissa of a value on a logarithmic axis, bits: four decimal ones
MODE_COLOURS = {
    Mode.FREE: "#9aa5b1", Mode.CONTACT: "#0072B2", Mode.BALLISTIC: "#E69F00", Mode.COLLISION: "#D55E00",
    Mode.COLLISION_SEPARATION: "#CC79A7", Mode.BILATERAL: "#009E73",
    Mode.STICK: "#56B4E9", Mode.SLIP: "#F0E442",
}  # fmt: skip
VEIL = "rgba(136,136,136,.14)"  # over what is not known: seen on light and on dark pages
LINE = 20  # letters of a title in one line
LONGEST = 150  # intervals of one mode in one bar; of more, the longest are drawn


class Sheet:
    """Plots one below another, with the lines of every engine; a plot in which nothing is drawn is left out.

    Args:
        rows: title of every plot's y axis, with its unit.
        title: of the figure.
        points: samples a line.
        group: so many plots belong together: the last of them carries the times.
    """

    def __init__(self, rows: Sequence[str], title: str, points: int, group: int = 1) -> None:
        self.rows, self.title, self.points, self.group = rows, title, points, group
        self.lines: list[tuple[int, NDArray[np.float32], dict[str, Any]]] = []
        self.decades: set[int] = set()
        self.ranges: dict[int, tuple[float, float]] = {}
        self.far: dict[str, list[tuple[float, str, str]]] = {}
        self.limits: list[tuple[int, float, str]] = []
        self.bands: list[tuple[int, float, str]] = []
        self.combs: dict[str, None] = {}
        self.sparse, self.end = False, 0.0

    def limit(self, row: int, value: float, name: str) -> None:
        """Draw what a plot's lines may reach and be within."""
        self.limits.append((row, value, name))

    def band(self, row: int, half: float, name: str) -> None:
        """Draw how far a plot's lines may be from the truth's, where that is wider than its line."""
        self.bands.append((row, half, name))

    def logarithmic(self, *rows: int) -> None:
        """Make the y axes of these plots (from 0 on) logarithmic."""
        self.decades |= set(rows)

    def clip(self, row: int, low: float, high: float) -> None:
        """Draw a plot between two values alone."""
        self.ranges[row] = low, high

    def beyond(self, who: str, size: float, unit: str, where: str) -> None:
        """Say in the title how far a line goes beyond its plot; of an engine's lines, the farthest."""
        self.far.setdefault(who, []).append((size, unit, where))

    def line(
        self, trace: Trace, row: int, y: Floats, t: Floats | None = None, floor: float = 0.0, **more: Any
    ) -> None:  # fmt: skip
        """One line of one engine into plot `row`, thinned; what is not finite, or leaps from a floor, is a gap.

        One with a floor is of errors: what they are within a long step nobody knows, so its ends alone are drawn.
        """
        t = trace.run.t if t is None else t
        if not len(t) or not np.isfinite(y).any():
            return
        self.end = max(self.end, float(t[-1]))
        most = int(np.clip(SHARE * self.points / AROUND, 3, EVENTS))
        events = distinct([e.t for e in trace.run.events])[:most]
        at = keep(t, y, events, self.points - AROUND * len(events))
        drawn_t, drawn_y, look = t[at], y[at], style(trace)
        if floor:
            long = np.flatnonzero(np.diff(t) > LONG * (t[-1] - t[0]))
            at = distinct(at, long, long + 1)
            drawn_t, drawn_y = broken(t[at], y[at], floor, np.flatnonzero(np.isin(at[:-1], long)) + 1)
            self._dots(trace, row, t, y, distinct(long, long + 1), look["color"])
        line = {
            "type": "scatter", "x": coded(_times(drawn_t)),
            "name": plain(called(trace)), "meta": label(trace), "mode": "lines",
            "line": {key: look[key] for key in ("color", "dash", "width")} | more,
            "opacity": 0.65 if label(trace) == TRUTH else 1.0,
        }  # fmt: skip
        self.lines.append((row, single(drawn_y), line))

    def band_of(self, trace: Trace, row: int, y: Floats, swings: float) -> None:
        """Draw of a comb its least to largest in every part of the horizon, below all lines, and its mean over time.

        It goes up or down so often in all.
        """
        t, y = trace.run.t, np.nan_to_num(y)
        edges = np.linspace(t[0], t[-1], int(np.clip(swings / EACH, 2, PARTS)) + 1)
        cuts = np.searchsorted(t, edges)
        some = [y[max(a - 1, 0) : b + 1] for a, b in pairwise(cuts)]
        low, high = (np.array([kind(part) for part in some]) for kind in (np.min, np.max))
        way = np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(t))])
        mean = np.diff(np.interp(edges, t, way)) / np.diff(edges)
        self.line(trace, row, np.append(mean, mean[-1]), edges, shape="hv")
        color, sides = style(trace)["color"], np.repeat(edges, 2)[1:-1]
        around = np.concatenate([np.repeat(high, 2), np.repeat(low, 2)[::-1]])
        band = {
            "type": "scatter", "x": coded(_times(np.concatenate([sides, sides[::-1]]))), "name": "",
            "meta": label(trace), "mode": "lines", "line": {"width": 0, "color": color}, "fill": "toself",
            "fillcolor": color, "opacity": 0.25, "hoverinfo": "skip",
        }  # fmt: skip
        self.lines.insert(0, (row, single(around), band))
        self.combs[label(trace)] = None

    def _dots(
        self, trace: Trace, row: int, t: Floats, y: Floats, at: NDArray[np.intp], color: str
    ) -> None:  # fmt: skip
        """Samples at the ends of long steps; they have no name, which stands at the end of the line."""
        if not np.isfinite(y[at]).any():
            return
        self.sparse = True
        dots = {"type": "scatter", "x": coded(_times(t[at])), "name": "", "meta": label(trace), "mode": "markers",
                "marker": {"size": 4, "color": color}, "cliponaxis": False}  # fmt: skip
        self.lines.append((row, single(y[at]), dots))

    def done(self) -> dict[str, Any]:
        """The figure."""
        drawn = sorted({row for row, *_ in self.lines})
        axes, height = self._axes(drawn)
        bands, narrow = self._seen()
        place = {row: number(i + 1) for i, row in enumerate(drawn)}
        data = [
            line
            | {"y": coded(_short(y) if row in self.decades else y)}
            | {"xaxis": f"x{place[row]}", "yaxis": f"y{place[row]}"}
            | ({"band": [half for half, _ in bands[row]]} if row in bands and line["meta"] == TRUTH else {})
            for row, y, line in self.lines
        ]
        layout = {"title": {"text": self._caption(drawn, bands, narrow)}, "height": height, "showlegend": False} | axes
        limits = [(f"y{place[row]}", value, name) for row, value, name in self.limits if row in place]
        return {"data": data, "layout": layout | {"shapes": [level(*one) for one in limits]}}

    def _span(self, row: int) -> ArrayLike:
        """What the axis of a plot covers."""
        return self.ranges.get(row) or np.concatenate([y[np.isfinite(y)] for at, y, _ in self.lines if at == row])

    def _seen(self) -> tuple[dict[int, list[tuple[float, str]]], list[str]]:
        """Half widths and names of the bands that are wider than the line that they are around, and what others are."""
        found: dict[int, list[tuple[float, str]]] = {}
        narrow: dict[int, dict[str, float]] = {}
        for row, half, name in (one for one in self.bands if one[0] in {at for at, *_ in self.lines}):
            seen = self._span(row)
            if 2.0 * half * PLOT > SEEN * np.ptp(seen):
                found.setdefault(row, []).append((half, name))
            else:
                halves = narrow.setdefault(row, {})
                halves[name] = min(half, halves.get(name, half))
        alike: dict[str, dict[str, None]] = {}
        for row, halves in narrow.items():  # of several that nobody sees, the usual one is said, or the narrowest
            name = USUAL if USUAL in halves else min(halves, key=lambda one: halves[one])
            title, _, unit = self.rows[row].partition("\n")
            alike.setdefault(f"±{halves[name]:.2g} {unit.strip('[]')} ({name})", {})[title] = None
        return found, [f"{', '.join(titles)} {text}" for text, titles in alike.items()]

    def _caption(
        self, drawn: Sequence[int], bands: Mapping[int, Sequence[tuple[float, str]]], narrow: Sequence[str]
    ) -> str:  # fmt: skip
        empty = [name.partition("\n")[0] for row, name in enumerate(self.rows) if row not in drawn]
        told = [f"Empty and left out: {', '.join(empty)}"] if empty else []
        told += [f"Off scale: {off_scale(self.far)}"] if self.far else []
        names = dict.fromkeys(name for each in bands.values() for _, name in each)
        told += [f"Grey around the truth: {', '.join(names)}"] if names else []
        more = f"; and {len(narrow) - NARROW} more" if len(narrow) > NARROW else ""
        told += [f"Limits narrower than a line: {'; '.join(narrow[:NARROW])}{more}"] if narrow else []
        told += [f"Shade and line: least to largest of {', '.join(self.combs)}, and its mean"] if self.combs else []
        told += ["Dots: the ends of long steps, between which no error is known"] if self.sparse else []
        return ". ".join([self.title, *told])

    def _axes(self, drawn: Sequence[int]) -> tuple[dict[str, Any], int]:
        """Axes of the plots that are drawn, and the height of the figure, pixels."""
        last = [i + 1 == len(drawn) or row // self.group != drawn[i + 1] // self.group for i, row in enumerate(drawn)]
        below = [APART if end else CLOSE for end in last[:-1]] + [0]
        names = Counter(row for row, _, line in self.lines if line["name"])
        heights = [max(TALL if row in self.decades else PLOT, NAME * names[row]) for row in drawn]
        inside = sum(heights) + sum(below)
        axes: dict[str, Any] = {}
        top = 0
        for i, row in enumerate(drawn):
            span = [1.0 - (top + heights[i]) / inside, 1.0 - top / inside]
            axes |= _pair(number(i + 1), self.rows[row], [max(span[0], 0.0), span[1]], last[i])
            if self.sparse and not i:  # dots would widen it
                axes["xaxis"]["range"] = [0.0, self.end]
            if i + 1 == len(drawn):
                axes[f"xaxis{number(i + 1)}"]["title"] = {"text": "time [s]"}
            if row in self.ranges:
                ends = self.ranges[row]
                axes[f"yaxis{number(i + 1)}"]["range"] = np.log10(ends).tolist() if row in self.decades else list(ends)
            if row in self.decades:
                axes[f"yaxis{number(i + 1)}"] |= logarithmic(self._span(row))
            top += heights[i] + below[i]
        return axes, TOP + inside + BOTTOM


def shaded(figure: Figure, until: float, end: float) -> Figure:
    """Shade a figure over time from when on the truth is not known, s, to its end, and say so in its title."""
    if not (until < end and figure["data"]):
        return figure
    layout = figure["layout"]
    title = {"text": f"{layout['title']['text']}. Shaded: the truth is known up to {until:.3g} s only"}
    veil = {"type": "rect", "x0": until, "x1": end, "yref": "paper", "y0": 0.0, "y1": 1.0, "line": {"width": 0},
            "fillcolor": VEIL, "layer": "below"}  # fmt: skip
    return figure | {"layout": layout | {"title": title, "shapes": [*layout.get("shapes", ()), veil]}}


def broken(t: Floats, y: Floats, floor: float, more: Sequence[int] | NDArray[np.intp] = ()) -> tuple[Floats, Floats]:
    """Break a line on a logarithmic axis where it leaps from the floor, or back to it: nothing is known in between.

    So it is before more of its points, each the end of a long step.

    A value that is alone stays joined to its neighbours, or nobody would see it, but for a first or last one at the
    floor, such as the difference at the start.
    """
    low = y <= floor
    starts = np.flatnonzero(low[1:] != low[:-1]) + 1
    several = np.diff(np.concatenate([[0], starts, [len(y)]])) > 1
    several[[0, -1]] |= low[[0, -1]]
    leaps = np.maximum(y[starts], y[starts - 1]) > LEAP * floor
    at = distinct(starts[several[:-1] & several[1:] & leaps], np.asarray(more, dtype=np.intp))
    return np.insert(t, at, t[at]), np.insert(y, at, np.nan)


def _short(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Round to the digits that a logarithmic axis shows: what is left of the others does not pack."""
    cut = np.uint32(np.finfo(np.float32).nmant - DIGITS)
    whole = values.view(np.uint32) + (np.uint32(1) << (cut - np.uint32(1)))
    return (whole >> cut << cut).view(np.float32)


def off_scale(far: Mapping[str, Sequence[tuple[float, str, str]]]) -> str:
    """Say of each engine how far it goes, in which unit and where, at its farthest."""
    told = ((who, *max(places), len(places) - 1) for who, places in far.items())
    return "; ".join(
        f"{who} up to {size:.3g} {unit} ({where}{f' and {more} more' if more else ''})"
        for who, size, unit, where, more in told
    )


def _lines(name: str) -> str:
    """The title of an axis and its unit: a long one in more lines, no longer than a plot is high."""
    text, _, unit = plain(name).partition("\n")
    if len(text) <= LINE:
        return f"{text}<br>{unit}" if unit else text
    whole = unit.replace(" ", "\u00a0")
    return "<br>".join(wrap(f"{text} {whole}", LINE, break_on_hyphens=False))


def _pair(n: str, name: str, domain: list[float], timed: bool) -> dict[str, Any]:
    """The two axes of one plot."""
    x: dict[str, Any] = {"anchor": f"y{n}", "domain": [0.0, 1.0], "showticklabels": timed}
    if n:
        x["matches"] = "x"
    title = {"text": _lines(name), "standoff": 14, "font": {"size": 12}}
    y = {"anchor": f"x{n}", "domain": domain, "title": title, "exponentformat": "e", "tickfont": {"size": 10.5}}
    return {f"xaxis{n}": x, f"yaxis{n}": y}


def _times(t: Floats) -> Floats:
    """Times in single precision where nobody can see it."""
    apart = np.diff(t)
    smallest = np.min(apart[apart > 0.0], initial=np.inf)
    return t.astype(np.float32) if smallest > FINE * abs(t[-1]) else t


def modes(traces: Sequence[Trace], points: int = LONGEST, limits: object = None, which: Sequence[int] = ()) -> Figure:
    """One strip a contact and engine, of contacts whose modes change."""
    moving = [(k, contact) for k, contact in changing(traces)[0] if not which or k in which]
    bars: list[dict[str, Any]] = []
    shown: set[int] = set()
    for k, contact in reversed(moving):
        for trace in reversed(traces):
            for mode, spans in _by_mode(trace.run, k).items():
                name = label(trace) if len(moving) == 1 else f"{contact}, {label(trace)}"
                bars.append(_bar(trace, name, mode, spans[:LONGEST]) | {"showlegend": mode not in shown})
                shown.add(mode)
    layout = {
        "title": {"text": "Modes of the state machine"}, "barmode": "overlay", "bargap": 0.25,
        "height": 150 + 18 * len({bar["y"][0] for bar in bars}),
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom"},
        "xaxis": {"title": {"text": "time [s]"}, "range": [0.0, float(traces[0].run.t[-1])]},
        "yaxis": {"automargin": True, "tickfont": {"size": 10}, "dtick": 1},  # every strip has its name
    }  # fmt: skip
    return {"data": bars, "layout": layout}


def changing(traces: Sequence[Trace]) -> tuple[list[tuple[int, str]], list[tuple[str, str]]]:
    """Contacts (index, name) whose mode changes or differs among engines, and name and mode of the others."""
    moving, still = [], []
    for k, contact in enumerate(traces[0].about["contacts"]):
        seen = {int(m) for trace in traces for m in distinct(trace.run.mode[:, k]) if m >= 0}
        if len(seen) > 1:
            moving.append((k, contact))
        else:
            still += [(contact, Mode(m).name) for m in seen]
    return moving, still


def alike(traces: Sequence[Trace]) -> list[list[int]]:
    """Contacts whose mode changes or differs, those together that are in the same modes in every engine."""
    found: dict[tuple[bytes, ...], list[int]] = {}
    for k, _ in changing(traces)[0]:
        found.setdefault(tuple(trace.run.mode[:, k].tobytes() for trace in traces), []).append(k)
    return list(found.values())


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
