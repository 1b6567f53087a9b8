"""The reference's equations of a case: a module of reference/systems, or a file of the user's own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from crossbody.cases import Case, CaseUnsupported, SceneError
from crossbody.cases.errors import KernelError, OwnFault
from crossbody.cases.installed import from_file
from crossbody.cases.remembered import remembered
from crossbody.cases.scene_contacts import rowless
from crossbody.reference import System

SYSTEMS = "crossbody.reference.systems"


def builder(mechanism: str) -> Callable[..., System] | None:
    """What builds the equations of a mechanism from (parameters, law); None where there are none.

    Args:
        mechanism: a module of reference/systems with `build`, or the path of a file (ends in .py)
            with `system`.
    """
    if mechanism.endswith(".py"):
        return getattr(module(mechanism), "system", None)
    known = find_spec(f"{SYSTEMS}.{mechanism}") is not None
    return getattr(module(mechanism), "build", None) if known else None


@cache
def module(mechanism: str) -> ModuleType | None:
    """Return where the equations stand; None for a scene, whose equations are those of every scene."""
    if mechanism == "scene":
        return None
    own = mechanism.endswith(".py")
    return from_file("mechanism", Path(mechanism)) if own else import_module(f"{SYSTEMS}.{mechanism}")


@contextmanager
def answering(case: Case) -> Iterator[None]:
    """Answer for a kernel of a case that is not what it says: it is crossbody's own, unless a file has the equations.

    Raises:
        OwnFault: in place of what blames whoever wrote the kernel.
    """
    try:
        yield
    except KernelError as error:
        if case.mechanism.endswith(".py"):
            raise
        raise OwnFault(str(error)) from error


def has_equations(case: Case) -> bool:
    """Return whether the reference has equations of a case."""
    return case.scene is not None or builder(case.mechanism) is not None


@remembered(4)
def _built(build: Callable[..., System], parameters: Any, law: Any) -> System:
    made = build(parameters, law)
    if wrong := np.flatnonzero(law.touches & (np.asarray(made.follows) >= 0)).tolist():
        raise SceneError(f"Rows {wrong} are rows of friction, which have no gap: Law.touches must be False for them.")
    return made


def system_of(case: Case, made: System | None = None) -> System:
    """The mechanism with the law of its rows, as it was made if given; its findings name shapes of a file without any.

    `covered` of the harness asks that of a motion; whoever takes the equations alone is told by every run of them.
    """
    made, lost = made or equations_of(case), rowless(case.scene) if case.file and case.scene is not None else {}
    return replace(made, findings=(*made.findings, _left_out(lost))) if lost else made


def _left_out(lost: Mapping[frozenset[str], str]) -> str:
    """Say which shapes have no rows and why, of the first pair by name, and how many more."""
    first, reason = min((sorted(shapes), why) for shapes, why in lost.items())
    more = len(lost) - 1
    others = f"; nor have {more} other pairs" if more > 1 else "; nor has another pair" if more else ""
    return f"Shapes {' and '.join(map(repr, first))} have no rows and pass through each other: {reason}{others}."


def equations_of(case: Case, traced: bool | None = None) -> System:
    """The mechanism with the law of its rows: kernels of its own, where there are some, or those of every scene.

    Args:
        case: whose.
        traced: of a scene: whether code is compiled for it alone; None takes it where it was compiled before.
    """
    if (build := builder(case.mechanism)) is not None:
        return _built(build, case.parameters, case.law)
    if case.scene is None:
        raise CaseUnsupported(f"The reference has no equations of the mechanism {case.mechanism!r}.")
    from crossbody.reference.tree.system import system

    return system(case.scene, case.law, case.q0, case.control, case.act0, case.rank, traced)
