"""A compiled MuJoCo model as a scene."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from crossbody.cases.errors import SceneError
from crossbody.cases.files.meshes import check_files, leave_out_colliding, leave_out_missing
from crossbody.cases.files.pairs import pairs_of
from crossbody.cases.files.reading import is_urdf
from crossbody.cases.files.understood import check_understood
from crossbody.cases.files.urdf import unfused
from crossbody.cases.files.warned import compiled, sentences
from crossbody.cases.files.without import apart, without_meshes
from crossbody.cases.scene import (
    ROWS,
    UNBOUNDED,
    UPRIGHT,
    Actuator,
    Body,
    Joint,
    Loop,
    RowLaw,
    Scene,
    Shape,
    Tendon,
    Vector,
)

if TYPE_CHECKING:
    import mujoco

JOINTS = ("free", "ball", "slide", "hinge")
MESH = 7
SHAPES = {0: "plane", 2: "sphere", 3: "capsule", 4: "ellipsoid", 5: "cylinder", 6: "box", MESH: "hull"}
WORDS = {"jnt": "joint", "eq": "loop", "geom": "shape"}  # MuJoCo's word for a kind of part, and ours
JOINT_WRAP, SITE_WRAP = 1, 3


def read(path: Path, without: str = "") -> tuple[mujoco.MjModel, list[str]]:
    """Return MuJoCo's model of a file as it stands but for what has to be left out before it is compiled.

    With it what MuJoCo warns of, and which meshes are not there.
    """
    import mujoco

    told: list[str] = []

    def opened() -> Any:
        spec = unfused(path) if is_urdf(path) else mujoco.MjSpec.from_file(str(path))
        if without_meshes(without):
            leave_out_colliding(spec)
        return spec

    def compiler() -> Any:
        spec = opened()
        check_files(spec, path)
        try:
            return apart(spec, without)
        except ValueError:
            spec = opened()
            told.extend(leave_out_missing(spec, path))
            return apart(spec, without)

    model, warned = compiled(path, compiler)
    return model, [*sentences(warned), *told]


def scene_of(model: mujoco.MjModel) -> Scene:
    """Return the scene of a compiled model."""
    check_understood(model)
    return Scene(
        bodies=tuple(_body(model, i) for i in range(1, model.nbody)),
        joints=tuple(_joint(model, i) for i in range(model.njnt)),
        shapes=tuple(shape for i in range(model.ngeom) if (shape := _shape(model, i)) is not None),
        pairs=pairs_of(model, names(model, "geom"), law) if _on(model, "CONTACT") else (),
        loops=tuple(_loop(model, i) for i in range(model.neq) if model.eq_active0[i] and _on(model, "EQUALITY")),
        tendons=tuple(_tendon(model, i) for i in range(model.ntendon)),
        actuators=tuple(_actuator(model, i) for i in range(model.nu)),
        gravity=tuple(model.opt.gravity) if not model.opt.disableflags & _disabled("GRAVITY") else (0.0, 0.0, 0.0),
        friction=False,  # a file runs in every engine unless it is asked for
    )


def _disabled(flag: str) -> int:
    import mujoco

    return int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}"))


def _on(model: Any, rows: str) -> bool:
    """Return whether the model has a kind of rows at all."""
    return not model.opt.disableflags & (_disabled(rows) | _disabled("CONSTRAINT"))


def _name(model: Any, kind: str, index: int) -> str:
    """Return the name of a part, or one made of its kind and number; the world is empty."""
    if kind == "body" and index == 0:
        return ""
    return str(getattr(model, kind)(index).name) or f"{WORDS.get(kind, kind)}{index}"


def names(model: Any, kind: str) -> Callable[[int], str]:
    """Return what gives the name of a part of one kind by its number."""
    return lambda index: _name(model, kind, index)


def _floats(values: Any) -> Vector:
    return tuple(float(value) for value in values)


def _body(model: Any, i: int) -> Body:
    R = _rotation(model.body_iquat[i])
    J = R @ np.diag(model.body_inertia[i]) @ R.T
    return Body(
        name=_name(model, "body", i),
        parent=_name(model, "body", int(model.body_parentid[i])),
        position=_floats(model.body_pos[i]),
        orientation=_floats(model.body_quat[i]),
        mass=float(model.body_mass[i]),
        com=_floats(model.body_ipos[i]),
        inertia=_floats((J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])),
        weightless=float(model.body_gravcomp[i]),
    )


def _rotation(quaternion: Any) -> Any:
    import mujoco

    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, quaternion)
    return R.reshape(3, 3)


def _joint(model: Any, i: int) -> Joint:
    kind, at, dof = JOINTS[model.jnt_type[i]], int(model.jnt_qposadr[i]), int(model.jnt_dofadr[i])
    single = kind in ("slide", "hinge")
    if model.jnt_actgravcomp[i] and model.jnt_actfrclimited[i]:
        raise SceneError(
            f"Joint {_name(model, 'jnt', i)!r} bounds the force against weight (actuatorgravcomp, "
            "actuatorfrcrange), which a scene's joint does not; valid: one of the two."
        )
    rest = model.qpos_spring[at : at + 1] if single else model.qpos_spring[at + (3 if kind == "free" else 0) :][:4]
    limited = bool(model.jnt_limited[i]) and _on(model, "LIMIT")
    return Joint(
        name=_name(model, "jnt", i),
        body=_name(model, "body", int(model.jnt_bodyid[i])),
        type=kind,
        axis=_floats(model.jnt_axis[i]) if single else (0.0, 0.0, 1.0),
        anchor=_floats(model.jnt_pos[i]) if kind != "free" else (0.0, 0.0, 0.0),
        reference=float(model.qpos0[at]) if single else 0.0,
        range=_floats(model.jnt_range[i]) if limited else UNBOUNDED,
        margin=float(model.jnt_margin[i]),
        armature=float(model.dof_armature[dof]),
        damping=_poly(model.dof_damping[dof], model.dof_dampingpoly[dof]),
        stiffness=_poly(model.jnt_stiffness[i], model.jnt_stiffnesspoly[i]),
        rest=_floats(rest),
        friction_loss=float(model.dof_frictionloss[dof]),
        force_range=_floats(model.jnt_actfrcrange[i]) if model.jnt_actfrclimited[i] else UNBOUNDED,
        law=law(model, model.jnt_solref[i], model.jnt_solimp[i]),
    )


def _poly(first: float, others: Any) -> Vector:
    return (float(first), float(others[0]), float(others[1]))


def law(model: Any, solref: Any, solimp: Any) -> RowLaw:
    """Return the law of a row by its solref and the largest impedance of its solimp."""
    dmax, step = float(np.clip(solimp[1], 1e-4, 0.9999)), float(model.opt.timestep)
    if solref[0] <= 0.0:
        return RowLaw(a0=-float(solref[0]) / dmax, a1=-float(solref[1]) / dmax)
    constant = float(solref[0])
    if not model.opt.disableflags & _disabled("REFSAFE"):
        constant = max(constant, 2.0 * step)
    return RowLaw(a0=1.0 / (dmax * constant**2 * float(solref[1]) ** 2), a1=2.0 / (dmax * constant))


def _shape(model: Any, i: int) -> Shape | None:
    kind = SHAPES.get(int(model.geom_type[i]))
    corners = _corners(model, int(model.geom_dataid[i])) if kind == "hull" else ()
    if kind is None or (kind == "hull" and not corners):
        return None
    return Shape(
        name=_name(model, "geom", i),
        body=_name(model, "body", int(model.geom_bodyid[i])),
        type=kind,
        size=_floats(model.geom_size[i]) if kind != "hull" else (0.0, 0.0, 0.0),
        corners=corners,
        position=_floats(model.geom_pos[i]),
        orientation=_floats(model.geom_quat[i]),
        friction=_floats(model.geom_friction[i]),
        margin=float(model.geom_margin[i]),
    )


def _corners(model: Any, mesh: int) -> tuple[Vector, ...]:
    """Return the corners of a mesh's hull, which MuJoCo has of meshes that may collide."""
    at = int(model.mesh_graphadr[mesh])
    if at < 0:
        return ()
    count = int(model.mesh_graph[at])  # numbers of corners and faces, then of each corner its first edge and its vertex
    vertices = model.mesh_vertadr[mesh] + model.mesh_graph[at + 2 + count :][:count]
    return tuple(_floats(model.mesh_vert[k]) for k in vertices)


