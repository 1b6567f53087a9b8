"""Which engine runs which case, and the running itself."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter, process_time
from typing import Any, TypeVar

import numpy as np

from crossbody import engines
from crossbody.cases import Case, CaseUnsupported, CrossbodyError, InvalidValue, Outcome, SceneError, Trajectory, Value
from crossbody.cases.arguments import instance
from crossbody.cases.errors import OwnFault
from crossbody.cases.public_names import TEXT, Public, check_values
from crossbody.reference import ahead
from crossbody.reference.compiling import count
from crossbody.reports.judging.audit import AuditRow, answered_once, audit, settings_kept
from crossbody.reports.judging.clocks import Clock
from crossbody.reports.judging.comparison import check_names, judges_parts
from crossbody.reports.judging.covered import followed_if_covered, refuse_uncovered
from crossbody.reports.judging.first_steps import first_steps
from crossbody.reports.judging.forces_of_scene import forces_of_scene
from crossbody.reports.judging.form_of_case import form_of_case
from crossbody.reports.judging.gaps_of_scene import gaps_of_scene
from crossbody.reports.judging.reach import BUDGET, estimated
from crossbody.reports.judging.run_verdicts import Entry, crash
from crossbody.reports.judging.steps_taken import runaway
from crossbody.reports.judging.truth import law_of, truth_of, with_both_sides
from crossbody.reports.judging.units_of_scene import units_of_scene
from crossbody.reports.measuring.truth import Truth, sample_times
from crossbody.reports.runs import watch
from crossbody.reports.runs.choice import (
    COMPILED,
    DEAR,
    Pick,
    bounded,
    check_known,
    of_case,
    of_pick,
    offered,
    with_bound,
)
from crossbody.reports.runs.refined import refined

TRUTHS = 3.0  # a truth may take so many times as long as a run: it is two of them, at tight tolerances
ENOUGH = 2000  # steps of a run that is drawn as it is
FIRST = 0.02  # part of its horizon by which a run of a scene is estimated
AHEAD, BEYOND = 0.05, 1.0
"""Part of the time for which a truth is known by which a run goes on behind it, and the time, in budgets, that it may
take from there to its horizon: nothing is compared there."""
_OF_RUNS = {"profile": TEXT, "settings": Public("a mapping from names to values", lambda one: isinstance(one, Mapping))}
_Kind = TypeVar("_Kind")


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseResult:
    """A case, its truth, and every run."""

    case: Case
    truth: Truth
    entries: tuple[Entry, ...]


def run_case(
    case: Case,
    wanted: Sequence[Pick],
    rtol: float | None = None,
    tell: Callable[[str], None] = lambda _: None,
    settings: Mapping[str, Value] | None = None,
    truth: Truth | None = None,
    limit: float = watch.LIMIT,
    refine: bool = True,
    budget: float = BUDGET,
) -> CaseResult:
    """Run a case on every engine asked for.

    Args:
        case: what is run.
        wanted: on which engines.
        rtol: tolerance for the engines that have one.
        tell: is told what is being done.
        settings: of the engines, by name; each takes those that it knows, and of those behind its
            own name and a dot ("mujoco.dt", "mujoco:matched.dt") all.
        truth: of the case, where it is known already.
        limit: time after which an engine that has not come back is ended with its process, s;
            from the command line.
        refine: whether the parts of errors are told even where no limit judges one.
        budget: time, s, that the tightest run of a scene may take: its motion is compared as far
            as it gets, and what else tells more is done where it takes some budgets at most.

    Raises:
        UnknownName: for a setting that none of them knows.
        InvalidValue: for samples, which are not the caller's to choose.
        CaseUnsupported: for a file whose motion leaves what its model covers: nothing could be judged.
    """
    asked = dict(settings or {}) | ({} if rtol is None else {"rtol": rtol})
    if "samples" in asked:
        raise InvalidValue("A judged run chooses its own samples by its events and motion: omit samples.")
    check_names(case)
    if not case.general:
        ahead.ask("SUNDIALS")
    label = f"{case.label}: truth"
    tell(label)
    watch.limited(label, TRUTHS * limit)
    started = _clock()
    if why := watch.lost(label):
        raise CaseUnsupported(f"{label} is not available. {why}")
    if truth is None and (reached := followed_if_covered(case, budget)) is not None:
        case, truth = reached.case, truth_of(reached.case, reached, budget)
    truth = truth_of(case) if truth is None else truth
    refuse_uncovered(case, truth.trajectory)
    if math.isfinite(truth.tight):
        case = replace(case, tight=truth.tight)
    known = "reference" in engines.names()
    reference = answered_once(engines.load("reference").prepare(case, "compiled").audit()) if known else {}
    entries = []
    for pick in (of_case(one, case) for one in wanted):
        label = f"{case.label}: {pick.engine}:{pick.profile}"
        tell(label)
        watch.limited(label, limit)
        why = watch.lost(label)
        began = _clock()
        made = partial(_entry, case, pick, of_pick(asked, pick), reference, refine, budget, truth)
        entry = ended(case, pick, why) if why else made()
        own = _own(case, pick, entry, settings or {})
        entries.append(replace(entry, took_s=_clock() - began, asked=own))
    watch.unlimited()
    if not (whole := sum(one.took_s for one in entries)) <= (passed := _clock() - started):
        raise OwnFault(f"Runs of {case.label} are said to have taken {whole:.3g} s of {passed:.3g} s.")
    check_known(settings or {}, [(one.engine, one.profile, one.settings) for one in entries if one.run is not None])
    return CaseResult(case=case, truth=truth, entries=tuple(entries))


def _own(case: Case, pick: Pick, entry: Entry, settings: Mapping[str, Value]) -> dict[str, Value]:
    """Return those of the settings that an engine was asked to take and has."""
    mine, known = of_pick(settings, pick), entry.settings
    if mine and not (known or pick.skipped):  # it did not get so far as to say which it used
        known = offered(case, pick) or {}
    return {name: value for name, value in mine.items() if name in known}


def _clock() -> float:
    """Time that stands still while code is compiled, s."""
    return perf_counter() - count.seconds


def ended(case: Case, pick: Pick, why: str) -> Entry:
    """The entry of a run that took its process with it."""
    return Entry(engine=pick.engine, profile=pick.profile, run=of_start(case, why), settings={})


def of_start(case: Case, why: str) -> Trajectory:
    """A run that got no further than its start, and why."""
    q, v, nothing = case.q0[None], case.v0[None], np.zeros((1, len(case.contacts)))
    return Trajectory(
        t=np.zeros(1), q=q, v=v, gap=nothing, lam=nothing, energy=np.zeros((1, 2)),
        mode=nothing.astype(np.int8) - 1, outcome=Outcome.TIME_LIMIT, message=why,
    )  # fmt: skip


def _entry(
    case: Case, pick: Pick, asked: Mapping[str, Value], reference: Mapping[str, Any], refine: bool, budget: float,
    truth: Truth,
) -> Entry:  # fmt: skip
    """The run of one engine; whatever it throws is a row, and the others are judged."""
    if pick.skipped:
        return Entry(engine=pick.engine, profile=pick.profile, skipped=pick.skipped)
    try:
        refine = refine or judges_parts(case, pick.engine, pick.profile)
        run = partial(_ran, pick=pick, asked=asked, reference=reference, refine=refine, budget=budget, truth=truth)
        return _as_far(case, pick, truth.trusted, run)
    except CaseUnsupported as error:
        return Entry(engine=pick.engine, profile=pick.profile, skipped=str(error))
    except CrossbodyError:  # wrong use of ours
        raise
    except (Exception, SystemExit) as error:
        return Entry(engine=pick.engine, profile=pick.profile, crashed=crash(error))


def _as_far(case: Case, pick: Pick, known: float, run: Callable[..., Entry]) -> Entry:
    """The run of one engine, not beyond the end of the truth where that costs too much: nothing is compared there.

    Args:
        case: the scene.
        pick: the engine.
        known: the end of the truth, s.
        run: runs a case, unless what is left, so many times as long, is cheap (`_CheapError`).
    """
    short = ahead_of(case, known) if bounded(case, pick) else case
    try:
        found = run(short, left=case.t_end / short.t_end - 1.0)
    except _CheapError:
        with suppress(CaseUnsupported):  # it may come to what takes long
            return run(case)
        found = run(short)
    return found if short is case else replace(found, until=short.t_end)


class _CheapError(Exception):
    """What is left of a run costs little."""


def ahead_of(case: Case, known: float) -> Case:
    """Return a scene up to a little behind the instant, s, to which its truth is known; as it is if to the end."""
    end = float(f"{(1.0 + AHEAD) * known:.2g}") if math.isfinite(known) else case.t_end
    return replace(case, t_end=end) if case.general and end < case.t_end else case


def _ran(
    case: Case, pick: Pick, asked: Mapping[str, Value], reference: Mapping[str, Any], refine: bool, budget: float,
    truth: Truth, left: float = 0.0,
) -> Entry:  # fmt: skip
    most = DEAR * budget
    if bounded(case, pick) and (done := _done_beside(pick, truth)):
        raise CaseUnsupported(done)
    if pick.every and (dear := _dear(case, pick, asked, most)):
        raise CaseUnsupported(dear)
    prepared = prepare(case, pick, with_bound(case, pick, asked, budget))
    if why := runaway(case, prepared.settings, lambda first, more: prepare(first, pick, {**asked, **more})):
        stopped = replace(of_start(case, why), outcome=Outcome.STEP_LIMIT)
        return Entry(engine=pick.engine, profile=pick.profile, settings=prepared.settings, run=stopped)
    shown = _of_engine(pick, "audit", prepared.audit(), Mapping, "a mapping")  # type: ignore[type-abstract]
    hidden = {**engines.load(pick.engine).hidden_in(prepared.profile), **shown.get("hidden", {})}
    rows: tuple[AuditRow, ...] = audit(shown, reference, case, hidden) if reference else ()
    own = {name: value for name, value in asked.items() if name in prepared.settings}
    rows += settings_kept(shown, prepared.settings)
    rows += (*forces_of_scene(case), *gaps_of_scene(case), *form_of_case(case), *units_of_scene(case))
    if case.file:
        from crossbody.reports.judging.start_of_file import start_of_file  # parsers that other cases do without

        rows += start_of_file(case)
    rows += first_steps(case, (engines.load(pick.engine), prepared.profile), prepared.settings, own, rows, reference)
    began, clock, compiled = process_time(), perf_counter(), count.seconds
    made = prepared.run()
    around = perf_counter() - clock
    natural = _of_case(case, pick, made)
    if bounded(case, pick) and natural.outcome is Outcome.TIME_LIMIT:
        raise CaseUnsupported(_too_dear(pick, f"more than {most:.0f} s"))
    took = process_time() - began  # with what is observed, which may cost more than the steps
    if natural.outcome.ok and 0.0 < left * took <= BEYOND * budget:
        raise _CheapError
    run = _dense(case, pick, prepared, natural, asked)
    short = ahead_of(case, truth.trusted)
    return Entry(
        engine=pick.engine,
        profile=pick.profile,
        settings=prepared.settings,
        default=not any(name in prepared.settings for name in asked),
        run=run,
        clock=Clock(run=natural, around_s=around, compiled_s=count.seconds - compiled, cpu_s=took),
        audit=rows,
        study=refined(short, truth, (pick, asked), prepared, (natural, run), took * short.t_end / case.t_end, budget)
        if refine and natural.outcome.ok
        else None,
        hidden=hidden,
        own=law_of(prepared.follows) if refine and prepared.follows is not None else None,
    )


def _done_beside(pick: Pick, truth: Truth) -> str:
    """Return why a run would only repeat what was run for the truth; nothing where it would not."""
    who = (pick.engine, pick.profile)
    told = {
        truth.spent: "As the witness of the truth it took all its time",
        truth.witness: "It is the witness of the truth",
    }
    return f"{told[who]}. -e {pick.engine}:{pick.profile} runs it again." if who in told else ""


def _dear(case: Case, pick: Pick, asked: Mapping[str, Value], most: float) -> str:
    """Return what a run of a scene would cost where that is too much, by its first part; else nothing."""
    if not case.general or (pick.engine, pick.profile) == COMPILED:
        return ""
    first = replace(case, t_end=FIRST * case.t_end)
    cost, _ = estimated(lambda **more: prepare(first, pick, {**asked, **more}), FIRST, most)
    return "" if cost <= most else _too_dear(pick, f"about {cost:.0f} s or more")


def _too_dear(pick: Pick, cost: str) -> str:
    who = f"-e {pick.engine}:{pick.profile}"
    return f"Too expensive: it would take {cost}. {who} runs it anyway, and so does a larger --budget."


def prepare(case: Case, pick: Pick, asked: Mapping[str, Value]) -> engines.Run:
    """A prepared run, with those of the asked settings that the engine has."""
    engine = engines.load(pick.engine)
    offered = engine.offered(case, pick.profile) if asked else {}
    own = {key: value for key, value in asked.items() if key in offered}
    return _checked(pick, engine.prepare(case, pick.profile, **own))


def _of_engine(pick: Pick, method: str, value: object, kind: type[_Kind], wanted: str) -> _Kind:
    """Return what a method of an engine, which may be anybody's, has returned.

    Raises:
        InvalidValue: if it is of another type.
    """
    return instance(f"What {method} of the engine {pick.engine!r} returns", value, kind, wanted)


def _checked(pick: Pick, made: object) -> engines.Run:
    run = _of_engine(pick, "prepare", made, engines.Run, "a crossbody.engines.Run")  # type: ignore[type-abstract]
    check_values(f"What prepare of the engine {pick.engine!r} returns", run, _OF_RUNS)
    return run


def _of_case(case: Case, pick: Pick, made: object) -> Trajectory:
    run = _of_engine(pick, "run", made, Trajectory, "a crossbody.cases.Trajectory")
    for name, own in (("q", case.q0), ("v", case.v0), ("gap", case.contacts)):
        if (found := getattr(run, name).shape[1]) != len(own):
            raise SceneError(
                f"What run of the engine {pick.engine!r} returns has {found} columns of {name}; "
                f"valid: {len(own)}, as {case.label} has."
            )
    return run


def _dense(case: Case, pick: Pick, prepared: Any, natural: Trajectory, given: Mapping[str, Value]) -> Trajectory:
    """The run; where the engine can be asked for samples, again with enough of them to be drawn.

    A run whose own steps are as many shows itself.
    """
    if "samples" not in prepared.settings or not natural.outcome.ok or natural.steps >= ENOUGH:
        return natural
    asked = {key: prepared.settings[key] for key in ("rtol", *given) if key in prepared.settings}
    times = sample_times(natural, case.t_end)
    dense = engines.load(pick.engine).prepare(case, pick.profile, samples=times, **asked).run()
    if not dense.outcome.ok or dense.events != natural.events:
        return natural  # samples have changed the steps: it is another run
    told = {"wall_s": natural.wall_s, "control_s": natural.control_s, "steps": natural.steps}
    return replace(with_both_sides(dense, natural), **told)  # type: ignore[arg-type]
