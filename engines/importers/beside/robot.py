"""What an engine's reader has made of a file, in the coordinates of the joints that are asked for."""

from __future__ import annotations

from typing import Any

import numpy as np

from .conventions import CONVENTIONS
from .solids import boxes, composite, posed

WIDTHS = {"free": 6, "ball": 3}  # velocities of a joint, of others 1


UNSAID: dict[str, Any] = {
    "hidden": {}, "unseen": {}, "refused": (), "tendons": {}, "keys": {}, "actuators": {}, "loops": (),
    "precision": 0.0,
}  # fmt: skip
"""What a robot has where its reader says nothing."""


def matched(ours: Any, theirs: Any) -> dict[str, int]:
    """Return our joint -> number of theirs: by name; else in order on that body, if kinds agree."""
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


class Measured:
    """An engine's robot in the coordinates of the scene's joints, each of which was `matched`."""

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
        told["ends"] = (
            [[posed(*pose) for pose in ends] for ends in robot.ends()]
            if hasattr(robot, "ends")
            else ([[] for _ in robot.loops])
        )
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

    def keys(self, wanted: Any) -> dict[str, Any]:
        """Return of every keyframe that both have its positions, the engine's and what they are to be."""
        told = {}
        for name in self.robot.keys.keys() & wanted.keys():
            q_e = np.zeros(self.robot.nq)
            for (_, _, kind, at, _), q_j in zip(self.to, wanted[name], strict=True):
                q_part = self._mapped(kind, q_j, np.zeros(WIDTHS.get(kind, 1)))[0]
                q_e[at : at + len(q_part)] = q_part
            told[name] = [list(map(float, self.robot.keys[name])), q_e.tolist()]
        return told

    def _mapped(self, kind: str, q: Any, v: Any) -> Any:
        of = {"free": self.robot.free, "ball": self.robot.ball, "unbounded": "unbounded"}
        return CONVENTIONS[of.get(kind, "mujoco")](np.asarray(q, dtype=float), np.asarray(v, dtype=float))

    def shapes(self, named: Any) -> list[Any]:
        """Return name, kind, joint that moves it, and boxes in its body's axes, of every shape."""
        frames, told = self.robot.frames(), []
        bodies = {joint[0]: body for (_, body, _), joint in zip(self.ours, self.to, strict=True)}
        for name, kind, joint, size, points, p, R in self.robot.shapes():
            frame = frames.get(bodies.get(joint, ""), (np.zeros(3), np.eye(3)))
            told.append([name, kind, named.get(joint, joint), boxes(kind, size, points, p, R, frame)])
        return told

    def inertias(self) -> dict[str, Any]:
        """Return mass, centre and inertia about it of what each joint alone moves, in the body's axes."""
        frames, parts = self.robot.frames(), list(self.robot.inertias())
        told = {}
        for (name, body, _), joint in zip(self.ours, self.to, strict=True):
            own = [part for part in parts if part[0] == joint[0]]
            if own and body in frames:
                told[name] = composite(own, *frames[body])
        return told


def measured(robot: Any, job: Any) -> dict[str, Any]:
    """Return what a robot's reader has made of its file, in the coordinates of the job's joints."""
    for key, value in UNSAID.items():
        if not hasattr(robot, key):
            setattr(robot, key, value)
    ours, theirs = job["joints"], [list(joint) for joint in robot.joints]
    found = matched(ours, theirs)
    extra = [joint[0] for i, joint in enumerate(theirs) if i not in found.values()]
    numbers = {
        key: {name: list(values[theirs[i][0]]) for name, i in found.items() if theirs[i][0] in values}
        for key, values in robot.numbers.items()
    }
    named = {theirs[i][0]: name for name, i in found.items()}
    told: dict[str, Any] = {
        "status": "read", "version": robot.version, "hidden": dict(robot.hidden),
        "unseen": dict(robot.unseen), "refused": list(robot.refused), "numbers": numbers,
        "precision": robot.precision, "missing": [name for name, *_ in ours if name not in found],
        "extra": extra,
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
        told["surfaces"] = [] if "surfaces" in lacks else [list(map(float, pair)) for pair in robot.surfaces()]
        told["softness"] = {} if "softness" in lacks else {k: list(map(float, a)) for k, a in robot.softness().items()}
        told["keys"] = {} if "keyframes" in lacks else whole.keys(job.get("keys", {}))
    return told
