"""What reading may cost: sizes that chunks declare, how denied memory is told, and time by the size of a file."""

from __future__ import annotations

import bz2
import json
from pathlib import Path
from types import SimpleNamespace

import hypothesis.strategies as st
import pytest
from hypothesis import given

from crossbody.cases import LogFormatError
from crossbody.hw import budget as budgets
from crossbody.hw import formats
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


@given(st.lists(st.integers(0, 3 * 2**20), min_size=1, max_size=8))
def test_what_is_decoded_adds_up(pieces: list[int]) -> None:
    found = Budget(Path("rig.mcap"), 2**24)
    refused = next((k for k in range(len(pieces)) if sum(pieces[: k + 1]) > 2**22), None)
    for k, piece in enumerate(pieces[: None if refused is None else refused + 1]):
        if k == refused:
            with pytest.raises(LogFormatError, match=r"decompresses to more than 4\.19 MB"):
                found.spend(piece)
        else:
            found.spend(piece)


def test_holes_of_a_file_and_the_rest_of_its_last_block_do_not_count(tmp_path: Path) -> None:
    for name, content, whole in (("small", b"x" * 10, 10), ("sparse", b"", 2**26), ("full", b"x" * 2**16, 2**16)):
        with (tmp_path / name).open("wb") as file:
            file.write(content)
            file.truncate(whole)
        assert Budget(tmp_path / name).size == len(content)
    assert Budget(tmp_path).size == 10 + 2**16


def test_topics_that_are_not_read_say_why(tmp_path: Path) -> None:
    """Of a file with five of them one is read; no other vanishes."""
    writing = pytest.importorskip("mcap.writer")
    path, told = tmp_path / "rig.mcap", {"/deep": [{"q": 1.0}] * 20_000, "/long": "x" * 1_100_000, "/rig": 1.0}
    with path.open("wb") as file:
        writer = writing.Writer(file)
        writer.start()
        schema = writer.register_schema("state", "jsonschema", b'{"type": "object"}')
        for topic, value in told.items():
            channel = writer.register_channel(topic, "json", schema)
            writer.add_message(channel, log_time=0, publish_time=0, data=json.dumps({"a": 1.0, "b": value}).encode())
        writer.add_message(writer.register_channel("/other", "cbor", schema), log_time=0, publish_time=0, data=b"1")
        writer.finish()
    log = formats.open_log(path, "mcap")
    assert [group.name for group in log.groups] == ["/rig"]
    words = {"/deep": "messages inside", "/long": "messages of", "/other": "is encoded as cbor"}
    assert log.refused.keys() == words.keys()
    assert all(words[topic] in why for topic, why in log.refused.items())
    log.close()


@given(st.lists(st.integers(0, 500), max_size=4), st.integers(0, 200), st.integers(0, 24))
def test_rows_that_no_block_of_an_mdf_file_holds_are_told(sizes: list[int], rows: int, width: int) -> None:
    mdf = pytest.importorskip("crossbody.hw.formats.mdf")
    path = Path("rig.mf4")
    reader = SimpleNamespace(_budget=Budget(path), _path=path)
    group = SimpleNamespace(
        get_data_blocks=lambda: [SimpleNamespace(original_size=size) for size in sizes], channels=[None],
        channel_group=SimpleNamespace(samples_byte_nr=width),
    )  # fmt: skip
    if rows * width <= sum(sizes):
        mdf.MdfReader._check_size(reader, group, rows, 3)
        return
    with pytest.raises(LogFormatError, match=f"announces {rows} rows in group 3 and holds") as told:
        mdf.MdfReader._check_size(reader, group, rows, 3)
    assert told.value.row == max(k for k in range(rows) if k * width <= sum(sizes))
