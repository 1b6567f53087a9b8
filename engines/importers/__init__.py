"""What an engine's own reader makes of a robot file: one module an importer, each run in a process of its own.

A module has `FORMATS` (of "mjcf" and "urdf"), `PACKAGE` (what has to be installed), `MODULE` (what is imported of it)
and `open_robot(path, urdf)`, which returns a `Robot`. It is loaded by its path where crossbody may not be installed, so
it imports nothing of ours, and its engine only inside its functions: CROSSBODY_PYTHON_NEWTON=/path/to/python names the
interpreter of the importer newton, where that is not this one.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

from crossbody.cases.arrays import Floats
from crossbody.cases.errors import UnknownName
from crossbody.cases.registry import Registry

REGISTRY = Registry("importer", __name__, hidden=("process",))
SECONDS, BYTES = 20.0, 3 << 30
"""What an importer may take: time, s, and memory, bytes."""
TOLD = 100_000
"""Bytes of what an importer says that are read."""
PROCESS = Path(__file__).parent / "process.py"


class Robot(Protocol):
    """A robot file as an engine's own reader has it, in that engine's coordinates.

    Attributes:
        version: of the engine.
        joints: name, body that it moves, kind (free, ball, hinge, slide; unbounded: a hinge by cos and sin; any other
            is compared by name alone), first position and first velocity.
        free, ball: conventions of their coordinates, of those in `process.CONVENTIONS`.
        nq, nv: numbers of positions and of velocities.
        numbers: quantity (armature, damping, stiffness, rest, lower, upper, friction) -> joint -> one number or more.
        actuators: which joints each moves.
        loops: number of equalities.
        hidden: quantity -> why this engine does not have it.
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
    loops: int
    hidden: Mapping[str, str]
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

    def inertias(self) -> Sequence[tuple[str, float, Floats, Floats]]:
        """Return of every body: joint that moves it, mass, kg, centre (3,), inertia about it (3, 3); world axes."""


class Reading:
    """An importer at work on a file.

    Args:
        name: of the importer.
        path: of the file.
        urdf: whether it is a URDF.
        seconds: what it may take.
    """

    def __init__(self, name: str, path: Path, urdf: bool, seconds: float = SECONDS) -> None:
        module = REGISTRY.load(name)
        self.name, self.package, self.seconds = name, str(module.PACKAGE), seconds
        self.python = os.environ.get(f"CROSSBODY_PYTHON_{name.upper()}", sys.executable)
        self.formats = tuple(module.FORMATS)
        self._files = tempfile.TemporaryDirectory(prefix="crossbody-reading-")
        self._out, self._told = (Path(self._files.name) / kind for kind in ("answer.json", "told.txt"))
        kind = "urdf" if urdf else "mjcf"
        self._process = self._started(str(module.__file__), str(path.resolve()), kind)

    def _started(self, *words: str) -> subprocess.Popen[bytes] | None:
        """Return the process, which ends with this one; None for a format that it has no reader for."""
        if words[-1] not in self.formats:
            return None
        single = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL")}
        with self._told.open("wb") as told:
            try:
                return subprocess.Popen(
                    [self.python, "-P", str(PROCESS), *words, str(self._out), str(BYTES)], stdin=subprocess.PIPE,
                    stdout=told, stderr=told, start_new_session=True, cwd=self._files.name, env=os.environ | single,
                )  # fmt: skip
            except OSError as error:
                self._told.write_text(f"{self.python} cannot be started: {error.strerror}", encoding="utf-8")
                return None

    def answer(self, job: Mapping[str, Any]) -> dict[str, Any]:
        """Return what was measured, or `why` there is nothing; in both cases what the importer has `told`.

        Args:
            job: `joints` (name, body, kind) in the order of the coordinates, and `states`, each with `q` and `v`.
        """
        with self._files:
            if self._process is None:
                said = self._told.read_text(encoding="utf-8") if self._told.exists() else ""
                why = said or f"{self.name} reads no files of this format; valid: {', '.join(self.formats)}."
                return {"status": "failed" if said else "unsupported", "told": [], "why": why}
            why = self._waited(self._process, json.dumps(job).encode())
            found = _loaded(self._out)
            told = _lines(self._told)
        if found is None:
            found = {"status": "failed", "why": why or "It ended without an answer."}
        if found["status"] == "failed" and told:
            found["why"] = f"{found['why']} ({told[-1]})"
        return found | {"told": told}

    def _waited(self, process: subprocess.Popen[bytes], job: bytes) -> str:
        """Return why the process did not come to its end; empty where it did."""
        try:
            process.communicate(job, timeout=self.seconds)
        except subprocess.TimeoutExpired:
            return f"It did not come back within {self.seconds:g} s and was ended."
        except BrokenPipeError:
            pass
        finally:
            self._kill()
        number = -process.returncode
        if number <= 0:
            return ""
        name = signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
        return f"Its process was ended by {name}."

    def abandon(self) -> None:
        """End the process, whose answer is not wanted."""
        self._kill()
        self._files.cleanup()

    def _kill(self) -> None:
        """Kill the process and all that it has begun."""
        if self._process is not None:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
            with suppress(OSError):
                self._process.stdin.close() if self._process.stdin is not None else None
            self._process.wait()


def _loaded(path: Path) -> dict[str, Any] | None:
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found


def _lines(path: Path) -> list[str]:
    """Return what was said, each line once, without the colours of a terminal."""
    with path.open("rb") as file:
        text = file.read(TOLD).decode(errors="replace")
    plain = re.sub(r"\x1b\[[0-9;]*m", "", text)
    return list(dict.fromkeys(line.strip() for line in plain.splitlines() if line.strip()))


def names() -> tuple[str, ...]:
    """Names of all importers, installed or not."""
    return REGISTRY.names()


def known(wanted: Sequence[str]) -> tuple[str, ...]:
    """Return the importers wanted, each once; all of them where none is.

    Raises:
        UnknownName: for one that there is not.
    """
    for name in wanted:
        if name not in names():
            raise UnknownName("importer", name, names())
    return tuple(dict.fromkeys(wanted)) or names()
