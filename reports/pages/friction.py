"""The force of one contact: over its depth, and of friction against the cone and the slip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Mode
from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.scene_contacts import WAYS, Contact, contacts
from crossbody.cases.scene_plain import scene_from
from crossbody.reports.figures.section import Plot, Section
from crossbody.reports.figures.styles import LINE, coded, label, plain, single, style
from crossbody.reports.pages.figures import (
    NONE,
    ROUNDING,
    Limits,
    carrying,
    chattering,
    clipped,
    force_kind,
    gap_limits,
    robust,
)
from crossbody.reports.pages.sheet import off_scale
from crossbody.reports.runs.store import Trace
from crossbody.reports.scenes.scene import slip

MOST_CONTACTS = 6  # of which one can be chosen
DOT = 3e-3  # part of a plot that a line is not seen below
TINY = float(np.finfo(float).tiny)
MOST_OF_DEPTH = 1500  # points of one engine's line
MOST_OF_COMB = 400  # points of an engine whose line would be a comb
OVER_DEPTH = (
    "Force over penetration depth of one contact. A spring gives a line; damping opens it to a loop "
    "whose area is the energy lost. A force below zero pulls. Where an engine goes far beyond the truth, the axes end "
    "at one and a half times the truth's largest, and the title says how far it goes."
)
DISC = {"type": "circle", "x0": -1.0, "y0": -1.0, "x1": 1.0, "y1": 1.0, "line": LINE}
MOST = 1000  # points of one engine's line
TEXT = (
    "Friction of one contact is bounded by mu times the normal force. The force of a sticking contact is inside "
    "this cone, that of a sliding one on its edge; outside, it violates Coulomb's law. In the plane of the "
    "contact, friction relative to its bound is a point of the unit disc, opposite to the slip if the contact slides."
)


def hysteresis(traces: Sequence[Trace], share: float = 1.0, limits: Limits = NONE) -> list[Section]:
    """The section, with a share of the usual points, and the limits of depths.

    Nothing where no contact that opens and closes carries anything.
    """
    found = _busiest(traces)
    most = _points(share * MOST_OF_DEPTH, len(found))
    plots = [
        plot for i, k in enumerate(found) if (plot := _loop(traces, k, most, _numbered("plot-hysteresis", i), limits))
    ]
    return [Section(name="hysteresis", title="Force over depth", text=OVER_DEPTH, plots=plots)] if plots else []


def _points(usual: float, contacts: int) -> int:
    """Points of a line of each of some contacts: all of them have no more than twice the room of one."""
    return max(int(2.0 * usual / (contacts + 1)), 2)


def _numbered(name: str, i: int) -> str:
    return f"{name}-{i + 1}" if i else name


def _loop(traces: Sequence[Trace], k: int, most: int, name: str, limits: Limits) -> Plot | None:
    """Force over depth of one contact in every engine, up to some times the truth's, and what is off that."""
    points = [(trace, found) for trace in traces if (found := _over_depth(trace, k, most))]
    if not points:
        return None
    contact = traces[0].about["contacts"][k]
    unit, kind = force_kind(traces, k)
    length = "m" if unit == "N" else "rad"
    told, axes = [f"Force over depth, contact {plain(contact)}"], list[dict[str, Any]]()
    depths = {label(trace): (float(np.nanmin(x)), float(np.nanmax(x))) for trace, (x, _) in points}
    for (ends, far), one in ((clipped(depths, ROUNDING), length), (robust(traces, k), unit)):
        axes.append({"range": list(ends)} if ends else {})
        told += [f"Off scale: {off_scale({who: [(size, one, contact)] for who, size in far.items()})}"] if ends else []
    halves: dict[str, float] = {}
    for half, called in gap_limits(traces[0], k, limits):  # the gap's and the depth's: the narrower counts
        halves[called] = min(half, halves.get(called, half))
    known = [f"±{half:.2g} {length} ({called})" for called, half in halves.items()]
    told += [f"Limits of the depth: {', '.join(known)} around the truth's"] if known else []
    edges = {} if length == "rad" else limits.get("penetration", {})
    layout = {
        "title": {"text": ". ".join(told)}, "height": 420, "showlegend": False,
        "xaxis": {"title": {"text": f"depth [{length}]"}, "exponentformat": "power"} | axes[0],
        "yaxis": {"title": {"text": f"{kind} [{unit}]"}, "exponentformat": "power", "rangemode": "tozero"} | axes[1],
        "shapes": [
            {"type": "line", "x0": x, "x1": x, "yref": "paper", "y0": 0.0, "y1": 1.0, "line": LINE} for x in edges
        ],
    }  # fmt: skip
    combs = chattering(traces, k)
    told += [
        f"Points: {', '.join(sorted(combs))}, whose contact opens and closes or swings too often for a line"
    ] * bool(combs)
    layout["title"] = {"text": ". ".join(told)}
    wide = [max(float(np.nanmax(np.abs(one[axis]))) for _, one in points) for axis in (0, 1)]
    lines = [_points_of(trace, x, y) for trace, (x, y) in points if label(trace) in combs]
    lines += [
        _drawn(trace, x, y, "lines+markers", marker={"size": 7})
        if _one_place(x, y, wide)
        else _drawn(trace, x, y, "lines")
        for trace, (x, y) in points if label(trace) not in combs
    ]  # fmt: skip
    return Plot(name=name, figure={"data": lines, "layout": layout}, choice=contact)


