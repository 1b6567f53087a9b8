"""The index: which engine is to be trusted for which case, and at what cost; and what has changed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from crossbody.reports.judging.verdict import Word
from crossbody.reports.pages.case_page import provenance
from crossbody.reports.pages.changes import changes
from crossbody.reports.pages.html import Page
from crossbody.reports.pages.results import CaseFiles, Results
from crossbody.reports.pages.section import Section

SHOWN = 100
"""Cases on one page of the index."""
JUDGED = (Word.OUTSIDE.value, Word.EXPECTED.value, Word.WITHIN.value)


def index_pages(found: Results) -> list[Page]:
    """The index, in as many pages as its cases need."""
    cut = [found.cases[i : i + SHOWN] for i in range(0, len(found.cases), SHOWN)] or [()]
    names = ["index", *(f"index-{i}" for i in range(2, len(cut) + 1))]
    return [
        Page(
            name=name, title="crossbody" if i == 0 else f"crossbody, cases {i * SHOWN + 1} to {i * SHOWN + len(cases)}",
            lead="Which engine to trust for which case, and at what cost." if found.cases else "",
            sections=_sections(found, cases, names, i),
        ) for i, (name, cases) in enumerate(zip(names, cut, strict=True))
    ]  # fmt: skip


def _sections(found: Results, cases: Sequence[CaseFiles], names: Sequence[str], i: int) -> list[Section]:
    shown = [_matrix(found, cases, names, i)] if cases else []
    if i == 0 and found.base is not None:
        shown.append(changes(found.verdicts, found.base, found.base_name))
    return [*shown, provenance(found)] if i == 0 else shown


def _matrix(found: Results, cases: Sequence[CaseFiles], names: Sequence[str], i: int) -> Section:
    engines = list(dict.fromkeys(found.verdicts["who"]))
    lines = [{"case": case, "cells": _line(found, case.label, engines)} for case in cases]
    return Section(
        name="matrix", title="Verdicts", template="matrix.html",
        context={
            "heads": _heads(engines), "lines": lines, "tiles": _tiles(found, engines), "pages": names, "here": i,
            "cases": len(found.cases), "warning": _warning(found),
        },
    )  # fmt: skip


def _heads(engines: Sequence[str]) -> list[dict[str, Any]]:
    """Engines over their profiles."""
    groups: dict[str, list[str]] = {}
    for who in engines:
        engine, _, profile = who.partition(":")
        groups.setdefault(engine, []).append(profile)
    return [{"engine": engine, "profiles": profiles} for engine, profiles in groups.items()]


def _line(found: Results, label: str, engines: Sequence[str]) -> list[dict[str, Any]]:
    """One case: a cell for every engine."""
    counts: dict[str, Counter[str]] = {}
    why: dict[str, str] = {}
    for row in found.rows.get(label, ()):
        counts.setdefault(row["who"], Counter())[row["verdict"]] += 1
        why[row["who"]] = row["why"]
    walls = found.walls
    return [_cell(label, who, counts.get(who), why.get(who, ""), walls.get((label, who))) for who in engines]


def _cell(label: str, who: str, counts: Counter[str] | None, why: str, wall: float | None) -> dict[str, Any]:
    """Worst word of one engine on one case, how many of how many, and its run time."""
    if counts is None:
        return {"word": "", "who": who, "text": "", "title": f"{who} was not asked for {label}."}
    judged = {word: counts[word] for word in JUDGED}
    word = next((word for word, n in judged.items() if n), "skipped" if counts["skipped"] else "not judged")
    said = ", ".join(f"{n} {word}" for word, n in judged.items() if n)
    title = f"{who} on {label}: {said or why or word}"
    total = sum(judged.values())
    text = (str(total) if word == "within" else f"{judged[word]} of {total}") if total else ""
    return {"word": word, "who": who, "text": text, "title": title, "wall": _time(wall)}


def _time(wall: float | None) -> str:
    """A run time in three digits and its unit."""
    if not wall:
        return ""
    return f"{wall:.3g} s" if wall >= 1.0 else f"{1e3 * wall:.3g} ms"


def _tiles(found: Results, engines: Sequence[str]) -> list[dict[str, Any]]:
    counts = found.verdicts["verdict"].value_counts()
    words = {word: int(counts.get(word, 0)) for word in ("within", "expected-outside", "outside", "skipped")}
    different = sum(not row["same"] for rows in found.audits.values() for row in rows)
    return [
        {"value": len(found.cases), "title": "cases", "word": ""},
        {"value": len(engines), "title": "engines with profile", "word": ""},
        *({"value": n, "title": word, "word": word} for word, n in words.items()),
        {"value": different, "title": "differ in the parity audit", "word": "outside" if different else ""},
    ]


def _warning(found: Results) -> str:
    """Says if another version made the results."""
    by = str(found.told.get("versions", {}).get("crossbody", "an unknown version"))
    try:
        mine = version("crossbody")
    except PackageNotFoundError:
        return ""
    return "" if by == mine else f"These results were made by crossbody {by}; the pages by {mine}."
