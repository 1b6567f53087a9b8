"""Settings that a run is said to have had are those that the engine's own model has."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import Case, CrossbodyError, EngineUnavailable, Parameter, Value
from crossbody.reports.judging.audit import audit, settings_kept

FILE = """<mujoco><compiler autolimits="true"/><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
<body name="a" pos="0 0 .3"><freejoint/><geom name="g" size=".1" solref=".03 .8"/></body>
<body name="b" pos="1 0 1"><joint name="j" axis="0 1 0" range="-30 30"/><geom name="h" size=".1" pos=".1 0 0"/></body>
</worldbody><contact>{}</contact></mujoco>"""
PAIR = '<pair geom1="g" geom2="h" solref=".04 1"/>'


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


def _drawn(one: Parameter, draw: np.random.Generator) -> Iterator[Value]:
    """Every word of a setting; of a number one that is near its default, and others between its bounds."""
    if isinstance(one.default, (str, bool)):
        yield from one.choices or (True, False)
        return
    size = float(one.default) if one.default > 0.0 else 1.0
    for value in size * np.array([draw.uniform(0.5, 2.0), *10.0 ** draw.uniform(-3.0, 3.0, 2)]):
        value = float(np.clip(value, one.low, one.high))
        yield round(value) if isinstance(one.default, int) else value


def _settings(case: Case) -> Iterator[tuple[engines.Engine, str, str, Value]]:
    """Every setting of every engine that runs a case, with what may be asked of it."""
    draw = np.random.default_rng(20240917)
    for name in engines.names():
        try:
            engine = engines.load(name)
        except EngineUnavailable:
            continue
        for profile in engine.profiles:
            if engine.why_not(case, profile) is None:
                for key, one in engine.offered(case, profile).items():
                    yield from ((engine, profile, key, value) for value in _drawn(one, draw))


@pytest.mark.parametrize(("pair", "more"), [("", {}), ("", {"friction": 1}), (PAIR, {}), (PAIR, {"friction": 1})])
def test_what_was_asked_of_an_engine_is_no_fault_of_an_importer(
    pair: str, more: dict[str, Any], tmp_path: Path
) -> None:
    """The same physics reached every engine, whatever it was told about solving it."""
    pytest.importorskip("mujoco")
    path = tmp_path / "ball.xml"
    path.write_text(FILE.format(pair))
    case = cases.from_file(path, **more or {"without": "friction"})
    theirs = engines.load("reference").prepare(case, "compiled").audit()
    asked = count()
    for engine, profile, name, value in _settings(case):
        try:
            run = engine.prepare(case, profile, **{name: value})
        except CrossbodyError:  # what does not go together, in a sentence
            continue
        rows = (*audit(run.audit(), theirs, case, engine.hidden_in(profile)), *settings_kept(run.audit(), run.settings))
        assert all(row.ok for row in rows), (engine.name, profile, name, value, [row for row in rows if not row.ok])
        next(asked)
    assert next(asked) > 20


@pytest.mark.parametrize("name", ["geom_solref", "pair_solref"])
def test_a_time_constant_that_reached_not_all_that_touches_is_seen(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mujoco")
    from crossbody.engines.mujoco import _model

    path, kept = tmp_path / "ball.xml", _model._set

    def undone(model: Any, *asked: Any) -> dict[str, Any]:
        getattr(model, name)[0, 0] *= 0.5
        return kept(model, *asked)

    path.write_text(FILE.format(PAIR))
    monkeypatch.setattr(_model, "_set", undone)
    run = engines.load("mujoco").prepare(cases.from_file(path, friction=1), "as_is", timeconst=0.05)
    assert not settings_kept(run.audit(), run.settings)[0].ok
