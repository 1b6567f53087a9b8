"""Metrics of motions at random, beside what their sentences say, written out sample by sample.

The run is the truth later and later: its clock stretches between touches by drawn parts, as do all its instants, so
that every sample has its own of the truth. Signals are off by drawn errors, and trusted until a drawn instant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from drawn_motions import CASES, Drawn

from crossbody.cases import Case, Mode, Tier, Trajectory, from_scene
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Body, Joint, Pair, Scene, Shape
from crossbody.reports import metrics
from crossbody.reports.judging import known_answers
from crossbody.reports.judging.known_answers import answers, largest_of_like
from crossbody.reports.judging.made_up import MadeUp, case_of
from crossbody.reports.measuring.alignment import clock
from crossbody.reports.measuring.equations import equations
from crossbody.reports.measuring.impulse import told
from crossbody.reports.measuring.truth import from_run


@pytest.fixture(scope="module", params=[(*case, seed) for case in CASES for seed in range(2)], ids=str)
def one(request: pytest.FixtureRequest) -> Drawn:
    return Drawn(*request.param)


NEAR = ("gap_error", "position")
"""Metrics that take each body, or each row, for itself."""


def test_the_clock_of_a_run_is_the_truths(one: Drawn) -> None:
    for releases in (False, True):
        np.testing.assert_allclose(clock(one.truth, one.run, one.case, releases), one.t, atol=1e-9 * one.case.t_end)


OF_EQUATIONS = ("complementarity", "mode_residual", "mode_contradicted")
"""Metrics that ask which rows follow others."""


def test_metrics_say_what_sums_over_samples_say(one: Drawn) -> None:
    system = equations(one.case)
    left_out = {*OF_EQUATIONS, "event_gap"} if system is not None and system.jumps else OF_EQUATIONS
    assert [found for found in known_answers._wrong(one, answers(one)) if found[0] not in left_out] == []


@pytest.mark.parametrize("seed", range(20))
def test_metrics_say_it_of_cases_that_nobody_made(seed: int) -> None:
    draw = np.random.default_rng(seed)
    units, opens = draw.choice(["m", "rad"], draw.integers(1, 6)), draw.random(draw.integers(1, 5)) < 0.6
    made = MadeUp(case_of(units.tolist(), opens.tolist(), seed, int(draw.integers(0, 3))), seed)
    assert list(known_answers._wrong(made, answers(made))) == []


@pytest.mark.parametrize("factor", [0.0, 1.0 - 1e-6, -1.0])
def test_a_metric_that_says_other_numbers_of_made_up_motions_is_told(
    factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = MadeUp(case_of(*known_answers.UNLIKE, 1), 1)
    for name, wanted in answers(made).items():
        monkeypatch.setattr(known_answers, "measured", lambda *_, value=wanted: value and factor * value)
        told = {name for name, *_ in known_answers._wrong(made, answers(made))}
        assert (name in told) == bool(wanted)


def test_positions_are_off_by_the_part_of_the_largest_of_each(one: Drawn) -> None:
    case, k, exact = one.case, one.trusted, one.exact
    own, units = np.abs(exact.q).max(axis=0), [c.unit for c in case.coordinates]
    parts = []
    for j, unit in enumerate(units):
        at = next((a for a in case.quaternions if a <= j < a + 4), None)
        if at is not None:
            ways = [
                np.linalg.norm(one.run.q[:k, at : at + 4] + sign * exact.q[:k, at : at + 4], axis=1) for sign in (-1, 1)
            ]
            parts.append(4.0 * np.arcsin(0.5 * np.min(ways, axis=0)).max())
            continue
        scale = own[j]
        if case.scene is not None and not case.quaternions:  # joints, which are measured by the largest of their like
            scale = max(scale, min(1.0 if unit == "rad" else np.inf, largest_of_like(own, units)[j]))
        elif case.quaternions:  # bodies that float, each by where it is itself
            scale = own[j - j % 7 : j - j % 7 + 3].max()
        parts.append(np.abs(one.run.q[:k, j] - exact.q[:k, j]).max() / scale)
    assert one.measured("position") == pytest.approx(max(parts), rel=1e-6)


def test_velocities_of_joints_are_off_by_a_part_of_their_like_as_their_positions_are(one: Drawn) -> None:
    """Where something moves: of what turns by more than a radian by as much as turns by one, or by itself."""
    case, k, exact = one.case, one.trusted, one.exact
    if case.scene is None or case.quaternions:
        return
    units, own = [c.unit for c in case.velocities], np.abs(exact.v).max(axis=0)
    turned = np.where(np.array(units) == "rad", np.maximum(np.abs(exact.q).max(axis=0), 1.0), 1.0)
    like = largest_of_like(np.maximum(own, [c.rate for c in case.velocities]), units)
    part = np.where(np.array(units) == "rad", turned / turned.max(), 1.0)
    scale = np.minimum(like, np.maximum(own, largest_of_like(own, units) * part))
    off = (np.abs(one.run.v[:k] - exact.v[:k]) / scale).max()
    assert one.measured("velocity") == pytest.approx(off, rel=1e-6)


def test_gaps_of_rows_are_off_by_a_part_of_their_own_or_of_the_largest(one: Drawn) -> None:
    k, run, exact, touches = one.trusted, one.run, one.exact, one.case.law.touches
    if touches.any():
        off, own = np.abs(run.gap - exact.gap)[:k, touches].max(axis=0), np.abs(exact.gap[:, touches]).max(axis=0)
        assert (off / own.max()).max() * (1.0 - 1e-9) <= one.measured("gap_error") <= (off / own).max() * (1.0 + 1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_a_body_far_away_hides_nothing_of_a_near_one(seed: int) -> None:
    """Neither of its gaps nor of its positions, however far the other is and moves."""
    random, t = np.random.default_rng(seed), np.linspace(0.0, 1.0, 40)
    far = 10.0 ** random.uniform(2.0, 4.0) * random.choice([-1.0, 1.0], 3)
    ways = 0.3 * np.sin(np.multiply.outer(t, random.uniform(1.0, 9.0, 6)) + random.uniform(0.0, 6.0, 6))
    off = 1e-4 * random.normal(size=(40, 3))
    found = {}
    for bodies in (("near",), ("near", "far")):
        case = balls(bodies)
        places = [ways[:, :3], ways[:, 3:] + far][: len(bodies)]
        turn = np.tile([1.0, 0.0, 0.0, 0.0], (40, 1))
        exact, run = (
            still(
                case, t, np.hstack([one for k, place in enumerate(places) for one in (place + more * (k == 0), turn)])
            )
            for more in (0.0, off)
        )
        gap, truth = run.gap.copy(), from_run(exact, Tier.A, "drawn")
        gap[:, 0] += off[:, 0]
        run = replace(run, gap=gap)
        found[bodies] = [metrics.load(name).measure(truth, run, case) for name in NEAR]
    assert found["near", "far"] == pytest.approx(found["near",], rel=1e-6)
    assert min(found["near",]) > 1e-5


def balls(names: Sequence[str]) -> Case:
    """Of radius 0.1 m, that float above a floor."""
    floor = Shape(name="floor", body="", type="plane", size=(0.0, 0.0, 0.0))
    return from_scene(Scene(
        bodies=tuple(Body(name=name, mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)) for name in names),
        joints=tuple(Joint(name=name, body=name, type="free") for name in names),
        shapes=(floor, *(Shape(name=name, body=name, type="sphere", size=(0.1, 0.0, 0.0)) for name in names)),
        pairs=tuple(Pair(name=name, first="floor", second=name) for name in names),
    ), q0=[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0] * len(names), t_end=1.0)  # fmt: skip


def still(case: Case, t: Floats, q: Floats) -> Trajectory:
    """Positions and their gaps, with nothing else."""
    system = equations(case)
    assert system is not None
    v, rows = np.zeros((len(t), system.n)), np.zeros((len(t), system.nc))
    return Trajectory(
        t=t, q=q, v=v, gap=system.gaps_along(q, v)[0], lam=rows, energy=np.zeros((len(t), 2)), steps=len(t),
        mode=np.full(rows.shape, Mode.FREE, np.int8), events=(),
    )  # fmt: skip


def test_multipliers_pull_or_act_on_open_rows_by_a_part_of_the_largest(one: Drawn) -> None:
    """Of rows that touch."""
    rows = np.flatnonzero(one.case.law.touches)
    lam, free = one.run.lam[:, rows], one.run.mode[:, rows] == Mode.FREE
    wanted = None if not len(rows) else max(-lam.min(), np.abs(lam[free]).max()) / np.abs(lam).max()
    assert one.measured("complementarity") == (wanted and pytest.approx(wanted, rel=1e-9))


def test_instants_and_numbers_of_contacts_are_matched_in_order(one: Drawn) -> None:
    """Each of its own, up to the time for which the truth is trusted; one that the run lacks is counted."""
    touches = [e for e in one.exact.events if (e.before, e.after) == (Mode.FREE, Mode.COLLISION)]
    releases = [e for e in one.exact.events if e.before == Mode.CONTACT]
    pairs = list(zip(touches, releases, strict=True))
    for until in (one.truth.trusted, 0.5 * one.case.t_end):
        known = [t for a, b in pairs if a.t <= until for t in (a.t, b.t)]
        shifts = [abs(float(one.late(t)) - t) for t in known]
        found = metrics.load("event_times").measure(replace(one.truth, trusted=until), one.run, one.case)
        assert found == (pytest.approx(max(shifts), rel=1e-9) if shifts else None)
    if pairs:  # one that does not end in the run has no shift, and is counted
        ends = max(k for k, e in enumerate(one.run.events) if e.before == Mode.CONTACT)
        held = replace(one.run, events=tuple(e for k, e in enumerate(one.run.events) if k != ends))
        kept = [t for a, b in pairs if a.t <= one.truth.trusted for t in (a.t, b.t)][:-1]
        shifts = [abs(float(one.late(t)) - t) for t in kept]
        assert metrics.load("event_times").measure(one.truth, held, one.case) == pytest.approx(max(shifts), rel=1e-9)
        assert metrics.load("release_count").measure(one.truth, held, one.case) == -1
    lacking = replace(one.run, events=tuple(e for e in one.run.events if one.case.law.touches[e.contact])[3:])
    for run, number in ((one.run, 0), (lacking, -1)):
        if pairs:
            assert metrics.load("touch_count").measure(one.truth, run, one.case) == number
            assert metrics.load("release_count").measure(one.truth, run, one.case) == number


@pytest.mark.parametrize("scene", CASES[:3], ids=":".join)
@pytest.mark.parametrize(
    ("withheld", "empty"), [("ledger", lambda run: None), ("lam", lambda run: np.full_like(run.lam, np.nan))]
)
def test_what_a_run_withholds_is_no_number_of_the_metrics_that_say_they_need_it(
    withheld: str, empty: Callable[[Trajectory], Floats | None], scene: tuple[str, str]
) -> None:
    """And changes no other that is measured of every run, or fails."""
    one = Drawn(*scene, seed=0)
    run = replace(one.run, **{withheld: empty(one.run)})
    for name in metrics.names():
        metric = metrics.load(name)
        if metric.CLAIMED or name.startswith(("friction_", "cone_")):
            continue
        before, after = (metric.measure(one.truth, each, one.case) for each in (one.run, run))
        if getattr(metric, "NEEDS", "") == withheld:
            assert (before is None and after is None) or np.isnan(after), name
        elif name not in ("creep_speed", "event_gap", "mode_residual"):
            assert after == before, name


def test_all_that_is_beside_a_truth_is_measured_of_every_run() -> None:
    """What a run shows alone is where a case asks for it, and so are modes that hold, which take as long as a run."""
    asked = {name for name in metrics.names() if metrics.load(name).CLAIMED}
    assert asked == {name for name, (module, _) in metrics._together().items() if module == "_of_run"} | {
        "violated_modes"
    }


@pytest.mark.parametrize("seed", range(30))
def test_a_multiplier_is_known_or_follows_from_others_of_rows_that_are_always_on(seed: int) -> None:
    """Of a row that opens, and at some samples alone, it is unknown."""
    random, n, rows = np.random.default_rng(seed), 5, int(np.random.default_rng(seed).integers(1, 4))
    on, lacking, partly = (random.random(rows) < share for share in (0.6, 0.4, 0.1))
    lam, mode = random.normal(size=(n, rows)), np.full((n, rows), Mode.CONTACT, np.int8)
    mode[:, on] = Mode.BILATERAL
    lam[:, lacking] = np.nan
    lam[2, partly] = np.nan
    wide = np.zeros((n, rows))
    run = Trajectory(t=np.arange(n) * 1.0, q=wide, v=wide, gap=wide, lam=lam, energy=np.zeros((n, 2)), mode=mode)
    follows = [bool(on[k] and lacking[k]) for k in range(rows)]
    unknown = any((lacking[k] or partly[k]) and not follows[k] for k in range(rows)) or all(follows)
    found = told(run)
    assert (found is None) if unknown else (found is not None and found.tolist() == [not f for f in follows])
