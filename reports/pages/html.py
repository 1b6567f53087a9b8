"""From sections to HTML: templates and their filters, names safe in a path, numbers, packed data.

A packed value is the length of a JSON text (4 bytes), that text, and the bytes of all arrays that
were taken out of it. Of an array consecutive rows are subtracted as whole numbers (their bit
patterns), and the first bytes of all differences come first, then the second ones: what changes
slowly becomes long runs of equal bytes. Nothing is lost.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import math
import re
import struct
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from jinja2.bccache import Bucket, BytecodeCache
from markupsafe import Markup, escape
from numpy.typing import NDArray

from crossbody.cases import OutputError
from crossbody.reference import code_store
from crossbody.reports.figures.section import Column, Figure, Kind, Section, Table, Written
from crossbody.reports.layout import bounded

LEVEL = 6
"""Of compression: more takes three times as long for a hundredth of the size."""
PLOTLY, SCRIPT, STYLE = "plotly.min.js", "crossbody.js", "crossbody.css"
PARTS = ("page.js", "plots.js", "solids.js", "player.js")  # the pages' own script, in this order
SIGNS = {
    "within": "✓", "outside": "✗", "expected-outside": "≈", "not judged": "·",
    "ledger only": "∑", "skipped": "-", "crashed": "!", (BEYOND := "beyond, not judged"): "▲",
}  # fmt: skip
"""A verdict is shown by sign and word besides its colour."""
KEYS = {
    "within": "its limits", "expected-outside": "as far as a known property of the engine explains",
    "outside": "a limit, or without the number", "crashed": "with an exception",
    BEYOND: "for a known cause of which no size is stored", "skipped": "not run",
}  # fmt: skip
"""What each word of a table means, to a reader who has not read of it."""
MOST = 2000  # rows of a table that a page shows; the file beside it has all
UNFOLDED = 500  # characters of a text in a table that are shown at once
THEME = (
    'try { const kept = localStorage.getItem("crossbody-theme"); '
    "if (kept) document.documentElement.dataset.theme = kept; } catch { /* a browser may refuse storage to a file */ }"
)
"""Runs before anything is drawn, so that a page does not flash."""


WRITTEN_OUT = 1e4  # from here on four digits would have an exponent, which they need from a million on
UNITLESS = re.compile(r"(<br>|\s)*\[1\]$")  # what a number without a unit would have for one


def packed_text(text: str) -> str:
    """A text as base64 of gzip."""
    return _folded(text.encode())


def breakable(text: str) -> Markup:
    """A name that a narrow column may break behind its colons and underscores."""
    return Markup(re.sub("([:_])", r"\1<wbr>", str(escape(text))))


def packed_value(value: Any) -> str:
    """A JSON value whose arrays are as plotly reads them (`dtype`, `bdata`, `shape`), as base64 of gzip."""
    arrays: list[bytes] = []
    text = json.dumps(_taken(value, arrays), separators=(",", ":")).encode()
    return _folded(struct.pack("<I", len(text)) + text + b"".join(arrays))


def _folded(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, LEVEL, mtime=0)).decode()


def _taken(value: Any, arrays: list[bytes]) -> Any:
    """The value with every array replaced by where its bytes stand behind the text, kind, count and shape of rows.

    Rows are as wide as the last axis, of which a plain array has none.
    """
    if isinstance(value, Mapping):
        if "bdata" not in value:
            return {key: _taken(each, arrays) for key, each in value.items()}
        numbers = np.frombuffer(base64.b64decode(value["bdata"]), dtype=value["dtype"])
        width = max(1, int(value["shape"].split(",")[-1])) if "shape" in value else 1
        place = sum(map(len, arrays))
        arrays.append(_split_bytes(numbers, width))
        return {"packed": [place, value["dtype"], len(numbers), width, "shape" in value]}
    return [_taken(each, arrays) for each in value] if isinstance(value, list | tuple) else value


def _split_bytes(numbers: NDArray[Any], width: int) -> bytes:
    """Differences of rows as whole numbers, byte by byte."""
    whole = numbers.view(f"<u{numbers.itemsize}")
    apart = whole.copy()
    apart[width:] -= whole[:-width]
    return np.ascontiguousarray(apart.view(np.uint8).reshape(-1, numbers.itemsize).T).tobytes()


class KeptTemplates(BytecodeCache):
    """Keeps each template under a digest of its name, its text and the versions that read it."""

    def load_bytecode(self, bucket: Bucket) -> None:
        """Read a template back, if it is there."""
        store = code_store.current()
        data = store.read(_name(bucket)) if store is not None else None
        if data is not None:
            bucket.bytecode_from_string(data)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep a template."""
        if (store := code_store.current()) is not None:
            store.write(_name(bucket), bucket.bytecode_to_string())


def _name(bucket: Bucket) -> str:
    what = "\0".join((bucket.key, bucket.checksum, jinja2.__version__, sys.version))
    return f"template-{hashlib.sha256(what.encode()).hexdigest()[:32]}"


TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """One entry of the navigation: the name of a page, and what to call it."""

    page: str
    title: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """One page.

    Attributes:
        name: of its file, without ".html".
        title: heading.
        sections: in order.
        lead: what is most important, below the heading.
        about: what the page is of and what it is held against, in a sentence; sources: where that is from, folded.
        opening: how many sections stand before the list of all.
        word: the verdict in few words, for the name of the window.
        engines: label and style of every engine that can be shown and hidden on it.
        beside: the pages before and after it, if it is one of a row.
    """

    name: str
    title: str
    sections: Sequence[Section]
    lead: str = ""
    about: str = ""
    sources: str = ""
    opening: int = 0
    word: str = ""
    engines: Sequence[Mapping[str, Any]] = ()
    beside: tuple[Link | None, Link | None] = (None, None)


