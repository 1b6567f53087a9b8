"""Verdicts of one run: every number that it has, and every one that it should have."""

from __future__ import annotations

import math
import shlex
import traceback
from collections.abc import Callable, Iterator, Mapping, Set
from dataclasses import dataclass, field, replace
from functools import cached_property
from numbers import Real
from typing import Any

import numpy as np

from crossbody import cases, engines
from crossbody.cases import Case, CaseUnsupported, Claim, CrossbodyError, Limit, Trajectory, Value
from crossbody.cases.arguments import instance
from crossbody.cases.arrays import Floats
from crossbody.cases.defaults import TOLERANCE, limits_of
from crossbody.reports import metrics
from crossbody.reports.judging.acting import SUMS, misacting, uncertain
from crossbody.reports.judging.audit import AuditRow
from crossbody.reports.judging.clocks import Clock, mistimed
from crossbody.reports.judging.parts import LARGEST, PARTS, SPLIT, Split, Study, part_of, splits
from crossbody.reports.judging.steps_taken import miscounted
from crossbody.reports.judging.stored import (
    Deviations,
    changed,
    defaults,
    deviations,
    differing,
    lacking,
    repeated,
    words,
)
from crossbody.reports.judging.verdict import (
    AGAIN,
    FACTOR,
    IDENTITIES,
    LACKS,
    NOT_MEASURED,
    ROUNDING,
    Verdict,
    Word,
    as_stored,
    band,
    deviation,
    explained,
    judge,
    limit_for,
    regression,
)
from crossbody.reports.measuring.truth import Truth, before, shortened

GROWING = frozenset({
    "position", "velocity", "gap_error", "event_times", "mode_times", "lam_impulse_path",
    "slip_times", "stick_times", "friction_impulse", "friction_work",
    "largest position (importer)", "largest event_times (importer)",
    "largest position (step)", "largest event_times (step)",
})  # fmt: skip
"""Metrics that compare a motion with the truth's, or those of two readers of a file: rounding
grows as the motion has it."""
WIDEST = 1e-3
"""To which such a limit grows at most: a tenth of what a fault of one per cent makes of a motion, or a claim."""
LOOSEST = 1e3
"""So many times the tolerance that limits are for widen them at most: beyond, an error may be as large as a fault's."""
EXACT = IDENTITIES - GROWING
"""Metrics of a run against itself: neither a tolerance nor a horizon widens their limits."""
MAY_BE_UNTOLD = frozenset({"rate_residual", *SUMS})
"""Metrics that samples which are far apart do not tell."""
TINY = 1e-300
"""In place of a tolerance of an audit that is zero: any difference is beyond it."""
SUM = 1e-9
"""To which part of it the parts of an error add up to it."""
FLOOR = 0.5
"""A number is judged where at least this part of the time for which the truth must be trusted was
compared; that of a stored run with the same deviation, which was compared as far, is judged by it."""
REACHED = 1e-9
"""Part of the horizon by which the end of a record may miss it: steps that do not add up to it exactly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One run of an engine, or the sentence that says why there is none.

    Attributes:
        engine, profile: who ran.
        settings: what was really used.
        default: whether these are the engine's own, none having been asked for.
        run: the motion; None if it was skipped.
        skipped: why, in one sentence.
        audit: what reached the engine beside the reference.
        study: runs of the same engine with other steps or tolerances, which tell the parts of its error.
        clock: the run of the engine's own steps, where `run` was asked for other instants, and what passed
            around it; None where nobody looked.
        own: truth of the equations that the engine really integrates; None where they are the case's own.
        hidden: what this engine does not show, and why (`crossbody.engines.hidden`).
        crashed: what it threw, where it did not come back with an outcome.
        asked: of the settings, those that were asked for.
        took_s: what all of that took, s: preparation and the runs that tell the parts of its error too,
            compilation aside.
        until: up to when it was run, s, where the truth is known no further and the rest would cost too much.
    """

    engine: str
    profile: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    default: bool = False
    run: Trajectory | None = None
    skipped: str = ""
    audit: tuple[AuditRow, ...] = ()
    study: Study | None = None
    clock: Clock | None = None
    own: Truth | None = None
    hidden: Mapping[str, str] = field(default_factory=dict)
    crashed: str = ""
    asked: Mapping[str, Value] = field(default_factory=dict)
    took_s: float = 0.0
    until: float = math.inf

    @property
    def options(self) -> str:
        """What a command says to run it."""
        words = [word for name, value in self.asked.items() for word in ("--set-engine", f"{name}={value}")]
        return shlex.join([*words, "--engine", f"{self.engine}:{self.profile}"])


