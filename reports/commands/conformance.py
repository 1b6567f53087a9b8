"""What `crossbody conformance` does: all features through all importers, as a page and tables."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import pandas as pd

from crossbody.cases import EngineUnavailable, UnknownName
from crossbody.cases.files.conformance import FEATURES
from crossbody.engines import importers
from crossbody.reports import layout, voice
from crossbody.reports.commands.shared import publish, where
from crossbody.reports.figures.section import records
from crossbody.reports.importers.compare import FAILED, OK, UNSEEN, UNSUPPORTED, WRONG
from crossbody.reports.importers.conformance import misread, table
from crossbody.reports.runs import output
from crossbody.reports.runs.provenance import provenance

STUDY = "conformance"


def conformance(engines: Sequence[str], part: str, seconds: float, out: Path, command: str) -> int:
    """Run the features whose names have that part, on some importers or all.

    Return 0: what engines do is no fault of the run.
    """
    wanted = importers.known(engines)
    if not (features := [feature for feature in FEATURES if part in feature.name]):
        raise UnknownName("feature", part, tuple(feature.name for feature in FEATURES))
    output.check(out, STUDY)
    rows, absent = [], dict[str, str]()
    with voice.progress(len(features) * len(wanted)) as tell:
        for feature, engine, row in table(features, wanted, seconds, os.cpu_count() or 1):
            tell(f"{engine}: {feature.name}")
            if isinstance(row, str):
                absent[engine] = row
            else:
                told = {"feature": feature.name, "format": feature.format, "rule": feature.rule}
                rows.append(told | asdict(row) | {"rewrite": feature.rewrite, "text": feature.text})
    if not (rows := [row for row in rows if row["engine"] not in absent]):
        raise EngineUnavailable(f"None of these is installed: {', '.join(wanted)}.")
    found = pd.DataFrame(rows)
    publish(out, STUDY, {STUDY: found}, provenance(command))
    if not voice.told_as_json({STUDY: found}):
        _show(found, absent, out)
    return 0


def _show(rows: pd.DataFrame, absent: dict[str, str], out: Path) -> None:
    if not voice.quiet():
        print("\n".join(map(layout.told, misread(records(rows)))) + "\n")
        for engine, own in rows.groupby("engine", sort=False):
            counts, version = Counter(own["verdict"]), max(own["version"])
            told = ", ".join(
                f"{counts[word]} {word}" for word in (OK, WRONG, UNSUPPORTED, UNSEEN, FAILED) if counts[word]
            )
            print(layout.told(f"{engine} {version}: {told}"))
        if absent:
            print(layout.told(importers.missing(sorted(absent))))
    where(out)
