"""Faults of known size in the truth's own motion, by which the judge is judged (`crossbody.reports.judging.controls`).

What must come out follows from each fault in closed form: neither a metric nor a limit is asked for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Coordinate, Event, Mode, Trajectory
from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.contacts import contacts
from crossbody.reports.measuring.equations import equations, spread
from crossbody.reports.measuring.friction import rubbing, slips
from crossbody.reports.measuring.scale import rounded
from crossbody.reports.measuring.truth import taken

PART = 0.02
"""Part of the largest by which a signal is off: no limit on a motion may be as wide."""
TENTH, MUCH = 0.1, 0.25
"""Likewise, of velocities and angles, and of multipliers, which robots with servos hold less tightly."""
SLACK, ROUGH = 1e-3, 3.0
"""Part, and factor, by which a number may differ from what follows: by rounding, and by where samples stand."""
QUIET = 1e-5
"""Part of the horizon within which samples are at an event, and say nothing but of it."""
SEED, DRAWN, QUARTERS = 20261127, 2, 4
"""Of all draws, how many coordinates and rows are drawn for one kind of fault, and into what samples are parted."""
LOOKED, FEW = 400, 40
"""Samples that identities look at, at most: a fault covers their neighbours; and samples for what takes long."""
RESTS, TINY = 1e-4, 1e-6
"""Sizes, SI, and part of an energy, below which a motion is not what its errors are measured by."""
FAR = 0.01
"""Part of its largest beyond which what brings an event about is far from zero."""
HAIR = 1e-7
"""Gap at a touch, m, that no tolerance leaves, and that is less than what joins two touches."""
PUSHES = (Mode.CONTACT, Mode.COLLISION, Mode.STICK, Mode.SLIP)

Range = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Control:
    """A motion with one known fault.

    Attributes:
        fault: what was done, in words.
        run: the motion.
        sees: metric -> least and most of its size, in its unit.
        plain: the same motion without the fault, where that is not the whole one.
        wrong: whether what it sees must be outside; else it is no fault, and the number alone must be right.
    """

    fault: str
    run: Trajectory
    sees: Mapping[str, Range]
    plain: Trajectory | None = None
    wrong: bool = True


def exactly(size: float) -> Range:
    """Return the range around a size that follows."""
    return (1.0 - SLACK) * size, (1.0 + SLACK) * size


def roughly(size: float) -> Range:
    """Return the range around a size that samples blur."""
    return size / ROUGH, size * ROUGH


@dataclass
class Plain:
    """A motion without a fault, and where faults can be put.

    Attributes:
        case: what moved.
        run: the motion.
        quiet: samples at which nothing happens.
        normal: rows that open.
        turning: coordinates that are parts of quaternions.
    """

    case: Case
    run: Trajectory
    quiet: NDArray[np.intp] = field(init=False)
    normal: NDArray[np.intp] = field(init=False)
    turning: frozenset[int] = field(init=False)
    draw: np.random.Generator = field(init=False)

    def __post_init__(self) -> None:
        """Look where nothing happens."""
        run = self.run
        self.draw = np.random.default_rng(SEED)
        happens = np.sort([*(e.t for e in run.events), *(s.t for s in run.switches), run.t[0], run.t[-1]])
        behind = np.searchsorted(happens, run.t)
        around = np.stack([np.maximum(behind - 1, 0), np.minimum(behind, len(happens) - 1)])
        nearest = np.min(np.abs(run.t - happens[around]), axis=0)
        self.quiet = np.flatnonzero(nearest > QUIET * self.case.t_end)
        self.normal = np.flatnonzero(self.case.law.touches)
        self.turning = frozenset(i + k for i in self.case.quaternions for k in range(4))

    def samples(self, among: NDArray[np.bool_] | None = None) -> list[int]:
        """Draw quiet samples of those that are asked for: one early and one late, in any order."""
        kept = self.quiet if among is None else self.quiet[among[self.quiet]]
        few = -(-len(kept) // QUARTERS)
        ends = [kept[:few], kept[-few:]] if len(kept) > few else [kept]
        return [int(self.draw.choice(ends[k])) for k in self.draw.permutation(len(ends)) if few]

    def both(self) -> Iterator[tuple[int, float]]:
        """Yield an early and a late sample, and a sign for each: what is too small is as wrong as what is too large."""
        yield from zip(sorted(self.samples()), self.draw.permutation([1.0, -1.0]).tolist(), strict=False)

    def some(self, of: Sequence[int] | NDArray[np.intp]) -> list[int]:
        """Draw a few of some numbers."""
        return [int(k) for k in self.draw.permutation(np.array(of, dtype=int))[:DRAWN]]

    def off(self, name: str, at: tuple[int | slice, int], by: float | Floats) -> Trajectory:
        """Return the motion with one signal off at some places."""
        return _with(self.run, name, at, getattr(self.run, name)[at] + by)


def _with(run: Trajectory, name: str, at: tuple[int | slice, int | slice], value: float | Floats) -> Trajectory:
    values = np.array(getattr(run, name))
    values[at] = value
    return replace(run, **{name: values})  # type: ignore[arg-type]


def faults(case: Case, run: Trajectory) -> Iterator[Control]:
    """Yield every fault that a motion has room for.

    Args:
        case: what moved.
        run: the motion of its truth, some hundred samples or more.
    """
    plain = Plain(case, run)
    for kind in KINDS if len(plain.quiet) >= FEW else ():
        yield from kind(plain)


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
            turned = _with(run, "q", (i, slice(j, j + 4)), _turned(run.q[i, j : j + 4], plain.draw.normal(size=3)))
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
    for j in plain.some(range(run.v.shape[1])):
        most = float(sizes[j] / min(least[j], sizes[j]))
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
        below = _with(run, "gap", (plain.samples()[0], k), -deep)
        yield Control(fault=f"row {k} {deep:.3g} below", run=below, sees={"penetration": exactly(deep)}, wrong=False)
    for k in plain.some(closed):
        i, size = plain.samples()[0], PART + float(np.max(np.abs(run.gap[:, closed])))
        opened = _with(run, "gap", (i, k), size)
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
    least = WEAK * _moving(run)
    yield from _impulses(plain, least)
    if not largest > RESTS:
        return
    yield from _laws(plain, least)
    k = int(np.argmax(np.max(np.abs(run.lam), axis=0)))
    for i, sign in plain.both() if largest > least else ():
        one = plain.off("lam", (i, k), sign * MUCH * largest)
        yield Control(fault="a multiplier off at one sample", run=one, sees={"lam_error": exactly(MUCH)})
    yield from _pulling(plain)


def _moving(run: Trajectory) -> float:
    """Return the force, N, that moves a mechanism: the energy that turns over, over its way."""
    way = float(np.max(np.ptp(run.q, axis=0), initial=0.0))
    return max(float(run.energy[:, 0].max()), float(np.ptp(run.energy[:, 1]))) / way if way > 0.0 else 0.0


def _impulses(plain: Plain, least: float) -> Iterator[Control]:
    """Put all impulses off; where rows carry less than `least`, N, let one carry what moves the mechanism."""
    run, seen = plain.run, ("lam_impulse_path", "lam_impulse")
    if not _carries(run, least):
        pressed = _pressed(run, least / WEAK)
        yield Control(fault=f"a row presses by {least / WEAK:.3g} more", run=pressed, sees=dict.fromkeys(seen, LARGE))
        return
    for times, said in FORCED.items():
        events = tuple(replace(event, impulse=times * event.impulse) for event in run.events)
        yield Control(
            fault=f"multipliers and impulses {said}", run=replace(run, lam=times * run.lam, events=events),
            sees=dict.fromkeys(seen, roughly(1.0)),
        )  # fmt: skip


def _carries(run: Trajectory, least: float) -> bool:
    """Whether the impulse of a row is that of a force, N, that acts throughout, or more: errors are measured by it."""
    return float(np.max(np.abs(np.trapezoid(run.lam, run.t, axis=0)), initial=0.0)) >= least * float(np.ptp(run.t))


LARGE = (1.0 / ROUGH, np.inf)
"""Range of what is as large as what it is measured by, or far larger."""


def _pressed(run: Trajectory, more: float) -> Trajectory:
    """Return a motion whose row that carries most carries more, N, throughout."""
    k = int(np.argmax(np.max(np.abs(run.lam), axis=0)))
    return _with(run, "lam", (slice(None), k), run.lam[:, k] + more)


def _laws(plain: Plain, least: float) -> Iterator[Control]:
    """Put multipliers off the law, at all of a few samples and at one."""
    few = taken(plain.run, plain.quiet[:: -(-len(plain.quiet) // FEW)])
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
        one = _with(few, "lam", (int(at[0]), int(at[1])), (1.0 + sign * MUCH) * few.lam[at])
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
                yield Control(fault=f"row {k} {said} at one sample", run=_with(run, "lam", (i, k), push), sees=sees)


def counts(plain: Plain) -> Iterator[Control]:
    """Leave out a contact that ended, with its modes and without them."""
    run = plain.run
    row, touch, end = _last_contact(plain) or (-1, 0.0, 0.0)
    if row < 0:
        return
    mode = np.array(run.mode)
    mode[(run.t >= touch) & (run.t <= end), row] = Mode.FREE
    fewer = tuple(e for e in run.events if not (e.contact == row and touch <= e.t <= end))
    one = dict.fromkeys(("touch_count", "release_count"), exactly(1.0))
    yield Control(fault="a contact left out", run=replace(run, mode=mode, events=fewer), sees=one)
    inside = (run.t > touch) & (run.t < end)
    known = int(np.sum(inside & ~np.isin(run.t, [e.t for e in run.transitions(row)]) & (run.mode[:, row] != Mode.FREE)))
    if known:
        odd = {"mode_residual": (float(known), float(np.sum(mode != run.mode) * mode.shape[1]))}
        yield Control(fault="a contact without its modes", run=replace(run, mode=mode), sees=odd)


WIDE = 3
"""Samples on either side of one between which and its neighbours nothing may happen."""


def modes(plain: Plain) -> Iterator[Control]:
    """Call what presses free, and what slips a stick, at one sample amid others of the same modes."""
    run = plain.run
    still = np.isin(np.arange(len(run.t)), plain.quiet)
    still[WIDE:-WIDE] &= np.all([still[i : len(still) - 2 * WIDE + i] for i in range(2 * WIDE + 1)], axis=0)
    still[:WIDE] = still[len(still) - WIDE :] = False
    for k in plain.normal if run.lam.any() else ():
        presses = still & (run.lam[:, k] > FAR * float(np.max(np.abs(run.lam)))) & np.isin(run.mode[:, k], PUSHES)
        for i in plain.samples(presses)[:1]:
            freed = _with(run, "mode", (i, int(k)), Mode.FREE)
            yield Control(fault=f"row {k} presses while FREE", run=freed, sees={"mode_contradicted": exactly(1.0)})
    yield from _misnamed(run)
    rows, ways, bound = _bounds(plain.case, run)
    for k, row in enumerate(rows):
        slides = still & (run.mode[:, row] == Mode.SLIP) & (bound[:, k] > FAR * float(np.max(np.abs(run.lam))))
        for i in plain.samples(slides & _fast(plain, ways, k))[:1]:
            held = _with(run, "mode", (i, int(row)), Mode.STICK)
            yield Control(fault=f"row {row} slips while STICK", run=held, sees={"mode_contradicted": exactly(1.0)})
            return


def _misnamed(run: Trajectory) -> Iterator[Control]:
    """Call what is below the surface behind a contact as if a collision had ended there, and the other way about."""
    swapped = {Mode.BALLISTIC: Mode.COLLISION_SEPARATION, Mode.COLLISION_SEPARATION: Mode.BALLISTIC}
    ends = {Mode.BALLISTIC: Mode.COLLISION, Mode.COLLISION_SEPARATION: Mode.CONTACT}
    odd = [e for e in run.events if e.after in ends and e.before not in (ends[e.after], Mode.FREE)
           and sum(abs(e.t - other.t) == 0.0 for other in run.events) == 1]  # fmt: skip
    if odd:
        names = np.arange(len(Mode))
        names[list(swapped)] = list(swapped.values())
        events = tuple(
            replace(e, before=swapped.get(e.before, e.before), after=swapped.get(e.after, e.after)) for e in run.events
        )
        other = replace(run, mode=names[run.mode].astype(run.mode.dtype), events=events)
        sees = {"mode_residual": (float(len(odd)), float(len(run.events)))}
        yield Control(fault="rows below their surface called by another name", run=other, sees=sees)


def _fast(plain: Plain, ways: Sequence[slice], k: int) -> NDArray[np.bool_]:
    """Return the samples (n,) at which one of several places slips by at least a part of what any moves by, in flight.

    No metric looks where one hardly slips: there is no direction.
    """
    rates = slips(plain.case, plain.run)
    speeds = np.stack([np.linalg.norm(rates[:, way], axis=1) for way in ways])
    fast: NDArray[np.bool_] = speeds[k] > FAR * float(speeds.max())
    return fast


def _last_contact(plain: Plain) -> tuple[int, float, float] | None:
    """Return row, touch and end of a row's last contact, behind which it stays free; of bodies without friction."""
    for row in plain.some(plain.normal) if not (plain.case.rubs or plain.case.general) else ():
        events = plain.run.transitions(row)
        touched = [e.t for e in events if e.before == Mode.FREE and e.after in PUSHES]
        if touched and events[-1].after == Mode.FREE and touched[-1] < events[-1].t:
            return row, touched[-1], events[-1].t
    return None