def unguarded(_label: str) -> str:
    """Let a metric take as long as it likes."""
    return ""


PART_ROWS = tuple(part_of(metric, part) for metric in SPLIT for part in PARTS)
LARGEST_PARTS = tuple(f"{LARGEST} {name}" for name in PART_ROWS)


def looser(case: Case, entry: Entry) -> float:
    """Return how many times the tolerance that limits are for, or the engine's own if that is more, was asked for."""
    rtol = float(entry.settings.get("rtol", 0.0))
    if not rtol > TOLERANCE or entry.run is None or entry.engine not in engines.names():
        return 1.0
    own = float(engines.load(entry.engine).planned(case, entry.profile).get("rtol", TOLERANCE))
    return max(rtol / max(own, TOLERANCE), 1.0)


def longer(case: Case) -> float:
    """Return how many times its own horizon a case of the library is given; 1 where that is longer."""
    own = cases.load(case.name, case.variant).t_end if changed(case) else case.t_end
    return max(case.t_end / own, 1.0)


def _unit(metric: str, case: Case) -> float:
    """Return what the largest errors of a metric are parts of: 1, or of instants the horizon where it is shorter, s."""
    return min(case.t_end, 1.0) if "_times" in metric else 1.0


class Judge:
    """Fills in what all rows of one run share."""

    def __init__(
        self, case: Case, entry: Entry, truth: Truth, command: str, begin: Callable[[str], str] = unguarded
    ) -> None:
        self.begin = begin
        self.case, self.entry, self.truth = case, entry, truth
        self.claims: Mapping[str, Claim] = {claim.metric: claim for claim in case.claims}
        self.limits = limits_of(case)
        self.stored: Deviations = deviations(case, entry, truth.trusted)
        self.repeated = repeated(case, entry) if self.stored else frozenset()
        self.looser, self.longer = looser(case, entry), longer(case)
        self.command = f"{command} {entry.options}"

    def limit(self, metric: str) -> Limit | None:
        """The limit that judges this run: wider as errors grow and tolerances do, while a fault of a per cent shows.

        Those of a case are for its own horizon: each step adds as much.
        """
        found = limit_for(self.limits, metric, self.entry.engine, self.entry.profile)
        if found is None or metric in EXACT:
            return found
        found = found.under(self.entry.settings)
        if metric in MAY_BE_UNTOLD and metric in self.untold:
            return None
        grows, longer, looser = self.truth.grows, self.longer, min(self.looser, LOOSEST)
        times, why = longer * looser, found.why
        if metric in GROWING:
            times *= grows * longer  # what an error makes of the speed goes on
            why += f"; errors grow {grows:.2g} times as much as in free flight" if grows > 1.0 else ""
        why += f"; the horizon is {longer:.3g} times the case's own" if longer > 1.0 else ""
        why += f"; {self.looser:.3g} times that tolerance was requested" if looser > 1.0 else ""
        claim = self.claims.get(metric)
        widest = WIDEST * (abs(claim.expected) if claim is not None and claim.expected else _unit(metric, self.case))
        return replace(found, value=max(found.value, min(found.value * times, widest)), why=why)

    def hides(self) -> bool:
        """Whether the tolerance that was asked for allows a motion errors beyond those that tell a fault from none."""
        limit = limit_for(self.limits, "position", self.entry.engine, self.entry.profile)
        stated = 0.0 if limit is None else limit.value
        return self.looser > LOOSEST or (stated < WIDEST < stated * self.looser)

    @cached_property
    def untold(self) -> Mapping[str, str]:
        """What samples of this run, or of its truth, are too far apart to tell, and why."""
        run = self.entry.run
        return {**self._rates, **({} if run is None else uncertain(self.case, run))}

    @property
    def _rates(self) -> dict[str, str]:
        """Why rates are not told, if they are not."""
        stated = limit_for(self.limits, "rate_residual", self.entry.engine, self.entry.profile)
        own = metrics.load("rate_residual").measure(self.truth, self.truth.trajectory, self.case)
        if self.looser > 1.0:
            return {"rate_residual": "At the requested tolerance its samples are too far apart."}
        if stated is not None and own is not None and own > stated.value:
            return {"rate_residual": "Rates change between samples: those of the truth do not tell its own way."}
        return {}

    def told(self, metric: str, word: Word, why: str) -> tuple[Word, str]:
        """What is said of a number: one outside is not judged where a tolerance was asked for that hides any fault."""
        if word is not Word.OUTSIDE or metric in EXACT or metric == "law_residual" or not self.hides():
            return word, why
        return Word.INFO, "The requested tolerance allows errors as large as those of a fault."

    def row(self, metric: str, value: float, unit: str, verdict: Word, why: str, **more: Any) -> Verdict:
        """Return a row of this run."""
        return Verdict(
            case=self.case.name, variant=self.case.variant, engine=self.entry.engine,
            profile=self.entry.profile, metric=metric, value=value, unit=unit, verdict=verdict,
            why=why, command=self.command, settings=words(self.entry.settings),
            **({"tier": self.truth.tier.value} | more),
        )  # fmt: skip

    def judged(self, metric: str, value: float, unit: str, against: Truth, compared: float) -> Verdict:
        """One number: its word by physics and method, and by the stored run."""
        claim, limit, stored = self.claims.get(metric), self.limit(metric), self.stored.get(metric)
        factor = AGAIN if metric in self.repeated else FACTOR
        word, why = judge(value, limit, claim, stored, factor)
        if math.isfinite(value):
            word, why = self.told(metric, word, why)
        if word is Word.INFO and limit is None and metric not in self.untold:
            shown = limit_for(self.limits, "*", self.entry.engine, self.entry.profile)
            word, why = as_stored(value, shown, stored, factor)
        known = self.case.chaos or self.truth.horizon
        until = 1.0 if known is None else min(1.0, known.until / self.case.t_end)
        if compared < FLOOR * until and (word is Word.WITHIN or (word is Word.EXPECTED and stored is None)):
            word, why = Word.INFO, f"Compared over {compared:.2%} of the horizon only: {against.source}"
        most = band(stored, limit, claim)
        return self.row(
            metric, value, unit, word,
            why or self.untold.get(metric, "") or (against.source if against is not self.truth else ""),
            expected=math.nan if claim is None else claim.expected,
            limit=limit.value if limit else math.nan if claim is None else 0.0,
            tier=against.tier.value if claim is None else claim.tier.value,
            compared=compared, band=most, regression=regression(deviation(value, claim), most, stored, factor),
        )  # fmt: skip

    def missing(self, metric: str, unit: str, why: str, needs: str) -> Verdict:
        """A number that is asked for and that the run does not have: a claim, or what the truth has."""
        claim, limit, stored = self.claims.get(metric), self.limit(metric), self.stored.get(metric)
        expected = math.nan if claim is None else claim.expected
        if needs in self.entry.hidden:
            return self.row(metric, math.nan, unit, Word.INFO, self.entry.hidden[needs], expected=expected)
        known = "" if limit is None else limit.known
        word = Word.EXPECTED if known and stored is not None and math.isnan(stored) else Word.OUTSIDE
        excused = claim is None or metric in lacking(self.case, self.entry)
        if limit is not None and limit.covers_none and stored is None and excused:
            return self.row(metric, math.nan, unit, Word.INFO, f"{why} Known: {limit.known}.")
        if claim is not None:
            why += f" {claim.expected:g} claimed: {claim.source}."
        word, why = self.told(metric, word, known if word is Word.EXPECTED else why)
        return self.row(
            metric, math.nan, unit, word, why, expected=expected,
            tier=self.truth.tier.value if claim is None else claim.tier.value,
        )  # fmt: skip


