"""Pieces that are compiled beside the kernels of a mechanism, and work that compiling is spared."""

import gc
import io
import os
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout, suppress
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numba import float64, int64, void
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import DEFAULT_FLAGS, DefaultPassBuilder
from numba.core.errors import NumbaRuntimeError, TypingError
from numba.core.types.functions import BaseFunction

from crossbody.reference import _program, ahead, kernels
from crossbody.reference._hastened import hastened
from crossbody.reference._parts import NEEDLESS
from crossbody.reference.cache import ALLOCATES, ALLOCATES_NOTHING, Compiled, Part, compiled
from crossbody.reference.compiling import Count
from crossbody.reference.systems import absent


def doubled(x: float) -> float:
    return x + x


def moved(x: np.ndarray) -> None:
    x[1:] = x[:-1]


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[list[str]]]:
    """Commands of the processes that are begun, none of which is."""
    found: list[list[str]] = []
    monkeypatch.setattr(ahead, "_alone", False)
    monkeypatch.setattr(ahead, "_process", None)
    monkeypatch.setattr(ahead, "_asked", [ahead.BESIDE])
    monkeypatch.setattr(ahead.atexit, "register", lambda *given: None)
    made = SimpleNamespace(stdout=(), stdin=io.StringIO())
    monkeypatch.setattr(ahead.subprocess, "Popen", lambda call, **_how: found.append(call) or made)
    ahead.begin.cache_clear()
    yield found
    ahead.begin.cache_clear()


