"""Faults planted in recorded runs: each must be outside, whatever the engine is known for."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, Claim, InvalidValue, Limit, Mode, Outcome, Tier, Trajectory, UnknownName, load
from crossbody.cases.arrays import Floats
from crossbody.cases.contacts import CLOSED
from crossbody.reports import metrics
from crossbody.reports.judging import stored
from crossbody.reports.judging.comparison import judged
from crossbody.reports.judging.parts import PARTS
from crossbody.reports.judging.run_verdicts import Entry
from crossbody.reports.judging.truth import held_against, truth_of
from crossbody.reports.judging.verdict import Regression, Word, exit_code
from crossbody.reports.measuring.truth import Truth
from crossbody.reports.runs import choice, jobs

Fault = Callable[[Trajectory], Trajectory]
Recorded = dict[tuple[str, str], tuple[Case, Truth, dict[str, Entry]]]
SCENES = (("bouncing_ball", "listing"), ("newtons_cradle", "sliders"))
ENGINES = ("reference:compiled", "mujoco:matched", "pinocchio:law")
RIGHT = (Word.WITHIN, Word.EXPECTED, Word.INFO, Word.SKIPPED)


def _silent(run: Trajectory) -> Trajectory:
    """All multipliers unknown."""
    return replace(run, lam=np.full_like(run.lam, np.nan))


def _forces(run: Trajectory) -> Trajectory:
    """Every force twice as large, those of collisions in no time among them."""
    return replace(run, lam=2.0 * run.lam, events=tuple(replace(e, impulse=2.0 * e.impulse) for e in run.events))


def _never_released(run: Trajectory) -> Trajectory:
    return replace(run, events=tuple(e for e in run.events if not (e.before in CLOSED and e.after not in CLOSED)))


def _late(run: Trajectory) -> Trajectory:
    return replace(run, events=tuple(replace(e, t=e.t + 1e-3 * run.t[-1]) for e in run.events))


def _one_touch_less(run: Trajectory) -> Trajectory:
    last = max(i for i, e in enumerate(run.events) if e.after in CLOSED)
    return replace(run, events=run.events[:last])


def _stopped(run: Trajectory) -> Trajectory:
    """A record that ends at nine tenths, of a run that says that it finished."""
    n = int(np.searchsorted(run.t, 0.9 * run.t[-1])) or 1
    columns = {name: getattr(run, name)[:n] for name in ("t", "q", "v", "gap", "lam", "energy", "mode")}
    if run.ledger is not None:
        kept = {name: getattr(run.ledger, name)[:n] for name in ("contact", "input", "dissipated")}
        columns["ledger"] = replace(run.ledger, **kept)
    return replace(run, events=tuple(e for e in run.events if e.t <= columns["t"][-1]), **columns)


FAULTS: dict[str, Fault] = {
    "stops early": _stopped,
    "modes of other events": lambda run: replace(run, mode=np.where(run.mode == Mode.FREE, Mode.BALLISTIC, run.mode)),
    "an event less": lambda run: replace(run, events=(*run.events[:1], *run.events[2:])),
    "an event without an instant": lambda run: replace(
        run, events=(*run.events[:-1], replace(run.events[-1], t=np.nan))
    ),
    "every force doubled": _forces,
    "force unknown": _silent,
    "velocity 10 % large": lambda run: replace(run, v=1.1 * run.v),
    "gap halved": lambda run: replace(run, gap=0.5 * run.gap),
    "kinetic energy 2 % large": lambda run: replace(run, energy=run.energy * np.array([1.02, 1.0])),
    "position drifts": lambda run: replace(run, q=run.q * (1.0 + 0.01 * run.t / run.t[-1])[:, None]),
    "releases ignored": _never_released,
    "diverged": lambda run: replace(run, outcome=Outcome.DIVERGED),
    "not a number": lambda run: replace(run, q=np.where(run.t[:, None] > 0.9 * run.t[-1], np.nan, run.q)),
}
OF_THE_REFERENCE: dict[str, Fault] = {
    "late events": _late,
    "a touch less": _one_touch_less,
    "kinetic energy 1e-5 large": lambda run: replace(run, energy=run.energy * np.array([1.0 + 1e-5, 1.0])),
    "velocity 1e-4 large": lambda run: replace(run, v=(1.0 + 1e-4) * run.v),
    "position 1e-5 off": lambda run: replace(run, q=run.q + 1e-5),
    "dissipation left out of the account": lambda run: replace(run, ledger=replace(
        run.ledger, contact=run.ledger.contact + 1e-4 * run.t[:, None])),
}  # fmt: skip
"""Too small to be seen where an engine is known to deviate, and seen where it is not."""


@pytest.fixture(scope="module")
def recorded() -> Recorded:
    """Cases, their truths and their runs, made once for all faults."""
    found = {}
    for name, variant in SCENES:
        case = load(name, variant)
        result = jobs.run_case(case, choice.picks(ENGINES))
        found[name, variant] = (case, result.truth, {f"{e.engine}:{e.profile}": e for e in result.entries})
    return found


def _outside(case: Case, entry: Entry, truth: Truth) -> list[str]:
    return [row.metric for row in judged(case, [entry], truth, "crossbody run") if row.verdict not in RIGHT]


@pytest.mark.parametrize("who", ENGINES)
@pytest.mark.parametrize("scene", SCENES, ids=":".join)
def test_what_was_recorded_is_not_outside(recorded: Recorded, scene: tuple[str, str], who: str) -> None:
    case, truth, entries = recorded[scene]
    assert _outside(case, entries[who], truth) == []


def test_collisions_that_take_energy_in_no_time_are_not_outside() -> None:
    case = load("newtons_cradle", "sliders", zeta=0.2)
    found = jobs.run_case(case, choice.picks(("reference:compiled", "reference:cvode")), refine=False)
    assert [_outside(case, entry, found.truth) for entry in found.entries] == [[], []]


@pytest.mark.parametrize("who", ENGINES)
@pytest.mark.parametrize("scene", SCENES, ids=":".join)
def test_what_happens_behind_the_trusted_time_is_not_judged(
    recorded: Recorded, scene: tuple[str, str], who: str
) -> None:
    """All that is recorded there is spoilt, and its events are gone: every number is as it was."""
    case, truth, entries = recorded[scene]
    truth, entry = replace(truth, trusted=0.47 * case.t_end, parted=0.47 * case.t_end), entries[who]
    assert entry.run is not None
    late = (entry.run.t > 0.5 * case.t_end)[:, None]
    spoilt = {name: np.where(late, 3.0 * getattr(entry.run, name) + 1.0, getattr(entry.run, name))
              for name in ("q", "v", "gap", "lam", "energy")}  # fmt: skip
    ledger = entry.run.ledger
    if ledger is not None:
        ledger = replace(ledger, contact=np.where(late, 3.0 * ledger.contact + 1.0, ledger.contact))
    events = tuple(event for event in entry.run.events if event.t <= 0.5 * case.t_end)
    wrong = replace(entry, run=replace(entry.run, ledger=ledger, events=events, **spoilt))
    right, found = ([(row.metric, str(row.value), row.verdict) for row in judged(case, [one], truth, "")]
                    for one in (entry, wrong))  # fmt: skip
    assert found == right


@pytest.mark.parametrize("who", ENGINES)
@pytest.mark.parametrize("scene", SCENES, ids=":".join)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_outside_in_every_engine(recorded: Recorded, fault: str, scene: tuple[str, str], who: str) -> None:
    case, truth, entries = recorded[scene]
    entry = entries[who]
    assert entry.run is not None
    assert _outside(case, replace(entry, run=FAULTS[fault](entry.run)), truth)


@pytest.mark.parametrize("scene", SCENES, ids=":".join)
@pytest.mark.parametrize("fault", OF_THE_REFERENCE)
def test_a_small_fault_of_the_reference_is_outside(recorded: Recorded, fault: str, scene: tuple[str, str]) -> None:
    case, truth, entries = recorded[scene]
    entry = entries["reference:compiled"]
    assert entry.run is not None
    assert _outside(case, replace(entry, run=OF_THE_REFERENCE[fault](entry.run)), truth)


def test_a_truth_that_drifts_is_outside(recorded: Recorded) -> None:
    case, truth, entries = recorded["bouncing_ball", "listing"]
    second = entries["reference:cvode"].run if "reference:cvode" in entries else entries["reference:compiled"].run
    assert second is not None

    def at(times: Floats) -> Trajectory:
        exact = truth.at(times)
        return replace(exact, q=exact.q * (1.0 + 0.01 * times)[:, None])

    wrong = held_against(replace(truth, at=at), second, case, 1e-12)
    assert "truth" in _outside(case, entries["pinocchio:law"], wrong)


def test_touches_of_a_truth_stand_where_its_own_gaps_close() -> None:
    """Its events come from one run and its motion from another: both are as exact as a truth has to be."""
    truth = truth_of(load("red_body", "resolved"))
    touches = [e for e in truth.trajectory.events if e.before is Mode.FREE and e.after in CLOSED]
    gaps = truth.at(np.array([e.t for e in touches])).gap[range(len(touches)), [e.contact for e in touches]]
    assert len(touches) > 1
    assert np.abs(gaps).max() < 1e-13 * np.abs(truth.trajectory.gap).max()


@pytest.mark.parametrize("size", [0.03, 30.0])
def test_truths_part_at_the_same_instant_in_any_unit_of_length(size: float, recorded: Recorded) -> None:
    case, truth, entries = recorded["bouncing_ball", "listing"]
    second = entries["reference:compiled"].run
    assert second is not None
    second = replace(second, q=second.q + 1e-6 * np.expm1(10.0 * second.t)[:, None])

    def told(by: float) -> Truth:
        def at(times: Floats) -> Trajectory:
            return replace(truth.at(times), q=by * truth.at(times).q)

        scaled = replace(truth, trajectory=replace(truth.trajectory, q=by * truth.trajectory.q), at=at)
        return held_against(scaled, replace(second, q=by * second.q), case, 1e-12)

    one, other = told(1.0), told(size)
    assert 0.0 < one.trusted < case.t_end
    assert (other.trusted, other.parted) == (one.trusted, one.parted)
    assert other.growth == pytest.approx(one.growth, rel=1e-9)
    assert other.agreement == pytest.approx(one.agreement, rel=1e-9)


def test_what_was_compared_over_a_small_part_is_not_judged(recorded: Recorded) -> None:
    case, truth, entries = recorded["bouncing_ball", "listing"]
    short = replace(truth, trusted=0.1 * case.t_end)
    rows = {row.metric: row for row in judged(case, [entries["reference:compiled"]], short, "crossbody run")}
    assert rows["truth"].verdict == Word.OUTSIDE
    assert rows["position"].verdict == Word.INFO
    assert rows["position"].compared == pytest.approx(0.1, abs=0.01)
    assert rows["energy_integrator"].verdict == Word.INFO, "of the run alone, and over that part too"
    assert rows["energy_integrator"].compared == pytest.approx(0.1, abs=0.01)


@pytest.fixture(scope="module")
def deviating() -> tuple[Case, Truth, Entry]:
    """A ball by a contact of MuJoCo's own."""
    case = load("bouncing_ball", "listing")
    result = jobs.run_case(case, choice.picks(["mujoco:default"]))
    return case, result.truth, result.entries[0]


