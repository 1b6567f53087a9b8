"""Equilibria, modes and maps: every system's derivatives, and what the presentations claim about their poles."""

from __future__ import annotations

import html
import json

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import CaseUnsupported, InvalidValue, Outcome, SceneError, UnknownName
from crossbody.cases.mechanisms.maze import claims as maze_forms
from crossbody.cases.scene import Body, Joint, RowLaw, Scene
from crossbody.reference import delta, simulate
from crossbody.reference.delta.loop import closed_loop
from crossbody.reference.delta.scene import controller_of, robot_of
from crossbody.reference.linear import (
    LinearModel,
    controllable,
    linearise,
    locus,
    modes,
    observable,
    poses,
    tangents,
    trim,
)
from crossbody.reference.sundials.equations import Equations
from crossbody.reports.analysis import numbers
from crossbody.reports.analysis import places as analyse
from crossbody.reports.analysis.loci import Family, limits
from crossbody.reports.analysis.summary import over, sentence, summary

RNG = np.random.default_rng(27)
LAW = RowLaw(a0=1e4, a1=50.0)


def at(name, variant, rows, spread=1e-2, **changed):
    case = cases.load(name, variant, **changed)
    system = analyse.build(case)
    n = system.n
    q = case.q0 + spread * RNG.normal(size=n) * np.maximum(np.abs(case.q0), 1e-2)
    return system, q, 0.1 * RNG.normal(size=n), RNG.normal(size=system.inputs), rows


SCENES = {
    "ball in contact": at("bouncing_ball", "listing", [0]),
    "delta": at("delta_impulse", None, list(range(6))),
    "delta with servos": at("delta_singularity", None, list(range(6))),
    "sliders, two touch": at("newtons_cradle", "sliders", [1, 2]),
    "pendulums, all touch": at("newtons_cradle", "pendulums", [0, 1, 2, 3]),
    "pendulums, free": at("newtons_cradle", "pendulums", []),
    "maze, locked, rolling": at("ball_maze", "outside", [0, 6]),
    "maze, free, frictionless": at("ball_maze", "free", [3], rolling=0),
    "maze, balanced": at("ball_maze", "balanced", [0, 6]),
    "maze, ball in the air": at("ball_maze", "solve", []),
    "red body on its feet": at("red_body", None, [0, 1, 2, 3]),
    "fingers, grasp": at("soft_contact", "axis", [0, 1]),
    "robot and block": at("soft_contact", "delta", [0, 1, 2, 3, 4, 5, 8]),
}


@pytest.fixture(params=SCENES, ids=list(SCENES))
def scene(request):
    return SCENES[request.param]


def test_compiled_derivatives_are_those_of_the_single_state(scene):
    """Columns stepped together and the reduced solve, against column by column and the saddle matrix."""
    system, q, v, u, rows = scene
    many = tangents(system, [q, q], [v, v], [u, u], rows)
    one, n = linearise(system, q, v, u, rows, outputs=("lam",)), system.n
    assert many.well_posed.all()
    for k in range(2):
        for found, expected in (
            (many.vd_x[k], one.A[n:]), (many.vd_u[k], one.B[n:]), (many.lam_x[k], one.C[rows]),
            (many.lam_u[k], one.D[rows]),
        ):  # fmt: skip
            np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max(initial=1e-30))


def test_the_model_is_the_tangent_of_the_simulator(scene):
    """Against fourth-order differences of what the simulator integrates: its accelerations in this mode set."""
    system, q, v, u, rows = scene
    n, equations = system.n, Equations(system)
    equations.activate([1 if i in rows else 0 for i in range(system.nc)])
    equations.u[:] = u

    def rate(x):
        return equations.accelerate(0.0, x[:n].copy(), x[n:].copy())[0]

    x, columns = np.concatenate([q, v]), []
    for k in range(2 * n):
        d = 2e-4 * np.eye(2 * n)[k] * np.clip(np.abs(x[k]), 1e-2, 1.0)
        near, far = rate(x + d) - rate(x - d), rate(x + 2 * d) - rate(x - 2 * d)
        columns.append((8.0 * near - far) / (12.0 * d[k]))
    expected = np.array(columns).T
    found = linearise(system, q, v, u, rows).A[n:]
    scale = np.maximum(np.abs(expected).max(axis=1, keepdims=True), 1e-6 * np.abs(expected).max() + 1e-9)
    assert np.abs((found - expected) / scale).max() < 1e-7


