"""Any scene in MuJoCo: matched, built from the scene; default, with MuJoCo's contacts; as_is, a file."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import nullcontext
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Case, CaseUnsupported, Mode, Parameter, SceneError
from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.files import mjcf
from crossbody.cases.files.case import OF_THE_FILE
from crossbody.cases.files.without import strip
from crossbody.cases.scene import UNBOUNDED, Scene, Tendon
from crossbody.cases.scene_contacts import frictional, rough, rows_of, under_law
from crossbody.engines._acting import Acting
from crossbody.engines._acting import acting as acting_of
from crossbody.engines._gates import ALL_AT_ONCE
from crossbody.engines._real_time import depths, resolving_step
from crossbody.engines._real_time import followed as real_time
from crossbody.engines._scene import Forces
from crossbody.engines.importers.mujoco import all_rows, bounds, softness
from crossbody.engines.mujoco._build import compiled, spec_of, without_regularisation
from crossbody.engines.mujoco._file import held, rebuilt
from crossbody.engines.mujoco._gated import GatedRows
from crossbody.engines.mujoco._obvious import Obvious, obvious
from crossbody.engines.mujoco._rows import Rows
from crossbody.engines.mujoco._scene import Hook, Prepared, constraint_jacobian, hooked, mass_matrix, numbers
from crossbody.engines.mujoco._switched import Switched

CONE = {"pyramidal": mujoco.mjtCone.mjCONE_PYRAMIDAL, "elliptic": mujoco.mjtCone.mjCONE_ELLIPTIC}
FASTEST = 100.0  # times the speed that a scene can have: a run has diverged
SLOWEST, OF_RATE, OF_ROWS = 1e-3, 0.02, 0.05
"""Largest step of the matched profile, s, and the parts that it is of the fastest time constant
of forces and of that of rows that open: Runge-Kutta 4 leaves (1/50)^4 a time constant, and rows
act for a few of theirs."""
OF_KINKS = 0.002
"""The part of the fastest time constant of forces that a step is where these have bounds, or springs
dead bands: whatever the order, a step across a kink leaves up to (h rate)^2/4 of what moves, 1e-6."""
STABLE, DECAYS = 0.5, 0.5
"""Largest product of the step and any rate, where Runge-Kutta 4 is stable up to 2.8 and rates
change as bodies turn; and part of a rate by which a mode may swing at most that only decays."""
CONVERGED = 1e-28
"""Improvement at which Newton's method ends where no row may let go: its costs are quadratic
then, it is there after two or three iterations, and without an end it takes a hundred. Where rows
may, rounding that is left over lets them."""
STIFF, LOOPS = 1e3, 30.0
"""Times the softness of one row that bounds and coupled joints keep, and what loops join in space.

R is 1e-4 and 3e-6 of MuJoCo's then. Newton's method ends where its step is below 1e-15, which leaves multipliers off by
1e-15 / R: with no more than one row's, 1e-3 of a newton at bounds (`tests/reference/test_bounds_at_rest.py`), and 9e-6
of a weight in loops (`tests/engines/test_loops_at_rest.py`). And R lam is off the law: loops in space bear many times
what moves, so that the condition of H M^-1 H' times R, 3e-10, is what theirs are off by.
"""
ROUNDS = 3  # of PGS, with one row
SOLVES = 4
"""Times that multipliers are solved for to be compared: two leave 1e-7 of Newton's end."""
DEPENDENT = 1e-6
"""Singular value of the loops' rows, over the largest, below which one depends on the others."""
CONES = {
    "cone": Parameter(default="own", choices=("own", *CONE), doc="cone of friction; own: the model's"),
    "impratio": Parameter(default=0.0, doc="friction's stiffness over that of normals; 0: the model's", low=0.0),
    "noslip": Parameter(default=-1, doc="iterations that remove slip (noslip); -1: the model's", low=-1, high=1e6),
    "timeconst": Parameter(default=0.0, unit="s", doc="time constant of contacts (solref); 0: the model's", low=0.0),
}
"""Of models with friction."""
OF_FORCE = 1.5
"""Time constants of what answers to a force that a step may be long: Runge-Kutta 4 is stable up to 2.8."""
SOFT = "The file's rows are soft: their law varies with depth."
OWN_CONTACTS = (
    "MuJoCo has no row for parts of this case that are not shapes, such as rolling on the face of "
    "a ring; its own contacts are the profile default."
)
HIDDEN = "MuJoCo has a row for a bound only while it acts."


