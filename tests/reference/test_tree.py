"""The dynamics of a tree against MuJoCo's and Pinocchio's, written apart, on random scenes."""

from __future__ import annotations

import dataclasses
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numba.core import types
from random_scenes import random_scene, random_state
from scenes import BALL, compiled, rows_at

from crossbody.cases import CaseUnsupported, Mode, SceneError
from crossbody.cases.files.case import case_of
from crossbody.cases.files.mjcf import scene_of
from crossbody.cases.scene import Actuator, Body, Joint, Scene, Tendon
from crossbody.cases.scene_contacts import rows_of
from crossbody.engines import load
from crossbody.engines._scene import Forces, Rows
from crossbody.engines.equations import system_of
from crossbody.engines.mujoco import _build as build
from crossbody.engines.pinocchio._coordinates import Coordinates
from crossbody.engines.pinocchio._joined import Strings
from crossbody.engines.pinocchio._model import Gaps, spans, tree
from crossbody.reference.tree import mechanism, quantities, switches
from crossbody.reference.tree.table import tabulate

SEEDS = range(40)
ROUNDING = 1e-12
"""Of sums of products over a path of a dozen bodies, over the largest of their terms."""


def ours(scene: Scene, q: Any, v: Any, u: Any) -> tuple[Any, Any, Any]:
    table = tabulate(scene)
    M, f, e = np.full((scene.nv, scene.nv), np.nan), np.full(scene.nv, np.nan), np.full(2, np.nan)
    mechanism.dynamics(0.0, q, v, u, table.p, M, f, np.full(table.scratch, np.nan))
    quantities.energy(q, v, table.p, e)
    return M, f, e


def rates(scene: Scene, q: Any, v: Any) -> Any:
    qd = np.full(scene.nq, np.nan)
    mechanism.velocity(0.0, q, v, tabulate(scene).p, qd)
    return qd


def close(mine: Any, theirs: Any) -> bool:
    return bool(np.abs(np.asarray(mine) - theirs).max(initial=0.0) <= ROUNDING * np.abs(theirs).max(initial=1.0))


@pytest.mark.parametrize("seed", SEEDS)
def test_mass_matrix_forces_and_energy_are_those_of_mujoco(seed: int) -> None:
    scene = random_scene(seed)
    model, rng = compiled(scene), np.random.default_rng(seed)
    data = mujoco.MjData(model)
    for _ in range(3):
        q, v, u = random_state(scene, rng)
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, u[: model.nu]
        mujoco.mj_forward(model, data)
        pushed = np.zeros(model.nv)
        for push, force in zip(scene.pushes, u[model.nu :].reshape(-1, 3), strict=True):
            i = model.body(push.body).id
            mujoco.mj_applyFT(model, data, force, np.zeros(3), data.xipos[i], i, pushed)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        M, f, e = ours(scene, q, v, u)
        assert close(M, full)
        assert close(f, data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias + pushed)
        spared = (model.body_gravcomp * model.body_mass * (data.xipos @ model.opt.gravity)).sum()
        assert close(e, [data.energy[1], data.energy[0] + spared])


@pytest.mark.parametrize("seed", SEEDS)
def test_forces_do_the_work_that_the_energy_says(seed: int) -> None:
    """dT/dt + dV/dt = P_in - P_dissipated along v' = M^-1 f, by complex steps of the kernels."""
    scene = random_scene(seed)
    rng, table = np.random.default_rng(seed), tabulate(scene)
    q, v, u = random_state(scene, rng)
    M, f, _ = ours(scene, q, v, u)
    vd, step, e = np.linalg.solve(M, f), 1e-30, np.zeros(2, dtype=complex)
    quantities.energy(q + 1j * step * rates(scene, q, v), v + 1j * step * vd, table.p.astype(complex), e)
    power = np.zeros(2)
    quantities.power(0.0, q, v, u, table.p, power)
    assert close(e.imag.sum() / step, power[0] - power[1])


