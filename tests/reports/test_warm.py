"""`crossbody warm` compiles ahead what a run would have to."""

from __future__ import annotations

import pytest

from crossbody import cases
from crossbody.cases import UnknownName
from crossbody.reference import ahead, code_store
from crossbody.reports.cli import main
from crossbody.reports.commands import cache


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


def test_a_piece_that_does_not_exist_is_a_sentence() -> None:
    with pytest.raises(UnknownName, match="no piece 'integrater'"):
        ahead.compile_piece("integrater")


def test_what_takes_long_is_told_while_it_takes(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    monkeypatch.setattr(cases, "names", lambda: ("bouncing_ball",))
    monkeypatch.setattr(cache, "EVERY_S", 0.05)
    with pytest.raises(SystemExit) as end:
        main(["warm"])
    assert not end.value.code
    said = " ".join(capsys.readouterr().err.split())
    count = len(ahead.PIECES)
    first, *_ = ahead.PIECES
    assert f"compiling {first}" in said
    assert f"; {count} of {count} to go" in said
    assert "compiling bouncing_ball; 1 of 1 to go" in said
