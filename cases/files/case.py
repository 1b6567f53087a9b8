"""A robot file as a case: its keyframes are the variants, its horizon and its rows' law the parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypedDict, cast

import numpy as np
from numpy.typing import ArrayLike

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Case, Coordinate, Inputs, Limit, Parameter, Value
from crossbody.cases.control import Control
from crossbody.cases.errors import InvalidValue, SceneError, several, shown
from crossbody.cases.files.controls import pushed, read_control, read_controls, under
from crossbody.cases.files.reading import check_text, existing, findings_of, model_of, read, scene_of
from crossbody.cases.rotations import normalised
from crossbody.cases.scene import RowLaw, Scene
from crossbody.cases.scene_contacts import check_pairs, law_of, rough, rows_of

REFERENCE_POSE, UNNAMED = "reference", "scene"
OF_THE_FILE = -1.0
WHERE_MET = -1  # of the parameter friction: contacts that slide have rows if the motion comes to one
PARAMETERS = {
    "t_end": Parameter(default=1.0, unit="s", doc="horizon", low=0.0, open_low=True),
    "a0": Parameter(default=OF_THE_FILE, unit="1/s^2", doc="stiffness of every row; -1: the file's", low=OF_THE_FILE),
    "a1": Parameter(default=OF_THE_FILE, unit="1/s", doc="damping of every row; -1: the file's", low=OF_THE_FILE),
    "without": Parameter(
        default="", doc="left out of every engine: friction, contacts, medium, loop:NAME, ..., separated by commas"
    ),
    "ctrl": Parameter(default="", doc="table of controls: t and a column for every actuator (CSV, Parquet, NPZ)"),
    "control": Parameter(default="", doc="controller: FILE.py:NAME of a callable (t, q, v) -> u, or of a class"),
    "tick": Parameter(default=1e-3, unit="s", doc="between two calls of the controller", low=0.0, open_low=True),
    "friction": Parameter(
        default=WHERE_MET, doc="contacts with friction have rows: 1, 0; -1: if the motion reaches one", low=-1, high=1
    ),
    "push": Parameter(
        default="", doc="forces: BODY FX FY FZ T0 T1, N and s, at its centre of mass; several separated by ;"
    ),
    "start": Parameter(
        default="",
        doc="coordinates at the start, in place of the keyframe's: NAME VALUE, m or rad; several separated by ;",
    ),
    "rate": Parameter(
        default="", doc="velocities at the start, in place of the keyframe's: NAME VALUE, m/s or rad/s; separated by ;"
    ),
    "rank": Parameter(
        default=-1,
        doc="number of independent rows of the loops; -1: those that are clearly independent",
        low=-1,
        high=1e6,
    ),
    "assemble": Parameter(
        default=False, doc="start at the nearest state to the keyframe that closes the loops", low=0, high=1
    ),
}
ENTRIES = {
    "free": ((*"xyz", "qw", "qx", "qy", "qz"), ("m",) * 3 + ("1",) * 4),
    "ball": (("qw", "qx", "qy", "qz"), ("1",) * 4),
    "slide": (("",), ("m",)),
    "hinge": (("",), ("rad",)),
}
RATES = ENTRIES | {
    "free": ((*"xyz", "rx", "ry", "rz"), ("m",) * 3 + ("rad",) * 3),
    "ball": (("rx", "ry", "rz"), ("rad",) * 3),
}
"""Names and units of the positions and of the velocities of each kind of joint."""
ROUNDS = 50
CLOSED = 1e-13  # m or rad: rounding of a gap
DEPENDENT = 1e-9  # singular value of the rows, over the largest, that counts as zero


@dataclass(frozen=True, kw_only=True)
class FileCase:
    """What a case's module offers, for a file."""

    path: Path
    PARAMETERS: Mapping[str, Parameter] = field(default_factory=lambda: PARAMETERS)

    @property
    def __file__(self) -> str:
        """The file."""
        return str(self.path)

    @cached_property
    def model(self) -> Any:
        """MuJoCo's model of the file but for what its meshes touch, whose text is looked at here, once."""
        check_text(self.path)
        return model_of(self.path, "meshes")

    @cached_property
    def VARIANTS(self) -> Mapping[str, Mapping[str, Value]]:
        """The keyframes of the file, the pose of its bodies if it has none."""
        names = [self.model.key(i).name or f"key{i}" for i in range(self.model.nkey)]
        return {name: {} for name in names or [REFERENCE_POSE]}

    def build(self, variant: str, p: Mapping[str, Value]) -> Case:
        """Return the case of one keyframe."""
        index = list(self.VARIANTS).index(variant) if self.model.nkey else -1
        q0 = self.model.qpos0 if index < 0 else self.model.key_qpos[index]
        v0 = np.zeros(self.model.nv) if index < 0 else self.model.key_qvel[index]
        model, told = read(self.path, str(p["without"]))
        scene = scene_of(self.path, model).replace(friction=p["friction"] == 1)
        q0, v0 = changed("start", q0, coordinates(scene), p), changed("rate", v0, coordinates(scene, RATES), p)
        if p["assemble"]:
            q0, v0 = assembled(model, q0, v0)
        ctrl = np.zeros(self.model.nu) if index < 0 else self.model.key_ctrl[index]
        act0 = np.zeros(self.model.na) if index < 0 else self.model.key_act[index]
        scene = overruled(scene, float(p["a0"]), float(p["a1"]))
        inputs = read_controls(Path(str(p["ctrl"])), scene) if p["ctrl"] else held(scene, ctrl)
        scene, inputs = pushed(scene, inputs, str(p["push"]))
        case = case_of(
            scene, name=self.path.name, variant=variant, q0=q0, v0=v0, act0=act0, rank=int(p["rank"]),
            t_end=float(p["t_end"]), findings=(*told, *findings_of(self.path)),
            inputs=inputs, parameters=p, file=str(self.path.resolve()),
        )  # fmt: skip
        return under(case, read_control(str(p["control"]), float(p["tick"]))) if p["control"] else case


