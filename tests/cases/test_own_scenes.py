"""A case in one file that returns a scene: named by its file, run, stressed and analysed like any other."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from click.testing import CliRunner

from crossbody import cases, engines
from crossbody.cases import Case, InvalidValue, SceneError
from crossbody.cases.scene import Actuator, Body, Joint, RowLaw, Scene
from crossbody.reports import suites
from crossbody.reports.cli import cli
from crossbody.reports.suites.axis import Levels, Linear

HEAD = """
from crossbody import cases
from crossbody.cases import Parameter
from crossbody.cases.scene import Body, Joint, Scene

PARAMETERS = {
    "length": Parameter(default=0.5, unit="m", low=0.1, high=1.0),
    "t_end": Parameter(default=0.4, unit="s", low=0.0, open_low=True),
    "mass": Parameter(default=2.0, unit="kg", low=0.0, open_low=True),
}
VARIANTS = {"short": {}, "long": {"length": 1.0}}


def build(variant, p):
    rod = Body(name="rod", mass=p["mass"], com=(0.0, 0.0, -p["length"]), inertia=(0.1, 0.1, 0.01, 0.0, 0.0, 0.0))
    hinge = Joint(name="hinge", body="rod", type="hinge", axis=(0.0, 1.0, 0.0), range=(-0.2, 2.0), reference=0.3)
    scene = Scene(bodies=(rod,), joints=(hinge,))
"""
RETURNS = {
    "scene": "    return scene\n",
    "case": '    return cases.from_scene(scene, q0=[1.0], t_end=p["t_end"])\n',
}


@pytest.fixture(params=sorted(RETURNS))
def path(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    file = tmp_path / "swing.py"
    file.write_text(HEAD + RETURNS[request.param])
    return str(file)


def test_it_has_the_names_and_numbers_of_its_file(path: str) -> None:
    case = cases.load(path, "long", mass=3.0)
    assert (case.name, case.variant, case.t_end) == ("swing", "long", 0.4)
    assert case.parameters == {"length": 1.0, "t_end": 0.4, "mass": 3.0}
    assert case.q0.tolist() in ([0.3], [1.0])
    for name in ("reference", "mujoco", "pinocchio"):
        assert engines.load(name).prepare(case).run().outcome.ok


def test_what_build_returns_otherwise_is_a_sentence(tmp_path: Path) -> None:
    file = tmp_path / "swing.py"
    file.write_text(HEAD + "    return hinge\n")
    with pytest.raises(SceneError, match=r"swing:short: build returns Joint.*valid: a Case or a Scene"):
        cases.load(str(file))


def test_a_file_of_ones_own_is_a_suite(path: str) -> None:
    """Its numbers are drawn within their bounds, those without any within twice and half their default."""
    suite = suites.load(path)
    assert [family.variant for family in suite.families] == ["short", "long"]
    assert dict(suite.families[0].axes) == {"length": Linear(0.1, 1.0), "mass": Linear(1.0, 4.0)}
    assert "mass" not in suites.load(path, {"mass": 1.0}).families[0].axes
    with pytest.raises(InvalidValue, match="'balls' has fixed parameters: mass cannot be given"):
        suites.load("balls", {"mass": 1.0})


def test_a_robots_file_is_a_suite(tmp_path: Path) -> None:
    file = tmp_path / "arm.xml"
    geom = '<geom type="sphere" size=".1" mass="2" contype="0" conaffinity="0"/>'
    joint = '<joint name="h" type="hinge" axis="0 1 0" range="-1 1" limited="true" frictionloss="1"/>'
    file.write_text(f'<mujoco><worldbody><body name="a" pos="0 0 1">{joint}{geom}</body></worldbody></mujoco>')
    assert set(suites.load(str(file)).families[0].axes) == {"a0", "a1", "push"}
    family = suites.load(str(file), {"without": "friction"}).families[0]
    assert set(family.axes) == {"a0", "a1", "push"}
    pushes = family.axes["push"]
    assert isinstance(pushes, Levels)
    for push in pushes.values:
        found = cases.load(str(file), push=push, without="friction")
        assert isinstance(found, Case)


def test_the_command_runs_it(path: str, tmp_path: Path) -> None:
    out = str(tmp_path / "out")
    told = CliRunner().invoke(cli, ["stress", path, "--runs", "4", "--jobs", "1", "--set", "mass=1", "--out", out])
    assert told.exit_code == 0, told.output
    told = CliRunner().invoke(cli, ["analyse", path])
    assert told.exit_code == 0, told.output


def bounded(law: RowLaw) -> Scene:
    cart = Body(name="cart", mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))
    rail = Joint(name="x", body="cart", type="slide", axis=(1.0, 0.0, 0.0), range=(-1.0, 1.0), law=law)
    return Scene(bodies=(cart,), joints=(rail,))


def test_constants_that_nobody_would_follow_are_refused() -> None:
    with pytest.raises(SceneError, match="b0, b1 must be 0"):
        cases.from_scene(bounded(RowLaw(a0=1e4, a1=1.0, b0=1e6)))


def test_a_cubic_term_is_followed_by_every_engine_with_the_law() -> None:
    def ends(a2: float, *picks: tuple[str, str]) -> list[float]:
        case = cases.from_scene(bounded(RowLaw(a0=1e4, a1=1.0, a2=a2)), v0=[2.0], t_end=1.0)
        return [float(engines.load(name).prepare(case, profile).run().v[-1, 0]) for name, profile in picks]

    found = ends(1e7, ("reference", "compiled"), ("mujoco", "matched"), ("pinocchio", "law"))
    assert found == pytest.approx([found[0]] * 3, abs=1e-5)
    assert ends(0.0, ("reference", "compiled"))[0] != pytest.approx(found[0], abs=1e-3)


@pytest.mark.parametrize("time_constant", [-1.0, 0.0, math.inf, 1e-3, 1e3])
@pytest.mark.parametrize("activation", ["", "integrator", "filter"])
def test_a_filter_alone_has_a_time_constant(activation: str, time_constant: float) -> None:
    given = {"name": "motor", "joint": "hinge", "activation": activation, "time_constant": time_constant}
    given_one = 0.0 < time_constant < math.inf
    if given_one == (activation == "filter") and math.isfinite(time_constant):
        assert Actuator(**given).time_constant == time_constant
    else:
        with pytest.raises(SceneError, match=r"only a filter has one, above 0 s|it must be finite"):
            Actuator(**given)


@pytest.mark.parametrize("field", ["q0", "v0"])
@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_a_start_that_is_not_finite_is_the_case_s(field: str, wrong: float) -> None:
    hinge = Joint(name="hinge", body="rod", type="hinge", axis=(0.0, 1.0, 0.0))
    scene = Scene(bodies=(Body(name="rod", mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)),), joints=(hinge,))
    with pytest.raises(SceneError, match=rf"^Case scene: {field} is \[{wrong}\]; it must be finite\.$"):
        cases.from_scene(scene, **{field: [wrong]})
