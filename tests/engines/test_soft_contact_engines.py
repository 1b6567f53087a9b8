"""The soft contact in the engines: the same physics, written out once more, and the same run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import CaseUnsupported, Mode, Outcome
from crossbody.engines import load
from crossbody.reports.judging.audit import audit

PROBED = {"probe": 0.01, "probe_rate": 20.0, "release": 3.5, "rate_share": 0.5, "t_end": 4.0}
QUICK = {"close_start": 0.1, "close_end": 0.5, "release": 0.7, "release_time": 0.3, "t_end": 1.0}
"""A quick grasp that is let go again."""
LADDER = (8e-4, 4e-4, 2e-4)
LEFT, RIGHT = 0, 1
FLANGE, BLOCK = 0, 3


def touches(run):
    return [(e.contact, e.t) for e in run.events if e.after is Mode.CONTACT]


def assert_same_touches(theirs, ours, off):
    found, wanted = touches(theirs), touches(ours)
    assert [c for c, _ in found] == [c for c, _ in wanted]
    assert [t for _, t in found] == pytest.approx([t for _, t in wanted], abs=off)


@pytest.mark.parametrize("changed", [{}, PROBED])
@pytest.mark.parametrize("kstar", [0.0, 20.0])
def test_pinocchio_gives_the_run_of_the_reference(kstar, changed):
    pytest.importorskip("pinocchio")
    case = cases.load("soft_contact", kstar=kstar, **changed)
    ours = load("reference").prepare(case, rtol=1e-10).run()
    theirs = load("pinocchio").prepare(case, "law", rtol=1e-8, method="BDF").run()
    assert theirs.outcome is Outcome.FINISHED
    assert_same_touches(theirs, ours, 1e-7)
    np.testing.assert_allclose(theirs.q[-1], ours.q[-1], atol=1e-6)
    np.testing.assert_allclose(theirs.lam[-1], ours.lam[-1], atol=1e-4)


@pytest.mark.parametrize(
    ("kstar", "flange", "moved", "uneven"), [(0.0, 0.08e-3, 7.9e-3, 4e-3), (20.0, 6.4e-3, 1.6e-3, 3e-5)]
)
def test_mujoco_gives_the_run_of_the_reference(kstar, flange, moved, uneven):
    """Without feedback the block is pushed to the robot; with it the robot comes to the block."""
    pytest.importorskip("mujoco")
    case = cases.load("soft_contact", kstar=kstar)
    ours = load("reference").prepare(case, rtol=1e-12).run()
    theirs = load("mujoco").prepare(case).run()
    assert theirs.outcome is Outcome.FINISHED
    assert_same_touches(theirs, ours, 1e-7)
    np.testing.assert_allclose(theirs.q[-1], ours.q[-1], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(theirs.lam[-1], ours.lam[-1], atol=1e-7)
    assert theirs.q[-1, FLANGE] == pytest.approx(flange, abs=1e-5)
    assert case.q0[BLOCK] - theirs.q[-1, BLOCK] == pytest.approx(moved, abs=5e-5)
    assert abs(theirs.lam[-1, LEFT] - theirs.lam[-1, RIGHT]) < uneven


def test_mujoco_keeps_order_four_through_touch_and_release():
    """Forces of the pads and of the loop are those of every stage, in free flight too."""
    mujoco = pytest.importorskip("mujoco")
    case = cases.load("soft_contact", **QUICK)
    ours = load("reference").prepare(case, rtol=1e-12).run()
    runs = [load("mujoco").prepare(case, dt=dt).run() for dt in LADDER]
    for run in runs:
        assert run.mode[0].tolist() == run.mode[-1].tolist() == [Mode.FREE, Mode.FREE]
    ends = [np.abs(run.q[-1] - ours.q[-1]).max() for run in runs]
    left = [abs(dict(touches(run))[LEFT] - dict(touches(ours))[LEFT]) for run in runs]
    for errors in (ends, left):
        order = np.polyfit(np.log(LADDER), np.log(errors), 1)[0]
        assert 3.5 < order < 4.7, errors
    assert mujoco.get_mjcb_control() is None


@pytest.mark.parametrize(
    ("engine", "profile", "changed"),
    [
        ("pinocchio", "law", {"width": 0.03, "rate_share": 0.5}),
        ("mujoco", "matched", {"width": 0.03, "rate_share": 0.5}),
        ("pinocchio", "law", {"variant": "delta", "width": 0.03, "d1": 0.1, "d2": 0.02, "d3": 0.03}),
        ("mujoco", "matched", {"variant": "delta", "width": 0.03, "d1": 0.1, "d2": 0.02, "d3": 0.03}),
    ],
)
def test_engines_hold_the_same_physics(engine, profile, changed):
    pytest.importorskip(engine)
    case = cases.load("soft_contact", **changed)
    theirs = load("reference").prepare(case).audit()
    rows = audit(load(engine).prepare(case, profile).audit(), theirs, case)
    assert {row.quantity for row in rows} >= {"masses", "M", "bias", "H", "lam"}
    assert all(row.ok and not np.isnan(row.difference) for row in rows if row.quantity in theirs), rows


def test_the_obvious_model_in_mujoco_is_the_same_mechanism_with_softer_contacts():
    """Its balls touch at one place each, which gives way more than the pads do."""
    pytest.importorskip("mujoco")
    case = cases.load("soft_contact")
    prepared = load("mujoco").prepare(case, "default")
    rows = {row.quantity: row for row in audit(prepared.audit(), load("reference").prepare(case).audit(), case)}
    assert all(rows[same].ok for same in ("masses", "M", "bias"))
    assert not rows["constants"].ok
    run = prepared.run()
    assert run.outcome is Outcome.FINISHED
    assert run.q[-1, FLANGE] == pytest.approx(6.4e-3, abs=1e-5)
    squeezed = case.number("squeeze") + run.gap[-1]
    assert run.lam[-1].sum() == pytest.approx(case.number("kp") * squeezed.sum(), rel=1e-3)  # the block still comes
    assert 0.02 < run.lam[-1].max() / (case.number("kp") * case.number("squeeze")) < 0.03


HASTE = {"descent": 0.1, "rise": 0.8, "rise_time": 0.3}


@pytest.mark.parametrize(
    ("engine", "settings"),
    [("mujoco", {}), pytest.param("pinocchio", {"rtol": 1e-8, "method": "BDF"}, marks=pytest.mark.slow)],
)
def test_engines_give_the_run_of_the_reference_on_the_whole_robot(engine, settings):
    """Robot, loops, pads, block and table: touches, releases and the end of a quick grasp."""
    pytest.importorskip(engine)
    case = cases.load("soft_contact", "delta", **QUICK, **HASTE)
    ours = load("reference").prepare(case, rtol=1e-11).run()
    theirs = load(engine).prepare(case, **settings).run()
    assert theirs.outcome is Outcome.FINISHED
    assert_same_touches(theirs, ours, 1e-6)
    assert {c for c, _ in touches(theirs)} == {6, 7, 8}
    np.testing.assert_allclose(theirs.q[-1], ours.q[-1], atol=1e-8)
    np.testing.assert_allclose(theirs.lam[-1], ours.lam[-1], atol=1e-6)


def test_what_an_engine_cannot_do_is_said():
    pytest.importorskip("pinocchio")
    for variant in ("axis", "delta"):
        for profile in ("impulse", "impulse_simultaneous", "admm"):
            with pytest.raises(CaseUnsupported, match="depends on finite forces"):
                load("pinocchio").prepare(cases.load("soft_contact", variant), profile)


def test_what_mujoco_cannot_do_is_said():
    pytest.importorskip("mujoco")
    for variant in ("axis", "delta"):
        with pytest.raises(CaseUnsupported, match="machine 'level'"):
            load("mujoco").prepare(replace(cases.load("soft_contact", variant), fsm="edge"))
