"""Runs of one case against its truth: one tidy table."""

from __future__ import annotations

import math
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from numbers import Real
from typing import TYPE_CHECKING, Any

from crossbody import cases, engines
from crossbody.cases import (
    Case,
    CaseUnsupported,
    Claim,
    CrossbodyError,
    InvalidValue,
    Limit,
    Outcome,
    Trajectory,
    UnknownName,
)
from crossbody.cases.arguments import instance, shown
from crossbody.cases.arrays import Floats
from crossbody.cases.defaults import TOLERANCE, limits_of
from crossbody.engines import Run
from crossbody.reports import metrics
from crossbody.reports.judging.audit import AuditRow
from crossbody.reports.judging.parts import PARTS, SPLIT, Split, Study, part_of, splits
from crossbody.reports.judging.stored import (
    SAME_END,
    Deviations,
    changed,
    compared_until,
    defaults,
    deviations,
    differing,
    judged_alike,
    lacking,
    words,
)
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.verdict import (
    COLUMNS,
    IDENTITIES,
    ROUNDING,
    Regression,
    Verdict,
    Word,
    as_stored,
    band,
    deviation,
    exit_code,
    explained,
    judge,
    limit_for,
)  # fmt: skip
from crossbody.reports.measuring.alignment import instants
from crossbody.reports.measuring.truth import TRUTH, Truth, before, shortened

