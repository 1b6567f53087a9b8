"""Directions of slips that are small, and by how much they turn: the implicit method's matrix is made of that."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from crossbody.reference.core import directions

STEP = 1e-6  # of the speed below which a slip has no direction
SMALL = 1e-8


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(directions, "small_slip", lambda *_: SMALL)
    monkeypatch.setattr(directions, "_least_ahead", directions._least_ahead.py_func)


@pytest.mark.parametrize("seed", range(200))
def test_a_direction_turns_as_its_differences_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = rng.uniform(0.0, 2.0 * np.pi)
    m, w = SimpleNamespace(tangent=[0]), SimpleNamespace(way=np.array([np.cos(turn), np.sin(turn)]))
    x, y = rng.normal(size=2) * SMALL * 10.0 ** rng.uniform(-1.0, 1.0)

    def angle(dx: float, dy: float) -> float:
        a, b = directions.lengthened.py_func(None, m, w, 0, x + dx, y + dy)
        return float(np.arctan2(b, a))

    def slope(dx: float, dy: float) -> float:
        turned = np.exp(1j * (angle(dx, dy) - angle(-dx, -dy)))
        return float(np.angle(turned)) / (2.0 * STEP * SMALL)

    found = directions.bend.py_func(None, m, w, 0, x, y)
    wanted = slope(STEP * SMALL, 0.0), slope(0.0, STEP * SMALL)
    assert np.abs(np.subtract(found, wanted)).max() < 1e-5 * max(np.abs(wanted).max(), 1.0 / SMALL)
