"""Code that is traced for one model: the same numbers as the general sweeps, to the last bit, and never another's."""

from __future__ import annotations

from pathlib import Path
from types import CodeType
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_scenes import random_scene, random_state, with_own_laws

from crossbody import cases, engines
from crossbody.cases import Law
from crossbody.cases.scene import Body, Joint, Scene
from crossbody.reference import System, _fingerprint, code_store, linear
from crossbody.reference.tree import layout, sweeps, traced
from crossbody.reference.tree.system import system
from crossbody.reference.tree.table import tabulate


def law_of(scene: Scene) -> Law:
    case = cases.from_scene(with_own_laws(scene, 0))
    return case.law


def seen(own: System, scene: Scene, seed: int) -> list[np.ndarray]:
    """What the kernels say of a state: M, f, and the rows, which read the poses that were left."""
    rng = np.random.default_rng(seed)
    q, v, u = random_state(scene, rng)
    u = np.resize(u, own.inputs)
    p, n, nc = np.array(own.p), own.n, own.nc
    M, f, w = np.zeros((n, n)), np.zeros(n), np.zeros(own.scratch)
    own.dynamics(0.0, q, v, u, p, M, f, w)
    H, h, Hdv = np.zeros((nc, n)), np.zeros(nc), np.zeros(nc)
    own.rows(0.0, q, v, p, w, np.arange(nc), nc, H, h, Hdv)
    return [M, f, H, h, Hdv]


@pytest.mark.parametrize("seed", range(40))
def test_traced_code_gives_the_numbers_of_the_general_code_to_the_last_bit(seed: int) -> None:
    scene = random_scene(seed)
    law = law_of(scene)
    general, own = (system(scene, law, traced=asked) for asked in (False, True))
    assert general.p[layout.TRACED] == 0.0 != own.p[layout.TRACED]
    for state in range(3):
        for a, b in zip(seen(general, scene, state), seen(own, scene, state), strict=True):
            np.testing.assert_array_equal(a, b)


def pendulum(mass: float = 1.0, armature: float = 0.0) -> Scene:
    rod = Body(name="rod", mass=mass, com=(0.0, 0.0, -0.5), inertia=(0.01, 0.01, 0.01, 0.0, 0.0, 0.0))
    return Scene(
        bodies=(rod,), joints=(Joint(name="hinge", body="rod", type="hinge", axis=(0, 1, 0), armature=armature),)
    )


@given(st.floats(0.1, 10.0), st.floats(0.0, 1.0))
def test_a_model_never_gets_the_code_of_another(mass: float, armature: float) -> None:
    scene = pendulum(mass, armature)
    law = law_of(scene)
    found = [seen(system(scene, law, traced=asked), scene, 0)[0] for asked in (False, True)]
    assert found[0] == found[1]


@pytest.fixture
def empty_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A store with nothing in it, and a process that has loaded nothing."""
    monkeypatch.setenv("CROSSBODY_CACHE", str(tmp_path))
    monkeypatch.setattr(traced, "_LOADED", {})
    return tmp_path


def address(anew: bool, mass: float = 3.25) -> float:
    table = tabulate(pendulum(mass))
    return traced.compiled_sweeps(table.p, 1, 1, anew=anew)


def test_what_was_not_asked_for_is_not_compiled_and_what_was_is_kept(
    empty_store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert address(anew=False) == 0.0
    assert address(anew=True) != 0.0
    (file,) = (empty_store / "compiled").glob("sweeps-*.code")
    monkeypatch.setattr(traced, "_LOADED", {})
    monkeypatch.setattr(traced.llvm, "create_pass_builder", lambda *_: pytest.fail("compiled twice"))
    assert address(anew=False) != 0.0
    assert address(anew=False, mass=3.5) == 0.0
    file.write_bytes(file.read_bytes()[:-1])
    monkeypatch.setattr(traced, "_LOADED", {})
    assert address(anew=False) == 0.0  # what is damaged is dropped
    assert not file.exists()


def test_without_a_folder_to_keep_code_in_it_serves_the_process(
    empty_store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(code_store, "current", lambda: None)
    assert address(anew=False) == 0.0
    assert address(anew=True) == address(anew=False) != 0.0


def helpers() -> list[Any]:
    """All functions that the sweeps are made of."""
    return [one for one in vars(sweeps).values() if hasattr(one, "py_func")]


def altered(function: Any) -> CodeType:
    """Its code with another number or another name in it, as what was compiled from another text may have."""
    code = function.__code__
    consts = tuple(2.0 * c if type(c) is float else c for c in code.co_consts)
    if consts == code.co_consts:
        return code.replace(co_varnames=(*code.co_varnames[:-1], f"{code.co_varnames[-1]}_"))
    return code.replace(co_consts=consts)


@pytest.mark.parametrize("helper", helpers(), ids=lambda one: one.__name__)
def test_code_of_other_bytecode_is_none_of_what_was_kept(helper: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever text stands beside it: an old .pyc may run, or a function that was changed since it was read."""
    before = traced._dependencies()
    monkeypatch.setattr(helper.py_func, "__code__", altered(helper.py_func))
    assert traced._dependencies() != before
    monkeypatch.undo()
    assert traced._dependencies() == before


@pytest.mark.parametrize("compiled_before", [False, True])
def test_code_that_reads_another_number_is_made_anew(
    empty_store: Path, compiled_before: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where general code was compiled before, it has the old number for good: what has the new one is not kept."""
    before = address(anew=True)
    monkeypatch.setattr(layout, "ARMATURE", layout.ARMATURE + 1)
    if compiled_before:
        monkeypatch.setattr(_fingerprint, "changed", lambda _: True)
    assert address(anew=True) not in (before, 0.0)
    assert len(list((empty_store / "compiled").glob("sweeps-*.code"))) == 2 - compiled_before


def test_a_run_and_a_derivative_are_the_same_with_either() -> None:
    case = cases.from_scene(pendulum(), q0=[0.5], v0=[1.0], t_end=2.0)
    reference = engines.load("reference")
    runs: list[Any] = [reference.prepare(case, "compiled", traced=word, rtol=1e-11) for word in ("no", "yes")]
    assert runs[1].system.p[layout.TRACED] != 0.0
    general, own = (run.run() for run in runs)
    np.testing.assert_array_equal(general.q, own.q)
    np.testing.assert_array_equal(general.energy, own.energy)
    A = [linear.linearise(run.system, case.q0, case.v0).A for run in runs]
    np.testing.assert_array_equal(*A)