def touches(plain: Plain) -> Iterator[Control]:
    """Record a touch too early: by a part of the fall onto it, and by a hair."""
    run, case = plain.run, plain.case
    begun = {(one.row, one.touch) for one in contacts(run, case.law.touches, case.general)}  # not what rounding parts
    for event in run.events:
        if not (event.before == Mode.FREE and event.after in PUSHES) or not event.t > run.t[0]:
            continue
        if (event.contact, event.t) not in begun:
            continue
        gap = np.abs(run.gap[:, event.contact])
        off = 0.05 * _since_last(run, event)
        high = float(np.interp(event.t - off, run.t, gap))
        if sum(e.t == event.t for e in run.events) > 1 or high < FAR * float(gap.max()):
            continue
        hair = HAIR * max(1.0, float(np.max(np.abs(run.q)))) * off / high
        for early, more in ((off, {"event_times": exactly(off)}), (hair, {})):
            if early <= off:
                sees: dict[str, Range] = {"event_gap": _left(run, event, early), **more}
                yield Control(fault=f"a touch {early:.3g} s early", run=shifted(run, [event], -early), sees=sees)
        return


def _since_last(run: Trajectory, event: Event) -> float:
    """Return the time from the instant at which something last happened to an event, s."""
    return event.t - max([e.t for e in run.events if e.t < event.t], default=float(run.t[0]))