def changed(name: str, values: Floats, of: Sequence[Coordinate], given: Mapping[str, Value]) -> Floats:
    """Return what a start has with the numbers that a parameter gives some of its entries by name.

    Raises:
        InvalidValue: for what is no number of an entry; entries of quaternions are no freedoms, and have none.
    """
    found, free = np.array(values), {one.name: at for at, one in enumerate(of) if one.unit != "1"}
    for part in filter(str.strip, str(given[name]).split(";")):
        entry, _, number = part.strip().rpartition(" ")
        try:
            value = float(number)
        except ValueError:
            value = np.nan
        if entry.strip() not in free or not np.isfinite(value):
            valid = f"a finite number behind one of {', '.join(free)}"
            raise InvalidValue(f"{name}: {shown(part.strip())} is not a name and its value; valid: {valid}.")
        found[free[entry.strip()]] = value
    return found


def open_file(name: str) -> FileCase:
    """Return what a file offers."""
    return FileCase(path=existing(Path(name)))


def rubbing(case: Case) -> Case | None:
    """Return a file's case with the friction of its contacts, if its motion is to tell whether it has rows; else None.

    None too where no contact has friction of a kind that is done.
    """
    if case.scene is None or case.parameters.get("friction") != WHERE_MET:
        return None
    scene = case.scene.replace(friction=True)
    if rough(scene) is None:
        return None
    return replace(
        case, scene=scene, contacts=tuple(rows_of(scene)[0]), law=law_of(scene),
        parameters={**case.parameters, "friction": 1},
    )  # fmt: skip


def overruled(scene: Scene, a0: float, a1: float) -> Scene:
    """Return the scene with these constants for all of its rows; those of the file stay at `OF_THE_FILE`.

    Raises:
        InvalidValue: for any other number below 0.
    """
    for name, value in (("a0", a0), ("a1", a1)):
        if value < 0.0 and value != OF_THE_FILE:
            raise InvalidValue(f"{name} is {value:g}; valid: at least 0, or {OF_THE_FILE:g} for the file's own.")
    if a0 < 0.0 and a1 < 0.0:
        return scene

    def law(own: RowLaw) -> RowLaw:
        return RowLaw(a0=own.a0 if a0 < 0.0 else a0, a1=own.a1 if a1 < 0.0 else a1)

    changed: dict[str, Any] = {}
    for group in ("joints", "pairs", "loops", "tendons"):
        changed[group] = tuple(replace(part, law=law(part.law)) for part in getattr(scene, group))
    return scene.replace(**changed)