def test_the_loop_is_begun_with_the_first_code_that_is_compiled_and_not_where_it_is_read_back(
    begun: list[list[str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("CROSSBODY_CACHE", str(tmp_path))
    count = []
    for _ in range(2):
        ahead.begin.cache_clear()
        assert compiled(doubled, [float64(float64)])(2.0) == 4.0  # a user's own code begins nothing
        compiled(absent.gaps.py_func, [kernels.REAL["gaps"]])
        count.append(len(begun))
    assert count == [1, 1]


@pytest.mark.parametrize("processors", [1, 2])
def test_it_is_begun_where_a_processor_is_free_and_said_at_once(
    processors: int, begun: list[list[str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    count, said = Count(show=lambda *told: said.append(told)), list[tuple[int, int]]()
    monkeypatch.setenv("CROSSBODY_CACHE", str(tmp_path))
    monkeypatch.setattr(ahead, "count", count)
    monkeypatch.setattr(ahead, "processors", lambda: processors)
    ahead.begin()
    ahead.begin()
    assert [call[0] for call in begun] == [sys.executable] * (processors - 1)
    assert all("compile_beside" in call[2] for call in begun)
    assert said == [(0, len(count.needed))]
    roots = ("core.advance.advance", "core.instant_answers.answer")
    assert {f"crossbody.reference.{name}" for name in roots} < count.needed


def test_it_may_use_as_many_processors_as_it_is_given() -> None:
    all_of_them = ahead.processors()
    if hasattr(os, "sched_setaffinity"):
        given = os.sched_getaffinity(0)
        try:
            os.sched_setaffinity(0, {min(given)})
            assert ahead.processors() == 1
        finally:
            os.sched_setaffinity(0, given)
    assert ahead.processors() == all_of_them >= 1


def test_it_is_asked_for_each_piece_once_also_before_it_is_begun_and_when_it_has_gone(
    begun: list[list[str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("CROSSBODY_CACHE", str(tmp_path))
    monkeypatch.setattr(ahead, "processors", lambda: 2)
    ahead.ask("modes")
    ahead.begin()
    for name in ("friction", "modes", "friction"):
        ahead.ask(name)
    assert ahead._process is not None
    assert ahead._process.stdin is not None
    assert ahead._process.stdin.getvalue().split() == [ahead.BESIDE, "modes", "friction"]  # type: ignore[attr-defined]
    read, write = os.pipe()
    os.close(read)
    with suppress(BrokenPipeError), open(write, "w") as nobody_reads:
        monkeypatch.setattr(ahead._process, "stdin", nobody_reads)
        ahead.ask("SUNDIALS")
    assert len(begun) == 1


def test_the_process_beside_names_what_is_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, pieces, count = ["integrator", "friction"], list[str](), Count()
    monkeypatch.setattr(ahead, "die_with_parent", lambda: None)
    monkeypatch.setattr(ahead.sys, "stdin", io.StringIO("integrator\nfriction\n"))
    monkeypatch.setattr(ahead, "compile_piece", lambda name: (pieces.append(name), count.done(f"a.{name}")))
    monkeypatch.setattr(ahead, "count", count)
    read, write = os.pipe()
    with os.fdopen(write, "w") as out, redirect_stdout(out):
        ahead.compile_beside()
    assert pieces == asked
    here = Count()
    here.need(f"a.{name}" for name in asked)
    monkeypatch.setattr(ahead, "count", here)
    with os.fdopen(read) as names:
        ahead._follow(names)
    assert here.ready == here.needed


def test_nothing_is_begun_where_the_loop_is_kept(begun: list[list[str]]) -> None:
    _program.program()
    begun.clear()
    ahead.begin.cache_clear()
    ahead.begin()
    assert begun == []


def test_who_compiles_piece_by_piece_begins_no_other(begun: list[list[str]], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_program, "is_missing", lambda: True)
    ahead.compile_piece("modes")
    ahead.begin()
    assert begun == []


@pytest.mark.parametrize("missing", [False, True])
def test_a_piece_is_compiled_here_only_while_another_process_compiles_the_loop(
    missing: bool, begun: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    pieces: list[str] = []
    monkeypatch.setattr(_program, "is_missing", lambda: missing)
    monkeypatch.setattr(ahead, "compile_piece", pieces.append)
    ahead.meanwhile("SUNDIALS")
    assert pieces == []  # where nothing was compiled nothing is missing
    ahead.begin()
    ahead.meanwhile("SUNDIALS")
    assert pieces == ["SUNDIALS"] * missing


def test_a_sum_of_numbers_is_resolved_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("CROSSBODY_CACHE", str(tmp_path))
    asked: list[tuple[object, ...]] = []
    resolve = BaseFunction.get_call_type

    def noted(function: BaseFunction, context: object, args: tuple[object, ...], kws: object) -> object:
        asked.append((function.typing_key, *args))
        return resolve(function, context, args, kws)

    monkeypatch.setattr("crossbody.reference._hastened._resolve", noted)
    monkeypatch.setattr(BaseFunction, "get_call_type", noted)

    def total(x: float, y: float) -> float:
        a = x + y
        b = a + y
        c = b + a
        return c + b

    found = compiled(total, [float64(float64, float64)])
    assert len(asked) == len(set(asked)) == 1
    assert found(1.0, 2.0) == total(1.0, 2.0)


def shared(x: float, k: int) -> float:
    return x * k if k > 1 else x - k


@pytest.mark.parametrize(("module", "versions"), [(ALLOCATES_NOTHING[0] + "one", 1), (__name__, 3)])
def test_constants_are_numbers_to_what_is_called_with_them(
    module: str, versions: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Each constant would be a version of its own to compile; a user's own code may need to know which it is."""
    monkeypatch.setenv("CROSSBODY_CACHE", str(tmp_path))
    monkeypatch.setattr(shared, "__module__", module)
    part = compiled(shared)

    def total(x: float) -> float:
        return part(x, 1) + part(x, k=2) + part(x, 3)

    found = compiled(total, [float64(float64)])
    assert len(part.overloads) == versions
    assert found(5.0) == shared(5.0, 1) + shared(5.0, 2) + shared(5.0, 3)


@pytest.mark.parametrize(("module", "count"), [(ALLOCATES_NOTHING[0] + "one", 0), (__name__, 1)])
def test_the_whole_is_optimised_twice_only_where_references_are_counted(
    module: str, count: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    twice, optimise = list[Any](), JITCodeLibrary._optimize_final_module
    monkeypatch.setenv("CROSSBODY_CACHE", str(tmp_path))
    monkeypatch.setattr(shared, "__module__", module)
    monkeypatch.setattr(JITCodeLibrary, "_optimize_final_module", lambda one: (twice.append(one), optimise(one))[1])
    assert compiled(shared, [float64(float64, int64)])(2.0, 3) == 6.0
    assert len(twice) == count


def test_passes_that_are_left_out_are_numbas() -> None:
    state = SimpleNamespace(func_ir=None, flags=DEFAULT_FLAGS)
    assert {kind.name() for kind, _ in DefaultPassBuilder.define_nopython_pipeline(state).passes} >= NEEDLESS


def test_the_collector_and_numba_are_as_they_were() -> None:
    before = BaseFunction.get_call_type
    with hastened():
        with suppress(ZeroDivisionError), hastened():
            raise ZeroDivisionError
        assert not gc.isenabled()
        assert BaseFunction.get_call_type is not before
    assert gc.isenabled()
    assert BaseFunction.get_call_type is before


@pytest.mark.parametrize("package", ALLOCATES_NOTHING)
def test_what_allocates_is_refused(monkeypatch: pytest.MonkeyPatch, package: str) -> None:
    """What is moved within an array is copied first, by numba: memory, and twenty functions on strings to compile."""
    monkeypatch.setattr(moved, "__module__", package + "one")
    with pytest.raises(NumbaRuntimeError, match="NRT required"):
        compiled(moved, [void(float64[::1])])


@pytest.mark.parametrize("module", ALLOCATES)
def test_modules_that_make_arrays_are_there_and_count_references(module: str) -> None:
    functions = [one for one in vars(import_module(module)).values() if getattr(one, "__module__", "") == module]
    assert any(isinstance(one, (Part, Compiled)) for one in functions)
    assert not any("_nrt" in one.targetoptions for one in functions if isinstance(one, (Part, Compiled)))


def rest(x: Any) -> Any:
    return x[1:], x[0]


def test_what_counts_no_references_hands_out_no_array(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who counts them takes one away at the end, for which nobody added one; Python would get the whole array."""
    monkeypatch.setattr(rest, "__module__", ALLOCATES_NOTHING[-1] + "one")
    part = compiled(rest)

    def first(x: Any) -> Any:
        return part(x)[0][0]

    for call in (lambda: part(np.arange(3.0)), lambda: compiled(first, [float64(float64[::1])])):
        with pytest.raises((TypeError, TypingError), match=r"returns .*array.* counts no references"):
            call()
    monkeypatch.setattr(rest, "__module__", ALLOCATES[-1])
    assert compiled(rest)(np.arange(3.0))[0].tolist() == [1.0, 2.0]