def verdicts(
    case: Case, entry: Entry, truth: Truth, command: str, begin: Callable[[str], str] = unguarded
) -> list[Verdict]:
    """Every row of one run, which is compared as far as the truth is trusted."""
    truth = shortened(truth)
    judge_ = Judge(case, entry, truth, command, begin)
    if entry.crashed:
        return [judge_.row("run", math.nan, "", Word.CRASHED, entry.crashed)]
    if entry.run is None:
        return [judge_.row("run", math.nan, "", Word.SKIPPED, entry.skipped)]
    rows = [finished(judge_, entry.run), *_defaults(judge_)]
    rows += _outside_of_clocks(judge_, entry)
    if entry.audit:
        rows.append(audited(judge_))
        if rows[-1].verdict == Word.OUTSIDE:
            return rows
    if not len(entry.run.t):
        return rows
    rows += _outside_of_momenta(judge_, entry.run)
    run = truth.compared(entry.run)
    rows += _measured(judge_, run, truth)
    rows += _split(judge_, {row.metric: row.value for row in rows})
    return [*rows, *_vanished(judge_, {row.metric for row in rows})]


def _outside_of_clocks(judge_: Judge, entry: Entry) -> Iterator[Verdict]:
    """Say which times and steps that a run reports are not those that were seen from outside."""
    if entry.clock is None or entry.run is None:
        return
    for value, why in mistimed(entry.clock, entry.run, entry.took_s):
        yield judge_.row("time (control)", value, "s", Word.OUTSIDE, why, tier="")
    for value, wanted, why in miscounted(judge_.case, entry.settings, entry.clock.run):
        yield judge_.row("steps (control)", value, "1", Word.OUTSIDE, why, expected=float(wanted), tier="")


