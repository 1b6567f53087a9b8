"""What a page carries folded comes back to the last bit, whatever it is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from unpacked import text_of, value_of

from crossbody.reports.figures.styles import coded
from crossbody.reports.pages.html import packed_text, packed_value


@given(st.text())
def test_a_text_comes_back(text: str) -> None:
    assert text_of(packed_text(text)) == text


@pytest.mark.parametrize("kind", ["<f4", "<f8"])
@given(rows=st.integers(0, 9), width=st.integers(1, 4), seed=st.integers(0, 2**32 - 1))
def test_every_bit_of_every_array_comes_back(kind: str, rows: int, width: int, seed: int) -> None:
    """Random bits are numbers of every size, infinities and NaN of every payload."""
    rng = np.random.default_rng(seed)
    arrays = [
        np.frombuffer(rng.bytes(rows * wide * int(kind[2])), kind).reshape((rows, wide) if wide > 1 else rows)
        for wide in (width, 1)
    ]
    given_ = {"a": [{"x": coded(arrays[0]), "more": [1, None, "</script>"]}], "b": coded(arrays[1])}
    found = value_of(packed_value(given_))
    assert found["a"][0]["more"] == [1, None, "</script>"]
    for back, array in zip((found["a"][0]["x"], found["b"]), arrays, strict=True):
        assert back.tobytes() == array.tobytes()
        assert back.shape == array.shape or not back.size
