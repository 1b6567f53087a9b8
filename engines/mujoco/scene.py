"""Any scene in MuJoCo: matched, built from the scene; as_is, the file as it stands."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Case, CaseUnsupported, Mode, Parameter, SceneError
from crossbody.cases._arrays import Floats
from crossbody.cases.files import mjcf
from crossbody.cases.files.without import strip
from crossbody.cases.scene import UNBOUNDED, Scene
from crossbody.cases.scene_contacts import Contact
from crossbody.engines._acting import Acting
from crossbody.engines._contacts import Contacts, end_of
from crossbody.engines._log import Modes, Observe
from crossbody.engines._scene import Forces, angle_of
from crossbody.engines.mujoco._build import compiled, spec_of
from crossbody.engines.mujoco._direct import MAX_IMPEDANCE, without_regularisation
from crossbody.engines.mujoco._drift import Drift
from crossbody.engines.mujoco._file import held, rebuilt
from crossbody.engines.mujoco._globals import Hook, hooked
from crossbody.engines.mujoco._observe import mass_matrix, numbers, pose_of
from crossbody.engines.mujoco._scene import Scene as Prepared

SLOWEST, OF_RATE = 1e-3, 0.02
"""Largest step of the matched profile, s, and the part of the fastest time constant that it is: Runge-Kutta 4 leaves
(1/50)^4 a time constant."""
STIFF = 1e3
"""Times the softness of contacts and loops in space that bounds and coupled joints keep, 1e-4 of MuJoCo's. Newton's
method ends where the costs of rows, f^2 R/2, are below 1e-15: of a newton 1e-7 leaves multipliers of bounds off by
1e-3, 1e-4 by 1e-6 (`tests/test_bounds_at_rest.py`). Loops in space bear many times what moves, and want 1e-7."""
REACH = 1e-12
"""How far above its surface a row of the matched profile still pushes, m or rad: MuJoCo's are on below it alone, where
a row at rest, or one that starts at its surface, is off in every other step."""
LIMITS = (mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT, mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON)
TOUCH = int(mujoco.mjtConstraint.mjCNSTR_CONTACT_FRICTIONLESS)
SOFT = "The file's rows are soft: their law varies with depth."
HIDDEN = "MuJoCo has a row for a bound only where it acts."


def why_not(case: Case, profile: str) -> str | None:
    """Return why a profile cannot do it: no file to take as it stands, or one that MuJoCo does not read."""
    if profile == "default":
        return "What MuJoCo makes of a robot file by itself is the profile as_is; default is one of the shipped cases."
    if profile != "as_is":
        return None
    if not case.file:
        return "There is no file to run as it stands."
    try:
        _from_file(case)
    except SceneError as error:
        return str(error)
    return None


def settings(case: Case, profile: str) -> dict[str, Parameter]:
    """Return the setting that says who reads the file: MuJoCo, or the project, which builds its scene."""
    if profile != "as_is":
        return {}
    return {"reader": Parameter(default="file", choices=("file", "scene"), doc="who reads the file")}


def default_step(case: Case, profile: str) -> float:
    """Return the file's own step, s, or for matched a part of the fastest time constant that forces of joints have."""
    if profile == "as_is":
        return float(_from_file(case).opt.timestep)
    return min(SLOWEST, OF_RATE / fastest(_scene(case), case.q0, case.v0))


def fastest(scene: Scene, q: Floats, v: Floats) -> float:
    """Return the largest rate, 1/s, with which springs, dampers and actuators move the bodies from a state."""
    model = matched(scene)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(model, data)
    M, n, step = mass_matrix(model, data), model.nv, 1e-6
    lift = step * np.eye(n)

    def forces(d: Floats, rate: Floats) -> Floats:
        data.qpos[:], data.qvel[:] = q, v + rate
        mujoco.mj_integratePos(model, data.qpos, d, 1.0)
        mujoco.mj_forward(model, data)
        return np.array(data.qfrc_passive + data.qfrc_actuator)

    still = np.zeros(n)
    K = np.array([(forces(d, still) - forces(-d, still)) / (2.0 * step) for d in lift]).T
    D = np.array([(forces(still, d) - forces(still, -d)) / (2.0 * step) for d in lift]).T
    A = np.block([[np.zeros((n, n)), np.eye(n)], [np.linalg.solve(M, K), np.linalg.solve(M, D)]])
    filters = [1.0 / actuator.time_constant for actuator in scene.actuators if actuator.time_constant > 0.0]
    return max(float(np.abs(np.linalg.eigvals(A)).max()), *filters, 1.0)


