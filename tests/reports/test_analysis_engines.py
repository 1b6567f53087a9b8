"""Linear models of engines beside the reference's: right to their limit, or off by exactly what is known of them."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import CaseUnsupported
from crossbody.engines.linear import Chart
from crossbody.reference.linear.differences import differences
from crossbody.reports.analysis import counterparts as work
from crossbody.reports.analysis.places import places
from crossbody.reports.commands.analyse import analyse
from crossbody.reports.judging import known

mujoco, pinocchio = (pytest.importorskip(name) for name in ("mujoco", "pinocchio"))
SCENES = [
    ("bouncing_ball", "listing", {}),
    ("bouncing_ball", "bilateral", {}),
    ("delta_free", "light", {}),
    ("delta_impulse", "heavy", {}),
    ("delta_tracking", "circle", {}),
    ("delta_singularity", "light", {}),
    ("newtons_cradle", "sliders", {}),
    ("newtons_cradle", "pendulums", {"n": 3}),
    ("red_body", None, {}),
    ("soft_contact", "axis", {}),
    ("soft_contact", "axis", {"kstar": 0.0}),
    ("soft_contact", "delta", {}),
    ("ball_maze", "outside", {}),
    ("ball_maze", "free", {}),
    ("ball_maze", "free", {"rolling": 0}),
    ("ball_maze", "balanced", {}),
]


@pytest.fixture(scope="module", params=SCENES, ids=[f"{n}:{v} {p}" for n, v, p in SCENES])
def compared(request):
    name, variant, changed = request.param
    found = places(cases.load(name, variant, **changed))
    return found, *work.counterparts(found)


def test_a_way_is_right_or_off_by_what_is_known_of_it(compared):
    found, rows, _ = compared
    assert set(rows["engine"]) == set(work.ENGINES)
    right = rows["why"] == ""
    assert set(rows[right]["place"]) == {place.name for place in found if place.spot is not None}
    assert (rows[right]["verdict"] == "within").all()
    assert (rows[right][["slope", "poles"]] < [work.SLOPE, work.POLES]).all(axis=None)
    known = rows[~right & (rows["verdict"] != "skipped")]
    assert (known["unexplained"] < work.EXPLAINED).all()
    assert known["verdict"].isin(["within", "expected-outside"]).all()


def test_every_pole_has_one_beside_it(compared):
    found, _, poles = compared
    for place in (place for place in found if place.spot is not None):
        for _, own in poles[poles["place"] == place.name].groupby(["engine", "way"]):
            assert len(own) == len(place.model.states)
            expected = place.model.poles()
            own_reference = own["reference_real"] + 1j * own["reference_imag"]
            scale = np.abs(expected).max(initial=1e-3)
            np.testing.assert_allclose(own_reference.sum(), expected.sum(), atol=1e-9 * scale)


def test_the_known_errors_are_large_where_they_are():
    """Of constrained derivatives at a loaded pose more than the entries; of the logarithm as the step."""
    rows, _ = work.counterparts(places(cases.load("delta_free")))
    by_way = rows.set_index("way")["slope"]
    assert by_way["computeConstraintDynamicsDerivatives"] > 1.0
    assert 1e-3 < by_way["mjd_transitionFD, one-sided, logarithm"] < 1e-2


def test_derivatives_of_pinocchio_err_as_the_force_on_the_loops():
    """Where the servos end nothing pulls at the loops, and the same derivatives are right."""
    rows, _ = work.counterparts(places(cases.load("delta_singularity")), ["pinocchio"])
    loaded, unloaded = rows[rows["way"] == "computeConstraintDynamicsDerivatives"]["slope"]
    assert loaded > 1.0
    assert unloaded < work.SLOPE


@pytest.mark.parametrize("dynamics", ["filter", "integrator"])
def test_activations_are_said_to_be_left_out_by_engines(dynamics, tmp_path):
    (tmp_path / "lag.xml").write_text(
        f"""<mujoco><worldbody><body pos="0 0 1"><joint name="j" axis="0 1 0" damping=".2"/>
        <inertial pos="0 0 -.3" mass="1" diaginertia=".01 .01 .01"/></body></worldbody>
        <actuator><general joint="j" dyntype="{dynamics}" dynprm=".05" gainprm="2"/></actuator></mujoco>"""
    )
    rows, _ = work.counterparts(places(cases.from_file(str(tmp_path / "lag.xml"))))
    assert set(rows["engine"]) == set(work.ENGINES)
    assert set(rows["verdict"]) == {"skipped"}
    assert rows["why"].str.contains("Activations").all()


def test_a_wrong_engine_is_outside(monkeypatch, capsys):
    known.check("analyse")  # of the engines as they are
    load = engines.load

    def linearise(case, spot):
        (way, *_) = load("pinocchio").linearise(case, spot)
        return (replace(way, slope=way.slope * (1.0 + 1e-6)),)

    monkeypatch.setattr(engines, "load", lambda name: SimpleNamespace(linearise=linearise))
    found = places(cases.load("bouncing_ball", "linear"))
    assert set(work.counterparts(found)[0]["verdict"]) == {"outside"}
    options = {"bode": False, "locus": None, "mapped": False, "out": None, "command": ""}
    assert analyse("bouncing_ball", "linear", [], [], **options) == 1
    assert "outside" in capsys.readouterr().out


def test_what_an_engine_cannot_do_is_a_row_with_its_sentence():
    rows, poles = work.counterparts(places(cases.load("bouncing_ball", "linear")), ["mujoco", "pymunk", "nobody"])
    skipped = rows[rows["verdict"] == "skipped"].set_index("engine")["why"]
    assert set(skipped.index) == {"pymunk", "nobody"}
    absent = importlib.util.find_spec("pymunk") is None
    assert ("not installed" if absent else "does not linearise") in skipped["pymunk"]
    assert set(poles["engine"]) == {"mujoco"}
    for name in work.ENGINES:
        with pytest.raises(CaseUnsupported, match="sampled"):
            engines.load(name).linearise(cases.load("ball_maze", "solve", controller="sampled"), None)


def test_poles_that_nearly_coincide_are_compared_by_their_mean():
    expected = np.array([-1.0 + 1e-4, -1.0 - 1e-4, -5.0])
    assert work._clusters_apart(expected, expected + np.array([1e-4, -1e-4, 0.0])) < 1e-15
    assert work._clusters_apart(expected, expected + np.array([0.0, 0.0, 0.05])) == pytest.approx(0.01)


def test_a_chart_takes_derivatives_at_rest_along():
    """Polar to Cartesian: r'' = -k (r - 1), b'' = -c b', as x'' = f(x, x') differenced in x, y."""
    k, c, b = 3.0, 0.4, 0.7

    def acceleration(z):
        (x, y, xd, yd), rho = z, np.hypot(z[0], z[1])
        n, t = np.array([x, y]) / rho, np.array([-y, x]) / rho
        rate, turn = n @ [xd, yd], t @ [xd, yd] / rho
        return (-k * (rho - 1.0) - rho * turn**2) * n + (-c * turn * rho + 2.0 * rate * turn) * t

    at = np.array([np.cos(b), np.sin(b), 0.0, 0.0])
    T = np.array([[np.cos(b), -np.sin(b)], [np.sin(b), np.cos(b)]])
    own = np.array([[-k, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, -c]])
    found = Chart(T=T, S=np.linalg.inv(T)).slope(own)
    np.testing.assert_allclose(found, differences(acceleration, at, 1e-3), atol=1e-10)
