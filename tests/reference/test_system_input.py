"""A user's own mechanism and options: each mistake is one sentence that names the field and what would be valid."""

import dataclasses
import inspect

import numpy as np
import pytest
from friction_scenes import sphere_on_floor
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanisms import ball, flyby

from crossbody.cases import InvalidValue, SceneError, UnknownName
from crossbody.cases.files.case import Given, case_of
from crossbody.engines.equations import system_of
from crossbody.reference import Options, System, simulate
from crossbody.reference.options import Chosen
from crossbody.reference.systems import ball as ball_kernels

KERNELS = ball_kernels.KERNELS


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"n": 0}, ["System.n", "from 1"]),
        ({"mass_block": 2}, ["mass_block", "divide"]),
        ({"a1": [1.0, 2.0]}, ["System.a1", "(2,)", "(1,)"]),
        ({"a0": [np.nan]}, ["finite"]),
        ({"a0": [-1.0]}, ["at least 0"]),
        ({"parameters": [[1.0]]}, ["parameters", "shape"]),
        ({"parameters": [np.inf, 1.0]}, ["finite"]),
        ({"redundant": [0], "loose": [-1e-9]}, ["System.loose", "at least 0"]),
        ({"redundant": [0], "loose": [np.nan]}, ["System.loose", "finite"]),
        ({"redundant": [0], "loose": [0.0, 0.0]}, ["System.loose", "(2,)", "(1,)"]),
        ({"follows": [3]}, ["follows", "below 1"]),
        ({"dynamics": lambda *a: None}, ["System.dynamics", "kernels.dynamics"]),
        ({"gaps": ball_kernels.energy}, ["System.gaps", "signature"]),
    ],
)
def test_wrong_system(fields, words):
    good = {"n": 1, "parameters": [1.0, 9.81], "a0": [100.0], "a1": [20.0], **KERNELS}
    with pytest.raises(SceneError) as caught:
        System(**{**good, **fields})
    assert all(word in str(caught.value) for word in words), caught.value


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"rtol": 1e-15}, InvalidValue),
        ({"rtol": 0.2}, InvalidValue),
        ({"rtol": np.nan}, InvalidValue),
        ({"atol": 0.0}, InvalidValue),
        ({"t_end": 0.0}, InvalidValue),
        ({"t_end": -1.0}, InvalidValue),
        ({"t_end": np.inf}, InvalidValue),
        ({"fsm": "levle"}, UnknownName),
        ({"solver": "rk4"}, UnknownName),
        ({"collisions": "none"}, UnknownName),
        ({"samples": [1.0, 0.5]}, InvalidValue),
        ({"samples": [0.0, 9.0]}, InvalidValue),
        ({"index": 3}, InvalidValue),
        ({"inputs": ([0.0, 0.0], np.zeros((2, 0)))}, InvalidValue),
        ({"inputs": ([0.0], [[1.0]])}, SceneError),
        ({"max_steps": 0}, InvalidValue),
    ],
)
def test_wrong_option(options, error):
    with pytest.raises(error):
        simulate(ball(), [1.0], [0.0], **{"t_end": 1.0, **options})


@pytest.mark.parametrize("solver", ["compiled", "cvode"])
@pytest.mark.parametrize("rule", ["sequential", "simultaneous"])
def test_a_frozen_collision_needs_a_linear_law(solver, rule):
    fast = {"b0": [1e4], "b1": [10.0], "b2": [1e9]}
    system = System(n=1, parameters=[1.0, 9.81], a0=[100.0], a1=[20.0], **fast, **KERNELS)
    with pytest.raises(InvalidValue, match="row 0 has b2 > 0; valid: b2 = 0 or 'resolved'"):
        simulate(system, [1.0], [0.0], 1.0, collisions=rule, solver=solver)
    assert simulate(system, [1.0], [0.0], 1.0, collisions="resolved", solver=solver).outcome.ok


@pytest.mark.parametrize(("q0", "v0"), [([1.0, 2.0], [0.0]), ([1.0], []), ([np.nan], [0.0]), (["x"], [0.0])])
def test_wrong_start(q0, v0):
    with pytest.raises(SceneError, match=r"simulate\.(q0|v0)"):
        simulate(ball(), q0, v0, 1.0)


@settings(max_examples=60, deadline=None)
@given(
    height=st.floats(-0.1, 10.0), speed=st.floats(-1e3, 1e3), a0=st.floats(1.0, 1e12), zeta=st.floats(0.0, 10.0),
    gravity=st.floats(0.0, 100.0), rtol=st.sampled_from([1e-3, 1e-6, 1e-9]),
    fsm=st.sampled_from(["level", "memoryless"]),
)  # fmt: skip
def test_any_ball_ends_in_an_outcome(height, speed, a0, zeta, gravity, rtol, fsm):
    system = ball(a0=a0, a1=2.0 * zeta * a0**0.5, a2=0.0, gravity=gravity)
    run = simulate(system, [height], [speed], 1.0, rtol=rtol, fsm=fsm, max_steps=20_000)
    assert np.all(np.isfinite(run.q))
    assert np.all(np.isfinite(run.lam))
    assert run.outcome.ok or run.message


def test_mass_matrix_and_rows_can_be_asked_for():
    system = flyby(0.5)
    M, f = system.terms([3.0, 4.0])
    H, h, Hdv = system.constraint([3.0, 4.0], [1.0, 0.0])
    assert np.array_equal(M, np.eye(2))
    assert not f.any()
    assert np.allclose(H, [[0.6, 0.8]], rtol=1e-15)
    assert h == pytest.approx([4.5])
    assert Hdv == pytest.approx([(1.0 - 0.36) / 5.0])


def test_options_are_named_once_for_editors_and_once_for_runs():
    """A type checker sees the one, a run checks the other."""
    fields = {field.name: field.type for field in dataclasses.fields(Options)}
    assert {name: part.__forward_arg__ for name, part in Chosen.__annotations__.items()} == {
        name: kind for name, kind in fields.items() if name != "t_end"
    }
    parameters = inspect.signature(case_of).parameters
    assert {name: part.__forward_arg__ for name, part in Given.__annotations__.items()} == {
        name: one.annotation for name, one in parameters.items() if name != "scene"
    }


@given(st.lists(st.floats(-1.0, 1.0), min_size=7, max_size=7), st.lists(st.floats(-5.0, 5.0), min_size=6, max_size=6))
@settings(max_examples=30, deadline=None)
def test_rates_take_arrays_of_any_kind(q: list[float], v: list[float]) -> None:
    """Read-only ones, as runs have them, others' parts, and whole numbers."""
    system = system_of(case_of(sphere_on_floor(0.5, 0.1), q0=[0, 0, 1, 1, 0, 0, 0], t_end=1.0))
    wanted = system.displacement(np.array(q), np.array(v))
    frozen = [np.array(x) for x in (q, v)]
    for array in frozen:
        array.flags.writeable = False
    parts = [np.stack([x, x], axis=1)[:, 0] for x in (q, v)]
    for one in (frozen, parts):
        np.testing.assert_array_equal(system.displacement(*one), wanted)
        np.testing.assert_array_equal(system.rates(*one), system.rates(np.array(q), np.array(v)))
    whole = [np.round(x).astype(int) for x in (q, v)]
    np.testing.assert_array_equal(system.displacement(*whole), system.displacement(*(1.0 * x for x in whole)))
