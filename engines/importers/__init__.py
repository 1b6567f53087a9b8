"""What an engine's own reader makes of a robot file: one module an importer, each run in a process of its own.

A module has `FORMATS` (of "mjcf" and "urdf"), `PACKAGE` (what has to be installed), `MODULE` (what is imported of it),
and `open_robot(path, urdf)`, which returns a `Robot`; it may have `TRIED` (first and last version that it was tried
with) and `INSTALL` (what pip is to install, if not that package). It is loaded by its path where crossbody may not be
installed, so it imports nothing of ours, and its engine only inside its functions:
CROSSBODY_PYTHON_NEWTON=/path/to/python names the interpreter of the importer newton, where that is not this one.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol

from crossbody.cases.arrays import Floats
from crossbody.cases.errors import InvalidValue, UnknownName
from crossbody.cases.registry import Registry

REGISTRY = Registry("importer", __name__, hidden=("beside",))
SECONDS, BYTES = 20.0, 3 << 30  # what an importer may take: time, s, and memory, bytes
GRACE = 2.0  # what it has in any case when its job is there, s: it may have waited for that
LATE = "It did not return within"  # how the sentence on an importer begins that took more than its time
TOLD = 100_000  # bytes of what an importer says that are read
WITHOUT = {"exudyn": " (its LoadURDFrobot is roboticstoolbox's)", "pymunk": "", "reference": ": it is the yardstick"}
"""Engines that there is nothing to ask."""
PROCESS = Path(__file__).parent / "beside" / "process.py"


class Robot(Protocol):
    """A robot file as an engine's own reader has it, in that engine's coordinates.

    What the engine does not have may be left out, if `hidden` or `unseen` says why, and all that
    would be empty.

    Attributes:
        version: of the engine.
        joints: name, body that it moves, kind (free, ball, hinge, slide; unbounded: a hinge by
            cos and sin; any other is compared by name alone), first position and first velocity.
        free, ball: conventions of their coordinates, of those in `beside.conventions.CONVENTIONS`.
        nq, nv: numbers of positions and of velocities.
        numbers: quantity (of `parts.NUMBERS`) -> joint -> one number, or one a velocity.
        actuators: which joints each moves.
        loops: of every equality its type (connect, weld, joint; empty where the engine tells their
            number alone), the two joints of one of joints, the coefficients of its polynomial.
        tendons: damping, stiffness, friction loss, rest and range of each.
        keys: name of every keyframe -> its positions (nq,).
        hidden: quantity -> why this engine does not have it.
        unseen: quantity -> why what it has of it cannot be looked at.
        refused: of these, what its reader gives up on in this file; may be left out.
        precision: what rounding is to it, of the largest entry.
    """

    version: str
    joints: Sequence[tuple[str, str, str, int, int]]
    free: str
    ball: str
    nq: int
    nv: int
    numbers: Mapping[str, Mapping[str, Sequence[float]]]
    actuators: Mapping[str, Sequence[str]]
    loops: Sequence[tuple[str, Sequence[str], Sequence[float]]]
    tendons: Mapping[str, Sequence[float]]
    keys: Mapping[str, Sequence[float]]
    hidden: Mapping[str, str]
    unseen: Mapping[str, str]
    precision: float

    def place(self, q: Floats, v: Floats) -> None:
        """Set the state (nq,), (nv,)."""

    def mass_matrix(self) -> Floats:
        """Return M (nv, nv) there, with armature."""

    def bias(self) -> Floats:
        """Return what has to be added to M v' to give the forces (nv,): Coriolis forces, and weight."""

    def energy(self) -> float:
        """Return kinetic and potential energy, J, up to a constant."""

    def frames(self) -> Mapping[str, tuple[Floats, Floats]]:
        """Return origin (3,), m, and rotation (3, 3) of every body."""

    def ends(self) -> Sequence[Sequence[tuple[Floats, Floats]]]:
        """Return of every loop the two frames whose origins (connect) or which (weld) it holds together, or none."""

    def drives(self) -> tuple[Mapping[str, Floats], Floats]:
        """Return each actuator's force (nv,) for a control of one, and of all of them at no control."""

    def lengths(self) -> Mapping[str, float]:
        """Return the length of every tendon."""

    def shapes(self) -> Sequence[tuple[str, str, str, Sequence[float], Floats, Floats, Floats]]:
        """Return of every shape that may touch: name, kind, joint that moves it, and what `bounds` needs.

        That is of `beside.solids`: size, points, and where it stands: origin (3,) and rotation (3, 3).
        """

    def contacts(self) -> Sequence[tuple[int, int]]:
        """Return which of these may touch each other, by their numbers."""

    def surfaces(self) -> Sequence[Sequence[float]]:
        """Return of each of these pairs its friction along two tangents, about the normal and them, and its margin, m.

        Coefficients that are not in force are 0.
        """

    def softness(self) -> Mapping[str, Sequence[float]]:
        """Return a0, 1/s^2, and a1, 1/s, of rows: bounds of joints and tendons, and loops, by their names.

        A pair of shapes has their names with a colon between them.
        """

    def inertias(self) -> Sequence[tuple[str, float, Floats, Floats]]:
        """Return of every body: its joint, mass, kg, centre (3,), inertia about it (3, 3), in world axes."""


