"""What is drawn of cases and of shapes in space is held against gaps and sizes: another place, side or size is told."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from crossbody import cases
from crossbody.reports import scenes
from crossbody.reports.pages import known_drawn, known_pages, known_solids

OTHER = {
    "bouncing_ball": "ball", "newtons_cradle": "sliders", "red_body": "red_body", "soft_contact": "soft_contact",
    "ball_maze": "maze", "delta_impulse": "delta",
}  # fmt: skip
"""Cases, and of which mechanism's picture arrows are changed."""


@pytest.mark.parametrize("name", sorted(cases.REGISTRY.own()))
def test_forces_of_every_case_are_drawn_where_its_gaps_say(name: str) -> None:
    assert known_drawn.wrong(name) == ()


@pytest.fixture
def anew() -> Iterator[None]:
    known_drawn.wrong.cache_clear()
    yield
    known_drawn.wrong.cache_clear()


def _other_way(arrows: np.ndarray) -> np.ndarray:
    found = arrows.copy()
    half = found.shape[2] // 2
    found[:, :, half:] *= -1.0
    return found


def _moved(arrows: np.ndarray) -> np.ndarray:
    """The first of two coordinates of each place the other way."""
    found = arrows.copy()
    found[:, :, 0] += 1e-3
    return found


@pytest.mark.usefixtures("anew")
@pytest.mark.parametrize(("name", "mechanism"), OTHER.items())
@pytest.mark.parametrize("change", [_other_way, lambda arrows: 0.5 * arrows])
def test_other_forces_are_told(
    name: str, mechanism: str, change: Callable[[Any], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = scenes.load(mechanism)
    own = drawn.arrows
    monkeypatch.setattr(drawn, "arrows", lambda q, lam, p: change(own(q, lam, p)))
    assert known_drawn.wrong(name)


@pytest.mark.usefixtures("anew")
@pytest.mark.parametrize("name", ["newtons_cradle", "red_body", "soft_contact"])
def test_other_places_are_told(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = scenes.load(OTHER[name])
    own = drawn.arrows
    monkeypatch.setattr(drawn, "arrows", lambda q, lam, p: _moved(own(q, lam, p)))
    assert {kind for kind, *_ in known_drawn.wrong(name)} >= {"place"}


@pytest.mark.parametrize("kind", known_solids.KINDS)
@pytest.mark.parametrize("times", [1.05, 0.95])
def test_other_sizes_of_what_is_drawn_are_told(kind: str, times: float, monkeypatch: pytest.MonkeyPatch) -> None:
    assert not list(known_pages.asked(kind, known_solids.KINDS[kind]))
    drawn: Any = scenes.load("scene")
    own = drawn._drawn
    monkeypatch.setattr(drawn, "_drawn", lambda points, body, radius, faces: own(times * points, body, radius, faces))
    assert list(known_pages.asked(kind, known_solids.KINDS[kind]))
