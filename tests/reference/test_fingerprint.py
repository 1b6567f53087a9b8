"""The key of compiled code covers what the code reads: whatever is changed, no old code is taken for new."""

from __future__ import annotations

import ast
import enum
import inspect
import math
import random
import subprocess
import sys
import types
from importlib import import_module
from pathlib import Path
from types import FunctionType

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import helped

from crossbody.reference import core, linear, systems
from crossbody.reference._fingerprint import Unreadable, fingerprint
from crossbody.reference._parts import WholePasses
from crossbody.reference.cache import Lean
from crossbody.reference.core.bundles import bundle_type
from crossbody.reference.kernels import NAMES, helper

MODULES = ("hw.fitting.rk4",)
PACKAGES = (core, systems, linear)
KEPT = {"helper", "compiled", *NAMES}


def _source(text: str, **scope: object) -> types.FunctionType:
    """The function `f` of a text, with these globals."""
    exec(text, scope)
    return scope["f"]


def _compiled() -> list[types.FunctionType]:
    files = [(package.__name__, path.stem) for package in PACKAGES for path in Path(package.__path__[0]).glob("*.py")]
    names = [f"{package}.{stem}" for package, stem in files] + [f"crossbody.{name}" for name in MODULES]
    modules = [import_module(name) for name in names]
    found = {id(part): part for module in modules for part in vars(module).values() if isinstance(part, FunctionType)}
    return [part for part in found.values() if _decorators(part) & KEPT]


def _decorators(function: FunctionType) -> set[str]:
    (tree,) = ast.parse(inspect.getsource(function)).body
    return {ast.unparse(line).removeprefix("kernels.") for line in tree.decorator_list}


def _reached(function: FunctionType, met: set[int]) -> dict[tuple[str, str], dict[str, object]]:
    """Numbers and arrays among the globals that a function and what it calls name: (module, name) -> those globals."""
    if id(function) in met or not function.__module__.startswith("crossbody."):
        return {}
    met.add(id(function))
    found: dict[tuple[str, str], dict[str, object]] = {}
    tree = ast.parse(inspect.getsource(function)).body[0]
    named = [node for line in tree.body for node in ast.walk(line) if isinstance(node, ast.Name)]
    own = {node.id for node in named if isinstance(node.ctx, ast.Store)} | {arg.arg for arg in tree.args.args}
    for name in {node.id for node in named} - own:
        value = function.__globals__.get(name)
        if isinstance(value, (int, float, np.ndarray, np.generic, tuple)):
            found[function.__module__, name] = function.__globals__
        elif isinstance(value, FunctionType):
            found |= _reached(value, met)
    return found


def _another(value: object) -> object:
    return (*value, 1.0) if isinstance(value, tuple) else np.add(value, 1)


def mutate_every_global() -> tuple[int, int]:
    """Change each global that shipped functions reach, one at a time; how many functions and globals there were."""
    functions = sorted(_compiled(), key=lambda function: (function.__module__, function.__qualname__))
    random.Random(4).shuffle(functions)
    tried = set()
    for function in functions:
        before = fingerprint(function)
        for place, scope in _reached(function, set()).items():
            if place not in tried:
                tried.add(place)
                value = scope[place[1]]
                scope[place[1]] = _another(value)
                assert fingerprint(function) != before, (function.__qualname__, place)
                scope[place[1]] = value
    return len(functions), len(tried)


def test_every_global_that_a_compiled_function_reaches_is_in_its_key():
    # In a process that compiles nothing, where the functions stand as they were written.
    code = "import test_fingerprint as law; print(*law.mutate_every_global())"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=Path(__file__).parent, env=helped(NUMBA_DISABLE_JIT="1"),
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    functions, reached = map(int, done.stdout.split())
    assert functions > 200
    assert reached > 200


BODY = "def f(x):\n    return x * RATE + helper(x)\n"
HELPER = "def helper(x):\n    return x + OFFSET\n"


def _pair(rate: object = 2.0, offset: object = 1.0, body: str = BODY, helper: str = HELPER) -> types.FunctionType:
    inner: dict[str, object] = {"OFFSET": offset}
    exec(helper, inner)
    return _source(body, RATE=rate, helper=numba.njit(inner["helper"]))


def test_comments_docstrings_lines_and_other_globals_do_not_count():
    commented = "# moved down\n\n\n" + BODY.replace(":\n", ":\n    'Say what it is.'\n    # why\n")
    assert fingerprint(_pair(body=commented)) == fingerprint(_pair())
    other = _pair()
    other.__globals__["unread"] = object()
    assert fingerprint(other) == fingerprint(_pair())


@pytest.mark.parametrize(
    "change",
    [
        {"rate": 2.5}, {"rate": 2}, {"offset": 1.5}, {"rate": -0.0}, {"rate": np.array([2.0])},
        {"body": BODY.replace("*", "/")}, {"helper": HELPER.replace("+", "-")},
        {"body": BODY.replace("(x):", "(x, y=1):")},
    ],
)  # fmt: skip
def test_what_is_read_counts(change):
    assert fingerprint(_pair(**change)) != fingerprint(_pair())


@settings(max_examples=50, deadline=None)
@given(a=st.floats(), b=st.floats())
def test_two_numbers_have_two_keys(a, b):
    same = (math.copysign(1.0, a) == math.copysign(1.0, b) and a == b) or (a != a and b != b)
    assert (fingerprint(_pair(rate=a)) == fingerprint(_pair(rate=b))) == same


