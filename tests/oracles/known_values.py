"""Made-up runs and what every metric that a case claims must say of them: a value that is known beforehand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from known_errors import OFF, Known, Scene, changed, channel

from crossbody.cases import Event, Mode, Switch, Trajectory
from crossbody.cases.contacts import CLOSED
from crossbody.cases.mechanisms.cradle.claims import row
from crossbody.cases.mechanisms.cradle.rules import answer
from crossbody.cases.mechanisms.red_body.order import STAGES


def drawn(s: Scene, signal: str, low: float = -1.0, high: float = 1.0) -> Trajectory:
    """A run whose signal is drawn at every sample."""
    return replace(s.run, **{signal: s.rng.uniform(low, high, getattr(s.run, signal).shape)})


def value(signal: str, of: Callable[[Scene, Trajectory], float], low: float = -1.0, high: float = 1.0) -> Known:
    """What a metric must say of a run with that signal drawn."""

    def known(s: Scene) -> tuple[Trajectory, float]:
        run = drawn(s, signal, low, high)
        return run, of(s, run)

    return known


def events(of: Callable[[Event], bool]) -> Known:
    """How many events of a kind there are; the run's own, each once or several times."""

    def known(s: Scene) -> tuple[Trajectory, float]:
        made = s.run.events * s.one(range(1, 4))
        return replace(s.run, events=made), float(sum(of(e) for e in made))

    return known


def parabola(s: Scene) -> Trajectory:
    """A run whose coordinates never turn and whose acceleration is constant: the trapezoidal rule is exact."""
    t, n = s.run.t, s.run.v.shape[1]
    v0, a = (s.sign() * s.rng.uniform(1.0, 2.0, n) for _ in range(2))
    a = np.abs(a) * np.sign(v0)
    return replace(s.run, q=s.run.q[0] + np.outer(t, v0) + 0.5 * np.outer(t**2, a), v=v0 + np.outer(t, a))


def faster(s: Scene) -> tuple[Trajectory, float]:
    """One rate at one sample that the way does not have."""
    run, k = parabola(s), s.sample()
    column = s.one(range(run.v.shape[1]))
    way = abs(run.q[-1, column] - run.q[0, column])
    off = 2.0 * OFF * way / (run.t[k + 1] - run.t[k - 1])
    largest = 0.5 * float(np.abs(run.v[:, column]).min())
    return changed(run, "v", (k, column), s.sign() * min(off, largest)), OFF * min(1.0, largest / off)


def place(s: Scene, name: str) -> int:
    return [c.name for c in s.case.coordinates].index(name)


def peak(row: int, other: int | None = None) -> Known:
    """A multiplier that is a parabola with its top between two samples, without a switch on the way."""

    def known(s: Scene) -> tuple[Trajectory, float]:
        k, t, lam = s.sample(), s.run.t, s.rng.uniform(0.0, 0.1, s.run.lam.shape[1])
        top = t[k] + s.one(range(1, 16)) / 16.0 * (t[k + 1] - t[k])
        run = replace(s.run, mode=0 * s.run.mode, lam=np.tile(lam, (len(t), 1)))
        run.lam.setflags(write=True)
        run.lam[:, row] = 2.0 - ((t - top) / t[-1]) ** 2
        return run, 2.0 if other is None else 2.0 - float(lam[other])

    return known


def leaving(of: Callable[[float, float, float], float]) -> Known:
    """A ball that leaves its face at a drawn angle with a drawn rate; `of` these and of the angle at the start."""

    def known(s: Scene) -> tuple[Trajectory, float]:
        angle, rate, start = s.rng.uniform(0.5, 1.2), s.sign() * s.rng.uniform(0.5, 2.0), s.rng.uniform(0.01, 0.1)
        release = next(e.t for e in s.run.events if e.contact == 0 and e.after not in CLOSED and e.before in CLOSED)
        q, v, at = s.run.q.copy(), s.run.v.copy(), np.searchsorted(s.run.t, release)
        around = slice(max(at - 2, 1), at + 3)
        q[around, 1:3], v[around, 1:3] = [np.sin(angle), np.cos(angle)], [rate * np.cos(angle), -rate * np.sin(angle)]
        q[0, 1:3] = [np.sin(start), np.cos(start)]
        return replace(s.run, q=q, v=v), of(angle, rate, start)

    return known


def pole(angle: float, rate: float, start: float) -> float:
    return float(abs(rate) / np.sqrt(2.0 * (np.cos(start) - np.cos(angle))))


def swinging(s: Scene) -> tuple[Trajectory, float]:
    """A saw of a drawn period: straight between samples where it crosses zero."""
    period, t, q = s.rng.uniform(0.2, 0.5), s.run.t, s.run.q.copy()
    q[:, 1] = np.abs((t / period + 0.25 + s.rng.uniform(0.0, 0.2)) % 1.0 - 0.5) - 0.25
    return replace(s.run, q=q), float(period)


