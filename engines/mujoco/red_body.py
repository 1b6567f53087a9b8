"""The red body in MuJoCo: two bodies on two slides and a hinge each, in the plane x, y (spec 2.5, 4.2).

Matched: every corner and foot is a small sphere about its point and every surface lies deeper by the radius, so that
the distance is the case's gap and its Jacobian the case's H. Default: two boxes on feet, with the contact constants,
integrator and step that MuJoCo sets, without friction.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Case, Mode
from crossbody.cases.arrays import Floats
from crossbody.engines import _red_body
from crossbody.engines._log import Modes
from crossbody.engines._real_time import one_set
from crossbody.engines._red_body import ROWS, RedBody
from crossbody.engines.mujoco._audit import audit
from crossbody.engines.mujoco._direct import without_regularisation
from crossbody.engines.mujoco._pairs import add_pairs
from crossbody.engines.mujoco._scene import Scene
from crossbody.engines.mujoco._two_sets import TwoSets

FREE, CONTACT, BALLISTIC = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BALLISTIC)
GEOMS = (("floor", "row 0"), ("floor", "row 1"), ("slab", "row 2"), ("slab", "row 3"), ("wall", "row 4"))
"""What each row holds apart, matched."""
SMALL = 1e-10
"""Part of a collision's depth that counts as no gap, and ten times of its multiplier as none."""
FASTEST = 1e3
"""Times the speed that the scene can have: a run has diverged."""
ITERATIONS = 20


def default_step(case: Case, profile: str) -> float:
    """Time step when none is given, s: MuJoCo's own, or twenty in half a period of the fastest row."""
    return 2e-3 if profile == "default" else min(1e-3, _red_body.step(case))


def build(case: Case, profile: str, dt: float) -> Scene:
    """Compile the model of one profile.

    Raises:
        ValueError: MuJoCo's own, for a model that it refuses.
    """
    own, matched = _red_body.red_body(case), profile == "matched"
    spec = _matched(own, case) if matched else _default(own)
    model = spec.compile()
    data = mujoco.MjData(model)
    scene = Scene(
        model=model, data=data, nc=ROWS, start=_start(case, model, data), modes=_modes(own, model, data),
        lam=_multipliers(model, data), safe=_guard(own, data), observe=own.observe,
    )  # fmt: skip
    pairs = _follow(scene, own, case, dt) if matched else None
    scene.audit = audit(case, scene, matched=matched)
    scene.audit = {**scene.audit, **_listed(scene, pairs)}
    return scene


def followed(case: Case, profile: str) -> Case | None:
    """The case whose equations the profile integrates; None where they are the case's, or the engine has its own."""
    frozen = case.collisions != "resolved"
    return _red_body.under(case, "resolved") if profile == "matched" and frozen else None


def _bodies(own: RedBody) -> Any:
    """The bodies with their joints and inertias, without a shape."""
    spec = mujoco.MjSpec()
    spec.option.gravity = (0.0, -own.p["gravity"], 0.0)
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    box, inertia, slab, slab_inertia = own.masses
    for name, mass, turning in (("box", box, inertia), ("slab", slab, slab_inertia)):
        # Only the moment of inertia about z ever acts.
        body = spec.worldbody.add_body(
            name=name, mass=mass, inertia=(turning, turning, turning), ipos=(0.0, 0.0, 0.0), explicitinertial=True
        )
        for kind, axis in (("SLIDE", (1, 0, 0)), ("SLIDE", (0, 1, 0)), ("HINGE", (0, 0, 1))):
            body.add_joint(type=getattr(mujoco.mjtJoint, f"mjJNT_{kind}"), axis=axis)
    return spec


def _plane(spec: Any, name: str, place: tuple[float, float, float], normal: tuple[float, float, float]) -> None:
    far = (10.0, 10.0, 1.0)
    spec.worldbody.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_PLANE, pos=place, zaxis=normal, size=far)


def _ball(spec: Any, body: str, name: str, place: tuple[float, float], radius: float) -> None:
    kind = mujoco.mjtGeom.mjGEOM_SPHERE
    spec.body(body).add_geom(name=name, type=kind, pos=(*place, 0.0), size=(radius, 0.0, 0.0), mass=0.0)


def _block(spec: Any, body: str, name: str, length: float, height: float) -> None:
    spec.body(body).add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_BOX, size=(length, height, 0.1), mass=0.0)


def _matched(own: RedBody, case: Case) -> Any:
    """Spheres of half the slab's thickness, much more than any penetration, and surfaces that much deeper."""
    spec, p = _bodies(own), own.p
    radius = 0.5 * p["slab_half_height"]
    _plane(spec, "floor", (0.0, -radius, 0.0), (0.0, 1.0, 0.0))
    _plane(spec, "wall", (p["wall"] + radius, 0.0, 0.0), (-1.0, 0.0, 0.0))
    _block(spec, "slab", "slab", 10.0 * p["slab_half_length"], p["slab_half_height"] - radius)
    for row in range(ROWS):
        _ball(spec, "slab" if row < 2 else "box", f"row {row}", own.arm(row), radius)
    option = spec.option
    option.integrator, option.solver = mujoco.mjtIntegrator.mjINT_RK4, mujoco.mjtSolver.mjSOL_NEWTON
    option.jacobian, option.iterations, option.tolerance = mujoco.mjtJacobian.mjJAC_DENSE, ITERATIONS, 0.0
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    add_pairs(spec, GEOMS, one_set(case.law))
    return spec