def test_attributes_of_a_module_of_a_user_count_and_its_others_do_not():
    def key(**attributes: object) -> str:
        module = types.ModuleType("settings_of_a_user")
        vars(module).update(attributes)
        return fingerprint(_source("def f(x):\n    return x * config.G\n", config=module))

    assert key(G=1.0) == key(G=1.0, other=[object()])
    assert key(G=1.0) != key(G=9.81)


def test_closures_collections_and_enumerations_count():
    def made(value: object) -> types.FunctionType:
        def f(x: float) -> object:
            return x, value

        return f

    class Mode(enum.IntEnum):
        ON = 1

    values = [1, 2.0, "a", (1, 2), [1, 2], {1: 2}, {1, 2}, frozenset({1}), Mode.ON, Mode, math.sin, np.cos]
    values += [np.arange(2), np.arange(2.0), np.float64(1), np.dtype("f8"), np.dtype([("a", "i4")])]
    values += [numba.float64, numba.float64[::1]]
    keys = [fingerprint(made(value)) for value in values]
    assert len(set(keys)) == len(values)
    assert keys == [fingerprint(made(value)) for value in values]


@pytest.mark.parametrize("value", [object(), np.array([object()]), types.SimpleNamespace(a=1)])
def test_what_has_no_content_that_can_be_told_is_refused(value):
    with pytest.raises(Unreadable):
        fingerprint(_source("def f(x):\n    return x, G\n", G=value))


def test_each_of_many_constants_and_globals_counts():
    """Beyond 256 of either the number of one takes more than one byte."""
    scope = {f"G{k}": float(k) for k in range(600)}

    def key(k: int, of_global: float = 0.0, of_constant: float = 0.5, told: str = "") -> str:
        values = [f"{of_constant if i == k else 1.0} + {i}.25 * G{i}" for i in range(600)]
        text = f"def f(x):\n{told}    return {' + '.join(values)}\n"
        return fingerprint(_source(text, **scope | {f"G{k}": of_global}))

    assert fingerprint(_source("def f():\n    return G599 + 1.5\n", **scope)) != key(599)
    for k in (0, 130, 260, 599):
        assert len({key(k), key(k, of_global=1.5), key(k, of_constant=2.5)}) == 3
    assert key(9, told="    'What it does.'\n") == key(9, told="    'Another.'\n")


def test_what_numba_compiles_in_place_of_a_function_counts():
    def made(value: float) -> types.FunctionType:
        scope: dict[str, object] = {"numba": numba}
        text = "def g():\n    return 0.0\n@numba.extending.overload(g)\ndef of_g():\n    return lambda: VALUE\n"
        exec(text.replace("VALUE", repr(value)), scope)
        return _source("def f():\n    return g()\n", g=scope["g"])

    assert fingerprint(made(1.0)) == fingerprint(made(1.0))
    assert fingerprint(made(1.0)) != fingerprint(made(2.0))


def test_what_a_user_has_numba_compile_in_place_of_a_library_function_counts():
    def key(value: float) -> str:
        text = f"@numba.extending.overload(math.ulp)\ndef of_ulp(x):\n    return lambda x: {value!r}\n"
        exec(text, {"numba": numba, "math": math})
        return fingerprint(_source("def f(x):\n    return math.ulp(x)\n", math=math))

    assert len({key(value) for value in (1.0, 2.0, 3.0)}) == 3


def test_a_file_of_a_user_with_the_name_of_a_module_of_python_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(tmp_path)

    def key(value: float) -> str:
        (tmp_path / "tabnanny.py").write_text(f"G = {value!r}\ndef of(x):\n    return x + {value!r}\n")
        monkeypatch.delitem(sys.modules, "tabnanny", raising=False)
        module = types.ModuleType("tabnanny")
        module.__file__ = str(tmp_path / "tabnanny.py")
        exec((tmp_path / "tabnanny.py").read_text(), vars(module))
        monkeypatch.setitem(sys.modules, "tabnanny", module)
        return fingerprint(_source("def f(x):\n    return tabnanny.G + of(x)\n", tabnanny=module, of=module.of))

    assert key(1.0) == key(1.0)
    assert key(1.0) != key(2.0)


def _anew(function: types.FunctionType) -> Lean:
    return Lean(function, targetoptions={"nopython": True}, pipeline_class=WholePasses)


def test_a_helper_that_was_compiled_before_its_constant_changed_has_no_key():
    scope: dict[str, object] = {"G": 1.0}
    exec("def helper(x):\n    return x * G\n", scope)
    inner = helper(scope["helper"])
    outer = _source("def f(x):\n    return inner(x)\n", inner=inner)
    fingerprint(outer)
    scope["G"] = 2.0
    assert _anew(outer)(2.0) == 4.0
    fingerprint(outer)
    scope["G"] = 3.0
    assert _anew(outer)(2.0) == 4.0  # numba has frozen it
    with pytest.raises(Unreadable, match="before what it reads changed"):
        fingerprint(outer)


def test_two_layouts_of_one_name_are_two_types() -> None:
    """Code that was compiled for the places of fields in an older layout is not that of the new one."""
    layouts = ({"x": "Floats", "y": "Floats"}, {"y": "Floats", "x": "Floats"}, {"x": "Floats", "y": "Floats2"})
    kinds = [bundle_type(type("Work", (), {"__annotations__": layout})) for layout in layouts]
    assert len({str(kind) for kind in kinds}) == 3
