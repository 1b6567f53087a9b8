"""The soft contact on an axis in MuJoCo: slides side by side, one of them a clock (spec 2.6, 4.2).

Matched: a free body on a slide for every coordinate and the time; pads, controller and sensors act as forces of every
stage, set in the callback that Runge-Kutta visits. Default: boxes, the pads on springs and dampers of their own joints
that the flange carries, with the contact constants, integrator and step that MuJoCo sets.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Case, Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.files.warned import captured
from crossbody.engines import _soft_contact as soft
from crossbody.engines._log import Chart, Modes, charted
from crossbody.engines._soft_contact import NAMES, SoftContact
from crossbody.engines.linear import Spot, same
from crossbody.engines.mujoco._direct import without_regularisation
from crossbody.engines.mujoco._globals import Hook, hooked
from crossbody.engines.mujoco._linear import Stand
from crossbody.engines.mujoco._observe import mass_matrix
from crossbody.engines.mujoco._pairs import LastingPairs, add_pairs
from crossbody.engines.mujoco._scene import Scene

FREE, CONTACT, BALLISTIC = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BALLISTIC)
PADS = NAMES[1:3]
BLOCK = NAMES[3]
GEOMS = tuple((pad, BLOCK) for pad in PADS)
SMALL = 1e-12
"""Part of the jaws' stroke, and of the largest force, that counts as no gap and as no multiplier."""
FASTEST = 1e3
"""Times the speed that the scene can have: a run has diverged."""
ITERATIONS = 20


def why_not(case: Case, profile: str) -> str | None:
    """The rows live as long as the level machine says."""
    if profile == "matched" and case.fsm != "level":
        return f"The soft contact in MuJoCo switches by the machine 'level' and not by {case.fsm!r}."
    return None


def default_step(case: Case, profile: str) -> float:
    """Time step when none is given, s: MuJoCo's own, or 1.5 of the shortest time constant.

    That is a pad's on its finger: 20 kN/m and 30 N s/m on 10 g have poles at -1000 and -2000 1/s, and Runge-Kutta 4 is
    stable up to 2.8 time constants.
    """
    p = soft.soft_contact(case).p
    return 2e-3 if profile == "default" else min(1e-3, 1.5 / soft.fastest(p, p["flange_mass"]))


def build(case: Case, profile: str, dt: float) -> Scene:
    """Compile the model of one profile.

    Raises:
        ValueError: MuJoCo's own, for a model that it refuses.
    """
    own = soft.soft_contact(case)
    return _matched(own, case) if profile == "matched" else _obvious(own, case)


def stand(case: Case, spot: Spot) -> Stand:
    """The matched model at an equilibrium, the clock at its time."""
    scene = _matched(soft.soft_contact(case), case)
    scene.start()
    scene.data.qpos[:], scene.data.qvel[:] = np.append(spot.q, spot.t), np.append(spot.v, 1.0)
    if scene.arm is not None:
        scene.arm(spot.modes(case))
    return Stand(model=scene.model, data=scene.data, chart=same(len(spot.q), more=1), hook=scene.hook)


def _matched(own: SoftContact, case: Case) -> Scene:
    """One pair a row with the case's own law, without the regularisation."""
    spec = _slides(own)
    radius = 0.5 * own.p["width"]
    for name, middle in zip((*PADS, BLOCK), (-radius, radius, 0.0), strict=True):
        kind = mujoco.mjtGeom.mjGEOM_SPHERE
        spec.body(name).add_geom(name=name, type=kind, pos=(middle, 0.0, 0.0), size=(radius, 0.0, 0.0), mass=0.0)
    option = spec.option
    option.integrator, option.solver = mujoco.mjtIntegrator.mjINT_RK4, mujoco.mjtSolver.mjSOL_NEWTON
    option.jacobian, option.iterations, option.tolerance = mujoco.mjtJacobian.mjJAC_DENSE, ITERATIONS, 0.0
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    add_pairs(spec, GEOMS, case.law)
    model = spec.compile()
    without_regularisation(model)
    data = mujoco.MjData(model)
    pairs = _rows(own, case, model, data)
    start = pairs.after(_start(own, case, model, data, np.eye(len(NAMES))))
    hook = pairs.beside(_forces(own, data))
    scene = Scene(
        model=model, data=data, nc=2, start=start, modes=pairs.modes, lam=pairs.lam, safe=_guard(own, data),
        observe=charted(soft.chart, own.observe), chart=soft.chart, instants=soft.instants(own.p, case.t_end),
        hook=hook, always=True,
        arm=pairs.arm(reach=own.sizes[0][0]), margins=pairs.margins, machine="level",
    )  # fmt: skip
    scene.audit = _listed(scene, own, case, np.eye(len(NAMES))) | _listed_rows(scene, pairs)
    return scene


