"""Cases that engines run on a scene with coordinates of its own: the way there and back, and what acts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import Case, SceneError
from crossbody.cases.case import Force
from crossbody.cases.form import Form
from crossbody.engines._acting import acting
from crossbody.engines._formed import form_of, on_scene
from crossbody.hw import models
from crossbody.hw.models.contract import Segment

SMALL = 1e-6
SHIPPED = [
    (name, variant) for name in cases.names() for variant in cases.variants(name) if cases.load(name, variant).form
]
CHAINS = ("single_pendulum", "double_pendulum")


def chain(name: str) -> Case:
    """A pendulum with both frictions under a torque."""
    model = models.load(name)
    count = len(model.measured)
    numbers = {key: 0.01 if key[0] in "ks" else one.default for key, one in model.parameters.items()}
    draw = np.random.default_rng(count)
    return model.build(
        {**numbers, "slip": 0.01},
        Segment(
            y=draw.uniform(1.0, 4.0, count), yd=draw.normal(size=count), t_end=0.1, times=np.zeros(1),
            inputs=np.full((1, count), 0.01),
        ),
    )  # fmt: skip


@pytest.fixture(params=[*(f"{name}:{variant}" for name, variant in SHIPPED), *CHAINS])
def case(request: pytest.FixtureRequest) -> Case:
    """Return a case that has a form."""
    name, _, variant = request.param.partition(":")
    return cases.load(name, variant) if variant else chain(name)


def near(form: Form, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """States (5, nv) of a scene about its start."""
    draw = np.random.default_rng(seed)
    shape = (5, len(form.case.v0))
    return form.case.q0 + 0.05 * draw.normal(size=shape), draw.normal(size=shape)


def test_every_kind_of_scene_has_its_form() -> None:
    mechanisms = {cases.load(name, variant).mechanism for name, variant in SHIPPED}
    assert mechanisms >= {"delta", "soft_contact", "soft_delta"}


def test_states_go_there_and_back_and_rates_are_derivatives(case: Case) -> None:
    form = form_of(case)
    assert form is not None
    r, rd = near(form, 1)
    back = form.to_scene(*form.to_case(r, rd))
    np.testing.assert_allclose(back[0], r, atol=1e-12)
    np.testing.assert_allclose(back[1], rd, atol=1e-10)
    (ahead, faster), (behind, slower) = (form.to_case(r + s * SMALL * rd, rd) for s in (1.0, -1.0))
    np.testing.assert_allclose((ahead - behind) / (2 * SMALL), form.to_case(r, rd)[1], atol=1e-6)
    if len(case.v0) == len(form.case.v0):
        for i in range(len(r)):
            bend = np.zeros(len(case.v0)) if form.bend is None else form.bend(r[i], rd[i])
            np.testing.assert_allclose((faster - slower)[i] / (2 * SMALL), bend, atol=1e-5)
            np.testing.assert_allclose(form.rate_matrix(r[i]) @ rd[i], form.to_case(r[i : i + 1], rd[i : i + 1])[1][0])
    start = form.to_case(form.case.q0[None], form.case.v0[None])
    np.testing.assert_allclose(start[0][0], case.q0, atol=1e-12)
    np.testing.assert_allclose(start[1][0], case.v0, atol=1e-12)


def test_a_compiled_force_is_what_is_written(case: Case) -> None:
    own = on_scene(case)
    form = form_of(case)
    assert form is not None
    if own.force is None:
        pytest.skip("nothing acts beside the parts of the scene")
    r, rd = near(form, 2)
    for t, q, v in zip((0.0, 0.2, 1.5, 3.0, 4.5), r, rd, strict=True):
        found, wanted = np.empty((2, len(v)))
        acting(own.force)(t, q, v, found)
        own.force.function(t, q, v, own.force.numbers, wanted)
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)
        assert np.isfinite(found).all()


def test_a_form_follows_what_is_changed_in_its_case(case: Case) -> None:
    """Horizon, law and inputs are those of the case that is run, not of the one that was written."""
    law = replace(case.law, a1=3.0 * case.law.a1 + 1.0)
    inputs = case.inputs if case.inputs is None else replace(case.inputs, values=2.0 * case.inputs.values)
    own = on_scene(replace(case, t_end=0.5 * case.t_end, law=law, inputs=inputs, claims=()))
    assert own.t_end == 0.5 * case.t_end
    if len(own.law.a0):
        assert sorted(own.law.a1.tolist()) == sorted(law.a1.tolist())
    if case.inputs is not None:
        before = on_scene(case).inputs
        assert own.inputs is not None
        assert before is not None
        np.testing.assert_allclose(own.inputs.values, 2.0 * before.values)


def test_a_force_needs_a_scene_whose_equations_have_it() -> None:
    nothing = Force(function=lambda _t, _q, _v, _p, _out: None)
    with pytest.raises(SceneError, match="has a force but is no scene"):
        replace(cases.load("delta_free"), force=nothing)
    with pytest.raises(SceneError, match="has no kernels of its own"):
        replace(cases.load("rolling_sphere"), force=nothing)