def _outside_of_momenta(judge_: Judge, run: Trajectory) -> Iterator[Verdict]:
    """Say that forces did not act when the run says."""
    try:
        with np.errstate(all="ignore"):  # a run that failed may end where squares overflow
            found = list(misacting(judge_.case, judge_.entry.settings, before(run, judge_.truth.trusted)))
    except np.linalg.LinAlgError:  # where masses vanish nothing tells what forces did
        return
    for value, why in found:
        yield judge_.row("impulses (control)", value, "1", Word.OUTSIDE, why, tier="")


def measured(case: Case, entry: Entry, truth: Truth) -> dict[str, float]:
    """Metric -> deviation of every number of a run, judged or not, to be stored; NaN for one that it does not have.

    The audit is stored beside them and does not stand before them: what is known of an engine is
    not known yet.
    """
    rows = verdicts(case, replace(entry, audit=()), truth, "")
    claims = {claim.metric: claim for claim in case.claims}
    found = {
        row.metric: deviation(row.value, claims.get(row.metric))
        for row in rows
        if row.metric not in ("finished", "settings", "audit", *PART_ROWS)
    }
    return found | {f"audit {row.quantity}": row.difference for row in entry.audit if not row.ok}


def finished(judge_: Judge, run: Trajectory) -> Verdict:
    """Whether the run reached its horizon: if not it is outside with the advice, whatever it says."""
    t_end = min(judge_.case.t_end, judge_.entry.until)
    end = float(run.t[-1]) if len(run.t) else 0.0
    if not run.outcome.ok:
        told = "" if run.outcome.advice in run.message else run.outcome.advice
        why = " ".join(text for text in (f"{run.outcome.value}:", run.message, told) if text)
    elif abs(end - t_end) <= REACHED * t_end:
        short = f"Run to {t_end:.4g} s: behind that the truth is not known, and more takes longer than --budget allows."
        why = short if t_end < judge_.case.t_end else ""
        return judge_.row("finished", 1.0, "1", Word.WITHIN, why, expected=1.0, limit=0.0)
    else:
        why = f"It reports that it finished, but its record ends at t = {end:.9g} s instead of {t_end:.9g} s."
    return judge_.row("finished", 0.0, "1", Word.OUTSIDE, why, expected=1.0, limit=0.0)


def _defaults(judge_: Judge) -> Iterator[Verdict]:
    """An engine's own settings that are not those of the stored run: nothing stored judges it any more."""
    was, now = defaults(judge_.case, judge_.entry), words(judge_.entry.settings)
    if judge_.entry.default and was and was != now:
        changed = ", ".join(sorted(set(was.split()) ^ set(now.split())))
        why = (
            f"Its own settings are not those of the stored run ({changed}); if the change is intended, run make bands."
        )
        yield judge_.row("settings", math.nan, "", Word.OUTSIDE, why, tier="")


