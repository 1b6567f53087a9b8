"""What figures over time must draw of made-up motions: every line, its limits, and the bands around the truth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from crossbody.cases import Mode, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports.figures.styles import look
from crossbody.reports.pages import errors, figures, sheet
from crossbody.reports.pages.made_up_traces import (
    CONTACTS,
    MANY,
    NAMES,
    OFF,
    ON,
    TURNING,
    UNITS,
    WHO,
    Drawn,
    Said,
    axis,
    bands,
    levels,
    lines,
    numbers,
)
from crossbody.reports.runs.store import Trace

LIMITS = {
    "position": {0.31: "limit", 0.53: "limit of two:q"}, "lam_impulse_path": {0.17: "limit"}, "lam_error": {0.13: "b"},
    "energy_integrator": {0.19: "limit"}, "energy_drift": {0.29: "drift"}, "penetration": {0.31: "limit"},
    "constraint_drift": {0.37: "limit"}, "gap_error": {0.41: "gap"}, "penetration_error": {0.43: "deep"},
}  # fmt: skip
LONG, POINTS, SPIKE, CLOSE = 4000, 900, 40.0, 1e-9
"""Samples of a line that is thinned, points that are left, its largest and smallest values, and the part of an instant
by which another one is before it."""


@cache
def drawn() -> Drawn:
    """Return the motions."""
    return Drawn()


def _lines(figure: Any, at: str, what: str, wanted: Mapping[str, tuple[Floats, Floats]]) -> Iterator[Said]:
    """Yield the lines of all engines on an axis: their instants, and numbers there."""
    found = lines(figure, at)
    yield f"engines that have {what}", tuple(sorted(found)), tuple(sorted(wanted))
    for who, (x, y) in wanted.items():
        yield f"instants of {what} of {who}", found[who][0], x
        yield f"{what} of {who}", found[who][1], y
    for line in figure["data"]:
        if line.get("yaxis", "y") == at and line["meta"] != WHO[0] and line["name"]:
            yield f"colour and name of {what} of {line['meta']}", (line["line"]["color"], line["name"]), (
                look(line["meta"])["color"], line["meta"],
            )  # fmt: skip


def _every(values: Any) -> dict[str, tuple[Floats, Floats]]:
    """Return instants and values of each motion's samples."""
    found = {who: (one.run.t, values(one.run)) for who, one in zip(WHO, drawn().traces, strict=True)}
    return {who: (t, y) for who, (t, y) in found.items() if y is not None}


def _engines(values: Any) -> dict[str, tuple[Floats, Floats]]:
    """Return instants of each engine's samples, and values of its motion and the truth beside it."""
    found = zip(WHO[1:], drawn().traces[1:], strict=True)
    return {who: (one.run.t, np.abs(values(one.run) - values(one.truth))) for who, one in found}


def _logarithmic(figure: Any, at: str) -> Said:
    return "axis", figure["layout"][f"{at[0]}axis{at[1:]}"].get("type", "linear"), "log"


def _motion() -> Iterator[Said]:
    made = drawn()
    figure = figures.motion(made.traces, MANY, LIMITS)
    for k, (name, unit) in enumerate(zip(NAMES, UNITS, strict=True)):
        at, errors = axis(figure, name, f"[{unit}]"), axis(figure, "|error|", f"[{unit}]")
        found = lines(figure, at)
        smooth = {who: (found[who][0], made.at(i, found[who][0])[:, k]) for i, who in enumerate(WHO)}
        yield from _lines(figure, at, name, smooth)
        for who, one in zip(WHO, made.traces, strict=True):
            missing = np.abs(one.run.t[:, None] - found[who][0]).min(axis=1)
            yield f"samples of {name} of {who}", missing.max() < 1e-6, 1.0
        yield from _lines(figure, errors, f"|error| of {name}", _engines(lambda run, k=k: run.q[:, k]))
        yield _logarithmic(figure, errors)
        scale = made.about["scales"][k]
        halves = [limit * scale for limit in LIMITS["position"]]
        yield f"limits of {name}", [value for value, _ in levels(figure, errors)], halves
        yield f"bands of {name}", bands(figure, at), halves
    yield "axis of time", axis(figure, "time", "[s]", kind="x")[:1], "x"