def _one_place(x: Floats, y: Floats, wide: Sequence[float]) -> bool:
    """Whether a line is no longer than a dot of a plot that reaches so far: what lies still on a rigid floor."""
    bears = np.isfinite(y) & (y != 0.0)
    spans = [float(np.ptp(one[bears])) if bears.any() else np.inf for one in (x, y)]
    return all(span < DOT * most or span == 0.0 for span, most in zip(spans, wide, strict=True))


def _drawn(trace: Trace, x: Floats, y: Floats, mode: str, **more: Any) -> dict[str, Any]:
    """One line of one engine in a plane."""
    look = style(trace)
    return {
        "type": "scatter", "mode": mode, "x": coded(single(x)), "y": coded(single(y)),
        "name": plain(label(trace)), "meta": label(trace),
        "line": {key: look[key] for key in ("color", "dash", "width")},
    } | more  # fmt: skip


def _points_of(trace: Trace, x: Floats, y: Floats) -> dict[str, Any]:
    """Samples of one engine in a plane, faint: those of a comb, below the lines of others."""
    known = np.isfinite(x) & np.isfinite(y) & (y != 0.0)
    x, y = (each[known][:: max(1, -(-int(known.sum()) // MOST_OF_COMB))] for each in (x, y))
    return _drawn(trace, x, y, "markers", marker={"size": 3, "opacity": 0.4, "color": style(trace)["color"]})


def _busiest(traces: Sequence[Trace]) -> list[int]:
    """Contacts that open and close and carry a force, those first that carry most in the first motion with any."""
    bearing = carrying(traces) if traces else []
    for trace in traces:
        lam = np.abs(np.nan_to_num(trace.run.lam)).max(axis=0, initial=0.0)
        still = (np.nan_to_num(trace.run.gap) == 0.0).all(axis=0)  # rows of friction have no depth
        lam = np.where((trace.run.mode == Mode.BILATERAL).all(axis=0) | still, 0.0, lam)
        if lam.size and lam.max() > 0.0:
            order = np.argsort(-lam, kind="stable")
            return [int(k) for k in order if lam[k] > 0.0 and int(k) in bearing][:MOST_CONTACTS]
    return []


def _over_depth(trace: Trace, k: int, most: int) -> tuple[Floats, Floats] | None:
    """Depths and forces of one engine while its contact carries, from no force on the surface and back; or none."""
    depth, lam = -trace.run.gap[:, k], trace.run.lam[:, k]
    carries = np.isfinite(lam) & (lam != 0.0) & np.isfinite(depth)
    if not carries.any():
        return None
    near = carries | np.append(carries[1:], False) | np.insert(carries[:-1], 0, False)
    unknown = ~np.isfinite(lam + depth)
    x, y = (np.where(unknown, np.nan, np.where(carries, values, 0.0))[near] for values in (depth, lam))
    drawn = np.nan_to_num(np.stack([x, y]))
    steps = np.diff(drawn, axis=1, prepend=drawn[:, :1]) / np.maximum(np.ptp(drawn, axis=1, keepdims=True), TINY)
    along = np.cumsum(np.linalg.norm(steps, axis=0))  # a long rest is one place, and takes no points from an impact
    even = np.searchsorted(along, np.linspace(0.0, along[-1], most)) if len(y) > most else np.arange(len(y))
    at = distinct(even, drawn.argmax(axis=1), drawn.argmin(axis=1), np.flatnonzero(~carries[near]))
    return x[at], y[at]


def friction(traces: Sequence[Trace], share: float = 1.0) -> list[Section]:
    """The section, with a share of the usual points; nothing where no contact with friction is pressed."""
    found = _pressed(traces)
    most = _points(share * MOST, len(found))
    plots = [plot for i, (contact, place) in enumerate(found) for plot in _rubbing(traces, contact, place, most, i)]
    told = {"beside": True}
    return [Section(name="friction", title="Friction", text=TEXT, plots=plots, context=told)] if plots else []


def _rubbing(traces: Sequence[Trace], contact: Contact, place: int, most: int, i: int) -> list[Plot]:
    """The cone, the plane and, where it is known, the slip of one contact in every engine."""
    name = contact.normals[place]
    forces = [_forces(trace, contact, place) for trace in traces]
    cone = [_line(one, (forces[j][0][:, 0], forces[j][1]), most) for j, one in enumerate(traces)]
    plane = [_line(one, forces[j][2], most) for j, one in enumerate(traces)]
    top = max(float(np.nanmax(rows[:, 0], initial=0.0)) for rows, *_ in forces)
    ends, far = robust(traces, list(traces[0].about["contacts"]).index(name))
    title = f"Friction over normal force, {name}. Dashed: the bound, mu = {contact.friction:g}{_beyond(far, name)}"
    plots = [
        _plot("cone", i, title, cone, ("normal force [N]", "|friction| [N]"), [_edge(contact.friction, top)], name,
              _ranges((0.0, ends[1]), contact.friction) if ends else None),
        _plot("plane", i, f"Friction over its bound in the plane, {name}. Dashed: the cone's edge", plane,
              ("friction t1 / bound", "friction t2 / bound"), [DISC], name),
    ]  # fmt: skip
    if contact.first.type == "plane":
        slips = [_line(trace, _slipping(trace, contact, place), most) for trace in traces]
        plots.append(_plot("slip", i, f"Slip, {name}", slips, ("slip t1 [m/s]", "slip t2 [m/s]"), [], name))
    return plots


def _beyond(far: Mapping[str, float], contact: str) -> str:
    """Say which engines go beyond the scale of a plot of forces."""
    return f". Off scale: {off_scale({who: [(size, 'N', contact)] for who, size in far.items()})}" if far else ""


def _ranges(loads: tuple[float, float], mu: float) -> tuple[list[float], list[float]]:
    """Ranges of a normal force, and of friction up to twice its bound there."""
    low, high = loads
    return [low, high], [low, 2.0 * mu * high]


def _pressed(traces: Sequence[Trace]) -> list[tuple[Contact, int]]:
    """Contacts with friction, and their places, those first that carry most in the first motion with any."""
    told = traces[0].about.get("scene") if traces else None
    rubs = [one for one in contacts(scene_from(told)) if one.friction > 0.0] if told else []
    places = [(one, k) for one in rubs for k in range(one.places)]
    bearing = {traces[0].about["contacts"][k] for k in carrying(traces)} if places else set()
    for trace in traces:
        loads = np.array([float(np.nanmax(_rows(trace, one, k)[:, 0], initial=0.0)) for one, k in places])
        if loads.max(initial=0.0) > 0.0:
            ranked = [places[i] for i in np.argsort(-loads, kind="stable") if loads[i] > 0.0]
            return [(one, k) for one, k in ranked if one.normals[k] in bearing][:MOST_CONTACTS]
    return []


def _rows(trace: Trace, contact: Contact, place: int) -> Floats:
    """Normal force and both of friction (n, 3), N."""
    name, known = contact.normals[place], list(trace.about["contacts"])
    return trace.run.lam[:, [known.index(each) for each in (name, *(f"{name} {way}" for way in WAYS))]]


def _forces(trace: Trace, contact: Contact, place: int) -> tuple[Floats, Floats, tuple[Floats, Floats]]:
    """Rows (n, 3), size of friction (n,), N, and friction over mu lam (2, n) where it is pressed."""
    rows = _rows(trace, contact, place)
    pressed = rows[:, 0] > 0.0
    bound = np.where(pressed, contact.friction * rows[:, 0], np.nan)
    size = np.where(pressed, np.hypot(rows[:, 1], rows[:, 2]), np.nan)
    return rows, size, (rows[:, 1] / bound, rows[:, 2] / bound)


def _slipping(trace: Trace, contact: Contact, place: int) -> tuple[Floats, Floats]:
    """Velocity of the second shape over the first where they are pressed (n,) along both ways, m/s."""
    scene = scene_from(trace.about["scene"])
    found = slip(scene, contact, place, trace.run.q, trace.run.v)
    there = np.where(_rows(trace, contact, place)[:, :1] > 0.0, found, np.nan)
    return there[:, 0], there[:, 1]


def _line(trace: Trace, points: tuple[Floats, Floats], most: int) -> dict[str, Any]:
    """A line of one engine through samples even in number and along its way, and those beside its events."""
    x, y = points
    near = np.searchsorted(trace.run.t, [event.t for event in trace.run.events])[: most // 4]
    at = distinct(_even(x, y, most), near, near + 1)
    free = ~np.isfinite(x + y)
    at = np.r_[at, np.flatnonzero(free[1:] & ~free[:-1]) + 1]  # a line ends where a contact opens
    at = distinct(at[(at >= 0) & (at < len(x))])
    told = np.cumsum(np.diff(trace.run.t, prepend=-np.inf) == 0.0)  # both sides of an event
    jumps = np.flatnonzero(np.diff(told[at])) + 1
    x, y = (np.insert(each[at], jumps, np.nan) for each in points)
    return _drawn(trace, x, y, "lines+markers", marker={"size": 4})


def _even(x: Floats, y: Floats, most: int) -> NDArray[np.intp]:
    """At most so many samples, as even in number as along the line."""
    if len(x) <= most:
        return np.arange(len(x))
    way = np.cumsum(np.nan_to_num(np.hypot(np.diff(x, prepend=x[:1]), np.diff(y, prepend=y[:1]))))
    even = np.arange(len(x)) / len(x) + way / (way[-1] or 1.0)
    return np.searchsorted(even, np.linspace(0.0, even[-1], most))


def _plot(
    kind: str, i: int, title: str, lines: list[dict[str, Any]], axes: tuple[str, str],
    shapes: list[dict[str, Any]], contact: str, ranges: tuple[list[float], list[float]] | None = None,
) -> Plot:  # fmt: skip
    x, y = axes
    within = [{"range": each} for each in ranges] if ranges else [{}, {}]
    layout = {
        "title": {"text": title}, "height": 420, "showlegend": False, "shapes": shapes,
        "xaxis": {"title": {"text": x}, "exponentformat": "power"} | within[0],
        "yaxis": {"title": {"text": y}, "exponentformat": "power"} | within[1]
        | ({} if kind == "cone" else {"scaleanchor": "x"}),
    }  # fmt: skip
    figure = {"data": lines, "layout": layout}
    return Plot(name=_numbered(f"plot-friction-{kind}", i), figure=figure, choice=contact)


def _edge(mu: float, top: float) -> dict[str, Any]:
    return {"type": "line", "x0": 0.0, "y0": 0.0, "x1": top, "y1": mu * top, "line": LINE}
