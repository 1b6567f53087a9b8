"""`crossbody list CASE` says what a case can be asked for."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from crossbody import cases, engines
from crossbody.cases import loading
from crossbody.hw import models
from crossbody.reports import described, metrics
from crossbody.reports.cli import cli


@pytest.mark.parametrize("name", cases.names())
def test_a_case_is_listed_with_all_that_it_can_be_asked_for(name: str) -> None:
    done = CliRunner().invoke(cli, ["list", name, "--json"])
    assert done.exit_code == 0, done.output
    told, source = json.loads(done.output), loading.module(name)
    assert list(told["variants"]) == list(cases.variants(name))
    assert list(told["parameters"]) == list(source.PARAMETERS)
    for variant in cases.variants(name):
        case = cases.load(name, variant)
        assert set(case.contacts) <= set(told.get("rows", ()))
        assert set(case.metrics) <= set(told.get("metrics of its own", ()))
        assert not set(case.metrics) & set(metrics.names())


@pytest.mark.parametrize("name", engines.names())
def test_an_engine_is_listed_with_its_profiles(name: str) -> None:
    try:
        told = described.one(name)
    except cases.EngineUnavailable:
        pytest.skip(f"{name} is not installed")
    assert told["Profiles"] == dict(engines.load(name).profiles)
    assert told["Versions"]
    assert "max_steps" in told["Settings for bouncing_ball"]


@pytest.mark.parametrize("name", engines.names())
def test_what_is_listed_as_a_setting_can_be_set_and_nothing_else_can(name: str) -> None:
    """What a profile fixes is listed apart."""
    try:
        engine, ball = engines.load(name), cases.load("bouncing_ball")
    except cases.EngineUnavailable:
        pytest.skip(f"{name} is not installed")
    for profile in (one for one in engine.profiles if engine.why_not(ball, one) is None):
        told, used = described.one(f"{name}:{profile}"), engine.planned(ball, profile)
        assert list(told["Profiles"]) == [profile]
        settings, fixed = told["Settings for bouncing_ball"], told.get("Fixed for bouncing_ball", {}).get(profile, "")
        for key, value in used.items():
            if key in settings:
                assert engine.planned(ball, profile, **{key: value}) == used
            else:
                assert f"{key}=" in fixed
                with pytest.raises(cases.UnknownName, match=f"There is no setting '{key}' of {name}:"):
                    engine.planned(ball, profile, **{key: value})


@pytest.mark.parametrize("name", cases.names())
def test_a_variant_is_listed_with_its_own_numbers(name: str) -> None:
    for variant, line in described.case(name)["Variants"].items():
        case, alone = cases.load(name, variant), described.case(f"{name}:{variant}")
        for key, one in loading.module(name).PARAMETERS.items():
            value = case.parameters[key]
            said = f"{value:g}" if isinstance(value, float) else str(value)
            assert f"({said} {one.unit}".rstrip() in alone["Parameters"][key] or said == ""
            assert (f"{key} {said}" in line) or value == one.default


@pytest.mark.parametrize("name", models.names())
def test_a_model_is_listed_with_its_parameters(name: str) -> None:
    told, model = described.one(name)["Parameters"], models.load(name)
    assert list(told) == list(model.parameters)
    assert all(told[key].startswith(one.doc) and one.unit in told[key] for key, one in model.parameters.items())


FILE = """<mujoco><worldbody><geom name="floor" type="plane" size="2 2 .1" friction=".5 0 0"/>
<body name="a" pos="0 0 .1"><freejoint name="f"/><geom name="ball" type="sphere" size=".1" friction=".5 0 0"/></body>
<body name="arm" pos="3 0 1"><joint name="h" axis="0 1 0"/>
<geom type="capsule" size=".02" fromto="0 0 0 .3 0 0"/></body>
</worldbody><actuator><motor name="m" joint="h" ctrlrange="-2 3"/></actuator></mujoco>"""


def test_a_file_is_listed_with_every_name_that_its_options_take(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(FILE)
    told = described.one(str(path))
    taken = [("start", name) for name in told["Coordinates (--start)"]]
    taken += [("rate", name) for name in told["Velocities (--rate)"]]
    places, turns = [f"f {x}" for x in "xyz"], [f"f r{x}" for x in "xyz"]
    assert [name for _, name in taken] == [*places, "h", *places, *turns, "h"]
    for option, name in taken:
        cases.load(str(path), **{option: f"{name} 0.25"})
    assert list(told["Bodies (--push)"]) == ["a", "arm"]
    assert told["Actuators (columns of --ctrl)"] == {"m": "[-2, 3]"}
    rubs = cases.load(str(path), friction=1)
    assert [*told.get("Rows", ()), *told["Rows if its motion comes to a contact with friction"]] == list(rubs.contacts)


def test_metrics_and_suites_that_list_names_are_described() -> None:
    listed = described.everything()
    for title in ("Metrics", "Stress suites"):
        for name, line in listed[title].items():
            assert described.one(name)[title] == {name: line}


def test_an_unknown_case_is_a_sentence() -> None:
    with pytest.raises(cases.UnknownName, match="There is no case 'newton'"):
        described.case("newton")


MOTOR = '<actuator><motor name="m" joint="j"/></actuator>'
FIXED = '<mujoco><worldbody><body name="base"><geom size=".1"/><body name="arm"><joint name="j"/>'
ARM = FIXED + '<geom size=".1" pos="0 0 .5" contype="0" conaffinity="0"/></body></body></worldbody>{0}</mujoco>'


@pytest.mark.parametrize("driven", [True, False])
def test_what_nothing_in_a_file_takes_is_neither_offered_nor_taken(tmp_path: Path, driven: bool) -> None:
    path, table, law = (tmp_path / name for name in ("arm.xml", "c.csv", "c.py"))
    path.write_text(ARM.format(MOTOR if driven else ""))
    table.write_text("t,m\n0,1\n")
    law.write_text("def f(t, q, v):\n    return [0.0]\n")
    told = described.case(str(path))
    offered = {"ctrl", "control", "tick"} & told["Parameters"].keys()
    assert offered == ({"ctrl", "control", "tick"} if driven else set())
    assert not {"rank", "assemble"} & told["Parameters"].keys(), "it has no loops"
    assert list(told["Bodies (--push)"]) == ["arm"]
    for given in ({"ctrl": str(table)}, {"control": f"{law}:f"}):
        if driven:
            assert cases.load(str(path), "reference", **given).scene is not None
        else:
            with pytest.raises(cases.CrossbodyError, match="has no actuators"):
                cases.load(str(path), "reference", **given)
    with pytest.raises(cases.InvalidValue, match="'base' is fixed: no joint moves it; valid: arm"):
        cases.load(str(path), "reference", push="base 1 0 0 0 .1")
    assert cases.load(str(path), "reference", push="arm 1 0 0 0 .1").inputs is not None
