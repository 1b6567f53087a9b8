"""What studies draw is what plotly knows, and its script is the one that pages have."""

from __future__ import annotations

import re

import plotly.graph_objects as go
import pytest
from ladder import ladder
from plotly.offline import get_plotlyjs
from study_pages import studies
from unpacked import value_of

from crossbody.reports.pages import html, site


@pytest.fixture(scope="module")
def figures(tmp_path_factory: pytest.TempPathFactory) -> list[dict]:
    path = tmp_path_factory.mktemp("figures")
    folders = [*studies(path), ladder(path / "bench", "bouncing_ball:linear")]
    for folder in folders:
        site.write(folder)
    texts = [page.read_text(encoding="utf-8") for folder in folders for page in folder.glob("*.html")]
    found = [one for text in texts for one in re.findall(r'data-plot="[^"]+">(.*?)</script>', text, re.DOTALL)]
    return [value_of(one) for one in found]


def test_every_figure_is_in_the_schema(figures: list[dict]) -> None:
    assert len(figures) > 10
    for one in figures:
        go.Figure({"data": one["data"], "layout": one["layout"]})  # refuses what plotly does not know


def test_the_script_is_that_of_the_package_and_names_its_licence() -> None:
    assert html._text(html.PLOTLY) == get_plotlyjs()
    assert "Licensed under the MIT license" in html._text(html.PLOTLY)[:300]
