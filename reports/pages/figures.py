"""The figures of a case's page; every axis has its unit, every line an engine that can be hidden."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from math import inf, isnan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Mode, Tier
from crossbody.cases.arrays import Floats, quantiles
from crossbody.cases.scene_contacts import WAYS, without_gap
from crossbody.cases.scene_plain import scene_from
from crossbody.reports.figures.section import Figure, Plot
from crossbody.reports.figures.styles import label
from crossbody.reports.judging.verdict import Row
from crossbody.reports.measuring.impulse import true_impulse, with_collisions
from crossbody.reports.measuring.scale import energy as energy_of
from crossbody.reports.measuring.scale import idle
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.pages import errors
from crossbody.reports.pages.filled import filled
from crossbody.reports.pages.sheet import Sheet, alike, changing, modes, shaded
from crossbody.reports.runs.store import Trace
from crossbody.reports.runs.thin import POINTS

SAMPLE = 16  # room of one sample of one line on a page, bytes (time and value as base64)
FEWEST = 60
MOST_SIGNALS = 9
"""Coordinates and contacts drawn of a mechanism that has more: those that matter most."""
FIRST = {"motion": 3, "force": 2, "modes": 3, "penetration": 3}
"""Of these, how many are seen at once in each figure; the others are drawn when they are asked for."""
BEYOND, FAR = 1.5, 4.0
"""Times the truth's largest force: up to which forces are drawn where any goes farther than the second."""
SWINGS, OFTEN = 60.0, 4.0
"""How often a force goes up or down by the truth's largest before its line is a comb that covers others, and times the
truth's own."""
NAMED = 6
"""Contacts without a force that are named; a robot has hundreds."""
IDLE = 1e-9
"""Part of the largest force of a case, or of the force that its energy makes over its way, below which
a contact carries none: tolerances of runs and rounding leave that."""
REMAINDERS = 0.02  # share of the steps that may be what is left before an event, or a first try: not drawn
EPS = float(np.finfo(float).eps)
SENSED = 1e-6  # part of the largest value that no sensor of a rig resolves
ROUNDING = 1e-17  # depth below which there is none, m


Limits = Mapping[str, Mapping[float, str]]  # metric -> what engines may reach -> how that is called
NONE: Limits = {}


def limits_of(rows: Iterable[Row]) -> Limits:
    """Return what engines may reach, a limit beyond what is claimed; those of few are called by whose they are."""
    found: dict[str, dict[float, list[str]]] = {}
    for row in rows:
        if (row["limit"] or 0.0) > 0.0:
            reach = row["limit"] + (0.0 if row["expected"] is None or isnan(row["expected"]) else row["expected"])
            found.setdefault(row["metric"], {}).setdefault(reach, []).append(f"{row['engine']}:{row['profile']}")
    told: dict[str, dict[float, str]] = {}
    for metric, limits in found.items():
        usual = max(limits, key=lambda limit: len(limits[limit]))
        told[metric] = {x: "limit" if x == usual else f"limit of {', '.join(whose)}" for x, whose in limits.items()}
    return told


def points_for(traces: Sequence[Trace], room: float) -> int:
    """Samples a line so that all lines of a case take `room` bytes."""
    coordinates, contacts = (min(len(traces[0].about[name]), MOST_SIGNALS) for name in ("coordinates", "contacts"))
    lines = len(traces) * (2 * coordinates + 4 * contacts + 4)
    return int(np.clip(room / (SAMPLE * lines), FEWEST, POINTS))


def floor_of(truth: Floats, part: float = EPS) -> float:
    """Below this a difference is rounding, or noise: that part of the largest value, down to a power of ten."""
    largest = float(np.max(np.abs(truth[np.isfinite(truth)]), initial=0.0))
    return float(10.0 ** np.floor(np.log10(largest * part))) if largest > 0.0 else 1e-17


def of_log(about: Mapping[str, Any]) -> bool:
    """Whether what a motion is held against is a log, which is no truth: it resolves what its sensors do."""
    return about.get("tier", "") not in {"", *Tier}