def heave(robot, z):
    """Poles (6,) of the robot held with its flange on the axis at depth z, and the weight of z in each mode."""
    system, q = delta.system(robot, p=20.0), delta.inverse(robot, [0.0, 0.0, z])
    held = trim(system, q, free=[], inputs=[0, 1, 2])
    assert held.outcome is Outcome.FINISHED
    np.testing.assert_allclose(held.u[:3], delta.gravity_torque(robot, q)[0], rtol=1e-10)
    model = linearise(system, q, u=held.u, outputs=("q",), reduce=True)
    found = modes(model)
    moves = np.abs(np.asarray(delta.virtual_jacobian(robot, q)) @ model.C @ found.vectors)
    return found.poles, moves[2] / np.linalg.norm(moves, axis=0)


@pytest.mark.parametrize(("robot", "depth"), [(delta.HEAVY, 0.41), (delta.LIGHT, 0.41)])
def test_heave_is_unstable_above_a_depth_and_lateral_modes_are_stable(robot, depth):
    for z in (depth - 0.06, depth - 0.01, depth + 0.02, depth + 0.1, depth + 0.25):
        poles, vertical = heave(robot, z)
        up, sideways = poles[vertical > 0.99], poles[vertical < 0.01]
        assert (len(up), len(sideways)) == (2, 4)
        assert sideways.real.max() < 0.0
        assert (up.real.max() > 0.0) == (z < depth)


def test_the_map_of_the_workspace_is_the_single_model_at_every_pose():
    robot, system = delta.HEAVY, delta.system(delta.HEAVY, p=20.0)
    z = np.column_stack([RNG.uniform(-0.15, 0.15, (40, 2)), RNG.uniform(0.35, 0.7, 40)])
    q, there = delta.inverses(robot, z)
    assert there.all()
    np.testing.assert_allclose(q[0], delta.inverse(robot, z[0]), atol=1e-13)
    found = poses(system, q, [0, 1, 2])
    for k in range(0, 40, 8):
        np.testing.assert_allclose(found.u[k, :3], delta.gravity_torque(robot, q[k])[0], rtol=1e-10)
        single = linearise(system, q[k], u=found.u[k], reduce=True).poles()
        a, b = (x[np.lexsort((x.imag.round(6), x.real.round(6)))] for x in (single, found.poles[k]))
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * np.abs(a).max())
    assert (found.growth > 0.0).any()
    assert (found.growth < 0.0).any()


