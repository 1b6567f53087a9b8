"""One run over one window of a log; of the reference without the warm-up that timing needs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from crossbody import engines
from crossbody.cases import Case, CaseUnsupported, Trajectory, Value
from crossbody.engines.equations import system_of
from crossbody.hw.models.contract import Model
from crossbody.hw.windows.window import Window
from crossbody.reference import simulate

REFERENCE = {"rtol": 1e-8}  # settings of the reference: far below what a rig measures


def run_once(case: Case, solver: str, **options: Any) -> Trajectory:
    """One motion of a case by the reference: a `solver` of its profiles, and `reference.Options`."""
    given = case.inputs
    return simulate(
        system_of(case), case.q0, case.v0, case.t_end, solver=solver, fsm=case.fsm,
        collisions=case.collisions,
        inputs=None if given is None else (given.times, given.values), **options,
    )  # fmt: skip


def run_window(
    model: Model, numbers: Mapping[str, Value], window: Window, name: str, profile: str, settings: Mapping[str, Any]
) -> tuple[Trajectory, dict[str, Any]]:
    """One window on one engine: the motion, and what was really used.

    Raises:
        CaseUnsupported, EngineUnavailable: if the engine cannot do it.
    """
    case = model.build(numbers, window.segment)
    asked = dict(model.settings.get(name, {})) | dict(settings)
    engine = engines.load(name)
    reason = model.why_not.get(name) or engine.why_not(case, profile)
    if reason is not None:
        raise CaseUnsupported(reason)
    if name == "reference":
        used = REFERENCE | asked
        solver = "compiled" if profile == "matched" else profile
        # Where inputs change at every sample its steps end there: samples of their own would cost a third more.
        samples = None if len(window.segment.times) else window.t - window.t[0]
        return run_once(case, solver, samples=samples, **used), {**used, "profile": solver}
    prepared = engine.prepare(case, profile, **asked)
    return prepared.run(), dict(prepared.settings) | {"profile": prepared.profile}
