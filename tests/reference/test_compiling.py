"""What is told of compiling: how many functions are ready of those that are needed, and the time that it takes."""

import random
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from numba import float64

from crossbody.reference import cache
from crossbody.reference._fingerprint import names_within
from crossbody.reference.cache import compiled
from crossbody.reference.compiling import Count

LINE = re.compile(r"crossbody: compiling the reference for this processor, once: (\d+) of (\d+) functions")


@pytest.mark.parametrize("seed", range(20))
def test_counts_rise_and_end_where_all_is_ready(seed: int) -> None:
    draw, said = random.Random(seed), list[tuple[int, int]]()
    count = Count(every=0.0, show=lambda *told: said.append(told))
    names = [f"f{k}" for k in range(draw.randrange(1, 30))]
    late = draw.randrange(len(names))
    count.need(names[late:])
    count.tell()
    count.need(names)
    ready = [*names, *draw.choices(names, k=5), "of another", "of nobody"]
    draw.shuffle(ready)
    for name in ready:
        count.done(name)
    assert said[0] == (0, len(names) - late)
    assert said[1:] == [(k, len(names)) for k in range(1, len(names) + 1)]


def test_what_is_ready_before_it_is_known_to_be_needed_counts() -> None:
    """Another process may compile a piece of which nobody knew whether it would be needed."""
    count, said = Count(), list[tuple[int, int]]()
    count.show = lambda *told: said.append(told)
    for name in "abx":
        count.done(name)
    count.need("abc")
    count.tell()
    assert said == [(2, 3)]


def test_nothing_is_told_before_it_is_asked_for_nor_too_often() -> None:
    said = list[tuple[int, int]]()
    count = Count(every=1e6, show=lambda *told: said.append(told))
    count.need("abcd")
    count.done("a")
    assert said == []
    count.tell()
    count.done("b")
    assert said == [(1, 4)]


def test_a_function_that_takes_long_does_not_silence_the_count() -> None:
    said = list[tuple[int, int]]()
    count = Count(every=0.02, show=lambda *told: said.append(told))
    count.need("ab")
    count.tell()
    with count.clocked():
        time.sleep(0.5)
    assert len(said) >= 3
    assert set(said) == {(0, 2)}


def test_time_is_counted_once_where_compilations_are_nested_and_while_they_last() -> None:
    count = Count()
    began = time.perf_counter()
    with count.clocked(), count.clocked():
        time.sleep(0.02)
        inside = count.seconds
    whole = time.perf_counter() - began
    assert 0.02 <= inside <= count.seconds <= whole
    time.sleep(0.01)
    assert count.seconds <= whole


def _tree(draw: random.Random, depth: int) -> Any:
    """A function that calls some others, each compiled as a part of it."""
    calls = tuple(compiled(_tree(draw, depth - 1)) for _ in range(draw.randrange(3))) if depth else ()
    first, last = (calls[0], calls[-1]) if calls else (None, None)
    if first is None:

        def made(x: float) -> float:
            return x + 1.0
    else:

        def made(x: float) -> float:
            return first(x) + last(x)

    made.__name__ = f"f{draw.randrange(10**9)}"
    return made


@pytest.mark.parametrize("seed", range(4))
def test_what_is_needed_is_what_gets_compiled(seed: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    count = Count()
    monkeypatch.setenv("CROSSBODY_CACHE", str(tmp_path))
    monkeypatch.setattr(cache, "count", count)
    whole = _tree(random.Random(seed), 3)
    compiled(whole, [float64(float64)])
    assert count.needed == count.ready == names_within(whole)


@pytest.mark.slow
def test_the_first_run_counts_up_to_all_and_books_the_time_as_compiling(tmp_path: Path) -> None:
    call = [str(Path(sys.executable).parent / "crossbody"), "run", "bouncing_ball:listing", "-e", "reference:compiled"]
    first, second = (
        subprocess.run(
            [*call, "--out", str(tmp_path / "out")], env={"CROSSBODY_CACHE": str(tmp_path / "cache")}, check=True,
            capture_output=True, text=True,
        ) for _ in range(2)
    )  # fmt: skip
    told = [tuple(map(int, found)) for found in LINE.findall(first.stderr)]
    assert told == sorted(told)
    assert len(told) > 3
    assert told[0][0] == 0
    assert told[-1][0] == told[-1][1]
    parts = dict(re.findall(r"(\w+) ([\d.]+)", first.stdout.partition("runs")[2]))
    assert float(parts["compiling"]) > 10.0 * float(parts["truths"])
    assert "compiling" not in second.stdout + second.stderr
