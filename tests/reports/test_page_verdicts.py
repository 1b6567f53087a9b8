"""What a case's page begins with, that every cell leads to its row, and that words are counted and explained once."""

from __future__ import annotations

import json
import re
from collections import Counter
from dataclasses import replace
from html import unescape
from pathlib import Path
from types import SimpleNamespace

import chromium
import numpy as np
import pytest
from study_pages import page_of

from crossbody.cases import load
from crossbody.reports import metrics
from crossbody.reports.figures.section import Section, Table, columns
from crossbody.reports.judging.told import NEXT, beyond, runs_of, sentence
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.verdict import Row, Word
from crossbody.reports.pages import case_page, grid
from crossbody.reports.pages.html import BEYOND, Page, render

needs_chromium = pytest.mark.skipif(
    chromium.binary() is None, reason="Chromium is not installed (Debian: apt-get install chromium)."
)
OFF = ("crashed", "outside", "expected-outside")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a ball, with one engine that is right and one that is off."""
    case = load("bouncing_ball", "linear")
    run = truth_of(case).trajectory
    off = replace(run, q=run.q * (1 + 1e-3 * np.sin(run.t))[:, None])
    given = [
        SimpleNamespace(engine="fake", profile=name, run=lambda one=one: one)
        for name, one in (("right", run), ("off", off))
    ]
    return page_of(case, tmp_path_factory.mktemp("verdicts") / "out", *given)


def test_a_page_begins_with_the_sentence_of_its_own_rows(page: Path) -> None:
    rows = json.loads((page.parent / "verdicts.json").read_text())["rows"]
    said = sentence(runs_of(rows)).replace(" on bouncing_ball:linear", "")
    assert "fake:off" in said
    text = unescape(page.read_text())
    lead = text[text.index('<p class="lead first">') :].partition("</ul>")[0]
    lines = re.findall(r"<(?:p class=.lead first.|li)>(.*?)</(?:p|li)>", lead)
    assert lines == said.split(NEXT)
    assert len(lines) > 1
    assert "bouncing_ball:linear" not in lead, "which case it is stands above"


def test_a_ratio_stands_above_how_far_its_signal_is_off_in_its_own_unit(page: Path) -> None:
    rows = json.loads((page.parent / "verdicts.json").read_text())["rows"]
    (row,) = [row for row in rows if row["metric"] == "position" and row["profile"] == "off"]
    size = row["where"].partition(" by ")[2].partition(" at ")[0]
    assert size.endswith(" m")
    assert f"<small>{size}</small>" in page.read_text()


def drawn(seed: int) -> list[Row]:
    """Rows of three engines at random, with every word, some beyond a limit that nothing is judged by."""
    rng, words = np.random.default_rng(seed), [word.value for word in Word]
    return [
        {"who": f"e{rng.integers(3)}:p", "metric": f"m{k}", "verdict": str(rng.choice(words)), "expected": None,
         "value": float(rng.uniform(0.0, 2.0)), "limit": float(rng.choice([0.0, 1.0])), "why": f"why {rng.integers(2)}"}
        for k in range(60)
    ]  # fmt: skip


@pytest.mark.parametrize("seed", range(20))
def test_every_number_that_is_off_is_counted_once_and_explained_once(seed: int) -> None:
    rows = drawn(seed)
    assert dict(case_page._counted(rows)) == Counter(BEYOND if beyond(row) else row["verdict"] for row in rows)
    off = Counter(
        (row["who"], BEYOND if beyond(row) else row["verdict"], row["why"])
        for row in rows if row["verdict"] in OFF or beyond(row)
    )  # fmt: skip
    causes = case_page._causes(rows)
    assert len(causes) == len(off)
    for cause in causes:
        *names, last = cause["names"]
        more = int(last.split()[0]) - 1 if last.endswith(" more") else 0
        assert len(names) + 1 + more == off[cause["who"], cause["word"], cause["why"]]
        assert len(names) < 7


@pytest.mark.browser
@needs_chromium
def test_every_cell_leads_to_its_row_whatever_was_shown_before(page: Path, browser: chromium.Browser) -> None:
    browser.open(page)
    browser.wait("document.readyState === 'complete' && document.querySelectorAll('.verdicts tbody tr[hidden]').length")
    empty = browser.js("""(async () => {
        const found = [];
        const set = (name, value) => {
            const field = document.querySelector(`[data-filter="${name}"]`);
            field.value = value;
            field.dispatchEvent(new Event("change"));
        };
        for (const kind of ["outside", "judged", "all"]) {
            for (const cell of document.querySelectorAll("section[id$=glance] td a")) {
                set("words", "nothing has this");
                set("verdict", kind);
                cell.click();
                await new Promise((done) => setTimeout(done, 5));
                const [engine, metric] = decodeURIComponent(cell.hash).split("~").slice(1);
                const rows = [...document.querySelectorAll(".verdicts tbody tr:not([hidden])")];
                const right = rows.length && rows.every((row) => row.dataset.engine === engine)
                    && (!metric || rows.some((row) => row.cells[2].textContent === metric));
                if (!right) found.push(`${kind}: ${cell.hash}`);
            }
        }
        return [document.querySelectorAll("section[id$=glance] td a").length, found];
    })()""")
    assert empty[0] > 20
    assert empty[1] == []
    assert browser.complaints() == []


@pytest.mark.browser
@needs_chromium
def test_an_empty_table_says_so_and_shows_all_when_it_is_asked(page: Path, browser: chromium.Browser) -> None:
    browser.open(page)
    none = "document.querySelector('section[id$=verdicts] [data-none]')"
    browser.wait(f"{none}.hidden")
    browser.js(
        "(() => { const field = document.querySelector('[data-filter=words]'); field.value = 'nothing has this';"
        " field.dispatchEvent(new Event('input')); })()"
    )
    assert not browser.js(f"{none}.hidden")
    assert browser.js(f"{none}.textContent").startswith("No row is shown.")
    browser.js("document.querySelector('[data-show-rows]').click()")
    assert browser.js(f"{none}.hidden")
    assert not browser.js("document.querySelectorAll('.verdicts tbody tr[hidden]').length")


@pytest.mark.browser
@needs_chromium
@pytest.mark.parametrize(("width", "height"), [(1400, 900), (400, 900)])
def test_the_picture_is_on_the_first_screen(page: Path, browser: chromium.Browser, width: int, height: int) -> None:
    browser.open(page, width=width)
    browser.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
    bottom = browser.js("document.querySelector('.player canvas').getBoundingClientRect().bottom")
    assert bottom <= height
    assert browser.js("document.querySelector('[data-play]').getBoundingClientRect().bottom") <= height


@pytest.mark.parametrize("seed", range(20))
def test_columns_begin_with_the_engines_that_are_off(seed: int) -> None:
    rows = [row | {"engine": row["who"].partition(":")[0]} for row in drawn(seed)]
    rows = [row for row in rows if row["verdict"] in (*OFF, "within", "skipped")]
    shown = grid.ran(rows)
    worst = [min(map(RANK.index, {row["verdict"] for row in rows if row["who"] == who} - {"skipped"})) for who in shown]
    assert worst == sorted(worst)
    assert set(shown) == {row["who"] for row in rows if row["verdict"] != "skipped"}


def test_profiles_of_an_engine_stay_side_by_side_behind_the_truth_is_nothing() -> None:
    words = {
        "a:good": "within",
        "b:bad": "outside",
        "a:odd": "expected-outside",
        "b:good": "within",
        "truth:": "within",
    }
    rows = [{"who": who, "verdict": word, "limit": 1.0, "value": 0.5, "expected": None} for who, word in words.items()]
    assert grid.ran(rows) == ["b:bad", "b:good", "a:odd", "a:good", "truth:"]


RANK = ("crashed", "outside", "expected-outside", "within")


def test_every_metric_at_a_glance_says_what_it_measures(page: Path) -> None:
    text = unescape(page.read_text())
    assert f'title="{metrics.summary("law_residual")}"' in text
    assert f'title="{metrics.summary("position")}"' in text


def test_a_table_without_rows_is_a_word_and_no_heads() -> None:
    table = Table(title="Leads", columns=columns(a="Alone"), rows=[])
    text = render([Page(name="p", title="t", sections=[Section(name="s", title="S", tables=(table,))])], [], "")
    assert "There is none." in text
    assert "Alone" not in text


@pytest.mark.browser
@needs_chromium
def test_a_telephone_shows_how_many_times_its_limit_a_number_is_and_each_reason_whole(
    page: Path, browser: chromium.Browser
) -> None:
    browser.open(page, width=400)
    row = "document.querySelector('.verdicts tbody tr:not([hidden])')"
    assert browser.js(f"{row}.cells[7].getBoundingClientRect().right") <= 400
    summary = f"{row}.querySelector('.why summary')"
    assert browser.js(f"{summary}.scrollHeight <= {summary}.clientHeight + 1")
    assert browser.js(f"getComputedStyle({summary}).webkitLineClamp") == "none"