class Given(TypedDict, total=False):
    """What may be given beside a scene, by name; what each means stands in `case_of`."""

    name: str
    variant: str
    q0: ArrayLike | None
    v0: ArrayLike | None
    act0: ArrayLike | None
    rank: int
    inputs: Inputs | None
    control: Control | None
    t_end: float
    parameters: Mapping[str, Value] | None
    file: str
    findings: tuple[str, ...]


def case_of(
    scene: Scene,
    *,
    name: str = UNNAMED,
    variant: str = REFERENCE_POSE,
    q0: ArrayLike | None = None,
    v0: ArrayLike | None = None,
    act0: ArrayLike | None = None,
    rank: int = -1,
    inputs: Inputs | None = None,
    control: Control | None = None,
    t_end: float = 1.0,
    parameters: Mapping[str, Value] | None = None,
    file: str = "",
    findings: tuple[str, ...] = (),
) -> Case:
    """Return a scene as a case: its rows are loops, bounds of joints and tendons, contacts, dry friction.

    Args:
        scene: what moves.
        name: of the case.
        variant: of the case.
        q0: start (nq,); the reference pose if not given.
        v0: velocities there (nv,); at rest if not given.
        act0: activations there (na,) of the actuators that have one; 0 if not given.
        rank: how many rows of the loops hold; below 0 those that surely do.
        inputs: controls of the actuators, then the components of the pushes; zero if not given.
        control: gives the controls at its ticks; those of the inputs are zero then.
        t_end: horizon, s.
        parameters: of the case.
        file: where the scene comes from.
        findings: sentences on what is strange there.

    Raises:
        SceneError: for a scene that no engine here can run, naming what stands against it.
    """
    check_runnable(scene)
    if not file:  # of a file's the run tells whether they meet
        check_pairs(scene)
    if rank >= 0 and not scene.loops:
        raise SceneError(f"rank is {rank}, but the scene has no loops.")
    start = normalised(reference_pose(scene) if q0 is None else np.asarray(q0), quaternions(scene))
    names, laws, _ = rows_of(scene)
    if fast := [name for name, one in zip(names, laws, strict=True) if one.b0 or one.b1]:
        raise SceneError(
            f"Row {fast[0]!r} has constants of COLLISION, which the rows of a scene do not have: b0, b1 must be 0."
        )
    bodies, freedom = several(len(scene.bodies), "body", "bodies"), several(scene.nv, "degree", "degrees")
    return Case(
        name=name, variant=variant, title=f"{bodies}, {freedom} of freedom",
        mechanism="scene", parameters=dict(parameters or {"t_end": t_end}),
        coordinates=coordinates(scene), velocities=coordinates(scene, RATES), quaternions=quaternions(scene),
        contacts=tuple(names), q0=start,
        v0=np.zeros(scene.nv) if v0 is None else cast(Floats, v0),  # arrays are checked there
        act0=np.zeros(0) if act0 is None else cast(Floats, act0), t_end=t_end, law=law_of(scene),
        inputs=inputs or held(scene), scene=scene, rank=rank,
        control=control, file=file, findings=findings,
        limits=AS_IT_STANDS if file else (),
    )  # fmt: skip


def check_runnable(scene: Scene) -> None:
    """Refuse what the engines here do not have."""
    spans = {tendon.name for tendon in scene.tendons if tendon.bodies}
    for loop in scene.loops:
        for name in {loop.first, loop.second} & spans if loop.type == "tendon" else ():
            raise SceneError(
                f"Tendon {name!r} runs between two points: no loop ({loop.name!r}) can couple "
                f"it; without=loop:{loop.name} leaves that out of every engine."
            )


