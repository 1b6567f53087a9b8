"""What a judge must say of runs and numbers of which the answer is known, asked in every run."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from crossbody.cases import Case, Outcome, Trajectory
from crossbody.cases.defaults import limits_of
from crossbody.reports import metrics
from crossbody.reports.judging.audit import AuditRow
from crossbody.reports.judging.run_verdicts import REACHED, WIDEST, Entry, Judge, audited, finished, value_of, verdicts
from crossbody.reports.judging.stored import changed, compared_until
from crossbody.reports.judging.truth import PARTED
from crossbody.reports.judging.truth_row import BESIDE_MOTION, of_truth, truth_row
from crossbody.reports.judging.verdict import Regression, Verdict, Word, exit_code, limit_for
from crossbody.reports.measuring.truth import Truth, before

if TYPE_CHECKING:
    from crossbody.reports.judging.controls import Blind

JUDGED = Entry(engine="reference", profile="compiled")
"""As whose the numbers of controls are judged: no known property explains its errors."""
FAR = 1e12
"""How many times its own horizon, and an error of its start, limits are asked to grow with."""
UNLIMITED = ("creep_speed", "lam_error", "lam_impulse")
"""Metrics that controls look at, and that are limited in some cases only."""


def blind(case: Case, truth: Truth, command: str, ran: Iterable[str] = ()) -> Iterator[Verdict]:
    """Say which metric, or the audit, does not see a fault that was put into what it looks at, or lets it pass."""
    from crossbody.reports.judging import known
    from crossbody.reports.judging.controls import unheard, unseen  # with numba, which pages do without
    from crossbody.reports.judging.planted_friction import unturned
    from crossbody.reports.judging.planting import PART

    near = Judge(case, JUDGED, truth, command)
    far = Judge(case, JUDGED, replace(truth, grows=FAR), command)
    far.longer = FAR

    def outside(name: str, value: float) -> bool:
        rows = [near.judged(name, off, "", truth, 1.0) for off in (value, -value)]
        unit = metrics.load(name).UNIT
        if unit in ("1", "s") and near.longer == 1.0:  # other units have caps in their own
            rows.append(far.judged(name, value if unit == "1" else PART * case.t_end, "", truth, 1.0))
        if name == "position" and not math.isnan(truth.allowed):  # another source that is off so much is no witness
            rows += truth_row(case, replace(truth, agreement={name: value}), command)
        return (
            all(row.verdict == Word.OUTSIDE for row in rows)
            or _lets_pass(case, name, value)
            or _grown(near, name, value)
            or name in near.untold
        )

    own = "" if case.file else case.name
    answers = known.wrong(file=bool(case.file), scene=not plain(case), ran=ran, case=own)
    for name, value, (least, most), fault in (*unseen(case, truth, outside), *unheard(case), *_unruled(case), *answers):
        if least <= value <= most:
            why = f"A control passes: {fault} is no number outside."
        else:
            why = f"A control is not seen as it is: {fault} must come out between {least:.3g} and {most:.3g}."
        yield of_truth(case, f"{name} (control)", why, command, tier=truth.tier.value, value=value)
    if unturned(case, truth.trajectory):
        why = "No control: nothing slides fast enough in this motion for its friction to be turned."
        yield of_truth(case, "friction_angle (control)", why, command, verdict=Word.INFO)
    for name, fault in _unsaid(near):
        word = next((one for one in WRONG if exit_code([one])), Word.OUTSIDE)
        yield of_truth(case, f"{name} (control)", f"A control passes: {fault}.", command, verdict=word)


def plain(case: Case) -> bool:
    """Whether a case has equations of its own, without friction, and nothing drives it."""
    driven = (case.control, case.inputs, case.force, case.gates, case.form)
    return case.scene is not None and not case.general and all(one is None for one in driven)


WRONG = (Word.OUTSIDE, Word.CRASHED)
TIMES = ("event_times", "mode_times", "slip_times", "stick_times")
"""Metrics of instants: a fault of one can be no larger than the time since anything happened before."""
BESIDE = 1e-3
"""Part of a limit by which a number is beside it."""
HALF = 0.5


def _unsaid(judge_: Judge) -> Iterator[tuple[str, str]]:
    """Yield what a judge does not say of runs and numbers of which it is known what must be said."""
    yield from _unsaid_of_limits(judge_)
    yield from _unsaid_by_exit_codes()
    yield from _unsaid_of_sources(judge_)
    yield from _unsaid_of_runs(judge_)
    yield from _unsaid_of_audits(judge_)


def _unsaid_by_exit_codes() -> Iterator[tuple[str, str]]:
    """Yield words that an exit code does not tell as it must."""
    for word in Word:
        if exit_code([Word.WITHIN, word]) != int(word in WRONG):
            yield "exit code", f"it does not tell {word} as it must"
    if exit_code([Word.WITHIN], [Regression.KEPT]) or not exit_code([Word.WITHIN], [Regression.KEPT, Regression.LOST]):
        yield "exit code", "it does not tell what was lost"


def _unsaid_of_sources(judge_: Judge) -> Iterator[tuple[str, str]]:
    """Yield in what the sources of a truth may differ without its row being outside."""
    truth = judge_.truth
    for name, unit in (("position", 1.0), ("event_times", judge_.case.t_end)):
        apart = {"position": 0.0, name: 2.0 * truth.allowed * unit}
        if any(row.verdict != Word.OUTSIDE for row in truth_row(judge_.case, replace(truth, agreement=apart), "")):
            yield "truth", f"sources whose {name} differ twice as much as they may are said to agree"
    others = {"modes": (1.0, "of which one has a row in another mode")}
    others |= {name: (2.0 * PARTED, f"of which one is off by {name}") for name in BESIDE_MOTION}
    for name, (off, which) in others.items():
        other = replace(truth, agreement={"position": 0.0, name: off})
        if any(row.verdict != Word.OUTSIDE for row in truth_row(judge_.case, other, "")):
            yield "truth", f"sources {which} are said to agree"


def _unsaid_of_audits(judge_: Judge) -> Iterator[tuple[str, str]]:
    """Yield what is not said of an audit that differs in its first row, its last, or none."""
    off = AuditRow(quantity="masses", mine="", theirs="", difference=BESIDE, tolerance=0.0)
    same = replace(off, difference=0.0)
    entries = [replace(judge_.entry, audit=rows) for rows in ((same, off), (off, same), (same, same))]
    found = [audited(Judge(judge_.case, one, judge_.truth, "")).verdict for one in entries]
    if found != [Word.OUTSIDE, Word.OUTSIDE, Word.WITHIN]:
        yield "audit", "other masses are not outside, or the same are"


def _unsaid_of_runs(judge_: Judge) -> Iterator[tuple[str, str]]:
    """Yield what is not said of runs that crashed, were skipped, end early, or are compared in part."""
    truth, run, entry = judge_.truth, judge_.truth.trajectory, judge_.entry
    for wanted, told in ((Word.CRASHED, {"crashed": "a fault"}), (Word.SKIPPED, {"skipped": "a reason"})):
        rows = verdicts(judge_.case, replace(entry, **told), truth, "")  # type: ignore[arg-type]
        if [row.verdict for row in rows] != [wanted]:
            yield "run", f"one that is {wanted} is not"
    short = before(run, HALF * float(run.t[-1]))
    if finished(judge_, replace(short, outcome=Outcome.FINISHED)).verdict != Word.OUTSIDE:
        yield "finished", "a run that ends halfway is not outside"
    if finished(judge_, replace(run, outcome=Outcome.TIME_LIMIT)).verdict != Word.OUTSIDE:
        yield "finished", "a run that says that it did not finish is not outside"
    known = replace(truth, at=lambda times: before(run, float(times[-1])) if len(times) else run)
    compared = [value_of(_Last(), "position", known, one, judge_.case)[1] * judge_.case.t_end for one in (short, run)]
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


def _unsaid_of_limits(judge_: Judge) -> Iterator[tuple[str, str]]:
    """Yield limits of which numbers on either side, or none, are not said to be so."""
    for name in dict.fromkeys([*judge_.claims, *(limit.metric for limit in judge_.limits)]):
        claim, limit = judge_.claims.get(name), judge_.limit(name)
        silent = (limit is None and claim is None) or (limit is not None and limit.known)
        if name in ("*", "audit") or silent:
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


def _grown(judge_: Judge, name: str, value: float) -> bool:
    """Whether a fault in time is no larger than what errors of the tolerance that limits are for grow to here.

    What a step adds to a speed goes on as long as the motion does: over a longer horizon than the case's own there are
    more steps, and more time behind each.
    """
    limit = limit_for(judge_.limits, name, JUDGED.engine, JUDGED.profile)
    grown = judge_.truth.grows * judge_.longer**2
    widest = WIDEST * min(judge_.case.t_end, 1.0)
    return name in TIMES and limit is not None and value <= min(limit.value * grown, widest)


def _lets_pass(case: Case, name: str, value: float) -> bool:
    """Whether a case leaves a number unlimited, or one of one's own limits it so widely that faults pass."""
    of_its_own = math.isnan(compared_until(case)) and not changed(case)
    own = [limit for limit in case.limits if limit.metric == name and limit.covers(JUDGED.engine, JUDGED.profile)]
    return name in UNLIMITED or (of_its_own and any(value <= limit.value or limit.known for limit in own))
