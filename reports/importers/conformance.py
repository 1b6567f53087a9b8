"""Every feature of the table through every importer: what each reads as the format says."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from crossbody.cases.files.conformance import Feature
from crossbody.engines.importers import SECONDS, answers
from crossbody.reports.importers.audit import Audit, of_scene, opened
from crossbody.reports.importers.compare import FAILED, NONE, OK, UNSEEN, UNSUPPORTED, WRONG, Row, rows
from crossbody.reports.importers.declared import excused
from crossbody.reports.importers.forms import Forms

PART = 16  # features that one process of an importer is asked at least
NAMED = 6  # features that are named of each engine
WORST = (FAILED, WRONG, UNSUPPORTED, UNSEEN, OK, NONE)


def written(feature: Feature, folder: Path) -> Path:
    """Return the file of a feature, written with what stands beside it."""
    folder.mkdir(exist_ok=True)
    path = folder / f"feature.{'urdf' if feature.format == 'urdf' else 'xml'}"
    for name, text in {path.name: feature.text, **feature.files}.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return path


def audit_of(feature: Feature, path: Path) -> Audit:
    """Return the audit of the file of a feature, by the scene that it means."""
    scene, shapes = feature.scene, [shape.name for shape in feature.scene.shapes]
    found = of_scene(path, scene, feature.keys, touching=shapes or None)
    if feature.heavier:
        for state in found.wanted["states"]:
            state["M"] = (np.array(state["M"]) + feature.heavier).tolist()
    return found


def judged(feature: Feature, engine: str, seconds: float = SECONDS) -> Row | str:
    """Return the one row that tells what an importer makes of a feature, or why it is not there."""
    return judged_all([feature], engine, seconds)[0]


def judged_all(features: Sequence[Feature], engine: str, seconds: float = SECONDS) -> list[Row | str]:
    """Return what `judged` does of each, by one process where none of them ends it."""
    found: dict[str, Row | str] = {}
    for kind in ("mjcf", "urdf"):
        own = [feature for feature in features if feature.format == kind]
        with tempfile.TemporaryDirectory(prefix="crossbody-feature-") as folder:
            paths = [written(feature, Path(folder) / str(k)) for k, feature in enumerate(own)]
            audits = [audit_of(feature, path) for path, feature in zip(paths, own, strict=True)]
            told = answers(engine, paths, kind == "urdf", [audit.job for audit in audits], seconds)
            for feature, audit, answer in zip(own, audits, told, strict=True):
                found[feature.name] = _told(feature, engine, audit, answer)
    return [found[feature.name] for feature in features]


def _told(feature: Feature, engine: str, audit: Audit, answer: dict[str, Any]) -> Row | str:
    if answer["status"] == "absent":
        return str(answer["why"])
    with Forms(audit.path, lambda form: opened(form, job=audit.job)) as forms:
        found = excused(rows(engine, answer, audit.wanted, audit.job["joints"]), answer, audit, forms)
    about = [row for row in found if row.quantity in ("reading", "coordinates", *feature.about)]
    about = [row for row in about if (row.quantity, row.verdict) != ("energy", UNSEEN)]  # it follows from the others
    worst = min(about, key=lambda row: WORST.index(row.verdict))
    return replace(worst, version=answer.get("version", ""), cause=feature.name)


def misread(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Say how many features all readers read as the format says, and which ones each reads otherwise, a line each.

    Args:
        rows: of each feature and engine, with its verdict.
    """
    found: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row["verdict"] in WORST[:2]:
            found.setdefault((row["engine"], row["verdict"]), []).append(row["feature"])
    every = list(dict.fromkeys(row["feature"] for row in rows))
    off = {row["feature"] for row in rows if row["verdict"] not in (OK, NONE)}
    told = [f"{len(every) - len(off)} of {len(every)} features are read by all engines as the format says."]
    for (engine, word), names in found.items():
        more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
        told.append(f"{engine} {word}: {', '.join(names[:NAMED])}{more}.")
    return told


def table(
    features: Sequence[Feature], engines: Sequence[str], seconds: float, jobs: int
) -> Iterator[tuple[Feature, str, Row | str]]:
    """Return what every importer makes of every feature, as it is there."""
    parts = [(engine, features[k : k + PART]) for k in range(0, len(features), PART) for engine in engines]
    with ThreadPoolExecutor(jobs) as pool:
        done = pool.map(lambda part: judged_all(part[1], part[0], seconds), parts)
        for (engine, own), found in zip(parts, done, strict=True):
            yield from ((feature, engine, row) for feature, row in zip(own, found, strict=True))
