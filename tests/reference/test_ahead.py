"""Pieces that are compiled beside the integrator."""

import sys
from pathlib import Path

import pytest
from numba import float64

from crossbody.reference import ahead
from crossbody.reference.cache import compiled


def doubled(x: float) -> float:
    return x + x


def test_others_are_begun_where_code_is_compiled_and_not_where_it_is_read_back(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("CROSSBODY_CACHE", str(tmp_path))
    begun: list[int] = []
    found = [compiled(doubled, [float64(float64)], beside=lambda: begun.append(1))(2.0) for _ in range(2)]
    assert (found, begun) == ([4.0, 4.0], [1])


@pytest.mark.parametrize("processors", [1, 2])
def test_they_are_begun_where_a_processor_is_free(processors: int, monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[list[str]] = []
    monkeypatch.setattr(ahead, "_alone", False)
    monkeypatch.setattr(ahead.os, "cpu_count", lambda: processors)
    monkeypatch.setattr(ahead.atexit, "register", lambda *given: None)
    monkeypatch.setattr(ahead.subprocess, "Popen", lambda call, **how: begun.append(call))
    ahead.begin()
    assert [call[0] for call in begun] == [sys.executable] * (processors - 1)
    assert set(ahead.BESIDE) <= set(ahead.PIECES)
    assert all(repr(name) in call[2] for call in begun for name in ahead.BESIDE)


def test_who_compiles_piece_by_piece_begins_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ahead, "_alone", False)
    monkeypatch.setattr(ahead.subprocess, "Popen", lambda call, **how: pytest.fail("begun"))
    ahead.compile_piece("modes")
    ahead.begin()
