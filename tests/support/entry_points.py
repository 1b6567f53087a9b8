"""Every public function, constructor and method, found by walking the packages, with arguments that are good for it."""

from __future__ import annotations

import enum
import inspect
from collections.abc import Callable, Iterator
from contextlib import _GeneratorContextManager
from functools import partial
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from wrong_calls import WRONG, Call, ball, log, motion

from crossbody import engines
from crossbody.engines.equations import system_of
from crossbody.reference import Options, delta, linear

PACKAGES = ("cases", "reference", "reference.linear", "reference.delta", "engines", "hw", "hw.models", "reports")
EXEMPT = {
    "hw.delta_plant": "runs MuJoCo for seconds",
    "reference.linear.locus.build": "a function of the caller's own: what it raises is for the caller",
    "reports.compare.command": "a text that no encoding has reaches Arrow as it is",
}


class Unprintable:
    """An object whose representation fails."""

    def __repr__(self) -> str:
        raise RuntimeError("no representation")


BAD = (*WRONG, Unprintable(), ..., slice(1, 2), np.int8(3), np.datetime64("2020"), bytearray(b"x"), "\ud800")


def good(folder: Path) -> dict[str, Any]:
    """Arguments by their names: what is good for most who have one of that name."""
    (folder / "log.csv").write_text("t,x\n0,1\n1,2\n2,3\n")
    system, run, robot = system_of(ball()), motion(), delta.LIGHT
    return {
        "name": "bouncing_ball", "path": folder / "log.csv", "scene": None, "case": ball(), "runs": [],
        "system": system, "q": [1.0], "q0": [1.0], "v0": [0.0], "t_end": 0.01, "options": Options(t_end=0.01),
        "model": linear.linearise(system, [1.0]), "robot": robot, "log": log(), "run": run,
        "engine": engines.load("mujoco"), "profile": "matched", "role": "coordinates", "start": 0.1, "stop": 0.2,
        "parameter": "gravity", "source": "multiarm_single", "text": "[time]", "rate": 1.0, "noise": 0.1,
        "t": [0.0, 1.0], "y": [[1.0], [2.0]], "values": [1.0], "free": ["k1"], "omega": [1.0], "z": (0.0, 0.0, 0.5),
    }  # fmt: skip


ROBOT = {"q": delta.inverse(delta.LIGHT, (0.0, 0.0, 0.5)), "y": np.full(3, 0.3), "v": np.zeros(9)}
"""Of the functions of `reference.delta`, where they differ."""
OWN: dict[str, dict[str, Any]] = {
    "reference.delta.flanges": {"q": [ROBOT["q"]]}, "reference.delta.inverses": {"z": [[0.0, 0.0, 0.5]]},
    "reference.delta.holding_pose": {"y": 0.3}, "reference.delta.kick": {"impulse": np.zeros(3)},
    "hw.models.load": {"name": "single_pendulum"}, "hw.models.summary": {"name": "single_pendulum"},
    "hw.models.chosen": {"model": "single_pendulum"}, "engines.load": {"name": "mujoco"},
    "engines.summary": {"name": "mujoco"}, "hw.Log.channel": {"name": "q"}, "hw.Log.times": {"name": "q"},
    "hw.replay": {"model": "single_pendulum"}, "hw.inverse": {"model": "single_pendulum"},
    "hw.identify": {"model": "single_pendulum", "budget": 1e-9},
}  # fmt: skip
"""Of single entry points."""


def entry_points() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Every public one by its name, but enumerations, errors and protocols, which are Python's own."""
    for package in PACKAGES:
        module = import_module(f"crossbody.{package}")
        for name in module.__all__:
            found = getattr(module, name)
            label = f"{package}.{name}"
            other = isinstance(found, ModuleType) or not callable(found) or getattr(found, "_is_protocol", False)
            if not other and not (inspect.isclass(found) and issubclass(found, (BaseException, enum.Enum))):
                yield label, found
    subjects = {"hw.Log": log(), "cases.Case": ball(), "cases.Trajectory": motion()}
    subjects |= {"reference.System": system_of(ball()), "reference.delta.Robot": delta.LIGHT}
    subjects |= {"reference.linear.LinearModel": linear.linearise(system_of(ball()), [1.0])}
    for label, subject in subjects.items():
        for name, _ in inspect.getmembers(type(subject), inspect.isfunction):
            if not name.startswith("_"):
                yield f"{label}.{name}", getattr(subject, name)


def wrong_arguments(folder: Path) -> Iterator[Call]:
    """Each argument of each entry point with each bad value, the others good where we know what is good for them."""
    known = good(folder)
    for label, entry in entry_points():
        if label in EXEMPT:
            continue
        own = known | (ROBOT if label.startswith("reference.delta") else {}) | OWN.get(label, {})
        parameters = [
            one
            for one in inspect.signature(entry).parameters.values()
            if one.kind not in (one.VAR_POSITIONAL, one.VAR_KEYWORD)
        ]
        given = {one.name: own.get(one.name) for one in parameters if one.default is one.empty}
        given |= {name: value for name, value in OWN.get(label, {}).items() if name not in given}
        for one in parameters:
            for value in () if f"{label}.{one.name}" in EXEMPT else BAD:
                try:
                    text = f"{label}(good | {{{one.name!r}: {value!r}}})"
                except RuntimeError:
                    text = f"{label}(good | {{{one.name!r}: unprintable}})"
                yield Call(text, partial(_called, entry, given | {one.name: value}))


def _called(entry: Callable[..., Any], given: dict[str, Any]) -> None:
    made = entry(**given)
    if isinstance(made, _GeneratorContextManager):
        with made:
            pass
