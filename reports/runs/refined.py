"""Runs of one engine at finer steps or tolerances, which tell the parts of its error."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from crossbody import engines
from crossbody.cases import Case, CaseUnsupported, Trajectory, Value
from crossbody.reports.judging.parts import RATIO, Positions, Study, settled
from crossbody.reports.measuring.truth import Truth
from crossbody.reports.runs.choice import Pick

FINEST_TOLERANCE = 1e-12
LOOSER = 10.0
"""A tolerance of a study over the tightest: what their runs differ by tells the tightest's error."""
MANY_STEPS, HALVINGS, LEAST_SIZES = 10_000, 5, 3
"""A step is halved twice for its study, and up to five times while that takes no more steps; a run
that has more by itself is studied at twice and four times its step. An order needs three of them."""
MOST_STEPS = 400_000
"""Steps of a run up to which a step is halved further while its study is not settled: what it keeps in memory."""
STUDY_S = 20.0
"""Time that a run of a study may take, s: an integrator that grinds to a halt at 1e-12 has none."""
OF_STUDIES, OF_FILES, DEARER = 2.0, 1.0, 3.0
"""Time that all runs of a study of a scene may take, in budgets, and of a file, whose user waits for it, by what its
own run took; one at a tight tolerance is taken to cost so many times as much."""
READER = "reader"
"""Setting of an engine that reads files by itself: "file", or "scene" for the model of the scene."""

_Run = Callable[..., Trajectory | str]
"""A run with other settings, or why there is none."""


def refined(
    case: Case, truth: Truth, asked: tuple[Pick, Mapping[str, Value]], prepared: engines.Run,
    runs: tuple[Trajectory, Trajectory], took: float, budget: float,
) -> Study:  # fmt: skip
    """Return the other runs of an engine that tell the parts of its error; of its model where its equations are known.

    They go as far as the case, which may end before the runs that are known: where its truth does. Where it reads the
    file by itself they are of the model that is built from the scene. What was asked of the engine, they have too.

    Args:
        case: what is run.
        truth: of the case.
        asked: the engine, and what was asked of it.
        prepared: the engine as it ran.
        runs: at its own samples, and at those that are judged.
        took: what the case takes it, s.
        budget: s.
    """
    settings, (natural, judged) = prepared.settings, runs
    run = _runner(case, *asked, settings)
    size = {name: float(settings[name]) for name in ("dt", "rtol") if name in settings}
    of_scene: dict[str, Any] = {READER: "scene"} if settings.get(READER) == "file" else {}
    built = run(**of_scene, **size) if of_scene else None
    told: dict[str, Any] = {"built": built}
    if isinstance(built, str):
        told, of_scene = {"why_built": built}, {}
    if prepared.follows is not None:
        return Study(**told)
    if not size:
        return Study(why="It has neither a step nor a tolerance that can be refined.", **told)
    setting, own = next(iter(size.items()))
    most = (OF_FILES if case.file else OF_STUDIES) * budget if case.general else math.inf
    samples = {"samples": np.array(judged.t[judged.t <= case.t_end])} if "samples" in settings else {}
    known = {} if setting == "rtol" else {own: built if of_scene else natural}

    def at(one: float) -> Trajectory | str:
        return known.get(one) or run(**of_scene, **{setting: one}, **samples)

    why = ""
    for sizes in _sizes(setting, own, natural.steps, case.tight):
        sizes = _afforded(setting, sizes, own, took, most)
        if (cost := _cost(setting, sizes, own, took)) > most:
            return Study(why=f"The runs with other {setting} that are needed would take about {cost:.0f} s.", **told)
        found = [at(one) for one in sizes]
        if not (failed := [one for one in found if isinstance(one, str)]):
            study = Study(setting=setting, sizes=sizes, runs=tuple(found), **told)  # type: ignore[arg-type]
            return _further(case, truth, judged, study, at, took * own, most) if case.general else study
        why = why or failed[0]
    return Study(why=why, **told)


def _runner(case: Case, pick: Pick, given: Mapping[str, Value], settings: Mapping[str, Any]) -> _Run:
    """Return what runs an engine with what was asked of it, but for what is changed."""
    asked = {name: settings[name] for name in given if name in settings}
    limit = {"time_limit": STUDY_S} if "time_limit" in settings else {}

    def run(**changed: Any) -> Trajectory | str:
        try:
            found = engines.load(pick.engine).prepare(case, pick.profile, **(asked | changed | limit)).run()
        except CaseUnsupported as error:
            return str(error)
        said = ", ".join(f"{name} {value}" for name, value in changed.items() if name != "samples")
        return found if found.outcome.ok else f"A run with {said} ends {found.outcome.value}."

    return run


def _further(
    case: Case, truth: Truth, judged: Trajectory, study: Study, at: Callable[[float], Trajectory | str],
    took: float, most: float,
) -> Study:  # fmt: skip
    """Return a study with ever smaller steps until it is settled, as far as there is time for.

    Args:
        case: what is run.
        truth: of the case.
        judged: the run that is judged.
        study: its runs at falling steps or tolerances.
        at: runs it at another step.
        took: what a run takes, s, times its step, s.
        most: what all runs may take, s.
    """
    if study.setting != "dt":
        return study
    left, positions = most - sum(took / size for size in study.sizes), Positions(case, truth, truth.compared(judged))
    while not settled(positions, study):
        size = study.sizes[-1] / RATIO
        left -= took / size
        if left < 0.0 or case.t_end / size > MOST_STEPS:
            break
        if isinstance(finer := at(size), str):
            break
        study = replace(study, sizes=(*study.sizes, size), runs=(*study.runs, finer))
    return study


def _afforded(setting: str, sizes: tuple[float, ...], own: float, took: float, most: float) -> tuple[float, ...]:
    """Return as many of the sizes of a study as there is time for, three at least."""
    while _cost(setting, sizes, own, took) > most and len(sizes) > LEAST_SIZES:
        sizes = sizes[:-1]
    return sizes


def _cost(setting: str, sizes: Sequence[float], size: float, once: float) -> float:
    """About what the runs of a study take, s, but for the one that is known."""
    if setting == "rtol":
        return once * DEARER * len(sizes)
    return once * sum(size / one for one in sizes if one != size)


def _sizes(setting: str, size: float, steps: int, tight: float) -> list[tuple[float, ...]]:
    """Steps or tolerances of a study, falling; a second one is for when a run of the first fails."""
    if setting == "rtol":
        tightest = min(max(FINEST_TOLERANCE, tight), size)
        return [(LOOSER * tightest, tightest)]
    if steps > MANY_STEPS:
        return [(RATIO**2 * size, RATIO * size, size), _halved(size, 2)]
    return [_halved(size, min(max(2, int(math.log2(MANY_STEPS / max(steps, 1)))), HALVINGS))]


def _halved(size: float, times: int) -> tuple[float, ...]:
    return tuple(size / RATIO**k for k in range(times + 1))