if TYPE_CHECKING:
    import pandas as pd

    from crossbody.reports.judging.controls import Blind

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
EXACT = IDENTITIES - GROWING | {"energy_residual", "gap_residual"}
"""Metrics of a run against itself: neither a tolerance nor a horizon widens their limits."""
SUM = 1e-9
"""To which part of it the parts of an error add up to it."""
LARGEST = "largest"
"""Before the name of a part: its largest anywhere, which may have a limit; without, its share of the worst error."""
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
        stepped: ends of the run's own steps, s, where `run` was asked for other instants; None
            where they are its own.
        own: truth of the equations that the engine really integrates; None where they are the case's own.
        hidden: what this engine does not show, and why (`crossbody.engines.hidden`).
        crashed: what it threw, where it did not come back with an outcome.
        took_s: what all of that took, s: preparation and the runs that tell the parts of its error too,
            compilation aside.
    """

    engine: str
    profile: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    default: bool = False
    run: Trajectory | None = None
    skipped: str = ""
    audit: tuple[AuditRow, ...] = ()
    study: Study | None = None
    stepped: Floats | None = None
    own: Truth | None = None
    hidden: Mapping[str, str] = field(default_factory=dict)
    crashed: str = ""
    took_s: float = 0.0


JUDGED = Entry(engine="reference", profile="compiled")
"""As whose the numbers of controls are judged: no known property explains its errors."""
FAR = 1e12
"""How many times its own horizon, and an error of its start, limits are asked to grow with."""
UNLIMITED = ("creep_speed", "lam_error", "lam_impulse")
"""Metrics that controls look at, and that are limited in some cases only."""


def compare(
    case: Case, runs: Sequence[Entry | Run], truth: Truth | None = None, command: str = "crossbody run"
) -> pd.DataFrame:
    """Judge runs of one case.

    Args:
        case: with its claims and limits.
        runs: entries, or prepared runs of engines, which are run here.
        truth: what they are judged against; the best that the case has, if not given.
        command: what reproduces the table, for its rows.

    Returns:
        One row per run and metric, and one for the truth, columns as in `Verdict`.

    Raises:
        UnknownName: if a claim or limit names a metric that does not exist.
    """
    instance("case", case, Case, "a Case, as crossbody.cases.load returns it")
    if truth is not None:
        instance("truth", truth, Truth, "a Truth, as crossbody.reports.truth_of returns it")
    instance("command", command, str, "a text")
    if not isinstance(runs, Sequence):
        raise InvalidValue(f"runs is {shown(runs)}; it must be a list of prepared runs.")
    for run in runs:
        if not isinstance(run, (Entry, Run)):
            raise InvalidValue(f"runs holds {shown(run)}; each must be what an engine's prepare returns, or an Entry.")
    truth = truth_of(case) if truth is None else truth
    entries = [_entry(run) for run in runs]
    import pandas as pd

    rows = [row.row() for row in judged(case, entries, truth, command)]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def unguarded(_label: str) -> str:
    """Let a metric take as long as it likes."""
    return ""


def judged(
    case: Case, entries: Sequence[Entry], truth: Truth, command: str, begin: Callable[[str], str] = unguarded
) -> list[Verdict]:
    """Every row of one case: of every run, the truth's own, and a word on claims that judged nothing.

    `begin` is told what each metric is before it is measured, and returns why it is not to be; nothing if it is.
    """
    check_names(case)
    truth.expect(instants(truth, [entry.run for entry in entries if entry.run is not None]))
    trusted = shortened(truth)
    rows = [row for entry in entries for row in verdicts(case, entry, trusted, command, begin)]
    return [
        *rows,
        *truth_row(case, truth, command),
        *_idle(case, rows, command),
        *_blind(case, trusted, command),
    ]


PART_ROWS = tuple(part_of(metric, part) for metric in SPLIT for part in PARTS)
LARGEST_PARTS = tuple(f"{LARGEST} {name}" for name in PART_ROWS)


def judges_parts(case: Case, engine: str, profile: str) -> bool:
    """Whether a limit asks for a part of the error of an engine."""
    return any(limit_for(limits_of(case), name, engine, profile) is not None for name in LARGEST_PARTS)


def check_names(case: Case) -> None:
    """Say which names in claims and limits do not exist.

    Raises:
        UnknownName: for a metric or an engine that does not exist; the valid ones are listed.
        InvalidValue: for a limit that is negative or not a number, and for a metric with the name of another.
    """
    known = {*metrics.of(case), "audit", "*", *LARGEST_PARTS}
    for kind, named in (("claims", case.claims), ("limits", case.limits)):
        for name in (each.metric for each in named):
            if name not in known:
                raise UnknownName(f"metric (in {kind} of {case.label})", name, known)
    installed = {*engines.names(), *engines.REGISTRY.own()}
    for limit in case.limits:
        if limit.engine not in ("*", *installed):
            raise UnknownName(f"engine (in limits of {case.label})", limit.engine, installed)
        if not (limit.value >= 0.0 and limit.known_size >= limit.known_least >= 0.0):
            raise InvalidValue(f"{case.label}: the limit of {limit.metric} is {limit.value}; it must be at least 0.")


def _entry(run: Entry | Run) -> Entry:
    if isinstance(run, Entry):
        return run
    hidden = engines.load(run.engine).hidden_in(run.profile) if run.engine in engines.names() else {}
    return Entry(engine=run.engine, profile=run.profile, settings=run.settings, run=run.run(), hidden=hidden)


def truth_row(case: Case, truth: Truth, command: str) -> list[Verdict]:
    """Whether the sources of a truth agree as far as they must; none for a truth that has one source and was given.

    One that is known less far than when runs were stored is worse than it was.
    """
    if math.isnan(truth.allowed):
        return []
    known = case.chaos or truth.horizon
    until = case.t_end if known is None else min(known.until, case.t_end)
    value = max(truth.agreement.get("position", math.inf), truth.agreement.get("event_times", 0.0) / case.t_end)
    short = truth.trusted < until
    told = [] if known is None else [f"Known up to {until:.4g} s: {known.why}."]
    told.append(f"{truth.source}.")
    if many := truth.trajectory.counts.get("not_searched", 0):
        told.append(
            f"At {many} instant{'s' * (many > 1)} too many contacts could change to search for a second motion."
        )
    if short:
        told.append(f"It must be trusted to {until:.4g} s.")
    if truth.part < 1.0:
        asked = case.t_end / truth.part
        told.append(f"Followed to {case.t_end:.4g} s of {asked:.4g} s: {truth.short}.")
    if lost := shortened(truth).trusted < compared_until(case) - SAME_END * case.t_end:
        told.append(f"The stored runs were compared up to {compared_until(case):.4g} s.")
    return [Verdict(
        case=case.name, variant=case.variant, engine=TRUTH, profile="", metric=TRUTH, value=value, unit="1",
        limit=truth.allowed, tier=truth.tier.value, why=" ".join(told), command=command,
        verdict=Word.WITHIN if value <= truth.allowed and not short else Word.OUTSIDE,
        regression=Regression.LOST if lost else "",
        compared=truth.part * min(truth.trusted / case.t_end, 1.0),
    )]  # fmt: skip


def _idle(case: Case, rows: Sequence[Verdict], command: str) -> Iterator[Verdict]:
    """A claim that judged no run, although some were compared."""
    seen = {row.metric for row in rows}
    if not any(row.metric == "position" for row in rows):
        return
    for claim in case.claims:
        if claim.metric not in seen:
            why = f"No run was judged by the claim: {claim.source}."
            yield _of_truth(
                case, f"{claim.metric} (claim)", why, command, tier=claim.tier.value, expected=claim.expected
            )


def unlike_stored(case: Case, command: str) -> Iterator[Verdict]:
    """Yield a row of a case by name whose limits or claims are others than its stored runs were judged by."""
    if not judged_alike(case):
        why = "Limits or claims are not those of the stored runs; if the change is intended, run make bands."
        yield _of_truth(case, "limits", why, command, tier="")


def _of_truth(case: Case, metric: str, why: str, command: str, **more: Any) -> Verdict:
    """Return a row that is outside of no run: no metric has its name, so that nobody looks for one."""
    said: dict[str, Any] = {"value": math.nan, "verdict": Word.OUTSIDE, "tier": ""} | more
    return Verdict(
        case=case.name, variant=case.variant, engine=TRUTH, profile="", metric=metric, unit="", command=command,
        why=why, **said,
    )  # fmt: skip


def _blind(case: Case, truth: Truth, command: str) -> Iterator[Verdict]:
    """Say which metric, or the audit, does not see a fault that was put into what it looks at, or lets it pass."""
    from crossbody.reports.judging.controls import unheard, unseen  # with numba, which pages do without
    from crossbody.reports.judging.planted import PART

    near = _Judge(case, JUDGED, truth, command)
    far = _Judge(case, JUDGED, replace(truth, grows=FAR), command)
    far.longer = FAR

    def outside(name: str, value: float) -> bool:
        rows = [near.judged(name, off, "", truth, 1.0) for off in (value, -value)]
        unit = metrics.load(name).UNIT
        if unit in ("1", "s") and near.longer == 1.0:  # other units have caps in their own
            rows.append(far.judged(name, value if unit == "1" else PART * case.t_end, "", truth, 1.0))
        if name == "position" and not math.isnan(truth.allowed):  # another source that is off so much is no witness
            rows += truth_row(case, replace(truth, agreement={name: value}), command)
        return all(row.verdict == Word.OUTSIDE for row in rows) or _lets_pass(case, name, value)

    for name, value, (least, most), fault in (*unseen(case, truth, outside), *unheard(case), *_unruled(case)):
        if least <= value <= most:
            why = f"A control passes: {fault} is no number outside."
        else:
            why = f"A control is not seen as it is: {fault} must come out between {least:.3g} and {most:.3g}."
        yield _of_truth(case, f"{name} (control)", why, command, tier=truth.tier.value, value=value)
    for name, fault in _unsaid(near):
        word = next((one for one in WRONG if exit_code([one])), Word.OUTSIDE)
        yield _of_truth(case, f"{name} (control)", f"A control passes: {fault}.", command, verdict=word)


WRONG = (Word.OUTSIDE, Word.CRASHED)
BESIDE = 1e-3
"""Part of a limit by which a number is beside it."""
HALF = 0.5


def _unsaid(judge_: _Judge) -> Iterator[tuple[str, str]]:
    """Yield what a judge does not say of runs and numbers of which it is known what must be said."""
    yield from _unsaid_of_limits(judge_)
    truth, run, entry = judge_.truth, judge_.truth.trajectory, judge_.entry
    for word in Word:
        if exit_code([Word.WITHIN, word]) != int(word in WRONG):
            yield "exit code", f"it does not tell {word} as it must"
    if exit_code([Word.WITHIN], [Regression.KEPT]) or not exit_code([Word.WITHIN], [Regression.KEPT, Regression.LOST]):
        yield "exit code", "it does not tell what was lost"
    for wanted, told in ((Word.CRASHED, {"crashed": "a fault"}), (Word.SKIPPED, {"skipped": "a reason"})):
        rows = verdicts(judge_.case, replace(entry, **told), truth, "")  # type: ignore[arg-type]
        if [row.verdict for row in rows] != [wanted]:
            yield "run", f"one that is {wanted} is not"
    short = before(run, HALF * float(run.t[-1]))
    if _outcome(judge_, replace(short, outcome=Outcome.FINISHED)).verdict != Word.OUTSIDE:
        yield "finished", "a run that ends halfway is not outside"
    if _outcome(judge_, replace(run, outcome=Outcome.TIME_LIMIT)).verdict != Word.OUTSIDE:
        yield "finished", "a run that says that it did not finish is not outside"
    off = AuditRow(quantity="masses", mine="", theirs="", difference=BESIDE, tolerance=0.0)
    same = replace(off, difference=0.0)
    found = [_audit(_of(judge_, audit=rows)).verdict for rows in ((same, off), (off, same), (same, same))]
    if found != [Word.OUTSIDE, Word.OUTSIDE, Word.WITHIN]:
        yield "audit", "other masses are not outside, or the same are"
    known = replace(truth, at=lambda times: before(run, float(times[-1])) if len(times) else run)
    compared = [_value(_Last(), "position", known, one, judge_.case)[1] * judge_.case.t_end for one in (short, run)]
    if any(
        abs(a - min(float(b.t[-1]), truth.trusted)) > REACHED * judge_.case.t_end
        for a, b in zip(compared, (short, run), strict=True)
    ):
        yield "compared", "it is not the part of the horizon for which the truth was asked"


class _Last:
    """A metric that asks for the truth at the end of a run."""

    UNIT, CLAIMED = "1", False

    def measure(self, truth: Truth, run: Trajectory, case: Case) -> float | None:
        """Return nothing of it."""
        truth.at(run.t)
        return 0.0


def _of(judge_: _Judge, **more: Any) -> _Judge:
    """Return a judge of another entry."""
    return _Judge(judge_.case, replace(judge_.entry, **more), judge_.truth, "")


def _unsaid_of_limits(judge_: _Judge) -> Iterator[tuple[str, str]]:
    """Yield limits of which numbers on either side, or none, are not said to be so."""
    for name in dict.fromkeys([*judge_.claims, *(limit.metric for limit in judge_.limits)]):
        claim, limit = judge_.claims.get(name), judge_.limit(name)
        if name in ("*", "audit") or (limit is None and claim is None) or (limit is not None and limit.known):
            continue
        expected, most = 0.0 if claim is None else claim.expected, 0.0 if limit is None else limit.value
        beside = BESIDE * (most or abs(expected) or 1.0)
        wanted = [(expected + sign * (most + beside), Word.OUTSIDE) for sign in (1.0, -1.0)]
        wanted += [(expected + sign * (most - beside), Word.WITHIN) for sign in (1.0, -1.0) if most > 0.0]
        wanted += [(sign * math.inf, Word.OUTSIDE) for sign in (1.0, -1.0)] + [(math.nan, Word.OUTSIDE)]
        wanted += [(-expected, Word.OUTSIDE)] if abs(expected) > most else []
        for value, word in wanted:
            if (found := judge_.judged(name, value, "", judge_.truth, 1.0).verdict) != word:
                yield name, f"{value:g} is {found}, but must be {word}"
                break
        if judge_.missing(name, "", "", "").verdict != Word.OUTSIDE:
            yield name, "a number that lacks is not outside"


def _unruled(case: Case) -> Iterator[Blind]:
    """Yield limits of a case that do not judge engines of which it says nothing else."""
    own = {limit.metric: limit for limit in case.limits if (limit.engine, limit.profile) == ("*", "*")}
    for name, limit in own.items():
        found = limit_for(limits_of(case), name, "", "")
        value = math.nan if found is None else found.value
        if value != limit.value:
            yield name, value, (limit.value, limit.value), "the limit of the case"


def _lets_pass(case: Case, name: str, value: float) -> bool:
    """Whether a case leaves a number unlimited, or one of one's own limits it so widely that faults pass."""
    of_its_own = math.isnan(compared_until(case)) and not changed(case)
    own = [limit for limit in case.limits if limit.metric == name and limit.covers(JUDGED.engine, JUDGED.profile)]
    return name in UNLIMITED or (of_its_own and any(value <= limit.value or limit.known for limit in own))


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


