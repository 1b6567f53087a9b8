"""The dynamics of a tree against MuJoCo's and Pinocchio's, written apart, on random scenes."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest
from random_scenes import SINGLE, random_scene, random_state

from crossbody.cases import CaseUnsupported
from crossbody.cases.files.case import case_of, rows_of
from crossbody.cases.scene import Scene
from crossbody.engines import load
from crossbody.engines.mujoco import _build as build
from crossbody.reference.tree import mechanism
from crossbody.reference.tree.table import tabulate

SEEDS = range(40)
ROUNDING = 1e-12
"""Of sums of products over a path of a dozen bodies, over the largest of their terms."""


def compiled(scene: Scene) -> Any:
    spec = build.spec_of(scene)
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    spec.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    return build.compiled(spec, scene)


def ours(scene: Scene, q: Any, v: Any, u: Any) -> tuple[Any, Any, Any]:
    table = tabulate(scene)
    M, f, e = np.full((scene.nv, scene.nv), np.nan), np.full(scene.nv, np.nan), np.full(2, np.nan)
    mechanism.dynamics(0.0, q, v, u, table.p, M, f, np.full(table.scratch, np.nan))
    mechanism.energy(q, v, table.p, e)
    return M, f, e


def close(mine: Any, theirs: Any) -> bool:
    return bool(np.abs(np.asarray(mine) - theirs).max() <= ROUNDING * max(1.0, np.abs(theirs).max()))


@pytest.mark.parametrize("seed", SEEDS)
def test_mass_matrix_forces_and_energy_are_those_of_mujoco(seed: int) -> None:
    scene = random_scene(seed)
    model, rng = compiled(scene), np.random.default_rng(seed)
    data = mujoco.MjData(model)
    for _ in range(3):
        q, v, u = random_state(scene, rng)
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, u
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        M, f, e = ours(scene, q, v, u)
        assert close(M, full)
        assert close(f, data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias)
        spared = (model.body_gravcomp * model.body_mass * (data.xipos @ model.opt.gravity)).sum()
        assert close(e, [data.energy[1], data.energy[0] + spared])


@pytest.mark.parametrize("seed", SEEDS)
def test_forces_do_the_work_that_the_energy_says(seed: int) -> None:
    """dT/dt + dV/dt = P_in - P_dissipated along v' = M^-1 f, by complex steps of the kernels."""
    scene = random_scene(seed, types=SINGLE)
    rng, table = np.random.default_rng(seed), tabulate(scene)
    q, v, u = random_state(scene, rng)
    M, f, _ = ours(scene, q, v, u)
    vd, step, e = np.linalg.solve(M, f), 1e-30, np.zeros(2, dtype=complex)
    mechanism.energy(q + 1j * step * v, v + 1j * step * vd, table.p.astype(complex), e)
    power = np.zeros(2)
    mechanism.power(0.0, q, v, u, table.p, power)
    assert close(e.imag.sum() / step, power[0] - power[1])


@pytest.mark.parametrize("seed", SEEDS)
def test_rows_belong_to_their_gaps(seed: int) -> None:
    """H v is the rate of h, and H' v the rate of H v at v' = 0, by complex steps."""
    scene = random_scene(seed, types=SINGLE)
    count = len(rows_of(scene)[0])
    if not count:
        return
    rng, table, step = np.random.default_rng(seed), tabulate(scene), 1e-30
    q, v, u = random_state(scene, rng)
    H, h, Hdv, w = np.zeros((count, scene.nv)), np.zeros(count), np.zeros(count), np.zeros(table.scratch)
    mechanism.dynamics(0.0, q, v, u, table.p, np.zeros((scene.nv, scene.nv)), np.zeros(scene.nv), w)
    mechanism.rows(0.0, q, v, table.p, w, np.arange(count), count, H, h, Hdv)
    moved = [np.zeros(count, dtype=complex) for _ in range(2)]
    mechanism.gaps(0.0, q + 1j * step * v, v.astype(complex), table.p.astype(complex), *moved)
    assert close(moved[0].real, h)
    assert close(moved[0].imag / step, H @ v)
    assert close(moved[1].imag / step, Hdv)


@pytest.mark.parametrize("seed", range(12))
def test_every_engine_says_the_same_physics(seed: int) -> None:
    from crossbody.reports.judging.audit import audit

    scene = random_scene(seed, types=SINGLE)
    case = case_of(scene.replace(loops=()))  # a loop that the start is not on is refused
    theirs = load("reference").prepare(case, "compiled").audit()
    for engine, profile in (("mujoco", "matched"), ("pinocchio", "law")):
        try:
            mine = load(engine).prepare(case, profile).audit()
        except CaseUnsupported as error:
            pytest.fail(str(error))
        for row in audit(mine, theirs, case):
            assert row.ok, (engine, row)
