"""Faults of known size in the multipliers of a motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Mode, Trajectory
from crossbody.reports.judging.planting import (
    MUCH,
    PART,
    PUSHES,
    RESTS,
    ROUGH,
    TENTH,
    Control,
    Plain,
    exactly,
    roughly,
    with_signal,
)
from crossbody.reports.measuring.equations import equations

FORCED = {2.0: "doubled", 0.0: "left out"}
"""Factors on all forces."""

WEAK = 3e-3
"""Part of the force that moves a mechanism below which what its rows carry is not what their errors are measured by."""


def forces(plain: Plain) -> Iterator[Control]:
    """Double all multipliers and impulses, or leave them out; put one off, to where it pulls, or pushes at nothing."""
    run = plain.run
    largest = float(np.max(np.abs(run.lam), initial=0.0))
    if not largest > RESTS and not any(event.impulse for event in run.events):
        return
    least = WEAK * moving(run)
    yield from _impulses(plain, least)
    if not largest > RESTS:
        return
    yield from _laws(plain, least)
    k = int(np.argmax(np.max(np.abs(run.lam), axis=0)))
    for i, sign in plain.both() if largest > least else ():
        one = plain.off("lam", (i, k), sign * MUCH * largest)
        yield Control(fault="a multiplier off at one sample", run=one, sees={"lam_error": exactly(MUCH)})
    yield from _pulling(plain)


def moving(run: Trajectory) -> float:
    """Return the force, N, that moves a mechanism: the energy that turns over, over its way."""
    way = float(np.max(np.ptp(run.q, axis=0), initial=0.0))
    return max(float(run.energy[:, 0].max()), float(np.ptp(run.energy[:, 1]))) / way if way > 0.0 else 0.0


def _impulses(plain: Plain, least: float) -> Iterator[Control]:
    """Put all impulses off; where rows carry less than `least`, N, let one carry what moves the mechanism."""
    run, seen = plain.run, ("lam_impulse_path", "lam_impulse")
    if not carries(run, least):
        pressed = _pressed(run, least / WEAK)
        yield Control(fault=f"a row presses by {least / WEAK:.3g} more", run=pressed, sees=dict.fromkeys(seen, LARGE))
        return
    for times, said in FORCED.items():
        events = tuple(replace(event, impulse=times * event.impulse) for event in run.events)
        yield Control(
            fault=f"multipliers and impulses {said}", run=replace(run, lam=times * run.lam, events=events),
            sees=dict.fromkeys(seen, roughly(1.0)),
        )  # fmt: skip


def carries(run: Trajectory, least: float) -> bool:
    """Whether the impulse of a row is that of a force, N, that acts throughout, or more: errors are measured by it.

    With those of collisions that take no time.
    """
    sums = np.abs(np.trapezoid(run.lam, run.t, axis=0))
    for event in run.events:
        sums[event.contact] += abs(event.impulse)
    return float(np.max(sums, initial=0.0)) >= least * float(np.ptp(run.t))


LARGE = (1.0 / ROUGH, np.inf)
"""Range of what is as large as what it is measured by, or far larger."""


def _pressed(run: Trajectory, more: float) -> Trajectory:
    """Return a motion whose row that carries most carries more, N, throughout."""
    k = int(np.argmax(np.max(np.abs(run.lam), axis=0)))
    return with_signal(run, "lam", (slice(None), k), run.lam[:, k] + more)


def _laws(plain: Plain, least: float) -> Iterator[Control]:
    """Put multipliers off the law, at all of a few samples and at one."""
    few = plain.few()
    if not len(few.t):
        return
    at = tuple(np.unravel_index(np.argmax(np.abs(few.lam)), few.lam.shape))
    if np.abs(few.lam[at]) < least:
        more, said = _pressed(few, least / WEAK), f"a row presses by {least / WEAK:.3g} more"
        yield Control(fault=said, run=more, sees={"law_residual": LARGE}, plain=few)
        return
    if not _acts(plain.case, few, int(at[0]), int(at[1])):
        return
    # Friction of what slides is the run's own: changed, it asks for other normal forces, near a jam for far larger
    # ones, beside which a doubled one is small. And of rows that depend on others a part counts.
    changes = ~_dragged(plain.case, few)
    twice = LARGE if plain.case.rubs else roughly(1.0) if plain.case.general else exactly(1.0)
    for sign, (times, said) in zip((1.0, -1.0), FORCED.items(), strict=True):
        other = replace(few, lam=np.where(changes, times, 1.0) * few.lam)
        yield Control(fault=f"multipliers {said}", run=other, sees={"law_residual": twice}, plain=few)
        one = with_signal(few, "lam", (int(at[0]), int(at[1])), (1.0 + sign * MUCH) * few.lam[at])
        pushes = float(np.max(np.abs(few.lam[changes]), initial=0.0))  # by which friction of what slides is measured
        seen = (TENTH * MUCH, ROUGH * MUCH * max(1.0, abs(float(few.lam[at])) / (pushes or 1.0)))
        yield Control(
            fault=f"the largest multiplier {sign * MUCH:g} off at one sample", run=one, sees={"law_residual": seen},
            plain=few,
        )  # fmt: skip


def _dragged(case: Case, run: Trajectory) -> NDArray[np.bool_]:
    """Return which multipliers (n, nc) are friction of what slides; none where it is dry and carries the most."""
    if (system := equations(case)) is None:
        return np.zeros(run.lam.shape, dtype=bool)
    slides = (run.mode == Mode.SLIP) & (np.asarray(system.follows) >= 0)
    dry, others = (np.max(np.abs(np.where(some, run.lam, 0.0))) for some in (slides & system.dry, ~slides))
    dragged: NDArray[np.bool_] = slides & bool(dry <= others)
    return dragged


def _acts(case: Case, run: Trajectory, i: int, row: int) -> bool:
    """Whether multipliers, and that of a row at a sample, move anything: at a dead centre no law tells them."""
    if (system := equations(case)) is None:
        return False
    H = system.equations_along(run.t, run.q, run.v)[2]
    pushed, largest = np.einsum("mkn,mk->mn", H, run.lam), float(np.max(np.abs(H), initial=0.0))
    all_, own = float(np.max(np.abs(pushed), initial=0.0)), float(np.max(np.abs(H[i, row]), initial=0.0))
    return all_ > WEAK * largest * float(np.max(np.abs(run.lam))) and own > WEAK * largest


def _pulling(plain: Plain) -> Iterator[Control]:
    """Let rows that touch pull, or push at nothing, at one sample."""
    run, rows = plain.run, plain.normal
    most = PART * float(np.max(np.abs(run.lam[:, rows]), initial=0.0))
    wrong = {"pulls": (-most, np.isin(run.mode, PUSHES)), "pushes at nothing": (most, run.mode == Mode.FREE)}
    for k in plain.some(rows) if most > 0.0 else ():
        for said, (push, among) in wrong.items():
            for i in plain.samples(among[:, k])[:1]:
                sees = {"complementarity": exactly(PART)}
                yield Control(
                    fault=f"row {k} {said} at one sample", run=with_signal(run, "lam", (i, k), push), sees=sees
                )