def build(case: Case, profile: str, dt: float, reader: str = "file") -> Prepared:
    """Compile the model of one profile.

    Raises:
        ValueError: MuJoCo's own, for a model that it refuses.
    """
    scene = _scene(case)
    if profile == "as_is":
        model = held(_from_file(case))
        model = model if reader == "file" else rebuilt(scene, model)
    else:
        model = matched(scene)
    data = mujoco.MjData(model)
    rows, acting = Rows(scene, model, data), Acting(case)
    driver = Forces(scene) if profile == "matched" and scene.activated else None
    prepared = Prepared(
        model=model, data=data, nc=len(case.contacts), start=_start(case, model, data, acting, driver),
        modes=rows.modes, lam=rows.lam,
        safe=lambda: bool(np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()),
        observe=rows.observe(), instants=acting.instants, change=_change(scene, data, acting, driver),
        acting=acting,
        hook=_hook(scene, rows, driver) if profile == "matched" else None, always=True,
    )  # fmt: skip
    prepared.audit = _audit(case, profile, model, rows)
    return prepared


def _scene(case: Case) -> Scene:
    if case.scene is None:
        raise CaseUnsupported(f"{case.label} is not a scene.")
    return case.scene


def _from_file(case: Case) -> Any:
    """Return MuJoCo's own reading of the file, less what is left out of every engine."""
    model = mjcf.compiled(Path(case.file))
    strip(model, str(case.parameters.get("without", "")))
    return model


def matched(scene: Scene) -> Any:
    """Return the model built from the scene: its own law, no regularisation, Runge-Kutta 4, no other contacts.

    Controls stand for the activations of actuators that have one: MuJoCo's stages let these pass the ends of ranges.
    """
    scene = scene.replace(actuators=tuple(
        replace(one, activation="", time_constant=0.0, control_range=UNBOUNDED) if one.activation else one
        for one in scene.actuators
    ))  # fmt: skip
    spec = spec_of(scene)
    option = spec.option
    option.integrator, option.solver = mujoco.mjtIntegrator.mjINT_RK4, mujoco.mjtSolver.mjSOL_NEWTON
    option.tolerance, option.jacobian = 0.0, mujoco.mjtJacobian.mjJAC_DENSE
    off = mujoco.mjtDisableBit
    option.disableflags |= int(off.mjDSBL_AUTORESET | off.mjDSBL_REFSAFE)
    model = compiled(spec, scene)
    without_regularisation(model)
    model.dof_invweight0[:] *= STIFF
    model.tendon_invweight0[:] *= STIFF
    for margin in (model.jnt_margin, model.tendon_margin, model.pair_margin):
        margin += REACH
    return model


def _start(case: Case, model: Any, data: Any, acting: Acting, driver: Forces | None) -> Callable[[], None]:
    def start() -> None:
        acting.reset()
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = case.q0, case.v0
        if driver is not None:
            driver.begin(case.act0)
        else:
            data.act[:] = case.act0
        mujoco.mj_forward(model, data)  # the rows that are always on stand there only then

    return start


def _hook(scene: Scene, rows: Rows, driver: Forces | None) -> Hook | None:
    """Return what MuJoCo calls in every stage: terms of rows that it leaves out, and activations at that instant."""
    own = rows.hook()
    if driver is None:
        return own
    activated = list(scene.activated)

    def hook(model: Any, data: Any) -> None:
        driver.t = data.time
        data.ctrl[activated] = driver.driven()[activated]
        if own is not None:
            own(model, data)

    return hook


def _change(scene: Scene, data: Any, acting: Acting, driver: Forces | None) -> Callable[[float], None]:
    bodies = numbers(scene)
    pushed = [bodies[push.body] for push in scene.pushes]

    def change(t: float) -> None:
        with hooked(None) if acting.controller is not None else nullcontext():  # it may compute with MuJoCo itself
            given = acting.at(t, data.qpos, data.qvel)
        controls, pushes = np.split(given, [len(scene.actuators)])
        data.ctrl[:] = controls
        if driver is not None:
            driver.change(given, t)
        data.xfrc_applied[:] = 0.0
        np.add.at(data.xfrc_applied[:, :3], pushed, pushes.reshape(-1, 3))

    return change