def _loop(model: Any, i: int) -> Loop:
    import mujoco

    kind, data, name = int(model.eq_type[i]), model.eq_data[i], _name(model, "eq", i)
    bodies = names(model, "body")
    one, two = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
    given = law(model, model.eq_solref[i], model.eq_solimp[i])
    coupled = {mujoco.mjtEq.mjEQ_JOINT: ("joint", "jnt"), mujoco.mjtEq.mjEQ_TENDON: ("tendon", "tendon")}
    if kind in coupled:
        word, part = coupled[kind]
        parts = names(model, part)
        return Loop(
            name=name, type=word, first=parts(one), second=parts(two) if two >= 0 else "",
            polynomial=_floats(data[:5]), law=given,
        )  # fmt: skip
    types = {mujoco.mjtEq.mjEQ_CONNECT: "connect", mujoco.mjtEq.mjEQ_WELD: "weld"}
    if kind not in types:
        raise SceneError(f"Equality {name!r} is of type {mujoco.mjtEq(kind).name}; valid: {', '.join(ROWS)}.")
    welded = types[kind] == "weld"
    turn, points = data[6:10], (data[3:6], data[:3]) if welded else (data[:3], data[3:6])
    if model.eq_objtype[i] == mujoco.mjtObj.mjOBJ_SITE:
        turn, points = _between(model, one, two), (model.site_pos[one], model.site_pos[two])
        one, two = int(model.site_bodyid[one]), int(model.site_bodyid[two])
    return Loop(
        name=name, type=types[kind], first=bodies(one), second=bodies(two), first_position=_floats(points[0]),
        second_position=_floats(points[1]), orientation=_floats(turn) if welded else UPRIGHT,
        torque_scale=float(data[10]) if welded else 1.0, law=given,
    )  # fmt: skip


