"""The obvious model of a scene: shapes that collide with MuJoCo's own constants, integrator and step."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Mode
from crossbody.cases.arrays import Floats, quantiles
from crossbody.cases.scene import RowLaw, Scene
from crossbody.cases.scene_contacts import by_shapes
from crossbody.engines._log import Modes
from crossbody.engines._scene import Forces
from crossbody.engines.mujoco._build import add_shape, compiled, spec_of
from crossbody.engines.mujoco._rows import Rows
from crossbody.engines.mujoco._rubs import EDGES

USUAL = 1e4
"""Stiffness over mass of bodies that collide with each other, 1/s^2: about the largest that a
step of 2 ms resolves. MuJoCo's own constants (solref 0.02 1) would have them stick together."""
SMALL, SLIGHT = 1e-12, 1e-8
"""Gap that rounding may make of bodies that touch, m or rad; the heaviest's acceleration by its push."""
LOCKED = 1e-3
"""Inertia of a joint amid all, over their mean, below which one is so heavy that it stands still.
The tolerance of MuJoCo's solver is relative to the mean: beside 1e6 kg m^2 it would never start,
and is relative to that amid all."""
FREE, CONTACT, BALLISTIC = int(Mode.FREE), int(Mode.CONTACT), int(Mode.BALLISTIC)


class Obvious(Rows):
    """Rows by shapes where they are distances of shapes; closed ones push or not, without memory."""

    def __init__(self, scene: Scene, model: Any, data: Any) -> None:
        super().__init__(by_shapes(scene), model, data)
        self.bounds, self.frictional, self.slight = Forces(scene), True, SLIGHT * float(model.body_mass.max())
        # Contacts stand behind bounds: where all bounds are shapes, in the order in which these were bounds.
        self.known = self.nc - self.always == len(self.bounds.bound_at) == self.touching.count
        self.alone = {tuple(sorted(geoms)): rows[0] for geoms, (_, rows) in self.touches.items() if len(rows) == 1}
        self.known &= len(self.alone) == len(self.touches)

    def lam(self) -> Floats:
        """Return the multiplier of every row (nc,): of a contact the sum of the edges of its pyramid."""
        if not self.known:
            return super().lam()
        data, lam = self.data, np.zeros(self.nc)
        if data.nefc:
            lam[: self.always] = self._along_bodies(data.efc_force, data)
            contacts = data.contact
            for geoms, first in zip(contacts.geom.tolist(), contacts.efc_address.tolist(), strict=True):
                row = self.alone.get(tuple(sorted(geoms)))
                if row is not None and first >= 0:
                    lam[row] += data.efc_force[first : first + EDGES].sum()
        return lam

    def gaps(self) -> Floats:
        """Return the gaps of all rows that open, m or rad."""
        return self.bounds.bounds(self.data.qpos, self.data.ten_length)

    def modes(self) -> Modes:
        """Return the mode of every row by its gap and multiplier."""
        if not self.known:
            return super().modes()
        always, gaps = (int(Mode.BILATERAL),) * self.always, self.gaps().tolist() if self.nc > self.always else []
        if min(gaps, default=1.0) > SMALL:
            return always + (FREE,) * len(gaps)
        pushes = self.lam()[self.always :].tolist()
        closed = (CONTACT if push > self.slight else BALLISTIC for push in pushes)
        return always + tuple(FREE if gap > SMALL else mode for gap, mode in zip(gaps, closed, strict=True))


def obvious(scene: Scene, *, colliding: bool = False) -> Any:
    """Return the model of a scene: MuJoCo's contacts and law of rows, solids in the place of point masses.

    What is a bound in the scene is a shape among all others. Pairs that the scene states are the
    only ones, unless all shapes collide, in the place of rows that no part of the scene has.
    """
    given, scene = scene, by_shapes(scene)
    solids = _solids(scene)
    spec = spec_of(scene, solids=solids)
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    stated, elastic = {pair.name for pair in given.pairs}, _elastic(scene)
    for pair in list(spec.pairs):
        if pair.name in stated:
            plain = spec.geom(pair.geomname2)
            pair.solref, pair.solimp = plain.solref, plain.solimp
            continue
        for name in (pair.geomname1, pair.geomname2):
            geom = spec.geom(name)
            geom.contype = geom.conaffinity = 1
            geom.solref = elastic.get(name, geom.solref)
        spec.delete(pair)
    for shape in scene.shapes if colliding else ():
        add_shape(spec, {shape.body: spec.body(shape.body) if shape.body else spec.worldbody}, shape)
        geom = spec.geom(shape.name)
        geom.contype = geom.conaffinity = 1
        geom.friction = shape.friction
    for name, mass in solids.items():
        spec.body(name).geoms[0].mass = mass
    model = compiled(spec, scene)
    plain = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    for name in ("eq_sol{}", "jnt_sol{}", "tendon_sol{}_lim"):
        for kind in ("ref", "imp"):
            getattr(model, name.format(kind))[:] = getattr(plain, f"geom_sol{kind}")[0]
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    if (part := float(quantiles(model.dof_M0, 0.5)[0]) / model.stat.meaninertia) < LOCKED:
        model.opt.tolerance *= part
    return model


def _solids(scene: Scene) -> dict[str, float]:
    """Return the masses of bodies that are points in the middle of one shape that collides.

    MuJoCo has no point masses; who writes such a body down gives a mass to its shape.
    """
    met = {name for pair in scene.pairs for name in (pair.first, pair.second)}
    own = [(shape.body, shape.position) for shape in scene.shapes if shape.name in met]
    points = [body for body in scene.bodies if body.mass > 0.0 and not any(body.inertia)]
    return {body.name: body.mass for body in points if [at for name, at in own if name == body.name] == [body.com]}


def _elastic(scene: Scene) -> dict[str, tuple[float, float]]:
    """Return the solref of shapes of bodies that bounce, with their law's damping ratio."""
    bodies = {shape.name: shape.body for shape in scene.shapes}
    found: dict[str, tuple[float, float]] = {}
    for pair in scene.pairs:
        if bodies[pair.first] and bodies[pair.second] and _ratio(pair.law) < 1.0:
            own = -USUAL, -2.0 * _ratio(pair.law) * USUAL**0.5
            found |= {pair.first: own, pair.second: own}
    return found


def _ratio(law: RowLaw) -> float:
    """Return the damping ratio of a row as it is entered; 1 without stiffness."""
    a0, a1 = (law.b0, law.b1) if law.b0 > 0.0 else (law.a0, law.a1)
    return 0.5 * a1 / float(np.sqrt(a0)) if a0 > 0.0 else 1.0