def apart(mine: Floats, theirs: Floats, floor: float) -> Floats:
    """|difference| for a logarithmic axis, not below the floor that all engines share."""
    return np.maximum(np.abs(mine - theirs), floor)


def _most(sizes: Floats, least: float = -1.0) -> list[int]:
    """Which of some signals are larger than the least, the largest first."""
    order = np.argsort(-sizes, kind="stable")
    return [int(k) for k in order if sizes[k] > least]


def _largest(parts: Iterable[Floats], count: int) -> Floats:
    """Of every signal its largest finite size in any run (count,)."""
    found = np.zeros(count)
    for part in parts:
        found = np.maximum(found, np.abs(np.where(np.isfinite(part), part, 0.0)).max(axis=0, initial=0.0))
    return found


def farthest(traces: Sequence[Trace]) -> list[int]:
    """Coordinates, of each unit those first that are farthest off in it, and rotations, each by its first entry.

    Of several units those that are farthest off for the largest coordinate of their unit.
    """
    names, sizes = errors.signals(traces[0]), errors.sizes(traces)
    apart = _largest((errors.off(t) for t in traces if t.truth is not None), len(traces[0].about["coordinates"]))
    for k, (_, unit) in names.items():
        apart[k] /= sizes[unit]
    return [k for k in _most(apart) if k in names]


def still(traces: Sequence[Trace], limits: Limits = NONE) -> list[int]:
    """Coordinates that go in no run farther from the start than their limit: what they do is rounding.

    None if all do: then that is the motion. Of a quaternion all four or none.
    """
    count = len(traces[0].about["coordinates"])
    scales = np.array(traces[0].about.get("scales", ()) or [0.0] * count)
    turns = _turns(traces)
    scales[turns] = 1.0
    moved = _largest((trace.run.q - traces[0].run.q[:1] for trace in traces), count)
    for at in traces[0].quaternions:
        moved[at : at + 4] = moved[at : at + 4].max()
    rests = moved < min(limits.get("position", {}), default=IDLE) * scales
    return [] if rests.all() else np.flatnonzero(rests).tolist()


def _turns(traces: Sequence[Trace]) -> list[int]:
    """Which coordinates are of quaternions."""
    return [at + i for at in traces[0].quaternions for i in range(4)]


def loads(traces: Sequence[Trace]) -> Floats:
    """Largest INT |lam| dt of every contact in any run (nc,)."""
    sums = (np.trapezoid(np.abs(np.nan_to_num(one.run.lam)), one.run.t, axis=0)[None] for one in traces)
    return _largest(sums, len(traces[0].about["contacts"]))


def loaded(traces: Sequence[Trace]) -> list[int]:
    """Contacts that carry a force, those first that carry most."""
    bearing, sizes = carrying(traces), loads(traces)
    return [bearing[i] for i in _most(sizes[bearing])]


def deepest(traces: Sequence[Trace]) -> list[int]:
    """Contacts that are deeper somewhere than rounding, and rows that are always on; the deepest first."""
    depths = (_depth(trace.run.gap, _always(traces)) for trace in traces)
    return _most(_largest((np.maximum(depth, 0.0) for depth in depths), len(traces[0].about["contacts"])), ROUNDING)


def _always(traces: Sequence[Trace]) -> NDArray[np.bool_]:
    """Which rows are always on (nc,)."""
    found: NDArray[np.bool_] = (traces[0].run.mode == Mode.BILATERAL).all(axis=0)
    return found


def _depth(gap: Floats, always: NDArray[np.bool_]) -> Floats:
    found: Floats = np.where(always, np.abs(gap), -gap)
    return found


def switching(traces: Sequence[Trace]) -> list[int]:
    """Contacts whose modes change or differ, of those that are alike the first; those first that carry most."""
    sizes, found = loads(traces), [each[0] for each in alike(traces)]
    return [found[i] for i in _most(sizes[found])]