def _between(model: Any, one: int, two: int) -> Any:
    """Return the orientation of a body in the first with which the axes of two sites are the same."""
    import mujoco

    back, turn = np.zeros(4), np.zeros(4)
    mujoco.mju_negQuat(back, model.site_quat[two])
    mujoco.mju_mulQuat(turn, model.site_quat[one], back)
    return turn


def _tendon(model: Any, i: int) -> Tendon:
    if model.tendon_actfrclimited[i]:
        raise SceneError(f"Tendon {_name(model, 'tendon', i)!r} bounds its actuators' sum: a scene's tendon has none.")
    first, count = int(model.tendon_adr[i]), int(model.tendon_num[i])
    where = slice(first, first + count)
    name = _name(model, "tendon", i)
    kinds, parts = model.wrap_type[where].tolist(), model.wrap_objid[where].tolist()
    joined: dict[str, Any] = {}
    if kinds == [SITE_WRAP, SITE_WRAP]:
        joined["bodies"] = tuple(_name(model, "body", int(model.site_bodyid[j])) for j in parts)
        joined["positions"] = tuple(_floats(model.site_pos[j]) for j in parts)
    elif set(kinds) == {JOINT_WRAP}:
        joined["joints"] = tuple(_name(model, "jnt", j) for j in parts)
        joined["coefficients"] = _floats(model.wrap_prm[where])
    else:
        raise SceneError(
            f"Tendon {name!r} runs over shapes or more than two sites; in a scene it connects two points, or joints."
        )
    if model.tendon_armature[i] != 0.0:
        raise SceneError(
            f"Tendon {name!r} has armature, which a scene does not have; valid: 0, or "
            f"without=tendon:{name}, which leaves the tendon out of every engine."
        )
    return Tendon(
        name=name,
        **joined,
        damping=_poly(model.tendon_damping[i], model.tendon_dampingpoly[i]),
        stiffness=_poly(model.tendon_stiffness[i], model.tendon_stiffnesspoly[i]),
        rest=_floats(model.tendon_lengthspring[i]),
        range=_floats(model.tendon_range[i]) if model.tendon_limited[i] and _on(model, "LIMIT") else UNBOUNDED,
        margin=float(model.tendon_margin[i]),
        friction_loss=float(model.tendon_frictionloss[i]),
        law=law(model, model.tendon_solref_lim[i], model.tendon_solimp_lim[i]),
    )