class _Judge:
    """Fills in what all rows of one run share."""

    def __init__(
        self, case: Case, entry: Entry, truth: Truth, command: str, begin: Callable[[str], str] = unguarded
    ) -> None:
        self.begin = begin
        self.case, self.entry, self.truth = case, entry, truth
        self.claims: Mapping[str, Claim] = {claim.metric: claim for claim in case.claims}
        self.limits = limits_of(case)
        self.stored: Deviations = deviations(case, entry, truth.trusted)
        self.looser, self.longer = looser(case, entry), longer(case)
        self.command = f"{command} --engine {entry.engine}:{entry.profile}"

    def limit(self, metric: str) -> Limit | None:
        """The limit that judges this run: wider as errors grow and tolerances do, while a fault of a per cent shows.

        Those of a case are for its own horizon: each step adds as much.
        """
        found = limit_for(self.limits, metric, self.entry.engine, self.entry.profile)
        if found is None or metric in EXACT:
            return found
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

    def told(self, metric: str, word: Word, why: str) -> tuple[Word, str]:
        """What is said of a number: one outside is not judged where a tolerance was asked for that hides any fault."""
        stands = metric in EXACT or metric == "law_residual"
        if word is Word.OUTSIDE and metric == "rate_residual" and self.looser > 1.0:
            return Word.INFO, "At the requested tolerance its samples are too far apart."
        if word is not Word.OUTSIDE or stands or not self.hides():
            return word, why
        return Word.INFO, "The requested tolerance allows errors as large as those of a fault."

    def row(self, metric: str, value: float, unit: str, verdict: Word, why: str, **more: Any) -> Verdict:
        return Verdict(
            case=self.case.name, variant=self.case.variant, engine=self.entry.engine,
            profile=self.entry.profile, metric=metric, value=value, unit=unit, verdict=verdict,
            why=why, command=self.command, settings=words(self.entry.settings),
            **({"tier": self.truth.tier.value} | more),
        )  # fmt: skip

    def judged(self, metric: str, value: float, unit: str, against: Truth, compared: float) -> Verdict:
        """One number: its word by physics and method, and by the stored run."""
        claim, limit, stored = self.claims.get(metric), self.limit(metric), self.stored.get(metric)
        word, why = judge(value, limit, claim, stored)
        if math.isfinite(value):
            word, why = self.told(metric, word, why)
        if word is Word.INFO and limit is None:
            shown = limit_for(self.limits, "*", self.entry.engine, self.entry.profile)
            word, why = as_stored(value, shown, stored)
        known = self.case.chaos or self.truth.horizon
        until = 1.0 if known is None else min(1.0, known.until / self.case.t_end)
        if compared < FLOOR * until and (word is Word.WITHIN or (word is Word.EXPECTED and stored is None)):
            word, why = Word.INFO, f"Compared over {compared:.2%} of the horizon only: {against.source}"
        most = band(stored, limit, claim)
        kept = Regression.KEPT if deviation(value, claim) <= most else Regression.LOST
        return self.row(
            metric, value, unit, word, why or (against.source if against is not self.truth else ""),
            expected=math.nan if claim is None else claim.expected,
            limit=limit.value if limit else math.nan if claim is None else 0.0,
            tier=against.tier.value if claim is None else claim.tier.value,
            compared=compared, band=most, regression="" if math.isnan(most) else kept,
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
    judge_ = _Judge(case, entry, truth, command, begin)
    if entry.crashed:
        return [judge_.row("run", math.nan, "", Word.CRASHED, entry.crashed)]
    if entry.run is None:
        return [judge_.row("run", math.nan, "", Word.SKIPPED, entry.skipped)]
    rows = [_outcome(judge_, entry.run), *_defaults(judge_)]
    if entry.audit:
        rows.append(_audit(judge_))
        if rows[-1].verdict == Word.OUTSIDE:
            return rows
    if not len(entry.run.t):
        return rows
    run = before(entry.run, truth.trusted) if truth.trusted < entry.run.t[-1] else entry.run
    rows += _measured(judge_, run, truth)
    rows += _split(judge_, {row.metric: row.value for row in rows})
    return [*rows, *_vanished(judge_, {row.metric for row in rows})]


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


def _outcome(judge_: _Judge, run: Trajectory) -> Verdict:
    """Whether the run reached its horizon: if not it is outside with the advice, whatever it says."""
    t_end = judge_.case.t_end
    end = float(run.t[-1]) if len(run.t) else 0.0
    if not run.outcome.ok:
        told = "" if run.outcome.advice in run.message else run.outcome.advice
        why = " ".join(text for text in (f"{run.outcome.value}:", run.message, told) if text)
    elif abs(end - t_end) <= REACHED * t_end:
        return judge_.row("finished", 1.0, "1", Word.WITHIN, "", expected=1.0, limit=0.0)
    else:
        why = f"It reports that it finished, but its record ends at t = {end:.9g} s instead of {t_end:.9g} s."
    return judge_.row("finished", 0.0, "1", Word.OUTSIDE, why, expected=1.0, limit=0.0)


def _defaults(judge_: _Judge) -> Iterator[Verdict]:
    """An engine's own settings that are not those of the stored run: nothing stored judges it any more."""
    was, now = defaults(judge_.case, judge_.entry), words(judge_.entry.settings)
    if judge_.entry.default and was and was != now:
        changed = ", ".join(sorted(set(was.split()) ^ set(now.split())))
        why = (
            f"Its own settings are not those of the stored run ({changed}); if the change is intended, run make bands."
        )
        yield judge_.row("settings", math.nan, "", Word.OUTSIDE, why, tier="")


def _audit(judge_: _Judge) -> Verdict:
    """A failed audit is a result, not a comparison: unless it is a known property, no metric follows it."""
    failed = [row for row in judge_.entry.audit if not row.ok]
    shown = [row.difference for row in judge_.entry.audit if not math.isnan(row.difference)]
    limit = judge_.limit("audit")
    if not failed:
        word, why = Word.WITHIN, "the same physics as the reference"
    elif limit is not None and limit.known and all(_is_known(judge_, limit, row) for row in failed):
        word, why = Word.EXPECTED, limit.known
    else:
        word, why = Word.OUTSIDE, "Not compared: " + ", ".join(row.quantity for row in failed) + " differ."
    worst = max(failed, key=lambda row: row.difference) if failed else None
    value = worst.difference if worst else max(shown, default=0.0)
    tolerance = worst.tolerance if worst else judge_.entry.audit[0].tolerance
    return judge_.row("audit", value, "1", word, why, limit=tolerance, tier="")


def _is_known(judge_: _Judge, limit: Limit, row: AuditRow) -> bool:
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


def _measured(judge_: _Judge, run: Trajectory, truth: Truth) -> Iterator[Verdict]:
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
"""How many times as large, and as small, a known deviation must not be."""


def _unbounded(judge_: _Judge, found: Verdict) -> Iterator[Verdict]:
    """Say that a known deviation passes in any size, where its size is that of a stored run."""
    limit, claim, stored = judge_.limit(found.metric), judge_.claims.get(found.metric), judge_.stored.get(found.metric)
    if found.verdict != Word.EXPECTED or stored is None or limit is None or limit.known_least > 0.0 or judge_.hides():
        return
    expected = 0.0 if claim is None else claim.expected
    for times in (TIMES, 1.0 / TIMES):
        value = expected + times * deviation(found.value, claim)
        row = judge_.judged(found.metric, value, found.unit, judge_.truth, found.compared)
        if row.verdict != Word.OUTSIDE and deviation(value, claim) > limit.value:
            why = f"A control passes: {times:g} times the known deviation is no number outside."
            yield replace(row, metric=f"{found.metric} (control)", verdict=Word.OUTSIDE, why=why)


def _vanished(judge_: _Judge, shown: Set[str]) -> Iterator[Verdict]:
    """A number that the stored run of the same parameters and settings has, and this one is not asked for."""
    for name, value in judge_.stored.items():
        if math.isfinite(value) and not name.startswith((LARGEST, "audit ")) and name not in shown:
            yield judge_.row(name, math.nan, "", Word.OUTSIDE, "The stored run of the same parameters has this number.")


def _row(
    judge_: _Judge, metric: metrics.Metric, name: str, wanted: bool, truth: Truth, run: Trajectory
) -> Verdict | None:
    """What is said of one metric; None where nothing is."""
    value, compared = _value(metric, name, truth, run, judge_.case)
    needs = getattr(metric, "NEEDS", "")
    excused = value is not None and math.isnan(value) and needs != "" and (needs in judge_.entry.hidden or not wanted)
    if value is not None and not excused:
        found = judge_.judged(name, value, metric.UNIT, truth, compared)
        place = getattr(metric, "where", None)
        beyond = found.verdict != Word.WITHIN and math.isfinite(value) and value > found.limit
        return replace(found, where=place(truth, run, judge_.case)) if place and beyond else found
    if name in judge_.claims:
        return judge_.missing(name, metric.UNIT, "There is no such number.", needs)
    if wanted and metric.measure(truth, truth.trajectory, judge_.case) is not None:
        return judge_.missing(name, metric.UNIT, "The run lacks this number, which the truth has.", needs)
    return None


def _value(metric: metrics.Metric, name: str, truth: Truth, run: Trajectory, case: Case) -> tuple[float | None, float]:
    """The number, and the part of the horizon over which the truth was asked for it, or is trusted."""
    until = [truth.trusted]

    def at(times: Floats) -> Trajectory:
        until.append(float(times[-1]) if len(times) else 0.0)
        return truth.at(times)

    value = metric.measure(replace(truth, at=at), run, case)
    if value is not None:
        value = float(instance(f"What measure of {name!r} returns", value, Real, "a number, NaN or None"))
    return value, min(min(until) / case.t_end, 1.0)


def _split(judge_: _Judge, wholes: Mapping[str, float]) -> Iterator[Verdict]:
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


def _unlike(judge_: _Judge, name: str, found: Split, whole: float) -> Iterator[Verdict]:
    """What parts add up to, where that is not the whole error: other code separates them.

    Parts of instants may be more, where what brings an event about comes near zero slowly (`measuring.instants`).
    """
    own, total = judge_.entry.own, sum(found.there.values())
    shorter = own is not None and own.trusted < judge_.truth.trusted
    off = whole - total if name == "event_times" else abs(total - whole)
    if shorter or "model" not in found.there or not off > SUM * abs(whole) + ROUNDING:
        return
    why = f"All parts of an error of {whole:.3g} at its worst place add up to {total:.3g}."
    yield judge_.row(f"{name} (parts)", total, metrics.load(name).UNIT, Word.OUTSIDE, why, limit=SUM)


def _part(judge_: _Judge, name: str, part: str, found: Split, unit: str) -> Iterator[Verdict]:
    row = part_of(name, part)
    if part in found.missing:
        yield judge_.row(row, math.nan, unit, Word.INFO, f"Not measured. {found.missing[part]}")
    if part not in found.there:
        return
    why = f"Part of the error of {found.where}. {found.says if part != 'importer' else ''}".strip()
    known = found.known[part]
    yield judge_.row(row, found.there[part], unit, Word.INFO, why, known=known)
    against = judge_.truth if part != "step" or judge_.entry.own is None else judge_.entry.own
    yield replace(judge_.judged(f"{LARGEST} {row}", found.largest[part], unit, against, 1.0), known=known)
