"""`crossbody warm` compiles ahead what a run would have to."""

from __future__ import annotations

import pytest

from crossbody import cases
from crossbody.cases import UnknownName
from crossbody.reference import ahead, code_store
from crossbody.reports.cli import main


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
