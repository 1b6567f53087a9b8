"""Which equations a timed run is held against: those that its engine says it follows."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from crossbody.cases import load
from crossbody.reports.bench.errors import Truths

LINEAR, RUBS, CLOSED = ("bouncing_ball", "linear"), ("sliding_block", "stops"), ("bouncing_ball", "bilateral")


@pytest.mark.parametrize(
    ("scene", "settings", "follows", "told"),
    [
        (LINEAR, {"law": "level"}, {}, "the case"),
        (LINEAR, {"law": "memoryless"}, {}, "memoryless, resolved"),
        (LINEAR, {}, {"fsm": "edge"}, "edge, sequential"),
        (LINEAR, {"law": "memoryless"}, {"fsm": "edge"}, "edge, sequential"),
        (RUBS, {"law": "memoryless"}, {}, "the case"),
        (CLOSED, {"law": "memoryless"}, {}, "the case"),
    ],
)
def test_a_timed_run_is_held_against_the_machine_that_it_follows(
    scene: tuple[str, str], settings: dict[str, str], follows: dict[str, Any], told: str
) -> None:
    """Contacts that slide, and rows that never open, have one machine alone."""
    case = load(*scene, **({"t_end": 0.6} if scene == LINEAR else {}))
    truths = Truths(case)
    run = SimpleNamespace(settings=settings, follows=replace(case, **follows) if follows else None)
    name, truth = truths.of(run)
    assert name == told
    assert (truth is truths.own) == (told == "the case")
    assert truths.of(run)[1] is truth