def why_not(case: Case, profile: str) -> str | None:
    """Return why a profile cannot do it: no file to take as it stands, or one that MuJoCo does not read."""
    if profile == "default" and case.file:
        return "The profile as_is runs a robot file unchanged; default is for scenes without a file."
    if profile != "default" and case.gates is not None:
        return OWN_CONTACTS
    if profile == "matched" and case.scene is not None and (found := frictional(case.scene)):
        return found
    if profile == "matched" and case.fsm != "level":
        return f"Rows of a scene in MuJoCo switch by the machine 'level', not by {case.fsm!r}."
    if profile != "as_is":
        return None
    if not case.file:
        return "There is no file to run unchanged; for MuJoCo's own contacts, use the profile default."
    if any(float(case.parameters.get(name, OF_THE_FILE)) != OF_THE_FILE for name in ("a0", "a1")):
        return "The profile as_is follows the file's constants, not those of --law; the profile matched follows these."
    try:
        _from_file(case)
    except SceneError as error:
        return str(error)
    return None


def settings(case: Case, profile: str) -> dict[str, Parameter]:
    """Return who reads the file, MuJoCo or the project, which builds its scene; and how friction acts."""
    reader = {"reader": Parameter(default="file", choices=("file", "scene"), doc="who reads the file")}
    found = reader if profile == "as_is" else {}
    rubs = _rubs(_from_file(case)) if profile == "as_is" else case.scene is not None and rough(case.scene) is not None
    return found | CONES if rubs else found


def _rubs(model: Any) -> bool:
    """Whether shapes of a file may touch with friction: MuJoCo computes it also where the scene has no rows for it."""
    touching = (model.geom_contype | model.geom_conaffinity) != 0
    return bool((model.geom_condim[touching] > 1).any() or (model.pair_dim > 1).any())


def default_step(case: Case, profile: str) -> float:
    """Return the file's step, s, or for matched parts of the fastest time constants of forces and of rows."""
    if profile == "as_is":
        return float(_from_file(case).opt.timestep)
    if profile == "default":
        return float(mujoco.MjModel.from_xml_string("<mujoco/>").opt.timestep)
    case = followed(case, profile) or case
    scene, law, opening = _scene(case), case.law, case.law.unilateral
    deep = 0.0
    if law.a2.any():
        model = matched(scene)
        deep = _reach(case, Switched(scene, model, mujoco.MjData(model)))[0]
    if not case.general:  # nothing but rows moves its bodies fast
        rate = case.force.rate if case.force is not None else 0.0
        return min(SLOWEST, resolving_step(law, deep), OF_FORCE / rate if rate else np.inf)
    stiffness = law.a0 + 3.0 * law.a2 * deep**2
    poles = [np.roots([1.0, a1, k]) for k, a1 in zip(stiffness[opening], law.a1[opening], strict=True)]
    rate = float(np.abs(np.concatenate([np.zeros(1), *poles])).max())
    part = OF_KINKS if smooth(scene) != scene else OF_RATE
    return min(SLOWEST, part / fastest(scene, case.q0, case.v0), OF_ROWS / max(rate, OF_ROWS))


def followed(case: Case, profile: str) -> Case | None:
    """Return the case whose equations the profile integrates, if not its own; None for MuJoCo's constants."""
    return real_time(case, two_sets=True) if profile == "matched" else None


def _reach(case: Case, rows: Switched) -> tuple[float, float]:
    """Return how deep rows get, m or rad, and how fast, by what drives them at the start."""
    rows.data.qpos[:], rows.data.qvel[:] = case.q0, case.v0
    law = case.law
    deep, fast = depths(np.stack([law.a0, law.a1, law.a2]), *rows.approach(), law.unilateral)
    return float(deep.max(initial=0.0)), float(fast.max(initial=0.0))


def fastest(scene: Scene, q: Floats, v: Floats) -> float:
    """Return the rate, 1/s, that a step has to follow of how springs, dampers and actuators move bodies from a state.

    Loops hold. Runge-Kutta 4 leaves about (h rate)^4 of what a mode moves. One that swings moves
    as much as all; one that decays by what a unit position or a unit rate makes of it, 1/rate
    where a damper alone holds a light body.
    """
    from scipy.linalg import eig  # which takes longer to import than a short run

    A = _slopes(scene, q, v)
    n = len(A) // 2
    found: Any = eig(A, left=True, right=True)
    rates, left, right = found
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # what moves freely has one vector twice
        moved = np.abs(right[:n]).max(axis=0) * np.abs(left).max(axis=0) / np.abs(np.sum(left.conj() * right, axis=0))
    decays = np.abs(rates.imag) <= DECAYS * np.abs(rates.real)
    counts = np.where(decays & (moved < 1.0), moved, 1.0) ** 0.25
    size = np.abs(rates)
    filters = [1.0 / actuator.time_constant for actuator in scene.actuators if actuator.time_constant > 0.0]
    return max(float(np.max(size * np.maximum(counts, OF_RATE / STABLE), initial=0.0)), *filters, 1.0)


