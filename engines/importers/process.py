"""What runs beside crossbody: one importer reads one file, and what it has made of it is measured at given states.

It is started by the path of this file, in an interpreter that has NumPy and the engine, and imports nothing of ours:

    python -P process.py IMPORTER.py FILE mjcf|urdf ANSWERS BYTES NICE < jobs

A job is a line of JSON; all but the first name their file, and each has its line in ANSWERS.
Velocities of the scene are v = J v_e of the engine's, with v' = J v_e' + bend: M_e = J^T M J, b_e = J^T (b + M bend).
"""

from __future__ import annotations

import ctypes
import json
import os
import re
import resource
import signal
import sys
from importlib.metadata import PackageNotFoundError, version
from importlib.util import module_from_spec, spec_from_file_location
from typing import Any

import numpy as np

PARENT_DEATH = 1  # PR_SET_PDEATHSIG
LARGEST_FILE = 1 << 28


def rotation(quaternion: Any) -> Any:
    """Return the matrix of a quaternion (w first)."""
    w, x, y, z = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def rotation_vector(quaternion: Any) -> Any:
    """Return axis times angle of a quaternion (w first)."""
    unit = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    unit = -unit if unit[0] < 0.0 else unit
    length = np.linalg.norm(unit[1:])
    return unit[1:] * (2.0 * np.arctan2(length, unit[0]) / length if length else 2.0)


def roll_pitch_yaw(quaternion: Any) -> Any:
    """Return the angles about fixed axes x, y, z of a quaternion (w first)."""
    R = rotation(quaternion)
    return np.array(
        [np.arctan2(R[2, 1], R[2, 2]), np.arcsin(np.clip(-R[2, 0], -1.0, 1.0)), np.arctan2(R[1, 0], R[0, 0])]
    )


def _x_first(quaternion: Any) -> Any:
    return np.roll(quaternion, -1)


def _free_body(q: Any, v: Any) -> Any:
    R, J, bend = rotation(q[3:]), np.eye(6), np.zeros(6)
    J[:3, :3] = R
    bend[:3] = R @ np.cross(v[3:], v[:3])
    return np.concatenate([q[:3], _x_first(q[3:])]), J, bend


def _free_world(q: Any, angles_first: Any) -> Any:
    J = np.zeros((6, 6))
    J[:3, 3:], J[3:, :3] = np.eye(3), rotation(q[3:]).T
    return np.concatenate([angles_first, q[:3]]), J, np.zeros(6)


def _plain(q: Any, v: Any) -> Any:
    return np.asarray(q, dtype=float), np.eye(len(v)), np.zeros(len(v))


CONVENTIONS: dict[str, Any] = {
    "mujoco": _plain,
    "p, xyzw; body, body": _free_body,
    "wxyz, p; world, world": lambda q, v: _free_world(q, q[3:]),
    "rotation vector, p; world, world": lambda q, v: _free_world(q, rotation_vector(q[3:])),
    "p, xyzw; world, world": lambda q, v: (
        np.concatenate([q[:3], _x_first(q[3:])]), np.block([[np.eye(3), np.zeros((3, 3))],
                                                            [np.zeros((3, 3)), rotation(q[3:]).T]]), np.zeros(6)),
    "xyzw; body": lambda q, v: (_x_first(q), np.eye(3), np.zeros(3)),
    "xyzw; parent": lambda q, v: (_x_first(q), rotation(q).T, np.zeros(3)),
    "rpy; parent": lambda q, v: (roll_pitch_yaw(q), rotation(q).T, np.zeros(3)),
    "rotation vector; body": lambda q, v: (rotation_vector(q), np.eye(3), np.zeros(3)),
    "unbounded": lambda q, v: (np.array([np.cos(q[0]), np.sin(q[0])]), np.eye(1), np.zeros(1)),
}  # fmt: skip
"""How an engine writes a joint -> (q, v of the scene) -> its q, J, J' v_e."""


def limit(size: int) -> None:
    """End with the parent, and take no more memory than this, no file larger than another."""
    resource.setrlimit(resource.RLIMIT_DATA, (size, size))
    resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_FILE, LARGEST_FILE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        ctypes.CDLL(None).prctl(PARENT_DEATH, signal.SIGKILL)
    except (OSError, AttributeError):
        return


