"""The command of a row runs what the row was of: read again by the command line, word for word."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click import ClickException

from crossbody.cases import CrossbodyError, Value, load
from crossbody.cases.errors import OwnFault
from crossbody.reports.commands import repeated
from crossbody.reports.judging.reach import BUDGET
from crossbody.reports.judging.run_verdicts import Entry
from crossbody.reports.runs import choice
from crossbody.reports.runs.choice import parse_settings

MOTION: Any = object()
SETTINGS = {"dt": 1.0e-3, "max_steps": 100000.0, "rtol": 1e-9}
ENTRIES = [
    Entry(engine=engine, profile=profile, settings=dict.fromkeys(names, 0.0), run=MOTION)
    for engine, profile, names in (("mujoco", "matched", ("dt",)), ("reference", "compiled", ("rtol", "max_steps")))
]


class Drawn:
    """A case with parameters, settings, a tolerance, a budget and a horizon as they may be asked for."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        own = load("bouncing_ball", "listing")
        names = rng.choice(["a0", "a1", "height", "t_end"], rng.integers(0, 4), replace=False)
        self.pairs = tuple(f"{name}={own.parameters[name] * rng.uniform(0.5, 1.5)!r}" for name in names)
        self.case = load("bouncing_ball", "listing", **parse_settings(self.pairs))
        self.t_end = self.case.t_end * float(rng.choice([1.0, rng.uniform()]))
        self.rtol = None if rng.random() < 0.3 else float(10.0 ** rng.uniform(-10.0, -3.0))
        self.budget = BUDGET if rng.random() < 0.5 else float(rng.uniform(1.0, 20.0))
        self.settings: dict[str, Value] = {
            f"{who}{name}": SETTINGS[name] * float(rng.uniform(1.0, 2.0))
            for who, name in (("", "dt"), ("reference.", "rtol"), ("mujoco:matched.", "dt"), ("", "max_steps"))
            if rng.random() < 0.5
        }

    def entry(self, own: Entry) -> Entry:
        found: dict[str, Value] = {}
        for name in own.settings:  # the more precise later, as `of_pick` has it
            for who in ("", f"{own.engine}.", f"{own.engine}:{own.profile}."):
                found |= {name: self.settings[who + name]} if who + name in self.settings else {}
        return replace(own, asked=found)

    def commands(self) -> list[tuple[str, str, str]]:
        again = repeated.repeat(self.case, self.case.name, self.pairs, self.rtol, self.budget, self.t_end)
        entries = [(f"{again} {self.entry(one).options}", one.engine, one.profile) for one in ENTRIES]
        return [*entries, (again, "truth", "")]

    def check(self, *commands: tuple[str, str, str]) -> None:
        rows = [dict(zip(("command", "engine", "profile"), one, strict=True)) for one in commands]
        result: Any = SimpleNamespace(
            case=replace(self.case, t_end=self.t_end), entries=[self.entry(one) for one in ENTRIES]
        )
        repeated.check(rows, self.case, result, self.rtol, self.settings, self.budget)


@pytest.mark.parametrize("seed", range(40))
def test_what_is_said_is_what_was_run(seed: int) -> None:
    drawn = Drawn(seed)
    drawn.check(*drawn.commands())


@pytest.mark.parametrize("seed", range(20))
def test_a_word_that_is_another_one_or_lacks_is_told(seed: int) -> None:
    """Each option with its value dropped, and each number in another digit."""
    drawn = Drawn(seed)
    for command, engine, profile in drawn.commands():
        words = shlex.split(command)
        for i in range(2, len(words)):
            option = words[i].startswith("--")
            other = words[i].replace("1", "2").replace("3", "4").replace("5", "6").replace("7", "8")
            changed = [*words[:i], *words[i + 2 :]] if option else [*words[:i], other, *words[i + 1 :]]
            if changed == words or words[i] == "--variant":  # the first one, which the case's own is
                continue
            with pytest.raises((OwnFault, CrossbodyError, ClickException)):
                drawn.check((shlex.join(changed), engine, profile))


def test_cases_that_are_called_otherwise_than_their_files_are_told_by_these(tmp_path: Path) -> None:
    text = '<mujoco><worldbody><body name="b"><joint type="hinge"/><geom size=".1"/></body></worldbody></mujoco>'
    paths = [str(tmp_path / place / "arm.xml") for place in ("a", "b")]
    for path in map(Path, paths):
        path.parent.mkdir()
        path.write_text(text)
    assert choice.sources([*paths, "bouncing_ball:linear"], None) == (*paths, "bouncing_ball")
    assert choice.sources([], "linear") == choice.DEFAULT_CASES
    names = choice.sources(["newtons_cradle", *paths], None)
    loaded = choice.load_cases(["newtons_cradle", *paths], None, {})
    assert [case.file or case.name for case in loaded] == list(names)


@pytest.mark.parametrize("way", ["{0}/arm.xml", "{0}/b/../arm.xml", "{0}/link.xml", "{0}/other/arm.xml"])
def test_a_file_is_the_same_by_whatever_path_it_is_named(tmp_path: Path, way: str) -> None:
    text = '<mujoco><worldbody><body name="b"><joint type="hinge"/><geom size=".1"/></body></worldbody></mujoco>'
    (tmp_path / "arm.xml").write_text(text)
    (tmp_path / "b").mkdir()
    (tmp_path / "link.xml").symlink_to(tmp_path / "arm.xml")
    (tmp_path / "other").symlink_to(tmp_path)
    source = way.format(tmp_path)
    case = load(source, "reference")
    command = repeated.repeat(case, source, (), None, BUDGET, case.t_end)
    rows: Any = [{"command": command, "engine": "truth", "profile": ""}]
    repeated.check(rows, case, SimpleNamespace(entries=(), case=case), None, {}, BUDGET)