def smooth(scene: Scene) -> Scene:
    """Return the scene without bounds of forces and dead bands: where they hold, they hide how fast forces change."""

    def banded(tendon: Tendon) -> Tendon:
        return replace(tendon, rest=tendon.rest[:1] * 2) if any(tendon.stiffness) else tendon

    return scene.replace(
        actuators=tuple(replace(one, force_range=UNBOUNDED) for one in scene.actuators),
        joints=tuple(replace(one, force_range=UNBOUNDED) for one in scene.joints),
        tendons=tuple(banded(one) for one in scene.tendons),
    )


def _slopes(scene: Scene, q: Floats, v: Floats) -> Floats:
    """Return d(v, v')/d(q, v) (2 nv, 2 nv) by springs, dampers and actuators alone, with the loops closed."""
    from scipy.linalg import null_space  # as above

    model = matched(smooth(scene))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(model, data)
    M, n, step = mass_matrix(model, data), model.nv, 1e-6
    H = constraint_jacobian(model, data)[: data.ne]
    lift = step * np.eye(n)

    def forces(d: Floats, rate: Floats) -> Floats:
        data.qpos[:], data.qvel[:] = q, v + rate
        mujoco.mj_integratePos(model, data.qpos, d, 1.0)
        mujoco.mj_forward(model, data)
        return np.array(data.qfrc_passive + data.qfrc_actuator)

    still = np.zeros(n)
    K = np.array([(forces(d, still) - forces(-d, still)) / (2.0 * step) for d in lift]).T
    D = np.array([(forces(still, d) - forces(still, -d)) / (2.0 * step) for d in lift]).T
    root = np.linalg.inv(np.linalg.cholesky(M))
    free = null_space(H @ root.T, rcond=DEPENDENT) if len(H) else np.eye(n)
    mobility = root.T @ free @ free.T @ root
    return np.block([[np.zeros((n, n)), np.eye(n)], [mobility @ K, mobility @ D]])


def build(
    case: Case, profile: str, dt: float, reader: str = "file", cone: str = "own", impratio: float = 0.0,
    noslip: int = -1, timeconst: float = 0.0,
) -> Prepared:  # fmt: skip
    """Compile the model of one profile."""
    integrated = followed(case, profile) or case
    scene = _scene(integrated)
    if profile == "as_is":
        model = held(_from_file(case))
        model = model if reader == "file" else rebuilt(scene, model)
    elif profile == "default":
        model = obvious(scene, colliding=case.gates is not None)
    else:
        model = matched(scene)
    read = (
        {"law": softness(mujoco, *all_rows(mujoco, model)), "bounds": bounds(mujoco, model)}
        if profile == "as_is"
        else {}
    )
    _set_cone(model.opt, cone, impratio, noslip)
    if timeconst > 0.0:
        model.geom_solref[:, 0] = model.pair_solref[:, 0] = timeconst
    data = mujoco.MjData(model)
    switched = Switched(scene, model, data) if profile == "matched" else None
    gated = GatedRows(case, scene, model, data) if case.gates is not None else None
    rows = switched or gated or (Obvious if profile == "default" else Rows)(scene, model, data)
    integrated, acting = _reading(integrated, gated), Acting(case)
    driver = Forces(scene) if profile == "matched" and scene.activated else None
    hook = _hook(integrated, data, switched, driver)
    prepared = Prepared(
        model=model, data=data, nc=len(case.contacts), start=_start(case, data, rows, acting, driver),
        modes=rows.modes, lam=rows.lam, safe=_guard(integrated, data, rows), observe=rows.observe(),
        instants=acting.instants, change=_change(scene, data, acting, driver), acting=acting, hook=hook,
        always=driver is not None or case.force is not None or (switched is not None and switched.wakeful),
        machine="level" if switched else "memoryless",
    )  # fmt: skip
    if gated is not None:
        variables, why = gated.gated, gated.gated.gates.lost
        prepared.follows = gated.follows
        prepared.switches, prepared.lost = gated.switches, lambda: why if variables.lost else ""
    if switched is not None and switched.nc > switched.always:
        prepared.arm, prepared.margins, prepared.outlives = switched.arm, switched.margins, True
        prepared.entered = switched.entered
    own = {"set": _set(model, cone, impratio, noslip, timeconst)}
    prepared.audit = _audit(case, profile, scene, model, rows) | read | own
    return prepared


