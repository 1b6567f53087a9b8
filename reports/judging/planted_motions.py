"""Faults of known size in the positions, velocities, gaps and energies of a motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Coordinate
from crossbody.cases.arrays import Floats
from crossbody.reports.judging.planting import (
    DRAWN,
    LOOKED,
    PART,
    RESTS,
    SLACK,
    TENTH,
    TINY,
    Control,
    Plain,
    exactly,
    roughly,
    with_signal,
)
from crossbody.reports.measuring.equations import spread
from crossbody.reports.measuring.scale import rounded


def positions(plain: Plain) -> Iterator[Control]:
    """Put a coordinate off at one sample, by a part of the largest of its unit; turn a body."""
    case, run = plain.case, plain.run
    largest = _of_unit(run.q, case.coordinates, [c.size for c in case.coordinates])
    for j in plain.some([j for j in range(run.q.shape[1]) if j not in plain.turning]):
        size, own = PART * float(largest[j]), float(np.max(np.abs(run.q[:, j])))
        most = max(size / own, size) if own > TENTH * largest[j] else np.inf
        for i, sign in plain.both():
            yield Control(
                fault=f"{case.coordinates[j].name} off by {sign * size:.3g} {case.coordinates[j].unit} at one sample",
                run=plain.off("q", (i, j), sign * size),
                sees={"position": ((1.0 - SLACK) * PART, (1.0 + SLACK) * most)},
            )  # fmt: skip
        yield Control(
            fault=f"{case.coordinates[j].name} off by {size:.3g} {case.coordinates[j].unit} at the end",
            run=plain.off("q", (len(run.t) - 1, j), size),
            sees={"position": ((1.0 - SLACK) * PART, (1.0 + SLACK) * most)},
        )  # fmt: skip
    for j in case.quaternions[:DRAWN]:
        for i in plain.samples()[:1]:
            turned = with_signal(
                run, "q", (i, slice(j, j + 4)), _turned(run.q[i, j : j + 4], plain.draw.normal(size=3))
            )
            yield Control(fault=f"a turn by {PART:g} rad", run=turned, sees={"position": exactly(PART)})


def _turned(q: Floats, axis: Floats) -> Floats:
    """Return the product of a quaternion and that of a turn by PART about an axis."""
    c, s = np.cos(0.5 * PART), np.sin(0.5 * PART) * axis / np.linalg.norm(axis)
    return np.array([c * q[0] - q[1:] @ s, *(c * q[1:] + q[0] * s + np.cross(q[1:], s))])


def _of_unit(signal: Floats, named: Sequence[Coordinate], least: Sequence[float]) -> Floats:
    """Return the largest value (n,) of each unit, and at least what a case says that its coordinates are."""
    groups: dict[str, float] = {}
    for value, one, size in zip(np.max(np.abs(signal), axis=0).tolist(), named, least, strict=True):
        groups[one.unit] = max(groups.get(one.unit, RESTS), value, size)
    return np.array([groups[one.unit] for one in named])


def velocities(plain: Plain) -> Iterator[Control]:
    """Put a velocity off at one sample; record all of them a tenth too large."""
    case, run = plain.case, plain.run
    largest = _of_unit(run.v, case.velocities, [c.rate for c in case.velocities])
    leads, turns = _of_unit(run.q, case.coordinates, [c.size for c in case.coordinates]) / case.t_end, _turns(case)
    leads = np.where(turns, 1.0 / case.t_end, np.delete(leads, [at + 3 for at in case.quaternions]))
    rests = largest <= RESTS
    sizes, least = np.where(rests, np.maximum(largest, leads), largest), np.where(rests & ~turns, largest, np.inf)
    if case.scene is not None:  # what turns little beside a wheel, or stands beside what flies, is measured by less
        own = np.max(np.abs(run.v), axis=0)
        least = np.minimum(least, np.where(own > TENTH * sizes, own, 0.0))
    for j in plain.some(range(run.v.shape[1])):
        most = float(sizes[j] / min(least[j], sizes[j])) if least[j] > 0.0 else np.inf
        for i, sign in plain.both():
            yield Control(
                fault=f"the velocity of {case.velocities[j].name} {sign * PART:g} of the largest off at one sample",
                run=plain.off("v", (i, j), sign * PART * float(sizes[j])),
                sees={"velocity": ((1.0 - SLACK) * PART, (1.0 + SLACK) * PART * most)},
            )  # fmt: skip
    for size in (TENTH, -TENTH) if np.ptp(run.q, axis=0).max() > RESTS else ():
        fast = replace(run, v=(1.0 + size) * run.v)
        yield Control(fault=f"velocities {size:g} too large", run=fast, sees={"rate_residual": roughly(TENTH)})


def _turns(case: Case) -> NDArray[np.bool_]:
    """Return which velocities (nv,) are of bodies that turn in space: if they rest, errors are by a radian."""
    found = np.zeros(len(case.velocities), dtype=bool)
    for i, at in enumerate(case.quaternions):
        found[at - i : at - i + 3] = True
    return found


def starts(plain: Plain) -> Iterator[Control]:
    """Begin elsewhere."""
    case, run = plain.case, plain.run
    largest = _of_unit(run.q, case.coordinates, [c.size for c in case.coordinates])
    for j in plain.some([j for j in range(run.q.shape[1]) if j not in plain.turning])[: int(run.t[0] == 0.0)]:
        for size in (PART, -PART):
            begun = plain.off("q", (0, j), size * float(largest[j]))
            said = f"a start {size:g} of the largest coordinate off"
            yield Control(fault=said, run=begun, sees={"start_error": exactly(PART)})


def gaps(plain: Plain) -> Iterator[Control]:
    """Put the gap of a row off at one sample, or at as many as are not looked at; open what is closed."""
    run, rows = plain.run, plain.normal
    closed = np.flatnonzero(~plain.case.law.unilateral & (plain.case.law.a0 > 0.0))
    least = TINY * max(1.0, float(np.max(np.abs(run.q))))
    looked = spread(run)
    size = max(float(np.max(np.abs(run.gap[looked]), initial=0.0)), rounded(run.q[looked]))
    for k in plain.some(rows):
        wide = max(float(np.max(np.abs(run.gap[:, rows]))), RESTS, least)
        some = PART * (wide if run.gap[:, rows].any() or run.q.any() else 1.0)  # at the origin errors are absolute
        every = PART * max(float(np.max(np.abs(run.gap))), least)
        own, many = float(np.max(np.abs(run.gap[:, k]))), -(-len(run.t) // LOOKED)
        most = (1.0 + SLACK) * some / own if own > 0.0 else np.inf  # its bodies may be farther than it ever opens
        for i, sign in plain.both():
            yield Control(
                fault=f"the gap of row {k} {sign * some:.3g} off at one sample",
                run=plain.off("gap", (i, k), sign * some), sees={"gap_error": ((1.0 - SLACK) * PART, most)},
            )  # fmt: skip
            yield Control(
                fault=f"the gap of row {k} {sign * every:.3g} off for some samples",
                run=plain.off("gap", (slice(i, i + many), k), sign * every),
                sees={"gap_residual": exactly(every / size)},
            )  # fmt: skip
    for k in plain.some(rows)[:1]:
        deep = PART * max(float(np.max(np.abs(run.gap))), RESTS) + float(np.max(-run.gap[:, rows], initial=0.0))
        below = with_signal(run, "gap", (plain.samples()[0], k), -deep)
        yield Control(fault=f"row {k} {deep:.3g} below", run=below, sees={"penetration": exactly(deep)}, wrong=False)
    for k in plain.some(closed):
        i, size = plain.samples()[0], PART + float(np.max(np.abs(run.gap[:, closed])))
        opened = with_signal(run, "gap", (i, k), size)
        yield Control(fault=f"row {k} opened by {size:.3g}", run=opened, sees={"constraint_drift": exactly(size)})


def energies(plain: Plain) -> Iterator[Control]:
    """Add to kinetic energies; book work that was not done."""
    run = plain.run
    kinetic = float(run.energy[:, 0].max())
    swing = max(kinetic, float(np.ptp(run.energy[:, 1])))
    if np.ptp(run.q, axis=0).max() <= RESTS or swing <= TINY * float(np.max(np.abs(run.energy))):
        return
    account = {} if run.ledger is None else {"energy_integrator": exactly(PART)}
    for i, sign in plain.both():
        yield Control(
            fault=f"kinetic energy {sign * PART:g} of the largest off at one sample",
            run=plain.off("energy", (i, 0), sign * PART * swing), sees={"energy_drift": exactly(PART), **account},
        )  # fmt: skip
        if run.ledger is not None and run.gap.shape[1]:
            work = np.array(run.ledger.contact)
            work[i, int(plain.draw.integers(work.shape[1]))] += sign * PART * swing
            yield Control(
                fault=f"work of a row {sign * PART:g} of the largest energy off at one sample",
                run=replace(run, ledger=replace(run.ledger, contact=work)),
                sees={"contact_work": exactly(PART), **account},
            )  # fmt: skip
    for size in (PART, -PART) if kinetic > 0.0 else ():
        more = plain.off("energy", (slice(None), 0), size * run.energy[:, 0])
        yield Control(fault=f"kinetic energy {size:g} too large", run=more, sees={"energy_residual": exactly(PART)})
