"""The sources that decide what comes out of a run, as one digest."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from crossbody.cases.sources import digest

FOLDERS = ("../cases", "../engines", "../reference", "../hw", "judging", "measuring", "metrics", "sweep")


def code() -> str:
    """Digest of the sources that decide what comes out: of runs, and of how they are judged."""
    folders = (os.path.normpath(Path(__file__).parent / folder) for folder in FOLDERS)
    return hashlib.sha256("".join(map(digest, folders)).encode()).hexdigest()[:16]