def matched(ours: Any, theirs: Any) -> dict[str, int]:
    """Return our joint -> number of theirs: by name; else in order on the body of that name, if the kinds agree."""
    kinds = ["hinge" if joint[2] == "unbounded" else joint[2] for joint in theirs]
    found: dict[str, int] = {}
    for name, _, kind in ours:
        same = [i for i, joint in enumerate(theirs) if joint[0] == name and kinds[i] == kind]
        if len(same) == 1:
            found[name] = same[0]
    for body in {joint[1] for joint in ours}:
        mine = [joint for joint in ours if joint[1] == body and joint[0] not in found]
        left = [i for i, joint in enumerate(theirs) if joint[1] == body and i not in found.values()]
        if [kind for *_, kind in mine] == [kinds[i] for i in left]:
            found |= {joint[0]: i for joint, i in zip(mine, left, strict=True)}
    return found


VIEWS = [rotation(q) for q in ((1, 0, 0, 0), (0.8, 0.3, -0.5, 0.2), (0.6, -0.4, 0.1, 0.7), (0.5, 0.2, 0.6, -0.3))]


class Measured:
    """An engine's robot in the scene's coordinates.

    Args:
        robot: a `Robot`.
        ours: name, body and kind of the scene's joints.
        found: of `matched`, for all of them.
    """

    def __init__(self, robot: Any, ours: Any, found: Any) -> None:
        self.robot, self.ours = robot, ours
        self.to = [robot.joints[found[name]] for name, *_ in ours]

    def at(self, q: Any, v: Any) -> dict[str, Any]:
        """Return what the engine has at a state."""
        robot = self.robot
        lacks = robot.hidden.keys() | robot.unseen.keys()
        still = self._of_state(q, [np.zeros(len(part)) for part in v])
        moving = self._of_state(q, v)
        shown = {"M": moving[0], "bias": moving[1], "gravity": still[1]}
        told = {key: value.tolist() for key, value in shown.items() if key not in lacks}
        told["frames"] = {name: posed(*pose) for name, pose in robot.frames().items()}
        told["ends"] = [[posed(*pose) for pose in ends] for ends in robot.ends()]
        if "energy" not in lacks:
            told["energy"] = float(robot.energy())
        if "tendons" not in lacks:
            told["tendons"] = {name: float(length) for name, length in robot.lengths().items()}
        if "actuators" not in lacks:
            driven, held = robot.drives()
            told["driven"] = {name: self._forces(force).tolist() for name, force in driven.items()}
            told["held"] = self._forces(held).tolist()
        return told | {"v": [x for part in v for x in part]}

    def _forces(self, force: Any) -> Any:
        """Return forces of the scene by those of the engine, at the state that was last asked for."""
        return np.linalg.solve(self._J.T, np.asarray(force, dtype=float)[self._order])

    def _of_state(self, q: Any, v: Any) -> Any:
        robot, n = self.robot, sum(len(part) for part in v)
        J: Any = np.zeros((n, n))
        bend, order = np.zeros(n), np.zeros(n, dtype=int)
        q_e, v_e, row = np.zeros(robot.nq), np.zeros(robot.nv), 0
        for (_, _, kind, at, first), q_j, v_j in zip(self.to, q, v, strict=True):
            here = slice(row, row + len(v_j))
            q_part, J[here, here], _ = self._mapped(kind, q_j, v_j)
            v_part = np.linalg.solve(J[here, here], v_j)
            bend[here] = self._mapped(kind, q_j, v_part)[2]
            q_e[at : at + len(q_part)], v_e[first : first + len(v_j)] = q_part, v_part
            order[here] = np.arange(first, first + len(v_j))
            row += len(v_j)
        robot.place(q_e, v_e)
        self._J, self._order = J, order
        M, b = np.zeros((n, n)), np.zeros(n)
        if "M" not in robot.hidden:
            M = np.linalg.solve(J.T, np.linalg.solve(J.T, np.asarray(robot.mass_matrix())[np.ix_(order, order)]).T)
        if "gravity" not in robot.hidden:
            b = np.linalg.solve(J.T, np.asarray(robot.bias())[order]) - M @ bend
        return M, b

    def _mapped(self, kind: str, q: Any, v: Any) -> Any:
        of = {"free": self.robot.free, "ball": self.robot.ball, "unbounded": "unbounded"}
        return CONVENTIONS[of.get(kind, "mujoco")](np.asarray(q, dtype=float), np.asarray(v, dtype=float))

    def shapes(self, named: Any) -> list[Any]:
        """Return name, kind, joint that moves it, and boxes in the axes of that joint's body, of every shape."""
        frames, told = self.robot.frames(), []
        bodies = {joint[0]: body for (_, body, _), joint in zip(self.ours, self.to, strict=True)}
        for name, kind, joint, size, points, p, R in self.robot.shapes():
            frame = frames.get(bodies.get(joint, ""), (np.zeros(3), np.eye(3)))
            told.append([name, kind, named.get(joint, joint), boxes(kind, size, points, p, R, frame)])
        return told

    def inertias(self) -> dict[str, Any]:
        """Return mass, centre and inertia about it of what each joint moves up to the next ones, in the body's axes."""
        frames, parts = self.robot.frames(), list(self.robot.inertias())
        told = {}
        for (name, body, _), joint in zip(self.ours, self.to, strict=True):
            own = [part for part in parts if part[0] == joint[0]]
            if own and body in frames:
                told[name] = composite(own, *frames[body])
        return told