@pytest.mark.parametrize("factor", [0.4, 2.5])
def test_a_known_deviation_that_changes_is_outside(deviating: tuple[Case, Truth, Entry], factor: float) -> None:
    case, truth, entry = deviating
    run = entry.run
    assert run is not None
    assert "lam_impulse_path" in {r.metric for r in judged(case, [entry], truth, "") if r.verdict == Word.EXPECTED}
    lam = run.lam * factor
    assert "lam_impulse_path" in _outside(case, replace(entry, run=replace(run, lam=lam)), truth)


def test_a_known_deviation_without_a_measured_size_is_not_judged(deviating: tuple[Case, Truth, Entry]) -> None:
    case, truth, entry = deviating
    entry = replace(entry, settings={"dt": 1e-4})
    rows = {row.metric: row.verdict for row in judged(case, [entry], truth, "")}
    assert rows["energy_drift"] == Word.INFO


def test_a_claimed_number_that_is_missing_is_outside(recorded: Recorded) -> None:
    case, truth, entries = recorded["bouncing_ball", "listing"]
    claim = Claim(metric="fifth_exit", expected=4.0, tier=Tier.B, source="a figure")
    claimed = replace(case, claims=(*case.claims, claim))
    for entry in entries.values():
        assert "fifth_exit" in _outside(claimed, entry, truth)


