"""What `crossbody analyse` says first: held to MuJoCo's own steps, and to closed forms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from crossbody import cases
from crossbody.engines import equations
from crossbody.reports.analysis import summary as told
from crossbody.reports.analysis.places import places

CART = """<mujoco model="cart"><option timestep="{dt}" integrator="{method}"/><worldbody>
  <body name="cart"><joint name="x" type="slide" axis="1 0 0" damping="{damping}"/>
    <geom type="box" size=".2 .1 .1" mass="1"/>
    <body name="pole"><joint name="hinge" type="hinge" axis="0 1 0" damping=".01"/>
      <geom type="capsule" size=".02" fromto="0 0 0 0 0 {end}" mass=".2"/></body></body>
</worldbody><actuator><position name="servo" joint="x" kp="{kp}" kv="{kv}"/></actuator></mujoco>"""


def cart(
    folder: Path, dt: float = 0.001, damping: float = 1.0, kp: float = 2000.0, kv: float = 0.0, end: float = -0.6,
    method: str = "Euler",
) -> Path:  # fmt: skip
    path = folder / "cart.xml"
    path.write_text(CART.format(dt=dt, damping=damping, kp=kp, kv=kv, end=end, method=method))
    return path


def analysed(path: Path) -> tuple[Any, str]:
    case = cases.load(str(path))
    found = places(case)
    rows = told.summary(found, case)
    return rows, told.sentence(case.label, rows, len(found))


def radius(path: Path, dt: float) -> float:
    """Return the largest modulus of MuJoCo's own step of the file, with all that it does implicitly."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = dt
    data, A = mujoco.MjData(model), np.zeros((2 * model.nv,) * 2)
    mujoco.mjd_transitionFD(model, data, 1e-6, True, A, None, None, None)
    return float(np.abs(np.linalg.eigvals(A)).max())


@pytest.mark.parametrize("seed", range(8))
def test_the_largest_step_is_that_at_which_mujoco_becomes_unstable(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    damping, kp, kv = (float(10.0 ** rng.uniform(*ends)) for ends in ((-2, 3), (0, 4), (-1, 3.5)))
    path = cart(tmp_path, damping=damping, kp=kp, kv=kv)
    step = float(analysed(path)[0]["step"].iloc[0])
    assert radius(path, 0.98 * step) <= 1.0 + 1e-6
    assert radius(path, 1.02 * step) > 1.0 + 1e-4


def test_a_step_of_the_file_that_is_too_long_is_warned_of(tmp_path: Path) -> None:
    """A servo that damps at 2600 N s/m is explicit in Euler's step: 2/2468 s."""
    rows, text = analysed(cart(tmp_path, kv=2600.0))
    (row,) = rows.to_dict(orient="records")
    assert row["verdict"] == "stable"
    assert row["step"] == pytest.approx(2.0 / row["fastest"], rel=1e-2)
    assert "Warning: the file's own step of 0.001 s is longer, and MuJoCo diverges there." in text
    assert radius(tmp_path / "cart.xml", 0.001) > 1.0
    for more in ({"dt": 1e-4}, {"method": "implicitfast"}):
        assert "Warning" not in analysed(cart(tmp_path, kv=2600.0, **more))[1]


def test_a_damper_of_a_joint_limits_no_step(tmp_path: Path) -> None:
    """MuJoCo takes it implicitly."""
    rows, text = analysed(cart(tmp_path, damping=5000.0, kp=0.0))
    assert radius(tmp_path / "cart.xml", 0.001) <= 1.0 + 1e-9
    assert rows["step"].iloc[0] > 0.1
    assert "Warning" not in text


def test_a_pole_that_stands_is_unstable_and_the_sentence_comes_first(tmp_path: Path) -> None:
    rows, text = analysed(cart(tmp_path, end=0.6, kp=0.0))
    assert rows["verdict"].tolist() == ["unstable"]
    assert text.startswith("cart.xml:reference, touching nothing: unstable, hinge grows at ")


def test_the_command_prints_it_before_its_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from crossbody.reports.commands.analyse import analyse

    analyse(str(cart(tmp_path)), None, [], [], bode=False, locus=None, mapped=False, out=None, command="")
    lines = " ".join(capsys.readouterr().out.split())
    assert lines.index("stable, what dies out last is hinge") < lines.index("operating points")


def test_no_instant_of_a_motion_is_called_an_equilibrium(capsys: pytest.CaptureFixture[str]) -> None:
    from crossbody.reports.commands.analyse import analyse

    analyse("sliding_block", None, [], [], bode=False, locus=None, mapped=False, out=None, command="")
    said = capsys.readouterr().out
    assert "moving" in said
    assert "equilibri" not in said


def test_equations_are_built_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from crossbody.engines import reference

    case, made = cases.load(str(cart(tmp_path))), []
    own = equations.equations_of
    for module in (equations, reference):
        monkeypatch.setattr(module, "equations_of", lambda *given: made.append(given) or own(*given))
    assert len(places(case)) == 1
    assert len(made) == 1


def test_several_operating_points_are_counted() -> None:
    case = cases.load("ball_maze", "outside")
    found = places(case)
    rows = told.summary(found, case)
    text = told.sentence(case.label, rows, len(found))
    unstable = int((rows["verdict"] == "unstable").sum())
    assert unstable >= 4
    assert f"{unstable} of {len(rows)} operating points are unstable (ring 0, top; " in text
    assert "grows at 4.71 1/s" in text
