"""Faults of known size in what friction does in a motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Mode, Trajectory
from crossbody.cases.arrays import Floats, distinct
from crossbody.reports.judging.planting import FAR, FEW, PART, TENTH, Control, Plain, exactly, with_signal
from crossbody.reports.measuring.equations import equations
from crossbody.reports.measuring.friction import slips
from crossbody.reports.measuring.truth import taken


def friction(plain: Plain) -> Iterator[Control]:
    """Let what slides exceed its bound at one sample, and turn it."""
    rows, ways, bound = bounds(plain.case, plain.run)
    most = float(np.max(bound, initial=0.0))
    yield from _cumulated(plain, ways)
    yield from _creeping(
        plain, [way for row, way in zip(rows, ways, strict=True) if plain.run.mode[-1, row] == Mode.STICK]
    )
    hard = bound > TENTH * most
    slides = hard & (plain.run.mode[:, rows] == Mode.SLIP)
    lower = bound < (1.0 - TENTH) * most  # than the hardest: it tells the bound of each from that of all
    places = plain.draw.permutation(len(rows)).tolist() if most > 0.0 else []
    for k in places:
        some = slides[:, k] & lower[:, k]
        if at := plain.samples(some if some[plain.quiet].any() else slides[:, k])[:1]:
            yield _exceeded(plain, at[0], k)
            break
    for k in places:
        if at := plain.samples(slides[:, k] & fast(plain, ways, k))[:1]:
            yield from _turned_aside(plain, at[0], k)
            break


def unturned(case: Case, run: Trajectory) -> bool:
    """Whether friction may point any way of a plane, and nothing slides by enough for a turn of it to be a fault."""
    system = equations(case)
    if system is None or not system.frictional or not (system.tangents > 1).any():
        return False
    return not any("friction_angle" in control.sees for control in friction(Plain(case, run)))


def _cumulated(plain: Plain, ways: Sequence[slice]) -> Iterator[Control]:
    """Draw a force along a tangent at every one of few samples, far apart: its impulse and work by trapezoids."""
    system, run = equations(plain.case), plain.few()
    if len(run.t) < 2 or system is None or not ways or not run.lam.any():
        return
    row = ways[int(plain.draw.integers(len(ways)))].start
    force = float(np.max(np.abs(run.lam))) * plain.draw.uniform(-1.0, 1.0, len(run.t))
    slip = slips(plain.case, run)[:, row]
    sees = {}
    for name, power in (("friction_impulse", force), ("friction_work", force * slip)):
        sums = np.append(0.0, np.cumsum([0.5 * (run.t[i + 1] - run.t[i]) * (power[i] + power[i + 1])
                                         for i in range(len(run.t) - 1)]))  # fmt: skip
        sees[name] = exactly(float(np.max(np.abs(sums))))
    pushed = with_signal(run, "lam", (slice(None), row), run.lam[:, row] + force)
    yield Control(fault=f"forces along row {row}", run=pushed, plain=run, sees=sees, wrong=False)


def _creeping(plain: Plain, ways: Sequence[slice]) -> Iterator[Control]:
    """Let everything move at the end, where contacts hold."""
    system, run = equations(plain.case), taken(plain.run, np.arange(len(plain.run.t))[-FEW:])
    if system is None or not ways:
        return
    v = run.v[-1] + PART * plain.draw.normal(size=run.v.shape[1])
    moving = replace(run, v=np.concatenate([run.v[:-1], [v]]))
    rates = slips(plain.case, moving)[-1]
    fastest = max(float(np.linalg.norm(rates[way])) for way in ways)
    yield Control(fault="what holds moves", run=moving, plain=run, sees={"creep_speed": exactly(fastest)})


def fast(plain: Plain, ways: Sequence[slice], k: int) -> NDArray[np.bool_]:
    """Return the samples (n,) at which one of several places slips by at least a part of what any moves by, in flight.

    No metric looks where one hardly slips: there is no direction.
    """
    rates = slips(plain.case, plain.run)
    speeds = np.stack([np.linalg.norm(rates[:, way], axis=1) for way in ways])
    fast: NDArray[np.bool_] = speeds[k] > FAR * float(speeds.max())
    return fast


def bounds(case: Case, run: Trajectory) -> tuple[NDArray[np.intp], list[slice], Floats]:
    """Return the rows with friction, the rows along which it acts, and its bounds (n, k), N."""
    system = equations(case)
    if system is None or not system.frictional:
        return np.zeros(0, dtype=np.intp), [], np.zeros((len(run.t), 0))
    rows = np.flatnonzero(system.tangents)
    ways = [slice(int(system.tangent[k]), int(system.tangent[k] + system.tangents[k])) for k in rows]
    return rows, ways, system.friction[rows] * np.where(system.dry[rows], 1.0, run.lam[:, rows])


def _few(plain: Plain, i: int) -> tuple[Trajectory, int]:
    """Return a sample's neighbours, with that at which friction is bounded most, and where it is among them."""
    hardest = int(np.argmax(bounds(plain.case, plain.run)[2].max(axis=1)))
    some = distinct(np.arange(max(i - FEW // 2, 0), min(i + FEW // 2, len(plain.run.t))), hardest)
    return taken(plain.run, some), int(np.searchsorted(some, i))


def _exceeded(plain: Plain, i: int, k: int) -> Control:
    """Enlarge friction of one place at one sample, among its neighbours."""
    few, i = _few(plain, i)
    rows, ways, bound = bounds(plain.case, few)
    own = np.array(few.lam[i, ways[k]])
    more = with_signal(few, "lam", (i, ways[k]), (1.0 + PART) * own)
    sees = {"cone_violation": exactly(PART * float(np.linalg.norm(own)) / float(bound.max()))}
    return Control(fault=f"friction of row {rows[k]} {PART:g} too large", run=more, plain=few, sees=sees)


def _turned_aside(plain: Plain, i: int, k: int) -> Iterator[Control]:
    """Turn friction of one place at one sample, among its neighbours; in a plane there is no other way."""
    few, i = _few(plain, i)
    rows, ways, _ = bounds(plain.case, few)
    own = np.array(few.lam[i, ways[k]])
    if len(own) == 2:
        c, s = np.cos(TENTH), np.sin(TENTH)
        turned = with_signal(few, "lam", (i, ways[k]), np.array([[c, -s], [s, c]]) @ own)
        said = f"friction of row {rows[k]} turned by {TENTH:g} rad"
        yield Control(fault=said, run=turned, plain=few, sees={"friction_angle": exactly(TENTH)})