@pytest.mark.parametrize("metric", ["collision_impulse", "largest position (model)"])
def test_a_claim_that_judged_nothing_is_reported(metric: str, recorded: Recorded) -> None:
    case, truth, entries = recorded["bouncing_ball", "listing"]
    claim = Claim(metric=metric, expected=4.0, tier=Tier.B, source="nothing collides in no time")
    alone = replace(entries["reference:compiled"], study=None)
    rows = judged(replace(case, claims=(*case.claims, claim)), [alone], truth, "")
    outside = [row.metric for row in rows if row.verdict == Word.OUTSIDE]
    assert [name.removesuffix(" (claim)") for name in outside] == [metric]


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"limits": (Limit(metric="kontakts", value=1.0),)}, UnknownName),
        ({"limits": (Limit(metric="position", value=1.0, engine="referense"),)}, UnknownName),
        ({"limits": (Limit(metric="position", value=-1.0),)}, InvalidValue),
        ({"claims": (Claim(metric="kontakts", expected=1.0, tier=Tier.A, source=""),)}, UnknownName),
        ({"claims": (Claim(metric="ring_changes", expected=1.0, tier=Tier.A, source="a maze"),)}, UnknownName),
    ],
)
def test_names_in_claims_and_limits_exist(change: dict[str, object], error: type[Exception]) -> None:
    case = replace(load("bouncing_ball", "linear"), **change)  # type: ignore[arg-type]
    with pytest.raises(error, match=r"kontakts|referense|-1|ring_changes"):
        judged(case, [], truth_of(case), "")