def leaves(s: Scene) -> tuple[Trajectory, float]:
    fast, arrived = s.rng.random(s.run.v.shape[1]) < 0.5, float(s.run.v[0].max())
    return changed(s.run, "v", -1, np.where(fast, 0.505, 0.495) * arrived, whole=True), float(fast.sum())


def swung(s: Scene) -> tuple[Trajectory, float]:
    """Pendulums whose speeds, from the first touch on, are those of the rule but for the first or the last ball."""
    balls, ball = row(s.case), s.one([0, -1])
    speeds = answer("sequential", balls)
    assert speeds is not None
    speeds = speeds.copy()
    speeds[ball] += (s.sign() if ball else -1.0) * OFF * balls.speed  # no gap closes
    late = s.run.t >= min(e.t for e in s.run.events)
    run = replace(s.run, mode=0 * s.run.mode)
    return changed(run, "v", late, speeds / s.case.number("length"), whole=True), OFF


def pattern(s: Scene) -> tuple[Trajectory, float]:
    ball, arrived = s.one(range(s.run.v.shape[1])), float(s.run.v[0].max())
    return changed(s.run, "v", (-1, ball), s.sign() * OFF * arrived), OFF


def ordered(s: Scene) -> tuple[Trajectory, float]:
    """Some stages of the order, and then one of the box that is not the next."""
    count = s.one(range(len(STAGES) + 1))
    made = [Event(t=0.01 * i, contact=row, before=before, after=sorted(after)[0])
            for i, (row, before, after) in enumerate(STAGES[:count])]  # fmt: skip
    made.append(Event(t=1.0, contact=4, before=Mode.FREE, after=Mode.COLLISION))
    return replace(s.run, events=tuple(made)), float(count)


def standing(s: Scene) -> tuple[Trajectory, float]:
    """Two feet, of which one comes late."""
    run = drawn(s, "lam", 1.0, 2.0)
    late, foot = s.one(range(1, 50)), s.one([0, 1])
    run = changed(run, "lam", (slice(0, late), foot), 0.0, whole=True)
    return run, float(run.lam[late:, :2].min())


def released(s: Scene, which: int) -> np.ndarray:
    """Samples of one release."""
    ends = [e.t for e in s.run.events if e.before in CLOSED and e.after not in CLOSED]
    return s.at(ends[which])


def gap_there(s: Scene) -> tuple[Trajectory, float]:
    left, run = s.rng.uniform(-1.0, 1.0), drawn(s, "gap")
    return changed(run, "gap", (released(s, 0), 0), left, whole=True), float(left)


def gained(s: Scene) -> tuple[Trajectory, float]:
    """Energy at the start and at the last release; all others are drawn."""
    run = drawn(s, "energy")
    run = changed(run, "energy", released(s, -1), s.rng.uniform(-1.0, 1.0, 2), whole=True)
    ended = sum(e.before in CLOSED and e.after not in CLOSED for e in run.events)
    return run, float(run.energy[released(s, -1)[0]].sum() - run.energy[0].sum()) / ended


def rebounding(s: Scene) -> tuple[Trajectory, float]:
    """Rates at the first touch and the first release; all others are drawn."""
    run, (down, up) = drawn(s, "v"), s.rng.uniform(0.5, 2.0, 2)
    touch = next(e.t for e in run.events if e.after in CLOSED and e.before not in CLOSED)
    run = changed(run, "v", (np.flatnonzero(run.t == touch), 0), -down, whole=True)
    return changed(run, "v", (released(s, 0), 0), up, whole=True), float(up / down)


def free_again(s: Scene) -> tuple[Trajectory, float]:
    times = np.sort(s.rng.uniform(0.0, 1.0, 14)).tolist()
    names = [Mode.FREE, Mode.CONTACT] * 7
    made = [Event(t=t, contact=0, before=b, after=a) for t, a, b in zip(times, names, [*names[1:], Mode.FREE],
                                                                        strict=True)]  # fmt: skip
    return replace(s.run, events=tuple(made)), float([e.t for e in made if e.after == Mode.FREE][4])


def struck(s: Scene) -> tuple[Trajectory, float]:
    impulses = s.rng.uniform(-1.0, 1.0, len(s.run.events))
    made = tuple(replace(e, impulse=float(x)) for e, x in zip(s.run.events, impulses, strict=True))
    return replace(s.run, events=made), float(impulses.sum())


FREE_OR_NOT = (Mode.FREE, Mode.CONTACT)


def touching(side: int) -> Known:
    def known(s: Scene) -> tuple[Trajectory, float]:
        kinds = [(1 - side, True), (side, True), (1 - side, False), (side, False), (side, True), (1 - side, True)]
        made = [Event(t=float(t), contact=row, before=FREE_OR_NOT[not shut], after=FREE_OR_NOT[shut])
                for t, (row, shut) in zip(np.sort(s.rng.uniform(0.0, 1.0, 6)), kinds, strict=True)]  # fmt: skip
        return replace(s.run, events=tuple(made)), made[1].t

    return known


def spent(s: Scene) -> tuple[Trajectory, float]:
    assert s.run.ledger is not None
    work = s.rng.uniform(-1.0, 1.0, s.run.ledger.contact.shape)
    return replace(s.run, ledger=replace(s.run.ledger, contact=work)), -float(work[-1].sum())


