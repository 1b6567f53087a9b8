"""The two balls of the matched maze: which one moves, what holds it, and its state in the case's coordinates."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
from maze_chain import FAR, PHI, PSI, RHO, THETA, TIPS, B, X, Y, compiled

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.engines._maze.memory import CONTACT, Memory
from crossbody.engines._maze.rows import ABOVE, BELOW, INNER, OUTER, SLIP_ABOVE, SLIP_BELOW, Place
from crossbody.engines._maze.scene import BallMaze

State = tuple[float, ...]
FACES = {BELOW: (SLIP_BELOW, OUTER), ABOVE: (SLIP_ABOVE, INNER)}
REACH = 1e-3
"""Gap up to which a closed row holds, m: the machine opens it, not its gap. MuJoCo counts positions from there."""
PARKED = 1.0
"""Distance from the axis at which the ball on the chain stands while the other moves, m."""


class Charts:
    """A compiled model with what the rows' modes make of it.

    Attributes:
        model, data: MuJoCo's.
        memory: the discrete state that is in force.
        rate: sqrt(a0) of faces and tips, 1/s.
        face: slot of the face that the ball on the chain is held by; None while it flies.
    """

    def __init__(self, case: Case, maze: BallMaze) -> None:
        self.maze, self.memory = maze, Memory(modes=(0,) * maze.nc, place=Place(0))
        self.model = compiled(maze, case.law)
        self.data = mujoco.MjData(self.model)
        self.bodies = [self.model.body(name).id for name in ("rolling", "flying")]
        self.geoms = [self.model.geom(name).id for name in TIPS]
        self.slots = {pair: int(name[3]) for pair, name in zip(self.geoms, TIPS, strict=True)}
        self.a0 = float(case.law.a0[0])
        self.rate = math.sqrt(self.a0)
        self.face: int | None = None

    def state(self) -> tuple[State, State]:
        """Q and v of the case."""
        p, s = self.data.qpos.tolist(), self.data.qvel.tolist()
        if self.face is None:
            return (p[THETA], p[X], p[Y], p[PHI]), (s[THETA], s[X], s[Y], s[PHI])
        c, n, rho = math.cos(p[B]), math.sin(p[B]), p[RHO]
        vr, vt = s[RHO], rho * s[B]
        q = p[THETA], rho * c, rho * n, p[B] + p[PSI]
        return q, (s[THETA], vr * c - vt * n, vr * n + vt * c, s[B] + s[PSI])

    def arm(self, memory: Memory, q: State, v: State) -> None:
        """Put the state on the chart that the modes ask for, and close its rows."""
        self.memory = memory
        self.face = next((slot for slot in FACES if memory.modes[slot] == CONTACT), None)
        self._place(q, v)
        self._hold()
        self._set_tips()
        mujoco.mj_forward(self.model, self.data)

    def acceleration(self) -> Floats:
        """V' of the case (4,)."""
        a, v = self.data.qacc.tolist(), self.data.qvel.tolist()
        if self.face is None:
            return np.array([a[THETA], a[X], a[Y], a[PHI]])
        b, rho = self.data.qpos[B], self.data.qpos[RHO]
        c, n = math.cos(b), math.sin(b)
        ar, at = a[RHO] - rho * v[B] ** 2, rho * a[B] + 2.0 * v[RHO] * v[B]
        return np.array([a[THETA], ar * c - at * n, ar * n + at * c, a[B] + a[PSI]])

    def multipliers(self) -> Floats:
        """Lam (nc,) of the case; of a normal row that would have to pull, what it would be without its bound."""
        lam, data = np.zeros(self.maze.nc), self.data
        if self.face is not None:
            force, slip = data.efc_force.tolist(), FACES[self.face][0]
            if self.maze.rows.rolling:
                lam[slip] = force[0]
            pull = data.efc_aref[-1] - data.qacc[RHO] * data.efc_J.reshape(-1, self.model.nv)[-1, RHO]
            lam[self.face] = force[-1] if force[-1] > 0.0 else pull * self.maze.plant.mb
            return lam
        for contact, slot in self._touched():
            row = contact.efc_address
            J, push = data.efc_J.reshape(-1, self.model.nv)[row], float(data.efc_force[row])
            inverse = J[THETA] ** 2 / self.maze.plant.Jm + (J[X] ** 2 + J[Y] ** 2) / self.maze.plant.mb
            lam[slot] = push if push > 0.0 else (data.efc_aref[row] - J @ data.qacc) / inverse
        return lam

    def probe(self, q: State, v: State, memory: Memory) -> tuple[Floats, Floats]:
        """V' (4,) and lam (nc,) at a state, perhaps with other rows on; the data stands as before. See `Accelerate`."""
        now, here = self.memory, self.state()
        if memory is now and (q, v) == here:
            return self.acceleration(), self.multipliers()
        self.arm(memory, q, v)
        found = self.acceleration(), self.multipliers()
        self.arm(now, *here)
        return found

    def stage(self, _model: Any, data: Any) -> None:
        """Every evaluation: the torque of the controller, and what MuJoCo's references leave out."""
        q, v = self.state()
        brake = self.maze.braking(v, self.memory)
        applied = data.qfrc_applied
        applied[THETA] = self.maze.torque(q, v, self.memory) - brake
        if brake:
            applied[[B, PSI] if self.face is not None else [PHI]] = brake
        if self.face is not None:
            data.efc_aref[data.nefc - 1] -= self.a0 * REACH
            return
        for contact, slot in self._touched():
            formula = self.maze.rows.at(self.memory.place)[slot]
            data.efc_aref[contact.efc_address] -= formula(q, v)[2] + self.a0 * REACH

    def _touched(self) -> list[tuple[Any, int]]:
        """Contacts in force, with their slots."""
        found = (self.data.contact[i] for i in range(self.data.ncon))
        return [(c, self.slots[int(c.geom1)]) for c in found if c.efc_address >= 0]

    def _place(self, q: State, v: State) -> None:
        """One ball moves; the other stands, without weight."""
        p, s, flying = self.data.qpos, self.data.qvel, self.face is None
        p[THETA], s[THETA] = q[0], v[0]
        rho, b = math.hypot(q[1], q[2]), math.atan2(q[2], q[1])
        if flying:
            p[[X, Y, PHI]], s[[X, Y, PHI]] = q[1:], v[1:]
            p[[B, RHO, PSI]], s[[B, RHO, PSI]] = (0.0, PARKED, 0.0), 0.0
        else:
            turn, vr = (q[1] * v[2] - q[2] * v[1]) / rho**2, (q[1] * v[1] + q[2] * v[2]) / rho
            p[[B, RHO, PSI]], s[[B, RHO, PSI]] = (b, rho, q[3] - b), (turn, vr, v[3] - turn)
            p[[X, Y, PHI]], s[[X, Y, PHI]] = 0.0, 0.0
        self.data.qfrc_applied[:] = 0.0
        self.model.body_gravcomp[self.bodies] = (1.0, 0.0) if flying else (0.0, 1.0)

    def _hold(self) -> None:
        """The limit of the slide and the tendon of the face."""
        model, data, r = self.model, self.data, self.maze.plant.r
        held = self.face is not None
        data.eq_active[0] = held and self.maze.rows.rolling
        model.jnt_margin[RHO] = REACH if held else -FAR
        if self.face is None:
            return
        s, R = FACES[self.face][1], self.maze.rows.radius(self.memory.place, self.face)
        rho = R - s * r
        model.jnt_range[RHO] = (rho, PARKED) if s == OUTER else (-PARKED, rho)
        model.wrap_prm[:] = (-R, rho + s * r, s * r)

    def _set_tips(self) -> None:
        """The spheres of the gaps beside the ball, and which of them are closed."""
        place, model = self.memory.place, self.model
        for slot, ring, angle in self.maze.rows.tips(place):
            geom = self.geoms[TIPS.index(f"tip{slot}")]
            model.geom_pos[geom, :2] = ring.middle * math.cos(angle), ring.middle * math.sin(angle)
            model.geom_size[geom, 0] = model.geom_rbound[geom] = ring.cap
        for k, name in enumerate(TIPS):
            closed = self.face is None and self.memory.modes[int(name[3])] == CONTACT
            model.pair_margin[k] = REACH if closed else -FAR