def motion(traces: Sequence[Trace], points: int = POINTS, limits: Limits = NONE, which: Sequence[int] = ()) -> Figure:
    """Coordinates of every engine, and under each log |difference to the truth|, impacts matched."""
    names = errors.signals(traces[0])
    # One floor a unit, by the largest value in any run: a coordinate that stays at 0 has its neighbours' size.
    sizes = _largest((trace.run.q for trace in traces), len(traces[0].about["coordinates"]))
    part = SENSED if of_log(traces[0].about) else EPS
    floors = {unit: floor_of(sizes[[k for k in names if names[k][1] == unit]], part) for _, unit in names.values()}
    shown = which or sorted(farthest(traces)[:MOST_SIGNALS])
    rows = [text for k in shown for text in ("{}\n[{}]".format(*names[k]), f"|error|\n[{names[k][1]}]")]
    title = "Coordinates, and |measured minus predicted|" if of_log(traces[0].about) else MATCHED
    sheet = Sheet(rows, title, points, group=2)
    for trace in traces:
        t, q = filled(trace.run, trace.quaternions)
        drawn = errors.seen(q, traces[0])
        away = errors.off(trace) if trace.truth is not None else None
        for place, k in enumerate(shown):
            sheet.line(trace, 2 * place, drawn[:, k], t)
            if away is not None:
                floor = floors[names[k][1]]
                sheet.line(trace, 2 * place + 1, np.maximum(away[:, k], floor), floor=floor)
    scales = traces[0].about.get("scales", ())
    least = min(limits.get("position", {}), default=0.0)
    every = np.concatenate([errors.seen(trace.run.q, traces[0]) for trace in traces])
    for place, k in enumerate(shown):
        if k < len(scales):
            size = 1.0 if k in traces[0].quaternions else scales[k]  # rad
            for limit, name in limits.get("position", {}).items():
                sheet.limit(2 * place + 1, limit * size, name)
                sheet.band(2 * place, limit * size, name)
            _show_still(sheet, 2 * place, every[:, k], least * size)
    sheet.logarithmic(*range(1, len(rows), 2))
    return sheet.done()


def _show_still(sheet: Sheet, row: int, values: Floats, limit: float) -> None:
    """Draw a coordinate that moves by less than its limit as one at rest: what it does is rounding."""
    values = values[np.isfinite(values)]
    if len(values) and (high := values.max()) - (low := values.min()) < limit:
        middle = 0.5 * (low + high)
        reach = max(limit, 0.5 * abs(middle))
        sheet.clip(row, middle - reach, middle + reach)


def force(traces: Sequence[Trace], points: int = POINTS, limits: Limits = NONE, which: Sequence[int] = ()) -> Figure:
    """Multipliers, their cumulative impulse, and its difference to the truth's."""
    contacts = traces[0].about["contacts"]
    shown = which or sorted(loaded(traces)[:MOST_SIGNALS])
    each = ("{2} {0}\n[{1}]", "impulse\n[{1} s]", "|error|\n[{1} s]")
    rows = [text.format(contacts[k], *force_kind(traces, k)) for k in shown for text in each]
    sheet = Sheet(rows, "Contact force, cumulative impulse and |its difference from the truth|", points, group=3)
    summed = [with_collisions(trace.run, trace.run.events) for trace in traces]
    total = float(np.nanmax(np.abs(summed[0]), initial=idle(traces[0].run) * float(traces[0].run.t[-1])))
    floor = floor_of(np.array([total]))
    largest = max(float(np.nanmax(np.abs(traces[0].run.lam), initial=0.0)), idle(traces[0].run))
    true = [_true_impulse(trace, traces[0]) for trace in traces]
    for place, k in enumerate(shown):
        combs = chattering(traces, k)
        for i, trace in enumerate(traces):
            if np.isnan(trace.run.lam[:, k]).all():
                continue
            if label(trace) in combs:
                sheet.band_of(trace, 3 * place, trace.run.lam[:, k], combs[label(trace)])
            else:
                sheet.line(trace, 3 * place, trace.run.lam[:, k])
            sheet.line(trace, 3 * place + 1, summed[i][:, k])
            if (exact := true[i]) is not None:
                sheet.line(trace, 3 * place + 2, apart(summed[i][:, k], exact[:, k], floor), floor=floor)
        ends, far = robust(traces, k)
        if ends is not None:
            sheet.clip(3 * place, *ends)
            for who, size in far.items():
                sheet.beyond(who, size, force_kind(traces, k)[0], contacts[k])
        for limit, name in limits.get("lam_impulse_path", {}).items():
            sheet.limit(3 * place + 2, limit * total, name)
            sheet.band(3 * place + 1, limit * total, name)
        for limit, name in limits.get("lam_error", {}).items():
            sheet.band(3 * place, limit * largest, name)
    sheet.logarithmic(*range(2, len(rows), 3))
    return sheet.done()


