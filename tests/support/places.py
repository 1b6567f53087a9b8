"""Where things are that tests ask for by their path."""

from __future__ import annotations

import os
from pathlib import Path

TESTS = Path(__file__).parent.parent
ROOT = TESTS.parent
FOLDERS = ("cases", "engines", "hw", "reference", "reports")
DATA = Path(os.environ.get("CROSSBODY_DATA", ROOT.parent / "shared" / "data"))
ROBOTS = DATA / "robots"
STUCK, OWN = (TESTS / "support" / name for name in ("stuck_engine.py", "own_case.py"))


def helped(**more: str) -> dict[str, str]:
    """Return the environment of a process that imports a test with its helpers."""
    folders = [str(TESTS / "support"), str(TESTS / "oracles"), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, folders)), **more}
