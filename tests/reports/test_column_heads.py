"""Heads of columns are read alone too, in a table saved as CSV: none is half a sentence, none is there twice."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module

import pytest

from crossbody.reports.figures.section import Column

MODULES = (
    "pages.case_page", "pages.index_page", "pages.summary", "sections._own", "sections._words", "sections.identify",
    "sections.replay",
)  # fmt: skip


def tables() -> Iterator[tuple[str, tuple[Column, ...]]]:
    for name in MODULES:
        for key, value in vars(import_module(f"crossbody.reports.{name}")).items():
            if isinstance(value, tuple | list) and value and all(isinstance(one, Column) for one in value):
                yield f"{name}.{key}", tuple(value)


TABLES = dict(tables())


@pytest.mark.parametrize("name", TABLES)
def test_a_head_stands_alone(name: str) -> None:
    heads = [column.title for column in TABLES[name]]
    assert len(set(heads)) == len(heads)
    symbols = ("k*", "a0")
    assert [head for head in heads if head[:1].islower() and not head.startswith(symbols)] == []


def test_there_are_tables() -> None:
    assert len(TABLES) > 20