def _default(own: RedBody) -> Any:
    """The box and the slab as boxes; the feet as spheres that the slab's thickness makes."""
    spec, p = _bodies(own), own.p
    _plane(spec, "floor", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    _plane(spec, "wall", (p["wall"], 0.0, 0.0), (-1.0, 0.0, 0.0))
    _block(spec, "box", "box", p["half_width"], p["half_height"])
    _block(spec, "slab", "slab", p["slab_half_length"], p["slab_half_height"])
    for row, side in ((0, -1.0), (1, 1.0)):
        _ball(spec, "slab", f"row {row}", (side * p["foot"], 0.0), p["slab_half_height"])
    for geom in spec.geoms:
        geom.condim = 1
    spec.geom("slab").contype, spec.geom("slab").conaffinity = 2, 2  # its feet stand on the floor, not itself
    spec.geom("box").contype = spec.geom("box").conaffinity = 3
    return spec


def _start(case: Case, model: Any, data: Any) -> Callable[[], None]:
    def start() -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = case.q0, case.v0

    return start


def _multipliers(model: Any, data: Any) -> Callable[[], Floats]:
    """Of the obvious model: the contacts between box and slab are summed left and right of the box's middle."""
    feet = {model.geom(f"row {i}").id: i for i in (0, 1)}
    box, wall = model.body("box").id, model.geom("wall").id

    def row(geoms: list[int], place: Floats) -> int:
        for geom in geoms:
            if geom in feet:
                return feet[geom]
        if wall in geoms:
            return 4
        arm = data.xmat[box].reshape(3, 3).T @ (place - data.xpos[box])
        return 2 if arm[0] < 0.0 else 3

    def multipliers() -> Floats:
        lam, contacts = np.zeros(ROWS), data.contact
        for geoms, place, at in zip(contacts.geom.tolist(), contacts.pos, contacts.efc_address.tolist(), strict=True):
            if at >= 0:
                lam[row(geoms, place)] += data.efc_force[at]
        return lam

    return multipliers


def _modes(own: RedBody, model: Any, data: Any) -> Callable[[], Modes]:
    """Free above the surface; below it in contact while it pushes (MuJoCo keeps no memory)."""
    lam = _multipliers(model, data)

    def modes() -> Modes:
        pairs = zip(own.heights(data.qpos).tolist(), lam().tolist(), strict=True)
        return tuple(CONTACT if push > 0.0 else FREE if h > 0.0 else BALLISTIC for h, push in pairs)

    return modes


def _guard(own: RedBody, data: Any) -> Callable[[], bool]:
    fastest = FASTEST * (own.speed + own.speed / own.p["half_width"])
    rates: Floats = data.qvel
    return lambda: bool(np.abs(rates).max() < fastest)


def _follow(scene: Scene, own: RedBody, case: Case, dt: float) -> TwoSets:
    """Rows that live as long as the level machine says, with the constants of their modes."""
    without_regularisation(scene.model)
    data = scene.data
    box, inertia, slab, slab_inertia = own.masses
    q, v = data.qpos, data.qvel
    pairs = TwoSets(
        scene.model, data, GEOMS, case.law, (SMALL * own.depth, 10.0 * SMALL * box * own.speed**2 / own.depth),
        gaps=lambda: own.heights(q), drift=lambda: own.drift(q, v), jacobian=lambda: own.jacobian(q),
        weights=np.array([box, box, inertia, slab, slab, slab_inertia]),
    )  # fmt: skip
    scene.machine = "level"
    scene.start, scene.modes, scene.lam = pairs.after(scene.start), pairs.modes, pairs.lam
    scene.hook, scene.margins, scene.arm = pairs.hook, pairs.margins, pairs.arm(reach=8.0 * dt * own.speed)
    return pairs


def _listed(scene: Scene, pairs: TwoSets | None) -> dict[str, Any]:
    """What is read back otherwise than from a chain of bodies with a row each: masses, and matched rows by name."""
    model, look = scene.model, scene.audit["lam"]
    bodies = [model.body(name) for name in ("box", "slab")]
    found: dict[str, Any] = {"masses": np.array([x for body in bodies for x in (body.mass[0], body.inertia[2])])}
    if pairs is None:
        return found

    def lam(q: Floats, v: Floats) -> Floats:
        look(q, v)
        return pairs.entries()[1]

    def H(q: Floats) -> Floats:
        look(q, np.zeros(model.nv))
        return pairs.entries()[0]

    pairs.reset()
    return found | {"H": H, "lam": lam, "constants": pairs.constants()}
