"""A folder of every study that has a page, each as small as it can be, by the commands themselves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from crossbody.cases import Case
from crossbody.engines import Run
from crossbody.reports.cli import main
from crossbody.reports.judging.run_verdicts import Entry
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.pages import site
from crossbody.reports.runs import study
from crossbody.reports.runs.jobs import CaseResult
from crossbody.reports.runs.output import folder

MAP = """[time]
column = "t [s]"
unit = "s"

[coordinates.th1]
column = "angle [deg]"
unit = "deg"
"""
ONE = ("-e", "reference:compiled")


def rig(folder: Path) -> tuple[str, ...]:
    """A log of a pendulum, made up, and what the commands for logs must know of it."""
    t = np.arange(2000) * 2e-3
    swing = solve_ivp(lambda _, y: [y[1], 58.0 * np.sin(y[0]) - 0.2 * y[1]], (0.0, t[-1]), [2.5, 0.0], t_eval=t)
    rows = np.stack([t, np.rad2deg(swing.y[0])], axis=1)
    np.savetxt(folder / "rig.csv", rows, delimiter=",", header="t [s],angle [deg]", comments="")
    (folder / "rig.toml").write_text(MAP, encoding="utf-8")
    return str(folder / "rig.csv"), "-m", "single_pendulum", "--columns", str(folder / "rig.toml"), "--restart", "2"


def commands(folder: Path) -> dict[str, tuple[str, ...]]:
    """Arguments of gap map, frequency responses, analysis, stress, replay, identification and readers."""
    log = rig(folder)
    return {
        "gapmap": (*ONE, "--n", "3", "--points", "5"),
        "bode": ("soft_contact",),
        "analyse": ("delta_impulse", "--at", "z=0.4", "--bode", "--map"),
        "stress": ("gap", *ONE, "--runs", "4", "--jobs", "1"),
        "replay": (*log, *ONE),
        "identify": (*log, "-f", "k1"),
        "conformance": ("--feature", "armature", "-e", "mujoco"),
    }


def studies(folder: Path) -> list[Path]:
    """Folders of these studies."""
    asked = commands(folder)
    for name, arguments in asked.items():
        with pytest.raises(SystemExit) as end:
            main([name, *arguments, "--quiet", "--out", str(folder / name)])
        assert not end.value.code, name
    return [folder / name for name in asked]


def page_of(case: Case, out: Path, *runs: Run) -> Path:
    """Write the page of one case and its runs into a folder that is made here."""
    entries = tuple(Entry(engine=run.engine, profile=run.profile, run=run.run()) for run in runs)
    results = [CaseResult(case=case, truth=truth_of(case), entries=entries)]
    with folder(out) as made:
        study.write(made, results, study.judge(results, {case.label: "crossbody run"}), {"command": "test", "time": ""})
        site.write(made)
    (page,) = out.glob("case-*.html")
    return page
