"""MuJoCo's matched rows hold the law at random states, strings and contacts of one place alike."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from random_scenes import random_scene, random_state, with_own_laws

from crossbody.cases import Mode
from crossbody.cases import load as load_case
from crossbody.cases.files.case import case_of
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape
from crossbody.cases.scene_contacts import contacts
from crossbody.engines import load
from crossbody.engines.equations import system_of
from crossbody.engines.mujoco._model import matched
from crossbody.engines.mujoco._scene import hooked
from crossbody.engines.mujoco._switched import Switched

STATES = 6
SAME = 1e-5
"""MuJoCo's rows keep 1e-7 of their softness."""


def of_one_place(scene: Scene, names: Sequence[str]) -> NDArray[np.bool_]:
    """Which rows are of no contact that has several: of a deep corner MuJoCo tells a point halfway to the surface."""
    several = {row for contact in contacts(scene) if contact.places > 1 for row in contact.rows}
    return np.array([name not in several for name in names], dtype=bool)


def pushing(scene: Scene, seed: int) -> int:
    """Check the law of the rows that push at random states; returns how many did."""
    case = case_of(scene)
    prepared, system, rng = load("mujoco").prepare(case, "matched").scene, system_of(case), np.random.default_rng(seed)
    mine = of_one_place(scene, case.contacts)
    assert prepared.arm is not None
    prepared.arm((int(Mode.CONTACT),) * len(case.contacts))
    pushed = 0
    with hooked(prepared.hook):
        for _ in range(STATES):
            q, v, _ = random_state(scene, rng)
            prepared.data.qpos[:], prepared.data.qvel[:] = q, v
            mujoco.mj_forward(prepared.model, prepared.data)
            on = (prepared.lam() > 0.0) & mine
            H, h, Hdv = (part[on] for part in system.constraint(q, v))
            a0, a1, _ = system.alpha[on].T
            terms = np.array([H @ prepared.data.qacc, Hdv, a1 * (H @ v), a0 * h])
            assert (np.abs(terms.sum(axis=0)) <= SAME * np.abs(terms).sum(axis=0)).all()
            pushed += int(on.sum())
    return pushed


@pytest.mark.parametrize("seed", range(9))
def test_a_row_that_pushes_follows_the_law(seed: int) -> None:
    """H v' + H'v + a1 h' + a0 h = 0 at MuJoCo's v', by the reference's rows, with all terms of their curvature."""
    assert pushing(with_own_laws(random_scene(seed).replace(loops=()), seed), seed)


def test_rows_of_many_velocities_are_read_as_those_of_few(tmp_path: Path) -> None:
    """MuJoCo keeps rows sparse from 60 velocities on: bounds, a tendon's and a contact's beside so many that rest."""
    runs = []
    for many in (0, 60):
        beside = "".join(f'<body pos="{i} 9 0"><joint type="slide"/><geom size=".1"/></body>' for i in range(many))
        path = tmp_path / f"{many}.xml"
        path.write_text(f"""<mujoco><option gravity="0 0 -9.81"/><default><geom contype="0" conaffinity="0"/></default>
          <worldbody><geom name="floor" type="plane" size="1 1 1" contype="1"/>
          <body pos="0 0 .3"><joint name="a" type="slide" axis="0 0 1" range="-.1 1" limited="true"/>
          <geom size=".1"/></body>
          <body pos="1 0 .3"><joint name="b" type="slide" axis="0 0 1"/><geom size=".1"/></body>
          <body pos="2 0 .3"><joint type="slide" axis="0 0 1"/><geom name="ball" size=".1" conaffinity="1"/></body>
          {beside}</worldbody>
          <tendon><fixed limited="true" range="-.05 1"><joint joint="b" coef="1"/></fixed></tendon></mujoco>""")
        case = load_case(str(path), friction=1, t_end=0.4)
        runs.append(load("mujoco").prepare(case, "as_is").run())
    few, lots = runs
    assert np.abs(lots.q[:, :3] - few.q).max() < 1e-12
    assert (lots.mode == few.mode).all()
    assert np.abs(lots.lam - few.lam).max() < 1e-9 * few.lam.max()
    assert (few.lam.max(axis=0) > 0.0).sum() >= 3


@pytest.mark.parametrize("seed", range(9))
def test_rows_approach_as_those_of_the_reference(seed: int) -> None:
    """By gap, rate and acceleration where nothing acts but forces, from where their law has them at zero."""
    scene = with_own_laws(random_scene(seed).replace(loops=()), seed)
    case, rng = case_of(scene), np.random.default_rng(seed)
    model = matched(scene)
    data = mujoco.MjData(model)
    rows, system = Switched(scene, model, data), system_of(case)
    for _ in range(STATES):
        q, v, _ = random_state(scene, rng)
        data.qpos[:], data.qvel[:] = q, v
        gap, rate, ahead = rows.approach()
        H, h, _ = system.constraint(q, v)
        there = of_one_place(scene, case.contacts) & (rate != 0.0)
        assert there.any() or not len(h)
        for mine, theirs in ((gap, h), (rate, H @ v), (ahead, H @ data.qacc_smooth)):
            assert np.abs(mine - theirs)[there].max(initial=0.0) <= SAME * max(1.0, np.abs(theirs).max(initial=0.0))


def test_a_contact_that_is_alone_follows_the_law() -> None:
    """One row takes another way than several: of a rod that turns over the floor it has H' v too."""
    rod = Body(name="rod", mass=2.0, inertia=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0))
    turning = Joint(name="turns", body="rod", type="hinge", axis=(0.0, -1.0, 0.0))
    scene = Scene(
        bodies=(rod,), joints=(Joint(name="height", body="rod", type="slide"), turning),
        shapes=(Shape(name="floor", type="plane"), Shape(name="end", body="rod", position=(0.4, 0.0, -2.0))),
        pairs=(Pair(name="touch", first="floor", second="end", law=RowLaw(a0=100.0, a1=5.0)),),
    )  # fmt: skip
    assert pushing(scene, 3)


