"""The rows of a scene among those of MuJoCo at a state: which is which, their law, gaps and multipliers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.files import mjcf
from crossbody.cases.scene import WIDTHS, Scene
from crossbody.cases.scene_contacts import WAYS, Contact, rows_of
from crossbody.engines._contacts import TOGETHER, Contacts, end_of
from crossbody.engines._log import Modes, Observe
from crossbody.engines._scene import Forces
from crossbody.engines.mujoco._build import MAX_IMPEDANCE, corner_names
from crossbody.engines.mujoco._rubs import AT_BOUND, Rub, Rubs
from crossbody.engines.mujoco._scene import constraint_jacobian, numbers
from crossbody.engines.nearest import corners

DRY = (int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF), int(mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON))
LIMITS = (mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT, mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON)
TOUCH = int(mujoco.mjtConstraint.mjCNSTR_CONTACT_FRICTIONLESS)
FRICTIONAL = (mujoco.mjtConstraint.mjCNSTR_CONTACT_PYRAMIDAL,)
Present = tuple[int, int]  # where a row stands in MuJoCo's arrays, and among the scene's


class Rows:
    """The rows of a scene among those that MuJoCo has at a state.

    Attributes:
        always: number of rows that are always on; they stand first in both.
        steady: whether what MuJoCo has rows for says which these are: no bound has two ends, no
            pair two places.
        frictional: whether edges of friction pyramids, whose sum is the normal force, are rows of
            contacts too.
        contacts: where the normal rows of contacts stand; behind them are the tangential ones of
            those with friction.
        rubs: contacts with friction; rubbing: whether there are any.
        dry: rows of dry friction, which stand last, by what MuJoCo calls them.
    """

    def __init__(self, scene: Scene, model: Any, data: Any) -> None:
        self.scene, self.model, self.data, self.frictional = scene, model, data, False
        self.always = sum(loop.width for loop in scene.loops)
        self.places: dict[tuple[int, int, bool], int] = {}
        row = self.always
        for j, part in enumerate(scene.bounded):  # in the model's order: a file need not name them
            tendon = j - len(scene.joints)
            kind, i = (int(LIMITS[0]), j) if tendon < 0 else (int(LIMITS[1]), tendon)
            for upper, bound in enumerate(part.range):
                if np.isfinite(bound):
                    self.places[kind, i, bool(upper)] = row
                    row += 1
        ends = [(kind, i) for kind, i, _ in self.places]
        self.sole = {(kind, i): row for (kind, i, _), row in self.places.items() if ends.count((kind, i)) == 1}
        self.welds = tuple(_welds(scene, model))
        self.cubic, self.forces = np.array([law.a2 for law in rows_of(scene)[1]]), Forces(scene)
        self.touching = Contacts(scene)
        named = mjcf.names(model, "geom")
        self.geoms = {named(i): i for i in range(model.ngeom)}
        self.touches: dict[frozenset[int], tuple[Contact, range]] = {}
        for contact in self.touching.all:
            first, rows = self.geoms[contact.first.name], range(row, row + contact.places)
            if self.by_corners(contact):
                for k, name in zip(rows, corner_names(contact.second), strict=True):
                    self.touches[frozenset((first, self.geoms[name]))] = (contact, range(k, k + 1))
            else:
                self.touches[frozenset((first, self.geoms[contact.second.name]))] = (contact, rows)
            row += contact.places
        self.rubbing = any(contact.pair.dimension > 1 for contact in self.touching.all)
        tangents: dict[int, int] = {}
        normal, tangent = row - self.touching.count, row
        for contact in self.touching.all:
            for k in range(contact.places if contact.friction > 0.0 else 0):
                tangents[normal + k] = tangent + len(WAYS) * k
            normal, tangent = normal + contact.places, tangent + len(contact.tangents)
        self.contacts = slice(row - self.touching.count, row)
        self.rubs = Rubs(model, data, self.geoms, tangents)
        one_each = len(self.sole) == len(self.places) and all(len(rows) == 1 for _, rows in self.touches.values())
        self.steady, self.only = one_each, ((0, 0),)
        self.dry = dict(zip(self._rubbed(), range(tangent, tangent + model.nv + model.ntendon), strict=False))
        self.sole |= self.dry
        self.nc = tangent + len(self.dry)
        self._known: dict[tuple[bytes, ...], tuple[Present, ...]] = {}

    def anew(self, scene: Scene, model: Any, data: Any) -> Rows:
        """Return the same of another model of a scene."""
        return type(self)(scene, model, data)

    def _rubbed(self) -> Iterator[tuple[int, int]]:
        """Return what MuJoCo calls the rows of dry friction: kind, and velocity or tendon."""
        dof = 0
        for joint in self.scene.joints:  # in the model's order, likewise
            width = WIDTHS[joint.type][1]
            yield from ((DRY[0], dof + k) for k in range(width if joint.friction_loss > 0.0 else 0))
            dof += width
        yield from ((DRY[1], i) for i, tendon in enumerate(self.scene.tendons) if tendon.friction_loss > 0.0)

    def by_corners(self, contact: Contact) -> bool:
        """Return whether the model has a shape for each place of a contact, and a pair for each row."""
        return contact.second.name not in self.geoms

    def pair_ids(self) -> list[int]:
        """Return the model's pair of every contact's row, by name: the compiler sorts them by bodies."""
        names = [
            contact.normals if self.by_corners(contact) else (contact.pair.name,) * contact.places
            for contact in self.touching.all
        ]
        return [int(self.model.pair(name).id) for part in names for name in part]

    def constants(self, *, own: bool = False) -> dict[str, Any]:
        """Return the law of every row as the model has it: a0, a1, a2 where the case's, else the pairs."""
        model = self.model
        solref = [*np.repeat(model.eq_solref, [loop.width for loop in self.scene.loops], axis=0)]
        bounds = {int(LIMITS[0]): model.jnt_solref, int(LIMITS[1]): model.tendon_solref_lim}
        solref += [bounds[kind][i] for kind, i, _ in self.places]
        solref += [model.pair_solref[i] for i in self.pair_ids()] if model.npair else []
        solref += [model.geom_solref[part] for part, _ in map(sorted, self.touches)] if not model.npair else []
        pairs = np.array(solref).reshape(-1, 2)
        if own or (pairs > 0.0).any():
            return {"solref": pairs}
        return dict(zip(("a0", "a1", "a2"), (*(-pairs.T / MAX_IMPEDANCE), self.cubic), strict=True))

    def present(self) -> tuple[Present, ...]:
        """Return what MuJoCo has a row for now, of those that may open."""
        data = self.data
        first, last = data.ne, data.nefc
        if first == last:
            return ()
        if not self.steady:
            return tuple(self._present(first, last))
        if self.nc == 1:
            return self.only
        there = data.efc_type[first:last].tobytes(), data.efc_id[first:last].tobytes(), data.contact.geom.tobytes()
        if (known := self._known.get(there)) is None:
            known = self._known[there] = tuple(self._present(first, last))
        return known

    def _present(self, first: int, last: int) -> Iterator[Present]:
        data = self.data
        rows = zip(data.efc_type[first:last].tolist(), data.efc_id[first:last].tolist(), strict=True)
        for j, (kind, part) in enumerate(rows, first):
            if (row := self.sole.get((kind, part))) is not None:
                yield j, row
            elif kind in LIMITS:
                yield j, self._place(j, kind, part)
            elif (kind == TOUCH or (self.frictional and not self.rubbing and kind in FRICTIONAL)) and self._geoms(
                part
            ) in self.touches:
                yield j, self._touch(part)

    def lam(self) -> Floats:
        """Return the multiplier of every row (nc,), 0 where it does not act."""
        data, lam = self.data, np.zeros(self.nc)
        lam[: self.always] = self._along_bodies(data.efc_force, data)
        for j, row in self.present():
            lam[row] += data.efc_force[j]
        for rub in self._rubbing():
            lam[rub.row] += rub.normal
            if rub.row in self.rubs.tangents:
                lam[self.rubs.tangents[rub.row] :][: len(WAYS)] += rub.across
        return lam

    def _rubbing(self) -> Sequence[Rub]:
        """Return the contacts with friction that MuJoCo has now, with 1e-5 for coefficients of 0."""
        return self.rubs.at(self._met) if self.rubbing else ()

    def _met(self) -> dict[int, tuple[Contact, int]]:
        """Return which of MuJoCo's contacts have friction now, and the scene's contact and row of each."""
        there = zip(self.data.contact.dim.tolist(), self.data.contact.efc_address.tolist(), strict=True)
        known = [i for i, (dim, first) in enumerate(there) if dim > 1 and first >= 0 and self._geoms(i) in self.touches]
        return {i: (self.touches[self._geoms(i)][0], self._touch(i)) for i in known}

    def jacobian(self) -> Floats:
        """Return H (nc, nv); 0 of a row that is not there."""
        J, H = constraint_jacobian(self.model, self.data), np.zeros((self.nc, self.model.nv))
        H[: self.always] = self._along_bodies(J, self.data)
        for j, row in self.present():
            H[row] = J[j]
        return H

    def _along_bodies(self, values: Floats, data: Any) -> Floats:
        """Return what MuJoCo has for the rows that are always on, along the axes that the scene's have."""
        found: Floats = values[: self.always]
        for rows, axes in self.welds:
            found = found.copy()
            found[rows] = axes(data) @ found[rows]
        return found

    def _geoms(self, part: int) -> frozenset[int]:
        """Return the shapes of a contact; in a file as it stands some meet whose pairs have no rows."""
        return frozenset(int(i) for i in self.data.contact[part].geom)

    def _touch(self, part: int) -> int:
        """Return which row a contact is: of points that shapes are round it is at the nearest."""
        found = self.data.contact[part]
        contact, rows = self.touches[self._geoms(part)]
        if len(rows) == 1:
            return rows[0]
        one, two = (
            (self.data.geom_xmat[i].reshape(3, 3), self.data.geom_xpos[i])
            for i in (self.geoms[contact.first.name], self.geoms[contact.second.name])
        )
        if contact.parallel > 0.0:
            return rows[end_of(contact, one, two, found.pos)]
        off = corners(contact.second.type, contact.second.extents) - two[0].T @ (found.pos - two[1])
        return rows[int(np.argmin(np.einsum("ij,ij->i", off, off)))]

    def _place(self, j: int, kind: int, part: int) -> int:
        """Return which bound an active row is: of a joint the upper one has a falling gap, of a tendon it is nearer."""
        J = constraint_jacobian(self.model, self.data)[j]
        if kind == LIMITS[0] and self.scene.joints[part].type == "ball":
            return self.places[kind, part, True]
        if kind == LIMITS[0]:
            return self.places[kind, part, bool(J.sum() < 0.0)]
        (low, high), length = self.scene.tendons[part].range, self.data.ten_length[part]
        off = abs(self.data.efc_pos[j] - (length - low)), abs(self.data.efc_pos[j] - (high - length))
        return self.places[kind, part, bool(off[1] < off[0])]

    def modes(self) -> Modes:
        """Return the mode of every row: a bound is in contact where it pushes."""
        lam = self.lam()[self.always : self.contacts.stop]
        modes = [int(Mode.BILATERAL)] * self.always + [int(Mode.CONTACT if x > 0.0 else Mode.FREE) for x in lam]
        for rub in (rub for rub in self._rubbing() if rub.row in self.rubs.tangents and rub.normal > 0.0):
            modes[rub.row] = int(Mode.SLIP if rub.slides else Mode.STICK)
        modes += [modes[row] for row in self.rubs.tangents for _ in WAYS] + [int(Mode.STICK)] * len(self.dry)
        for j, row in self.present() if self.dry else ():
            bound = (1.0 - AT_BOUND) * self.data.efc_frictionloss[j]
            if row >= self.nc - len(self.dry) and abs(self.data.efc_force[j]) >= bound:
                modes[row] = int(Mode.SLIP)
        return tuple(modes)

    def observe(self) -> Observe:
        """Return what reads gaps and energies of recorded states."""
        data, spared = mujoco.MjData(self.model), self.model.body_gravcomp * self.model.body_mass

        def observe(q: Floats, v: Floats) -> tuple[Floats, Floats]:
            first, lighter = self.contacts.start, spared.any()
            gaps, energy = np.zeros((len(q), self.nc)), np.empty((len(q), 2))
            gaps[:, self.contacts], lengths = self._apart(q, data), np.empty((len(q), self.model.ntendon))
            for i in range(len(q)):
                data.qpos[:], data.qvel[:] = q[i], v[i]
                mujoco.mj_fwdPosition(self.model, data)
                mujoco.mj_fwdVelocity(self.model, data)
                mujoco.mj_energyPos(self.model, data)
                mujoco.mj_energyVel(self.model, data)
                gaps[i, : self.always], lengths[i] = self._along_bodies(data.efc_pos, data), data.ten_length
                energy[i] = data.energy[1], data.energy[0]
                if lighter:
                    energy[i, 1] += spared @ (data.xipos @ self.model.opt.gravity)
            if first > self.always:
                gaps[:, self.always : first] = self.forces.bounds(q, lengths)
            return gaps, energy

        return observe

    def _apart(self, q: Floats, data: Any) -> Floats:
        """Return the gaps (n, contacts) of recorded positions (n, nq)."""
        gaps, bodies, n = np.empty((len(q), self.touching.count)), numbers(self.scene), self.model.nbody
        if not self.touching.count:
            return gaps
        R, p, ways = np.empty((TOGETHER, n, 3, 3)), np.empty((TOGETHER, n, 3)), dict[int, bool]()
        for first in range(0, len(q), TOGETHER):
            part = q[first : first + TOGETHER]
            for k, position in enumerate(part):
                data.qpos[:] = position
                mujoco.mj_kinematics(self.model, data)
                R[k], p[k] = data.xmat.reshape(-1, 3, 3), data.xpos
            poses = {name: (R[: len(part), i], p[: len(part), i]) for name, i in bodies.items()}
            gaps[first : first + TOGETHER] = self.touching.recorded(poses.__getitem__, ways)
        return gaps


