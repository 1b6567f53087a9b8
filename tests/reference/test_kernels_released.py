"""A system that is deleted takes its kernels, and what was compiled from them, with it."""

from __future__ import annotations

import gc
import resource
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crossbody.reference import Options, System, ensemble, kernels, prepare
from crossbody.reference.systems import ball


def _system(offset: float) -> System:
    """A ball under a force of its own, compiled anew."""

    @kernels.dynamics
    def dynamics(t: float, q: Any, v: Any, u: Any, p: Any, M: Any, f: Any, w: Any) -> None:
        M[0, 0], f[0] = p[0], offset - p[0] * p[1]

    fields = ball.KERNELS | {"dynamics": dynamics}
    return System(n=1, parameters=[1.0, 9.81], a0=[1e4], a1=20.0, **fields)


def _used(system: System, how: str) -> list[weakref.ref[Any]]:
    """Run a system; what must go with it."""
    if how == "ensemble":
        ensemble(system, np.ones((2, 1)), np.zeros((2, 1)), 0.1, threads=1)
    else:
        run = prepare(system, [1.0], [0.0], Options(t_end=0.5, solver=how))
        run.warm()
        run.go()
    return [weakref.ref(system), weakref.ref(system.dynamics), weakref.ref(system.dynamics.py_func)]


@pytest.mark.parametrize("how", ["compiled", "cvode", "ida", "ensemble"])
def test_a_deleted_system_goes_with_its_kernels(how: str) -> None:
    left = _used(_system(0.1), how)
    gc.collect()
    assert not any(ref() for ref in left)


@pytest.mark.bench
@pytest.mark.parametrize("how", ["compiled", "cvode"])
def test_machine_code_that_llvm_keeps_is_small(how: str) -> None:
    """Of a deleted system LLVM keeps what it allocated in the process: told, and bounded."""
    _used(_system(-1.0), how)
    before = _resident()
    for i in range(20):
        _used(_system(0.1 * i), how)
        gc.collect()
    each = (_resident() - before) / 20
    print(f"\n{how}: {each:.1f} MB stay of a deleted system")
    assert each < 4.0


def _resident() -> float:
    """Memory of this process, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6
