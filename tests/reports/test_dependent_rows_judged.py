"""Rows that follow from others: of a planar loop, and those that share a load, of which the sum alone is unique."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from four_bars import four_bar

from crossbody import cases, engines
from crossbody.cases import Case, Mode, Tier
from crossbody.cases.contacts import contacts
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape
from crossbody.engines.pinocchio._joined import none_pulling
from crossbody.reports import metrics
from crossbody.reports.judging.truth import with_both_sides
from crossbody.reports.measuring.modes import violated
from crossbody.reports.measuring.truth import from_run, sample_times

RTOL = 1e-9


@pytest.mark.parametrize("profile", ["compiled", "cvode", "ida"])
@pytest.mark.parametrize("seed", range(3))
def test_rows_that_others_hold_are_no_contacts_and_no_unknown_numbers(seed: int, profile: str) -> None:
    case = four_bar(seed)
    run = engines.load("reference").prepare(case, profile, rtol=RTOL).run()
    assert run.counts["redundant"] == 1, "a closure in space has three rows where a plane needs two"
    left_out = np.isnan(run.lam).all(axis=0)
    assert left_out.sum() == 1
    assert (run.mode[:, left_out] == Mode.BILATERAL).all()
    truth = replace(from_run(run, Tier.D, "itself"), joined=True)
    found = {
        name: metrics.load(name).measure(truth, run, case)
        for name in ("complementarity", "law_residual", "mode_residual")
    }
    assert found["mode_residual"] == 0.0
    assert found["complementarity"] is not None
    assert found["complementarity"] < 1e-9
    assert found["law_residual"] is not None
    assert found["law_residual"] < 1e-7
    met = {contact.row for contact in contacts(run, joined=True)}
    assert all(case.law.unilateral[row] for row in met), "what is always on touches nothing"
    assert violated(case, run, RTOL) == ()


def standing(apart: float) -> Case:
    """A body that may tip and sink, on two balls that are so far apart, m."""
    body = Body(name="body", mass=2.0, inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0))
    joints = tuple(Joint(name=kind, body="body", type=kind, axis=axis)
                   for kind, axis in (("slide", (0.0, 0.0, 1.0)), ("hinge", (0.0, 1.0, 0.0))))  # fmt: skip
    floor = Shape(name="floor", type="plane")
    balls = [Shape(name=f"ball {x}", body="body", type="sphere", size=(0.1, 0.0, 0.0), position=(x, 0.0, 0.0))
             for x in (-0.5 * apart, 0.5 * apart)]  # fmt: skip
    law = RowLaw(a0=1e3, a1=60.0)
    pairs = tuple(Pair(name=ball.name, first="floor", second=ball.name, law=law) for ball in balls)
    scene = Scene(bodies=(body,), joints=joints, shapes=(floor, *balls), pairs=pairs, gravity=(0.0, 0.0, -9.81))
    return cases.from_scene(scene, q0=[0.101, 0.0], t_end=0.3)


@pytest.mark.parametrize("engine", ["reference", "pinocchio"])
@pytest.mark.parametrize("seed", range(4))
def test_a_ball_within_another_changes_nothing(seed: int, engine: str) -> None:
    """Its row is that of the other with another gap: no multipliers let both follow their laws."""
    rng = np.random.default_rng(seed)
    alone = standing(float(rng.uniform(0.1, 0.4)))
    assert alone.scene is not None
    scene = alone.scene.replace(gravity=(0.0, 0.0, -float(rng.uniform(1.0, 30.0))))
    within, law = scene.shapes[1], scene.pairs[0].law
    smaller = replace(within, name="within", size=(within.size[0] - 10.0 ** -float(rng.uniform(3.0, 6.0)), 0.0, 0.0))
    pair = Pair(name="within", first="floor", second="within", law=law)
    both = scene.replace(shapes=(*scene.shapes, smaller), pairs=(*scene.pairs, pair))
    runs = [
        engines.load(engine).prepare(cases.from_scene(one, q0=[0.105, 0.05], t_end=0.3)).run() for one in (scene, both)
    ]
    assert all(run.outcome.ok for run in runs)
    assert np.abs(runs[0].q[-1] - runs[1].q[-1]).max() < 1e-8


@pytest.mark.parametrize(("engine", "profile"), [("pinocchio", "law"), ("mujoco", "matched")])
def test_how_shapes_lie_out_of_reach_is_not_looked_at(engine: str, profile: str) -> None:
    law = RowLaw(a0=1e3, a1=60.0)
    bodies = [Body(name=name, position=(x, 0.0, 0.0), mass=1.0, inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0))
              for name, x in (("one", 0.0), ("two", 1.0))]  # fmt: skip
    joints = [Joint(name=body.name, body=body.name, type="hinge", axis=(0.0, 1.0, 0.0)) for body in bodies]
    bars = [Shape(name=f"bar of {body.name}", body=body.name, type="capsule", size=(0.02, 0.1, 0.0)) for body in bodies]
    pair = Pair(name="bars", first=bars[0].name, second=bars[1].name, law=law)
    scene = Scene(bodies=tuple(bodies), joints=tuple(joints), shapes=tuple(bars), pairs=(pair,), gravity=(0.0,) * 3)
    case = cases.from_scene(scene, q0=[0.0, 0.1], v0=[3.0, -5.0], t_end=1.0)
    run = engines.load(engine).prepare(case, profile).run()
    exact = engines.load("reference").prepare(case, "compiled", samples=np.array(run.t)).run()
    assert np.abs(run.gap - exact.gap).max() < 1e-6


@pytest.mark.parametrize(("apart", "unique"), [(1e-12, False), (1e-8, False), (1e-3, True), (0.3, True)])
def test_a_load_may_be_shared_in_any_way_where_that_exerts_nothing(apart: float, unique: bool) -> None:
    """What moves from one ball to the other is an error of the law where the two balls can be told apart, else none."""
    case = standing(apart)
    run = engines.load("reference").prepare(case, "compiled", rtol=1e-11).run()
    measure = metrics.load("law_residual").measure
    closed = (run.mode == Mode.CONTACT).all(axis=1)
    assert closed.any()
    assert (run.counts.get("redundant", 0) > 0) != unique

    def off(*change: float) -> float:
        value = measure(from_run(run, Tier.D, "itself"), replace(run, lam=run.lam + closed[:, None] * change), case)
        assert value is not None
        return float(value)

    size = 1e-3 * float(run.lam.max())
    assert off(0.0, 0.0) <= 1e-6
    assert (off(size, -size) <= 1e-6) != unique
    assert off(size, 0.0) >= 4e-4, "the load itself is another"


@pytest.mark.parametrize("seed", range(200))
def test_multipliers_that_do_not_pull_exert_the_same_forces(seed: int) -> None:
    """Of rows of any rank, from multipliers that push; they are no larger than those."""
    rng = np.random.default_rng(seed)
    width, count = rng.integers(3, 8), rng.integers(2, 8)
    rank = rng.integers(1, min(width, count) + 1)
    J = rng.normal(size=(count, rank)) @ rng.normal(size=(rank, width))
    J = np.abs(J) if rng.random() < 0.5 else J
    one_sided = rng.random(count) < 0.8
    pushing = np.where(one_sided, 10.0 ** rng.uniform(-6.0, 3.0, count), rng.normal(size=count))
    pushing *= rng.random(count) < 0.7
    found = none_pulling(np.linalg.pinv(J.T, rcond=1e-9) @ (J.T @ pushing), J, one_sided)
    assert np.abs(J.T @ (found - pushing)).max() <= 1e-11 * np.abs(J.T @ pushing).max(initial=0.0)
    assert found[one_sided].min(initial=0.0) >= -1e-12 * np.abs(found).max()
    assert np.linalg.norm(found) <= (1.0 + 1e-9) * np.linalg.norm(pushing)


@pytest.mark.parametrize("seed", range(100))
def test_rows_that_must_let_go_pull_by_no_more_than_they_must(seed: int) -> None:
    """Corners of a box on a floor whose load has left their rectangle by a part of itself: that is all that pulls."""
    rng = np.random.default_rng(seed)
    x, y = (part.ravel() for part in np.meshgrid([-1.0, 1.0], [-1.0, 1.0]))
    J = np.stack([np.ones(4), *(x, y)], axis=1) @ np.diag(rng.uniform(0.1, 10.0, 3))
    beyond = 10.0 ** rng.uniform(-11.0, -1.0)
    at = rng.uniform(-0.9, 0.9)
    weights = 0.25 * (1.0 + (1.0 + beyond) * x + at * y)  # of the least norm: two pull, one of them by the other
    found = none_pulling(weights, J, np.ones(4, dtype=bool))
    assert np.abs(J.T @ (found - weights)).max() <= 1e-9 * np.abs(J.T @ weights).max()
    assert -10.0 * beyond <= found.min() < 0.0


@pytest.mark.parametrize("seed", range(100))
def test_rows_that_rounding_has_pull_leave_the_others_as_they_are(seed: int) -> None:
    """Heels and toes of two feet that stand alike, and two joints at bounds that bear nothing."""
    rng = np.random.default_rng(seed)
    lever, (heel, toe) = rng.uniform(0.05, 1.0), 10.0 ** rng.uniform(0.0, 3.0, 2)
    J = np.zeros((6, 9))
    J[0, 3] = J[1, 4] = -1.0
    J[2:, 1] = 1.0
    J[2, 2:6] = -lever, lever, lever, lever
    J[4, 2], J[4, 6:] = -lever, lever
    J[3, 2:6] = 1e-18 * rng.normal(size=4)
    J[5, 2], J[5, 6:] = J[3, 2], 1e-18 * rng.normal(size=3)
    lam = np.array([-7e-15, -1e-14, heel, toe, heel, toe])
    found = none_pulling(lam, J, np.ones(6, dtype=bool))
    assert np.abs(J.T @ (found - lam)).max() <= 1e-11 * np.abs(J.T @ lam).max()


ROCKING = (3, 11, 15, 16, 18, 24)
"""Seeds with which one of four corners begins to bear nothing."""


def rocking(seed: int) -> Case:
    """A box that falls on a floor without friction, and rocks until its load leaves one corner after the other."""
    rng = np.random.default_rng(seed)
    x, y, z = np.array([0.1, 0.08, 0.06]) ** 2 / 3.0
    box = Body(name="box", mass=1.0, inertia=(y + z, x + z, x + y, 0.0, 0.0, 0.0))
    shapes = (
        Shape(name="floor", type="plane"),
        Shape(name="crate", body="box", type="box", size=(0.1, 0.08, 0.06)),
    )
    scene = Scene(
        bodies=(box,), joints=(Joint(name="loose", body="box", type="free"),), shapes=shapes,
        pairs=(Pair(name="touch", first="floor", second="crate", law=RowLaw(a0=4000.0, a1=100.0)),),
    )  # fmt: skip
    tilt = np.array([0.17, 0.08]) + rng.uniform(-0.03, 0.03, 2)
    q0 = np.array([0.0, 0.0, 0.3, np.sqrt(1.0 - tilt @ tilt), *tilt, 0.0])
    turning = np.array([1.0, 2.0]) + rng.uniform(-0.3, 0.3, 2)
    return cases.from_scene(scene, q0=q0, v0=np.array([0.3, 0.0, -0.5, *turning, 0.5]), t_end=0.3)


def test_truths_show_both_sides_of_the_kinks_of_shared_loads() -> None:
    """Where one of four corners begins to bear nothing, which is no event: splines across it were off by 1e-3 N."""
    for seed in ROCKING:
        run = engines.load("reference").prepare(rocking(seed), "compiled").run()
        kinks = np.setdiff1d(run.t[1:][np.diff(run.t) == 0.0], [event.t for event in run.events])
        times = sample_times(run, 0.3)
        assert len(kinks)
        assert all(np.count_nonzero(times == kink) == 2 for kink in kinks)


@pytest.mark.parametrize("profile", ["mujoco:matched", "pinocchio:law"])
@pytest.mark.parametrize("seed", ROCKING)
def test_a_load_that_goes_from_corner_to_corner_accuses_nobody(seed: int, profile: str) -> None:
    case, (name, way) = rocking(seed), profile.split(":")
    first = engines.load("reference").prepare(case, "compiled", rtol=1e-12).run()
    dense = engines.load("reference").prepare(case, "compiled", rtol=1e-12, samples=sample_times(first, 0.3)).run()
    truth = replace(from_run(with_both_sides(dense, first), Tier.D, "tight"), joined=True, touches=case.law.touches)
    run = engines.load(name).prepare(case, way).run()
    assert run.outcome.ok
    for metric, limit in (("complementarity", 1e-6), ("event_times", 1e-5 * 0.3)):
        off = metrics.load(metric).measure(truth, run, case)
        assert off is not None
        assert off <= limit, metric
