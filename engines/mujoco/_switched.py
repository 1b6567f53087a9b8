"""Rows of the matched profile: on or off as their modes say, so that a step can be cut where one of them changes.

MuJoCo has a row for a bound or a contact where it is closer than its margin. One that is on keeps
a wide margin and its law, one that is off never pushes: the end of a trial is then a smooth
function of its length.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.cases.scene_contacts import rows_of
from crossbody.engines._level_machine import EPS
from crossbody.engines._log import Modes
from crossbody.engines._machines import elastic_part
from crossbody.engines.mujoco._build import solref_of
from crossbody.engines.mujoco._drift import Couplings, Drift
from crossbody.engines.mujoco._rows import LIMITS, Present, Rows
from crossbody.engines.mujoco._scene import Hook, constraint_jacobian

REACH = 1e-12
"""How far above its surface a row is closed, m or rad: one at rest, or one that starts at its
surface, is there but for rounding."""
WIDE = 0.1  # how far above its surface a row that is on is still a row, m or rad: further than a step goes
FAR = 1e9  # margin with which there is a row at any gap, m or rad
OFF = -1e12  # reference acceleration of a row that is off, m/s^2
FEW = 4  # rows for which NumPy costs more than Python: of one ten times as much
LAYOUTS = 256  # sets of rows and modes whose places are kept: a run has a few of them
FREE, CONTACT, BALLISTIC = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BALLISTIC)
BILATERAL, COLLISION, SEPARATED = int(Mode.BILATERAL), int(Mode.COLLISION), int(Mode.COLLISION_SEPARATION)


class Switched(Rows):
    """Rows that open and close by their modes.

    A row with two sets of constants collides with the fast ones and is handed over to the slow
    ones at the end of the step in which the elastic part of its multiplier is spent.

    Attributes:
        armed: the modes that are in force. on (nc,): which rows have their law, those in contact.
        part: of every row that may open the array of margins and its place there.
        sets: of every row with two sets of constants its array of them and its place there, the
            slow and the fast ones.
        surface (nc,): margin at which its law has it at zero, m or rad.
        wanted (nc,): reference acceleration by the law, m/s^2 or rad/s^2.
        quiet: whether all rows that open are bounds, whose gaps are known without a row: free ones have none.
        converged: where Newton's method may end while no row that opens is there; with one it
            goes on while it can.
        last (nc,): multipliers at the end of the last step. J v' = a - R f, where MuJoCo keeps a
            softness R; with a + R f of the last step in the place of a, what is left of it is R
            times the change of f in a step. It is 0 of contacts, whose R is 1e-11 of what moves
            them: less than what solving anew for another f makes of it.
    """

    def __init__(self, scene: Scene, model: Any, data: Any) -> None:
        super().__init__(scene, model, data)
        margins = {int(LIMITS[0]): model.jnt_margin, int(LIMITS[1]): model.tendon_margin}
        solrefs = {int(LIMITS[0]): model.jnt_solref, int(LIMITS[1]): model.tendon_solref_lim}
        pairs, laws = self.pair_ids(), rows_of(scene)[1]
        self.part = [(margins[kind], i) for kind, i, _ in self.places] + [(model.pair_margin, i) for i in pairs]
        solref = [(solrefs[kind], i) for kind, i, _ in self.places] + [(model.pair_solref, i) for i in pairs]
        self.sets = {
            row: (*part, solref_of(law.a0, law.a1), solref_of(law.b0, law.b1))
            for row, (law, part) in enumerate(zip(laws[self.always :], solref, strict=True), self.always)
            if law.b0 > 0.0
        }
        self.fast = np.array([(law.b0, law.b1) for law in laws]).reshape(-1, 2).T
        self.surface, self.wanted, self.last = np.zeros((3, self.nc))
        self.converged = float(model.opt.tolerance)
        self.surface[self.always :] = [margin[i] for margin, i in self.part]
        self.quiet, self.couplings = not self.touching.count, Couplings(scene)
        self.contact = np.arange(self.nc) >= self.nc - self.touching.count
        self.free: Modes = (BILATERAL,) * self.always + (FREE,) * (self.nc - self.always)
        self.armed = self.free
        self.arm(self.free)

    def arm(self, modes: Modes) -> None:
        """Put the law of the rows in contact in force and that of the others out of it."""
        for row, (solref, i, slow, fast) in self.sets.items():
            solref[i] = slow if modes[row] == CONTACT else fast
        self.armed, self.on = modes, np.isin(modes, (CONTACT, COLLISION))
        for row, (margin, i) in enumerate(self.part, self.always):
            margin[i] = -FAR if self.quiet else self.surface[row] + REACH
        for row, mode in enumerate(modes):
            if mode not in (FREE, BILATERAL):
                self._widen(row)  # behind all others: both bounds of a joint have one margin

    def entered(self, modes: Sequence[int], spent: Collection[int] = ()) -> Modes:
        """Return modes in which rows with two sets collide until they are spent, and are let go from where they were.

        Args:
            modes: CONTACT of what pushes, and BALLISTIC of what does not.
            spent: rows that have nothing left of their collision.
        """
        found = list(modes)
        for row in self.sets:
            before = self.armed[row]
            if modes[row] == CONTACT and before != CONTACT and row not in spent:
                found[row] = COLLISION
            elif modes[row] == BALLISTIC and before in (COLLISION, SEPARATED):
                found[row] = SEPARATED
        return tuple(found)

    def _widen(self, row: int) -> None:
        margin, i = self.part[row - self.always]
        margin[i] = self.surface[row] + WIDE

    def _gap(self, j: int, row: int) -> float:
        return float(self.data.efc_pos[j] - self.surface[row] - REACH)

    def lam(self) -> Floats:
        """Return the multiplier of every row (nc,), and keep it: records are behind steps taken."""
        found = super().lam()
        self.last = found.copy() if self.quiet else np.where(self.contact, 0.0, found)
        self.last[: self.always] = self.data.efc_force[: self.always]  # along MuJoCo's own axes, as what it goes into
        return found

    @property
    def wakeful(self) -> bool:
        """Whether the hook has something to do while all rows are free."""
        return not self.quiet or bool(self.cubic[: self.always].any()) or bool(self.couplings.curved)

    def _gaps(self) -> list[float]:
        """Return the gaps of all rows that open, m or rad, each of which is a bound."""
        found: list[float] = (self.forces.bounds(self.data.qpos, self.data.ten_length) - REACH).tolist()
        return found

    def modes(self) -> Modes:
        """Return the mode of every row by its gap and multiplier; a free one that has closed is taken for a contact."""
        if self.nc == self.always:
            return self.free
        found, present = list(self.free), self.present()
        if self.quiet:
            gaps = self._gaps()
            if self.armed == self.free and min(gaps, default=1.0) > 0.0:
                return self.free
            for row, gap in enumerate(gaps, self.always):
                found[row] = CONTACT if gap <= 0.0 and self.armed[row] == FREE else FREE
        for j, row in present:
            gap, push = self._gap(j, row), self._push(j, row)
            if push > 0.0 and (self.on[row] or gap <= 0.0):
                found[row] = CONTACT
            elif gap <= 0.0:
                found[row] = BALLISTIC
        colliding = any(self.armed[row] == COLLISION for row in self.sets)
        return self.entered(found, self._spent(present) if colliding else ())

    def _spent(self, present: tuple[Present, ...]) -> set[int]:
        """Return which rows have spent the elastic part of their multiplier: 1 % of lam_i / (G_A^-1)_ii is left."""
        data = self.data
        pushing = [(j, row) for j, row in present if self.on[row] and data.efc_force[j] > 0.0]
        at = [j for j, _ in pushing]
        stiff = np.diag(np.linalg.inv(self._delassus(at)[1]))[self.always :]
        rows = np.array([row for _, row in pushing], dtype=int)
        elastic = elastic_part(self.fast[:, rows], data.efc_pos[at] - self.surface[rows], data.efc_vel[at])
        spent = elastic <= EPS * data.efc_force[at] / stiff
        return {row for row, done in zip(rows.tolist(), spent, strict=True) if done and self.armed[row] == COLLISION}

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
        """Return a contact's multiplier; of a ballistic row positive where it closes and would push."""
        if self.armed[row] == FREE:
            return 1.0
        force = float(self.data.efc_force[j])
        if force > 0.0:
            return force
        pull = self._pull(j, row)
        return pull if self.on[row] else min(-float(self.data.efc_vel[j]), pull)

    def _pull(self, j: int, row: int) -> float:
        """Return a row's multiplier if it could pull and were alone: no kink where it ends."""
        data = self.data
        J = constraint_jacobian(self.model, data)[j]
        moved = np.empty((1, len(J)))
        mujoco.mj_solveM(self.model, data, moved, J[None])
        return float((self.wanted[row] - J @ data.qacc) / (J @ moved[0]))

    def _delassus(self, present: list[int]) -> tuple[Floats, Floats]:
        """Return H (n, nv) of the rows that are always on and of those at some places, and H M^-1 H'."""
        J = constraint_jacobian(self.model, self.data)[[*range(self.always), *present]]
        moved = np.empty_like(J)
        mujoco.mj_solveM(self.model, self.data, moved, J)
        return J, J @ moved.T

    def asked(self) -> Floats:
        """Return the multipliers (nc,) with which all rows there follow their law, even pulling."""
        at, rows = np.array(self.present()).T
        J, G = self._delassus(at.tolist())
        lam = np.zeros(self.nc)
        wanted = [*self.data.efc_aref[: self.always], *self.wanted[rows]]
        lam[[*range(self.always), *rows]] = np.linalg.solve(G, wanted - J @ self.data.qacc_smooth)
        lam[: self.always] = self._along_bodies(lam, self.data)
        return lam

    def approach(self) -> tuple[Floats, Floats, Floats]:
        """Return gap, rate and acceleration (nc,) of every row at the data's state with no row acting."""
        for margin, i in self.part:
            margin[i] = FAR
        mujoco.mj_forward(self.model, self.data)
        data, found = self.data, np.zeros((3, self.nc))
        J = constraint_jacobian(self.model, data)
        for j, row in [*((k, k) for k in range(self.always)), *self.present()]:
            gap = data.efc_pos[j] - self.surface[row]
            found[:, row] = gap, data.efc_vel[j], J[j] @ data.qacc_smooth
        self.arm(self.armed)
        return found[0], found[1], found[2]

    def hook(self) -> Hook | None:
        """Return what has the law at its surface, adds H' v where MuJoCo has none, and takes rows out."""
        joints, tendons = self.scene.joints, self.scene.tendons
        bent = {(int(LIMITS[0]), i): i for i, joint in enumerate(joints) if joint.type == "ball" and joint.limited}
        bent |= {(int(LIMITS[1]), i): len(joints) + i for i, tendon in enumerate(tendons) if tendon.bodies}
        couple = self.couplings.add if self.couplings.curved else None
        if self.nc == self.always and not self.cubic.any():
            return None if couple is None else lambda model, data: couple(data)
        drift, curved = Drift(self.scene, self.model, self.touching), self.cubic[: self.always]
        laid = lru_cache(LAYOUTS)(lambda present, armed: self._laid(present, armed, bent))
        option = self.model.opt  # to ask for it costs more than to set a number in it
        loops, all_straight = slice(self.always), not self.cubic[self.always :].any()
        surface, cubic = self.surface.tolist(), self.cubic.tolist()
        bends, few = bool(curved.any()), 0 if bent or self.touching.count else FEW

        def one(data: Any, j: int, row: int) -> None:
            pos, gains = float(data.efc_pos[j]) - surface[row], data.efc_KBIP[j].tolist()
            own = float(data.efc_aref[j]) + float(data.efc_R[j]) * float(self.last[row]) - cubic[row] * pos**3
            own -= gains[0] * gains[2] * (float(data.efc_margin[j]) - surface[row]) if row >= self.always else 0.0
            self.wanted[row] = own
            data.efc_aref[j] = own if self.on[row] or row < self.always else OFF

        def hook(model: Any, data: Any) -> None:
            aref = data.efc_aref
            if couple is not None:
                couple(data)
            if bends and self.nc == 1:
                return one(data, 0, 0)
            if bends:
                aref[loops] += data.efc_R[loops] * self.last[loops] - curved * data.efc_pos[loops] ** 3
            present = self.present()
            option.tolerance = 0.0 if present else self.converged
            if not present:
                return None
            if len(present) <= few:
                for j, row in present:
                    one(data, j, row)
                return None
            at, rows, off, bending = laid(present, self.armed)
            gains = data.efc_KBIP[at]  # a0 is the first times the third
            lifted = gains[:, 0] * gains[:, 2] * (data.efc_margin[at] - self.surface[rows])
            own = aref[at] - lifted + data.efc_R[at] * self.last[rows]
            if not all_straight:
                own -= self.cubic[rows] * (data.efc_pos[at] - self.surface[rows]) ** 3
            if bending is not None:
                places, sign, parts, touched = bending
                lengths, touches = drift(data, parts, touched)
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
