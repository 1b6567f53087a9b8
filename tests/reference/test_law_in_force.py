"""The law of the rows stays in force, whatever method takes the steps, and a run that leaves it is not finished."""

import numpy as np
import pytest
from rocking_block import HEIGHT, WIDTH, block

from crossbody.cases import Mode, Outcome
from crossbody.reference import Options, System, kernels, prepare, simulate


def law_missing(system, run, inputs=None):
    """Largest |h'' + a1 h' + a0 h + a2 h^3| of the active rows of all rows written, in parts of its largest term.

    v' is M^-1 (f + H^T lam) from the kernels and the lam written: no code of the integrator is used.
    """
    worst = 0.0
    for t, q, v, lam, mode in zip(run.t, run.q, run.v, run.lam, run.mode, strict=True):
        u = None if inputs is None else inputs(t)
        M, f = system.terms(q, v, u, t)
        H, h, drift = system.constraint(q, v)
        active = np.isin(mode, [Mode.CONTACT, Mode.COLLISION, Mode.BILATERAL])
        fast = (mode == Mode.COLLISION) & (np.asarray(system.beta)[:, :2] > 0.0).any(axis=1)
        a0, a1, a2 = np.where(fast[:, None], system.beta, system.alpha).T
        vd = np.linalg.solve(M, f + H.T @ lam)
        terms = np.array([H @ vd, drift, a1 * (H @ v), a0 * h, a2 * h**3])
        size = np.abs(H) @ np.abs(np.linalg.solve(M, f)) + np.abs(H) @ np.abs(np.linalg.solve(M, H.T * lam)).sum(axis=1)
        size += np.abs(terms[1:]).max(axis=0) + 1e-13 * (a0 + a1)
        worst = max(worst, (np.abs(terms.sum(axis=0)) / size)[active].max(initial=0.0))
    return worst


def on_a_corner(tilt, turning=0.0):
    """Block resting on one corner, tilted, that turns about it."""
    side = np.sign(tilt)
    x, z = -side * WIDTH, -HEIGHT
    s, c = np.sin(tilt), np.cos(tilt)
    arm = np.array([x * c - z * s, x * s + z * c])  # from the centre to the corner
    return [0.0, -arm[1], tilt], [turning * arm[1], -turning * arm[0], turning]


STIFF = {"slip": 1e5, "a0": 1e4, "a1": 200.0, "force": 1.0, "torque": 0.3, "damping": 0.1}


@pytest.mark.parametrize("rtol", [1e-5, 1e-8])
def test_implicit_steps_with_frozen_collisions_keep_the_law(rtol):
    """The block rocks on corners that strike at one instant and whose slip rows are stiff."""
    start = on_a_corner(0.3, -0.2)
    system = block(**STIFF)
    default, explicit, other = (
        simulate(system, *start, 0.15, rtol=rtol, **more) for more in ({}, {"implicit": False}, {"solver": "cvode"})
    )
    assert default.outcome.ok, default.message
    assert default.counts["implicit_steps"] > 0
    assert default.q[-1] == pytest.approx(explicit.q[-1], abs=20.0 * rtol)
    assert default.q[-1] == pytest.approx(other.q[-1], abs=20.0 * rtol)
    assert law_missing(system, default) < 1e-9


@pytest.mark.parametrize("solver", ["compiled", "cvode"])
def test_a_held_corner_keeps_its_slip_row_while_the_other_strikes(solver):
    """What an active row prescribes is finite, so that its rate outlasts an impulse: a slip row's as well."""
    width, turning = 0.3, -0.5
    system = block(width=width)
    q0, v0 = [0.0, HEIGHT, 0.0], turning * np.array([-HEIGHT, width, 1.0])
    run = simulate(system, q0, v0, 1e-5, solver=solver, samples=[0.0])
    H, M = system.constraint(q0, v0)[0], system.terms(q0, v0, None, 0.0)[0]
    damping = 0.5 * 2e3 / 1e4
    bounce = np.exp(-2.0 * damping * np.arccos(damping) / np.sqrt(1.0 - damping**2))
    rows = H[[0, 2, 1]]  # the held corner with its slip row, and the one that strikes
    X = np.linalg.solve(M, rows.T)
    after = v0 - (1.0 + bounce) * (H[1] @ v0) * X @ np.linalg.solve(rows @ X, [0.0, 0.0, 1.0])
    assert run.v[0] == pytest.approx(after, abs=1e-9)