def test_an_engine_that_throws_is_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    from crossbody import engines

    case = load("bouncing_ball", "linear")
    reference = engines.load("reference")
    real = type(reference).prepare

    def prepare(self: object, case: Case, profile: str = "matched", **settings: object) -> object:
        if profile == "cvode":
            raise ZeroDivisionError("planted")
        return real(reference, case, profile, **settings)  # type: ignore[arg-type]

    monkeypatch.setattr(type(reference), "prepare", prepare)
    result = jobs.run_case(case, choice.picks(["reference:cvode", "reference:compiled"]))
    rows = judged(case, result.entries, result.truth, "")
    crashed = [row for row in rows if row.verdict == Word.CRASHED]
    assert [(row.profile, row.metric) for row in crashed] == [("cvode", "run")]
    assert "ZeroDivisionError: planted" in crashed[0].why
    assert any(row.profile == "compiled" and row.metric == "position" for row in rows)


@pytest.mark.parametrize("name", ["position", "lam_impulse_path", "bounces"])
def test_a_metric_that_throws_is_a_row(name: str, recorded: Recorded, monkeypatch: pytest.MonkeyPatch) -> None:
    case, truth, entries = recorded["bouncing_ball", "listing"]

    def measure(truth: Truth, run: Trajectory, case: Case) -> float:
        raise ZeroDivisionError("planted")

    monkeypatch.setattr(metrics.load(name), "measure", measure)
    rows = judged(case, [entries["mujoco:matched"]], truth, "")
    crashed = [row for row in rows if row.verdict == Word.CRASHED]
    assert {row.metric.partition(" ")[0] for row in crashed} == {name}
    assert all("ZeroDivisionError: planted" in row.why for row in crashed)
    assert {"velocity", "energy_drift"} <= {row.metric for row in rows}
    assert exit_code(row.verdict for row in rows) == 1


@pytest.mark.parametrize("who", ENGINES)
@pytest.mark.parametrize("scene", SCENES, ids=":".join)
def test_a_shipped_run_stays_in_its_regression_bands(recorded: Recorded, scene: tuple[str, str], who: str) -> None:
    case, truth, entries = recorded[scene]
    rows = judged(case, [entries[who]], truth, "")
    assert sum(row.regression == Regression.KEPT for row in rows) > 8
    assert [row.metric for row in rows if row.regression == Regression.LOST] == []


def test_every_number_of_a_run_has_a_band(recorded: Recorded) -> None:
    """Also what nobody judges: it is seen to move."""
    rows = [row for case, truth, entries in recorded.values() for row in judged(case, [*entries.values()], truth, "")]
    parts = tuple(f"({part})" for part in PARTS)
    told = [row for row in rows if not math.isnan(row.value) and not row.metric.endswith(parts)]
    bare = {row.metric for row in told if math.isnan(row.band)}
    assert bare == {"truth", "finished", "audit"}


@pytest.mark.parametrize("label", [f"{name}:{variant}" for name in cases.names() for variant in cases.variants(name)])
def test_every_run_of_a_shipped_case_is_stored(label: str) -> None:
    case = load(*label.split(":"))
    bare = [
        f"{pick.engine}:{pick.profile}"
        for pick in choice.picks(["reference", "mujoco", "pinocchio", "exudyn", "dart", "pymunk"])
        if engines.load(pick.engine).why_not(case, pick.profile) is None
        and not stored.differing(case, Entry(engine=pick.engine, profile=pick.profile))
    ]
    assert bare == []


def test_a_number_that_left_its_band_is_wrong_if_that_is_asked_for(recorded: Recorded) -> None:
    case, truth, entries = recorded["newtons_cradle", "sliders"]
    entry = entries["reference:compiled"]
    assert entry.run is not None
    worse = replace(entry, run=replace(entry.run, q=entry.run.q * (1.0 + 1e-11)))
    rows = judged(case, [worse], truth, "")
    assert [row.metric for row in rows if row.verdict == Word.OUTSIDE] == []
    assert "position" in {row.metric for row in rows if row.regression == Regression.LOST}
    words, regressions = [row.verdict for row in rows], [row.regression for row in rows]
    assert (exit_code(words), exit_code(words, regressions)) == (0, 1)


def test_samples_of_a_judged_run_are_not_the_callers_to_choose() -> None:
    """Too few would show neither its events nor its forces, and a right run would be outside."""
    with pytest.raises(InvalidValue, match="omit samples"):
        jobs.run_case(load("bouncing_ball", "resting"), choice.picks(["reference:compiled"]), settings={"samples": 201})
