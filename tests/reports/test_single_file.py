"""A report in one file says which pages it replaces, and the same folder makes them again."""

from __future__ import annotations

from pathlib import Path

import pytest

from crossbody.cases import installed
from crossbody.cases.errors import KernelError, OwnFault
from crossbody.reports.cli import main


def code_of(*arguments: str) -> object:
    with pytest.raises(SystemExit) as ended:
        main([*arguments])
    return ended.value.code


def test_pages_that_one_file_replaces_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    labels = ("bouncing_ball:linear", "bouncing_ball:resting")
    assert code_of("run", *labels, "-e", "reference:compiled", "--out", str(out), "-q") == 0
    pages = sorted(path.name for path in out.glob("case-*.html"))
    assert len(pages) == 2
    capsys.readouterr()
    assert code_of("report", str(out), "--single-file") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert said.startswith(f"2 pages removed, which index.html now holds: {', '.join(pages)}. Report: ")
    assert not list(out.glob("case-*.html"))
    text = (out / "index.html").read_text()
    assert all(f'id="{name.removesuffix(".html")}' in text for name in pages)
    assert code_of("report", str(out), "--single-file") == 0
    assert capsys.readouterr().out.startswith("Report: "), "nothing is left to be removed"
    assert code_of("report", str(out)) == 0
    assert capsys.readouterr().out.startswith("Report: ")
    assert sorted(path.name for path in out.glob("case-*.html")) == pages


@pytest.mark.parametrize("wrote", [False, True])
def test_a_kernel_that_nobody_else_wrote_is_a_fault_of_crossbody_in_every_command(
    wrote: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wrong use is told in a sentence, with exit code 2; what crossbody's own kernels say otherwise is none."""
    monkeypatch.setattr(installed, "_OWN", {"mine.py": "case file mine.py"} if wrote else {})
    told = installed.sentence(KernelError("Kernel dynamics gives M = 1, but 2 is right."))
    assert (told is None) == (not wrote)
    assert installed.sentence(OwnFault("of its own")) is None