def _true_impulse(trace: Trace, lead: Trace) -> Floats | None:
    """Cumulative impulse of the truth beside every sample of a run (n, nc); NaN where it is not known."""
    if trace.truth is None:
        return None
    found = true_impulse(trace.run, trace.truth, lead.run)
    found[np.isnan(trace.truth.lam)] = np.nan
    return found


def force_kind(traces: Sequence[Trace], k: int) -> tuple[str, str]:
    """Unit of a contact's multiplier and what it is: a torque where its gap is an angle."""
    turns = traces[0].about["contacts"][k] in traces[0].about.get("turning", ())
    return ("N m", "torque") if turns else ("N", "force")


def carrying(traces: Sequence[Trace], least: float = 0.0) -> list[int]:
    """Contacts that carry a force in any motion, more than rounding and than the least, N."""
    lam = [np.abs(np.nan_to_num(trace.run.lam)).max(axis=0, initial=0.0) for trace in traces]
    largest = np.max(lam, axis=0, initial=0.0)
    noise = max(IDLE * float(np.max(largest, initial=0.0)), _noise(traces), least)
    return [int(k) for k in np.flatnonzero(largest > noise)]


def _noise(traces: Sequence[Trace]) -> float:
    """A force of rounding, of that which the energy makes over the way, N."""
    way = max(traces[0].about.get("scales", ()), default=0.0) or 1.0
    return IDLE * energy_of(traces[0].run) / way


def chattering(traces: Sequence[Trace], k: int) -> dict[str, float]:
    """Return the engines whose force of a contact goes up and down so often that its line would cover all others.

    How often that is stands beside each, times the truth's largest.
    """
    largest = [float(np.nanmax(np.abs(one.run.lam[:, k]), initial=0.0)) for one in traces]
    reach = largest[0] if label(traces[0]) == TRUTH and largest[0] > _noise(traces) else max(largest, default=0.0)
    if not reach:
        return {}
    seen = [np.clip(np.nan_to_num(one.run.lam[:, k]), -BEYOND * reach, BEYOND * reach) for one in traces]
    swings = [float(np.abs(np.diff(lam)).sum()) / reach for lam in seen]
    own = swings[0] if label(traces[0]) == TRUTH else 0.0
    return {label(one): n for one, n in zip(traces, swings, strict=True) if n > max(SWINGS, OFTEN * own)}


def robust(traces: Sequence[Trace], k: int) -> tuple[tuple[float, float] | None, dict[str, float]]:
    """Return the ends of a plot of a contact's force where runs go far beyond the truth's, and how far which do."""
    ends = {
        label(trace): (float(np.nanmin(lam)), float(np.nanmax(lam))) for trace in traces
        if np.isfinite(lam := trace.run.lam[:, k]).any()
    }  # fmt: skip
    return clipped(ends, _noise(traces))


def clipped(
    ends: Mapping[str, tuple[float, float]], noise: float
) -> tuple[tuple[float, float] | None, dict[str, float]]:  # fmt: skip
    """Return the ends of an axis where lines, by their ends, go far beyond the truth's, and how far which do.

    None where the truth's are noise, or no line goes far.
    """
    low, high = ends.get(TRUTH, (0.0, 0.0))
    reach = max(high, -low)
    far = {who: max(b, -a) for who, (a, b) in ends.items() if max(b, -a) > BEYOND * reach}
    if max(far.values(), default=0.0) <= FAR * reach or reach <= noise:
        return None, {}
    return (BEYOND * min(low, -0.1 * reach), BEYOND * max(high, 0.1 * reach)), far


