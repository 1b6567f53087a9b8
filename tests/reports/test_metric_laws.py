"""Metrics of motions at random, beside what their sentences say, written out sample by sample.

The run is the truth later and later: its clock stretches between touches by drawn parts, as do all its instants, so
that every sample has its own of the truth. Signals are off by drawn errors, and trusted until a drawn instant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from drawn_motions import CASES, Drawn, N

from crossbody.cases import Case, Mode, Tier, Trajectory, from_scene
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Body, Joint, Pair, Scene, Shape
from crossbody.reports import metrics
from crossbody.reports.measuring.alignment import clock
from crossbody.reports.measuring.equations import equations
from crossbody.reports.measuring.impulse import told
from crossbody.reports.measuring.truth import from_run


@pytest.fixture(scope="module", params=[(*case, seed) for case in CASES for seed in range(2)], ids=str)
def one(request: pytest.FixtureRequest) -> Drawn:
    return Drawn(*request.param)


NEAR = ("gap_error", "position")
"""Metrics that take each body, or each row, for itself."""


def largest_of_like(values: Floats, units: Sequence[str]) -> Floats:
    return np.array([max(v for v, other in zip(values, units, strict=True) if other == unit) for unit in units])


def energy_size(run: Trajectory) -> float:
    return max(float(run.energy[:, 0].max()), float(run.energy[:, 1].max() - run.energy[:, 1].min()))


def integrals(t: Floats, lam: Floats) -> Floats:
    """By trapezoids, from the start to each sample."""
    return np.array([np.trapezoid(lam[: i + 1], t[: i + 1], axis=0) for i in range(len(t))])


def test_the_clock_of_a_run_is_the_truths(one: Drawn) -> None:
    for releases in (False, True):
        np.testing.assert_allclose(clock(one.truth, one.run, releases), one.t, atol=1e-9 * one.case.t_end)


def test_positions_are_off_by_the_part_of_the_largest_of_each(one: Drawn) -> None:
    case, k, exact = one.case, one.trusted, one.exact
    own, units = np.abs(exact.q).max(axis=0), [c.unit for c in case.coordinates]
    parts = []
    for j, unit in enumerate(units):
        at = next((a for a in case.quaternions if a <= j < a + 4), None)
        if at is not None:
            turned = np.abs(np.sum(one.run.q[:k, at : at + 4] * exact.q[:k, at : at + 4], axis=1))
            parts.append(2.0 * np.arccos(np.minimum(turned, 1.0)).max())
            continue
        scale = own[j]
        if case.scene is not None and not case.quaternions:  # joints, which are measured by the largest of their like
            scale = max(scale, min(1.0 if unit == "rad" else np.inf, largest_of_like(own, units)[j]))
        elif case.quaternions:  # bodies that float, each by where it is itself
            scale = own[j - j % 7 : j - j % 7 + 3].max()
        parts.append(np.abs(one.run.q[:k, j] - exact.q[:k, j]).max() / scale)
    assert one.measured("position") == pytest.approx(max(parts), rel=1e-6)


def test_velocities_are_off_by_the_part_of_the_largest_of_their_like(one: Drawn) -> None:
    k, exact = one.trusted, one.exact
    scale = largest_of_like(np.abs(exact.v).max(axis=0), [c.unit for c in one.case.velocities])
    assert one.measured("velocity") == pytest.approx((np.abs(one.run.v[:k] - exact.v[:k]) / scale).max(), rel=1e-9)


def test_energies_are_off_by_the_part_of_the_largest(one: Drawn) -> None:
    k, size, run, exact = one.trusted, energy_size(one.exact), one.run, one.exact
    assert run.ledger is not None
    assert exact.ledger is not None
    wanted = {
        "energy_drift": np.abs(run.energy[:k].sum(axis=1) - exact.energy[:k].sum(axis=1)).max() / size,
        "contact_work": np.abs(run.ledger.contact[:k] - exact.ledger.contact[:k]).max() / size,
    }
    book = run.ledger.input - run.ledger.dissipated + sum(run.ledger.contact.T)
    left = run.energy[:, 0] + run.energy[:, 1] - book
    wanted["energy_integrator"] = np.abs(left - left[0]).max() / size
    own = one.case.law.unilateral
    if own.any():
        made = sum(run.ledger.contact.T[own])
        wanted["energy_law"] = max(0.0, made.max()) / exact.energy[:, 0].max()
    assert {name: one.measured(name) for name in wanted} == pytest.approx(wanted, rel=1e-9)


def test_gaps_are_those_of_rows_that_open_or_of_those_that_do_not(one: Drawn) -> None:
    k, run, exact, opens = one.trusted, one.run, one.exact, one.case.law.unilateral
    deep, deep_exact = np.minimum(run.gap[:, opens], 0.0), np.minimum(exact.gap[:, opens], 0.0)
    names = ("constraint_drift", "penetration", "penetration_error")
    wanted = {} if opens.all() else {"constraint_drift": np.abs(run.gap[:, ~opens]).max()}
    if opens.any():
        wanted["penetration"] = -deep.min()
        wanted["penetration_error"] = np.abs(deep[:k] - deep_exact[:k]).max() / -deep_exact.min()
        off, own = np.abs(run.gap - exact.gap)[:k, opens].max(axis=0), np.abs(exact.gap[:, opens]).max(axis=0)
        assert (off / own.max()).max() * (1.0 - 1e-9) <= one.measured("gap_error") <= (off / own).max() * (1.0 + 1e-9)
    found = {name: value for name in names if (value := one.measured(name)) is not None}
    assert found == pytest.approx(wanted, rel=1e-9)


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


def test_multipliers_are_off_by_the_part_of_the_largest(one: Drawn) -> None:
    k, run, exact, opens = one.trusted, one.run, one.exact, one.case.law.unilateral
    error = np.abs(run.lam[:k] - exact.lam[:k]).max() / np.abs(exact.lam[:k]).max()
    assert one.measured("lam_error") == (None if opens.any() else pytest.approx(error, rel=1e-9))
    mine, theirs = integrals(run.t, run.lam)[:k], integrals(one.t[:k], exact.lam[:k])
    total = np.abs(theirs[-1]).max()
    assert one.measured("lam_impulse") == pytest.approx(np.abs(mine[-1] - theirs[-1]).max() / total, rel=1e-9)
    for found, motion in ((mine, run), (theirs, exact)):
        for event in motion.events:
            found[motion.t[:k] > event.t, event.contact] += event.impulse
    if one.exact.counts.get("redundant", 0) == 0:
        path = np.abs(mine - theirs).max() / np.abs(theirs).max()
        assert one.measured("lam_impulse_path") == pytest.approx(path, rel=1e-9)


def test_multipliers_pull_or_act_on_open_rows_by_a_part_of_the_largest(one: Drawn) -> None:
    """Of rows that open and follow no other."""
    system = equations(one.case)
    opens = np.flatnonzero(one.case.law.unilateral)
    rows = [row for row in opens if system is None or system.follows[row] < 0]
    lam, free = one.run.lam[:, rows], one.run.mode[:, rows] == Mode.FREE
    wanted = None if not rows else max(-lam.min(), np.abs(lam[free]).max()) / np.abs(lam).max()
    assert one.measured("complementarity") == (wanted and pytest.approx(wanted, rel=1e-9))


def test_a_start_is_off_by_the_part_of_the_largest_of_its_like(one: Drawn) -> None:
    """Of a motion that begins at its case's own start but for its first sample."""
    if one.case.quaternions:
        return
    at = (1.0 + one.random.normal(size=len(part)) for part in (one.case.q0, one.case.v0))
    q0, v0 = at
    case = replace(one.case, q0=q0, v0=v0)
    parts = []
    for first, start, motion, named in (
        (one.run.q[0], q0, one.exact.q, case.coordinates), (one.run.v[0], v0, one.exact.v, case.velocities),
    ):  # fmt: skip
        scale = largest_of_like(np.abs(motion).max(axis=0), [c.unit for c in named])
        parts.append((np.abs(first - start) / scale).max())
    assert metrics.load("start_error").measure(one.truth, one.run, case) == pytest.approx(max(parts), rel=1e-9)


