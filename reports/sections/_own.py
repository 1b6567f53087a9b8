"""Our studies but those of logs: which of their tables a page shows, under which words, with which figures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from crossbody.reports.figures.section import Column, Kind, Plot, Section, Table, columns, records
from crossbody.reports.judging.told import NEXT
from crossbody.reports.runs.study import read_json
from crossbody.reports.sections import _words as words

if TYPE_CHECKING:
    import pandas as pd

ANALYSIS = "analysis-"  # how the tables of an analysis begin


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """As a module of a study, see the package: title, names of the cases it is about, folder -> sections."""

    TITLE: str
    sections: Callable[[Path], tuple[Section, ...]]
    CASES: tuple[str, ...] = ()


def _rows(out: Path, stem: str) -> pd.DataFrame:
    """A table of the folder, with engine and profile in one column `who` too."""
    import pandas as pd

    rows = pd.DataFrame(read_json(out / f"{stem}.json")["rows"])
    return rows.assign(who=rows["engine"] + ":" + rows["profile"]) if {"engine", "profile"} <= set(rows) else rows


def _has(out: Path, stem: str) -> bool:
    return (out / f"{stem}.json").is_file()


def _table(title: str, shown: Sequence[Column], rows: pd.DataFrame, stem: str, folded: bool = False) -> Table:
    return Table(title=title, columns=shown, rows=records(rows), file=f"{stem}.csv", folded=folded, once=True)


def _one(
    stem: str, heading: str, text: str, table: Callable[[Path], Table], plots: Callable[[Path], Iterable[Plot]]
) -> Callable[[Path], tuple[Section, ...]]:
    """One section of one table, where the folder has it."""

    def sections(out: Path) -> tuple[Section, ...]:
        if not _has(out, stem):
            return ()
        return (Section(name=stem, title=heading, text=text, plots=tuple(plots(out)), tables=(table(out),)),)

    return sections


def _plain(
    stem: str, title: str, heading: str, text: str, shown: Sequence[Column]
) -> Callable[[Path], tuple[Section, ...]]:
    """One section of one table as it stands."""
    return _one(stem, heading, text, lambda out: _table(title, shown, _rows(out, stem), stem), lambda _: ())


def _analysis(out: Path) -> tuple[Section, ...]:
    if not _has(out, f"{ANALYSIS}ranks"):
        return ()
    from crossbody.reports.analysis import figure as draw

    drawn = {"poles": draw.pole_figure, "locus": draw.locus_figure, "responses": draw.response_figure,
             "map": draw.map_figure}  # fmt: skip
    names = {*drawn, *(name for _, name, _ in words.ANALYSIS_TABLES)}
    found = {name: _rows(out, f"{ANALYSIS}{name}") for name in names if _has(out, f"{ANALYSIS}{name}")}
    more = {"locus": (found["limits"],)} if "limits" in found else {}
    plots = tuple(
        Plot(name=f"{ANALYSIS}{name}", figure=figure(found[name], *more.get(name, ())))
        for name, figure in drawn.items()
        if len(found.get(name, ()))
    )
    tables = tuple(
        _table(title, shown, found[name], f"{ANALYSIS}{name}")
        for title, name, shown in words.ANALYSIS_TABLES
        if len(found.get(name, ()))
    )
    title, says = STUDIES["analysis"].TITLE, ""
    if _has(out, f"{ANALYSIS}says"):
        (first,) = _rows(out, f"{ANALYSIS}says").to_dict(orient="records")
        title, says = f"{title} of {first['case']}", str(first["says"])
    return (Section(name="analysis", title=title, says=says, text=words.ANALYSIS_TEXT, plots=plots, tables=tables),)


def _bode(out: Path) -> Iterator[Plot]:
    from crossbody.reports.analysis.figure import bode_figure

    yield Plot(name="bode-soft-contact", figure=bode_figure(_rows(out, "bode")))


def _growths(out: Path) -> Table:
    from crossbody.reports.analysis.bode import growths

    return _table("Poles of the soft contact", words.GROWTHS, growths(_rows(out, "poles")), "poles")


def _bench(out: Path) -> tuple[Section, ...]:
    if not _has(out, "bench"):
        return ()
    from crossbody.reports.bench.figure import work_precision

    rows, orders = _rows(out, "bench"), _rows(out, "orders")
    tables = (_table("Observed order", words.ORDERS, orders, "orders"), _table("Timings", words.TIMINGS, rows, "bench"))
    plots = [
        Plot(name=f"work-precision-{i}", figure=work_precision(group))
        for i, (_, group) in enumerate(rows.groupby("case", sort=False))
    ]
    says = ""
    if _has(out, "headline") and len(lead := _rows(out, "headline")):
        from crossbody.reports.bench.headline import summary

        says = summary(lead)
    title = "Run time against error"
    return (Section(name="bench", title=title, says=says, text=words.BENCH_TEXT, plots=plots, tables=tables),)


def _conformance(out: Path) -> tuple[Section, ...]:
    if not _has(out, "conformance"):
        return ()
    from crossbody.reports.importers.conformance import misread

    rows = _rows(out, "conformance")
    engines = list(dict.fromkeys(rows["engine"]))
    versions = {name: max(own["version"]) for name, own in rows.groupby("engine")}
    wide = [
        {"feature": name} | dict(zip(own["engine"], own["verdict"], strict=True))
        for name, own in rows.groupby("feature", sort=False)
    ]
    across = columns(feature="Feature", **{name: (f"{name} {versions[name]}", Kind.VERDICT) for name in engines})
    off = rows[~rows["verdict"].isin(["ok", "-"])]
    tables = (
        _table("What is not ok", words.DETAILS, off, "conformance"),
        Table(title="Features", columns=across, rows=[{name: "" for name in engines} | row for row in wide]),
    )
    title = STUDIES["conformance"].TITLE
    says = NEXT.join(misread(records(rows)))
    return (Section(name="conformance", title=title, says=says, text=words.CONFORMANCE_TEXT, tables=tables),)


def _gap_map(out: Path) -> tuple[Section, ...]:
    if not _has(out, "gapmap"):
        return ()
    from crossbody.reports.maps.figure import gap_map
    from crossbody.reports.maps.gapmap import in_words, summary

    rows = _rows(out, "gapmap")
    lines = summary(rows)
    says = NEXT.join(in_words(lines))
    lines["who"] = lines["engine"] + ":" + lines["profile"]
    return (
        Section(
            name="gapmap", title="Gap map of Newton's cradle", says=says, text=words.GAPS_TEXT,
            plots=(Plot(name="gap-map", figure=gap_map(rows)),),
            tables=(_table("Gap map by engine", words.GAPS, lines, "gapmap"),),
        ),
    )  # fmt: skip


def _scenes(out: Path) -> Table:
    rows = _rows(out, "stability")
    rows = rows.assign(scene=rows["scene"].replace("", "default"))
    return _table("Stability map by scene", words.STABILITY, rows, "stability")


def _stability(out: Path) -> Iterator[Plot]:
    from crossbody.reports.maps.figure import stability

    yield Plot(name="stability-map", figure=stability(_rows(out, "stability")))


def _stress(out: Path) -> Iterator[Section]:
    if not _has(out, "stress_summary"):
        return
    from crossbody.reports.sweep.map import ERROR, in_words, unrun, varied

    table = _table("Runs by suite", words.SUITES, _rows(out, "stress_summary"), "stress")
    rows = _rows(out, "stress") if _has(out, "stress") else None
    says = "" if rows is None else NEXT.join([in_words(rows), *varied(rows), *unrun(rows)])
    text = f"{words.STRESS_TEXT} {ERROR}"
    yield Section(name="stress", title="Stress runs by suite", says=says, text=text, tables=(table,))
    if len(cells := _rows(out, "stress_map")):
        from crossbody.reports.maps.figure import stress_map

        plot = Plot(name="stress-map", figure=stress_map(cells))
        table = _table("Stability map of the engines", words.CELLS, cells, "stress_map", folded=True)
        yield Section(name="stress-map", title="Stability map", text=words.MAPPED_TEXT, plots=(plot,), tables=(table,))
    if len(small := _rows(out, "reproducers")):
        table = _table("Reproducers", words.FAILED, small, "reproducers")
        yield Section(name="reproducers", title="Smallest scenes that fail", text=words.SMALL_TEXT, tables=(table,))


STUDIES: Mapping[str, Study] = {
    "analysis": Study(TITLE="Equilibria and linear models", sections=_analysis),
    "bench": Study(TITLE="Run time", sections=_bench),
    "bode": Study(
        TITLE="Frequency responses", CASES=("soft_contact",),
        sections=_one("bode", "Frequency responses of the soft contact", words.BODE_TEXT, _growths, _bode),
    ),
    "conformance": Study(TITLE="Readers of robot files", sections=_conformance),
    "gapmap": Study(
        TITLE="Gap map", CASES=("newtons_cradle",),
        sections=_gap_map,
    ),
    "headline": Study(
        TITLE="Lead of the reference",
        sections=_plain(
            "headline", "Lead of the reference", "How much faster the reference is", words.HEADLINE_TEXT,
            words.HEADLINE,
        ),
    ),
    "skip": Study(
        TITLE="What is skipped",
        sections=_plain("skip", "What is skipped", "What is skipped", words.SKIP_TEXT, words.RATIOS),
    ),
    "stability": Study(
        TITLE="Stability map", CASES=("ball_maze",),
        sections=_one("stability", "Stability map of the ball maze", words.STABILITY_TEXT, _scenes, _stability),
    ),
    "stress": Study(TITLE="Stress", sections=lambda out: tuple(_stress(out))),
    "throughput": Study(
        TITLE="Throughput",
        sections=_plain("throughput", "Throughput", "Throughput", words.THROUGHPUT_TEXT, words.RATIOS),
    ),
}  # fmt: skip
