"""What is run, and the words that all other parts speak.

A case is one module in `library` with three public names:

    PARAMETERS   a mapping from name to `Parameter`
    VARIANTS     a mapping from variant to the parameters it changes; the first is the default
    build        a function (variant, parameters) -> `Case`

    load("bouncing_ball", variant="listing", a1=0.0)
"""

from __future__ import annotations

import sys
from importlib import import_module
from os import PathLike, fspath
from os.path import isabs
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from crossbody.cases.entry_points import checked_arguments
from crossbody.cases.errors import (
    CaseUnsupported,
    ColumnMapError,
    ControlError,
    CrossbodyError,
    EngineUnavailable,
    FormatUnavailable,
    InvalidValue,
    LogFormatError,
    Outcome,
    OutputError,
    SceneError,
    SchedulerUnavailable,
    UnknownName,
)
from crossbody.cases.registry import Registry

if TYPE_CHECKING:
    from crossbody.cases.case import Case, Chaos, Claim, Coordinate, Inputs, Law, Limit, Parameter, Tier, Value
    from crossbody.cases.control import Control
    from crossbody.cases.files.case import Given
    from crossbody.cases.scene import Scene
    from crossbody.cases.trajectory import Acts, Event, Ledger, Mode, Switch, Trajectory

REGISTRY = Registry("case", "crossbody.cases.library", group=__name__)
_LAZY = {
    **dict.fromkeys(
        ("Case", "Chaos", "Claim", "Coordinate", "Inputs", "Law", "Limit", "Parameter", "Tier", "Value"), "case"
    ),
    "Control": "control",
    **dict.fromkeys(("Acts", "Event", "Ledger", "Mode", "Switch", "Trajectory"), "trajectory"),
}

__all__ = [
    "Acts",
    "Case",
    "CaseUnsupported",
    "Chaos",
    "Claim",
    "ColumnMapError",
    "Control",
    "ControlError",
    "Coordinate",
    "CrossbodyError",
    "EngineUnavailable",
    "Event",
    "FormatUnavailable",
    "Inputs",
    "InvalidValue",
    "Law",
    "Ledger",
    "Limit",
    "LogFormatError",
    "Mode",
    "Outcome",
    "OutputError",
    "Parameter",
    "SceneError",
    "SchedulerUnavailable",
    "Switch",
    "Tier",
    "Trajectory",
    "UnknownName",
    "Value",
    "from_file",
    "from_scene",
    "load",
    "names",
    "summary",
    "variants",
]


def _warn_of_another_checkout() -> None:
    """Say so where a folder called crossbody beside the script came before what is installed."""
    here, whole = Path(__file__).parents[1], sys.modules["crossbody"]
    places = [Path(place).resolve() for place in whole.__path__ if isabs(place)]  # others are no folders
    if whole.__file__ or here.resolve() not in places:
        return  # a regular package comes before such a folder
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        told = distribution("crossbody").read_text("direct_url.json") or ""
    except PackageNotFoundError:  # nothing is installed that could be meant
        return
    if '"editable": true' in told and here.resolve().as_uri() not in told:
        import warnings

        warnings.warn(
            f"crossbody is imported from {here}, a folder of that name beside the script, instead "
            "of the editable installation: rename the folder, or install it (pip install -e).",
            RuntimeWarning, stacklevel=2,
        )  # fmt: skip


_warn_of_another_checkout()


def __getattr__(name: str) -> Any:
    """Import the types that need numpy only when one is asked for."""
    if name in _LAZY:
        return getattr(import_module(f"crossbody.cases.{_LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def names() -> tuple[str, ...]:
    """Names of all cases, those of other distributions too; imports none of them."""
    return REGISTRY.names()


@checked_arguments
def summary(name: str) -> str:
    """What a case is, in one line; imports nothing."""
    return REGISTRY.summary(name)


@checked_arguments
def variants(name: str) -> tuple[str, ...]:
    """The variants of a case, the default first; of CASE:VARIANT that one."""
    from crossbody.cases.loading import module, parted

    name, variant = parted(name)
    return tuple(module(name).VARIANTS) if variant is None else (variant,)


def load(name: str, variant: str | None = None, **overrides: Value) -> Case:
    """Build a case.

    Args:
        name: a name of `names()`, or the path of a case file of one's own (ends in .py); or CASE:VARIANT.
        variant: one of the case's variants; its first if not given.
        overrides: parameters to change.

    Raises:
        UnknownName: if there is no such case, variant or parameter; the valid ones are listed.
        InvalidValue: if a parameter lies outside what it admits.
    """
    from crossbody.cases.loading import build

    return build(name, variant, overrides)


@checked_arguments
def from_file(
    path: str | PathLike[str], key: str | None = None, *, control: str | Control | None = None, **overrides: Value
) -> Case:
    """Build a case from a robot's file.

    Args:
        path: of an MJCF file.
        key: one of its keyframes; the first if not given.
        control: what gives the controls of all actuators, or FILE.py:NAME of a callable, whose
            tick is given too.
        overrides: t_end, a0, a1, ctrl, tick and without, as in `crossbody.cases.files.case.PARAMETERS`.

    Raises:
        UnknownName: if there is no such file, keyframe or parameter.
        SceneError: for what a scene does not have, by name.
        InvalidValue: if a parameter lies outside what it admits.
    """
    if control is None or isinstance(control, str):
        return load(fspath(path), key, **overrides, **({} if control is None else {"control": control}))
    from crossbody.cases.files.controls import under

    if "tick" in overrides:
        raise InvalidValue("from_file: tick is given together with a Control, which has its own; valid: one of them.")
    return under(load(fspath(path), key, **overrides), control)


@checked_arguments
def from_scene(scene: Scene, **given: Unpack[Given]) -> Case:
    """Build a case from a scene; see `crossbody.cases.files.case.case_of` for what else may be given."""
    from crossbody.cases.files.case import case_of

    return case_of(scene, **given)