def _welds(scene: Scene, model: Any) -> Iterator[tuple[slice, Callable[[Any], Floats]]]:
    """Yield the rotational rows of every weld, and what gives the axes (3, 3) that they are along in the second body.

    MuJoCo's are along those of a site, a scene's along the body's. Of the two quaternions of what is left between both
    MuJoCo takes the one that comes out, and its rows are the negative of the scene's, which takes the other.
    """
    row = 0
    for i, loop in zip(np.flatnonzero(model.eq_active0), scene.loops, strict=True):
        if loop.type == "weld":
            sites = model.eq_objtype[i] == mujoco.mjtObj.mjOBJ_SITE
            one, two = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
            ends = (
                [(int(model.site_bodyid[k]), model.site_quat[k]) for k in (one, two)]
                if sites
                else [(one, model.eq_data[i, 6:10]), (two, np.array([1.0, 0.0, 0.0, 0.0]))]
            )
            yield slice(row + 3, row + 6), partial(_axes, ends)
        row += loop.width


def _axes(ends: Sequence[tuple[int, Floats]], data: Any) -> Floats:
    first, second, R = np.zeros(4), np.zeros(4), np.zeros(9)
    for turn, (body, own) in zip((first, second), ends, strict=True):
        mujoco.mju_mulQuat(turn, data.xquat[body], own)
    mujoco.mju_quat2Mat(R, ends[1][1])
    return R.reshape(3, 3) if first @ second >= 0.0 else -R.reshape(3, 3)