def integrals(run: Trajectory, blows: Trajectory, k: int) -> Floats:
    """Return the integrals of a multiplier by trapezoids up to each sample, with the blows of a motion."""
    total, found = 0.0, [0.0]
    for i in range(1, len(run.t)):
        total += (run.t[i] - run.t[i - 1]) * (run.lam[i, k] + run.lam[i - 1, k]) / 2.0
        found.append(total)
    own = [e for e in blows.events if e.contact == k and e.impulse]
    return np.array([x + sum(e.impulse for e in own if e.t <= t) for x, t in zip(found, run.t, strict=True)])


def _force() -> Iterator[Said]:
    traces = drawn().traces
    truth = traces[0].run
    total = max(float(np.abs(integrals(truth, truth, k)).max()) for k in range(OFF))
    for k, contact in enumerate(CONTACTS[:OFF]):
        kind, unit = ("torque", "N m") if contact in TURNING else ("force", "N")
        figure = figures.force(traces, MANY, LIMITS, [k])
        at = [
            axis(figure, kind, contact, f"[{unit}]"), axis(figure, "impulse", f"[{unit} s]"),
            axis(figure, "|error|", f"[{unit} s]"),
        ]  # fmt: skip
        yield from _lines(figure, at[0], f"{kind} {contact}", _every(lambda run, k=k: run.lam[:, k]))
        yield from _lines(figure, at[1], f"impulse {contact}", _every(lambda run, k=k: integrals(run, run, k)))
        apart = {
            who: (one.run.t, np.abs(integrals(one.run, one.run, k) - integrals(one.truth, truth, k)))
            for who, one in zip(WHO[1:], traces[1:], strict=True) if one.truth is not None
        }  # fmt: skip
        yield from _lines(figure, at[2], f"|error| of impulse {contact}", apart)
        yield _logarithmic(figure, at[2])
        yield f"limit of impulse {contact}", [value for value, _ in levels(figure, at[2])], [0.17 * total]
        yield f"band of impulse {contact}", bands(figure, at[1]), [0.17 * total]
        yield f"band of {kind} {contact}", bands(figure, at[0]), [0.13 * float(np.abs(truth.lam).max())]
    loads = [[np.abs(one.run.lam[:, k]) for k in range(OFF)] for one in traces]
    sums = [
        max(float(np.sum(np.diff(one.run.t) * (lam[k][1:] + lam[k][:-1]) / 2.0))
            for one, lam in zip(traces, loads, strict=True))
        for k in range(OFF)
    ]  # fmt: skip
    yield "order of contacts", figures.loaded(traces), sorted(range(OFF), key=lambda k: -sums[k])


def _energy() -> Iterator[Said]:
    traces = drawn().traces
    figure, truth = figures.energy(traces, MANY, LIMITS), traces[0].run
    at = [axis(figure, "total energy", "[J]"), axis(figure, "work", "[J]"), axis(figure, "unexplained", "[J]")]
    yield from _lines(figure, at[0], "total energy", _every(lambda run: run.energy[:, 0] + run.energy[:, 1]))
    yield from _lines(figure, at[1], "work of contacts", _every(lambda run: sum(run.ledger.contact.T)))

    def left(run: Trajectory) -> Floats:
        assert run.ledger is not None
        total = run.energy[:, 0] + run.energy[:, 1] - sum(run.ledger.contact.T)
        total += run.ledger.dissipated - run.ledger.input
        found: Floats = np.abs(total - total[0])
        return found

    found = lines(figure, at[2])
    for who, one in zip(WHO, traces, strict=True):
        yield f"|unexplained| of {who}", found[who][1][-len(one.run.t) + 1 :], left(one.run)[1:]
    yield _logarithmic(figure, at[2])
    size = max(float(truth.energy[:, 0].max()), float(truth.energy[:, 1].max() - truth.energy[:, 1].min()))
    yield "limit of |unexplained|", [value for value, _ in levels(figure, at[2])], [0.19 * size]
    yield "band of total energy", bands(figure, at[0]), [0.29 * size]


