"""Contacts that press and let go in turn, and what stands beside others: modes of scenes that came up in drawn ones."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody.cases import Outcome
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape
from crossbody.reference import simulate
from crossbody.reference.tree.system import system

FLOOR = Shape(name="floor", type="plane")


def on(place: str, shape: str, mu: float, law: RowLaw) -> Pair:
    return Pair(name=f"{place}:{shape}", first=place, second=shape, friction=(mu, mu, 0, 0, 0), dimension=3, law=law)


def hinged() -> tuple[Scene, list[float], list[float]]:
    """Return a small sphere that a box hangs on, by a hinge with dry friction and bounds; gravity is strong."""
    axis, span = (0.890307120952631, -0.4459621003236011, 0.09203822823153315), 0.02087216367137542
    scene = Scene(
        bodies=(
            Body(name="ball", mass=0.7098478783396295,
                 inertia=(4.860194614694038e-05, 5.0593083324723906e-05, 5.974096865050583e-05, 0, 0, 0)),
            Body(name="box", parent="ball", position=(0.00917718703661718, -0.022911632777922186, 0.05918570442908815),
                 mass=0.5756157010540808,
                 inertia=(6.971246661437293e-05, 5.119971423725394e-05, 5.525004773773867e-05, 0, 0, 0)),
        ),
        joints=(
            Joint(name="free", body="ball", type="free"),
            Joint(name="hinge", body="box", type="hinge", axis=axis, range=(-span, span),
                  anchor=(-0.01192348439381363, -0.0002452841477782877, 0.02084567102911538),
                  damping=(0.0002786281975966574, 0.0, 0.0), friction_loss=0.0786422950661006,
                  law=RowLaw(a0=147.81822911165708, a1=43.86292763460898)),
        ),
        shapes=(
            FLOOR, Shape(name="ball", body="ball", size=(0.006404005042960055, 0.0, 0.0)),
            Shape(name="box", body="box", type="box",
                  size=(0.02049023484763817, 0.01127321096493187, 0.020192501127430956)),
        ),
        pairs=(
            on("floor", "ball", 1.951483195321667, RowLaw(a0=166213.21572885188, a1=3787.535053691653)),
            on("floor", "box", 1.9890230493629066, RowLaw(a0=222810.0629949175, a1=0.0)),
        ),
        gravity=(0.0, 0.0, -100.0),
    )  # fmt: skip
    q0 = [-0.008580994943640242, 0.002792354594789081, 0.006404005042960055, 1.0, 0.0, 0.0, 0.0, 0.006694058478571628]
    v0 = [-0.06509771317131695, -0.024345903161820483, 0.0, 0.0, 0.0, 0.7358676541634118, -0.5902585845948892]
    return scene, q0, v0


@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10])
def test_a_contact_jams_once_a_bound_lets_go(rtol: float) -> None:
    """Alone its p is -2.5: where the joint's bound comes to bear nothing, no set of modes is consistent."""
    scene, q0, v0 = hinged()
    run = simulate(system(scene, case_of(scene).law), q0, v0, 0.0764, rtol=rtol)
    assert run.outcome is Outcome.PAINLEVE, run.message
    assert run.t[-1] == pytest.approx(0.0599233, abs=1e-6)
    assert "Rows [3]" in run.message


def planar(name: str) -> tuple[Joint, ...]:
    kinds = (("x", (1, 0, 0), "slide"), ("z", (0, 0, 1), "slide"), ("turn", (0, 1, 0), "hinge"))
    return tuple(Joint(name=f"{name} {way}", body=name, type=kind, axis=axis) for way, axis, kind in kinds)


def beside() -> tuple[Scene, list[float], list[float]]:
    """Return a capsule, and far from it a cylinder on which a light body hangs by a hinge with dry friction, planar."""
    scene = Scene(
        bodies=(
            Body(name="capsule", mass=16.80301479478243,
                 inertia=(0.7425782073964797, 0.7948653312264157, 0.5744516863941354, 0, 0, 0)),
            Body(name="can", mass=1.766417504187273,
                 com=(-0.01323792588532594, -0.03482260519258933, -0.05579407053103284),
                 inertia=(0.06027376139673915, 0.07394451660802383, 0.07849153526098823, 0, 0, 0)),
            Body(name="lid", parent="can", position=(0.2708877334106353, 0.08190103128439391, 0.5088787334687809),
                 mass=0.029605584876415916,
                 inertia=(0.0009615759720435794, 0.0012790825114958268, 0.0008599317753627477, 0, 0, 0)),
        ),
        joints=(
            *planar("capsule"), *planar("can"),
            Joint(name="hinge", body="lid", type="hinge",
                  axis=(0.6664355729468598, -0.37122939976648517, 0.6465696867778491),
                  anchor=(-0.16808816715767486, 0.3971525571390276, 0.12785280715065414),
                  damping=(0.005407664306637603, 0.0, 0.0), stiffness=(1.0815328613275204, 0.0, 0.0),
                  friction_loss=0.06436440059995154),
        ),
        shapes=(
            FLOOR,
            Shape(name="capsule", body="capsule", type="capsule", size=(0.20191428951709686, 0.09467104498619634, 0)),
            Shape(name="can", body="can", type="cylinder", size=(0.14596333759721256, 0.3690144434730494, 0.0)),
        ),
        pairs=(
            on("floor", "capsule", 1.0616158352777827, RowLaw(a0=12.191803718543222, a1=16.04640021752663)),
            on("floor", "can", 1.4253891738568278, RowLaw(a0=241.10310861266237, a1=0.0)),
        ),
    )  # fmt: skip
    q0 = [0.0, 0.9460543334263669, 0.35751798223645476, 0.0, 2.838163000279101, -0.9063549923687968,
          -0.2091097689372385]  # fmt: skip
    v0 = [1.022830944160486, 0.6987079054278467, -0.373501102838678, 1.340068932884136, -0.5456156003504307,
          0.19396198790804348, 0.7440375747709066]  # fmt: skip
    return scene, q0, v0