def _obvious(own: SoftContact, case: Case) -> Scene:
    """Boxes; flange and pads are a tree, the pads' springs and dampers and the friction of the table its own."""
    p = own.p
    spec = _slides(own, PADS)
    half = 0.5 * p["width"]
    for name, middle, length in zip((*PADS, BLOCK), (-0.5 * half, 0.5 * half, 0.0), (0.5, 0.5, 1.0), strict=True):
        size = (length * half, half, half)
        spec.body(name).add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_BOX, pos=(middle, 0, 0), size=size, mass=0.0)
        spec.geom(name).condim = 1
    for name, side in zip(PADS, (-1.0, 1.0), strict=True):
        pad = spec.joint(name)
        pad.stiffness[0], pad.damping[0], pad.springref = p["kp"], p["cp"], side * (p["jaw"] + half)
    spec.joint(BLOCK).damping[0] = p["bt"]
    model = spec.compile()
    data = mujoco.MjData(model)
    tree = np.eye(len(NAMES))
    tree[1:3, 0] = 1.0  # pads are counted from the flange
    lam = _multipliers(model, data)

    def modes() -> Modes:
        pairs = zip(own.heights(tree @ data.qpos).tolist(), lam().tolist(), strict=True)
        return tuple(CONTACT if push > 0.0 else FREE if h > 0.0 else BALLISTIC for h, push in pairs)

    scene = Scene(
        model=model, data=data, nc=2, start=_start(own, case, model, data, tree), modes=modes, lam=lam,
        safe=_guard(own, data), observe=charted(_chart(tree), own.observe), chart=_chart(tree),
        hook=_beside(own, data, tree),
    )  # fmt: skip
    scene.audit = _listed(scene, own, case, tree) | {"constants": {"solref": np.array(model.geom_solref[0])}}
    return scene


def _slides(own: SoftContact, carried: tuple[str, ...] = ()) -> Any:
    """A body on a slide along x for every coordinate, without a shape; some are carried by the flange."""
    spec = mujoco.MjSpec()
    spec.option.gravity = (0.0, 0.0, 0.0)
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    for name, mass in zip(NAMES, own.masses.tolist(), strict=True):
        parent = spec.body(NAMES[0]) if name in carried else spec.worldbody
        # No body turns: moments of inertia never act.
        body = parent.add_body(
            name=name, mass=mass, inertia=(mass, mass, mass), ipos=(0.0, 0.0, 0.0), explicitinertial=True
        )
        body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(1.0, 0.0, 0.0))
    return spec


def _rows(own: SoftContact, case: Case, model: Any, data: Any) -> LastingPairs:
    """The two rows, which follow the level machine."""
    q = data.qpos
    reach, force = own.sizes[0][0], own.p["kp"] * (own.p["jaw"] + own.p["squeeze"])
    return LastingPairs(
        model, data, GEOMS, case.law, (SMALL * reach, SMALL * force), gaps=lambda: own.heights(q)
    )  # fmt: skip


def _forces(own: SoftContact, data: Any) -> Hook:
    """Set all forces of this stage."""
    q, v, tau = data.qpos, data.qvel, data.qfrc_applied
    return lambda _model, _data: own.forces(q, v, tau)