@pytest.mark.parametrize("seed", range(30))
def test_an_audit_tells_the_law_of_every_row_in_its_place(seed: int) -> None:
    """MuJoCo's compiler sorts pairs by the bodies that they join, a scene lists them as it likes."""
    scene, rng = with_own_laws(random_scene(seed), seed), np.random.default_rng(seed)
    scene = scene.replace(pairs=tuple(scene.pairs[i] for i in rng.permutation(len(scene.pairs))))
    case = case_of(scene)
    told = load("mujoco").prepare(case, "matched").audit()["constants"]
    for name, wanted in (("a0", case.law.a0), ("a1", case.law.a1)):
        np.testing.assert_allclose(told[name], wanted, rtol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_recorded_gaps_are_those_of_the_shapes_wherever_their_body_has_its_weight(seed: int) -> None:
    rng = np.random.default_rng(seed)
    com, place, spin = rng.uniform(-0.2, 0.2, 3), rng.uniform(-0.2, 0.2, 3), rng.normal(size=6)
    scene = Scene(
        bodies=(Body(name="thing", mass=1.0, com=com, inertia=(0.02, 0.03, 0.04, 0.0, 0.0, 0.0)),),
        joints=(Joint(name="thing", body="thing", type="free"),),
        shapes=(Shape(name="floor", type="plane"),
                Shape(name="knob", body="thing", size=(0.05, 0.0, 0.0), position=place)),
        pairs=(Pair(name="below", first="floor", second="knob"),),
    )  # fmt: skip
    case = case_of(scene, q0=[0.0, 0.0, 0.6, 1.0, 0.0, 0.0, 0.0], v0=spin, t_end=0.3)
    run = load("mujoco").prepare(case).run()
    rotation = matrices(run.q[:, 3:])
    assert run.gap[:, 0] == pytest.approx(run.q[:, 2] + (rotation @ place)[:, 2] - 0.05, abs=1e-12)


@pytest.mark.parametrize(
    ("before", "pushes", "spent", "after"),
    [
        (Mode.FREE, True, False, Mode.COLLISION), (Mode.FREE, False, False, Mode.BALLISTIC),
        (Mode.COLLISION, True, False, Mode.COLLISION), (Mode.COLLISION, True, True, Mode.CONTACT),
        (Mode.COLLISION, False, False, Mode.COLLISION_SEPARATION),
        (Mode.COLLISION_SEPARATION, True, False, Mode.COLLISION),
        (Mode.COLLISION_SEPARATION, False, False, Mode.COLLISION_SEPARATION),
        (Mode.CONTACT, True, False, Mode.CONTACT), (Mode.CONTACT, False, False, Mode.BALLISTIC),
        (Mode.BALLISTIC, False, False, Mode.BALLISTIC),
    ],
)  # fmt: skip
def test_a_row_with_two_sets_collides_until_it_is_spent(
    before: Mode, pushes: bool, spent: bool, after: Mode
) -> None:  # fmt: skip
    """Each of several for itself, whatever the others do."""
    case = load_case("red_body", "resolved")
    assert case.scene is not None
    model = matched(case.scene)
    rows = Switched(case.scene, model, mujoco.MjData(model))
    for row in rows.sets:
        modes = list(rows.free)
        modes[row] = int(before)
        rows.armed = tuple(modes)
        modes[row] = int(Mode.CONTACT if pushes else Mode.BALLISTIC)
        found = rows.entered(modes, [row] if spent else [])
        modes[row] = int(after)
        assert found == tuple(modes)


WELDED = """<mujoco><option gravity="0 0 -9.81"/><worldbody>
<body name="one" pos="0 0 1"><joint name="one" axis="0 1 0"/><geom size=".1" mass="1" contype="0" conaffinity="0"/>
<site name="a" pos="0 0 -.3" euler="{0}"/></body>
<body name="two" pos="0 0 .7"><freejoint/><geom type="box" size=".1 .2 .3" mass="1" contype="0" conaffinity="0"/>
<site name="b" euler="{1}"/></body></worldbody>
<equality><weld name="joined" site1="a" site2="b"/></equality></mujoco>"""


@pytest.mark.parametrize("seed", range(4))
def test_rows_of_a_weld_between_turned_sites_are_along_the_axes_that_the_scene_s_have(seed, tmp_path):
    """MuJoCo has them along the second site's: H, multipliers and gaps are those of the other engines."""
    rng = np.random.default_rng(seed)
    path = tmp_path / "welded.xml"
    path.write_text(WELDED.format(*(" ".join(map(str, rng.uniform(-90.0, 90.0, 3))) for _ in range(2))))
    case = load_case(str(path), t_end=0.01, assemble=1)
    own, other = (load(e).prepare(case, p) for e, p in (("mujoco", "as_is"), ("reference", "compiled")))
    q = own.audit()["q0"] + np.array([0.0, *rng.normal(size=3) * 1e-2, 0.0, 0.0, 0.0, 0.0])
    assert own.audit()["H"](q) == pytest.approx(other.audit()["H"](q), abs=1e-12)
    assert np.abs(own.run().gap[0]).max() <= 1e-12
    matched = load("mujoco").prepare(case, "matched").run()
    assert matched.lam[0] == pytest.approx(other.run().lam[0], abs=1e-5 * np.abs(matched.lam[0]).max())
