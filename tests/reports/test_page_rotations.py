"""A rotation is drawn as the angle that a body has turned, however far it turns."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crossbody.reports.pages import errors


def turning(angles: np.ndarray, axis: np.ndarray, start: np.ndarray) -> Any:
    """A motion that turns from a start by angles about an axis of the body; either sign of a quaternion is one."""
    w, x = start[0], start[1:]
    c, s = np.cos(angles / 2.0), np.sin(angles / 2.0)[:, None] * axis
    q = np.column_stack([w * c - s @ x, w * s + c[:, None] * x + np.cross(x, s)])
    return SimpleNamespace(run=SimpleNamespace(q=q), quaternions=(0,))


@pytest.mark.parametrize("seed", range(20))
def test_a_rotation_about_an_axis_is_its_angle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    axis, start = rng.normal(size=3), rng.normal(size=4)
    t = np.linspace(0.0, 1.0, 600)
    angles = rng.uniform(5.0, 60.0) * t + rng.uniform(0.0, 9.0) * np.sin(rng.uniform(1.0, 9.0) * t)
    trace = turning(angles, axis / np.linalg.norm(axis), start / np.linalg.norm(start))
    flips = np.where(rng.random(600) < 0.5, -1.0, 1.0)[:, None]
    np.testing.assert_allclose(errors.seen(flips * trace.run.q, trace)[:, 0], angles, atol=1e-9)


def test_a_body_that_swings_through_its_start_turns_to_both_sides() -> None:
    angles = np.sin(np.linspace(0.0, 9.0, 700))
    trace = turning(angles, np.array([0.0, 0.6, 0.8]), np.array([1.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(errors.seen(trace.run.q, trace)[:, 0], angles, atol=1e-9)


def test_a_body_that_rests_but_for_rounding_has_not_turned() -> None:
    q = np.tile([1.0, 0.0, 0.0, 0.0], (50, 1)) + 1e-9 * np.random.default_rng(0).normal(size=(50, 4))
    assert np.abs(errors.seen(q, SimpleNamespace(run=SimpleNamespace(q=q), quaternions=(0,)))[:, 0]).max() == 0.0
