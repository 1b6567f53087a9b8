"""What audits must say of engines that are wrong by a known amount, and must not of those that are right.

An audit that passes anything passes every engine. So each is handed what is off: steps that are too long, a setting
that did not arrive, and a ball that an engine written here lets fall with a per cent too
much weight, or moves by its speed of the step before. And what a tolerance hides, and what stands between samples, is
known.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from crossbody import cases, engines
from crossbody.cases import Case, Mode, Outcome, Trajectory
from crossbody.cases.between import between
from crossbody.engines.contract import Engine, Run
from crossbody.reports.judging.asked import Found, Within, unlike
from crossbody.reports.judging.audit import settings_kept
from crossbody.reports.judging.first_steps import first_steps
from crossbody.reports.judging.run_verdicts import Entry, looser
from crossbody.reports.judging.steps_taken import miscounted

STEP, STEPS, FALL = 0.01, 100, 1e-3
"""Of a made-up record, s, and their number; step of a ball that falls, s."""
LITTLE, SOME = 1e-6, 0.01
"""By which a setting, and the weight of a ball, are off."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return the audit, its number, least and most, and of what, where it is another one."""
    kinds = (_steps, _settings, _falls, _loose, _between)
    return unlike(kinds, "audit", "an engine, which ends in")


def _record(count: int, dt: float) -> Trajectory:
    one = np.ones((count + 1, 1))
    return Trajectory(
        t=dt * np.arange(count + 1, dtype=np.float64), q=one, v=one, gap=one, lam=one, energy=np.ones((count + 1, 2)),
        mode=np.zeros((count + 1, 1), dtype=np.int8), steps=count, outcome=Outcome.FINISHED,
    )  # fmt: skip


def _steps() -> Iterator[Within]:
    """Yield whether steps are told that are others than a setting says."""
    case, run = cases.load("bouncing_ball", "linear"), _record(STEPS, STEP)
    for times, told in ((1.0, False), (2.0, True), (1.1, True), (0.9, True), (0.5, True)):
        found = any(miscounted(case, {"dt": times * STEP}, run))
        yield "steps", f"a setting {times:g} times the step", float(found), float(told), 0.0
    long = replace(run, t=np.delete(np.append(run.t, run.t[-1]), 5), steps=STEPS)
    yield "steps", "one step that is twice as long", float(any(miscounted(case, {"dt": STEP}, long))), 1.0, 0.0


def _settings() -> Iterator[Within]:
    """Yield how many rows say that settings did not arrive."""
    used = {"rtol": 1e-9, "cone": "elliptic", "max_steps": 9}
    for what, own, told in (
        ("as they are", {"rtol": 1e-9, "cone": "elliptic"}, 0), ("of another word", {"cone": "pyramidal"}, 1),
        ("of another number", {"rtol": 1e-9 * (1.0 + LITTLE)}, 1), ("that are none", {"rtol": math.nan}, 1),
    ):  # fmt: skip
        found = sum(not row.ok for row in settings_kept({"set": own}, used))
        yield "settings", f"settings {what}", float(found), float(told), 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Falls(Run):
    """A ball in free flight by steps of its own, with more weight than it has, moved by its new speed or its old."""

    case: Case
    settings: Mapping[str, Any]
    more: float
    late: bool
    engine: str = "made up"
    profile: str = "steps"

    def run(self) -> Trajectory:
        """Step from the start."""
        dt = float(self.settings["dt"])
        count, g = round(self.case.t_end / dt), (1.0 + self.more) * self.case.number("gravity")
        q, v = np.tile(self.case.q0, (count + 1, 1)), np.tile(self.case.v0, (count + 1, 1))
        for k in range(count):
            v[k + 1] = v[k] - g * dt
            q[k + 1] = q[k] + dt * (v[k] if self.late else v[k + 1])
        return replace(_record(count, dt), q=q, v=v, gap=q, lam=0.0 * q)

    def audit(self) -> Mapping[str, Any]:
        """Show nothing."""
        return {}


class Falling(Engine):
    """An engine whose only case is a ball in free flight; see `Falls`."""

    name = "made up"
    profiles: Mapping[str, str] = {"steps": "semi-implicit Euler"}
    versions: Mapping[str, str] = {}
    steps: Mapping[str, float] = {"steps": 1.0}
    late = frozenset({"steps"})

    def __init__(self, more: float = 0.0, late: bool = False) -> None:
        self.more, self.old = more, late

    def prepare(self, case: Case, profile: str = "steps", **settings: Any) -> Run:
        """See `Engine.prepare`; dt, s."""
        return Falls(case=case, settings={"dt": settings["dt"]}, more=self.more, late=self.old)


def _falls() -> Iterator[Within]:
    """Yield how many of its first steps are said to be wrong, and how many are looked at."""
    case = cases.load("bouncing_ball", "linear")
    theirs = engines.load("reference").prepare(case, "compiled").audit()
    for what, engine, told in (
        ("as it is", Falling(), 0), ("too heavy", Falling(more=SOME), 1), ("too light", Falling(more=-SOME), 1),
        ("moved late", Falling(late=True), 1),
    ):  # fmt: skip
        rows = first_steps(case, (engine, "steps"), {"dt": FALL}, {}, (), theirs)
        yield "first steps", "a ball that falls", float(len(rows)), 2.0, 0.0
        yield "first steps", f"a ball that is {what}", float(sum(not row.ok for row in rows)), float(told), 0.0


def _loose() -> Iterator[Within]:
    """Yield by how much a tolerance widens limits."""
    case = cases.load("bouncing_ball", "linear")
    for rtol, wanted in ((1e-12, 1.0), (1e-9, 1.0), (1e-6, 1e3), (1e-4, 1e5)):
        entry = Entry(engine="reference", profile="compiled", settings={"rtol": rtol}, run=_record(1, STEP))
        yield "tolerance", f"rtol = {rtol:g}", looser(case, entry), wanted, 1e-9 * wanted


def _between() -> Iterator[Within]:
    """Yield what stands between samples of a motion that is bent where its mode changes, whether told twice or not."""
    t = np.linspace(0.0, 1.0, 11)
    for what, at in (("once", t), ("twice", np.insert(t, 6, t[5]))):
        q = np.abs(at - t[5])[:, None]
        closed = np.arange(len(at)) >= (5 if what == "once" else 6)
        run = replace(
            _record(len(at) - 1, STEP), t=at, q=q, v=q, gap=q, lam=q,
            mode=np.where(closed, int(Mode.CONTACT), int(Mode.FREE)).astype(np.int8)[:, None],
        )  # fmt: skip
        for when in (0.13, 0.42, 0.58, 0.77):
            found = float(between(run)(np.array([when])).q[0, 0])
            yield "between", f"a bend that is told {what}", found, abs(when - 0.5), 1e-9
