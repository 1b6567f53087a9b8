"""The red body in the engines."""

from __future__ import annotations

import numpy as np
import pytest
from red_body_scene import ALL, REFERENCE, run

from crossbody import engines
from crossbody.cases import Mode, load
from crossbody.cases.mechanisms.red_body.order import LEFT, stages_in_order
from crossbody.reports.judging.audit import audit


@pytest.mark.parametrize(
    ("variant", "name", "profile", "off"),
    [
        ("resolved", "pinocchio", "law", 1e-8), ("resolved", "mujoco", "matched", 1e-6),
        ("frozen", "pinocchio", "impulse", 1e-8), ("frozen", "pinocchio", "impulse_simultaneous", 1e-8),
    ],
)  # fmt: skip
def test_engines_that_follow_the_variant(variant: str, name: str, profile: str, off: float) -> None:
    pytest.importorskip(name)
    case = load("red_body", variant)
    theirs, ours = engines.load(name).prepare(case, profile).run(), run(case, rtol=1e-12)
    assert theirs.outcome.ok, theirs.message
    assert stages_in_order(theirs.events) == ALL
    np.testing.assert_allclose(theirs.q[-1], ours.q[-1], atol=off)
    np.testing.assert_allclose(theirs.v[-1], ours.v[-1], atol=100 * off)


@pytest.mark.parametrize(
    ("name", "profile"), [pytest.param("mujoco", "matched", marks=pytest.mark.slow), ("pinocchio", "law")]
)
def test_a_collision_without_damping_has_its_own_constants(name: str, profile: str) -> None:
    """Rows have two sets by their stiffness: b1 may be 0."""
    pytest.importorskip(name)
    case = load("red_body", "resolved", zeta4=0.0, t_end=0.5)
    theirs, ours = engines.load(name).prepare(case, profile).run(), run(case, rtol=1e-12)
    assert theirs.outcome.ok, theirs.message
    assert [(e.contact, e.before, e.after) for e in theirs.events] == [
        (e.contact, e.before, e.after) for e in ours.events
    ]
    np.testing.assert_allclose(theirs.q[-1], ours.q[-1], atol=1e-6)


@pytest.mark.parametrize(("name", "profile"), [("mujoco", "matched"), ("pinocchio", "law")])
def test_parity_with_every_row_entered(name: str, profile: str) -> None:
    """M, bias, H, lam of an engine that follows the law: the same at states that turn and slide."""
    pytest.importorskip(name)
    case = load("red_body", slab_half_height=0.04, half_height=0.17)
    rows = audit(engines.load(name).prepare(case, profile).audit(), REFERENCE.prepare(case, "compiled").audit(), case)
    assert {row.quantity for row in rows} >= {"masses", "gravity", "constants", "M", "bias", "H", "lam"}
    assert all(row.ok and row.difference < 1e-9 for row in rows), [(r.quantity, r.difference) for r in rows]


def test_the_obvious_model_in_mujoco_keeps_the_left_corner() -> None:
    """One set of soft constants: when the right corner lands, the left one stays."""
    pytest.importorskip("mujoco")
    found = engines.load("mujoco").prepare(load("red_body"), "default").run()
    assert found.outcome.ok
    assert not [e for e in found.events if e.contact == LEFT and e.before is Mode.CONTACT]
