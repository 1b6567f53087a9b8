"""H' v of contacts, strings, bounds of ball joints and curved couplings, which MuJoCo leaves out.

It has J v' = -a1 h' - a0 h there, where the law has h'' = H v' + H' v.

By a difference of H along the motion, in a second set of data; MuJoCo has the term of `connect` and `weld`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Joint, Scene, Tendon, Vector
from crossbody.engines._contacts import TURN, Contacts, Flat, Indices, closing, drift, flat
from crossbody.engines._scene import angle_of, derivatives, horner, places
from crossbody.engines.mujoco._scene import numbers, pose_of
from crossbody.engines.nearest import Pose, cross


class Drift:
    """H' v of the contacts of a scene, of its tendons between points, and of angles of ball joints."""

    def __init__(self, scene: Scene, model: Any, contacts: Contacts) -> None:
        self.model, self.data, self.contacts = model, mujoco.MjData(model), contacts
        self.numbers = numbers(scene)
        self.pose = pose_of(self.data, self.numbers)
        self.carriers = np.array([self.numbers[body] for body in contacts.bodies], dtype=np.intp)
        self.bounded, self.at, self.place = scene.bounded, *places(scene)
        self.roots = model.body_rootid[self.carriers]
        self.moving = np.array([carried(model, body) for body in self.carriers]).reshape(-1, model.nv)
        none = [(np.eye(3), np.zeros(3))] * len(contacts.bodies)
        self.flat = Flat(contacts, none) if flat(contacts.all) else None
        self.row = np.repeat(np.arange(model.ntendon), model.ten_J_rownnz)  # of each entry of the tendons' Jacobian

    def __call__(self, now: Any, parts: Sequence[int], rows: Sequence[int]) -> tuple[Floats, Floats]:
        """Return that of some of `Scene.bounded`, 0 of a sum of joints, and of some rows of the contacts.

        MjData is that of a state that is evaluated up to its forces.
        """
        if self.flat is not None and len(rows):
            lengths = self(now, parts, ())[0] if len(parts) else np.zeros(0)
            return lengths, self._over_planes(self.flat, now, rows)
        q, v = now.qpos, now.qvel.copy()
        self.data.qvel[:], self.data.qpos[:] = v, q
        along: dict[int, bool] = {}
        turn = TURN
        if len(rows) and self.contacts.turning:
            mujoco.mj_kinematics(self.model, self.data)
            along, turn = self.contacts.lying(self.pose, rows)

        def rates(times: Floats) -> Floats:
            found, states = [], []
            for t in times:
                self.data.qpos[:] = q
                mujoco.mj_integratePos(self.model, self.data.qpos, v, t)
                mujoco.mj_kinematics(self.model, self.data)
                mujoco.mj_comPos(self.model, self.data)
                found.append(self._rates(parts, v) if len(parts) else [])
                if len(rows):
                    mujoco.mj_comVel(self.model, self.data)
                    states.append(self._state())
            own = np.array(found).reshape(len(times), -1)
            return np.concatenate([own, self._closing(states, rows, along)], axis=1) if len(rows) else own

        lengths, touches = np.split(drift(rates, v, turn), [len(parts)])
        return lengths, touches

    def _over_planes(self, flat: Flat, data: Any, rows: Sequence[int]) -> Floats:
        """Return that of points over planes at a state that MuJoCo has evaluated up to its forces."""
        k = self.carriers
        both = np.array([data.cvel.take(k, 0), (self.moving * data.qvel) @ data.cdof_dot])
        turns = both[:, :, :3]  # first, and both are about the centres of mass of the bodies' trees
        moves = both[:, :, 3:] + cross(data.subtree_com.take(self.roots, 0), turns)
        twist, change = np.concatenate([moves, turns], axis=2)
        return flat.drift((data.xmat.take(k, 0).reshape(-1, 3, 3), data.xpos.take(k, 0)), twist, change, rows)

    def _state(self) -> tuple[Floats, ...]:
        """Return poses and twists of all bodies, and their points: the trees' centres of mass."""
        data = self.data
        centres = data.subtree_com[self.model.body_rootid]
        return data.xmat.reshape(-1, 3, 3).copy(), data.xpos.copy(), data.cvel.copy(), centres

    def _closing(self, states: Sequence[tuple[Floats, ...]], rows: Sequence[int], along: dict[int, bool]) -> Floats:
        """Return the rates of gaps (m, n) at some instants."""
        R, p, twists, centres = (np.array(part) for part in zip(*states, strict=True))

        def carried(bodies: Indices, points: Floats) -> Floats:
            k = self.carriers[bodies]
            return twists[:, k, 3:] + cross(twists[:, k, :3], points - centres[:, k])

        def poses(body: str) -> Pose:
            return R[:, self.numbers[body]], p[:, self.numbers[body]]

        return closing(self.contacts.touches(poses, rows, along), carried)

    def _rates(self, parts: Sequence[int], v: Floats) -> list[float]:
        """Return how fast angles of ball joints and distances of points change, 0 of anything else."""
        mujoco.mj_tendon(self.model, self.data)
        J = np.zeros((self.model.ntendon, self.model.nv))
        J[self.row, self.model.ten_J_colind] = self.data.ten_J
        lengths, n = (J @ v).tolist(), len(self.bounded) - len(J)
        return [lengths[i - n] if i >= n else self._angle_rate(self.bounded[i], v) for i in parts]

    def _angle_rate(self, joint: Joint | Tendon, v: Floats) -> float:
        """Return how fast the angle of a ball joint changes; 0 of any other."""
        if not isinstance(joint, Joint) or joint.type != "ball" or not joint.limited:
            return 0.0
        first, turn = self.place[joint.name], angle_of(self.data.qpos[self.at[joint.name] :][:4])
        return float(turn @ v[first : first + 3] / np.linalg.norm(turn))


class Couplings:
    """H' v of joints and tendons that follow another by a polynomial from the square on.

    Attributes:
        curved: of each its row, where its leader is and how fast, in MjData's vectors, where it rests, and the second
            derivative of the polynomial.
    """

    def __init__(self, scene: Scene) -> None:
        at, place = places(scene)
        tendons, rests = [one.name for one in scene.tendons], {one.name: one.reference for one in scene.joints}
        self.curved: list[tuple[int, str, str, int, int, float, Vector]] = []
        row = 0
        for loop in scene.loops:
            name, curve = loop.second, derivatives(loop.polynomial)[2]
            if not loop.in_space and name and any(loop.polynomial[2:]):
                if loop.type == "tendon":
                    i, rest = tendons.index(name), scene.rest_length(scene.tendons[tendons.index(name)])
                    self.curved.append((row, "ten_length", "ten_velocity", i, i, rest, curve))
                else:
                    self.curved.append((row, "qpos", "qvel", at[name], place[name], rests[name], curve))
            row += loop.width

    def add(self, data: Any) -> None:
        """Take it off the reference accelerations of the rows, at a state that is evaluated up to its forces."""
        for row, where, rate, i, j, rest, curve in self.curved:
            data.efc_aref[row] += horner(curve, getattr(data, where)[i] - rest) * getattr(data, rate)[j] ** 2


def carried(model: Any, body: int) -> Floats:
    """Return which coordinates (nv,) move a body, as 1 and 0."""
    found = np.zeros(model.nv)
    while body:
        found[model.body_dofadr[body] :][: model.body_dofnum[body]] = 1.0
        body = model.body_parentid[body]
    return found