def _reading(case: Case, gated: GatedRows | None) -> Case:
    """Return the case whose force reads the discrete variables of a run."""
    return case if gated is None or case.force is None else replace(case, force=gated.gated.force(case.force))


def _set_cone(option: Any, cone: str, impratio: float, noslip: int) -> None:
    """Set what `CONES` are, where they are not the model's own."""
    if cone != "own":
        option.cone = CONE[cone]
    if impratio > 0.0:
        option.impratio = impratio
    if noslip >= 0:
        option.noslip_iterations = noslip


def _set(model: Any, cone: str, impratio: float, noslip: int, timeconst: float) -> dict[str, Any]:
    """Return those of these settings that are not left to the model, as it has them."""
    names = {number: name for name, number in CONE.items()}
    found: dict[str, Any] = {"cone": names[int(model.opt.cone)]} if cone != "own" else {}
    found |= {"impratio": float(model.opt.impratio)} if impratio > 0.0 else {}
    found |= {"noslip": int(model.opt.noslip_iterations)} if noslip >= 0 else {}
    constants = np.append(model.geom_solref[:, 0], model.pair_solref[:, 0])
    return found | (
        {"timeconst": float(max(constants, key=lambda one: abs(one - timeconst)))} if timeconst > 0.0 else {}
    )


def _guard(case: Case, data: Any, rows: Rows) -> Callable[[], bool]:
    """Return what tells whether a state is finite and not 100 times faster than what drives the start explains.

    Of a robot, and of what else is driven, nobody knows what its inputs will do.
    """
    rates: Floats = data.qvel
    if case.general or case.force is not None or case.inputs is not None or case.control is not None:
        places: Floats = data.qpos
        return lambda: math.isfinite(places.sum() + rates.sum())  # half the time of asking each
    speed = _reach(case, rows)[1] if isinstance(rows, Switched) else 0.0
    data.qpos[:], data.qvel[:] = case.q0, case.v0
    mujoco.mj_forward(rows.model, data)
    fastest = FASTEST * (speed + float((np.abs(rates) + np.abs(data.qacc_smooth) * case.t_end).max())) or np.inf
    return lambda: all(-fastest < rate < fastest for rate in rates.tolist())


def _scene(case: Case) -> Scene:
    if case.scene is None:
        raise CaseUnsupported(f"{case.label} is not a scene.")
    return under_law(case.scene, case.law)


def _from_file(case: Case) -> Any:
    """Return MuJoCo's own reading of the file, less what every engine leaves out: a copy of the last."""
    known = _READ[0] if _READ else None
    if known is None or known[0] is not case:
        without = str(case.parameters.get("without", ""))
        model, _ = mjcf.read(Path(case.file), without)
        strip(model, without)
        _READ[:] = [known := (case, model)]
    return copy(known[1])


_READ: list[tuple[Case, Any]] = []
"""The last case whose file was read, and its model: a run asks again, and meshes take long."""


def matched(scene: Scene) -> Any:
    """Return the model built from the scene: its own law, no regularisation, Runge-Kutta 4, no other contacts.

    Controls stand for the activations of actuators that have one: MuJoCo's stages let these pass
    the ends of ranges.
    """
    scene = scene.replace(actuators=tuple(
        replace(one, activation="", time_constant=0.0, control_range=UNBOUNDED) if one.activation else one
        for one in scene.actuators
    ))  # fmt: skip
    spec = spec_of(scene, by_corners=True)
    option = spec.option
    option.integrator, option.solver = mujoco.mjtIntegrator.mjINT_RK4, mujoco.mjtSolver.mjSOL_NEWTON
    option.tolerance, option.jacobian = CONVERGED, mujoco.mjtJacobian.mjJAC_DENSE
    off = mujoco.mjtDisableBit
    option.disableflags |= int(off.mjDSBL_AUTORESET | off.mjDSBL_REFSAFE)
    model = compiled(spec, scene)
    without_regularisation(model)
    if len(rows_of(scene)[0]) == 1:  # one row PGS solves exactly, however hard
        model.opt.solver, model.opt.iterations = mujoco.mjtSolver.mjSOL_PGS, ROUNDS
        return model
    looped = {
        model.body(name).id for loop in scene.loops if loop.in_space for name in (loop.first, loop.second) if name
    }
    model.body_invweight0[[*looped]] *= LOOPS
    model.dof_invweight0[:] *= STIFF
    model.tendon_invweight0[:] *= STIFF
    return model


