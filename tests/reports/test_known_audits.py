"""Audits have known answers: one that passes what is off, or refuses what is right, is told."""

from __future__ import annotations

import math
from typing import Any

import pytest

from crossbody.reports.judging import (
    audit,
    first_steps,
    forces_of_scene,
    known_audits,
    known_scenes,
    run_verdicts,
    steps_taken,
)


def row(off: float, quantity: str, *_: Any) -> audit.AuditRow:
    """Return a row that is off by so much, whatever was found."""
    return audit.AuditRow(quantity=quantity, mine="", theirs="", difference=off, tolerance=1e-3)


OFF: dict[str, tuple[Any, str, Any, str]] = {
    "steps": (steps_taken, "IDLE", 2.0, "steps"), "fewer steps": (steps_taken, "GRID", 60.0, "steps"),
    "settings": (audit, "TOLERANCE", 1e-3, "settings"), "words": (audit, "_apart", lambda *_: 0.0, "settings"),
    "forces": (forces_of_scene, "SIZES", (1e-9,), "forces"),
    "first steps": (first_steps, "_row", lambda *given: row(0.0, *given), "first steps"),
    "strict first steps": (first_steps, "_row", lambda *given: row(math.inf, *given), "first steps"),
    "places": (first_steps, "OF_PLACES", math.inf, "first steps"),
    "tolerances": (run_verdicts, "TOLERANCE", 1e-3, "tolerance"),
}  # fmt: skip


def test_audits_as_they_are_give_their_answers() -> None:
    assert (*known_audits.wrong(), *known_scenes.wrong()) == ()


@pytest.mark.parametrize("what", OFF)
def test_an_audit_that_is_another_one_is_told(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module, name, other, told = OFF[what]
    monkeypatch.setattr(module, name, other)
    kind = known_scenes if what == "forces" else known_audits
    kind.wrong.cache_clear()
    assert told in {found for found, *_ in kind.wrong()}
    kind.wrong.cache_clear()