def _left(run: Trajectory, event: Event, early: float) -> Range:
    """Return which part of its longest way between samples a row is off its surface before a touch."""
    gap = run.gap[:, event.contact]
    return roughly(abs(float(np.interp(event.t - early, run.t, gap))) / float(np.max(np.abs(np.diff(gap)))))


def shifted(run: Trajectory, which: Sequence[Event], by: float) -> Trajectory:
    """Return a motion with the instants of some events off, s."""
    return replace(run, events=tuple(replace(e, t=e.t + by) if e in which else e for e in run.events))


def released(plain: Plain) -> Iterator[Control]:
    """Record the end of a contact too late, and too early: by a part of the time since anything happened."""
    run = plain.run
    ends = [e for e in run.events if e.before in PUSHES and e.after not in PUSHES and e.contact in plain.normal]
    for event in ends if not (plain.case.rubs or plain.case.general) else ():
        behind = min([e.t for e in run.events if e.t > event.t], default=float(run.t[-1]))
        off, lam = 0.05 * min(behind - event.t, _since_last(run, event)), np.abs(run.lam[:, event.contact])
        alone = off > 0.0 and sum(e.t == event.t for e in run.events) == 1
        if alone and float(np.interp(event.t - off, run.t, lam)) > FAR * float(lam.max()):
            for by in (off, -off):
                moved = shifted(run, [event], by)
                yield Control(fault=f"a release {by:.3g} s off", run=moved, sees={"event_times": exactly(off)})
            return