@cache
def environment() -> Environment:
    """Templates that escape whatever is put in, and refuse what is not there."""
    made = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, bytecode_cache=KeptTemplates(),
        optimized=False,  # what is kept has no result of a filter in it
    )  # fmt: skip
    made.filters |= {
        "number": number,
        "breakable": breakable,
        "bounded": bounded,
        "slug": slug,
        "told": told,
        "same": same,
        "plot": plot,
        "text_packed": packed_text,
        "value_packed": packed_value,
    }
    made.globals |= {"Kind": Kind, "SIGNS": SIGNS, "KEYS": KEYS, "BEYOND": BEYOND, "MOST": MOST, "UNFOLDED": UNFOLDED}
    return made


def render(pages: Sequence[Page], links: Sequence[Link], footer: str, *, single: bool = False) -> str:
    """HTML of one page, or of all in one file, in which style and scripts stand and links stay inside."""

    def href(page: str, anchor: str = "") -> str:
        inside = f"#{page}--{anchor}" if anchor else f"#{page}"
        return inside if single else f"{page}.html{inside if anchor else ''}"

    inline = {"style": _text("page.css"), "script": _script(), "plotly": _packed_plotly()} if single else {}
    scripts = [THEME, *((_script(), _text(PLOTLY)) if single else ())]
    template = environment().get_template("page.html")
    return template.render(
        pages=pages, links=links, footer=footer, href=href,
        drawn=any(section.plots for page in pages for section in page.sections),
        inline={key: Markup(text) for key, text in inline.items()}, theme=Markup(THEME),
        policy=policy(scripts, single),
    )  # fmt: skip


def policy(scripts: Sequence[str], single: bool) -> str:
    """The page's Content-Security-Policy: it runs the scripts that stand here and asks nobody for anything.

    Scripts are named by their hashes; those of the files beside a page run too, unless it is single.
    """
    hashes = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts)
    allowed = " ".join([*(f"'sha256-{digest}'" for digest in hashes), *([] if single else ["'self'"])])
    styles = "'unsafe-inline'" if single else "'unsafe-inline' 'self'"
    return (
        f"default-src 'none'; script-src {allowed}; style-src {styles}; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )


def assets() -> dict[str, bytes]:
    """The files that all pages of a folder share, by name."""
    return {SCRIPT: _script().encode(), STYLE: _bytes("page.css"), PLOTLY: _bytes(PLOTLY)}


@cache
def _text(name: str) -> str:
    return _bytes(name).decode("utf-8")


def _bytes(name: str) -> bytes:
    try:
        return (TEMPLATES / name).read_bytes()
    except FileNotFoundError:
        raise OutputError(f"{TEMPLATES / name} is missing; installing crossbody (pip install) creates it.") from None


@cache
def _packed_plotly() -> str:
    return packed_text(_text(PLOTLY))


@cache
def _script() -> str:
    return "\n".join(_text(name) for name in PARTS)


def plot(figure: Figure | Written) -> dict[str, Any]:
    """A figure as plain values, with its title and height taken out of it; the page gives it its colours."""
    made: dict[str, Any] = figure if isinstance(figure, dict) else json.loads(figure.to_json(engine="json"))
    layout = {key: value for key, value in made["layout"].items() if key not in ("title", "template")}
    for axis in (value for key, value in layout.items() if key[1:5] == "axis" and "title" in value):
        axis["title"]["text"] = UNITLESS.sub("", axis["title"]["text"])
    layout["margin"] = {"l": 84, "r": 14, "t": 34, "b": 50}
    value = {"data": made["data"], "layout": layout}
    title, _, more = made["layout"]["title"]["text"].partition(". ")
    return {"title": title, "more": more, "height": layout["height"], "value": value}


def slug(text: str) -> str:
    """A text as a class or an id."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", text)


def told(table: Table) -> list[Column]:
    """Columns in which some row has a value, and not all the same text; all where there are no rows."""
    known = [row.get(column.key) for column in table.columns for row in table.rows]
    empty = [all(v is None or v == "" or v != v for v in known[i * len(table.rows) : (i + 1) * len(table.rows)])
             for i in range(len(table.columns))]  # fmt: skip
    left = same(table)
    return [
        column for column, nothing in zip(table.columns, empty, strict=True)
        if column.title not in left and not (nothing and table.rows)
    ]  # fmt: skip


def same(table: Table) -> dict[str, str]:
    """What is in every row of several: titles of columns of text, which the page says once instead, and that text."""
    found = {
        column.title: {str(row.get(column.key) or "") for row in table.rows}
        for column in table.columns if column.kind == Kind.TEXT
    }  # fmt: skip
    several = table.once and len(table.rows) > 1
    return {title: min(texts) for title, texts in found.items() if several and len(texts) == 1 and any(texts)}


def number(value: Any) -> str:
    """A number for a table: a count in full, any other with four digits, a word where there is none."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "none"
    if isinstance(value, float) and WRITTEN_OUT <= abs(value) < 100.0 * WRITTEN_OUT:
        return f"{float(f'{value:.4g}'):.0f}"
    return f"{value + 0.0:.4g}" if isinstance(value, float) else str(value)
