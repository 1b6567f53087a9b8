"""Contacts beside loops in few numbers: sets of modes, dependent rows, rows that loops hold, linear models."""

from __future__ import annotations

import numpy as np
import pytest
from friction_oracle import consistent
from friction_scenes import G, linear, random_problem

from crossbody.cases import Mode, Outcome
from crossbody.reference import System, simulate
from crossbody.reference.linear import linearise, sensitivity


@pytest.mark.parametrize("seed", [pytest.param(s, marks=() if s < 10 else pytest.mark.slow) for s in range(60)])
def test_modes_beside_loops_are_a_set_that_agrees_with_its_forces(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(10):
        H, force, mu, k = random_problem(rng, most=4, rough=1.5)
        l = int(rng.integers(1, 4))  # noqa: E741
        n = len(force) + l
        H, force = np.hstack([H, 0.5 * rng.normal(size=(2 * k, l))]), np.r_[force, rng.normal(size=l)]
        E = rng.normal(size=(l, n)) * 0.6
        sets = consistent(H, force, mu, k, E)
        run = simulate(linear(H, force, mu, k, loops=E), np.zeros(n), np.zeros(n), 1e-6, rtol=1e-6, max_steps=3)
        if run.outcome is Outcome.PAINLEVE:
            assert not sets
            continue
        assert sets
        assert run.outcome is not Outcome.NO_CONSISTENT_MODES, run.message
        assert min(np.abs(run.v[-1] / run.t[-1] - a).max() for a in sets) < 1e-3
        basis = np.linalg.qr(E.T, mode="complete")[0][:, l:]
        free = linear(H @ basis, basis.T @ force, mu, k)
        without = simulate(free, np.zeros(n - l), np.zeros(n - l), 1e-6, rtol=1e-6, max_steps=3)
        assert ("not_unique" in run.counts) == ("not_unique" in without.counts)


@pytest.mark.parametrize("seed", [pytest.param(s, marks=() if s < 10 else pytest.mark.slow) for s in range(60)])
def test_contacts_that_depend_on_each_other_by_loops_alone_do_as_in_coordinates_without(seed: int) -> None:
    """Of unit masses, in an orthonormal basis of what the loops leave: there the contacts have dependent rows."""
    rng = np.random.default_rng(1000 + seed)
    for _ in range(10):
        H, force, mu, k = random_problem(rng, most=4, rough=0.7)
        n, left = len(force), int(rng.integers(1, 2 * k + 1))
        E = rng.normal(size=(n - left, n))
        basis = np.linalg.qr(E.T, mode="complete")[0][:, n - left :]
        H[:k] += 0.8 * (basis @ rng.normal(size=left))  # so that all press on what is left
        force -= 3.0 * basis @ basis.T @ H[:k].sum(axis=0)
        runs = [
            simulate(made_, np.zeros(size), np.zeros(size), 1e-6, rtol=1e-6, max_steps=3)
            for made_, size in (
                (linear(H, force, mu, k, loops=E), n), (linear(H @ basis, basis.T @ force, mu, k), left),
            )
        ]  # fmt: skip
        assert runs[0].outcome is runs[1].outcome
        if runs[0].outcome is Outcome.FINISHED:
            rates = [run.v[-1] / run.t[-1] for run in runs]
            assert np.abs(rates[0] - basis @ rates[1]).max() < 1e-6
            off = [np.isin(run.mode[-1][: 2 * k], (Mode.FREE, Mode.BALLISTIC)) for run in runs]  # by rounding of a gap
            if off[0].tolist() == off[1].tolist():  # or one that the others hold has let go, and moves nothing
                assert runs[0].mode[-1][: 2 * k][~off[0]].tolist() == runs[1].mode[-1][~off[0]].tolist()
                assert runs[0].lam[-1][: 2 * k] == pytest.approx(runs[1].lam[-1], rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_a_contact_that_loops_hold_bears_nothing_and_what_slides_there_is_open(seed: int) -> None:
    """Of a point that is drawn along the surface, and two rows that hold its normal, in axes of no one's."""
    rng = np.random.default_rng(seed)
    axes, mixed = np.linalg.qr(rng.normal(size=(4, 4)))[0], rng.normal(size=(2, 2))
    force, loops = axes[0] - G * axes[1], mixed @ axes[1:3]
    run = simulate(linear(axes[[1, 0]], force, 0.5, 1, loops=loops), np.zeros(4), np.zeros(4), 0.5, rtol=1e-9)
    assert run.outcome is Outcome.FINISHED, run.message
    assert run.v[-1] == pytest.approx(0.5 * axes[0], abs=1e-9)
    assert np.all(run.lam[:, :2] == 0.0)
    on = run.t[run.mode[:, 0] > 0]  # rounding of the gap says when it touches
    assert run.determined_until == pytest.approx(on.min(initial=np.inf), abs=1e-12)
    fixed = linear(axes[[1, 0]], force, 0.5, 1, loops=rng.normal(size=(3, 3)) @ axes[:3])
    run = simulate(fixed, np.zeros(4), np.zeros(4), 0.5, rtol=1e-9)
    assert run.outcome is Outcome.FINISHED, run.message
    assert run.determined_until == np.inf


@pytest.mark.parametrize("gap", [0.0, -1e-15, -1e-13, -1e-11])
def test_a_contact_that_loops_hold_at_its_surface_or_a_rounding_below_it_is_open_alike(gap: float) -> None:
    held = linear([[0.0, 1.0], [1.0, 0.0]], [1.0, -G], 0.5, 1, loops=[[0.0, 1.0]])
    run = simulate(held, np.array([0.0, gap]), np.zeros(2), 0.5, rtol=1e-9)
    assert run.determined_until == 0.0
    assert run.message.startswith("indeterminate: loops hold a contact")
    assert run.v[-1] == pytest.approx([0.5, 0.0], abs=1e-9)


def test_a_contact_that_loops_hold_below_its_surface_is_ill_posed() -> None:
    held = linear([[0.0, 1.0], [1.0, 0.0]], [1.0, -G], 0.5, 1, loops=[[0.0, 1.0]])
    run = simulate(held, np.array([0.0, -0.01]), np.zeros(2), 0.5, rtol=1e-9)
    assert run.outcome is Outcome.ILL_POSED


def on_loops(seed: int, mu: float = 0.3) -> tuple[System, System, np.ndarray, np.ndarray, np.ndarray]:
    """Return a contact that slides beside loops, the same without them, its start there, and the basis of that.

    The rows of the loops are nearly alike, so that the determinant of all rows says nothing of the contact.
    """
    rng = np.random.default_rng(seed)
    E = rng.normal(size=7) + 3e-3 * rng.normal(size=(4, 7))
    basis = np.linalg.qr(E.T, mode="complete")[0][:, 4:]
    H, spring = rng.normal(size=(2, 3)), np.full(7, float(rng.uniform(1.0, 20.0)))
    H[1] -= H[0] * (H[0] @ H[1]) / (H[0] @ H[0])  # friction does not press
    way = H[1] / (H[1] @ H[1])
    force = -10.0 * H[0] / (H[0] @ H[0]) + way
    made_ = linear(H @ basis.T, basis @ force, mu, 1, loops=E, spring=spring)
    return made_, linear(H, force, mu, 1, spring=spring[:3]), -1e-4 * H[0], way, basis


@pytest.mark.parametrize("seed", [1, *(pytest.param(k, marks=pytest.mark.slow) for k in (0, 2, 3, 4, 5))])
def test_linear_models_and_derivatives_of_motions_are_those_without_loops(seed: int) -> None:
    loops, free, q, v, basis = on_loops(seed)
    starts = (loops, basis @ q, basis @ v), (free, q, v)
    both = [
        linearise(one, at, speed, active=[*np.flatnonzero(one.held), 0], sliding=[0]).A for one, at, speed in starts
    ]
    inside = np.kron(np.eye(2), basis)
    assert inside.T @ both[0] @ inside == pytest.approx(both[1], abs=1e-8 * np.abs(both[1]).max())
    moved = [sensitivity(one, at, speed, 1.5) for one, at, speed in starts]
    assert moved[0].jumps
    assert [jump.after for jump in moved[0].jumps] == [jump.after for jump in moved[1].jumps]
    assert inside.T @ moved[0].by_start @ inside == pytest.approx(moved[1].by_start, abs=1e-6)