def _penetration() -> Iterator[Said]:
    made = drawn()
    truth = made.traces[0].run
    deepest = max(-float(truth.gap[:, k].min()) for k in range(len(CONTACTS)) if k != ON)
    for k, contact in enumerate(CONTACTS[:OFF]):
        figure = figures.penetration(made.traces, MANY, LIMITS, [k])
        unit, what = "rad" if contact in TURNING else "m", "|gap|" if k == ON else "depth"
        at = axis(figure, what, contact, f"[{unit}]")
        yield from _lines(figure, at, f"{what} {contact}", _every(
            lambda run, k=k: np.abs(run.gap[:, k]) if k == ON else np.where(run.gap[:, k] < 0.0, -run.gap[:, k], 0.0)
        ))  # fmt: skip
        limit = [] if contact in TURNING else [0.37 if k == ON else 0.31]
        yield f"limit of {what} {contact}", [value for value, _ in levels(figure, at)], limit
        halves = [] if k == ON else [0.41 * made.about["gap_scales"][k], 0.43 * deepest]
        yield f"bands of {what} {contact}", bands(figure, at), halves
    deep = [max(float((np.abs(one.run.gap) if k == ON else -one.run.gap)[:, k].max()) for one in made.traces)
            for k in range(OFF)]  # fmt: skip
    yield "order of contacts", figures.deepest(made.traces), sorted(range(OFF), key=lambda k: -deep[k])


def _steps() -> Iterator[Said]:
    figure = figures.steps(drawn().traces, MANY)
    wanted = {}
    for who, one in zip(WHO, drawn().traces, strict=True):
        starts, lengths = one.about["steps"]
        wanted[who] = np.array([*starts, starts[-1] + lengths[-1]]), np.array([*lengths, lengths[-1]])
    at = axis(figure, "step size", "[s]")
    yield from _lines(figure, at, "step size", wanted)
    yield _logarithmic(figure, at)


def _modes() -> Iterator[Said]:
    """Yield the lengths of all intervals of every contact, engine and mode, and where each begins."""
    found: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for bar in sheet.modes(drawn().traces)["data"]:
        intervals = zip(bar["base"], bar["x"], strict=True)
        found.setdefault((bar["y"][0], bar["name"]), []).extend(sorted(intervals))
    wanted: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for k, (who, one) in product(range(ON), zip(WHO, drawn().traces, strict=True)):
        modes, t = one.run.mode[:, k].tolist(), one.run.t.tolist()
        starts = [i for i in range(len(t)) if i == 0 or modes[i] != modes[i - 1]]
        for i, end in zip(starts, [*starts[1:], len(t) - 1], strict=True):
            wanted.setdefault((f"{CONTACTS[k]}, {who}", Mode(modes[i]).name), []).append((t[i], t[end] - t[i]))
    yield "strips", tuple(sorted(found)), tuple(sorted(wanted))
    for key, spans in wanted.items():
        yield f"intervals of {key[1]} of {key[0]}", found[key], spans


def _thinned() -> Iterator[Said]:
    """Yield ends, highest and lowest value, and what is beside an event, of a line of too many samples."""
    made = Drawn(samples=LONG)
    one = made.traces[1]
    high, low = np.sort(made.draw.choice(np.arange(9, LONG - 9), 2, replace=False))
    energy = one.run.energy.copy()
    energy[[high, low], 0] += SPIKE, -SPIKE
    t = one.run.t.copy()
    at_event = int(np.searchsorted(t, one.run.events[0].t))
    t[at_event - 1] = (1.0 - CLOSE) * t[at_event]
    one = replace(one, run=replace(one.run, t=t, energy=energy), truth=None)
    figure = figures.energy([one], POINTS)
    x, y = lines(figure, axis(figure, "total energy"))[WHO[1]]
    total = one.run.energy[:, 0] + one.run.energy[:, 1]
    yield "instants one behind the other", bool(np.all(np.diff(x) > 0.0)), 1.0
    yield "ends of a thinned line", [x[0], x[-1], y[0], y[-1]], [*one.run.t[[0, -1]], *total[[0, -1]]]
    yield "highest and lowest of a thinned line", [y.max(), y.min()], [total.max(), total.min()]
    at = [np.argmin(np.abs(one.run.t - t)) for t in x]
    yield "a thinned line", y, total[at]
    for event in one.run.events:
        i = int(np.sum(one.run.t < event.t))
        beside = np.abs(x[:, None] - one.run.t[i - 2 : i + 3]).min(axis=0)
        yield "samples beside an event of a thinned line", float(beside.max()) < 1e-6, 1.0


