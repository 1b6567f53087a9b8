"""What studies draw is what plotly knows: properties of its schema, traces of the script that pages have."""

from __future__ import annotations

import re

import plotly.graph_objects as go
import pytest
from ladder import ladder
from study_pages import studies
from unpacked import value_of

from crossbody.reports.pages import html, site

CARTESIAN = {
    "bar",
    "box",
    "contour",
    "heatmap",
    "histogram",
    "histogram2d",
    "histogram2dcontour",
    "image",
    "scatter",
    "violin",
}
"""Traces of the bundle (github.com/plotly/plotly.js, dist/README.md) that have x and y."""


@pytest.fixture(scope="module")
def figures(tmp_path_factory: pytest.TempPathFactory) -> list[dict]:
    path = tmp_path_factory.mktemp("figures")
    folders = [*studies(path), ladder(path / "bench", "bouncing_ball:linear")]
    for folder in folders:
        site.write(folder)
    texts = [page.read_text(encoding="utf-8") for folder in folders for page in folder.glob("*.html")]
    found = [one for text in texts for one in re.findall(r'data-plot="[^"]+">(.*?)</script>', text, re.DOTALL)]
    return [value_of(one) for one in found]


def test_every_figure_is_in_the_schema_and_drawn_by_the_script(figures: list[dict]) -> None:
    assert len(figures) > 10
    for one in figures:
        made = go.Figure({"data": one["data"], "layout": one["layout"]})  # refuses what plotly does not know
        assert {trace.type for trace in made.data} <= CARTESIAN


def test_the_script_is_the_bundle_of_the_schema_and_has_its_licence() -> None:
    head = html._text(html.PLOTLY)[:3000]
    assert "Permission is hereby granted" in head
    version = re.search(r"plotly.js \(cartesian - minified\) v(\S+)", head)
    assert version
    from plotly.offline import get_plotlyjs_version

    assert version[1].partition(".")[0] == get_plotlyjs_version().partition(".")[0]
