"""Joints and tendons that follow another by a curve move in MuJoCo as in the reference, and stay on it."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody import engines
from crossbody.cases import Case
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Loop, Scene, Tendon
from crossbody.reports.judging.audit import audit

pytest.importorskip("mujoco")

ENDS = 0.3
"""Horizon, s."""


def coupled(seed: int, kind: str) -> Case:
    """Three slides without weight of which the first, or a sum of two, follows another by a polynomial."""
    draw = np.random.default_rng(seed)
    bodies = tuple(
        Body(name=name, mass=float(draw.uniform(0.5, 2.0)), inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)) for name in "abc"
    )
    joints = tuple(
        Joint(name=name, body=name, type="slide", axis=(1.0, 0.0, 0.0), stiffness=(float(k), 0.0, 0.0))
        for name, k in zip("abc", draw.uniform(0.0, 30.0, 3), strict=True)
    )  # fmt: skip
    curve = (0.0, *draw.uniform(-0.5, 0.5, 4).tolist())
    led = Tendon(name="led", joints=("a", "c"), coefficients=(1.0, float(draw.uniform(0.5, 2.0))))
    leads = Tendon(name="leads", joints=("b",), coefficients=(float(draw.uniform(0.5, 2.0)),))
    names = ("a", "b") if kind == "joint" else ("led", "leads")
    loop = Loop(name="curved", type=kind, first=names[0], second=names[1], polynomial=curve)
    scene = Scene(
        bodies=bodies, joints=joints, loops=(loop,), tendons=(led, leads) if kind == "tendon" else (),
        gravity=(0.0, 0.0, 0.0),
    )  # fmt: skip
    slope = curve[1] * (leads.coefficients[0] if kind == "tendon" else 1.0)
    fast = float(draw.uniform(1.0, 3.0))
    return case_of(scene, name="coupled", q0=[0.0, 0.0, 0.0], v0=[slope * fast, fast, 0.0], t_end=ENDS)


@pytest.mark.parametrize("kind", ["joint", "tendon"])
@pytest.mark.parametrize("seed", range(3))
def test_a_curved_coupling_is_kept_and_has_the_references_multipliers(seed: int, kind: str) -> None:
    case = coupled(seed, kind)
    reference, matched = (
        engines.load(name).prepare(case, profile)
        for name, profile in (("reference", "compiled"), ("mujoco", "matched"))
    )
    exact, run = reference.run(), matched.run()
    assert np.abs(run.q[-1] - exact.q[-1]).max() < 1e-8
    assert np.abs(run.gap).max() < 1e-8
    assert [row.quantity for row in audit(matched.audit(), reference.audit(), case) if not row.ok] == []
