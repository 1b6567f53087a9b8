"""Rows of the matched profile: on or off as their modes say, so that a step can be cut where one of them changes.

MuJoCo has a row for a bound or a contact where it is closer than its margin. One that is on keeps a wide margin and its
law, one that is off never pushes: the end of a trial is then a smooth function of its length.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.engines._log import Modes
from crossbody.engines.mujoco._drift import Drift
from crossbody.engines.mujoco._globals import Hook
from crossbody.engines.mujoco._rows import LIMITS, Present, Rows

REACH = 1e-12
"""How far above its surface a row is closed, m or rad: one at rest, or one that starts at its surface, is there but for
rounding."""
WIDE = 0.1
"""How far above its surface a row that is on is still a row, m or rad: further than a step goes."""
FAR = 1e9
"""Margin with which there is a row at any gap, m or rad."""
OFF = -1e12
"""Reference acceleration of a row that is off, m/s^2."""
LAYOUTS = 256
"""Sets of rows and modes whose places are kept: a run has a few of them."""
FREE, CONTACT, BALLISTIC = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BALLISTIC)


class Switched(Rows):
    """Rows that open and close by their modes.

    Attributes:
        armed: the modes that are in force. on (nc,): which rows have their law, those in contact.
        part: of every row that may open the array of margins and its place there.
        surface (nc,): margin at which its law has it at zero, m or rad.
        wanted (nc,): reference acceleration by the law, m/s^2 or rad/s^2.
        quiet: whether all rows that open are bounds, whose gaps are known without a row: free ones have none.
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
        self.quiet = not self.touching.count
        self.free: Modes = (int(Mode.BILATERAL),) * self.always + (FREE,) * (self.nc - self.always)
        self.arm(self.free)

    def arm(self, modes: Modes) -> None:
        """Put the law of the rows in contact in force and that of the others out of it."""
        self.armed, self.on = modes, np.array(modes) == CONTACT
        for row, (margin, i) in enumerate(self.part, self.always):
            margin[i] = -FAR if self.quiet else self.surface[row] + REACH
        for row, mode in enumerate(modes):
            if mode in (CONTACT, BALLISTIC):
                self._widen(row)  # behind all others: both bounds of a joint have one margin

    def _widen(self, row: int) -> None:
        margin, i = self.part[row - self.always]
        margin[i] = self.surface[row] + WIDE

    def _gap(self, j: int, row: int) -> float:
        return float(self.data.efc_pos[j] - self.surface[row] - REACH)

    def lam(self) -> Floats:
        """Return the multiplier of every row (nc,), and keep it: what is recorded is behind a step that is taken."""
        self.last = super().lam()
        return self.last

    @property
    def wakeful(self) -> bool:
        """Whether the hook has something to do while all rows are free."""
        return not self.quiet or bool(self.cubic[: self.always].any())

    def _gaps(self) -> list[float]:
        """Return the gaps of all rows that open, m or rad, each of which is a bound."""
        found: list[float] = (self.forces.bounds(self.data.qpos, self.data.ten_length) - REACH).tolist()
        return found

    def modes(self) -> Modes:
        """Return the mode of every row by its gap and multiplier; a free one that has closed is taken for a contact."""
        if self.nc == self.always:
            return self.free
        found = list(self.free)
        if self.quiet:
            gaps = self._gaps()
            if self.armed == self.free and min(gaps, default=1.0) > 0.0:
                return self.free
            for row, gap in enumerate(gaps, self.always):
                found[row] = CONTACT if gap <= 0.0 and self.armed[row] == FREE else FREE
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
        if self.quiet:
            found[self.always :] = [
                (gap, 1.0 if mode == FREE else -1.0)
                for gap, mode in zip(self._gaps(), self.armed[self.always :], strict=True)
            ]
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
        drift, curved = Drift(self.scene, self.model, self.touching), self.cubic[: self.always]
        laid = lru_cache(LAYOUTS)(lambda present, armed: self._laid(present, armed, bent))
        loops, all_straight = slice(self.always), not self.cubic[self.always :].any()
        surface, cubic = self.surface.tolist(), self.cubic.tolist()
        bends = bool(curved.any())

        def one(data: Any, j: int, row: int) -> None:
            pos, gains = float(data.efc_pos[j]) - surface[row], data.efc_KBIP[j].tolist()
            own = float(data.efc_aref[j]) + float(data.efc_R[j]) * float(self.last[row]) - cubic[row] * pos**3
            own -= gains[0] * gains[2] * (float(data.efc_margin[j]) - surface[row]) if row >= self.always else 0.0
            self.wanted[row] = own
            data.efc_aref[j] = own if self.on[row] or row < self.always else OFF

        def hook(model: Any, data: Any) -> None:
            aref = data.efc_aref
            if bends and self.nc == 1:
                return one(data, 0, 0)
            if bends:
                aref[loops] += data.efc_R[loops] * self.last[loops] - curved * data.efc_pos[loops] ** 3
            present = tuple(self.present())
            model.opt.tolerance = 0.0 if present else self.converged
            if not present:
                return None
            if self.nc == 1 and not bent:  # NumPy costs ten times as much
                return one(data, *present[0])
            at, rows, off, bending = laid(present, self.armed)
            gains = data.efc_KBIP[at]  # a0 is the first times the third
            lifted = gains[:, 0] * gains[:, 2] * (data.efc_margin[at] - self.surface[rows])
            own = aref[at] - lifted + data.efc_R[at] * self.last[rows]
            if not all_straight:
                own -= self.cubic[rows] * (data.efc_pos[at] - self.surface[rows]) ** 3
            if bending is not None:
                places, sign, parts, touched = bending
                lengths, touches = drift(data.qpos, data.qvel, parts, touched)
                own[places] -= sign * np.concatenate([lengths, touches])
            self.wanted[rows] = own
            own[off] = OFF
            aref[at] = own
            return None

        return hook

    def _laid(self, present: tuple[Present, ...], armed: Modes, bent: Mapping[tuple[int, int], int]) -> Any:
        """Return where rows stand and which they are, which are off, and those with H' v that MuJoCo leaves out.

        Of these the places, the sign, the bounded parts, and the rows of contacts.
        """
        at, rows = np.array(present).T
        first, kinds = self.nc - self.touching.count, (self.data.efc_type, self.data.efc_id)
        acting = [(k, row, (int(kinds[0][j]), int(kinds[1][j]))) for k, (j, row) in enumerate(present) if armed[row]]
        pulled = [(k, row, kind) for k, row, kind in acting if kind in bent]
        touched = [(k, row) for k, row, _ in acting if row >= first]
        sign = [-1.0 if row == self.places.get((*kind, True)) else 1.0 for _, row, kind in pulled]
        bending = (
            np.array([k for k, *_ in (*pulled, *touched)]), np.array(sign + [1.0] * len(touched)),
            [bent[kind] for _, _, kind in pulled], [row - first for _, row in touched],
        )  # fmt: skip
        together = slice(int(at[0]), int(at[-1]) + 1) if (np.diff(at) == 1).all() else at
        return together, rows, ~self.on[rows], bending if pulled or touched else None