def _constants(kernel: Any) -> str:
    """Return the names of the constants of all functions that a kernel is put together from."""
    (result,) = (one for args, one in kernel.overloads.items() if types.complex128[::1] not in args)
    return " ".join(one.name for one in result.library._get_module_for_linking().global_variables)


@pytest.mark.parametrize("paired", [False, True])
def test_only_scenes_whose_shapes_may_meet_compile_how_they_do(paired: bool) -> None:
    system, made = system_of(case_of(BALL.replace(pairs=BALL.pairs * paired))), quantities.row_kernels(paired)
    assert (system.gaps, system.rows) == (made["gaps"], made["rows"])
    kernels = [*made.values(), switches.switching_kernels(paired)["switch"]]
    assert {"pair_rows5touch" in _constants(kernel) for kernel in kernels} == {paired}


@pytest.mark.parametrize("paired", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_rows_belong_to_their_gaps(seed: int, paired: bool) -> None:
    """H v is the rate of h, and H' v the rate of H v at v' = 0, by complex steps."""
    scene = random_scene(seed)
    scene = scene if paired else scene.replace(pairs=())
    count = len(rows_of(scene)[0])
    if not count:
        return
    rng, table, step = np.random.default_rng(seed), tabulate(scene), 1e-30
    q, v, _ = random_state(scene, rng)
    H, h, Hdv = np.zeros((count, scene.nv)), np.zeros(count), np.zeros(count)
    w = np.zeros(table.scratch)
    still = np.zeros(len(scene.inputs))
    mechanism.dynamics(0.0, q, v, still, table.p, np.zeros((scene.nv, scene.nv)), np.zeros(scene.nv), w)
    rows, gaps = (quantities.row_kernels(paired)[name] for name in ("rows", "gaps"))
    rows(0.0, q, v, table.p, w, np.arange(count), count, H, h, Hdv)
    moved = [np.zeros(count, dtype=complex) for _ in range(2)]
    gaps(0.0, q + 1j * step * rates(scene, q, v), v.astype(complex), table.p.astype(complex), *moved)
    assert close(moved[0].real, h)
    assert close(moved[0].imag / step, H @ v)
    assert close(moved[1].imag / step, Hdv)


def drift_of(model: Any, row: Any, q: Any, v: Any) -> Any:
    """H' v by what MuJoCo's rows (h, H) are at two instants of a motion."""
    step, ends = 1e-6, [np.array(q), np.array(q)]
    mujoco.mj_integratePos(model, ends[0], v, step)
    mujoco.mj_integratePos(model, ends[1], v, -step)
    return (row(ends[0], v)[1] - row(ends[1], v)[1]) @ v / (2.0 * step)


@pytest.mark.parametrize("seed", SEEDS)
def test_loops_are_those_of_mujoco(seed: int) -> None:
    """Gaps and rows; H'v by what MuJoCo's rows are at two instants of a motion."""
    scene = random_scene(seed)
    if not scene.loops:
        return
    model = build.compiled(build.spec_of(scene), scene)
    data, count = mujoco.MjData(model), sum(loop.width for loop in scene.loops)
    turns = np.concatenate([np.arange(loop.width) >= 3 for loop in scene.loops])

    def look(q: Any, v: Any) -> tuple[Any, Any]:
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        h, J = np.array(data.efc_pos[:count]), np.array(data.efc_J).reshape(-1, model.nv)[:count]
        # Of the two quaternions of a turn MuJoCo takes the one that those of the bodies give.
        signs = np.where(turns & (h[turns] @ mine[turns] < 0.0), -1.0, 1.0)
        return signs * h, signs[:, None] * J

    q, v, u = random_state(scene, np.random.default_rng(seed))
    H, mine, Hdv = (part[:count] for part in rows_at(scene, q, v, u))
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    if data.ne < count:
        return  # MuJoCo leaves out rows that nothing moves
    h, J = look(q, v)
    assert close(mine, h)
    assert close(H, J)
    moved = drift_of(model, look, q, v)
    assert np.abs(moved - Hdv).max() <= 1e-7 * max(1.0, np.abs(Hdv).max())


@pytest.mark.parametrize("seed", SEEDS)
def test_couplings_are_those_of_the_engines(seed: int) -> None:
    scene = random_scene(seed)
    scene = scene.replace(loops=tuple(loop for loop in scene.loops if not loop.in_space), pairs=(), shapes=())
    if not scene.loops:
        return
    rows = Rows(scene, Forces(scene))
    q, v, u = random_state(scene, np.random.default_rng(seed))
    H, h, Hdv = rows_at(scene, q, v, u)
    for mine, theirs in ((h, rows.heights(q)), (H, rows.jacobian(q)), (Hdv, rows.drift(q, v))):
        count = sum(loop.width for loop in scene.loops)
        assert close(mine[:count], theirs[:count])


@pytest.mark.parametrize("seed", SEEDS)
def test_rows_are_those_of_pinocchio_in_their_order(seed: int) -> None:
    """Of all kinds together, whichever are asked for: contacts of several places too."""
    scene, rng = random_scene(seed), np.random.default_rng(seed)
    to, (model, placed), forces = Coordinates(scene), tree(scene), Forces(scene)
    forces.spans = spans(scene, model, placed, to)
    theirs = Gaps(scene, forces, (model, placed), to)
    q, v, u = random_state(scene, rng)
    H, h, Hdv = rows_at(scene, q, v, u)
    if not len(h):
        return
    r = to.theirs(q)
    their = to.back(r, v)
    assert close(theirs.heights(r), h)
    for chosen in (slice(None), *(sorted(rng.permutation(len(h))[:k].tolist()) for k in (0, 1, 2, 5, 9))):
        gaps, rows = theirs.gradient_of(r, chosen)
        assert close(gaps, h[chosen])
        assert close(to.velocities(r, rows), H[chosen])
        # Their H' v is at rest of their velocities, of which those of free joints turn with the body.
        drift = theirs.drift_of(r, their, chosen) - H[chosen] @ to.bend(r, their)
        off = np.abs(drift - Hdv[chosen]).max(initial=0.0)
        assert off <= 1e-8 * max(1.0, np.abs(Hdv).max())  # contacts by differences


@pytest.mark.parametrize("seed", SEEDS)
def test_distances_of_points_are_those_of_the_engines(seed: int) -> None:
    scene = random_scene(seed)
    ropes = tuple(tendon for tendon in scene.tendons if tendon.bodies)
    if not ropes:
        return
    scene = scene.replace(tendons=ropes, loops=(), pairs=(), shapes=(), actuators=(), joints=tuple(
        dataclasses.replace(joint, range=(-np.inf, np.inf)) for joint in scene.joints))  # fmt: skip
    q, v, u = random_state(scene, np.random.default_rng(seed))
    H, h, Hdv = rows_at(scene, q, v, u)
    to, (carried, placed) = Coordinates(scene), tree(scene)
    strings, r = Strings(carried, placed, ropes), to.theirs(q)
    their = to.back(r, v)
    assert close(strings.heights(r), h)
    assert close(to.velocities(r, strings.gradients(r)[1]), H)
    assert close(strings.drift(r, their) - H @ to.bend(r, their), Hdv)
    model = build.compiled(build.spec_of(scene), scene)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(model, data)
    assert close(h, [data.ten_length[0] - 0.11, 0.19 - data.ten_length[0]])


@pytest.mark.parametrize("seed", SEEDS)
def test_bounds_of_ball_joints_are_those_of_mujoco(seed: int) -> None:
    """Gap and row; H'v by what MuJoCo's row is at two instants of a motion."""
    scene = random_scene(seed).replace(loops=(), tendons=(), pairs=(), shapes=(), actuators=())
    scene = scene.replace(joints=tuple(
        dataclasses.replace(joint, range=(0.0, 0.1) if joint.type == "ball" else (-np.inf, np.inf))
        for joint in scene.joints))  # fmt: skip
    if not any(joint.limited for joint in scene.joints):
        return
    model = build.compiled(build.spec_of(scene), scene)
    data, rng = mujoco.MjData(model), np.random.default_rng(seed)

    def row(q: Any, v: Any) -> tuple[Any, Any]:
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        return np.array(data.efc_pos - data.efc_margin), np.array(data.efc_J).reshape(-1, model.nv)

    for _ in range(5):
        q, v, u = random_state(scene, rng)
        H, h, Hdv = rows_at(scene, q, v, u)
        theirs, J = row(q, v)
        assert close(h, theirs)
        assert close(H, J)
        moved = drift_of(model, row, q, v)
        assert np.abs(moved - Hdv).max() <= 1e-6 * max(1.0, np.abs(Hdv).max())


SITES = """
<mujoco><worldbody>
  <body pos="0 0 1"><freejoint/><geom size=".1"/><site name="a" pos=".1 .2 .3" euler="20 30 40"/></body>
  <body pos="0 1 1"><joint type="ball"/><geom size=".1" pos=".1 0 0"/><site name="b" pos="0 .2 -.3" euler="50 -30 10"/>
  </body>
</worldbody><equality><{kind} site1="a" site2="b"/></equality></mujoco>
"""


@pytest.mark.parametrize("kind", ["connect", "weld"])
def test_loops_of_sites_are_those_of_their_bodies(kind: str) -> None:
    """The same gap and the same rows, but for the axes in which the turn between the sites is said."""
    model = mujoco.MjModel.from_xml_string(SITES.format(kind=kind))
    data, scene, rng = mujoco.MjData(model), scene_of(model), np.random.default_rng(3)
    for _ in range(5):
        q, v, u = random_state(scene, rng)
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        J, their = np.array(data.efc_J).reshape(-1, model.nv)[: data.ne], np.array(data.efc_pos[: data.ne])
        H, h, _ = rows_at(scene, q, v, u)
        assert close(H[:3], J[:3])
        assert close(h[:3], their[:3])
        assert close(H[3:].T @ H[3:], J[3:].T @ J[3:])
        assert close(H[3:].T @ h[3:], J[3:].T @ their[3:])


@pytest.mark.parametrize("seed", range(12))
def test_every_engine_says_the_same_physics(seed: int) -> None:
    from crossbody.reports.judging.audit import audit

    scene = random_scene(seed)
    case = case_of(scene.replace(loops=()))  # a loop that the start is not on is refused
    theirs = load("reference").prepare(case, "compiled").audit()
    for engine, profile in (("mujoco", "matched"), ("pinocchio", "law")):
        try:
            mine = load(engine).prepare(case, profile).audit()
        except CaseUnsupported as error:
            pytest.fail(str(error))
        for row in audit(mine, theirs, case):
            assert row.ok, (engine, row)


def test_what_is_fixed_to_the_world_has_its_weight_in_every_engine() -> None:
    inertia = (0.1, 0.1, 0.1, 0.0, 0.0, 0.0)
    scene = Scene(
        bodies=(
            Body(name="base", position=(0.0, 0.0, 0.5), mass=3.0, com=(0.1, 0.2, 0.3), inertia=inertia),
            Body(name="rod", parent="base", mass=1.0, com=(0.0, 0.0, -0.5), inertia=inertia),
        ),
        joints=(Joint(name="hinge", body="rod", type="hinge", axis=(0.0, 1.0, 0.0)),),
    )
    case = case_of(scene, q0=[1.0], t_end=0.01)
    wanted = 9.81 * (3.0 * 0.8 + 0.5 - 0.5 * np.cos(1.0))
    for engine, profile in (("reference", "compiled"), ("mujoco", "matched"), ("pinocchio", "law")):
        run = load(engine).prepare(case, profile).run()
        assert run.energy[0, 1] == pytest.approx(wanted, rel=1e-12), engine


@pytest.mark.parametrize("seed", SEEDS)
def test_rates_of_positions_are_those_of_mujoco(seed: int) -> None:
    """q' against the difference of positions that MuJoCo integrates; quaternions keep their length to first order."""
    scene = random_scene(seed)
    model, step = compiled(scene), 1e-6
    q, v, _ = random_state(scene, np.random.default_rng(seed))
    ahead, behind = np.array(q), np.array(q)
    mujoco.mj_integratePos(model, ahead, v, step)
    mujoco.mj_integratePos(model, behind, v, -step)
    assert np.abs(rates(scene, q, v) - (ahead - behind) / (2.0 * step)).max() <= 1e-8 * np.abs(v).max()


@pytest.mark.parametrize("seed", SEEDS)
def test_coordinates_of_pinocchio_lead_there_and_back(seed: int) -> None:
    """There and back is the identity, power is the same, and v' of aba is that of our equations through the map."""
    scene = random_scene(seed)
    scene = scene.replace(loops=(), tendons=(), actuators=tuple(a for a in scene.actuators if a.joint))
    case, rng = case_of(scene), np.random.default_rng(seed)
    rows = load("pinocchio").prepare(case, "law").scene.rows
    to = Coordinates(scene)
    q, v, _ = random_state(scene, rng)
    r = to.theirs(q)
    u, tau = to.back(r, v), rng.normal(size=scene.nv)
    assert close(to.ours(r), q)
    assert close(to.velocities(r, u), v)
    assert close(to.back(r, tau) @ u, tau @ v)
    free = tuple(int(Mode.FREE) for _ in range(rows.nc))
    vd = to.velocities(r, rows.accelerate(r, u, free)[0]) + to.bend(r, u)
    M, f, _ = ours(scene, q, v, np.zeros(len(scene.inputs)))
    assert np.abs(vd - np.linalg.solve(M, f)).max() <= 1e-10 * np.abs(vd).max()
    ahead, behind, step = r.copy(), r.copy(), 1e-6
    for place, sign in ((ahead, 1.0), (behind, -1.0)):
        place[:] = pin.integrate(rows.model, r, sign * step * u)
    assert np.abs(to.rates(r, u) - (ahead - behind) / (2.0 * step)).max() <= 1e-8 * np.abs(u).max()


@pytest.mark.parametrize(
    ("joint", "actuator", "said"),
    [
        ({"type": "free", "stiffness": (1.0, 0.0, 0.0)}, {}, "springs of a free joint"),
        ({"type": "ball"}, {"bias": (0.0, -3.0, 0.0)}, "length"),
        ({"type": "free", "range": (0.0, 1.0)}, {}, "a free joint has no bounds"),
        ({"type": "ball", "range": (0.0, 0.01), "margin": 0.01}, {}, "largest angle"),
        ({"type": "ball", "range": (0.5, 1.0)}, {}, "largest angle"),
    ],
)
def test_what_turns_and_is_not_done_is_refused(joint: dict[str, Any], actuator: dict[str, Any], said: str) -> None:
    body = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))
    actuators = (Actuator(name="a", joint="j", gear=(1.0, 0.0, 0.0), **actuator),) if actuator else ()
    with pytest.raises(SceneError, match=said):
        tabulate(Scene(bodies=(body,), joints=(Joint(name="j", body="b", **joint),), actuators=actuators))


def test_points_of_a_string_may_meet() -> None:
    """Nothing acts along it there: the energy is known, though the string has no direction."""
    body = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))
    string = Tendon(name="s", bodies=("", "b"), positions=((0.0, 0.0, 0.0),) * 2, range=(-np.inf, 0.3))
    scene = Scene(bodies=(body,), joints=(Joint(name="j", body="b", type="slide"),), tendons=(string,))
    M, f, e = ours(scene, np.zeros(1), np.ones(1), np.zeros(0))
    assert np.isfinite([*M.ravel(), *f, *e]).all()