def _start(case: Case, data: Any, rows: Rows, acting: Acting, driver: Forces | None) -> Callable[[], None]:
    model = rows.model

    def start() -> None:
        acting.reset()
        mujoco.mj_resetData(model, data)
        if isinstance(rows, Switched):
            rows.last = np.zeros(rows.nc)  # not in place: multipliers that are recorded are these arrays
            rows.arm(rows.free)
        data.qpos[:], data.qvel[:] = case.q0, case.v0
        if isinstance(rows, GatedRows):
            rows.begin()
        if driver is not None:
            driver.begin(case.act0)
        else:
            data.act[:] = case.act0
        mujoco.mj_forward(model, data)  # the rows that are always on stand there only then

    return start


def _hook(case: Case, data: Any, rows: Switched | None, driver: Forces | None) -> Hook | None:
    """Return what MuJoCo calls in every stage: terms of rows left out, activations and forces."""
    own, force = rows.hook() if rows is not None else None, case.force
    if driver is None and force is None:
        return own
    activated = list(driver.scene.activated) if driver is not None else []
    act = None if force is None else acting_of(force)
    q, v, out = data.qpos, data.qvel, data.qfrc_applied

    def hook(model: Any, data: Any) -> None:
        if act is not None:
            act(data.time, q, v, out)
        if driver is not None:
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


def _audit(case: Case, profile: str, scene: Scene, model: Any, rows: Rows) -> dict[str, Any]:
    """Masses, M and bias at zero input; rows where all of them are always on."""
    model = copy(model)  # rows are put on here
    data = mujoco.MjData(model)
    entered = profile == "matched" and not case.general  # of a robot the states are not those of rows that act
    of_run, rows = rows, rows.anew(scene, model, data)
    if isinstance(rows, GatedRows):
        rows.begin()
        case = _reading(case, rows)
    if isinstance(rows, Switched) and isinstance(of_run, Switched):
        rows.surface[:] = of_run.surface
    laid = rows if isinstance(rows, Switched) and (entered or rows.nc == rows.always) else None
    hook = _hook(case, data, laid, None)

    def look(q: Floats, v: Floats) -> None:
        if isinstance(rows, Switched) and entered:
            rows.arm(rows.free)
            closed = (int(Mode.BILATERAL),) * rows.always + (int(Mode.CONTACT),) * (rows.nc - rows.always)
            rows.arm(rows.entered(closed))
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = q, v
        with hooked(hook):
            mujoco.mj_forward(model, data)

    def M(q: Floats) -> Floats:
        look(q, np.zeros(model.nv))
        return mass_matrix(model, data)

    def bias(q: Floats, v: Floats) -> Floats:
        look(q, v)
        return np.array(data.qfrc_bias - data.qfrc_passive - data.qfrc_actuator - data.qfrc_applied)

    def H(q: Floats) -> Floats:
        look(q, np.zeros(model.nv))
        return rows.jacobian()

    def lam(q: Floats, v: Floats) -> Floats:
        for _ in range(SOLVES if entered else 1):  # what softness leaves of it is R times the change since the last
            look(q, v)
            found = rows.lam()
        if not (entered and isinstance(rows, Switched)):
            return found
        pushes = found[rows.always :] > 0.0
        # MuJoCo's rows never pull: where one would, the others bear something else.
        return found if pushes.all() or len(pushes) == 1 else rows.asked()

    weightless = bool(model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY))
    found: dict[str, Any] = {
        # Compilers fuse bodies without joints, or do not: what moves as one counts as one.
        "masses": np.bincount(model.body_weldid, model.body_mass)[distinct(model.body_weldid)[1:]],
        "gravity": 0.0 if weightless else float(np.linalg.norm(model.opt.gravity)),
        "q0": case.q0, "v0": case.v0, "M": M, "bias": bias,
    }  # fmt: skip
    if profile == "matched" or not case.general:
        found["constants"] = rows.constants(own=profile == "default")
    hidden = {} if profile == "matched" else {"constants": SOFT, "lam": SOFT if case.gates is None else ALL_AT_ONCE}
    if profile == "default" and not case.general:
        return found | {"hidden": hidden, "lam": lam}
    if rows.nc > rows.always and not entered:
        return found | {"hidden": {**hidden, "H": HIDDEN, "lam": HIDDEN}}
    return found | {"hidden": hidden, "H": H} | ({"lam": lam} if profile == "matched" else {})