def energy(traces: Sequence[Trace], points: int = POINTS, limits: Limits = NONE) -> Figure:
    """Total energy, work of the contacts, and what neither they nor inputs nor damping explain."""
    rows = ["total energy\n[J]", "work of contacts\n[J]", "|unexplained|\n[J]"]
    sheet = Sheet(rows, "Energy ledger: what the law made, and what the integrator made", points, group=3)
    floor = floor_of(traces[0].run.energy)
    for trace in traces:
        run = trace.run
        sheet.line(trace, 0, run.total_energy)
        if run.ledger is None:
            continue
        work = run.ledger.contact.sum(axis=1)
        if np.any(np.abs(work) > floor):  # below is rounding
            sheet.line(trace, 1, work)
        book = work + run.ledger.input - run.ledger.dissipated
        sheet.line(trace, 2, apart(run.total_energy - run.total_energy[0], book - book[0], floor), floor=floor)
    sheet.logarithmic(2)
    for limit, name in limits.get("energy_integrator", {}).items():
        sheet.limit(2, limit * energy_of(traces[0].run), name)
    for limit, name in limits.get("energy_drift", {}).items():
        sheet.band(0, limit * energy_of(traces[0].run), name)
    return sheet.done()


def penetration(
    traces: Sequence[Trace], points: int = POINTS, limits: Limits = NONE, which: Sequence[int] = ()
) -> Figure:
    """Depth of contacts below their surfaces; |gap| of rows that are always on."""
    contacts = traces[0].about["contacts"]
    shown = which or sorted(deepest(traces)[:MOST_SIGNALS])
    always = _always(traces)[shown]
    turn = traces[0].about.get("turning", ())
    rows = [
        f"{'|gap|' if on else 'depth'} {contacts[k]}\n[{'rad' if contacts[k] in turn else 'm'}]"
        for k, on in zip(shown, always, strict=True)
    ]
    sheet = Sheet(rows, "Penetration, and drift of rows that are always on", points, group=len(rows))
    for row, (k, on) in enumerate(zip(shown, always, strict=True)):
        for trace in traces:
            depth = _depth(trace.run.gap[:, k], on)
            above = np.where(np.isnan(depth), np.nan, np.nan if on else 0.0)  # none is seen on a logarithmic axis
            sheet.line(trace, row, np.where(depth > ROUNDING, depth, above))
        if contacts[k] not in turn:
            for limit, name in limits.get("constraint_drift" if on else "penetration", {}).items():
                sheet.limit(row, limit, name)
        for half, name in () if on else gap_limits(traces[0], k, limits):
            sheet.band(row, half, name)
    sheet.logarithmic(*(row for row, on in enumerate(always) if on))
    return sheet.done()


def gap_limits(truth: Trace, k: int, limits: Limits) -> Iterator[tuple[float, str]]:
    """Yield how far the gap of a contact that can open may be from the truth's, and below the surface its depth."""
    widths = {"gap_error": truth.about.get("gap_scales", ()), "penetration_error": _deepest(truth)}
    for metric, width in widths.items():
        for limit, name in limits.get(metric, {}).items() if k < len(width) else ():
            yield limit * width[k], name


def _deepest(truth: Trace) -> Sequence[float]:
    """What depths are measured by, of every contact, m."""
    rows = ~_always([truth])
    return [float(np.max(-truth.run.gap[:, rows], initial=0.0))] * len(rows)


def steps(traces: Sequence[Trace], points: int = POINTS, limits: Limits = NONE) -> Figure:
    """Length of every step at its start: small while a collision lasts, large again when it is over."""
    sheet = Sheet(["step size\n[s]"], "Step size of each engine", points)
    floor, usual = floor_of(traces[0].run.t), list[Floats]()
    for trace in traces:
        starts, lengths = (np.array(given, dtype=np.float64) for given in trace.about.get("steps", ((), ())))
        ends = starts[-1:] + lengths[-1:]  # the last step is drawn to its end too
        sheet.line(trace, 0, np.maximum(np.r_[lengths, lengths[-1:]], floor), np.r_[starts, ends], shape="hv")
        usual += [quantiles(lengths, REMAINDERS, 1.0)] if len(lengths) else []
    sheet.logarithmic(0)
    if usual:
        sheet.clip(0, 0.3 * float(np.min(usual)), 3.0 * float(np.max(usual)))
    return sheet.done()


