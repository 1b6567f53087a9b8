"""Whatever is asked wrongly of Python or the command line is refused in a sentence of ours, never by a traceback."""

from __future__ import annotations

import os
import random
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from entry_points import wrong_arguments
from wrong_calls import COSTLY, Call, _logs, arguments_of_entry_points, calls, failure, fields_of_a_system, make_files

from crossbody import cases
from crossbody.cases import CrossbodyError, InvalidValue, Outcome, SceneError, UnknownName
from crossbody.engines.equations import system_of
from crossbody.reference import simulate
from crossbody.reports import cli, commands
from crossbody.reports.analysis import bode
from crossbody.reports.bench import measure, skip, throughput
from crossbody.reports.commands import analyse, cache, stress
from crossbody.reports.judging import known
from crossbody.reports.maps import gapmap, stability
from crossbody.reports.runs import jobs

LOG_CALLS = 300


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """What is wrong for most may be a good name of a file to write."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def cheap(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A folder to be in, and commands that stop where they would begin to compute; a fault of ours is one here."""

    def stop(*_: Any, **__: Any) -> Any:
        raise CrossbodyError(COSTLY)

    costly = ((jobs, "run_case"), (measure, "bench"), (skip, "measure"), (throughput, "measure"), (stress, "sweep"))
    more = ((gapmap, "gap_map"), (stability, "stability_map"), (bode, "soft_contact"), (analyse, "places"))
    all_names = ((cache, "warm"), (cache, "clear"), (known, "check"))  # `clear` would remove the code of these tests
    for module, name in costly + more + all_names:
        monkeypatch.setattr(module, name, stop)
    monkeypatch.setattr(cli, "_crashed", _raise)
    make_files(tmp_path)
    assert commands
    return tmp_path


def _raise(error: Exception) -> int:
    raise error


def faults(seed: int, count: int, folder: Path, costly: bool) -> str:
    """One of each kind of fault that so many draws find."""
    found = defaultdict(list)
    for call in calls(random.Random(seed), count, folder, costly):
        if text := failure(call):
            found["\n".join(text.splitlines()[-3:])].append(text)
    return "\n\n".join(f"{len(texts)} x {texts[0][:500]} ... {texts[0][-500:]}" for texts in found.values())


def test_wrong_calls_are_refused_in_a_sentence(cheap: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert not faults(1, 250, cheap, costly=False)


def test_wrong_arguments_for_logs_are_refused_in_a_sentence(tmp_path: Path) -> None:
    rng = random.Random(3)
    found = [text for _ in range(LOG_CALLS) if (text := failure(_logs(rng, tmp_path)))]
    assert not found, "\n\n".join(found[:5])


@pytest.mark.parametrize("kind", [fields_of_a_system, arguments_of_entry_points])
def test_every_argument_refuses_every_wrong_value_in_a_sentence(kind: Callable[[], Iterator[Call]]) -> None:
    found = [text for call in kind() if (text := failure(call))]
    assert not found, "\n".join(text[:300] for text in found[:20])


@pytest.mark.parametrize("step", [7, pytest.param(1, marks=pytest.mark.slow)])
def test_every_public_name_refuses_every_wrong_argument_in_a_sentence(step: int, cheap: Path) -> None:
    every = list(wrong_arguments(cheap))
    assert len(every) > 30_000  # the packages were walked
    found = [text for call in every[::step] if (text := failure(call))]
    assert not found, "\n".join(text[:300] for text in found[:20])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_ten_thousand_wrong_calls_are_refused_in_a_sentence(
    cheap: Path, seed: int, capfd: pytest.CaptureFixture[str]
) -> None:
    assert not faults(100 + seed, 1000, cheap, costly=True)


@pytest.mark.parametrize("solver", ["compiled", "cvode", "ida"])
def test_every_motion_has_its_start(solver: str) -> None:
    """Also where no row was asked for, or nothing could be computed."""
    case = cases.load("bouncing_ball", "linear", t_end=0.2)
    run = simulate(system_of(case), case.q0, case.v0, 0.2, solver=solver, samples=[])
    assert run.outcome is Outcome.FINISHED
    assert (len(run.t), run.t[-1], run.q[0, 0], run.gap[0, 0]) == (1, 0.0, case.q0[0], case.q0[0])
    np.testing.assert_allclose(run.energy[0], [0.0, 9.81 * case.q0[0]])
    assert run.lam.shape == run.mode.shape == (1, 1)


SYSTEM = "crossbody.reference.System"


@pytest.mark.parametrize(
    ("arguments", "options", "error", "said"),
    [
        ((None, [1.0], [0.0], 1.0), {}, InvalidValue, SYSTEM),
        ((7, [1.0], [0.0], 1.0), {"nonsense": 1}, UnknownName, "option"),
        ((7, [1.0], [0.0], 10**400), {}, InvalidValue, "t_end"),
        ((7, [1.0], [0.0], 1.0), {"max_steps": 1.5}, InvalidValue, "whole number"),
        ((7, [1.0], [0.0], 1.0), {"ledger": "x"}, InvalidValue, "True, False"),
        ((7, [1.0], [0.0], 1.0), {"inputs": 3}, SceneError, "pair"),
        ((7, [1.0], [0.0], 1.0), {"fsm": ["level"]}, UnknownName, "machine"),
    ],
)
def test_options_are_checked(arguments: Any, options: Any, error: type[Exception], said: str) -> None:
    given = list(arguments)
    given[0] = system_of(cases.load("bouncing_ball", "linear")) if given[0] == 7 else given[0]
    with pytest.raises((error, InvalidValue), match=said):
        simulate(*given, **options)


def test_complex_numbers_are_not_cut_to_real_ones() -> None:
    system = system_of(cases.load("bouncing_ball", "linear"))
    with pytest.raises(SceneError, match="complex"):
        simulate(system, np.array([1.0 + 2.0j]), [0.0], 0.1)


@pytest.mark.parametrize(
    "words",
    [
        ("analyse", "nope"),
        ("analyse", "bouncing_ball", "--set", "nope=1"),
        ("bode", "nope"),
        ("bench", "nope"),
        ("stress", "nope"),
        ("identify", "nope.csv", "-m", "ball", "-f", "mass"),
        ("replay", "nope.csv", "-m", "ball"),
    ],
)
def test_a_wrong_name_is_told_before_the_reference_is_compiled(words: tuple[str, ...], tmp_path: Path) -> None:
    command, kept = [sys.executable, "-m", "crossbody", *words], tmp_path / "cache"
    env = os.environ | {"CROSSBODY_CACHE": str(kept)}
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    assert "nope" in done.stderr
    assert len([*kept.rglob("*.code")]) < 20  # kernels that are none's; the reference has 300 functions


@pytest.mark.parametrize("words", [("report", "{}"), ("picture", "{}", "a.svg"), ("run", "--with", "{}")])
@pytest.mark.parametrize(("name", "said"), [("none", "does not exist"), ("file", "is not a folder")])
def test_a_folder_of_an_earlier_run_that_is_none_is_told(
    words: tuple[str, ...], name: str, said: str, cheap: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert cli._obey([word.format(name) for word in words]) == 2
    assert f"{name} {said}" in capfd.readouterr().err