def posed(p: Any, R: Any) -> Any:
    """Return a pose as lists."""
    return [np.asarray(p, dtype=float).tolist(), np.asarray(R, dtype=float).tolist()]


def boxes(kind: str, size: Any, points: Any, p: Any, R: Any, frame: Any) -> list[list[float]]:
    """Return `bounds` of a shape as seen from four sides of a frame (p, R): one side alone would hide how it stands."""
    origin, axes = (np.asarray(part, dtype=float) for part in frame)
    place, turn = axes.T @ (np.asarray(p, dtype=float) - origin), axes.T @ np.asarray(R, dtype=float)
    return [bounds(kind, size, points, view @ place, view @ turn) for view in VIEWS]


def bounds(kind: str, size: Any, points: Any, p: Any, R: Any) -> list[float]:
    """Return lowest and highest x, y and z of a shape: the same for every way of writing it.

    Args:
        kind: sphere, capsule, cylinder, box, ellipsoid or plane; of any other the points count.
        size: radius; radius and half length along z; half sides; semi-axes, m.
        points: of a mesh (n, 3), in its own axes.
        p: where it stands (3,).
        R: how it is turned (3, 3).

    Returns:
        (6,); of a plane, which has no bounds, its normal and the distance along it, twice.
    """
    p, R = np.asarray(p, dtype=float), np.asarray(R, dtype=float)
    if kind == "plane":
        return [*R[:, 2], *[float(R[:, 2] @ p)] * 3]
    if kind in ("sphere", "capsule", "cylinder", "box", "ellipsoid"):
        a, b, c = (np.abs(R[:, k]) for k in range(3))
        x, y, z = (float(one) for one in (*size, 0.0, 0.0, 0.0)[:3])
        reach: dict[str, Any] = {
            "sphere": lambda: np.full(3, x), "capsule": lambda: x + y * c,
            "cylinder": lambda: x * np.hypot(a, b) + y * c,
            "box": lambda: x * a + y * b + z * c, "ellipsoid": lambda: np.linalg.norm(R * [x, y, z], axis=1),
        }  # fmt: skip
        far = reach[kind]()
        return [*(p - far).tolist(), *(p + far).tolist()]
    at = p + np.asarray(points, dtype=float).reshape(-1, 3) @ R.T if len(points) else p[None]
    return [*at.min(axis=0).tolist(), *at.max(axis=0).tolist()]