ACTIVATIONS = {
    "mjDYN_NONE": "", "mjDYN_INTEGRATOR": "integrator", "mjDYN_FILTER": "filter",
    "mjDYN_FILTEREXACT": "filter",
}  # fmt: skip
"""MuJoCo's word -> the scene's: how exactly it integrates a filter is a matter of steps."""


def _actuator(model: Any, i: int) -> Actuator:
    import mujoco

    name = _name(model, "actuator", i)
    kind = mujoco.mjtTrn(model.actuator_trntype[i])
    gain, bias = mujoco.mjtGain(model.actuator_gaintype[i]), mujoco.mjtBias(model.actuator_biastype[i])
    dynamics = mujoco.mjtDyn(model.actuator_dyntype[i])
    if dynamics.name not in ACTIVATIONS or (model.actuator_actnum[i] > 1 or model.actuator_actearly[i]):
        early = " that acts early" if model.actuator_actearly[i] else ""
        valid = ", ".join(name.removeprefix("mjDYN_").lower() for name in ACTIVATIONS)
        raise SceneError(f"Actuator {name!r} has the activation {dynamics.name}{early}; valid: one of {valid}.")
    kind_of = ACTIVATIONS[dynamics.name]
    if gain.name not in ("mjGAIN_FIXED", "mjGAIN_AFFINE") or bias.name not in ("mjBIAS_NONE", "mjBIAS_AFFINE"):
        raise SceneError(f"Actuator {name!r} has {gain.name} and {bias.name}; valid: fixed and affine ones.")
    target = int(model.actuator_trnid[i, 0])
    places = {mujoco.mjtTrn.mjTRN_JOINT: ("joint", "jnt"), mujoco.mjtTrn.mjTRN_TENDON: ("tendon", "tendon")}
    if kind not in places:
        raise SceneError(f"Actuator {name!r} acts by {kind.name}; valid: joint, tendon.")
    what, names = places[kind]
    prm = model.actuator_gainprm[i]
    factors = _floats(prm[:3]) if gain.name == "mjGAIN_AFFINE" else (float(prm[0]), 0.0, 0.0)
    return Actuator(
        name=name,
        **{what: _name(model, names, target)},
        gear=_floats(model.actuator_gear[i]),
        gain=factors,
        bias=_floats(model.actuator_biasprm[i, :3]) if bias.name == "mjBIAS_AFFINE" else (0.0, 0.0, 0.0),
        armature=float(model.actuator_armature[i]),
        damping=float(model.actuator_damping[i]),
        control_range=_floats(model.actuator_ctrlrange[i]) if model.actuator_ctrllimited[i] else UNBOUNDED,
        force_range=_floats(model.actuator_forcerange[i]) if model.actuator_forcelimited[i] else UNBOUNDED,
        activation=kind_of,
        time_constant=float(model.actuator_dynprm[i, 0]) if kind_of == "filter" else 0.0,
        activation_range=_floats(model.actuator_actrange[i]) if kind_of and model.actuator_actlimited[i] else UNBOUNDED,
    )
