"""The pages of a folder of results: an index, a page a case, a page a study; no request to any network.

They are made from files alone (tables and motions), never with an engine, and can be made again at any time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from crossbody.cases import OutputError
from crossbody.reports import sections as studies
from crossbody.reports.pages.case_page import case_page, provenance
from crossbody.reports.pages.html import PLOTLY, Link, Page, assets, render
from crossbody.reports.pages.index_page import index_pages
from crossbody.reports.pages.results import Results, read, verdicts_of
from crossbody.reports.pages.section import Section
from crossbody.reports.runs import beside
from crossbody.reports.runs.output import MARKER, replace_text
from crossbody.reports.runs.study import read_json

INDEX = "index"
PAGE = f"{INDEX}.html"
MADE = '<meta name="generator" content="crossbody">'
"""Stands in every page: what carries it may be replaced."""


def check(against: Path | None, others: Sequence[Path]) -> None:
    """Say before anything is computed whether the folders to be shown beside can be read.

    Raises:
        OutputError: if they cannot.
    """
    if against is not None:
        verdicts_of(against)
    for other in others:
        beside.tables(other)


def write(out: Path, *, single_file: bool = False, against: Path | None = None, others: Sequence[Path] = ()) -> Path:
    """Make the pages of a folder that holds results.

    Args:
        out: written by a run, a bench or another study.
        single_file: whether one file holds all pages, style and scripts.
        against: folder of an earlier run; the index then says what has changed since.
        others: folders of studies (a bench, a gap map, ...) whose tables are taken into this one.

    Returns:
        The index page.

    Raises:
        OutputError: if a folder does not hold results, or cannot be written.
    """
    if not (out / MARKER).is_file():
        raise OutputError(f"{out} was not written by crossbody; name the folder of an earlier run.")
    beside.take(out, others)
    found = read(out, against)
    links = _links(found)
    footer = found.footer
    made: set[str] = set()
    if single_file:
        _put(out, {PAGE: render(list(_pages(found)), links, footer, single=True)})
        made.add(PAGE)
    else:
        for page in _pages(found):
            _put(out, {f"{page.name}.html": render([page], links, footer)})
            made.add(f"{page.name}.html")
        _put(out, assets(pages_drawn=True))
    _sweep(out, made, single_file)
    return out / PAGE


def write_page(out: Path, name: str, title: str, sections: Sequence[Section], lead: str = "") -> Path:
    """Make one page of given sections in a folder of ours; links lead to the index beside it.

    For a study whose page is to be made again by `crossbody report`, add a module to crossbody.reports.sections
    instead: `write` finds it.

    Raises:
        OutputError: if the folder is not ours, or cannot be written.
    """
    if not (out / MARKER).is_file():
        raise OutputError(f"{out} was not written by crossbody; name the folder of an earlier run.")
    page = Page(name=name, title=title, sections=sections, lead=lead)
    links = (Link(page=INDEX, title="Index"), Link(page=name, title=title))
    _put(out, {f"{name}.html": render([page], links, "")} | assets(pages_drawn=True))
    return out / f"{name}.html"


def _put(out: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        try:
            replace_text(out / name, text)
        except OSError as error:
            raise OutputError(f"The page {name} in {out} cannot be written: {error.strerror}.") from None


def _sweep(out: Path, made: set[str], single_file: bool) -> None:
    """Take away pages of an earlier time that belong to nothing any more."""
    for path in out.glob("*.html"):
        with path.open(encoding="utf-8", errors="replace") as file:
            ours = MADE in file.read(400)
        if ours and path.name not in made:
            path.unlink()
    if single_file:
        (out / PLOTLY).unlink(missing_ok=True)


def _studies(found: Results) -> Iterator[Page]:
    for name in studies.names():
        if shown := studies.shown(name, found.out):
            yield Page(name=name, title=studies.load(name).TITLE, sections=[*shown, *_origin(found, shown)])


def _origin(found: Results, shown: Sequence[Section]) -> list[Section]:
    """Provenance of a study, which may come from another folder than the verdicts."""
    file = next((table.file for section in shown for table in section.tables if table.file), "")
    told = read_json((found.out / file).with_suffix(".json"))["provenance"] if file else found.told
    return [] if not found.cases else [provenance(told)]


def _pages(found: Results) -> Iterator[Page]:
    """Every page, made one after another; a folder of one study and no case is one page."""
    studied = list(_studies(found))
    alone = studied if not found.cases else []
    for page in index_pages(found):
        if page.name == INDEX:
            page = replace(page, sections=[*(s for study in alone for s in study.sections), *page.sections])
        yield page
    if not alone:
        yield from studied
    for case in found.cases:
        yield case_page(found, case)


def _links(found: Results) -> list[Link]:
    links = [Link(page=INDEX, title="Index")]
    if found.cases:
        links += [Link(page=page.name, title=page.title) for page in _studies(found)]
    return links