def _limits() -> Iterator[Said]:
    """Yield what engines may reach: a limit beyond what is claimed, and of whom."""
    draw = np.random.default_rng(3)
    usual, own, claim = draw.uniform(0.1, 0.9, 3).tolist()
    rows: Any = [
        {"metric": "position", "limit": limit, "expected": expected, "engine": f"e{i}", "profile": "p"}
        for i, (limit, expected) in enumerate(((usual, None), (usual, np.nan), (own, claim), (None, None)))
    ]
    found = figures.limits_of(rows)["position"]
    yield "limits", list(found), [usual, own + claim]
    yield "their names", tuple(found.values()), ("limit", "limit of e2:p")


def _named() -> Iterator[Said]:
    """Yield that a force far beyond the truth's is said with its size and engine."""
    one = drawn().traces
    far: Trace = replace(one[2], run=replace(one[2].run, lam=37.7 * one[2].run.lam))
    figure = figures.force([*one[:2], far], MANY, LIMITS, [0])
    size = float(np.abs(far.run.lam[:, 0]).max())
    yield "what is off scale", f"{WHO[2]} up to {size:.3g} N" in figure["layout"]["title"]["text"], 1.0


def _turning(angles: Sequence[Floats], t: Floats) -> list[Trace]:
    """Return a truth and engines that turn about an axis by angles, and are off along x by a tenth of the angle."""
    poses = [np.column_stack([0.1 * a, np.cos(a / 2.0), np.zeros((len(a), 2)), np.sin(a / 2.0)]) for a in angles]
    one = drawn().traces[0].run
    rests = np.zeros((len(t), 1))
    runs = [
        replace(one, t=t, q=q, v=np.column_stack([0.1 * rate, np.zeros((len(t), 2)), rate]), gap=rests, lam=rests,
                energy=np.zeros((len(t), 2)), mode=np.zeros((len(t), 1), np.int8), events=(), ledger=None)
        for q, a in zip(poses, angles, strict=True) for rate in (np.gradient(a, t),)
    ]  # fmt: skip
    units = {"x": "m", **{f"cube {entry}": "1" for entry in ("qw", "qx", "qy", "qz")}}
    about = drawn().about | {
        "coordinates": [{"name": name, "unit": unit} for name, unit in units.items()], "contacts": ("a",),
        "scales": [2.0, 1.0, 1.0, 1.0, 1.0], "steps": ((), ()),
    }  # fmt: skip
    return [
        Trace(about=about | {"engine": who.partition(":")[0], "profile": who.partition(":")[2],},
              run=run, truth=runs[0] if i else None)
        for i, (who, run) in enumerate(zip(WHO, runs, strict=False))
    ]  # fmt: skip


