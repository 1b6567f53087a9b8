"""What reading may cost: sizes that chunks declare, how denied memory is told, and time by the size of a file."""

from __future__ import annotations

import bz2
from pathlib import Path

import hypothesis.strategies as st
import pytest
from hypothesis import given

from crossbody.cases import LogFormatError
from crossbody.hw import budget as budgets
from crossbody.hw.budget import Budget
from crossbody.hw.formats._bounded import UNFOLD, Chunks


def squeezed(whole: bytes, how: str) -> bytes:
    if how == "bz2":
        return bz2.compress(whole)
    if how == "lz4":
        return bytes(pytest.importorskip("lz4.frame").compress(whole))
    return bytes(pytest.importorskip("zstandard").compress(whole)) if how == "zstd" else whole


@given(st.binary(min_size=1, max_size=3000), st.sampled_from(sorted(UNFOLD)), st.integers(-5, 5))
def test_a_chunk_is_what_it_declares_or_refused(whole: bytes, how: str, more: int) -> None:
    path, raw = Path("rig.mcap"), squeezed(whole * 3, how)
    whole *= 3
    chunks = Chunks(path, Budget(path))
    assert chunks.unfold(0, how, raw) == whole
    if more:
        with pytest.raises(LogFormatError, match=f"holds {'less' if more > 0 else 'more'} than it declares"):
            chunks.unfold(1, how, raw, len(whole) + more)
    assert chunks.unfold(2, how, raw, len(whole)) == whole
    assert chunks.unfold(0, "unknown", b"") == whole, "it is kept"
    assert UNFOLD[how](raw, len(whole) + 1) == whole
    if how in ("zstd", "lz4", "bz2"):
        assert UNFOLD[how](raw, max(len(whole) + more, 1)) == whole[: max(len(whole) + more, 1)]


@given(st.lists(st.booleans(), max_size=4), st.sampled_from([MemoryError, KeyError]))
def test_denied_memory_is_told_however_a_library_wraps_it(caused: list[bool], first: type[Exception]) -> None:
    """Each error is raised `from` the one before it, or while that is handled; the last is the reader's sentence."""
    error: Exception = first("no more")
    for i, explicit in enumerate(caused):
        last = i == len(caused) - 1
        outer = LogFormatError(Path("rig.mcap"), "is cut off.") if last else RuntimeError("of the library")
        outer.__cause__, outer.__context__ = (error, None) if explicit else (None, error)
        error = outer
    wanted = LogFormatError if first is MemoryError or caused else KeyError
    with pytest.raises(wanted) as told, Budget(Path("rig.mcap")).guard():
        raise error
    assert ("cannot be read within" in str(told.value)) == (first is MemoryError)
    assert (told.value is error) == (first is not MemoryError)


@given(st.integers(0, 10**9), st.integers(1, 10**10))
def test_a_file_has_the_more_time_the_larger_it_is(size: int, memory: int) -> None:
    """7 s up to 5 MB, and a second for each 250 kB beyond; with twice the memory of 1 GB twice as long."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(budgets, "_occupied", lambda path: size)
        found = Budget(Path("rig.mcap"), memory)
    beyond = (size - 5_000_000) / 250e3 if size > 5_000_000 else 0.0
    assert found.seconds == pytest.approx((7.0 + beyond) * (memory / 2**30 if memory > 2**30 else 1.0))
    assert (found.memory, found.most) == (memory + size, memory // 4 + 100 * size)