def composite(parts: Any, p: Any, R: Any) -> list[float]:
    """Return mass, centre and inertia about it of parts in a frame."""
    p, R = np.asarray(p), np.asarray(R)
    mass = sum(part[1] for part in parts)
    if not mass:
        return [0.0, *np.zeros(9)]
    centre = sum(part[1] * np.asarray(part[2]) for part in parts) / mass
    J = np.zeros((3, 3))
    for _, m, c, about in parts:
        d = np.asarray(c) - centre
        J += np.asarray(about) + m * (d @ d * np.eye(3) - np.outer(d, d))
    turned = R.T @ J @ R
    return [float(mass), *(R.T @ (centre - p)).tolist(), *turned[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()]


def measured(robot: Any, job: Any) -> dict[str, Any]:
    """Return what a robot's reader has made of its file, in the coordinates of the job's joints."""
    ours, theirs = job["joints"], [list(joint) for joint in robot.joints]
    found = matched(ours, theirs)
    extra = [joint[0] for i, joint in enumerate(theirs) if i not in found.values()]
    numbers = {
        key: {name: list(values[theirs[i][0]]) for name, i in found.items() if theirs[i][0] in values}
        for key, values in robot.numbers.items()
    }
    named = {theirs[i][0]: name for name, i in found.items()}
    told: dict[str, Any] = {
        "status": "read", "version": robot.version, "hidden": dict(robot.hidden), "unseen": dict(robot.unseen),
        "numbers": numbers,
        "precision": robot.precision, "missing": [name for name, *_ in ours if name not in found], "extra": extra,
        "actuators": {name: sorted(named.get(one, one) for one in of) for name, of in robot.actuators.items()},
        "loops": [[kind, [named.get(one, one) for one in of], list(numbers)] for kind, of, numbers in robot.loops],
        "tendons": {name: list(numbers) for name, numbers in robot.tendons.items()}, "states": [],
    }  # fmt: skip
    if not told["missing"] and not extra:
        whole = Measured(robot, ours, found)
        for state in job["states"]:
            told["states"].append(whole.at(state["q"], state["v"]))
        told["inertias"] = whole.inertias()
        lacks = robot.hidden.keys() | robot.unseen.keys()
        told["shapes"] = [] if "shapes" in lacks else whole.shapes(named)
        told["contacts"] = [] if "contacts" in lacks else [list(map(int, pair)) for pair in robot.contacts()]
    return told


def installed(module: Any) -> str:
    """Return the version of the engine's package; empty where that is not known."""
    try:
        return version(module.PACKAGE)
    except PackageNotFoundError:
        return ""


def tried(module: Any) -> str:
    """Return a sentence on a version of the engine that no importer was tried with; empty for one that was."""
    found = installed(module)
    low, high = getattr(module, "TRIED", ("0", "999999"))
    number = [int(word) for word in re.findall(r"\d+", found)[:2]]
    if not found or [int(word) for word in low.split(".")] <= number <= [int(word) for word in high.split(".")]:
        return ""
    return f"{module.PACKAGE} is of version {found}; its importer was tried with {low} to {high}."


def answered(module: Any, file: str, urdf: bool, job: Any, size: int) -> dict[str, Any]:
    """Return what was measured of one file, or why there is nothing.

    Args:
        module: the importer.
        file: what it reads.
        urdf: whether that is a URDF.
        job: gives the job, which may come later than the file.
        size: bytes that it may take.
    """
    try:
        robot = module.open_robot(file, urdf)
        asked = job()
        return measured(robot, asked)
    except ModuleNotFoundError as error:
        lacking = (error.name or "").partition(".")[0]
        own = lacking == module.MODULE
        why = f"It needs the package {module.PACKAGE if own else lacking}, which is not installed."
        return {"status": "absent" if own else "failed", "why": why}
    except MemoryError:
        return {"status": "failed", "why": f"It wants more than {size >> 20} MiB of memory."}
    except Exception as error:
        return {"status": "failed", "why": " ".join(f"{type(error).__name__}: {error}".split())}


def main(importer: str, file: str, kind: str, answers: str, size: str, nice: str) -> None:
    """Read, measure, and leave a line for every job in a file; what engines print is the messages."""
    os.nice(int(nice))
    limit(int(size))
    spec = spec_from_file_location("importer", importer)
    if spec is None or spec.loader is None:
        raise ImportError(f"{importer} is no Python file")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    strange, number, said, line = tried(module), installed(module), 0, list[str]()

    def job() -> Any:
        line[:] = line or [sys.stdin.readline()]
        return json.loads(line[0] or "{}")

    while file:
        told = {"version": number} | answered(module, file, kind == "urdf", job, int(size))
        told |= {"strange": strange, "from": said}
        job()
        sys.stdout.flush()
        sys.stderr.flush()
        said = os.lseek(1, 0, os.SEEK_CUR)
        with open(answers, "a", encoding="utf-8") as out:
            out.write(json.dumps(told | {"to": said}) + "\n")
        line[:] = [sys.stdin.readline()]
        file = job().get("file", "")
    os._exit(0)  # an engine may crash where it is torn down


if __name__ == "__main__":
    main(*sys.argv[1:])
