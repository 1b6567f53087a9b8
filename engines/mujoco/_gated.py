"""Rows of a case's own where MuJoCo has shapes that collide: its contacts' forces as multipliers of these."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Case, Mode, Switch
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene
from crossbody.engines._gates import Gated
from crossbody.engines._log import Modes, Observe
from crossbody.engines.mujoco._rows import Rows

FREE, CONTACT = int(Mode.FREE), int(Mode.CONTACT)


class GatedRows(Rows):
    """Rows under discrete variables that are looked at once a step, as a user's own loop does.

    `switches` are the changes, in order.
    """

    def __init__(self, case: Case, scene: Scene, model: Any, data: Any) -> None:
        super().__init__(scene, model, data)
        assert case.gates is not None
        self.case, self.nc = case, len(case.contacts)
        self.gated, self.switches = Gated(case.gates, self.nc, model.nv), list[Switch]()
        self.follows, self.pushes = case.gates.follows, np.zeros(self.nc)

    def anew(self, scene: Scene, model: Any, data: Any) -> GatedRows:
        """Return the same of another model of a scene."""
        return GatedRows(self.case, scene, model, data)

    def begin(self) -> None:
        """Forget what was, at the start of a run."""
        self.switches.clear()
        self.gated.begin(self.case.q0)

    def modes(self) -> Modes:
        """Look at the state, and return the mode of every row: in contact where it pushes."""
        q, before = self.data.qpos, self.gated.discrete()
        self.gated.seen(q, (FREE,) * self.nc)
        self.pushes = self._exerted()
        modes = self.gated.shared([CONTACT if push > 0.0 else FREE for push in self.pushes])
        self.gated.hold(q, modes)
        if self.data.time > 0.0:
            self.switches += self.gated.switches(float(self.data.time), before)
        return modes

    def lam(self) -> Floats:
        """Return the multiplier of every row (nc,) at the state that was looked at, which is recorded."""
        self.gated.keep()
        return self.pushes

    def constants(self, *, own: bool = False) -> dict[str, Any]:
        """Return the solref of the shapes."""
        return {"solref": self.model.geom_solref[0].copy()}

    def _exerted(self) -> Floats:
        """Return the multipliers (nc,) that come nearest to what MuJoCo's contacts do to the motion.

        Of the rows that are closed, or of the nearest one, and of those that follow them: H^T lam is
        compared with the contacts' generalised force in the metric of M^-1, and none of a normal row pulls.
        """
        data, lam = self.data, np.zeros(self.nc)
        if not data.ncon:
            return lam
        h, H, _ = self.gated.at(data.qpos, data.qvel)
        there = [i for i, lead in enumerate(self.follows) if lead < 0 and H[i].any()]
        closed = [i for i in there if h[i] <= 0.0] or [min(there, key=h.__getitem__)]
        on = [*closed, *(i for i, lead in enumerate(self.follows) if lead in closed)]
        moved = np.empty((len(on), self.model.nv))
        mujoco.mj_solveM(self.model, data, moved, H[on])
        lam[on] = np.linalg.lstsq(H[on] @ moved.T, moved @ data.qfrc_constraint)[0]
        lam[closed] = np.maximum(lam[closed], 0.0)
        return lam

    def observe(self) -> Observe:
        """Return what reads gaps and energies of recorded states."""
        model, data = self.model, mujoco.MjData(self.model)

        def observe(q: Floats, v: Floats) -> tuple[Floats, Floats]:
            energy = np.empty((len(q), 2))
            for i in range(len(q)):
                data.qpos[:], data.qvel[:] = q[i], v[i]
                mujoco.mj_kinematics(model, data)
                mujoco.mj_comPos(model, data)
                mujoco.mj_crb(model, data)
                mujoco.mj_energyPos(model, data)
                mujoco.mj_energyVel(model, data)
                energy[i] = data.energy[1], data.energy[0]
            return self.gated.recorded(q), energy

        return observe
