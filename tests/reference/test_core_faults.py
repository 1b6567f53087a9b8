"""Faults that a hybrid integrator of this kind can have, each met once and kept out since."""

import os
import signal
import subprocess
import sys
import time
from itertools import count

import numpy as np
import pytest
from mechanisms import ball, flyby, sliders

from crossbody.cases import Outcome
from crossbody.reference import Options, System, kernels, prepare, simulate
from crossbody.reference._run import CompiledRun


def test_ballistic_is_caught_below_the_surface():
    # Pushed down while it leaves: without the second guard it falls through.
    from gusty import gusty

    run = simulate(gusty(1e8, 2e4), [0.01], [-1.0], 0.5, inputs=([0.0, 0.0101], [[0.0], [-2000.0]]))
    assert run.outcome.ok
    assert run.q[:, 0].min() > -1e-3


@pytest.mark.parametrize("a1", [0.0, 1.0])
@pytest.mark.parametrize("n", [5, 40])
def test_touching_sliders_without_damping_end(n, a1):
    run = simulate(sliders(n, a1=a1), np.zeros(n), np.eye(n)[0], 0.2, rtol=1e-8)
    assert run.outcome is Outcome.FINISHED
    assert run.v[-1].sum() == pytest.approx(1.0, abs=1e-9)


def test_many_sliders_apart_pass_the_speed_on():
    n = 60
    run = simulate(sliders(n), 0.01 * np.arange(n), np.eye(n)[0], 0.01 * n + 0.4, rtol=1e-8)
    assert run.outcome is Outcome.FINISHED
    assert run.v[-1] == pytest.approx(np.eye(n)[-1], abs=1e-6)


def test_exact_zero_at_the_end_of_a_bracket():
    # Speed, height and step are powers of two: the gap is exactly 0 at a node.
    run = simulate(ball(gravity=0.0, a2=0.0, a0=1e4), [1.0], [-1.0], 2.0, max_step=0.25, shortcuts=False)
    assert run.events[0].t == pytest.approx(1.0, abs=1e-15)


@kernels.dynamics
def _turns_nan(t, q, v, u, p, M, f, w):
    M[0, 0] = 1.0
    f[0] = -p[0] * q[0]
    if t > 0.5:
        f[0] = np.nan


@kernels.dynamics
def _blows_up(t, q, v, u, p, M, f, w):
    M[0, 0] = 1.0
    f[0] = v[0] * v[0]


@kernels.dynamics
def _loses_mass(t, q, v, u, p, M, f, w):
    M[0, 0] = 1.0 if t < 0.5 else 0.0
    f[0] = 1.0


@pytest.mark.parametrize(
    ("dynamics", "outcomes"),
    [
        (_turns_nan, {Outcome.NOT_FINITE}),
        (_blows_up, {Outcome.DIVERGED, Outcome.NOT_FINITE, Outcome.STEP_TOO_SMALL}),
        (_loses_mass, {Outcome.ILL_POSED, Outcome.NOT_FINITE}),
    ],
)
def test_numerical_failure_is_an_outcome_with_its_place(dynamics, outcomes):
    run = simulate(System(n=1, parameters=[1.0], dynamics=dynamics), [1.0], [1.0], 3.0)
    assert run.outcome in outcomes
    assert "t = " in run.message
    assert "q = " in run.message
    assert np.all(np.isfinite(run.q))


def test_redundant_rows_are_ill_posed():
    @kernels.rows
    def twice(t, q, v, p, w, idx, na, H, h, Hdv):
        for j in range(na):
            H[j, 0] = 1.0
            H[j, 1] = 0.0
            h[j] = q[0]
            Hdv[j] = 0.0

    @kernels.gaps
    def both(t, q, v, p, h, hd):
        h[0] = h[1] = q[0]
        hd[0] = hd[1] = v[0]

    single = flyby(1.0)
    system = System(
        n=2, mass_block=1, parameters=[1.0, 1.0], a0=[1.0, 1.0], a1=2.0, unilateral=False,
        dynamics=single.dynamics, gaps=both, rows=twice,
    )  # fmt: skip
    assert simulate(system, [0.0, 0.0], [0.0, 0.0], 1.0).outcome is Outcome.ILL_POSED


def test_bounds_on_steps_and_time():
    assert simulate(ball(), [1.0], [0.0], 5.0, max_steps=20).outcome is Outcome.STEP_LIMIT
    assert simulate(ball(), [1.0], [0.0], 5.0, max_step=1e-6, time_limit=0.05).outcome is Outcome.TIME_LIMIT


