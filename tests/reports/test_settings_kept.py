"""Settings that a run is said to have had are those that the engine's own model has."""

from __future__ import annotations

from typing import Any

import pytest

from crossbody import cases, engines
from crossbody.reports.judging.audit import settings_kept


def test_settings_of_mujoco_are_read_back_from_its_model() -> None:
    pytest.importorskip("mujoco")
    asked: dict[str, Any] = {"impratio": 10.0, "cone": "pyramidal", "noslip": 3, "timeconst": 0.01}
    run = engines.load("mujoco").prepare(cases.load("sliding_block", "stops"), "default", **asked)
    (row,) = settings_kept(run.audit(), run.settings)
    assert row.ok
    assert set(run.audit()["set"]) == set(asked)
    for name in asked:
        other = {**run.settings, name: "elliptic" if name == "cone" else 2.0 * asked[name]}
        (row,) = settings_kept(run.audit(), other)
        assert not row.ok


def test_settings_of_dart_are_read_back_from_its_world() -> None:
    pytest.importorskip("dartpy")
    for detector, e, sleep in (("dart", 0.3, False), ("fcl", 0.0, True)):
        given = {"detector": detector, "restitution": e, "sleep": sleep}
        run = engines.load("dart").prepare(cases.load("tossed_cube", "tumbles"), "matched", **given)
        assert run.audit()["set"] == pytest.approx(given)
        assert settings_kept(run.audit(), run.settings)[0].ok


def test_an_engine_that_shows_no_settings_has_no_row() -> None:
    run = engines.load("reference").prepare(cases.load("bouncing_ball", "linear"), "compiled")
    assert settings_kept(run.audit(), run.settings) == ()


def test_settings_of_exudyn_are_read_back_from_its_solver() -> None:
    pytest.importorskip("exudyn")
    engine, case = engines.load("exudyn"), cases.load("bouncing_ball", "linear")
    run = engine.prepare(case, "matched", rtol=1e-7, method="ODE23")
    assert run.audit()["set"] == {"rtol": 1e-7, "method": "ODE23"}
    assert settings_kept(run.audit(), run.settings)[0].ok
    fixed = engine.prepare(case, "default", dt=7e-4)  # which the horizon is no multiple of
    assert all(row.ok for row in settings_kept(fixed.audit(), fixed.settings))
