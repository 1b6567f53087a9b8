"""The process of an importer: it reads files one behind the other, and what it has made of each is measured.

    python -P process.py IMPORTER.py FILE mjcf|urdf ANSWERS BYTES NICE < jobs

A job is a line of JSON; all but the first name their file, and each has its line in ANSWERS.
"""

from __future__ import annotations

import ctypes
import json
import os
import re
import resource
import signal
import sys
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

PARENT_DEATH = 1  # PR_SET_PDEATHSIG
LARGEST_FILE = 1 << 28


def limit(size: int) -> None:
    """End with the parent, and take no more memory than this, no file larger than another."""
    resource.setrlimit(resource.RLIMIT_DATA, (size, size))
    resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_FILE, LARGEST_FILE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        ctypes.CDLL(None).prctl(PARENT_DEATH, signal.SIGKILL)
    except (OSError, AttributeError):
        return


def installed(module: Any) -> str:
    """Return the version of the engine's package; empty where that is not known."""
    try:
        return version(module.PACKAGE)
    except PackageNotFoundError:
        return ""


def tried(module: Any) -> str:
    """Return a sentence on a version of the engine not tried with an importer; empty if tried."""
    found = installed(module)
    low, high = getattr(module, "TRIED", ("0", "999999"))
    number = [int(word) for word in re.findall(r"\d+", found)[:2]]
    if not found or [int(word) for word in low.split(".")] <= number <= [int(word) for word in high.split(".")]:
        return ""
    return f"{module.PACKAGE} has version {found}; its importer was tested with {low} to {high}."


def answered(module: Any, file: str, urdf: bool, job: Any, size: int, measured: Any) -> dict[str, Any]:
    """Return what was measured of one file, or why there is nothing, within a size in bytes.

    The job, which may come later than the file, is given by a function; another measures the robot
    by it.
    """
    try:
        robot = module.open_robot(file, urdf)
        asked = job()
        told: dict[str, Any] = measured(robot, asked)
        return told
    except ModuleNotFoundError as error:
        lacking = (error.name or "").partition(".")[0]
        own = lacking == module.MODULE
        why = f"It needs the package {module.PACKAGE if own else lacking}, which is not installed."
        return {"status": "absent" if own else "failed", "why": why}
    except MemoryError:
        return {"status": "failed", "why": f"It needs more than {size >> 20} MiB of memory."}
    except Exception as error:
        return {"status": "failed", "why": " ".join(f"{type(error).__name__}: {error}".split())}


def _loaded(name: str, path: Path) -> Any:
    """Return a module by its file, and let it be known by its name."""
    spec = spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is not a Python file")
    sys.modules[name] = module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def main(importer: str, file: str, kind: str, answers: str, size: str, nice: str) -> None:
    """Read, measure, and leave a line for every job in a file; what engines print is the messages."""
    os.nice(int(nice))
    limit(int(size))
    module, here = _loaded("importer", Path(importer)), Path(__file__).parent
    _loaded(here.name, here / "__init__.py")
    measured = import_module(f"{here.name}.robot").measured
    strange, number, said, line = tried(module), installed(module), 0, list[str]()

    def job() -> Any:
        line[:] = line or [sys.stdin.readline()]
        return json.loads(line[0] or "{}")

    while file:
        told = {"version": number} | answered(module, file, kind == "urdf", job, int(size), measured)
        told |= {"strange": strange, "from": said}
        job()
        sys.stdout.flush()
        sys.stderr.flush()
        said = os.lseek(1, 0, os.SEEK_CUR)
        with open(answers, "a", encoding="utf-8") as out:
            out.write(json.dumps(told | {"to": said}) + "\n")
        line[:] = [sys.stdin.readline()]
        file = job().get("file", "")
    os._exit(0)  # an engine may crash where it is torn down


if __name__ == "__main__":
    main(*sys.argv[1:])
