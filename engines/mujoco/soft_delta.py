"""The soft contact on the delta robot in MuJoCo: the tree with its loops, and slides beside it (spec 2.6, 3.8, 4.2).

Matched: pads, sensors and controller act as forces of every stage, as on the axis; loops and pairs follow the case's
law. Default: the loops, contacts, integrator and step that MuJoCo sets; the pads' springs and dampers are those of
their own joints, as far as they do not depend on the flange.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Case, Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.files.warned import captured
from crossbody.engines import _soft_contact as soft
from crossbody.engines._log import charted
from crossbody.engines._soft_delta import (
    AXES,
    HINGES,
    LOOPS,
    NV,
    SLIDERS,
    SoftDelta,
    joined,
    linear,
    of_case,
    rows_of_case,
    small_motions,
    soft_delta,
)
from crossbody.engines.linear import Spot
from crossbody.engines.mujoco._delta_model import FLAGS, text
from crossbody.engines.mujoco._direct import law_of, without_regularisation
from crossbody.engines.mujoco._globals import Hook, hooked
from crossbody.engines.mujoco._linear import Stand
from crossbody.engines.mujoco._observe import mass_matrix
from crossbody.engines.mujoco._pairs import LastingPairs, Pairs, add_pairs
from crossbody.engines.mujoco._scene import Scene
from crossbody.engines.mujoco.soft_contact import ITERATIONS, SMALL
from crossbody.engines.mujoco.soft_contact import why_not as why_not

HELD = (int(Mode.BILATERAL),) * LOOPS
FREE, CONTACT = int(Mode.FREE), int(Mode.CONTACT)
PADS, BLOCK = ("left pad", "right pad"), "block"
GEOMS = ((PADS[0], BLOCK), (PADS[1], BLOCK), ("table", BLOCK))
WIDE = 1.0
"""Half the height and depth of a pad's face, m: only its distance along x counts."""
FASTEST = 1e6
"""Rate at which a run has diverged."""


def default_step(case: Case, profile: str) -> float:
    """Time step when none is given, s: MuJoCo's own, or 1.5 of the shortest time constant, as on the axis."""
    own = soft_delta(case)
    return 2e-3 if profile == "default" else min(1e-3, 1.5 / soft.fastest(own.p, own.p["m3"]))


def build(case: Case, profile: str, dt: float) -> Scene:
    """Compile the model of one profile.

    Raises:
        ValueError: MuJoCo's own, for a model that it refuses.
        SceneError: for a start that does not close the loops.
    """
    own = soft_delta(case)
    return _matched(own, case) if profile == "matched" else _obvious(own, case)


def stand(case: Case, spot: Spot) -> Stand:
    """The matched model at an equilibrium, the clock at its time."""
    scene = _matched(soft_delta(case), case)
    scene.start()
    scene.data.qpos[:], scene.data.qvel[:] = joined(spot.q, spot.v, spot.t)
    if scene.arm is not None:
        scene.arm(spot.modes(case))
    return Stand(model=scene.model, data=scene.data, chart=small_motions(scene.data.qpos), hook=scene.hook)


def _matched(own: SoftDelta, case: Case) -> Scene:
    """One pair a row with the case's own law, without the regularisation."""
    spec = mujoco.MjSpec.from_string(text(own.robot, case.law))
    _beside(spec, own)
    spec.option.iterations = ITERATIONS
    add_pairs(spec, GEOMS, own.law)
    model = spec.compile()
    model.opt.disableflags |= FLAGS
    without_regularisation(model)
    data = mujoco.MjData(model)
    q, reach = data.qpos, own.p["jaw"] + own.p["squeeze"]
    small = SMALL * reach, SMALL * own.p["kp"] * reach
    pairs = LastingPairs(model, data, GEOMS, own.law, small, gaps=lambda: own.heights(q))
    scene, arm = _scene(own, case, model, data, pairs), pairs.arm(reach)
    scene.start, scene.hook, scene.machine = pairs.after(scene.start), pairs.beside(_forces(own, data)), "level"
    scene.arm = lambda modes: arm(modes[LOOPS:])
    scene.margins = lambda: [(0.0, 0.0)] * LOOPS + pairs.margins()
    scene.audit = _listed(scene, own, case) | _listed_rows(scene, own, case, pairs)
    return scene


def _obvious(own: SoftDelta, case: Case) -> Scene:
    """Loops and contacts as they come; the damper of a pad is its joint's, and implicit."""
    spec = mujoco.MjSpec.from_string(text(own.robot, None))
    _beside(spec, own)
    for pad in PADS:
        spec.joint(f"{pad} 0").damping[0] = own.p["cp"]
    add_pairs(spec, GEOMS, None)
    model = spec.compile()
    data = mujoco.MjData(model)
    q = data.qpos
    pairs = Pairs(model, data, GEOMS, own.law, (0.0, 0.0), gaps=lambda: own.heights(q))
    scene = _scene(own, case, model, data, pairs)
    scene.audit = _listed(scene, own, case) | {"constants": {"solref": np.array(model.pair_solref[0])}}
    return scene