def inputs(traces: Sequence[Trace], points: int = POINTS, limits: Limits = NONE) -> Figure:
    """What acts from outside: each value from its instant on; of many those that change most."""
    given = {label(one): one.about["inputs"] for one in traces if one.about.get("inputs")}
    names = next((list(found[0]) for found in given.values()), [])
    reach = np.max([np.ptp(found[2], axis=1) for found in given.values()], axis=0) if given else np.zeros(0)
    shown = sorted(np.argsort(-reach, kind="stable")[:MOST_SIGNALS].tolist())
    more = f" ({len(shown)} of {len(names)}, those that change most)" if len(names) > len(shown) else ""
    sheet = Sheet([_over_unit(names[k]) for k in shown], f"What acts from outside{more}", points)
    for trace in (one for one in traces if label(one) in given and len(one.run.t)):
        _, times, values = given[label(trace)]
        t = np.r_[times, max(times[-1], trace.run.t[-1])]
        for place, k in enumerate(shown):
            sheet.line(trace, place, np.r_[values[k], values[k][-1]], t, shape="hv")
    return sheet.done()


def _over_unit(name: str) -> str:
    """A name above its unit."""
    head, found, unit = name.partition(" [")
    return f"{head}\n[{unit}" if found else f"{name}\n"


def plots(
    name: str, traces: Sequence[Trace], points: int = POINTS, limits: Limits = NONE, until: float = inf
) -> list[Plot]:
    """One figure if there is anything in it; of many signals those that matter most, the others drawn folded.

    It is shaded from the instant `until` on, s, up to which the truth is known.
    """

    def draw(*which: Sequence[int]) -> Figure:
        return shaded(FIGURES[name][1](traces, points, limits, *which), until, float(traces[0].run.t[-1]))

    if name not in SIGNALS:
        figure = draw()
        return [Plot(name=f"plot-{name}", figure=figure, time=True)] if figure["data"] else []
    noun, _, more = SIGNALS[name]
    order = _ranked(name, traces, limits)[:MOST_SIGNALS]
    if not order:
        return []
    cut = FIRST[name] if len(order) > FIRST[name] + 1 else len(order)
    first, rest = sorted(order[:cut]), sorted(order[cut:])
    found = [Plot(name=f"plot-{name}", figure=draw(first), time=True)]
    if rest:
        told = f"{len(rest)} more {noun} {more}: {', '.join(_names(traces, noun)[k] for k in rest)}"
        figure = draw(rest)
        found.append(Plot(name=f"plot-{name}-more", figure=figure, time=True, folded=told))
    return found


def _ranked(name: str, traces: Sequence[Trace], limits: Limits) -> list[int]:
    """Signals of a figure that say anything, those that matter most first."""
    rests = still(traces, limits) if name == "motion" else []
    return [k for k in SIGNALS[name][1](traces) if k not in rests]


def _names(traces: Sequence[Trace], noun: str) -> dict[int, str]:
    """Names of coordinates, rotations among them, or of contacts, by their places."""
    if noun == "contacts":
        return dict(enumerate(traces[0].about[noun]))
    return {k: name for k, (name, _) in errors.signals(traces[0]).items()}


def note(name: str, traces: Sequence[Trace], limits: Limits = NONE) -> str:
    """What the reader of a figure must know."""
    told = [LOG_NOTE if name == "motion" and of_log(traces[0].about) else NOTES.get(name, "")]
    if name == "motion" and traces[0].quaternions:
        told.append(ROTATIONS)
    if name in SIGNALS:
        noun = SIGNALS[name][0]
        names, found = _names(traces, noun), _ranked(name, traces, limits)
        if len(found) > MOST_SIGNALS:
            told.append(f"{MOST_SIGNALS} of {len(found)} {noun} are drawn; all are stored.")
        bare = _without_gap(traces[0]) if name == "penetration" else set[str]()
        if name in IDLE_NOTES and (rest := [one for k, one in names.items() if k not in found and one not in bare]):
            told.append(f"{IDLE_NOTES[name]}: {few(normals(rest))}.")
    if name == "energy" and (
        without := [label(one) for one in traces if one.run.ledger is None and label(one) != TRUTH]
    ):
        told.append(f"Only the total energy is drawn of engines without an account of work: {', '.join(without)}.")
    if name == "inputs" and any(one.about.get("asked_again") for one in traces):
        told.append(ASKED_AGAIN)
    if name == "modes":
        told += [*_same(traces), *_throughout(traces)]
    return " ".join(filter(None, told))