def handed(plain: Plain) -> Iterator[Control]:
    """Record the end of a collision too early."""
    run = plain.run
    ends = [e for e in run.events if (e.before, e.after) == (Mode.COLLISION, Mode.CONTACT)]
    for event in ends[:1]:
        off = 0.2 * _since_last(run, event)
        early = shifted(run, [event], -off)
        yield Control(fault=f"a hand-over {off:.3g} s early", run=early, sees={"mode_times": exactly(off)})


def switched(plain: Plain) -> Iterator[Control]:
    """Record too early that what slides holds, or the other way about."""
    run = plain.run
    between = {Mode.STICK, Mode.SLIP}
    turns = [e for e in run.events if {e.before, e.after} == between]
    for slides, metric in ((False, "stick_times"), (True, "slip_times")):
        for event in [e for e in turns if (e.after == Mode.SLIP) == slides and _of_pair(plain, e)][-1:]:
            off = 0.05 * _since_last(run, event)
            same = [e for e in run.events if e.t == event.t]
            if not _shows(plain, event, event.t - off):
                continue
            yield Control(
                fault=f"a change between slip and stick {off:.3g} s early", run=shifted(run, same, -off),
                sees={metric: exactly(off)},
            )  # fmt: skip


def _of_pair(plain: Plain, event: Event) -> bool:
    """Whether a place of a pair begins to slide as its first, or holds as its last: others' changes are no instants."""
    found = rubbing(plain.run, plain.case)
    if found is None:
        return False
    times, own = plain.run.t, found.rows == event.contact
    mates = found.rows[np.isin(found.pair, found.pair[own]) & ~own]
    before, after = int(np.searchsorted(times, event.t)) - 1, int(np.searchsorted(times, event.t, side="right"))
    beside = max(before, 0) if event.after == Mode.SLIP else min(after, len(times) - 1)
    return not (plain.run.mode[beside, mates] == Mode.SLIP).any()


