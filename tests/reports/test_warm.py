"""`crossbody warm` compiles ahead what a run would have to."""

from __future__ import annotations

import shutil
from concurrent.futures import Executor, Future, wait
from pathlib import Path
from typing import Any

import own_case
import pytest

from crossbody import cases
from crossbody.cases import UnknownName
from crossbody.reference import ahead, code_store
from crossbody.reports.cli import main
from crossbody.reports.commands import cache
from crossbody.reports.runs import watch


def test_every_piece_is_found_by_who_comes_later(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr(cases, "names", lambda: ("bouncing_ball",))
    with pytest.raises(SystemExit) as end:
        main(["warm"])
    assert not end.value.code
    said = capsys.readouterr()
    assert all(f"{piece} is compiled" in said.err for piece in (*ahead.PIECES, "bouncing_ball"))
    assert str(code_store.base()) in said.out
    written: list[str] = []
    monkeypatch.setattr(code_store.Store, "write", lambda _self, name, _data: written.append(name))
    for piece in ahead.PIECES:
        ahead.compile_piece(piece)
    assert written == []


class Here(Executor):
    """Does everything at once, and is interrupted before one task."""

    def __init__(self, last: int) -> None:
        self.last, self.done = last, list[str]()

    def submit(self, work: Any, /, *given: Any, **_: Any) -> Future[None]:
        if len(self.done) == self.last:
            raise watch.Stopped
        self.done.append(given[0])
        if given[0] not in ahead.PIECES:
            work(*given)
        return Future()


def test_an_interrupt_keeps_kernels_that_are_ready(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """They are compiled before all but the largest of the pieces that take long."""
    case = tmp_path / "own_case.py"
    shutil.copy2(own_case.__file__, case)
    monkeypatch.setenv("CROSSBODY_CACHE", str(tmp_path))
    monkeypatch.setattr(cases, "names", lambda: (str(case),))
    pool = Here(last=2)
    monkeypatch.setattr(cache, "_processes", lambda: pool)
    with pytest.raises(watch.Stopped):
        cache.warm()
    assert pool.done == [next(iter(ahead.PIECES)), str(case)]
    store = code_store.current()
    assert store is not None
    kept = [path.stem for path, _ in store.entries()]
    assert {"_dynamics", "_energy"} <= {name.partition("-")[0] for name in kept}
    assert all(store.read(name) for name in kept)


def test_a_piece_that_does_not_exist_is_a_sentence() -> None:
    with pytest.raises(UnknownName, match="no piece 'integrater'"):
        ahead.compile_piece("integrater")


def test_what_takes_long_is_told_while_it_takes(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    monkeypatch.setattr(cases, "names", lambda: ("bouncing_ball",))
    asked: list[set[Future]] = []

    def nothing_yet(left: set[Future], _: float, when: str) -> tuple[set[Future], set[Future]]:
        """Every wait ends without a result the first time it is asked, however fast the machine is."""
        if left in asked:
            return wait(left, None, when)
        asked.append(set(left))
        return set(), left

    monkeypatch.setattr(cache, "wait", nothing_yet)
    with pytest.raises(SystemExit) as end:
        main(["warm"])
    assert not end.value.code
    said = " ".join(capsys.readouterr().err.split())
    count = len(ahead.PIECES) + 1
    first, *_ = ahead.PIECES
    assert f"compiling {first}" in said
    assert f"; {count} of {count} to go" in said
    assert "compiling bouncing_ball; 1 of 1 to go" in said