class Reading:
    """An importer at work on a file, for some seconds; nice says how much it lets others go before it."""

    def __init__(self, name: str, path: Path, urdf: bool, seconds: float = SECONDS, nice: int = 0) -> None:
        module = REGISTRY.load(name)
        self.name, self.package, self.seconds = name, str(module.PACKAGE), seconds
        self.python = os.environ.get(f"CROSSBODY_PYTHON_{name.upper()}", sys.executable)
        self.formats = tuple(module.FORMATS)
        self._files = tempfile.TemporaryDirectory(prefix="crossbody-reading-")
        self._out, self._told = (Path(self._files.name) / kind for kind in ("answers", "told.txt"))
        kind, self._began, self._nice = ("urdf" if urdf else "mjcf"), time.monotonic(), nice
        self._process = self._started(str(module.__file__), str(path.resolve()), kind)
        self._there = self.python != sys.executable or find_spec(module.MODULE) is not None

    def _started(self, *words: str) -> subprocess.Popen[bytes] | None:
        """Return the process, which ends with this one; None for a format that it has no reader for."""
        if words[-1] not in self.formats:
            return None
        single = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL")}
        with self._told.open("wb") as told:
            try:
                return subprocess.Popen(
                    [self.python, "-P", str(PROCESS), *words, str(self._out), str(BYTES), str(self._nice)],
                    stdin=subprocess.PIPE, stdout=told, stderr=told, start_new_session=True,
                    cwd=self._files.name, env=os.environ | single,
                )  # fmt: skip
            except OSError as error:
                self._told.write_text(f"{self.python} cannot be started: {error.strerror}", encoding="utf-8")
                return None

    def answer(self, job: Mapping[str, Any]) -> dict[str, Any]:
        """Return what was measured, or `why` there is nothing; in both cases what the importer has `told`.

        Args:
            job: `joints` (name, body, kind) in the order of the coordinates, and `states`, each
                with `q` and `v`.
        """
        return self.answers([job])[0]

    def answers(self, jobs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Return an answer a job, up to the first that ended the process; later ones name their `file`."""
        with self._files:
            if self._process is None:
                return [self._without()] * len(jobs)
            why = self._waited(self._process, "".join(json.dumps(job) + "\n" for job in jobs).encode())
            found = _loaded(self._out)
            if len(found) < len(jobs):
                begin = found[-1]["to"] if found else 0
                found.append({"status": "failed", "why": why or "It ended without an answer.", "from": begin})
            for one in found:
                one["told"] = _lines(self._told, one["from"], one.get("to", -1))
                one["error"] = one.get("why", "")
                if one["status"] == "failed" and one["told"]:
                    one["why"] = f"{one['why']} ({one['told'][-1]})"
                if one["status"] == "failed" and one.get("strange"):
                    one["why"] = f"{one['why']} {one['strange']}"
        return found

    def _without(self) -> dict[str, Any]:
        """Return the answer of a process that there is not."""
        why = self._told.read_text(encoding="utf-8") if self._told.exists() else ""
        status = "failed" if why else "unsupported"
        if not self._there:
            status, why = "absent", f"It needs the package {self.package}, which is not installed."
        return {
            "status": status, "told": [],
            "why": why or f"{self.name} reads no files of this format; valid: {', '.join(self.formats)}.",
        }  # fmt: skip

    def _waited(self, process: subprocess.Popen[bytes], jobs: bytes) -> str:
        """Return why the process did not come to its end; empty where it did."""
        try:
            self._talked(process, jobs)
        except subprocess.TimeoutExpired:
            return f"{LATE} {self.seconds:g} s and was ended; see --time-limit."
        finally:
            self._kill()
        number = -process.returncode
        if number <= 0:
            return ""
        name = signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
        return f"Its process was ended by {name}."

    def _talked(self, process: subprocess.Popen[bytes], jobs: bytes) -> None:
        """Give the jobs, and wait as long as there is an answer in the time that one may take."""
        left = max(self.seconds - (time.monotonic() - self._began), min(self.seconds, GRACE))
        sender = threading.Thread(target=_given, args=(process, jobs), daemon=True)
        sender.start()
        answers = -1
        while True:
            try:
                process.wait(left)
                return
            except subprocess.TimeoutExpired:
                before, answers, left = answers, len(_loaded(self._out)), self.seconds
                if answers <= max(before, 0):
                    raise

    def abandon(self) -> None:
        """End the process, whose answer is not wanted."""
        self._kill()
        self._files.cleanup()

    def _kill(self) -> None:
        """Kill the process and all that it has begun."""
        if self._process is not None:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
            with suppress(OSError, ValueError):
                self._process.stdin.close() if self._process.stdin is not None else None
            self._process.wait()


def answers(
    name: str, files: Sequence[Path], urdf: bool, jobs: Sequence[Mapping[str, Any]], seconds: float = SECONDS
) -> list[dict[str, Any]]:
    """Return what an importer makes of files, one process behind another only where one of them ends it."""
    told: list[dict[str, Any]] = []
    named = [{"file": str(path.resolve())} | dict(job) for path, job in zip(files, jobs, strict=True)]
    while len(told) < len(files):
        told += Reading(name, files[len(told)], urdf, seconds).answers(named[len(told) :])
    return told


def _given(process: subprocess.Popen[bytes], jobs: bytes) -> None:
    with suppress(OSError, ValueError):
        if process.stdin is not None:
            process.stdin.write(jobs)
            process.stdin.close()


def _loaded(path: Path) -> list[dict[str, Any]]:
    try:
        return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    except (OSError, ValueError):
        return []


def _lines(path: Path, begin: int, end: int) -> list[str]:
    """Return what was said between two bytes, each line once, without the colours of a terminal."""
    with path.open("rb") as file:
        file.seek(begin)
        text = file.read(min(TOLD, end - begin) if end >= 0 else TOLD).decode(errors="replace")
    plain = re.sub(r"\x1b\[[0-9;]*m", "", text)
    return list(dict.fromkeys(line.strip() for line in plain.splitlines() if line.strip()))


def names() -> tuple[str, ...]:
    """Names of all importers, installed or not."""
    return REGISTRY.names()


def missing(absent: Sequence[str]) -> str:
    """Return in a sentence which importers are not installed, and what brings them."""
    modules = [REGISTRY.load(name) for name in absent]
    wanted = dict.fromkeys(getattr(module, "INSTALL", module.PACKAGE) for module in modules)
    packages = " ".join(map(shlex.quote, wanted))
    return (
        f"Not installed: {', '.join(absent)}. pip install {packages} installs what is missing, here or in "
        f"an environment whose python is named: CROSSBODY_PYTHON_{absent[0].upper()}=PATH."
    )


def known(wanted: Sequence[str]) -> tuple[str, ...]:
    """Return the importers wanted, each once; all of them where none is."""
    for name in wanted:
        if name in WITHOUT and name not in names():
            raise InvalidValue(f"{name} has no reader of robot files of its own{WITHOUT[name]}.")
        if name not in names():
            raise UnknownName("importer", name, names())
    return tuple(dict.fromkeys(wanted)) or names()
