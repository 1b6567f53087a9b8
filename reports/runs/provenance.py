"""What a result depends on besides its numbers."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from crossbody.cases import installed

PACKAGES = (
    "crossbody",
    "numpy",
    "scipy",
    "numba",
    "pandas",
    "scikit-sundae",
    "mujoco",
    "pin",
    "exudyn",
    "drake",
    "dartpy",
    "pymunk",
)


def provenance(command: str, **more: Any) -> dict[str, Any]:
    """Versions, machine, commit, command and whatever else the caller used (seed, tolerances)."""
    return {
        "command": command,
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "git": _commit(),
        "python": sys.version.split()[0],
        "versions": _versions(),
        "machine": _machine(),
        "cpu": _cpu(),
        "cpus": os.cpu_count(),
        "threads": {k: v for k, v in os.environ.items() if k.endswith("_NUM_THREADS")},
        "plugins": installed.digests(),
        **more,
    }


def _versions() -> Mapping[str, str]:
    found = {}
    for name in PACKAGES:
        try:
            found[name] = installed.version(name)
        except ModuleNotFoundError:
            found[name] = "not installed"
    return found


def _commit() -> str:
    """Commit of the working copy this code stands in, marked if it has changes; empty outside one."""
    here = Path(__file__).resolve().parent

    def git(*arguments: str) -> str:
        return subprocess.run(
            ["git", "-C", str(here), *arguments], capture_output=True, text=True, check=True, timeout=10
        ).stdout.strip()

    try:
        changed = git("status", "--porcelain", "--untracked-files=no")
        return git("rev-parse", "HEAD") + (" with changes" if changed else "")
    except (OSError, subprocess.SubprocessError):
        return ""


def _machine() -> str:
    """System, release, processor and C library; `platform.platform` asks another process for the processor."""
    return "-".join(filter(None, (platform.system(), platform.release(), platform.machine(), *platform.libc_ver())))


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