class Rows:
    """The rows of a scene among those that MuJoCo has at a state.

    Attributes:
        always: number of rows that are always on; they stand first in both.
    """

    def __init__(self, scene: Scene, model: Any, data: Any) -> None:
        self.scene, self.model, self.data = scene, model, data
        self.always = sum(loop.width for loop in scene.loops)
        self.places: dict[tuple[int, int, bool], int] = {}
        row = self.always
        for j, part in enumerate(scene.bounded):  # in the model's order: a file need not name them
            tendon = j - len(scene.joints)
            kind, i = (int(LIMITS[0]), j) if tendon < 0 else (int(LIMITS[1]), tendon)
            for upper, bound in enumerate(part.range):
                if np.isfinite(bound):
                    self.places[kind, i, bool(upper)] = row
                    row += 1
        self.touching = Contacts(scene)
        self.nc = row + self.touching.count
        named = mjcf.names(model, "geom")
        self.geoms = {named(i): i for i in range(model.ngeom)}
        self.touches: dict[frozenset[int], tuple[Contact, int]] = {}
        for contact in self.touching.all:
            both = frozenset((self.geoms[contact.first.name], self.geoms[contact.second.name]))
            self.touches[both] = (contact, row)
            row += contact.places

    def constants(self) -> dict[str, Any]:
        """Return the law of every row as the model has it: a0, a1, a2 where solref is direct, else the pairs."""
        model = self.model
        solref = [*np.repeat(model.eq_solref, [loop.width for loop in self.scene.loops], axis=0)]
        bounds = {int(LIMITS[0]): model.jnt_solref, int(LIMITS[1]): model.tendon_solref_lim}
        solref += [bounds[kind][i] for kind, i, _ in self.places]
        solref += [model.pair_solref[i] for i, contact in enumerate(self.touching.all) for _ in range(contact.places)]
        pairs = np.array(solref).reshape(-1, 2)
        if (pairs >= 0.0).any():
            return {"solref": pairs}
        return dict(zip(("a0", "a1", "a2"), (*(-pairs.T / MAX_IMPEDANCE), np.zeros(len(pairs))), strict=True))

    def lam(self) -> Floats:
        """Return the multiplier of every row (nc,), 0 where it does not act."""
        data, lam = self.data, np.zeros(self.nc)
        lam[: self.always] = data.efc_force[: self.always]
        for j in range(data.ne, data.nefc):
            kind, part = int(data.efc_type[j]), int(data.efc_id[j])
            if kind in LIMITS:
                lam[self._place(j, kind, part)] += data.efc_force[j]
            elif kind == TOUCH:
                lam[self._touch(part)] += data.efc_force[j]
        return lam

    def _touch(self, part: int) -> int:
        """Return which row a contact is: its place is told by the signs of its point in the second shape's axes."""
        found = self.data.contact[part]
        contact, row = self.touches[frozenset(int(i) for i in found.geom)]
        one, two = (
            (self.data.geom_xmat[i].reshape(3, 3), self.data.geom_xpos[i])
            for i in (self.geoms[contact.first.name], self.geoms[contact.second.name])
        )
        if contact.parallel > 0.0:
            return row + end_of(contact, one, two, found.pos)
        x = two[0].T @ (found.pos - two[1])
        bits = {1: (), 2: (x[2] > 0.0,), 8: tuple(x > 0.0)}[contact.places]
        return row + sum(int(bit) << k for k, bit in enumerate(bits))

    def _place(self, j: int, kind: int, part: int) -> int:
        """Return which bound an active row is: of a joint the upper one has a falling gap, of a tendon it is nearer."""
        J = np.array(self.data.efc_J).reshape(-1, self.model.nv)[j]
        if kind == LIMITS[0] and self.scene.joints[part].type == "ball":
            return self.places[kind, part, True]
        if kind == LIMITS[0]:
            return self.places[kind, part, bool(J.sum() < 0.0)]
        (low, high), length = self.scene.tendons[part].range, self.data.ten_length[part]
        off = abs(self.data.efc_pos[j] - (length - low)), abs(self.data.efc_pos[j] - (high - length))
        return self.places[kind, part, bool(off[1] < off[0])]

    def hook(self) -> Hook | None:
        """Return what takes `REACH` out of the law and adds H' v of contacts, strings and bounds of ball joints."""
        joints, tendons = self.scene.joints, self.scene.tendons
        bent = {(int(LIMITS[0]), i): i for i, joint in enumerate(joints) if joint.type == "ball" and joint.limited}
        bent |= {(int(LIMITS[1]), i): len(joints) + i for i, tendon in enumerate(tendons) if tendon.bodies}
        if self.nc == self.always:
            return None
        drift, first = Drift(self.scene, self.model, self.touching), self.nc - self.touching.count
        straight = not bent and not self.touching.count

        def hook(_model: Any, data: Any) -> None:
            if data.nefc == data.ne:
                return
            gains = data.efc_KBIP[data.ne :]  # a0 is the first times the third
            data.efc_aref[data.ne :] -= gains[:, 0] * gains[:, 2] * REACH
            if straight:
                return
            acting = [(j, int(data.efc_type[j]), int(data.efc_id[j])) for j in range(data.ne, data.nefc)]
            acting = [one for one in acting if one[1] == TOUCH or one[1:] in bent]
            if not acting:
                return
            touched = [(j, self._touch(part) - first) for j, kind, part in acting if kind == TOUCH]
            pulled = [(j, kind, part) for j, kind, part in acting if kind != TOUCH]
            parts, rows = [bent[kind, part] for _, kind, part in pulled], [row for _, row in touched]
            lengths, touches = drift(data.qpos, data.qvel, parts, rows)
            for (j, _), term in zip(touched, touches, strict=True):
                data.efc_aref[j] -= term
            for (j, kind, part), term in zip(pulled, lengths, strict=True):
                upper = self._place(j, kind, part) == self.places.get((kind, part, True))
                data.efc_aref[j] -= (-1.0 if upper else 1.0) * term

        return hook

    def modes(self) -> Modes:
        """Return the mode of every row: a bound is in contact where it pushes."""
        lam = self.lam()[self.always :]
        return (int(Mode.BILATERAL),) * self.always + tuple(int(Mode.CONTACT if x > 0.0 else Mode.FREE) for x in lam)

    def observe(self) -> Observe:
        """Return what reads gaps and energies of recorded states."""
        data = mujoco.MjData(self.model)
        forces, poses = Forces(self.scene), pose_of(data, numbers(self.scene))

        def heights(q: Floats) -> list[float]:
            h: list[float] = []
            x = forces.x(q)
            lengths = [float(np.linalg.norm(angle_of(q[forces.at[joint.name] :][:4]))) if joint.type == "ball"
                       else x[forces.place[joint.name]] for joint in self.scene.joints]  # fmt: skip
            lengths += list(data.ten_length)
            for part, length in zip(self.scene.bounded, lengths, strict=True):
                low, high = part.range
                h += [length - low - part.margin] if np.isfinite(low) else []
                h += [high - length - part.margin] if np.isfinite(high) else []
            return h

        def observe(q: Floats, v: Floats) -> tuple[Floats, Floats]:
            gaps, energy = np.empty((len(q), self.nc)), np.empty((len(q), 2))
            for i in range(len(q)):
                data.qpos[:], data.qvel[:] = q[i], v[i]
                mujoco.mj_fwdPosition(self.model, data)
                mujoco.mj_fwdVelocity(self.model, data)
                mujoco.mj_energyPos(self.model, data)
                mujoco.mj_energyVel(self.model, data)
                touching = [touch.gap for touch in self.touching.touches(poses)]
                gaps[i] = [*data.efc_pos[: self.always], *heights(q[i]), *touching]
                spared = self.model.body_gravcomp * self.model.body_mass * (data.xipos @ self.model.opt.gravity)
                energy[i] = data.energy[1], data.energy[0] + spared.sum()
            return gaps, energy

        return observe


