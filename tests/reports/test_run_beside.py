"""Cases at once, in processes of their own: the same rows, and what is lost in one of them is lost there alone."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from places import STUCK

from crossbody import cases
from crossbody.reports.commands import run as command
from crossbody.reports.runs import watch

BALLS = """from crossbody.cases.library.bouncing_ball import PARAMETERS, build

VARIANTS = {"linear": {"a0": 1e4, "a1": 20.0, "a2": 0.0}, "resting": {"a2": 0.0}, "listing": {}}
"""


def said(tmp_path: Path, *words: str) -> tuple[int, list[dict[str, object]], str]:
    """Exit code, rows without what is timed, and stderr of `run` with engines that may be stuck."""
    (tmp_path / "balls.py").write_text(BALLS)
    command = [sys.executable, str(STUCK), "run", "balls.py", "--json", *words]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300)
    return done.returncode, json.loads(done.stdout or "[]"), done.stderr


def test_cases_at_once_give_the_rows_of_cases_one_by_one(tmp_path: Path) -> None:
    alone, together = (said(tmp_path, "-e", "fake:exact", "--out", n, "--jobs", n) for n in ("1", "3"))
    assert alone[0] == together[0]
    assert alone[1] == together[1]
    assert {row["variant"] for row in alone[1]} == {"linear", "resting", "listing"}


@pytest.mark.parametrize(("profile", "why"), [("crash", "SIGSEGV"), ("stuck", "did not return within 4 s")])
def test_what_is_ended_beside_others_is_a_row_and_an_exit_code(tmp_path: Path, profile: str, why: str) -> None:
    code, rows, told = said(tmp_path, "-e", f"fake:{profile}", "--time-limit", "4", "--out", "o", "--jobs", "2")
    assert code == 1
    assert told.count(why) == 3
    assert {row["variant"] for row in rows if row["profile"] == profile} == {"linear", "resting", "listing"}


def test_an_interrupt_ends_all_that_is_run_at_once(tmp_path: Path) -> None:
    (tmp_path / "balls.py").write_text(BALLS)
    words = ["run", "balls.py", "-e", "fake:stuck", "--out", "o", "--jobs", "2"]
    process = subprocess.Popen([sys.executable, str(STUCK), *words], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120.0
    while len(descendants(process.pid)) < 5 and time.monotonic() < deadline:  # child, two workers, a child of each
        time.sleep(0.1)
    mine = descendants(process.pid)
    assert len(mine) >= 5
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=30)
    assert process.returncode == 130
    assert told.count("interrupted") == 1
    time.sleep(0.2)
    assert not [pid for pid in mine if alive(pid)]


def descendants(process: int) -> list[int]:
    below = watch._children(process)
    return [*below, *(one for child in below for one in descendants(child))]


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
        return "Z" not in Path(f"/proc/{process}/stat").read_text().split()[2]
    except (ProcessLookupError, FileNotFoundError):
        return False


def test_the_missing_cases_run_the_largest_first_and_each_is_told_by_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("newtons_cradle", "bouncing_ball", "bouncing_ball", "red_body")
    shown, done, some = list[str](), list[int](), [cases.load(name) for name in names]
    there: Any = SimpleNamespace(
        has=lambda name: name == command.key(1, some[1]), begin=lambda: None, keep=lambda: None
    )

    def beside(todo: Sequence[Callable[[], int]], at_once: int, tell: Callable[[int], None]) -> int:
        for k, run in enumerate(todo):
            tell(k)
            run()
        return 7

    monkeypatch.setattr(watch, "beside", beside)
    monkeypatch.setattr(command, "progress", lambda total, done: nullcontext(shown.append))
    assert command._beside(some, there, lambda i: done.append(i) or 0, 2) == 1
    assert done == [3, 0, 2]
    assert shown == [some[i].label for i in done]
