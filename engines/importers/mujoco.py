"""MuJoCo's compiler on a robot file, as `mujoco.MjModel.from_xml_path` has it."""

from __future__ import annotations

from copy import copy
from functools import cached_property
from typing import Any

import numpy as np

FORMATS, PACKAGE, MODULE, TRIED = ("mjcf", "urdf"), "mujoco", "mujoco", ("4.0", "4.0")
KINDS = ("free", "ball", "slide", "hinge")
SHAPES = ("plane", "field", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")
FAR = 1e12  # margin of a bound with which its row is there wherever it is, m or rad
FUSED = "MuJoCo's compiler merges links of a URDF that no joint moves with their parents (fusestatic)."


def all_rows(lib: Any, model: Any) -> Any:
    """Return a model and its data in which all bounds and contacts have rows: wide bounds, balls at one place."""
    m = copy(model)
    d = lib.MjData(m)
    for margin in (m.jnt_margin, m.tendon_margin):
        margin[:] = FAR
    m.geom_type[:], m.geom_rbound[:], m.geom_size[:] = int(lib.mjtGeom.mjGEOM_SPHERE), 1.0, 1.0
    m.opt.disableflags |= int(lib.mjtDisableBit.mjDSBL_MIDPHASE)
    m.opt.cone = int(lib.mjtCone.mjCONE_ELLIPTIC)
    for step in (lib.mj_kinematics, lib.mj_comPos, lib.mj_tendon):
        step(m, d)
    d.geom_xpos[:] = 0.0
    for step in (lib.mj_collision, lib.mj_makeConstraint):
        step(m, d)
    return m, d


def softness(lib: Any, m: Any, d: Any) -> dict[str, list[float]]:
    """Return of each row of `all_rows`, by its name, what MuJoCo makes of solref and the largest impedance: K dmax, B.

    Those of a contact are named by its shapes.
    """
    kind, geoms = lib.mjtConstraint, [m.geom(i).name or f"shape{i}" for i in range(m.ngeom)]
    of = {
        int(kind.mjCNSTR_EQUALITY): lambda k: (m.equality(k).name or f"loop{k}", m.eq_solimp[k]),
        int(kind.mjCNSTR_LIMIT_JOINT): lambda k: (m.joint(k).name or f"joint{k}", m.jnt_solimp[k]),
        int(kind.mjCNSTR_LIMIT_TENDON): lambda k: (m.tendon(k).name or f"tendon{k}", m.tendon_solimp_lim[k]),
    }
    rows = [(*of[int(d.efc_type[j])](int(d.efc_id[j])), j) for j in range(d.nefc) if int(d.efc_type[j]) in of]
    rows += [(":".join(sorted(geoms[k] for k in one.geom)), one.solimp, one.efc_address)
             for one in d.contact if one.efc_address >= 0]  # fmt: skip
    return {
        name: [float(d.efc_KBIP[j][0] * np.clip(solimp[1], 1e-4, 0.9999)), float(d.efc_KBIP[j][1])]
        for name, solimp, j in rows
    }


def bounds(lib: Any, m: Any) -> dict[str, list[float]]:
    """Return of each bounded joint and tendon, by its name, lowest and highest value, and margin."""
    on = not m.opt.disableflags & int(lib.mjtDisableBit.mjDSBL_LIMIT)
    kinds = ((m.njnt, m.joint, "joint", m.jnt_limited, m.jnt_range, m.jnt_margin),
             (m.ntendon, m.tendon, "tendon", m.tendon_limited, m.tendon_range, m.tendon_margin))  # fmt: skip
    return {
        part(i).name or f"{word}{i}": [*map(float, range_[i]), float(margin[i])]
        for count, part, word, limited, range_, margin in kinds for i in range(count) if limited[i] and on
    }  # fmt: skip


class _Robot:
    free = ball = "mujoco"

    def __init__(self, path: str, urdf: bool) -> None:
        import mujoco

        self.hidden = {"bodies": FUSED} if urdf else {}
        self._lib = mujoco
        self.version = mujoco.__version__
        self._m = m = mujoco.MjModel.from_xml_path(path)
        self._d = mujoco.MjData(m)
        self.nq, self.nv = m.nq, m.nv
        self._bodies = [m.body(i).name or f"body{i}" for i in range(m.nbody)]
        names = [m.joint(i).name or f"joint{i}" for i in range(m.njnt)]
        self.joints = [
            (names[i], self._bodies[m.jnt_bodyid[i]], KINDS[m.jnt_type[i]], int(m.jnt_qposadr[i]), int(m.jnt_dofadr[i]))
            for i in range(m.njnt)
        ]
        self.numbers = self._numbers()
        self.actuators = {m.actuator(i).name or f"actuator{i}": self._moved(i) for i in range(m.nu)}
        self._loops = [i for i in range(m.neq) if m.eq_active0[i] and self._on("EQUALITY")]
        self.loops = [self._loop(i) for i in self._loops]
        self._tendons = [m.tendon(i).name or f"tendon{i}" for i in range(m.ntendon)]
        self.tendons = {name: self._tendon(i) for i, name in enumerate(self._tendons)}
        self.keys = {m.key(i).name or f"key{i}": m.key_qpos[i].tolist() for i in range(m.nkey)}
        m.jnt_actfrclimited[:] = m.tendon_actfrclimited[:] = 0  # bounds are numbers, and forces are without them

    def _on(self, rows: str) -> bool:
        """Return whether the file has a kind of rows at all."""
        off = (int(getattr(self._lib.mjtDisableBit, f"mjDSBL_{key}")) for key in (rows, "CONSTRAINT"))
        return not any(self._m.opt.disableflags & flag for flag in off)

    def _numbers(self) -> dict[str, dict[str, Any]]:
        m, told = self._m, dict[str, dict[str, Any]]()
        for i, (name, _, kind, at, dof) in enumerate(self.joints):
            single, dofs = kind in ("slide", "hinge"), slice(dof, dof + {"free": 6, "ball": 3}.get(kind, 1))
            free = (-np.inf, np.inf)
            bounds = m.jnt_range[i] if m.jnt_limited[i] and self._on("LIMIT") else free
            least, most = m.jnt_actfrcrange[i] if m.jnt_actfrclimited[i] else free
            stiff, here = [m.jnt_stiffness[i], *m.jnt_stiffnesspoly[i]], slice(at, at + 1 if single else at)
            values = {
                "armature": m.dof_armature[dofs] + self._of_motors(i, m.actuator_armature),
                "friction": m.dof_frictionloss[dofs],
                "damping": m.dof_damping[dofs] + self._of_motors(i, m.actuator_damping),
                "damping v|v|": m.dof_dampingpoly[dofs, 0], "damping v^3": m.dof_dampingpoly[dofs, 1],
                "stiffness": stiff[0], "stiffness x^2": stiff[1], "stiffness x^3": stiff[2],
                "rest": m.qpos_spring[here if kind != "ball" else slice(at, at + 4)]
                if any(stiff) else (), "lower": bounds[0] if single else -np.inf, "upper": bounds[1],
                "least force": least, "most force": most,
            }  # fmt: skip
            for key, value in values.items():
                told.setdefault(key, {})[name] = np.atleast_1d(value).astype(float).tolist()
        return told

    def _moved(self, i: int) -> list[str]:
        m, kind, to = self._m, self._m.actuator_trntype[i], int(self._m.actuator_trnid[i, 0])
        if kind == self._lib.mjtTrn.mjTRN_TENDON:
            wrapped = range(m.tendon_adr[to], m.tendon_adr[to] + m.tendon_num[to])
            return [
                self.joints[m.wrap_objid[k]][0] for k in wrapped if m.wrap_type[k] == self._lib.mjtWrap.mjWRAP_JOINT
            ]
        return [self.joints[to][0]] if kind == self._lib.mjtTrn.mjTRN_JOINT else []

    def _of_motors(self, joint: int, values: Any) -> float:
        """Return what actuators add to a joint's number: their own (nu,), by their squared gears."""
        m = self._m
        own = (m.actuator_trntype == int(self._lib.mjtTrn.mjTRN_JOINT)) & (m.actuator_trnid[:, 0] == joint)
        return float((m.actuator_gear[own, 0] ** 2 * values[own]).sum())

    def _loop(self, i: int) -> tuple[str, list[str], list[float]]:
        m, kind = self._m, self._lib.mjtEq(self._m.eq_type[i]).name.removeprefix("mjEQ_").lower()
        names = {"joint": [joint[0] for joint in self.joints], "tendon": [m.tendon(k).name for k in range(m.ntendon)]}
        if kind not in names:
            return kind, [], []
        return kind, [names[kind][k] for k in (m.eq_obj1id[i], m.eq_obj2id[i]) if k >= 0], m.eq_data[i, :5].tolist()

    def ends(self) -> Any:
        m, d, told = self._m, self._d, list[Any]()
        for i, (kind, *_) in zip(self._loops, self.loops, strict=True):
            one, two, data = m.eq_obj1id[i], m.eq_obj2id[i], m.eq_data[i]
            if kind not in ("connect", "weld"):
                told.append([])
            elif m.eq_objtype[i] == int(self._lib.mjtObj.mjOBJ_SITE):
                told.append([(d.site_xpos[k], d.site_xmat[k].reshape(3, 3)) for k in (one, two)])
            else:
                welded = kind == "weld"
                places, turn = ((data[3:6], data[:3]) if welded else (data[:3], data[3:6])), np.zeros(9)
                self._lib.mju_quat2Mat(turn, data[6:10] if welded else np.array([1.0, 0.0, 0.0, 0.0]))
                frames = [(d.xpos[k], d.xmat[k].reshape(3, 3)) for k in (one, two)]
                turns = (turn.reshape(3, 3), np.eye(3))
                told.append([(p + R @ at, R @ by) for (p, R), at, by in zip(frames, places, turns, strict=True)])
        return told

    def _tendon(self, i: int) -> list[float]:
        m = self._m
        bounds = m.tendon_range[i] if m.tendon_limited[i] and self._on("LIMIT") else (-np.inf, np.inf)
        parts = (m.tendon_damping[i], m.tendon_dampingpoly[i], m.tendon_stiffness[i], m.tendon_stiffnesspoly[i],
                 m.tendon_frictionloss[i], m.tendon_lengthspring[i], bounds)  # fmt: skip
        return [float(x) for part in parts for x in np.atleast_1d(part)]

    def lengths(self) -> Any:
        return dict(zip(self._tendons, self._d.ten_length.tolist(), strict=True))

    def _moments(self) -> Any:
        d, moments = self._d, np.zeros((self._m.nu, self._m.nv))
        self._lib.mju_sparse2dense(moments, d.actuator_moment, d.moment_rownnz, d.moment_rowadr, d.moment_colind)
        return moments

    def drives(self) -> Any:
        """Forces by gears, gains and biases alone: no bound of a control or force, no activation."""
        m, d, moments = self._m, self._d, self._moments()
        gain, held = m.actuator_gainprm, np.zeros(m.nv)
        fixed, none = m.actuator_gaintype == int(self._lib.mjtGain.mjGAIN_FIXED), int(self._lib.mjtBias.mjBIAS_NONE)
        motion = np.column_stack([np.ones(m.nu), d.actuator_length, d.actuator_velocity])
        factors = np.where(fixed, gain[:, 0], (gain[:, :3] * motion).sum(axis=1))
        held = ((m.actuator_biasprm[:, :3] * motion).sum(axis=1) * (m.actuator_biastype != none)) @ moments
        return dict(zip(self.actuators, factors[:, None] * moments, strict=True)), held

    def shapes(self) -> Any:
        m, d, told = self._m, self._d, []
        for i in self._touching():
            kind, mesh = SHAPES[m.geom_type[i]] if m.geom_type[i] < len(SHAPES) else "other", m.geom_dataid[i]
            first = m.mesh_vertadr[mesh] if kind == "mesh" else 0
            points = m.mesh_vert[first : first + m.mesh_vertnum[mesh]] if kind == "mesh" else np.zeros((0, 3))
            place = (d.geom_xpos[i].copy(), d.geom_xmat[i].reshape(3, 3).copy())
            name, joint = m.geom(i).name or f"shape{i}", self._mover(m.geom_bodyid[i])
            told.append((name, kind, joint, m.geom_size[i], points, *place))
        return told

    def _touching(self) -> list[int]:
        m = self._m
        paired = {*m.pair_geom1.tolist(), *m.pair_geom2.tolist()}
        return [i for i in range(m.ngeom) if m.geom_contype[i] or m.geom_conaffinity[i] or i in paired]

    def contacts(self) -> Any:
        m, at = self._m, {geom: k for k, geom in enumerate(self._touching())}
        if not self._on("CONTACT"):
            return []
        moved, out = m.body_weldid[m.geom_bodyid], {int(one) for one in m.exclude_signature}
        above = m.body_weldid[m.body_parentid[moved]]
        found = {tuple(sorted(pair)) for pair in zip(m.pair_geom1.tolist(), m.pair_geom2.tolist(), strict=True)}
        filtered = not m.opt.disableflags & int(self._lib.mjtDisableBit.mjDSBL_FILTERPARENT)
        for i in at:
            for j in range(i + 1, m.ngeom):
                a, b = sorted((int(m.geom_bodyid[i]), int(m.geom_bodyid[j])))
                near = moved[i] == above[j] or moved[j] == above[i]
                if (m.geom_contype[i] & m.geom_conaffinity[j] or m.geom_contype[j] & m.geom_conaffinity[i]) and not (
                    moved[i] == moved[j] or (filtered and near and moved[i] and moved[j]) or (a << 16) + b in out
                    or (b << 16) + a in out
                ):  # fmt: skip
                    found.add((i, j))
        return [(at[i], at[j]) for i, j in found]

    @cached_property
    def _rows(self) -> Any:
        return all_rows(self._lib, self._m)

    def surfaces(self) -> Any:
        """MuJoCo's friction in force and margin of each pair; of one without a contact nothing is known."""
        d = self._rows[1]
        shapes, told = self._touching(), dict[tuple[int, int], Any]()
        for one in d.contact:
            rubs = np.where(np.arange(5) < one.dim - 1, one.friction, 0.0)
            told[tuple(sorted(one.geom.tolist()))] = [*rubs, one.includemargin]
        return [told.get(tuple(sorted((shapes[i], shapes[j]))), [np.nan] * 6) for i, j in self.contacts()]

    def softness(self) -> Any:
        """Of each row what MuJoCo makes of solref and of the largest impedance: K dmax and B."""
        return softness(self._lib, *self._rows)

    def place(self, q: Any, v: Any) -> None:
        self._d.qpos[:], self._d.qvel[:] = q, v
        self._lib.mj_forward(self._m, self._d)
        self._lib.mj_energyPos(self._m, self._d)
        self._lib.mj_energyVel(self._m, self._d)

    def mass_matrix(self) -> Any:
        full = np.zeros((self.nv, self.nv))
        self._lib.mj_fullM(self._m, self._d, full)
        return full

    def bias(self) -> Any:
        """Weight is taken off by a passive force, or among the actuators'; its effect counts."""
        m, d = self._m, self._d
        by_motors = d.qfrc_actuator - d.actuator_force @ self._moments()
        return d.qfrc_bias - np.where(m.jnt_actgravcomp[m.dof_jntid], by_motors, d.qfrc_gravcomp)

    def energy(self) -> float:
        springs = self._m.jnt_stiffness.copy()  # the other readers tell of springs by their numbers alone
        off = self._m.opt.disableflags
        self._m.opt.disableflags |= int(self._lib.mjtDisableBit.mjDSBL_SPRING)
        self._lib.mj_energyPos(self._m, self._d)
        self._m.opt.disableflags = off
        self._m.jnt_stiffness[:] = springs
        return float(self._d.energy.sum())

    def frames(self) -> Any:
        d = self._d
        return {name: (np.array(d.xpos[i]), d.xmat[i].reshape(3, 3)) for i, name in enumerate(self._bodies) if i}

    def _mover(self, body: int) -> str:
        """Return the joint that moves a body; none of what stands on the world."""
        m, moved = self._m, self._m.body_weldid[body]
        return self.joints[m.body_jntadr[moved] + m.body_jntnum[moved] - 1][0] if m.body_jntnum[moved] else ""

    def inertias(self) -> Any:
        m, d, told = self._m, self._d, []
        for i in range(1, m.nbody):
            if joint := self._mover(i):
                R = d.ximat[i].reshape(3, 3)
                told.append((joint, float(m.body_mass[i]), np.array(d.xipos[i]), R @ np.diag(m.body_inertia[i]) @ R.T))
        return told


def open_robot(path: str, urdf: bool) -> _Robot:
    """Return what MuJoCo makes of a file; its compiler reads both formats."""
    return _Robot(path, urdf)
