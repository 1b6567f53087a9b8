"""Equilibria that `trim` returns can be linearised with their rows held, whatever the units and stiffness."""

import numpy as np
import pytest
from linear_rows import linear_rows

from crossbody.cases import SceneError
from crossbody.reference.linear import linearise, trim


@pytest.mark.parametrize("seed", range(40))
def test_rows_are_held_at_every_equilibrium(seed):
    """Random masses over twelve decades; rows may hold every coordinate, so that nothing but rounding is left."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    na = int(rng.integers(1, n + 1))
    root = rng.normal(size=(n, n))
    system = linear_rows(
        (root @ root.T + 0.1 * np.eye(n)) * 10.0 ** rng.uniform(-6, 6), rng.normal(size=(na, n)), np.zeros(na),
        10.0 ** rng.uniform(0, 8), 10.0, g=1e-3 * rng.normal(size=n), K=rng.uniform() * np.eye(n),
        B=rng.normal(size=(n, 2)), unilateral=False,
    )  # fmt: skip
    held = trim(system, np.zeros(n), free=range(n))
    model = linearise(system, held.q, u=held.u, reduce=True)
    assert len(model.states) == 2 * (n - na)
    assert np.isfinite(model.poles()).all()


def test_a_condition_that_the_motion_leaves_is_still_refused():
    system = linear_rows(np.eye(2), [[1.0, 0.0]], [0.0], 1e8, 10.0, B=[[1.0], [1.0]], unilateral=False)
    model = linearise(system, [0.0, 0.0])
    with pytest.raises(SceneError, match="leaves the subspace"):
        model.restricted([[0.0, 1.0, 0.0, 0.0]])