def _audit(case: Case, profile: str, model: Any, rows: Rows) -> dict[str, Any]:
    """Masses, M and bias at zero input; rows where all of them are always on."""
    data = mujoco.MjData(model)

    def look(q: Floats, v: Floats) -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)

    def M(q: Floats) -> Floats:
        look(q, np.zeros(model.nv))
        return mass_matrix(model, data)

    def bias(q: Floats, v: Floats) -> Floats:
        look(q, v)
        return np.array(data.qfrc_bias - data.qfrc_passive - data.qfrc_actuator)

    def H(q: Floats) -> Floats:
        look(q, np.zeros(model.nv))
        return np.array(data.efc_J).reshape(-1, model.nv)[: rows.nc]

    def lam(q: Floats, v: Floats) -> Floats:
        look(q, v)
        return np.array(data.efc_force[: rows.nc])

    found: dict[str, Any] = {
        "masses": model.body_mass[1:].copy(), "gravity": float(np.linalg.norm(model.opt.gravity)),
        "q0": case.q0, "v0": case.v0, "M": M, "bias": bias,
    }  # fmt: skip
    if profile == "matched":
        found["constants"] = rows.constants()
    hidden = {} if profile == "matched" else {"constants": SOFT, "lam": SOFT}
    if rows.nc > rows.always:
        return found | {"hidden": {**hidden, "H": HIDDEN, "lam": HIDDEN}}
    return found | {"hidden": hidden, "H": H} | ({"lam": lam} if profile == "matched" else {})