def coordinates(scene: Scene, entries: Any = ENTRIES) -> tuple[Coordinate, ...]:
    """Return names and units of q, or of v by `RATES`."""
    return tuple(
        Coordinate(name=f"{joint.name} {name}".strip(), unit=unit)
        for joint in scene.joints
        for name, unit in zip(*entries[joint.type], strict=True)
    )


def quaternions(scene: Scene) -> tuple[int, ...]:
    """Return where in q each quaternion begins."""
    units = [coordinate.name.endswith(" qw") for coordinate in coordinates(scene)]
    return tuple(np.flatnonzero(units).tolist())


def reference_pose(scene: Scene) -> Floats:
    """Return q at the pose that `Body.position` gives."""
    placed = {body.name: (*body.position, *body.orientation) for body in scene.bodies}
    parts: list[Any] = []
    for joint in scene.joints:
        single = (1.0, 0.0, 0.0, 0.0) if joint.type == "ball" else (joint.reference,)
        parts.append(placed[joint.body] if joint.type == "free" else single)
    return np.concatenate([np.zeros(0), *parts])


def held(scene: Scene, ctrl: Any = None) -> Inputs | None:
    """Return controls held from the start on, with pushes of 0 N; None for a scene without inputs."""
    if not scene.inputs:
        return None
    values = np.zeros((1, len(scene.inputs)))
    if ctrl is not None:
        values[0, : len(scene.actuators)] = ctrl
    return Inputs(names=scene.inputs, times=np.zeros(1), values=values)


AS_IT_STANDS = (
    Limit(
        metric="*", engine="mujoco", profile="as_is", covers_none=True,
        known="MuJoCo's step, integrator and soft rows, those of the file where it has some: the parts of its error "
        "show the effect of each",
    ),
    Limit(
        metric="event_gap", value=1.0, engine="mujoco", profile="as_is", covers_none=True,
        known="its rows are in contact while they push, which may begin and end below their surface",
    ),
    *(
        Limit(
            metric=f"largest {metric} (importer)", value=1e-9, engine="mujoco", profile="as_is",
            why="the same engine and steps on the model that is built from the scene: rounding, and its growth",
        )
        for metric in ("position", "event_times")
    ),
    *(
        Limit(metric="*", engine="drake", profile=profile, covers_none=True, known=known)
        for profile, known in (
            ("continuous", "Runge-Kutta 3 and an accuracy of 1e-4, the defaults of a Simulator, and no rows"),
            ("default", "steps of 1 ms, and bounds that are springs: the parts of its error show their effect"),
        )
    ),
)  # fmt: skip
"""Of what an engine makes of a file by itself: its reader is judged, what it computes is told."""


def assembled(model: Any, q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Return the nearest start with every loop closed: Newton's method, each step the least in the metric of M.

    Returns:
        Positions (nq,) and velocities (nv,) that keep the loops closed.
    """
    import mujoco

    data, found = mujoco.MjData(model), np.array(q)
    M = np.zeros((model.nv, model.nv))
    for _ in range(ROUNDS):
        data.qpos[:], data.qvel[:] = found, 0.0
        mujoco.mj_fwdPosition(model, data)
        if not data.ne:
            return found, v
        h, H = np.array(data.efc_pos[: data.ne]), np.array(data.efc_J).reshape(-1, model.nv)[: data.ne]
        mujoco.mj_fullM(model, data, M)
        root = np.linalg.cholesky(M)
        rows = np.linalg.solve(root, H.T).T
        off_h, off_v = np.linalg.lstsq(rows, np.column_stack([h, H @ v]), rcond=DEPENDENT)[0].T
        if np.abs(h).max(initial=0.0) <= CLOSED:
            return found, v - np.linalg.solve(root.T, off_v)
        mujoco.mj_integratePos(model, found, -np.linalg.solve(root.T, off_h), 1.0)
    raise SceneError(
        f"The start cannot be assembled: no positions that close the loops were found from q = {q.tolist()}."
    )
