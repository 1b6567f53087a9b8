"""Which shapes may touch and by what law, against MuJoCo's own contacts on random models."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from crossbody.cases.files import mjcf
from crossbody.cases.files.pairs import pairs_of


def random_model(rng: np.random.Generator) -> mujoco.MjModel:
    """Spheres on a tree of bodies, some without joints, all within reach of each other, with everything at random."""
    spec = mujoco.MjSpec()
    bodies, geoms = [spec.worldbody], []
    for i in range(8):
        parent = bodies[int(rng.integers(len(bodies)))]
        body = parent.add_body(name=f"b{i}", pos=0.05 * rng.normal(size=3))
        if rng.random() < 0.7:
            body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=rng.normal(size=3))
        bodies.append(body)
    for i, body in enumerate((*bodies, *bodies[1:])):
        direct = rng.random() < 0.2
        body.add_geom(
            name=f"g{i}", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.5, 0, 0], pos=0.1 * rng.normal(size=3),
            contype=int(rng.integers(4)), conaffinity=int(rng.integers(4)), priority=int(rng.integers(2)),
            solmix=float(rng.choice([0.0, 1.0, 1.0, 2.5])), condim=int(rng.choice([1, 3, 4, 6])),
            solref=-rng.uniform(10, 100, 2) if direct else rng.uniform(0.02, 0.1, 2), friction=rng.uniform(0, 1, 3),
            solimp=[0.8, rng.uniform(0.85, 0.99), 1e-3, 0.5, 2.0], margin=rng.uniform(0, 0.1),
        )  # fmt: skip
        geoms.append((f"g{i}", body.name))
    spec.add_exclude(bodyname1="b0", bodyname2="b5")
    for _ in range(3):
        one, two = rng.choice(len(geoms), 2, replace=False)
        if geoms[one][1] != geoms[two][1]:
            spec.add_pair(
                geomname1=geoms[one][0], geomname2=geoms[two][0], condim=3, solref=[0.07, 0.8], margin=0.02,
                friction=rng.uniform(0, 1, 5),
            )  # fmt: skip
    return spec.compile()


@pytest.mark.parametrize("seed", range(30))
def test_pairs_are_those_of_mujoco(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = random_model(rng)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    found = {frozenset((p.first, p.second)): p for p in pairs_of(model, lambda i: model.geom(i).name, mjcf.law)}
    theirs = {frozenset(model.geom(int(i)).name for i in c.geom): c for c in data.contact}
    assert set(found) == set(theirs)
    assert len(found) > 3
    for which, contact in theirs.items():
        pair = found[which]
        assert pair.dimension == contact.dim
        assert pair.margin == pytest.approx(contact.includemargin, abs=1e-15)
        assert pair.friction == pytest.approx(np.maximum(contact.friction, 0.0), abs=1e-4)
        mixed = mjcf.law(model, contact.solref, contact.solimp)
        assert (pair.law.a0, pair.law.a1) == pytest.approx((mixed.a0, mixed.a1), rel=1e-12)