def _beside(spec: Any, own: SoftDelta) -> None:
    """Bodies on slides, the faces of the pads, the block as a ball of its width, and the table."""
    half = 0.5 * own.p["width"]
    height = own.p["table"] - half
    for (name, count), mass in zip(SLIDERS.items(), own.bodies, strict=True):
        # No body turns: moments of inertia never act. A gravity along z acts on the block alone.
        body = spec.worldbody.add_body(
            name=name, mass=mass, inertia=(mass, mass, mass), ipos=(0.0, 0.0, 0.0), explicitinertial=True
        )
        for k in range(count):
            body.add_joint(name=f"{name} {k}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=AXES[k])
    for pad, side in zip(PADS, (-half, half), strict=True):
        kind, size = mujoco.mjtGeom.mjGEOM_BOX, (half, WIDE, WIDE)
        spec.body(pad).add_geom(name=pad, type=kind, pos=(side, 0.0, height), size=size, mass=0.0)
    spec.body(BLOCK).add_geom(name=BLOCK, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(half, 0.0, 0.0), mass=0.0)
    kind, place = mujoco.mjtGeom.mjGEOM_PLANE, (0.0, 0.0, own.p["table"])
    spec.worldbody.add_geom(name="table", type=kind, pos=place, zaxis=(0.0, 0.0, -1.0), size=(WIDE, WIDE, 1.0))


def _scene(own: SoftDelta, case: Case, model: Any, data: Any, pairs: Pairs) -> Scene:
    """What both profiles share; no row opens or closes by the level machine yet."""
    q0, v0 = own.start(case)
    rates = data.qvel

    def start() -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = q0, v0

    return Scene(
        model=model, data=data, nc=LOOPS + len(GEOMS), start=start, hook=_forces(own, data), always=True,
        modes=lambda: HELD + pairs.modes(),
        lam=lambda: np.append(data.efc_force[:LOOPS], pairs.lam()),
        safe=lambda: bool((np.abs(rates) < FASTEST).all()),
        observe=charted(of_case, own.observe), chart=of_case, instants=own.instants(case.t_end),
    )  # fmt: skip


def _forces(own: SoftDelta, data: Any) -> Hook:
    """Set what the model's own dampers leave of the forces of this stage."""
    q, v, out, passive, tau = data.qpos, data.qvel, data.qfrc_applied, data.qfrc_passive, np.zeros(NV)

    def hook(_model: Any, _data: Any) -> None:
        own.forces(q, v, tau)
        out[:] = tau - passive

    return hook


def _look(scene: Scene, q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Evaluate the model at a state of the case, at the time 0, with every row on that can be; the model's state."""
    data = scene.data
    scene.start()
    data.qpos[:], data.qvel[:] = at = joined(q, v, 0.0)
    if scene.arm is not None:
        scene.arm(HELD + (CONTACT,) * len(GEOMS))
    with captured(), hooked(scene.hook):
        mujoco.mj_forward(scene.model, data)
    return at


def _listed(scene: Scene, own: SoftDelta, case: Case) -> dict[str, Any]:
    """The audit in the case's coordinates: the bodies' masses without those of the controller."""
    model, data, still = scene.model, scene.data, np.zeros(len(case.q0))

    def terms(q: Floats, v: Floats) -> tuple[Floats, Floats]:
        at = _look(scene, q, v)
        return linear(*at, mass_matrix(model, data), data.qfrc_bias - data.qfrc_passive - data.qfrc_applied)

    def lam(q: Floats, v: Floats) -> Floats:
        _look(scene, q, v)
        return np.array(scene.lam())

    beside = [model.body_mass[model.body(name).id] for name in (*PADS, BLOCK)]
    return {
        "masses": np.append(model.body_mass[2 : 2 + HINGES], beside), "q0": case.q0, "v0": case.v0,
        "gravity": float(np.linalg.norm(model.opt.gravity)),
        "M": lambda q: terms(q, still)[0], "bias": lambda q, v: terms(q, v)[1], "lam": lam,
    }  # fmt: skip


def _listed_rows(scene: Scene, own: SoftDelta, case: Case, pairs: LastingPairs) -> dict[str, Any]:
    """Rows read back by name: their law, H, and lam without the bound lam >= 0."""
    data = scene.data

    def H(q: Floats) -> Floats:
        at, _ = _look(scene, q, np.zeros(len(q)))
        return rows_of_case(at, np.vstack((np.array(data.efc_J).reshape(-1, NV)[:LOOPS], pairs.entries()[0])))

    def lam(q: Floats, v: Floats) -> Floats:
        _look(scene, q, v)
        return np.append(data.efc_force[:LOOPS], pairs.entries()[1])

    loops = np.repeat([law_of(row) for row in scene.model.eq_solref], 3, axis=0).T
    own_rows = pairs.constants()
    constants = {name: np.append(loops[i], own_rows[name]) for i, name in enumerate(("a0", "a1"))}
    return {"H": H, "lam": lam, "constants": constants | {"a2": np.zeros(scene.nc)}}