def test_slices_do_not_change_the_result():
    whole, sliced = (prepare(ball(), [1.0], [0.0], Options(t_end=5.0)) for _ in range(2))
    whole.go()
    sliced.start()
    while sliced.slice(3):
        pass
    count = int(whole.state["rows"][0])
    assert np.array_equal(whole.buffers["out"][:count], sliced.buffers["out"][:count])


def test_buffers_grow_without_loss():
    run = simulate(ball(), [1.0], [0.0], 5.0, max_step=1e-3, shortcuts=False)
    assert len(run.t) > 5000
    assert len(run.events) == 7


def test_interrupt_is_answered_at_once():
    code = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler);"  # else it may be ignored
        "sys.path.insert(0, 'tests/support'); from mechanisms import ball;"
        "from crossbody.reference import simulate; simulate(ball(), [1.0], [0.0], 0.1); print('ready', flush=True);"
        "r = simulate(ball(), [1.0], [0.0], 1e4, max_step=1e-5,"
        " max_steps=10**9, samples=[0.0]); print(r.outcome, flush=True)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline().strip() == "ready"
        time.sleep(1.0)
        began = time.perf_counter()
        process.send_signal(signal.SIGINT)
        answer = process.stdout.readline().strip()
        assert answer == "interrupted"
        assert time.perf_counter() - began < 1.0


def test_runs_do_not_remember_each_other():
    run = prepare(ball(), [1.0], [0.0], Options(t_end=5.0))
    first = run.trajectory(*run.go())
    run.warm()
    second = run.trajectory(*run.go())
    assert np.array_equal(first.q, second.q)
    assert first.events == second.events


COUNTED = """
import sys
sys.path.insert(0, 'tests/support')
import numba
from numba.core import compiler
compile_extra, count = compiler.compile_extra, []
compiler.compile_extra = lambda *given, **named: (count.append(given[2].__name__), compile_extra(*given, **named))[1]
from mechanisms import ball
from crossbody.reference import simulate
simulate(ball(), [1.0], [0.0], 5.0)
numba.njit(lambda x: x)(1.0)  # what is compiled is seen
print(*count)
"""


def test_a_second_process_starts_from_the_cache():
    """Nothing is compiled in it."""
    for _ in range(2):
        found = subprocess.run([sys.executable, "-c", COUNTED], check=True, capture_output=True, text=True).stdout
    assert found.split() == ["<lambda>"]


def test_kernels_give_complex_derivatives():
    q = np.array([0.3 + 1e-30j, 0.4], dtype=complex)
    system = flyby(0.2)
    h, hd = np.zeros(1, complex), np.zeros(1, complex)
    system.gaps(0.0, q, np.zeros(2, complex), system.p.astype(complex), h, hd)
    H = system.constraint([0.3, 0.4])[0]
    assert h.imag[0] / 1e-30 == pytest.approx(H[0, 0], rel=1e-15)


@kernels.dynamics
def _still(t, q, v, u, p, M, f, w):
    M[0, 0], f[0] = 1.0, 0.0


@kernels.switch
def _lost_at_once(t, q, v, p, mode, fired):
    return 2 if fired == -1 else 0


def test_a_run_that_is_lost_at_its_start_still_shows_the_start():
    run = simulate(System(n=1, dynamics=_still, switch=_lost_at_once), [0.3], [0.1], 1.0)
    assert run.outcome is Outcome.LOST
    assert run.t.tolist() == [0.0]
    assert run.q.tolist() == [[0.3]]


@pytest.mark.parametrize("call", [1, 5])
def test_interrupt_that_meets_a_library_at_its_work_is_answered(call, monkeypatch):
    """The library enters compiled code by Python of its own, and may swallow what is raised there."""
    given, calls = CompiledRun.slice, count(1)

    def interrupted(run, budget):
        held = signal.getsignal(signal.SIGINT) is not signal.default_int_handler  # not in runs as short as first slices
        if held and next(calls) == call:
            try:
                os.kill(os.getpid(), signal.SIGINT)
                time.sleep(0.0)
            except KeyboardInterrupt:
                raise TypeError("cannot be unboxed") from None
        return given(run, budget)

    monkeypatch.setattr(CompiledRun, "slice", interrupted)
    former = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        run = simulate(ball(), [1.0], [0.0], 1e4, max_step=1e-5, max_steps=10**7, samples=[0.0])
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, former)
    assert run.outcome is Outcome.INTERRUPTED
    assert next(calls) > call
