"""Whether scripts and templates of pages are those whose pictures were judged in a browser: a run has none to ask.

What a script draws is seen by a browser alone. So a digest of each stands beside them since the tests with a browser
passed (`make scripts`), as numbers of runs are stored that nobody can compute by hand (`make bands`).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from crossbody.reports.judging.planted import Range

TEMPLATES = Path(__file__).parent / "templates"
JUDGED = TEMPLATES / "judged.json"
OURS = (".js", ".html", ".css")
Found = tuple[str, float, Range, str]


@cache
def wrong() -> tuple[Found, ...]:
    """Return every file that is another one than was judged, or that nobody judged, or that is gone."""
    judged, own = stored(), digests()
    return tuple(
        ("page scripts", np.nan, (np.nan, np.nan), f"{name}, not as a browser was shown it (make scripts),")
        for name in sorted({*judged, *own}) if judged.get(name) != own.get(name)
    )  # fmt: skip


def stored() -> Mapping[str, str]:
    """Return the digests of what was judged; nothing where none are stored."""
    found: dict[str, str] = json.loads(JUDGED.read_text(encoding="utf-8")) if JUDGED.is_file() else {}
    return found


def digests() -> dict[str, str]:
    """Return the digest of every file of ours, whatever ends its lines."""
    return {
        path.name: hashlib.sha256(path.read_bytes().replace(b"\r\n", b"\n")).hexdigest()[:16]
        for path in sorted(TEMPLATES.iterdir()) if path.suffix in OURS and not path.name.endswith(".min.js")
    }  # fmt: skip


if __name__ == "__main__":
    JUDGED.write_text(json.dumps(digests(), indent=1) + "\n", encoding="utf-8")
