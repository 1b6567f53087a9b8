"""What holds for all tests."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest


@pytest.fixture(scope="module", autouse=True)
def _kept_out_of_collections() -> Iterator[None]:
    """Put what a file leaves, compiled code above all, out of the collector's sight.

    A process that has run thousands of tests holds a gigabyte of it; each full collection would go through all.
    """
    yield
    gc.collect()
    gc.freeze()
