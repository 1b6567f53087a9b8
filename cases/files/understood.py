"""Which arrays of a compiled MuJoCo model are understood: any other off its default ends the reading."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.cases.errors import SceneError

READ = frozenset(
    """
    body_parentid body_pos body_quat body_ipos body_iquat body_mass body_inertia body_gravcomp jnt_type
    jnt_qposadr jnt_dofadr jnt_bodyid jnt_axis jnt_pos jnt_range jnt_limited jnt_margin jnt_solref jnt_solimp
    jnt_stiffness jnt_stiffnesspoly jnt_actfrcrange jnt_actfrclimited jnt_actgravcomp qpos0 qpos_spring
    dof_armature dof_damping dof_dampingpoly dof_frictionloss geom_type geom_bodyid geom_size geom_pos geom_quat
    geom_friction geom_margin geom_contype geom_conaffinity geom_condim geom_solref geom_solimp geom_solmix
    geom_priority geom_gap pair_dim pair_geom1 pair_geom2 pair_margin pair_gap pair_friction pair_solref
    pair_solimp pair_solreffriction exclude_signature eq_type eq_obj1id eq_obj2id eq_objtype eq_active0 eq_data
    eq_solref eq_solimp tendon_adr tendon_num tendon_damping tendon_dampingpoly tendon_stiffness
    tendon_stiffnesspoly tendon_lengthspring tendon_range tendon_limited tendon_margin tendon_solref_lim
    tendon_solimp_lim tendon_frictionloss tendon_armature tendon_actfrcrange tendon_actfrclimited tendon_type wrap_type
    wrap_objid wrap_prm actuator_trntype actuator_trnid actuator_gear actuator_gaintype actuator_gainprm
    actuator_biastype actuator_biasprm actuator_dyntype actuator_dynprm actuator_ctrlrange actuator_ctrllimited
    actuator_forcerange actuator_forcelimited actuator_armature actuator_damping actuator_actlimited
    actuator_actrange actuator_actearly key_qpos key_qvel key_ctrl
    key_act key_time
    """.split()  # noqa: SIM905
)
"""What becomes part of the scene, or is looked at and refused by a name of its own."""

DERIVED = frozenset(
    """
    body_rootid body_weldid body_treeid body_dofadr body_dofnum body_geomadr body_geomnum body_jntadr
    body_jntnum body_bvhadr body_bvhnum body_sameframe body_simple body_subtreemass body_invweight0 body_contype
    body_conaffinity body_margin jnt_actuatorid dof_M0 dof_Madr dof_bodyid dof_invweight0 dof_jntid dof_length
    dof_parentid dof_simplenum dof_treeid dof_solref dof_solimp geom_aabb geom_rbound geom_sameframe geom_dataid
    pair_signature tendon_treeid tendon_treenum tendon_length0 tendon_invweight0 tendon_actuatorid
    tendon_solref_fri tendon_solimp_fri actuator_acc0 actuator_length0 actuator_lengthrange actuator_ctrladr
    actuator_ctrlnum actuator_outadr actuator_outnum actuator_actadr actuator_actnum actuator_ctrlspec
    actuator_historyadr actuator_cranklength
    tree_bodyadr tree_bodynum tree_dofadr tree_dofnum tree_sleep_policy B_colind B_rowadr B_rownnz D_colind
    D_diag D_rowadr D_rownnz M_colind M_rowadr M_rownnz ten_J_colind ten_J_rowadr ten_J_rownnz
    """.split()  # noqa: SIM905
)
"""What the compiler computes from the rest, or what has no meaning without something that is refused."""

UNSEEN = tuple(
    """
    bvh_ oct_ cam_ light_ mat_ mesh_ tex_ skin_ text_ numeric_ tuple_ name_ names_ sensor_ site_ map efm
    flexedge_J hfield_
    """.split()  # noqa: SIM905
)
"""What is only drawn, named, measured or kept for speed, by the beginning of its name."""

DRAWN = frozenset(
    """
    geom_rgba geom_group geom_matid geom_castshadow tendon_rgba tendon_matid tendon_width
    """.split()  # noqa: SIM905
)

EMPTY = {"body_mocapid": -1, "body_plugin": -1, "geom_plugin": -1, "actuator_plugin": -1, "sensor_plugin": -1}
"""Arrays whose default is not 0."""
NOT_FELT = frozenset({"geom_fluid", "jnt_plasticadr", "tendon_plasticadr", "key_mpos", "key_mquat", "key_plastic"})
"""Of no effect here: the medium is refused by itself, and the others need what is refused."""
HARMLESS = tuple(
    """
    CONSTRAINT EQUALITY CONTACT LIMIT GRAVITY REFSAFE WARMSTART SENSOR ISLAND AUTORESET EULERDAMP
    MIDPHASE NATIVECCD MULTICCD FILTERPARENT
    """.split()  # noqa: SIM905
)
"""Flags that are taken into account, or that change no physics of a scene."""


def check_understood(model: Any) -> None:
    """Refuse a compiled model that holds physics which a scene does not."""
    for name in dir(model):
        array = getattr(model, name) if name[0] != "_" else None
        if not isinstance(array, np.ndarray) or name in READ or name in DERIVED:
            continue
        if name in DRAWN or name in NOT_FELT or name.startswith(UNSEEN) or name.endswith(("_user", "_group")):
            continue
        default = EMPTY.get(name, 0)
        if array.size and np.any(array != default):
            where = int(np.flatnonzero(np.any(np.reshape(array != default, (len(array), -1)), axis=1))[0])
            raise SceneError(
                f"The model's {name}[{where}] is {array[where]}, which is not supported; it must be {default}."
            )
    _check_options(model.opt)


def _check_flags(option: Any) -> None:
    import mujoco

    allowed = {f"mjDSBL_{name}" for name in HARMLESS}
    for flag in mujoco.mjtDisableBit.__members__.values():
        if flag.name.startswith("mjDSBL") and option.disableflags & int(flag) and flag.name not in allowed:
            raise SceneError(f"The model sets the flag {flag.name}, which is not understood; valid: without it.")
    if option.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE):
        raise SceneError(
            "The model overrides contact constants for all pairs (flag override), which is "
            "not understood; valid: without it, with solref, solimp and margin at the shapes."
        )
    if option.disableactuator:
        raise SceneError(
            "The model disables groups of actuators (actuatorgroupdisable), which is not "
            "understood; valid: none disabled, with without=actuator:NAME for those that are "
            "to do nothing in any engine."
        )


def _check_options(option: Any) -> None:
    _check_flags(option)
    for name in ("density", "viscosity"):
        if getattr(option, name) != 0.0:
            raise SceneError(
                f"The model moves in a medium (option {name} {getattr(option, name):g}), whose forces "
                f"are not done; valid: {name} 0, or without=medium, which leaves it out of every engine."
            )
    if np.any(option.wind):
        raise SceneError(
            "The model has wind, whose forces are not supported; valid: no wind, or "
            "without=medium, which leaves it out of every engine."
        )
