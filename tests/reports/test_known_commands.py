"""Commands that judge no run ask for known answers before they say a number, and end where one is another."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from crossbody.cases import Case
from crossbody.cases.errors import OwnFault
from crossbody.cases.mechanisms.cradle import rules
from crossbody.cases.scene import Scene
from crossbody.hw.fitting import covariance, difference, doubts
from crossbody.hw.models import _links
from crossbody.hw.reading import repair
from crossbody.hw.reading.plan import Source
from crossbody.hw.replaying import measures
from crossbody.reference.linear import LinearModel
from crossbody.reports import described, known_described
from crossbody.reports.analysis import known_analysis, numbers
from crossbody.reports.bench import known_bench, measure
from crossbody.reports.cli import cli
from crossbody.reports.judging import known
from crossbody.reports.maps import gapmap, known_maps, known_rules
from crossbody.reports.pages import known_pictures
from crossbody.reports.replay import known_doubts, known_fits, known_formats, known_replay
from crossbody.reports.runs import output
from crossbody.reports.suites.axis import Log
from crossbody.reports.sweep import execute, known_sweep

SUPPORT = Path(__file__).parents[1] / "support"
LOG = (str(SUPPORT / "falling_ball.csv"), "--columns", str(SUPPORT / "falling_ball.toml"), "-m", "ball", "-q")
COMMANDS = {
    "replay": ("replay", *LOG, "-e", "reference", "--out", "out"),
    "identify": ("identify", *LOG, "--free", "gravity", "--hold", "0", "--out", "out"),
    "bench": ("bench", "bouncing_ball", "--variant", "linear", "--repeats", "1", "-q", "--out", "out"),
    "analyse": ("analyse", "bouncing_ball", "--variant", "linear", "-q"),
    "picture": ("picture", "earlier", "out"),
    "stress": ("stress", "stiffness", "--runs", "1", "-q", "--out", "out"),
    "gapmap": ("gapmap", "--n", "2", "--points", "2", "-q", "--out", "out"),
    "bode": ("bode", "soft_contact", "-q", "--out", "out"),
    "list": ("list", str(SUPPORT / "driven_ball.xml")),
}  # fmt: skip
MODULES = {
    "replay": known_replay, "identify": known_fits, "doubts": known_doubts, "bench": known_bench,
    "analyse": known_analysis, "picture": known_pictures, "stress": known_sweep, "gapmap": known_maps,
    "rules": known_rules, "list": known_described,
}  # fmt: skip


@pytest.mark.parametrize("name", MODULES)
def test_what_is_right_is_not_told(name: str) -> None:
    assert MODULES[name].wrong() == ()
    known.check({"identify": "replay", "doubts": "replay", "rules": "gapmap"}.get(name, name))


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_ends_where_an_answer_is_wrong(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    with output.folder(tmp_path / "earlier", "run"):
        pass  # of which a picture is asked
    module = MODULES[{"bode": "analyse"}.get(name, name)]
    monkeypatch.setattr(module, "wrong", lambda: (("rmse", 1.0, (2.0, 2.0), "a log"),) * 2)
    ended = CliRunner().invoke(cli, COMMANDS[name])
    assert isinstance(ended.exception, OwnFault)
    assert str(ended.exception) == (
        "No number can be trusted: rmse of a log is 1, but must be 2. 1 more numbers are wrong."
    )
    assert not (tmp_path / "out").exists()


HUNG = _links._hung


def turned(case: Case) -> Scene:
    """Links on hinges whose motors turn the other way."""
    scene = HUNG(case)
    return scene.replace(actuators=tuple(replace(one, gear=(1.0,)) for one in scene.actuators))


CACHED = ("wrong", "link_log", "_hanging", "_flight")
OFF: dict[str, tuple[Any, str, Any]] = {
    "replay": (measures, "bias", lambda y, yhat: float(np.mean(y - yhat))),
    "replay in a unit": (Source, "to_si", lambda source, raw: source.conversion.apply(raw)),
    "replay without repairs": (repair, "GAP", 9.0),
    "identify with intervals": (covariance, "LEVEL", 0.8),
    "identify from noise that lasts": (covariance, "_through", lambda X, rho, series: X),
    "list": (described, "_of_scene", lambda case: {}),
    "replay by motors": (_links, "_hung", turned),
    "doubts of halves": (doubts, "FEWEST", 1000),
    "identify with steps": (difference, "STEP", 1e-13),
    "bench": (measure, "NATIVE", 1),
    "stress": (known_sweep, "residual", lambda run: 0.0),
    "stress by its limit": (execute, "ACCOUNT", 1e6),
    "stress along an axis": (Log, "at", lambda axis, u: axis.low + (axis.high - axis.low) * u),
    "gapmap": (gapmap, "LARGEST_S", 1.5),
    "rules of springs": (rules, "_reduced", lambda masses: masses[1:]),
    "analyse": (numbers, "controllable", lambda model: len(model.states)),
    "analyse without damping": (LinearModel, "poles", lambda model: 1j * np.linalg.eigvals(model.A)),
}


@pytest.mark.parametrize("what", OFF)
def test_a_number_that_is_off_is_told(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module = MODULES[what.split()[0]]
    own, name, other = OFF[what]
    for cached in CACHED:
        if hasattr(module, cached):
            getattr(module, cached).cache_clear()
    monkeypatch.setattr(own, name, other)
    try:
        assert module.wrong()
    finally:
        for cached in CACHED:
            if hasattr(module, cached):
                getattr(module, cached).cache_clear()


@pytest.mark.parametrize("column", ["t", "angle"])
def test_a_log_that_is_read_as_another_one_is_told(column: str, monkeypatch: pytest.MonkeyPatch) -> None:
    kind, library, write, before = known_formats.WRITERS["log.mat"]

    def other(path: Path, data: known_formats.Table) -> None:
        write(path, data | {column: data[column] * (1.0 + 1e-12)})

    known_formats.wrong.cache_clear()
    assert known_formats.wrong() == ()
    monkeypatch.setitem(known_formats.WRITERS, "log.mat", (kind, library, other, before))
    known_formats.wrong.cache_clear()
    assert {what for *_, what in known_formats.wrong()} == {"log.mat"}
    known_formats.wrong.cache_clear()