def test_a_run_stays_beside_the_truth_until_the_first_thousandth(one: Drawn) -> None:
    case, k = one.case, one.trusted
    if case.law.unilateral.any():
        assert one.measured("divergence_time") is None
        return
    off = np.zeros((N, len(case.coordinates)))
    first = int(one.random.integers(3, k - 3))
    off[first:, one.random.integers(off.shape[1])] = 1.001e-3 * np.abs(one.exact.q).max()
    off[:first] = 0.999e-3 * np.abs(one.exact.q).max()
    for q, last in ((one.exact.q + off, first), (one.exact.q + off[:1], k - 1)):
        found = metrics.load("divergence_time").measure(one.truth, replace(one.run, q=q), case)
        assert found == one.run.t[last]


def test_angles_are_off_by_radians(one: Drawn) -> None:
    k, angles = one.trusted, all(c.unit == "rad" for c in one.case.coordinates)
    off = np.abs(one.run.q[:k] - one.exact.q[:k]).max()
    assert one.measured("angle_error") == (pytest.approx(off, rel=1e-9) if angles else None)


def test_instants_and_numbers_of_contacts_are_matched_in_order(one: Drawn) -> None:
    """Each of its own, up to the time for which the truth is trusted; one that the run lacks is counted."""
    touches, releases = ([e for e in one.exact.events if e.after == mode and e.before != mode]
                         for mode in (Mode.CONTACT, Mode.FREE))  # fmt: skip
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
    lacking = replace(one.run, events=one.run.events[2:])
    for run, number in ((one.run, 0), (lacking, -1)):
        if pairs:
            assert metrics.load("touch_count").measure(one.truth, run, one.case) == number
            assert metrics.load("release_count").measure(one.truth, run, one.case) == number


def test_velocities_are_the_rates_of_positions_whatever_the_steps(one: Drawn) -> None:
    case = one.case
    if case.quaternions:
        return
    step, mean = np.diff(one.run.t)[:, None], 0.5 * (one.run.v[1:] + one.run.v[:-1])
    moved = np.diff(one.run.q, axis=0)
    way = np.abs(moved).sum(axis=0)
    off = np.abs(((moved - mean * step) * np.sign(mean)).sum(axis=0))
    assert one.measured("rate_residual") == pytest.approx((off / way).max(), rel=1e-9)


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