def test_the_map_counts_the_poles_of_the_single_model_at_every_place() -> None:
    case = cases.load("delta_free")
    table = numbers.workspace(case, points=9)
    robot = robot_of(case.parameters)
    system = delta.system(robot, p=case.number("p"))
    assert [np.ptp(table[axis]) for axis in "xz"] == pytest.approx([0.6, 0.45])
    assert len(table[["x", "z"]].drop_duplicates()) == 81
    reached = table[table["growth"].notna()]
    assert not table[table["growth"].isna()]["unstable"].any()
    assert reached["unstable"].gt(0).equals(reached["growth"] > 0.0)
    assert reached["unstable"].nunique() > 1
    for place in reached.iloc[:: len(reached) // 6].itertuples():
        q = delta.inverse(robot, (place.x, 0.0, place.z))
        found = linearise(system, q, u=poses(system, q[None], [0, 1, 2]).u[0], reduce=True).poles()
        assert place.growth == pytest.approx(found.real.max(), rel=1e-9, abs=1e-6)
        assert place.unstable == np.sum(found.real > 1e-6)


def test_poses_out_of_reach_and_singular_ones_are_told():
    assert not delta.inverses(delta.LIGHT, [[0.0, 0.0, 2.0]])[1].any()
    robot = delta.LIGHT
    y = delta.elbow_angle(robot)
    q = np.tile([y, np.arccos(-(robot.offset + robot.l1 * np.cos(y)) / robot.l2), 0.0], 3)
    reached = delta.inverse(robot, (0.0, 0.0, 0.6))
    found = poses(delta.system(robot), [q, reached], [0, 1, 2])
    assert found.well_posed.tolist() == [False, True]
    assert np.isnan(found.growth).tolist() == [True, False]
    for signal in (found.u, found.lam, found.basis, found.A, found.poles):
        assert np.isnan(signal[0]).all()
        assert np.isfinite(signal[1]).all()
    for hold in ([0, 1], [0, 1, 1], [0, 1, -1], [0, 1, 6]):
        with pytest.raises(SceneError, match="3 inputs"):
            poses(delta.system(robot), [q], hold)


def test_derivatives_that_are_no_numbers_are_told() -> None:
    system, q = delta.system(delta.LIGHT), delta.inverse(delta.LIGHT, (0.0, 0.0, 0.6))
    found = tangents(system, [q, q], [np.zeros(9), np.full(9, 1e200)])
    assert found.well_posed.tolist() == [True, False]
    for whole in (found.vd, found.lam, found.vd_x, found.vd_u, found.lam_x, found.lam_u):
        assert np.isfinite(whole[0]).all()
        assert np.isnan(whole[1]).all()


def test_the_linearised_loop_has_the_characteristic_coefficients():
    """u = My Jy^-1 (ki INT e + kp e + kd e' ) + tau_g about a pose: (s + 7)^3 in each direction of the task."""
    robot, system = delta.LIGHT, delta.system(delta.LIGHT, p=20.0)
    q = delta.inverse(robot, [0.03, -0.02, 0.6])
    u = trim(system, q, free=[], inputs=[0, 1, 2]).u
    plant = linearise(system, q, u=u, outputs=("q", "v"), reduce=True)
    _, Jy, _ = delta.jacobians(robot, q)
    Jv, My = np.asarray(delta.virtual_jacobian(robot, q)), delta.task_mass(robot, q)
    K, nx = My @ np.linalg.inv(Jy), 6
    z, zd = Jv @ plant.C[:9], Jv @ plant.C[9:]
    drop = _reflected_friction(robot, q)  # the law gives back what the joints' friction takes
    A, B = plant.A, plant.B[:, :3]
    loop = np.zeros((nx + 3, nx + 3))
    loop[:nx, :nx] = A + B @ (
        K @ (-147.0 * z - 21.0 * zd) + drop @ (np.linalg.solve(Jy, zd)) - _stiffness(robot, q, z, Jy)
    )
    loop[:nx, nx:] = 343.0 * B @ K
    loop[nx:, :nx] = -z
    s = 1j * np.geomspace(0.1, 50.0, 12)
    determinant = np.array([np.linalg.det(x * np.eye(nx + 3) - loop) for x in s])
    ideal = ((s + 7.0) ** 3) ** 3
    np.testing.assert_allclose(determinant, ideal, rtol=5e-3)


def _reflected_friction(robot, q):
    _, _, X = delta.jacobians(robot, q)
    S = np.zeros((9, 3))
    S[[0, 3, 6]] = np.eye(3)
    S[[1, 2, 4, 5, 7, 8]] = X
    return S.T @ np.diag(np.tile([robot.d1, robot.d2, robot.d3], 3)) @ S


def _stiffness(robot, q, z, Jy):
    """Minus the slope of the gravity torque by the state, which the controller follows."""
    step, y = 1e-6, q[[0, 3, 6]]
    slope = np.column_stack(
        [
            delta.gravity_torque(robot, delta.forward(robot, y + step * e, q))[0]
            - delta.gravity_torque(robot, delta.forward(robot, y - step * e, q))[0]
            for e in np.eye(3)
        ]
    ) / (2 * step)
    return -slope @ np.linalg.solve(Jy, z)


@pytest.mark.parametrize("ring", range(4))
def test_a_ball_on_a_locked_ring_falls_at_the_rate_of_the_closed_form(ring):
    places = {p.name: p for p in analyse.places(cases.load("ball_maze", "outside"))}
    top, bottom = places[f"ring {ring}, top"].model.poles(), places[f"ring {ring}, bottom inside"].model.poles()
    assert top.real.max() == pytest.approx([4.70823, 3.58380, 3.00459, 2.63662][ring], rel=2e-6)
    period = 2.0 * np.pi / np.abs(bottom.imag).max()
    assert period == pytest.approx([0.789814, 1.384439, 1.795122, 2.126450][ring], rel=1e-6)


def test_feedback_places_the_poles_on_every_ring():
    k2, k1, k0 = maze_forms.balance_gains(5.0)
    for place in analyse.places(cases.load("ball_maze", "balanced")):
        poles = place.model.poles()
        moving = poles[np.abs(poles) > 1.0]
        np.testing.assert_allclose(np.poly(moving), [1.0, k2, k1, k0], rtol=1e-9)


def test_a_ball_in_contact_follows_its_law_at_rest():
    case = cases.load("bouncing_ball", "linear", a0=900.0, a1=12.0)
    (place,) = analyse.places(case)
    assert place.trim.lam == pytest.approx([9.81])
    np.testing.assert_allclose(np.poly(place.model.poles()), [1.0, 12.0, 900.0], rtol=1e-12)


def test_trim_finds_the_pose_from_torques_and_says_where_there_is_none():
    robot, system = delta.LIGHT, delta.system(delta.LIGHT, p=20.0)
    q = delta.inverse(robot, [0.05, 0.02, 0.55])
    torque = np.concatenate([delta.gravity_torque(robot, q)[0], np.zeros(3)])
    found = trim(system, q + 0.03, u=torque)
    assert found.outcome is Outcome.FINISHED
    np.testing.assert_allclose(found.q, q, atol=1e-12)
    assert simulate(system, found.q, np.zeros(9), 0.2, inputs=([0.0], [torque])).q[-1] == pytest.approx(q, abs=1e-9)
    ball = analyse.build(cases.load("bouncing_ball", "linear"))
    assert trim(ball, [1.0], active=[]).outcome is Outcome.STEP_LIMIT
    lifted = analyse.build(cases.load("bouncing_ball", "linear", gravity=0.0))
    assert trim(lifted, [0.3], active=[0]).q == pytest.approx([0.0], abs=1e-12)


def model(A, B, C):
    A, B, C = (np.asarray(x, dtype=float) for x in (A, B, C))
    return LinearModel(
        A=A, B=B, C=C, D=np.zeros((len(C), B.shape[1])), states=tuple(f"x{i}" for i in range(len(A))),
        inputs=tuple(f"u{i}" for i in range(B.shape[1])), outputs=tuple(f"y{i}" for i in range(len(C))),
    )  # fmt: skip


@pytest.mark.parametrize("reached", range(1, 7))
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_ranks_of_a_model_built_with_them(reached, scale):
    """A block triangular system under a random change of states."""
    A = scale * RNG.normal(size=(6, 6))
    A[reached:, :reached] = 0.0
    B = np.vstack([RNG.normal(size=(reached, 1)), np.zeros((6 - reached, 1))])
    T, _ = np.linalg.qr(RNG.normal(size=(6, 6)))
    hidden = model(T @ A @ T.T, T @ B, B.T @ T.T)
    assert controllable(hidden) == reached
    turned = model(T @ A.T @ T.T, T @ B, (T @ B).T)
    assert observable(turned) == reached


@pytest.mark.parametrize("seed", range(10))
def test_ranks_do_not_hang_on_what_rounding_leaves_of_zeros(seed):
    """One entry of 1e-62 scaled states by 1e125, and of sixteen that outputs show one was left."""
    rng, n = np.random.default_rng(seed), 6
    A = np.where(rng.random((n, n)) < 0.5, rng.normal(size=(n, n)), 0.0)
    noise = np.where(A == 0.0, 10.0 ** rng.uniform(-120, -30, (n, n)), 0.0)
    B, C = rng.normal(size=(n, 1)), rng.normal(size=(1, n))
    for rank in (controllable, observable):
        assert rank(model(A + noise, B, C)) == rank(model(A, B, C))


def test_a_symmetric_robot_is_seen_and_reached_from_one_motor():
    (place,) = analyse.places(cases.load("delta_impulse"), {"x": 0.05, "y": 0.02, "z": 0.55})
    assert controllable(place.model) == observable(place.model) == 6
    assert controllable(place.model.pick(None, ["u[0]"])) == 6
    (axis,) = analyse.places(cases.load("delta_impulse"), {"x": 0.0, "y": 0.0, "z": 0.55})
    assert controllable(axis.model.pick(None, ["u[0]"])) == 4  # both lateral modes are equal on the axis: one is not


@pytest.mark.parametrize("seed", range(10))
def test_participation_is_how_poles_move_with_the_entries_of_the_diagonal(seed):
    n, step = 5, 1e-6
    A = np.random.default_rng(seed).normal(size=(n, n))
    found = modes(model(A, np.ones((n, 1)), np.eye(n)))
    slopes = np.empty((n, n))
    for k in range(n):
        up, down = (np.linalg.eigvals(A + sign * step * np.outer(np.eye(n)[k], np.eye(n)[k])) for sign in (1.0, -1.0))
        for i, pole in enumerate(found.poles):
            near = [poles[np.argmin(np.abs(poles - pole))] for poles in (up, down)]
            slopes[k, i] = abs(near[0] - near[1]) / (2.0 * step)
    np.testing.assert_allclose(found.participation, slopes / slopes.sum(axis=0), atol=1e-6)


def test_participation_adds_up_and_names_the_mode():
    found = modes(model([[0.0, 1.0, 0.0], [-4.0, -0.4, 0.0], [0.0, 0.0, -3.0]], np.ones((3, 1)), np.eye(3)))
    np.testing.assert_allclose(found.participation.sum(axis=0), 1.0)
    assert found.participation[2, np.argmin(np.abs(found.poles + 3.0))] == pytest.approx(1.0)
    assert found.frequency[0] == pytest.approx(2.0)
    assert found.damping[0] == pytest.approx(0.1)


def test_branches_of_a_locus_do_not_jump():
    """s^2 + k s + 1: two branches meet at k = 2 and part on the real axis."""
    found = locus(lambda k: model([[0.0, 1.0], [-1.0, -k]], np.ones((2, 1)), np.eye(2)), np.linspace(0.0, 4.0, 401))
    np.testing.assert_allclose(found.poles.sum(axis=1), -found.values, atol=1e-12)
    assert np.abs(np.diff(found.poles, axis=0)).max() < 0.15
    with pytest.raises(InvalidValue, match="empty"):
        locus(lambda k: None, [])


def test_a_locus_grows_as_the_branch_that_grows_most() -> None:
    """Of two that cross at k = 2."""
    found = locus(lambda k: model([[-1.0, 0.0], [0.0, k - 3.0]], np.ones((2, 1)), np.eye(2)), np.linspace(0.0, 4.0, 41))
    np.testing.assert_allclose(found.growth, np.maximum(-1.0, found.values - 3.0), atol=1e-12)


def test_where_a_gain_makes_an_equilibrium_unstable():
    """A single finger from 5.95 (m/s)/N on, at 724 rad/s; two fingers never. The poles there stand on the axis."""
    family = Family("soft_contact", "axis", {}, {}, "kstar")
    rows = limits(family, [500.0, 650.0, 800.0]).set_index("place")
    assert set(rows.index) == {"left finger", "right finger"}
    np.testing.assert_allclose(rows["value"], 595.4, atol=0.1)
    assert set(rows["unstable"]) == {"above"}
    poles = family.model(1, float(rows.loc["left finger", "value"])).poles()
    crossing = poles[np.argmin(np.abs(poles - 1j * rows.loc["left finger", "frequency"]))]
    assert abs(crossing.real) < 1e-6 * abs(crossing)
    told = over("kstar", (500.0, 800.0), rows.reset_index())
    assert told == "Unstable above kstar = 595.376: left finger, right finger."
    assert over("kstar", (1.0, 2.0), rows[:0]) == "Nothing gains or loses its stability over kstar = 1 .. 2."


def test_the_models_are_read_by_scipy_and_by_python_control():
    found = model([[0.0, 1.0], [-1.0, -0.3]], [[0.0], [1.0]], [[1.0, 0.0]])
    np.testing.assert_array_equal(found.state_space().A, found.A)
    control = pytest.importorskip("control")
    read = found.control()
    assert (read.state_labels, read.input_labels, read.output_labels) == (["x0", "x1"], ["u0"], ["y0"])
    np.testing.assert_allclose(control.poles(read), found.poles())
    omega = np.array([0.3, 1.0, 30.0])
    np.testing.assert_allclose(np.squeeze(read(1j * omega)), found.response(omega)[:, 0, 0])


@pytest.mark.parametrize(
    ("name", "variant"),
    [("bouncing_ball", "linear"), ("red_body", None), ("newtons_cradle", "pendulums"), ("soft_contact", "axis")],
)
def test_every_place_of_a_case_is_an_equilibrium(name, variant):
    for place in analyse.places(cases.load(name, variant)):
        assert place.trim.outcome is Outcome.FINISHED
        assert place.trim.residual < 1e-10
        assert not place.trim.pulling


ROD = Body(name="rod", mass=1.0, com=(0.0, 0.0, -0.5), inertia=(0.1, 0.1, 0.01, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("limits", "turns", "found"),
    [((-np.inf, np.inf), 0, (0.0, np.pi)), ((-2.6, 2.6), 0, (0.0,)), ((-np.inf, np.inf), 3, (0.0, np.pi))],
)
def test_equilibria_are_looked_for_all_along_a_motion_and_inside_of_its_bounds(limits, turns, found):
    """Of a rod that falls from near its highest place: upright, if no bound is before, and hanging."""
    hinge = Joint(name="hinge", body="rod", type="hinge", axis=(0.0, 1.0, 0.0), range=limits, law=LAW)
    start = 2.5 + 2.0 * np.pi * turns
    case = cases.from_scene(Scene(bodies=(ROD,), joints=(hinge,)), q0=[start], t_end=3.0)
    places = [place for place in analyse.places(case) if place.name.startswith("touching nothing")]
    assert sorted(float(place.trim.q[0]) - 2.0 * np.pi * turns for place in places) == pytest.approx(found, abs=1e-9)
    assert all(abs(place.trim.q[0] - start) <= np.pi for place in places)
    rates = {round(float(place.trim.q[0]) / np.pi) % 2: place.model.poles().real.max() for place in places}
    own = np.sqrt(9.81 * 0.5 / (0.1 + 0.25))
    assert rates.get(1, own) == pytest.approx(own, rel=1e-9)
    assert rates[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("low", "stands"), [(-0.2, False), (0.3, True)])
def test_where_a_row_would_have_to_pull_there_is_no_equilibrium(low, stands):
    """A rod that hangs swings against a bound: only one beyond the lowest place holds it."""
    hinge = Joint(name="hinge", body="rod", type="hinge", axis=(0.0, 1.0, 0.0), range=(low, 2.0), law=LAW)
    case = cases.from_scene(Scene(bodies=(ROD,), joints=(hinge,)), q0=[0.8], t_end=2.0)
    (touches,) = (place for place in analyse.places(case) if place.name == "touching hinge low")
    assert (touches.model is not None) == stands
    assert touches.why == (
        "" if stands else "It is one of the equations alone: hinge low would pull, and can only push."
    )


def test_the_command_writes_tables_and_a_page(tmp_path, capsys):
    from crossbody.reports.commands.analyse import analyse as command

    out = tmp_path / "out"
    common = {"bode": True, "mapped": False, "out": out, "command": "crossbody analyse"}
    with pytest.raises(InvalidValue, match=r"PARAM=a\.\.b"):
        command("bouncing_ball", "linear", [], [], locus="a0", **common)
    assert not out.exists()
    assert command("bouncing_ball", "linear", ["a1=3"], [], locus="a1=0..300", **common) == 0
    assert "on the floor" in capsys.readouterr().out
    rows = json.loads((out / "analysis-locus.json").read_text())["rows"]
    assert {row["branch"] for row in rows} == {0, 1}
    page = (out / "index.html").read_text()
    assert "Equilibria and linear models of bouncing_ball:linear" in page
    (told,) = json.loads((out / "analysis-says.json").read_text())["rows"]
    assert told["says"].startswith(
        "Nothing gains or loses its stability over a1 = 0 .. 300. bouncing_ball:linear, on the"
    )
    assert told["says"] in html.unescape(page)
    with pytest.raises(UnknownName, match="place"):
        command("bouncing_ball", "linear", [], ["x=1"], locus=None, **common)
    with pytest.raises(CaseUnsupported, match="workspace"):
        command("bouncing_ball", "linear", [], [], locus=None, **{**common, "mapped": True})


RUBBING = [
    (name, variant) for name in cases.names() for variant in cases.variants(name) if cases.load(name, variant).rubs
]


@pytest.mark.parametrize(("name", "variant"), RUBBING)
def test_every_case_with_friction_has_models_or_says_why_not(name, variant):
    found = analyse.places(cases.load(name, variant))
    for place in found:
        assert (place.model is None) == (bool(place.why) or not place.trim.outcome.ok), place.name
        assert place.spot is None
        assert place.model is None or np.isfinite(place.model.A).all()
    assert any(place.model is not None or place.why for place in found)


def test_a_block_on_its_edge_falls_as_its_closed_form_does():
    case = cases.load("rocking_block")
    (place,) = analyse.places(case)
    b, h = (case.number(name) for name in ("width", "height"))
    R = np.hypot(b, h)
    rate = np.sqrt(case.number("gravity") * R / ((b * b + h * h) / 3.0 + R * R))
    assert place.model.poles()[0] == pytest.approx(rate, rel=1e-9)


def test_a_slide_downhill_turns_into_its_direction():
    """y' dies out at mu g cos(slope)/|v| beside a slip along x."""
    case = cases.load("sliding_block", "stops")
    holds, slides = analyse.places(case)
    press = case.number("gravity") / np.hypot(1.0, case.number("slope"))
    rates = np.sort(slides.model.poles().real)
    np.testing.assert_allclose(rates[2], -case.number("mu") * press / case.number("speed"), rtol=1e-9)
    assert holds.name == "held by floor:block"
    rows = summary([slides], case)
    assert rows["verdict"].tolist() == ["no equilibrium"]
    assert "no equilibrium; poles are those of the motion at 1 of its instants." in sentence(case.label, rows, 1)


def test_a_page_of_places_without_any_model_says_why(tmp_path):
    """It had failed where no place had poles."""
    from crossbody.reports.commands.analyse import analyse as command

    out = tmp_path / "out"
    none = {"bode": False, "locus": None, "mapped": False, "command": "crossbody analyse"}
    assert command("stacked_blocks", "apart", [], [], out=out, **none) == 0
    page = (out / "index.html").read_text()
    assert "cannot be shown" not in page
    assert "indeterminate" in page


def test_a_controlled_delta_is_linearised_where_it_is_asked_for() -> None:
    case, at = cases.load("delta_tracking", "circle"), {"x": 0.08, "y": -0.05, "z": 0.62}
    (there,) = (place for place in analyse.places(case, at) if place.controlled)
    robot = robot_of(case.parameters)
    q = delta.inverse(robot, list(at.values()))
    wanted = closed_loop(robot, q, controller_of(case.parameters)).poles()
    here = closed_loop(robot, case.q0, controller_of(case.parameters)).poles()
    np.testing.assert_allclose(there.model.poles(), wanted, atol=1e-9)
    assert np.abs(np.sort_complex(wanted) - np.sort_complex(here)).max() > 1e-4
