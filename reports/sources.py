"""The sources that decide what comes out of a run, as one digest."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from pathlib import Path

from crossbody.cases.sources import digest

FOLDERS = ("../cases", "../engines", "../reference", "../hw", "judging", "measuring", "metrics", "sweep")
SHOWN = (*FOLDERS[:4], ".")
"""Those that also decide how it is shown."""


def code(folders: Sequence[str] = FOLDERS) -> str:
    """Digest of the sources that decide what comes out: of runs, and of how they are judged."""
    named = (os.path.normpath(Path(__file__).parent / folder) for folder in folders)
    return hashlib.sha256("".join(map(digest, named)).encode()).hexdigest()[:16]
