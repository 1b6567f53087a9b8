"""The gap map: how far apart balls must hang for an engine to give the ideal pattern, and what energy it makes before.

s = gap sqrt(a0) / v is the gap over the deepest penetration of one pair. From s = 0, where
collisions overlap, to s of some units, where they are over before the next begins.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from crossbody import cases, engines
from crossbody.cases import Case, CaseUnsupported, EngineUnavailable, Trajectory
from crossbody.cases.contacts import CLOSED
from crossbody.cases.mechanisms.cradle.claims import distance, row
from crossbody.cases.mechanisms.cradle.rules import RULES
from crossbody.reports.measuring.switching import made
from crossbody.reports.runs.choice import Pick

LARGEST_S = 3.0
MACHINES = ("level", "memoryless")
BESIDE = tuple(rule for rule in RULES if rule not in ("block", "memoryless"))
"""Rules whose own answer is laid beside; block gives simultaneous, memoryless is its own line."""
LONGER = 6  # how often the horizon is doubled while gaps still close
TIE = 1e-6
"""Rules no further apart than this are taken in their order: with springs and gaps all are ideal."""
PATTERN = "to_sequential"

COLUMNS = (
    "n", "engine", "profile", "machine", "s", "gap", "energy_created", "energy_switching", "momentum",
    *(f"to_{rule}" for rule in BESIDE), "nearest", "outcome", "wall_ms", "why",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One engine and profile, for the reference also one machine: a line of the map."""

    pick: Pick
    machine: str = MACHINES[0]

    @property
    def label(self) -> str:
        """In one word."""
        return f"{self.pick.engine}:{self.pick.profile}"


def lines(picks: Iterable[Pick]) -> tuple[Line, ...]:
    """The lines of the map: the reference's compiled loop runs both machines, every other profile has its own."""
    return tuple(
        Line(pick=pick, machine=machine)
        for pick in picks
        for machine in (MACHINES if (pick.engine, pick.profile) == ("reference", "compiled") else MACHINES[:1])
    )


def scene(n: int, s: float, machine: str, rule: str) -> Case:
    """The sliders with a gap of s v/sqrt(a0); contacts integrated in real time if "resolved"."""
    plain = cases.load("newtons_cradle", "sliders", n=n)
    gap = s * plain.number("speed") / math.sqrt(plain.number("a0"))
    case = cases.load("newtons_cradle", "sliders", n=n, gap=gap, collisions=rule)
    return replace(case, fsm=machine)


def _supported(line: Line, n: int) -> tuple[str, str]:
    """Rule under which an engine runs the sliders, "resolved" if it can; or "" and its sentence."""
    reasons = [line.pick.skipped] if line.pick.skipped else []
    try:
        engine = None if reasons else engines.load(line.pick.engine)
    except EngineUnavailable as error:
        return "", str(error)
    for rule in ("resolved", "sequential") if engine is not None else ():
        reason = engine.why_not(scene(n, 0.0, line.machine, rule), line.pick.profile) if engine else None
        if reason is None:
            return rule, ""
        reasons.append(reason)
    return "", reasons[0]


def gap_map(
    counts: Sequence[int], picks: Iterable[Pick], points: int, tell: Callable[[str], None] = lambda _: None
) -> pd.DataFrame:
    """Run every engine over so many values of s from 0 to 3; one row a run, columns `COLUMNS`.

    They are ratios to the energy, momentum and speed that came in. A line that cannot be had is one
    row with its sentence; a run that failed stays, with its outcome.
    """
    rows: list[dict[str, Any]] = []
    for n in counts:
        for line in lines(picks):
            tell(f"{n} balls: {line.label} {line.machine}")
            rows += _line(line, n, np.linspace(0.0, LARGEST_S, points).tolist())
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _line(line: Line, n: int, values: Sequence[float]) -> Iterator[dict[str, Any]]:
    rule, reason = _supported(line, n)
    about = {"n": n, "engine": line.pick.engine, "profile": line.pick.profile, "machine": line.machine}
    if not rule:
        yield {**about, "outcome": "skipped", "why": reason}
        return
    for s in values:
        case = scene(n, s, line.machine, rule)
        try:
            case, run, law = _run(line, case)
        except CaseUnsupported as error:
            yield {**about, "s": s, "outcome": "skipped", "why": str(error)}
            continue
        yield {**about, "machine": law, "s": s, "gap": case.number("gap"), **_measured(case, run)}