def _rotations() -> Iterator[Said]:
    """Yield a rotation's angle from the start and the angle that it is off, their limits, and the farthest errors."""
    t = np.linspace(0.0, 1.0, 101)
    angles = [0.2 + 0.7 * t, 0.2 + 0.9 * t]
    traces = _turning(angles, t)
    figure = figures.motion(traces, MANY, LIMITS)
    at, errs = axis(figure, "rotation cube", "[rad]"), axis(figure, "|error|", "[rad]")
    for who, rate in zip(WHO, (0.7, 0.9), strict=False):
        x, y = lines(figure, at)[who]
        yield f"rotation of {who}", y, rate * x
    yield "error of the rotation", lines(figure, errs)[WHO[1]][1][1:], np.abs(angles[1] - angles[0])[1:]
    yield "limits of a rotation", [value for value, _ in levels(figure, errs)], [*LIMITS["position"]]
    yield "rotations first", figures.farthest(traces), [1, 0]
    (table,) = errors.farthest_off(traces)
    wanted = {"m": ("x", 0.02), "rad": ("rotation cube", 0.2)}
    yield "units of largest errors", tuple(row["unit"] for row in table.rows), tuple(wanted)
    for row in table.rows:
        name, size = wanted[row["unit"]]
        yield f"farthest in {row['unit']}", (row["coordinate"], row["who"]), (name, WHO[1])
        yield f"largest error in {row['unit']}, and when", [row["size"], row["t"]], [size, 1.0]
    first = Drawn().traces[0]
    alike = [one | {"unit": "m"} for one in first.about["coordinates"]]
    one = replace(first, about={**first.about, "coordinates": alike, "scales": [1.0, 3.0, 2.0]})
    yield "size of a unit", errors.sizes([one])["m"], 3.0
    both = errors.told([*traces, *_turning([angles[0], 0.2 + 0.8 * t], t)[1:]])
    yield "the largest error in words", ("by 0.2 rad" in both, "by 0.1 rad" in both), (True, False)


def _still() -> Iterator[Said]:
    """Yield which coordinates go nowhere, whatever their rates: by how far off the start, in the size of each."""
    t, none = np.linspace(0.0, 1.0, 5), np.zeros((5, 0))
    q = np.stack([3.0 + 0.5 * t, np.full(5, 2.0), 1.0 + 1e-5 * t], axis=1)
    run = Trajectory(t=t, q=q, v=np.ones((5, 3)), gap=none, lam=none, energy=np.ones((5, 2)), mode=none.astype(int))
    about = drawn().about | {"coordinates": [{"name": name, "unit": "m"} for name in "abc"], "turning": (),
                             "quaternions": (), "scales": [4.0, 2.0, 1.0]}  # fmt: skip
    one = Trace(about=about, run=run, truth=None)
    for most, wanted in ((1e-3, [1, 2]), (1e-6, [1])):
        yield f"coordinates at rest at {most:g}", figures.still([one], {"position": {most: "e"}}), wanted
    rest = replace(one, run=replace(run, q=np.full((5, 3), 2.0)))
    yield "coordinates of a motion at rest", len(figures.still([rest], {"position": {1e-3: "e"}})), 0.0


def _sparse() -> Iterator[Said]:
    """Yield that a line of errors is broken where a step is long, and that its ends are dots."""
    t = np.concatenate([np.linspace(0.0, 0.3, 31), np.linspace(0.6, 0.9, 31), [1.0]])
    figure = figures.motion(_turning([t, 1.1 * t + 0.01], t), MANY)
    for unit, part in (("rad", 1.0), ("m", 0.1)):
        at = axis(figure, "|error|", f"[{unit}]")
        own = [line for line in figure["data"] if line["yaxis"] == at and line["meta"] == WHO[1]]
        (line,), (dots,) = ([one for one in own if one["mode"] == mode] for mode in ("lines", "markers"))
        gaps = np.flatnonzero(np.isnan(numbers(line["y"])))
        yield f"breaks of |error| in {unit}", numbers(line["x"])[gaps - 1], [0.3, 0.9]
        yield f"dots of |error| in {unit}", numbers(dots["x"]), [0.3, 0.6, 0.9, 1.0]
        yield f"heights of dots in {unit}", numbers(dots["y"]), part * np.array([0.04, 0.07, 0.10, 0.11])
    yield "what dots are", "Dots: the ends of long steps" in figure["layout"]["title"]["text"], 1.0


KINDS = {
    "rotations": _rotations, "long steps": _sparse, "motion figure": _motion,
    "force figure": _force, "energy figure": _energy, "penetration figure": _penetration,
    "step figure": _steps, "mode figure": _modes, "thinned lines": _thinned, "limit lines": _limits,
    "off scale": _named, "what stands still": _still,
}  # fmt: skip
