"""Every feature of the table through every importer: what each reads as the format says."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

from crossbody.cases.files.conformance import Feature
from crossbody.engines.importers import SECONDS, Reading
from crossbody.reports.importers.audit import of_scene
from crossbody.reports.importers.compare import FAILED, NONE, OK, UNSUPPORTED, WRONG, Row, rows, said_of

WORST = (FAILED, WRONG, UNSUPPORTED, OK, NONE)


def written(feature: Feature, folder: Path) -> Path:
    """Return the file of a feature, written with what stands beside it."""
    path = folder / f"feature.{'urdf' if feature.format == 'urdf' else 'xml'}"
    for name, text in {path.name: feature.text, **feature.files}.items():
        (folder / name).write_text(text, encoding="utf-8")
    return path


def judged(feature: Feature, engine: str, seconds: float = SECONDS) -> Row | str:
    """Return the one row that tells what an importer makes of a feature, or why it is not there."""
    with tempfile.TemporaryDirectory(prefix="crossbody-feature-") as folder:
        path = written(feature, Path(folder))
        reading = Reading(engine, path, feature.format == "urdf", seconds)
        audit = of_scene(path, feature.scene)
        answer = reading.answer(audit.job)
    if answer["status"] == "absent":
        return str(answer["why"])
    found = rows(engine, answer, audit.wanted, audit.job["joints"])
    worst = min((row for row in found if row.quantity in ("reading", *feature.about)), key=_badness)
    said = said_of(words(feature), answer["told"]) if worst.verdict == WRONG else ""
    told: dict[str, Any] = {"verdict": UNSUPPORTED, "why": said} if said else {}
    return replace(worst, version=answer.get("version", ""), cause=feature.name, **told)


def _badness(row: Row) -> int:
    return WORST.index(row.verdict)


def words(feature: Feature) -> str:
    """Return a pattern of the attributes and tags that are this feature, as importers name them."""
    named = [re.findall(r"@(\w+)", path) or re.findall(r"(\w+)$", path) for path in feature.finds]
    return "|".join(rf"\b{word}\b" for group in named for word in group if word != "name")


def table(
    features: Sequence[Feature], engines: Sequence[str], seconds: float, jobs: int
) -> Iterator[tuple[Feature, str, Row | str]]:
    """Return what every importer makes of every feature, as it is there; one that is not there is asked once."""
    asked = [(feature, engine) for engine in engines for feature in features]
    absent: dict[str, str] = {}

    def one(feature: Feature, engine: str) -> tuple[Feature, str, Row | str]:
        found = absent[engine] if engine in absent else judged(feature, engine, seconds)
        if isinstance(found, str):
            absent[engine] = found
        return feature, engine, found

    with ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(lambda pair: one(*pair), asked)
