"""DART finds a tilted ellipsoid where it touches: by FCL, since its own detector makes a hull of 162 points of it."""

from __future__ import annotations

import numpy as np
import pytest
from friction_scenes import pair

from crossbody import engines
from crossbody.cases import Case, CaseUnsupported, Mode
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Scene, Shape

pytest.importorskip("dartpy")
SIZE = (0.1, 0.06, 0.15)


def egg(seed: int, *more: Shape, size: tuple[float, float, float] = SIZE) -> Case:
    """Return an ellipsoid that spins over a floor, turned at random, with further shapes."""
    draw = np.random.default_rng(seed)
    turn = draw.normal(size=4)
    shapes = (Shape(name="floor", type="plane"), Shape(name="egg", body="egg", type="ellipsoid", size=size), *more)
    scene = Scene(
        bodies=(Body(name="egg", mass=1.0, inertia=(0.005, 0.006, 0.003, 0.0, 0.0, 0.0)),),
        joints=(Joint(name="free", body="egg", type="free"),), shapes=shapes,
        pairs=tuple(pair("floor", shape.name, 0.3) for shape in shapes[1:]),
    )  # fmt: skip
    v0 = np.array([0.5, 0.0, -0.5, *draw.uniform(-8.0, 8.0, 3)])
    return case_of(scene, q0=[0.0, 0.0, 0.2, *(turn / np.linalg.norm(turn))], v0=v0, t_end=0.3)


@pytest.mark.parametrize("seed", range(6))
def test_a_tilted_ellipsoid_is_found_within_a_step(seed: int) -> None:
    run = engines.load("dart").prepare(egg(seed), "matched").run()
    free, fell = run.mode[:, 0] == Mode.FREE, np.abs(np.diff(run.gap[:, 0]))
    assert (~free).any()
    assert -run.gap[free, 0].min() <= 2.0 * fell.max()


def test_its_own_detector_is_refused_for_ellipsoids_and_is_taken_for_balls() -> None:
    dart = engines.load("dart")
    assert dart.planned(egg(0), "matched")["detector"] == "fcl"
    assert dart.planned(egg(0, size=(0.1, 0.1, 0.1)), "matched")["detector"] == "dart"
    with pytest.raises(CaseUnsupported, match="hull of 162 points"):
        dart.prepare(egg(0), "matched", detector="dart")
    capsule = Shape(name="rod", body="egg", type="capsule", size=(0.01, 0.05, 0.0))
    assert "treats the capsule 'rod' as a sphere" in str(dart.why_not(egg(0, capsule), "matched"))


def test_a_hull_of_162_points_touches_late() -> None:
    """What the refusal says, measured: the gap at which DART's own detector finds tilted ellipsoids first."""
    import dartpy

    from crossbody.engines.dart._contacts import Rubs

    late, depth = [], 5e-3
    kinds = {"fcl": dartpy.collision.FCLCollisionDetector, "dart": dartpy.collision.DARTCollisionDetector}
    for case in map(egg, range(6)):
        stepper = Rubs(case, {"dt": 1e-3, "detector": "fcl", "restitution": 0.0, "sleep": False})
        solver, lower = stepper.world.getConstraintSolver(), case.q0.copy()
        lower[2] -= stepper.touching.touches(stepper.pose).gap[0] + depth
        stepper._put(lower, case.v0)
        found = {}
        for name, kind in kinds.items():
            stepper._only_pairs(kind())
            met = dartpy.collision.CollisionResult()
            solver.getCollisionGroup().collide(solver.getCollisionOption(), met)
            found[name] = max(one.penetrationDepth for one in met.getContacts())
        assert found["fcl"] == pytest.approx(depth, abs=1e-5)
        late.append(depth - found["dart"])
    assert max(late) > 1e-4
    assert max(late) < SIZE[2] * (1.0 - np.cos(np.radians(18.0)))