@kernels.solve
def _forgets_its_law(t, q, v, u, p, w, law, idx, na, vd, lam, hd):
    vd[0] = -p[1]
    for j in range(na):  # holds the gap's rate instead of following the row's law
        lam[j] = p[0] * p[1]
        hd[j] = v[0]
        vd[0] = 0.0
    return 0


def test_algebra_that_leaves_the_law_of_its_rows_is_not_finished():
    from mechanisms import ball

    right = ball()
    wrong = System(
        n=1, parameters=right.p, a0=right.a0, a1=right.a1, a2=right.a2, dynamics=right.dynamics, gaps=right.gaps,
        rows=right.rows, energy=right.energy, solve=_forgets_its_law,
    )  # fmt: skip
    run = simulate(wrong, [-0.01], [0.0], 1.0)
    assert run.outcome is Outcome.INCONSISTENT
    assert "law of rows [0]" in run.message


def test_a_law_that_is_lost_on_the_way_is_not_finished():
    q0, v0 = on_a_corner(0.3, -0.2)
    q0[1] -= 1e-3  # inside the floor: there is something that the law must do
    run = prepare(block(**STIFF), q0, v0, Options(t_end=0.1, rtol=1e-6))
    run.start()
    assert run.slice(3) == 1
    run.work["law"][:] = 0.0
    assert run.slice(1000) == -7


def random_block(rng):
    """Slip rows that follow, stiff and soft laws, drag and forces that vary; and a start on a corner."""
    fast = 10.0 ** rng.uniform(5, 8)
    system = block(
        slip=10.0 ** rng.uniform(1, 5), a0=10.0 ** rng.uniform(3, 6), a1=10.0 ** rng.uniform(1.5, 3), b0=fast,
        b1=2.0 * rng.uniform(0.1, 1.0) * fast**0.5, force=rng.uniform(0, 2), torque=rng.uniform(-0.3, 0.3),
        rate=rng.uniform(1, 20), drag=rng.uniform(0, 1), damping=rng.uniform(0, 0.2),
    )  # fmt: skip
    return system, on_a_corner(rng.uniform(0.25, 0.35), rng.uniform(-0.3, 0.0))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
def test_random_blocks_follow_their_law_by_every_method(seed):
    """Frozen and resolved collisions."""
    rng = np.random.default_rng(seed)
    system, start = random_block(rng)
    rule = rng.choice(["sequential", "simultaneous", "resolved"])
    runs = [
        simulate(system, *start, 0.12, rtol=1e-8, collisions=rule, **more)
        for more in ({}, {"implicit": False}, {"solver": "cvode"})
    ]
    assert len({run.outcome for run in runs}) == 1, [run.message for run in runs]
    if runs[0].outcome.ok:
        for run in runs:
            assert law_missing(system, run) < 1e-6
        assert runs[0].q[-1] == pytest.approx(runs[1].q[-1], abs=1e-5)
        assert runs[0].q[-1] == pytest.approx(runs[2].q[-1], abs=1e-5)


def outcomes(seed):
    """How random rocking blocks end in every solver; their slip rows may lift a corner that rest presses down."""
    rng = np.random.default_rng(seed)
    system, start = random_block(rng)
    rule = "sequential" if seed % 2 else "simultaneous"
    return [
        simulate(system, *start, 0.8, rtol=1e-7, solver=solver, collisions=rule, max_steps=30_000)
        for solver in ("compiled", "cvode", "ida")
    ]


@pytest.mark.parametrize("seed", [3, 5, 7])
def test_laws_that_contradict_at_a_corner_end_as_a_cycle_in_every_solver(seed):
    """No mode set is consistent: a corner let go is pressed down, and one that is held would pull."""
    runs = outcomes(seed)
    for run in runs:
        assert run.outcome is Outcome.MODE_CYCLE, run.message
        assert run.t[-1] == pytest.approx(runs[0].t[-1], abs=1e-5)
        assert run.steps < 1000


def test_capture_is_judged_by_the_rows_that_still_press():
    """A held corner that a collision lets go no longer presses on the one that collides."""
    first, *others = outcomes(30)
    assert first.outcome.ok, first.message
    for run in others:
        assert [(e.contact, e.after) for e in run.events] == [(e.contact, e.after) for e in first.events]
        assert run.q[-1] == pytest.approx(first.q[-1], abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_random_blocks_end_alike_in_every_solver(seed):
    runs = outcomes(seed)
    assert len({run.outcome for run in runs}) == 1, [run.message for run in runs]