def _run(line: Line, case: Case) -> tuple[Case, Trajectory, str]:
    """The run with a horizon that lets every gap open, that case, and the machine followed."""
    engine = engines.load(line.pick.engine)
    for _ in range(LONGER):
        prepared = engine.prepare(case, line.pick.profile)
        run = prepared.run()
        if not run.outcome.ok or over(run):
            break
        case = replace(case, t_end=2.0 * case.t_end)
    # An engine's own machine, impacts where a restitution stands for the law, else the case's machine.
    followed = "impacts" if "restitution" in prepared.settings else str(prepared.settings.get("law", case.fsm))
    return case, run, followed


def over(run: Trajectory) -> bool:
    """Whether at the end no gap closes and nothing pushes."""
    closing = np.diff(run.v[-1]) < -1e-9 * float(np.max(np.abs(run.v[0])))
    return not closing.any() and not np.isin(run.mode[-1], CLOSED).any()


def _measured(case: Case, run: Trajectory) -> dict[str, Any]:
    """The numbers of one run; none of them if it failed."""
    found: dict[str, Any] = {"outcome": run.outcome.value, "wall_ms": 1e3 * run.wall_s, "why": run.message}
    if not run.outcome.ok:
        return found
    balls = row(case)
    brought, momentum = 0.5 * float(balls.masses @ balls.v0**2), float(balls.masses @ balls.v0)
    jumps = made(run, case)
    apart = {f"to_{rule}": distance(rule, run, case) for rule in BESIDE}
    known = {name: value for name, value in apart.items() if value is not None}
    return found | apart | {
        "energy_created": float(run.total_energy[-1]) / brought - 1.0,
        "energy_switching": math.nan if jumps is None else jumps / brought,
        "momentum": float(run.v[-1] @ balls.masses) / momentum - 1.0,
        "nearest": _nearest(known),
    }  # fmt: skip


def _nearest(apart: Mapping[str, float]) -> str:
    """The rule that is followed most closely; of those equally close the first."""
    least = min(apart.values())
    return next(name.removeprefix("to_") for name, value in apart.items() if value <= least + TIE)


def summary(rows: pd.DataFrame, ideal: float = 1e-3) -> pd.DataFrame:
    """One row a line: its largest gain of energy and where, whom it follows at s = 0, from where it is ideal."""
    found = []
    for (n, engine, profile, machine), group in rows.groupby(["n", "engine", "profile", "machine"], sort=False):
        about = {"n": n, "engine": engine, "profile": profile, "machine": machine}
        done = group[group["outcome"] == "finished"].sort_values("s")
        failed = int((group["outcome"] != "finished").sum())
        why = next((str(text) for text in group["why"] if isinstance(text, str) and text), "")
        found.append(about | _line_summary(done, ideal) | {"failed": failed, "why": why})
    columns = ["n", "engine", "profile", "machine", "most", "at_s", "at_touch", "ideal_from", "failed", "why"]
    return pd.DataFrame(found, columns=columns)


def in_words(lines: pd.DataFrame) -> list[str]:
    """Say of a summary who creates most energy at which gap, and from which gap on the pattern is ideal."""
    told = []
    for n, group in lines.groupby("n", sort=False):
        if not (known := group[group["most"].notna()]).empty:
            top = known.iloc[int(np.argmax(known["most"].astype(float)))]
            ideal = group[group["ideal_from"].notna()]["ideal_from"].astype(float)
            told.append(
                f"{n} balls: {top['engine']}:{top['profile']} ({top['machine']}) creates most, "
                f"{100.0 * float(top['most']):.3g} % of the energy brought in, at s = {float(top['at_s']):g}; "
                f"{len(ideal)} of {len(group)} follow the ideal pattern"
                + (f", all of these from s = {ideal.max():g} on." if len(ideal) else " at no gap.")
            )
    if failed := int(lines["failed"].sum()):
        told.append(f"{failed} runs failed.")
    return told


def _line_summary(done: pd.DataFrame, ideal: float) -> dict[str, Any]:
    if not len(done):
        return {"most": math.nan, "at_s": math.nan, "at_touch": "", "ideal_from": math.nan}
    peak = done.iloc[int(np.argmax(done["energy_created"].astype(float)))]
    beyond = done[done[PATTERN].astype(float) > ideal]["s"]
    later = done[done["s"] > (beyond.max() if len(beyond) else -1.0)]["s"]
    touching = done[done["s"] == 0.0]["nearest"]
    return {
        "most": float(peak["energy_created"]), "at_s": float(peak["s"]), "at_touch": "".join(touching),
        "ideal_from": float(later.min()) if len(later) else math.nan,
    }  # fmt: skip
