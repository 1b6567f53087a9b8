"""The pages of a folder of results: an index, a page a case, a page a study; no request to any network.

They are made from files alone (tables and motions), never with an engine, and can be made again at any time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from crossbody.cases import OutputError
from crossbody.reports import sections as studies
from crossbody.reports.figures.section import Section
from crossbody.reports.judging.told import NEXT, WRONG
from crossbody.reports.pages.case_page import case_page, provenance
from crossbody.reports.pages.html import Link, Page, assets, render
from crossbody.reports.pages.index_page import index_pages
from crossbody.reports.pages.results import Results, read, verdicts_of
from crossbody.reports.runs import beside, manifest, output
from crossbody.reports.runs.manifest import INDEX, PAGE
from crossbody.reports.runs.origin import BROKEN, blamed
from crossbody.reports.runs.study import read_json

FULL = 2.25  # cases whose plots have their usual room in a single file; those of more share it


def write(out: Path, *, single_file: bool = False, against: Path | None = None, others: Sequence[Path] = ()) -> Path:
    """Make the pages of a folder that holds results.

    Args:
        out: written by a run, a bench or another study; or the folder of a study that is being
            written, which then has the pages of all studies of its output folder.
        single_file: whether one file holds all pages, style and scripts.
        against: folder of an earlier run; the index then says what has changed since.
        others: folders of studies (a bench, a gap map, ...) whose tables are taken into this one.

    Returns:
        The index page.
    """
    if output.is_staged(out):
        _make(out, single_file, against, others)
        return out / PAGE
    _require(out, against, others)
    with output.folder(out, "report", adds=True) as made:
        _make(made, single_file, against, others)
    return out / PAGE


def _require(out: Path, against: Path | None, others: Sequence[Path]) -> None:
    """Say of all folders that are asked for what is wrong with them, not of the first one alone."""
    asks: list[Callable[[], object]] = [lambda: output.require_ours(out, "run")]
    asks += [lambda one=one: beside.tables(one) for one in others if one.resolve() != out.resolve()]  # type: ignore[misc]
    asks += [] if against is None else [lambda: verdicts_of(against)]
    wrong: dict[str, None] = {}
    for ask in asks:
        try:
            ask()
        except OutputError as error:
            wrong[str(error)] = None
    if wrong:
        raise OutputError(" ".join(wrong))


def pages_of(out: Path) -> set[str]:
    """Names of the pages of a folder that crossbody wrote."""
    return {name for name in manifest.read(out).files if name.endswith(".html")}


def _make(made: Path, single_file: bool, against: Path | None, others: Sequence[Path]) -> None:
    """Put the pages beside the tables of a study that is being written."""
    out = output.gather(made)
    beside.take(made, [other for other in others if other.resolve() != out.resolve()])
    try:
        with blamed(made, against=against):
            found = read(made, against)
        for name, text in _rendered(found, single_file, against):
            _put(made, name, text.encode(), output.put)
    except OutputError as error:  # the hidden folder is nobody's business
        raise OutputError(str(error).replace(str(made), str(out))) from error
    for name, data in {} if single_file else assets().items():
        _put(made, name, data, output.put_shared)


def _rendered(found: Results, single_file: bool, against: Path | None) -> Iterator[tuple[str, str]]:
    """Name and text of every page, made one after another."""
    try:
        with blamed(found.out, against=against):
            links = _links(found)
            if single_file:
                pages = list(_pages(found, FULL / max(FULL, len(found.cases))))
                yield PAGE, render(pages, links, found.footer, single=True)
                return
            for page in _pages(found):
                yield f"{page.name}.html", render([page], links, found.footer)
    except OutputError:
        raise
    except BROKEN as error:
        raise OutputError(_unreadable(found, error)) from error


def _unreadable(found: Results, error: BaseException) -> str:
    """Which table has a field that no page can show, as far as that is known."""
    files = ", ".join(name for name in output.tables(found.out))
    what = " ".join(f"{type(error).__name__}: {error}".split())
    return f"{found.out} cannot be shown: a field of {files} or of a motion is not as expected ({what})."


def _put(out: Path, name: str, data: bytes, write: Callable[[Path, str, bytes], None]) -> None:
    try:
        write(out, name, data)
    except OSError as error:
        raise OutputError(f"The page {name} in {out} cannot be written: {error.strerror}.") from None


def _studies(found: Results) -> Iterator[Page]:
    for name in studies.names(found.out):
        if shown := studies.shown(name, found.out):
            yield Page(name=name, title=studies.load(name).TITLE, sections=[*shown, *_origin(found, shown)])


def _origin(found: Results, shown: Sequence[Section]) -> list[Section]:
    """Provenance of a study, which may come from another folder than the verdicts."""
    file = next((table.file for section in shown for table in section.tables if table.file), "")
    told = read_json((found.out / file).with_suffix(".json"))["provenance"] if file else found.told
    return [] if _leads(found) else [provenance(told)]


def _pages(found: Results, share: float = 1.0) -> Iterator[Page]:
    """Every page, made one after another; a folder without cases is led by its study."""
    studied = list(_studies(found))
    alone = studied if _leads(found) else []
    first = [section for study in alone for section in study.sections]
    led = [section.says for section in first if section.says]
    for page in index_pages(found):
        if page.name == INDEX:
            title = " · ".join(map(_called, alone)) if alone and not found.cases else page.title
            own = [replace(one, title=one.title.partition(" of ")[0]) if one.title == title else one for one in first]
            page = replace(page, title=title, sections=[*own, *page.sections])
            if led:
                off = [page.lead] if any(row["verdict"] in WRONG for row in found.verdicts) else []
                page = replace(
                    page, lead=NEXT.join([*off, *led]), sections=[replace(s, says="") for s in page.sections]
                )
        yield page
    if not alone:
        yield from studied
    for case in found.cases:
        page = case_page(found, case, share)
        yield replace(page, lead=NEXT.join(led)) if led else page


def _called(study: Page) -> str:
    """The title of a study, with the case where its first section names it."""
    return next((one.title for one in study.sections if one.title.startswith(study.title)), study.title)


def _leads(found: Results) -> bool:
    """Whether the index begins with the studies: no case was run, or a log was replayed."""
    return not found.cases or "log" in found.told


def _links(found: Results) -> list[Link]:
    links = [Link(page=INDEX, title="Index")]
    if not _leads(found):
        links += [Link(page=page.name, title=page.title) for page in _studies(found)]
    return links