def _beside(own: SoftContact, data: Any, tree: Floats) -> Hook:
    """Set what the model's own springs and dampers leave of the forces, in the coordinates q = tree @ qpos."""
    q, v, out, passive, tau = data.qpos, data.qvel, data.qfrc_applied, data.qfrc_passive, np.zeros(len(NAMES))

    def hook(_model: Any, _data: Any) -> None:
        own.forces(tree @ q, tree @ v, tau)
        out[:] = tree.T @ tau - passive

    return hook


def _chart(tree: Floats) -> Chart:
    return lambda q, v: soft.chart(q @ tree.T, v @ tree.T)


def _start(own: SoftContact, case: Case, model: Any, data: Any, tree: Floats) -> Callable[[], None]:
    q0, v0 = (np.linalg.solve(tree, x) for x in own.start(case))

    def start() -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = q0, v0

    return start


def _guard(own: SoftContact, data: Any) -> Callable[[], bool]:
    fastest, rates = FASTEST * own.sizes[1], data.qvel
    return lambda: bool((np.abs(rates) < fastest).all())


def _multipliers(model: Any, data: Any) -> Callable[[], Floats]:
    """Of two boxes: their contacts are summed."""
    pads = {model.geom(name).id: i for i, name in enumerate(PADS)}

    def multipliers() -> Floats:
        lam, contacts = np.zeros(2), data.contact
        for geoms, at in zip(contacts.geom.tolist(), contacts.efc_address.tolist(), strict=True):
            row = pads.get(geoms[0], pads.get(geoms[1]))
            if row is not None and at >= 0:
                lam[row] += data.efc_force[at]
        return lam

    return multipliers


def _looker(scene: Scene, tree: Floats) -> Callable[[Floats, Floats], None]:
    """Evaluates the model at a state of the case, at the time 0, with every row on that can be."""

    def look(q: Floats, v: Floats) -> None:
        scene.start()
        scene.data.qpos[:] = np.linalg.solve(tree, np.append(q, 0.0))
        scene.data.qvel[:] = np.linalg.solve(tree, np.append(v, 1.0))
        if scene.arm is not None:
            scene.arm((CONTACT, CONTACT))
        with captured(), hooked(scene.hook):
            mujoco.mj_forward(scene.model, scene.data)

    return look


def _listed(scene: Scene, own: SoftContact, case: Case, tree: Floats) -> dict[str, Any]:
    """The audit in the case's coordinates: the bodies' masses without those of the controller."""
    model, data, n = scene.model, scene.data, soft.CLOCK
    look, back = _looker(scene, tree), np.linalg.inv(tree)

    def M(q: Floats) -> Floats:
        look(q, np.zeros(n))
        found: Floats = (back.T @ mass_matrix(model, data) @ back)[:n, :n]
        return found

    def bias(q: Floats, v: Floats) -> Floats:
        look(q, v)
        found: Floats = (back.T @ (data.qfrc_bias - data.qfrc_passive - data.qfrc_applied))[:n]
        return found

    def lam(q: Floats, v: Floats) -> Floats:
        look(q, v)
        return np.array(scene.lam())

    return {
        "masses": model.body_mass[1:5].copy(), "gravity": float(np.linalg.norm(model.opt.gravity)), "q0": case.q0,
        "v0": case.v0, "M": M, "bias": bias, "lam": lam,
    }  # fmt: skip


def _listed_rows(scene: Scene, pairs: LastingPairs) -> dict[str, Any]:
    """Rows read back by name: their law, H, and lam without the bound lam >= 0."""
    look = _looker(scene, np.eye(len(NAMES)))

    def H(q: Floats) -> Floats:
        look(q, np.zeros(soft.CLOCK))
        return pairs.entries()[0][:, : soft.CLOCK]

    def lam(q: Floats, v: Floats) -> Floats:
        look(q, v)
        return pairs.entries()[1]

    return {"H": H, "lam": lam, "constants": pairs.constants()}
