"""Rows of the matched profile: on or off as their modes say, so that a step can be cut where one of them changes.

MuJoCo has a row for a bound or a contact where it is closer than its margin. One that is on keeps a wide margin and its
law, one that is off never pushes: the end of a trial is then a smooth function of its length.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.engines._log import Modes
from crossbody.engines.mujoco._drift import Drift
from crossbody.engines.mujoco._globals import Hook
from crossbody.engines.mujoco._rows import LIMITS, Rows

REACH = 1e-12
"""How far above its surface a row is closed, m or rad: one at rest, or one that starts at its surface, is there but for
rounding."""
WIDE = 0.1
"""How far above its surface a row that is on is still a row, m or rad: further than a step goes."""
FAR = 1e9
"""Margin with which there is a row at any gap, m or rad."""
OFF = -1e12
"""Reference acceleration of a row that is off, m/s^2."""
FREE, CONTACT, BALLISTIC = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BALLISTIC)


class Switched(Rows):
    """Rows that open and close by their modes.

    Attributes:
        armed: the modes that are in force. on (nc,): which rows have their law, those in contact.
        part: of every row that may open the array of margins and its place there.
        surface (nc,): margin at which its law has it at zero, m or rad.
        wanted (nc,): reference acceleration by the law, m/s^2 or rad/s^2.
        converged: where Newton's method may end while no row that opens is there; with one it goes on while it can.
        last (nc,): multipliers at the end of the last step. J v' = a - R f, where MuJoCo keeps a softness R; with
            a + R f of the last step in the place of a, what is left of it is R times the change of f in a step.
    """

    def __init__(self, scene: Scene, model: Any, data: Any) -> None:
        super().__init__(scene, model, data)
        margins = {int(LIMITS[0]): model.jnt_margin, int(LIMITS[1]): model.tendon_margin}
        self.part = [(margins[kind], i) for kind, i, _ in self.places]
        self.part += [(model.pair_margin, i) for i in self.pair_ids()]
        self.surface, self.wanted, self.last = np.zeros((3, self.nc))
        self.converged = float(model.opt.tolerance)
        self.surface[self.always :] = [margin[i] for margin, i in self.part]
        self.arm((FREE,) * self.nc)

    def arm(self, modes: Modes) -> None:
        """Put the law of the rows in contact in force and that of the others out of it."""
        self.armed, self.on = modes, np.array(modes) == CONTACT
        for row, (margin, i) in enumerate(self.part, self.always):
            margin[i] = self.surface[row] + REACH
        for row, mode in enumerate(modes):
            if mode in (CONTACT, BALLISTIC):
                self._widen(row)

    def _widen(self, row: int) -> None:
        margin, i = self.part[row - self.always]
        margin[i] = self.surface[row] + WIDE

    def _gap(self, j: int, row: int) -> float:
        return float(self.data.efc_pos[j] - self.surface[row] - REACH)

    def lam(self) -> Floats:
        """Return the multiplier of every row (nc,), and keep it: what is recorded is behind a step that is taken."""
        self.last = super().lam()
        return self.last

    def modes(self) -> Modes:
        """Return the mode of every row by its gap and multiplier; a free one that has closed is taken for a contact."""
        found = [int(Mode.BILATERAL)] * self.always + [FREE] * (self.nc - self.always)
        for j, row in self.present():
            gap, push = self._gap(j, row), self._push(j, row)
            if push > 0.0 and (self.on[row] or gap <= 0.0):
                found[row] = CONTACT
            elif gap <= 0.0:
                found[row] = BALLISTIC
        return tuple(found)

    def margins(self) -> list[tuple[float, float]]:
        """Return the gap of every row, m or rad, and what is positive where it pushes or would be caught."""
        found = [(0.0, 0.0)] * self.always + [(np.inf, -1.0)] * (self.nc - self.always)
        for j, row in self.present():
            found[row] = gap, _ = self._gap(j, row), self._push(j, row)
            if self.armed[row] == FREE and gap <= 0.0:
                self._widen(row)  # trials look at it where it is open
        return found

    def _push(self, j: int, row: int) -> float:
        """Return a contact's multiplier; of a ballistic row what is positive where it closes and would push."""
        if self.armed[row] == FREE:
            return 1.0
        force = float(self.data.efc_force[j])
        if force > 0.0:
            return force
        pull = self._pull(j, row)
        return pull if self.on[row] else min(-float(self.data.efc_vel[j]), pull)

    def _pull(self, j: int, row: int) -> float:
        """Return the multiplier that a row would have if it could pull, as if it were alone: no kink where it ends."""
        data, nv = self.data, self.model.nv
        J = np.array(data.efc_J).reshape(-1, nv)[j]
        moved = np.empty((1, nv))
        mujoco.mj_solveM(self.model, data, moved, J[None])
        return float((self.wanted[row] - J @ data.qacc) / (J @ moved[0]))

    def approach(self) -> tuple[Floats, Floats, Floats]:
        """Return gap, rate and acceleration (nc,) that every row has at the state of the data with no row acting."""
        for margin, i in self.part:
            margin[i] = FAR
        mujoco.mj_forward(self.model, self.data)
        data, found = self.data, np.zeros((3, self.nc))
        J = np.array(data.efc_J).reshape(-1, self.model.nv)
        for j, row in [*((k, k) for k in range(self.always)), *self.present()]:
            gap = data.efc_pos[j] - self.surface[row]
            found[:, row] = gap, data.efc_vel[j], J[j] @ data.qacc_smooth
        self.arm(self.armed)
        return found[0], found[1], found[2]

    def hook(self) -> Hook | None:
        """Return what has the law at its surface, adds H' v where MuJoCo has none, and puts rows out of force."""
        joints, tendons = self.scene.joints, self.scene.tendons
        bent = {(int(LIMITS[0]), i): i for i, joint in enumerate(joints) if joint.type == "ball" and joint.limited}
        bent |= {(int(LIMITS[1]), i): len(joints) + i for i, tendon in enumerate(tendons) if tendon.bodies}
        if self.nc == self.always and not self.cubic.any():
            return None
        drift, first = Drift(self.scene, self.model, self.touching), self.nc - self.touching.count

        curved = self.cubic[: self.always]

        def hook(model: Any, data: Any) -> None:
            if curved.any():
                data.efc_aref[: self.always] -= curved * data.efc_pos[: self.always] ** 3
                data.efc_aref[: self.always] += data.efc_R[: self.always] * self.last[: self.always]
            present = list(self.present())
            model.opt.tolerance = 0.0 if present else self.converged
            if not present:
                return
            at, rows = np.array(present).T
            gains = data.efc_KBIP[at]  # a0 is the first times the third
            data.efc_aref[at] -= gains[:, 0] * gains[:, 2] * (data.efc_margin[at] - self.surface[rows])
            data.efc_aref[at] -= self.cubic[rows] * (data.efc_pos[at] - self.surface[rows]) ** 3
            closed = [(j, row) for j, row in present if self.armed[row] != FREE]
            acting = [(j, row, (int(data.efc_type[j]), int(data.efc_id[j]))) for j, row in closed]
            touched = [(j, row) for j, row, _ in acting if row >= first]
            pulled = [(j, row, kind) for j, row, kind in acting if kind in bent]
            if touched or pulled:
                parts = [bent[kind] for _, _, kind in pulled]
                lengths, touches = drift(data.qpos, data.qvel, parts, [row - first for _, row in touched])
                for (j, _), term in zip(touched, touches, strict=True):
                    data.efc_aref[j] -= term
                for (j, row, kind), term in zip(pulled, lengths, strict=True):
                    data.efc_aref[j] -= (-1.0 if row == self.places.get((*kind, True)) else 1.0) * term
            data.efc_aref[at] += data.efc_R[at] * self.last[rows]
            self.wanted[rows] = data.efc_aref[at]
            data.efc_aref[at[~self.on[rows]]] = OFF

        return hook