def taken(s: Scene) -> tuple[Trajectory, float]:
    run = replace(drawn(s, "energy"), ledger=None)
    return run, float(run.energy[0].sum() - run.energy[-1].sum())


def rings(s: Scene) -> tuple[Trajectory, float]:
    """Changes of the channel among those of other variables."""
    count, others = s.one(range(9)), s.one(range(5))
    made = [Switch(t=0.1 * i, variable=channel(s) + (i >= count), before=0, after=1) for i in range(count + others)]
    return replace(s.run, switches=tuple(made)), float(count)


def drifted(s: Scene) -> tuple[Trajectory, float]:
    return changed(s.run, "v", (s.sample(), place(s, "integral of the error")), s.sign() * OFF), OFF


def by_sign(s: Scene) -> tuple[Trajectory, float, float]:
    """Gaps without events or modes, straight between samples: touch and release of row 0; the others open."""
    t, k = s.run.t, s.sample() // 2 + 1
    j = s.one(range(k + 2, len(t) - 1))
    gap = np.ones(s.run.gap.shape)
    gap[k:j, 0] = -s.rng.uniform(0.1, 3.0, j - k)
    touch = t[k - 1] + (t[k] - t[k - 1]) / (1.0 - gap[k, 0])
    release = t[j - 1] + (t[j] - t[j - 1]) * gap[j - 1, 0] / (gap[j - 1, 0] - 1.0)
    return replace(s.run, gap=gap, events=(), mode=0 * s.run.mode - 1), touch, release


def called_free(s: Scene) -> tuple[Trajectory, float]:
    """Some rows that push, called free at samples that are not beside an event."""
    t, lam, mode = s.run.t, s.run.lam, s.run.mode.copy()
    quiet = [k for k in range(4, len(t) - 4) if not any(t[k - 3] <= e.t <= t[k + 3] for e in s.run.events)]
    pushing = [(k, i) for k in quiet for i in np.flatnonzero(lam[k] > 1e-3 * lam.max()).tolist()]
    chosen = {pushing[s.one(range(len(pushing)))] for _ in range(3)}
    for k, i in chosen:
        mode[k, i] = Mode.FREE
    return replace(s.run, mode=mode), float(len(chosen))


def touch_by_sign(s: Scene) -> tuple[Trajectory, float]:
    return by_sign(s)[:2]


def time_by_sign(s: Scene) -> tuple[Trajectory, float]:
    run, touch, release = by_sign(s)
    return run, release - touch


def sides(lam: np.ndarray) -> float:
    return abs(float(lam[0] - lam[1]))


VALUES: dict[str, tuple[str, Known]] = {
    "balls_out": ("sliders", leaves),
    "block_end": ("block", value("q", lambda s, run: run.q[-1, place(s, "block")])),
    "bounces": ("box", events(lambda e: e.after == Mode.FREE)),
    "collision_impulse": ("blow", struck),
    "contact_imbalance": ("block", peak(0, other=1)),
    "contact_imbalance of the other side": ("block", peak(1, other=0)),
    "contact_loss": ("maze", spent),
    "contact_loss without an account": ("maze", taken),
    "contacts": ("box", events(lambda e: e.after in CLOSED and e.before not in CLOSED)),
    "end_imbalance": ("block", value("lam", lambda _, run: sides(run.lam[-1]))),
    "energy_per_bounce": ("ball", gained),
    "fifth_exit": ("ball", free_again),
    "final_gap": ("box", value("gap", lambda _, run: run.gap[-1].min())),
    "final_lam": ("box", value("lam", lambda _, run: run.lam[-1].sum())),
    "flange_end": ("block", value("q", lambda s, run: run.q[-1, place(s, "flange")])),
    "foot_lam": ("box", standing),
    "leave_angle": ("edge", leaving(lambda angle, _, __: float(np.cos(angle)))),
    "mode_contradicted": ("box", called_free),
    "mode_order": ("box", ordered),
    "pattern_distance": ("sliders", pattern),
    "pattern_distance of pendulums": ("pendulums", swung),
    "peak_lam3": ("box", peak(2)),
    "penetration": ("box", value("gap", lambda _, run: -run.gap.min())),
    "rate_residual": ("box", faster),
    "restitution": ("ball", rebounding),
    "ring_changes": ("maze", rings),
    "separation_gap": ("ball", gap_there),
    "swing_period": ("swing", swinging),
    "tactile_invariant": ("block", drifted),
    "touch_left": ("block", touching(0)),
    "touch_left by the sign of its gap": ("block", touch_by_sign),
    "contact_time by the sign of its gap": ("block", time_by_sign),
    "touch_right": ("block", touching(1)),
    "transitions": ("box", events(lambda e: True)),
    "unstable_pole": ("edge", leaving(pole)),
    "wall_lam": ("box", value("lam", lambda _, run: np.abs(run.lam[:, 4]).max())),
}
"""Scene and made-up run of every metric that says a value rather than a difference."""