def _shows(plain: Plain, event: Event, t: float) -> bool:
    """Whether at an instant before a change slip, or what friction is below its bound, is far from none."""
    run, (rows, ways, bound) = plain.run, _bounds(plain.case, plain.run)
    if event.contact not in rows:
        return False
    k, i = int(np.searchsorted(rows, event.contact)), int(np.searchsorted(run.t, t))
    if event.after == Mode.SLIP:
        below = np.abs(bound[:, k] - np.linalg.norm(run.lam[:, ways[k]], axis=1))
        return bool(below[i] > FAR * float(bound[:, k].max()))
    rates = slips(plain.case, taken(run, np.array([i, *range(0, len(run.t), -(-len(run.t) // FEW))])))[:, ways[k]]
    speeds = np.linalg.norm(rates, axis=1)
    return bool(speeds[0] > FAR * speeds.max())


def clocks(plain: Plain) -> Iterator[Control]:
    """Stretch time between touches, or between slips and sticks: laid beside the truth, the motion is the same."""
    run = plain.run
    touched = {e.t for e in run.events if e.before == Mode.FREE and e.after in PUSHES and e.t > run.t[0]}
    turned = {e.t for e in run.events if {e.before, e.after} == {Mode.STICK, Mode.SLIP}}
    rubs = plain.case.rubs or plain.case.general
    if rubs == bool(touched) or not touched | turned:
        return
    knots = sorted(touched | turned)
    late = PART * float(np.min(np.diff([run.t[0], *knots]))) * np.resize([1.0, -1.0], len(knots))

    def stretched(t: Floats) -> Floats:
        moved: Floats = t + np.interp(t, [run.t[0], *knots], [0.0, *late])
        return moved

    other = replace(
        run, t=stretched(run.t), events=tuple(replace(e, t=float(stretched(np.array(e.t)))) for e in run.events)
    )
    sees = dict.fromkeys(("position", "velocity", "gap_error"), (0.0, TINY))
    if rubs:
        if not _carries(run, WEAK * _moving(run)):
            return
        sees = {"lam_impulse_path": exactly(_apart(run, other))}
    yield Control(fault="another clock between events", run=other, sees=sees, wrong=False)


def _apart(run: Trajectory, other: Trajectory) -> float:
    """Return how far impulses are apart in two clocks, over the largest."""
    total = [np.cumsum(0.5 * np.diff(one.t)[:, None] * (one.lam[1:] + one.lam[:-1]), axis=0) for one in (run, other)]
    return float(np.max(np.abs(total[1] - total[0])) / np.max(np.abs(total[0]), initial=1e-300))


def friction(plain: Plain) -> Iterator[Control]:
    """Let what slides exceed its bound at one sample, and turn it."""
    rows, ways, bound = _bounds(plain.case, plain.run)
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
        if at := plain.samples(slides[:, k] & _fast(plain, ways, k))[:1]:
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
    system, run = equations(plain.case), taken(plain.run, plain.quiet[:: -(-len(plain.quiet) // FEW)])
    if system is None or not ways or not run.lam.any():
        return
    row = ways[int(plain.draw.integers(len(ways)))].start
    force = float(np.max(np.abs(run.lam))) * plain.draw.uniform(-1.0, 1.0, len(run.t))
    slip = slips(plain.case, run)[:, row]
    sees = {}
    for name, power in (("friction_impulse", force), ("friction_work", force * slip)):
        sums = np.append(0.0, np.cumsum([0.5 * (run.t[i + 1] - run.t[i]) * (power[i] + power[i + 1])
                                         for i in range(len(run.t) - 1)]))  # fmt: skip
        sees[name] = exactly(float(np.max(np.abs(sums))))
    pushed = _with(run, "lam", (slice(None), row), run.lam[:, row] + force)
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


def _bounds(case: Case, run: Trajectory) -> tuple[NDArray[np.intp], list[slice], Floats]:
    """Return the rows with friction, the rows along which it acts, and its bounds (n, k), N."""
    system = equations(case)
    if system is None or not system.frictional:
        return np.zeros(0, dtype=np.intp), [], np.zeros((len(run.t), 0))
    rows = np.flatnonzero(system.tangents)
    ways = [slice(int(system.tangent[k]), int(system.tangent[k] + system.tangents[k])) for k in rows]
    return rows, ways, system.friction[rows] * np.where(system.dry[rows], 1.0, run.lam[:, rows])


def _few(plain: Plain, i: int) -> tuple[Trajectory, int]:
    """Return a sample's neighbours, with that at which friction is bounded most, and where it is among them."""
    hardest = int(np.argmax(_bounds(plain.case, plain.run)[2].max(axis=1)))
    some = distinct(np.arange(max(i - FEW // 2, 0), min(i + FEW // 2, len(plain.run.t))), hardest)
    return taken(plain.run, some), int(np.searchsorted(some, i))


def _exceeded(plain: Plain, i: int, k: int) -> Control:
    """Enlarge friction of one place at one sample, among its neighbours."""
    few, i = _few(plain, i)
    rows, ways, bound = _bounds(plain.case, few)
    own = np.array(few.lam[i, ways[k]])
    more = _with(few, "lam", (i, ways[k]), (1.0 + PART) * own)
    sees = {"cone_violation": exactly(PART * float(np.linalg.norm(own)) / float(bound.max()))}
    return Control(fault=f"friction of row {rows[k]} {PART:g} too large", run=more, plain=few, sees=sees)


def _turned_aside(plain: Plain, i: int, k: int) -> Iterator[Control]:
    """Turn friction of one place at one sample, among its neighbours; in a plane there is no other way."""
    few, i = _few(plain, i)
    rows, ways, _ = _bounds(plain.case, few)
    own = np.array(few.lam[i, ways[k]])
    if len(own) == 2:
        c, s = np.cos(TENTH), np.sin(TENTH)
        turned = _with(few, "lam", (i, ways[k]), np.array([[c, -s], [s, c]]) @ own)
        said = f"friction of row {rows[k]} turned by {TENTH:g} rad"
        yield Control(fault=said, run=turned, plain=few, sees={"friction_angle": exactly(TENTH)})


KINDS: tuple[Callable[[Plain], Iterator[Control]], ...] = (
    positions, velocities, starts, gaps, energies, forces, modes, counts, touches, released, handed, switched, clocks,
    friction,
)  # fmt: skip