def audited(judge_: Judge) -> Verdict:
    """A failed audit is a result, not a comparison: unless it is a known property, no metric follows it."""
    failed = [row for row in judge_.entry.audit if not row.ok]
    shown = [row for row in judge_.entry.audit if not math.isnan(row.difference)]
    limit = judge_.limit("audit")
    if not failed:
        word, why = Word.WITHIN, "the same physics as the reference"
    elif limit is not None and limit.known and all(_is_known(judge_, limit, row) for row in failed):
        word, why = Word.EXPECTED, limit.known
    else:
        word, why = Word.OUTSIDE, "Not compared: " + ", ".join(row.quantity for row in failed) + " differ."
    worst = max(failed or shown, key=lambda row: row.difference / max(row.tolerance, TINY), default=None)
    value, tolerance = (worst.difference, worst.tolerance) if worst else (0.0, judge_.entry.audit[0].tolerance)
    return judge_.row("audit", value, "1", word, why, limit=tolerance, tier="")


def _is_known(judge_: Judge, limit: Limit, row: AuditRow) -> bool:
    """Whether a stored run differed in the same quantity by as much.

    With other parameters or settings than any stored run's the size is not known: the quantity alone must be.
    """
    name = f"audit {row.quantity}"
    if not judge_.stored:
        return name in differing(judge_.case, judge_.entry)
    stored = judge_.stored.get(name, 0.0)
    sizes = explained(limit, stored)
    return stored == row.difference or (sizes is not None and sizes[0] <= row.difference <= sizes[1])


def crash(error: BaseException) -> str:
    """What was thrown, and where, unless it says itself what would be valid."""
    if isinstance(error, CrossbodyError):
        return f"{type(error).__name__}: {error}"
    place = "".join(traceback.format_tb(error.__traceback__)[-1:]).strip().splitlines()[0]
    return f"{type(error).__name__}: {error} ({place})"


def _measured(judge_: Judge, run: Trajectory, truth: Truth) -> Iterator[Verdict]:
    """A row for every metric that says something; one that throws is a row too."""
    for name, metric in metrics.of(judge_.case).items():
        wanted = name in judge_.claims or judge_.limit(name) is not None
        if metric.CLAIMED and not wanted:
            continue
        label = f"{judge_.case.label}: {name} of {judge_.entry.engine}:{judge_.entry.profile}"
        try:
            if why := judge_.begin(label):
                raise CaseUnsupported(why)
            found = _row(judge_, metric, name, wanted, truth, run)
        except (Exception, SystemExit) as error:
            found = judge_.row(name, math.nan, metric.UNIT, Word.CRASHED, crash(error))
        if found is not None:
            yield found
            yield from _unbounded(judge_, found)


TIMES = 5.0
"""How many times as large, and as small, a number expected-outside must not be."""


def _unbounded(judge_: Judge, found: Verdict) -> Iterator[Verdict]:
    """Say that what is expected-outside passes in any size, where its size is that of a stored run."""
    limit, claim, stored = judge_.limit(found.metric), judge_.claims.get(found.metric), judge_.stored.get(found.metric)
    if found.verdict != Word.EXPECTED or stored is None or limit is None or limit.known_least > 0.0 or judge_.hides():
        return
    expected = 0.0 if claim is None else claim.expected
    for times in (TIMES, 1.0 / TIMES):
        value = expected + times * deviation(found.value, claim)
        row = judge_.judged(found.metric, value, found.unit, judge_.truth, found.compared)
        if row.verdict != Word.OUTSIDE and deviation(value, claim) > limit.value:
            why = f"A control passes: {times:g} times what is expected-outside is no number outside."
            yield replace(row, metric=f"{found.metric} (control)", verdict=Word.OUTSIDE, why=why)


def _vanished(judge_: Judge, shown: Set[str]) -> Iterator[Verdict]:
    """A number that the stored run of the same parameters and settings has, and this one is not asked for."""
    for name, value in judge_.stored.items():
        if math.isfinite(value) and not name.startswith((LARGEST, "audit ")) and name not in shown:
            yield judge_.row(name, math.nan, "", Word.OUTSIDE, "The stored run of the same parameters has this number.")


