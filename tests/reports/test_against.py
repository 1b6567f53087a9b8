"""What `run --against` prints of what has changed since another run."""

from __future__ import annotations

from pathlib import Path

import pytest

from crossbody.reports.cli import main

RUN = ["run", "bouncing_ball", "--variant", "linear", "-e", "reference:compiled", "--out"]


def told(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    with pytest.raises(SystemExit) as end:
        main([*RUN, *words])
    assert not end.value.code
    return " ".join(capsys.readouterr().out.split())


def test_what_has_changed_is_counted_and_verdicts_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert "Against" not in told(capsys, "one")
    assert "Against one: 0 of " in told(capsys, "two", "--against", "one")
    said = told(capsys, "two", "--against", "one", "--rtol", "1e-7")
    assert "Against one: 1 of " in said
    assert "changed: reference:compiled on bouncing_ball:linear: rate_residual was within, is not judged" in said
    assert "Against" not in told(capsys, "two", "--against", "one", "--quiet")