def _without_gap(trace: Trace) -> set[str]:
    """Names of rows that have no surface: of friction."""
    names, scene = trace.about["contacts"], trace.about.get("scene")
    count = 0 if scene is None else without_gap(scene_from(scene))
    return set(names) - set(normals(names[: len(names) - count]))


def few(names: Sequence[str], most: int = NAMED) -> str:
    """Some names, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def normals(names: Sequence[str]) -> list[str]:
    """Names without the tangential rows of contacts that are among them."""
    return [name for k, (name, row) in enumerate(zip(names, led(names), strict=True)) if row == k]


def led(names: Sequence[str]) -> list[int]:
    """Return of each row which one bears it: of tangential rows of contacts their normal row, of others themselves."""
    rows = {name: k for k, name in enumerate(names)}
    return [rows.get(name[:-3], k) if name[-2:] in WAYS else k for k, name in enumerate(names)]


def _same(traces: Sequence[Trace]) -> Iterator[str]:
    names = traces[0].about["contacts"]
    same = [[names[first], *normals([names[k] for k in (first, *rest)])[1:]] for first, *rest in alike(traces)]
    groups = [f"same as {first}: {few(rest, 3)}" for first, *rest in same if rest]
    if groups:
        yield f"The {'; the '.join(groups[:NAMED])}{f'; and {len(groups) - NAMED} more' * (len(groups) > NAMED)}."


def _throughout(traces: Sequence[Trace]) -> Iterator[str]:
    found: dict[str, list[str]] = {}
    for contact, mode in changing(traces)[1]:
        found.setdefault(mode, []).append(contact)
    for mode, names in found.items():
        yield f"{mode} throughout, in every engine: {few(normals(names))}."


MATCHED = "Coordinates, and |difference from the truth|, impacts matched"
ASKED_AGAIN = "What the controller of the case gives is computed again from each run's own motion, at its ticks."
ROTATIONS = "A rotation is drawn by its angle from the truth's start, its error by the angle between both."
LOG_NOTE = (
    "Every window starts from the measured state, where the difference is zero. Differences below a millionth of the "
    "largest value of that unit are cut off."
)
NOTES = {
    "motion": (
        "Impacts are matched first, and the arcs between them compared; the errors of their times are the "
        "metric event_times. An error ends with the last sample that has a counterpart in the truth, early "
        "if impacts come sooner than the truth's. Differences are cut off at a common floor, the rounding error "
        "of the largest value of that unit; a line that leaps from there begins anew. Across long steps of a solver, a "
        "cubic through q and v at both ends is drawn."
    ),
    "force": (
        "A small delay of an impact changes the force a lot at one instant, but hardly its impulse: "
        "judge by the impulse. Instantaneous collisions are steps of the impulse."
    ),
}
IDLE_NOTES = {
    "motion": "At rest in every run, to within the limit",
    "force": "Without force in every run",
    "penetration": "Never below the surface",
}
FIGURES: dict[str, tuple[str, Callable[..., Figure]]] = {
    "motion": ("Motion", motion),
    "force": ("Contact force", force),
    "energy": ("Energy", energy),
    "modes": ("Modes", modes),
    "penetration": ("Penetration", penetration),
    "steps": ("Step size", steps),
    "inputs": ("Inputs", inputs),
}
SIGNALS: dict[str, tuple[str, Callable[[Sequence[Trace]], list[int]], str]] = {
    "motion": ("coordinates", farthest, "with smaller errors"),
    "force": ("contacts", loaded, "with less impulse"),
    "modes": ("contacts", switching, "with less impulse"),
    "penetration": ("contacts", deepest, "less deep"),
}
"""Of what a figure draws one signal each, which those are, those that matter most first, and what the others are."""
