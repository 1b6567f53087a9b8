"""How far coordinates are off the truth, each in its own unit; a rotation by the angle that it is off."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.rotations import differences, turned
from crossbody.reports.figures.section import Kind, Table, columns
from crossbody.reports.figures.styles import called, label
from crossbody.reports.runs.store import Trace

STILL = 1e-6  # what has turned by less has no axis, rad
SCALAR = " qw"  # how the name of the first entry of a quaternion ends
LARGEST = columns(
    called="Engine", coordinate="Coordinate", size=("Largest error", Kind.NUMBER), unit="Unit",
    t=("At [s]", Kind.NUMBER),
)  # fmt: skip


def signals(trace: Trace) -> dict[int, tuple[str, str]]:
    """Return the name and the unit of every coordinate by its place; of a quaternion the rotation, at its first."""
    found = {k: (one["name"], one["unit"]) for k, one in enumerate(trace.about["coordinates"])}
    for at in trace.quaternions:
        found[at] = f"rotation {found[at][0].removesuffix(SCALAR)}", "rad"
        for k in range(at + 1, at + 4):
            del found[k]
    return found


def seen(q: Floats, trace: Trace) -> Floats:
    """Return coordinates (n, nq) as they are drawn: of a quaternion, at its first, the angle from the start, rad.

    It goes on beyond half a turn, and is negative where the motion has come back through its start.
    """
    found = q.copy()
    for at in trace.quaternions:
        four = slice(at, at + 4)
        found[:, at] = _unfolded(turned(q[:, four], np.broadcast_to(trace.run.q[0, four], (len(q), 4))))
    return found


def _unfolded(turns: Floats) -> Floats:
    """The angles (n,) of rotation vectors (n, 3), rad, without the jumps of their axes at half a turn and at none."""
    sizes = np.linalg.norm(turns, axis=1)
    known = np.flatnonzero(sizes > STILL)
    found = np.zeros(len(turns))
    if len(known):
        ahead = np.where(np.sum(turns[known[1:]] * turns[known[:-1]], axis=1) < 0.0, -1.0, 1.0)
        found[known] = np.unwrap(sizes[known] * np.cumprod(np.concatenate([[1.0], ahead])))
    return found


def off(trace: Trace) -> Floats:
    """Return how far the coordinates (n, nq) of a motion are off its truth's; NaN where nothing is compared."""
    if trace.truth is None:
        raise ValueError("The truth is off by nothing.")
    return differences(trace.run.q, trace.truth.q, trace.quaternions)


def sizes(traces: Sequence[Trace]) -> dict[str, float]:
    """Return the largest size that coordinates of each unit are measured by, or have; a radian at least of rotations.

    What is off by a metre is farther off than what is off by a millimetre, however little it moves.
    """
    found: dict[str, float] = {}
    scales = traces[0].about.get("scales", ())
    for k, (_, unit) in signals(traces[0]).items():
        largest = max((float(np.nanmax(np.abs(one.run.q[:, k]), initial=0.0)) for one in traces), default=0.0)
        own = 1.0 if k in traces[0].quaternions else scales[k] if k < len(scales) else largest
        found[unit] = max(found.get(unit, 0.0), own)
    return {unit: size or 1.0 for unit, size in found.items()}


def largest(trace: Trace) -> Iterator[dict[str, Any]]:
    """Yield, for each unit, which coordinate is farthest off, by how much, and when, s."""
    errors = np.nan_to_num(off(trace), nan=-1.0, posinf=np.inf)
    units: dict[str, list[int]] = {}
    names = signals(trace)
    for k, (_, unit) in names.items():
        units.setdefault(unit, []).append(k)
    for unit, places in units.items() if len(errors) else ():
        own = errors[:, places]
        i, j = np.unravel_index(np.argmax(own), own.shape)
        if own[i, j] >= 0.0:
            yield {
                "who": label(trace), "called": called(trace), "coordinate": names[places[j]][0],
                "size": float(own[i, j]), "unit": unit, "t": float(trace.run.t[i]),
            }  # fmt: skip


def _largest_of(traces: Sequence[Trace]) -> list[dict[str, Any]]:
    return [row for trace in traces if trace.truth is not None for row in largest(trace)]


def farthest_off(traces: Sequence[Trace]) -> list[Table]:
    """Return the table of the largest errors of all engines, one line a unit; none where nothing is compared."""
    rows = _largest_of(traces)
    return [Table(title="Largest errors of coordinates, by unit", columns=LARGEST, rows=rows)] if rows else []


def told(traces: Sequence[Trace]) -> str:
    """Say which engine is farthest off, in each unit; nothing where nothing is compared."""
    rows = _largest_of(traces)
    worst = {unit: max((row for row in rows if row["unit"] == unit), key=lambda row: row["size"])
             for unit in dict.fromkeys(row["unit"] for row in rows)}  # fmt: skip
    texts = [
        f"{row['called']}, {row['coordinate']} by {row['size']:.2g} {unit} at {row['t']:.3g} s".replace("  ", " ")
        for unit, row in worst.items()
    ]
    units = " of each unit" if len(texts) > 1 else ""
    return f"Largest error{units}: {'; '.join(texts)}." if texts else ""
