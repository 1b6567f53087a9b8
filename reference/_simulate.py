"""`simulate`: one motion of one mechanism."""

from __future__ import annotations

from typing import Any, Unpack

import numba.core.config as numba_config
from numpy.typing import ArrayLike

from crossbody.cases import InvalidValue, Trajectory
from crossbody.cases.entry_points import checked_arguments
from crossbody.reference._check import check_once
from crossbody.reference._system import System
from crossbody.reference.options import Chosen, Options, checked
from crossbody.reference.start import check_start


def simulate(system: System, q0: ArrayLike, v0: ArrayLike, t_end: float, **options: Unpack[Chosen]) -> Trajectory:
    """Integrate the hybrid penalty DAE (docs/explanation/model.md) from (q0, v0) at t = 0 to t_end.

    Args:
        system: the mechanism.
        q0: positions at the start (nq,), finite.
        v0: velocities at the start (n,), finite.
        t_end: horizon, s, above 0.
        options: as in `Options`: inputs, rtol, atol, fsm, collisions, solver, samples,
            consistent, ledger, ...

    Returns:
        The motion. Numerical failure is its `outcome`, with place and state in `message`.

    Raises:
        SceneError: if q0 or v0 has another shape or is not finite, if a kernel is wrong there
            (`System.check`), or if the start is off a row that is always on (`Options.consistent`).
        InvalidValue, UnknownName: for an option outside what it admits.
    """
    run = prepare(system, q0, v0, checked(t_end, options))
    motion: Trajectory = run.trajectory(*run.go())
    return motion


@checked_arguments
def prepare(system: System, q0: ArrayLike, v0: ArrayLike, options: Options) -> Any:
    """A run that can be repeated: everything that does not depend on time is decided here."""
    if numba_config.DISABLE_JIT:
        raise InvalidValue("A run needs compiled kernels; NUMBA_DISABLE_JIT in the environment prevents compilation.")
    start = system.checked_state("q0", q0), system.checked_state("v0", v0)
    options.check_friction(system)
    check_once(system, *start, options.t_end)
    check_start(system, *start, options)
    if options.solver == "compiled":
        from crossbody.reference._run import CompiledRun

        return CompiledRun(system, *start, options)
    if system.frictional:
        from crossbody.reference.sundials.friction_run import FrictionRun

        return FrictionRun(system, *start, options)
    from crossbody.reference.sundials.run import SundialsRun

    return SundialsRun(system, *start, options)