def _row(
    judge_: Judge, metric: metrics.Metric, name: str, wanted: bool, truth: Truth, run: Trajectory
) -> Verdict | None:
    """What is said of one metric; None where nothing is."""
    value, compared = value_of(metric, name, truth, run, judge_.case)
    needs = getattr(metric, "NEEDS", "")
    excused = value is not None and math.isnan(value) and needs != "" and (needs in judge_.entry.hidden or not wanted)
    if value is not None and not excused:
        found = judge_.judged(name, float(value), metric.UNIT, truth, compared)
        return replace(found, where=getattr(value, "where", "") if math.isfinite(value) else "")
    if name in judge_.claims:
        return judge_.missing(name, metric.UNIT, "The run does not tell it.", needs)
    if wanted and metric.measure(truth, truth.trajectory, judge_.case) is not None:
        return judge_.missing(name, metric.UNIT, LACKS, needs)
    return None


def value_of(
    metric: metrics.Metric, name: str, truth: Truth, run: Trajectory, case: Case
) -> tuple[float | None, float]:
    """The number, and the part of the horizon over which the run and the truth were asked for it, or it is trusted."""
    until, used = [truth.trusted], list[float]()

    def at(times: Floats) -> Trajectory:
        until.append(float(times[-1]) if len(times) else 0.0)
        return truth.at(times)

    value = metric.measure(replace(truth, at=at, used=used.append), run, case)
    if value is not None:
        instance(f"What measure of {name!r} returns", value, Real, "a number, NaN or None")
    return value, min(min([truth.trusted, used[-1]] if used else until) / case.t_end, 1.0)


def _split(judge_: Judge, wholes: Mapping[str, float]) -> Iterator[Verdict]:
    """How much of the worst error is importer's, model's and step's, and the largest of each anywhere.

    Args:
        judge_: of the run.
        wholes: its errors, by metric, as these measure them.
    """
    entry = judge_.entry
    if entry.run is None or (entry.study is None and entry.own is None):
        return
    try:
        found = splits(judge_.case, judge_.truth, entry.run, entry.study or Study(), entry.own)
    except (Exception, SystemExit) as error:
        yield judge_.row(part_of("position", "step"), math.nan, "1", Word.CRASHED, crash(error))
        return
    for name, parts in found.items():
        yield from (row for part in PARTS for row in _part(judge_, name, part, parts, metrics.load(name).UNIT))
        yield from _unlike(judge_, name, parts, wholes.get(name, math.nan))


def _unlike(judge_: Judge, name: str, found: Split, whole: float) -> Iterator[Verdict]:
    """What parts add up to, where that is not the whole error: other code separates them.

    Parts of instants may be more, where what brings an event about comes near zero slowly (`measuring.instants`).
    """
    own, total = judge_.entry.own, sum(found.there.values())
    shorter = found.shorter or (own is not None and own.trusted < judge_.truth.trusted)
    off = whole - total if name == "event_times" else abs(total - whole)
    if shorter or "model" not in found.there or not off > SUM * abs(whole) + ROUNDING:
        return
    why = f"All parts of an error of {whole:.3g} at its worst place add up to {total:.3g}."
    yield judge_.row(f"{name} (parts)", total, metrics.load(name).UNIT, Word.OUTSIDE, why, limit=SUM)


def _part(judge_: Judge, name: str, part: str, found: Split, unit: str) -> Iterator[Verdict]:
    row = part_of(name, part)
    if part in found.missing:
        yield judge_.row(row, math.nan, unit, Word.INFO, f"{NOT_MEASURED}{found.missing[part]}")
    if part not in found.there:
        return
    why = f"Part of the error of {found.where}. {found.says if part != 'importer' else ''}".strip()
    known = found.known[part]
    yield judge_.row(row, found.there[part], unit, Word.INFO, why, known=known)
    against = judge_.truth if part != "step" or judge_.entry.own is None else judge_.entry.own
    yield replace(judge_.judged(f"{LARGEST} {row}", found.largest[part], unit, against, 1.0), known=known)