@pytest.mark.parametrize("rtol", [1e-6, 1e-7, 1e-9])
def test_a_can_lands_beside_a_capsule_that_sticks(rtol: float) -> None:
    """Nothing moves a planar contact across its plane: what was once asked there of another row is not asked of it."""
    scene, q0, v0 = beside()
    run = simulate(system(scene, case_of(scene).law), q0, v0, 1.5, rtol=rtol)
    assert run.outcome is Outcome.FINISHED, run.message
    alone = scene.replace(
        bodies=scene.bodies[1:], joints=scene.joints[3:], pairs=scene.pairs[1:],
        shapes=tuple(one for one in scene.shapes if one.body != "capsule"),
    )  # fmt: skip
    other = simulate(system(alone, case_of(alone).law), q0[3:], v0[3:], 1.5, rtol=rtol)
    assert np.abs(run.q[-1, 3:] - other.q[-1]).max() < 1e4 * rtol


def rolling_can() -> tuple[Scene, list[float], list[float]]:
    """Return a can on whose side a ball turns by a ball joint: it slides, tilts, rolls on its rim and stands again."""
    scene = Scene(
        bodies=(
            Body(name="can", mass=1.4353918060068598,
                 com=(0.1379125213061613, -0.16766089869612466, 0.3659768747906432),
                 inertia=(0.7341695921838506, 0.8866051477120641, 0.8905815612005783, 0, 0, 0)),
            Body(name="ball", parent="can", position=(1.6416824243048682, 1.0685748768634342, 0.31919810772918206),
                 mass=0.6388005533364657,
                 inertia=(0.38000455496926505, 0.4165778746081745, 0.23813987891273344, 0, 0, 0)),
        ),
        joints=(
            Joint(name="free", body="can", type="free"),
            Joint(name="joint", body="ball", type="ball",
                  anchor=(0.4524937570939716, -0.9067329538912671, -0.7755280275298921)),
        ),
        shapes=(
            FLOOR,
            Shape(name="wall", type="plane", position=(5.065595783693662, 0.0, 0.0),
                  orientation=(0.7071067811865476, 0.0, -0.7071067811865475, 0.0)),
            Shape(name="can", body="can", type="cylinder", size=(1.0185719988087059, 0.60434661689889, 0.0)),
            Shape(name="ball", body="ball", size=(0.7701918199295115, 0.0, 0.0)),
        ),
        pairs=(
            on("floor", "can", 0.16636863222797238, RowLaw(a0=3248.4240273859605, a1=88.45044772281464)),
            on("wall", "can", 0.010184479297496296, RowLaw(a0=7342777.451959152, a1=2737.483232656127)),
            on("floor", "ball", 0.2742529309789744, RowLaw(a0=35.893078332259186, a1=0.0)),
            on("wall", "ball", 0.16652226205668974, RowLaw(a0=60642.05039328782, a1=0.0)),
        ),
    )  # fmt: skip
    q0 = [-0.18801739569607026, 0.7197079736972247, 0.60434661689889, 1.0, 0.0, 0.0, 0.0, 0.9663151770026113,
          -0.02724005502276191, 0.22979277265063042, 0.11264208686944872]  # fmt: skip
    v0 = [0.45484397748700933, -0.4167378599990202, 0.0, 0.0, 0.0, 0.8037369919724906, -0.583092733573168,
          0.441442902353775, -0.1262408005136081]  # fmt: skip
    return scene, q0, v0


@pytest.mark.parametrize("rtol", [1e-6, 1e-7, 1e-8, 1e-9])
def test_a_can_that_tilts_from_where_it_stands_slides_where_it_is_fast(rtol: float) -> None:
    """It turns on a point of its rim that sticks; once it tilts another one is lowest, which is far from still."""
    scene, q0, v0 = rolling_can()
    run = simulate(system(scene, case_of(scene).law), q0, v0, 3.721, rtol=rtol)
    assert run.outcome is Outcome.FINISHED, run.message
