"""Convex hulls: their corners over a plane in every engine, meshes of robot files, and what is wrong with a mesh."""

from __future__ import annotations

import os
import re
import struct
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from crossbody import cases, engines
from crossbody.cases import InvalidValue, Mode, Outcome, SceneError
from crossbody.cases.contacts import contacts as touched
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape
from crossbody.cases.scene_contacts import PLACES, contacts, watched
from crossbody.engines._contacts import Contacts
from crossbody.engines.mujoco._build import compiled, spec_of
from crossbody.reports.cli import main

GRAVITY = 9.81
LAW = RowLaw(a0=1e4, a1=20.0)


def random_corners(rng: np.random.Generator, count: int = 12) -> tuple[tuple[float, ...], ...]:
    """The corners of the hull of random points; coordinates that a mesh can have, in single precision."""
    points = 0.1 * rng.normal(size=(count, 3)) + 0.05 * rng.normal(size=3)
    return tuple(tuple(map(float, np.float32(points[k]))) for k in ConvexHull(points).vertices)


def unit(rng: np.random.Generator) -> tuple[float, ...]:
    x = rng.normal(size=4)
    return tuple((x / np.linalg.norm(x)).tolist())


def dropped(seed: int, law: RowLaw = LAW) -> tuple[Scene, np.ndarray, np.ndarray]:
    """A hull with a pose of its own on a body whose inertia is a ball's, over a tilted plane; q and v at the start."""
    rng = np.random.default_rng(seed)
    hull = Shape(name="hull", body="body", type="hull", corners=random_corners(rng),
                 position=tuple(0.1 * rng.normal(size=3)), orientation=unit(rng))  # fmt: skip
    floor = Shape(name="floor", type="plane", position=(0.0, 0.0, -0.2), orientation=(1.0, 0.05, -0.03, 0.2))
    scene = Scene(
        bodies=(Body(name="body", mass=1.3, inertia=(0.01, 0.01, 0.01, 0.0, 0.0, 0.0)),),
        joints=(Joint(name="joint", body="body", type="free"),), shapes=(floor, hull),
        pairs=(Pair(name="pair", first="floor", second="hull", margin=0.002, law=law),), gravity=(0.0, 0.0, -GRAVITY),
    )  # fmt: skip
    q = np.array([*rng.uniform(-1.0, 1.0, 2), 0.6, *unit(rng)])
    return scene, q, np.array([*rng.normal(size=2), 0.5 * rng.normal(), *(3.0 * rng.normal(size=3))])


def heights(scene: Scene, q: np.ndarray, v: np.ndarray, t: float) -> np.ndarray:
    """Gap of every corner in free flight: the angular velocity of a body whose inertia is a ball's stays as it is."""
    floor, hull = scene.shapes
    spin = np.linalg.norm(v[3:])
    turned = np.array([np.cos(0.5 * spin * t), *(np.sin(0.5 * spin * t) * v[3:] / spin)])
    R = matrices(q[3:]) @ matrices(turned)  # w in body axes
    place = q[:3] + v[:3] * t - 0.5 * GRAVITY * t * t * np.array([0.0, 0.0, 1.0])
    local = np.array(hull.position) + np.array(hull.corners) @ matrices(np.array(hull.orientation)).T
    normal = matrices(np.array(floor.orientation) / np.linalg.norm(floor.orientation))[:, 2]
    return (place + local @ R.T - floor.position) @ normal - scene.pairs[0].margin


def touch(scene: Scene, q: np.ndarray, v: np.ndarray) -> tuple[float, int]:
    """When a corner meets the plane first, and which."""
    times = np.linspace(0.0, 1.0, 2001)
    lowest = np.array([heights(scene, q, v, t).min() for t in times])
    a, b = next(pair for pair in pairwise(times) if lowest[times == pair[1]] < 0.0)
    found = float(brentq(lambda t: heights(scene, q, v, t).min(), a, b, xtol=1e-15))
    return found, int(heights(scene, q, v, found).argmin())


WITNESSES = [("reference", "compiled"), ("reference", "cvode"), ("mujoco", "matched"), ("pinocchio", "law")]


@pytest.mark.parametrize(("engine", "profile"), WITNESSES)
@pytest.mark.parametrize("seed", range(3))
def test_a_dropped_hull_touches_with_the_corner_and_at_the_instant_of_its_free_flight(
    seed: int, engine: str, profile: str
) -> None:
    scene, q, v = dropped(seed)
    t, corner = touch(scene, q, v)
    case = cases.from_scene(scene, q0=q, v0=v, t_end=t + 0.01)
    run = engines.load(engine).prepare(case, profile).run()
    assert run.outcome is Outcome.FINISHED, run.message
    first = next(event for event in run.events if event.after == Mode.CONTACT)
    assert (first.contact, first.t) == (corner, pytest.approx(t, abs=1e-9))


@pytest.mark.parametrize("seed", range(2))
def test_both_witnesses_follow_a_hull_over_its_corners_and_its_energy_is_accounted_for(seed: int) -> None:
    scene, q, v = dropped(seed, RowLaw(a0=4e4, a1=60.0))
    case = cases.from_scene(scene, q0=q, v0=v, t_end=touch(scene, q, v)[0] + 0.15)
    one, two = (
        engines.load(engine).prepare(case, profile, rtol=1e-10).run()
        for engine, profile in (("reference", "compiled"), ("pinocchio", "law"))
    )
    assert [(e.contact, e.after) for e in one.events] == [(e.contact, e.after) for e in two.events]
    assert len({e.contact for e in one.events}) > 1
    assert np.abs(one.q[-1] - two.q[-1]).max() < 1e-8
    assert one.ledger is not None
    account = one.ledger.input - one.ledger.dissipated + one.ledger.contact.sum(axis=1)
    scale = one.energy[:, 0].max() + np.ptp(one.energy[:, 1])
    assert np.abs(one.total_energy - one.total_energy[0] - account).max() < 2e-8 * scale


def test_many_corners_below_the_surface_are_followed_by_the_few_that_can_be() -> None:
    """Trials of modes go round there; the set of the least motion is the one that the reference comes to."""
    rng = np.random.default_rng(1)
    scene, q, v = dropped(1, RowLaw(a0=2600.0, a1=105.0))
    points = rng.normal(size=(80, 3))
    points *= 0.1 / np.linalg.norm(points, axis=1, keepdims=True) * [1.0, 0.8, 0.3]
    floor, hull = scene.shapes
    scene = scene.replace(shapes=(floor, replace(hull, corners=tuple(map(tuple, points.tolist())))))
    case = cases.from_scene(scene, q0=q, v0=v, t_end=touch(scene, q, v)[0] + 0.008)
    one, two = (engines.load(e).prepare(case, p).run() for e, p in (("reference", "compiled"), ("pinocchio", "law")))
    assert (one.outcome, two.outcome) == (Outcome.FINISHED, Outcome.FINISHED), two.message
    assert np.abs(one.q[-1] - two.q[-1]).max() < 1e-8
    met = [[(c.row, round(c.touch, 7)) for c in touched(run, joined=True)] for run in (one, two)]
    assert met[0] == met[1]
    assert len({event.contact for event in one.events}) > 10


def stl(path: Path, points: np.ndarray) -> None:
    """Write the hull of points as binary STL, every triangle seen from outside against the clock."""
    hull = ConvexHull(points)
    with path.open("wb") as file:
        file.write(b"\0" * 80 + struct.pack("<I", len(hull.simplices)))
        for triangle, plane in zip(hull.simplices, hull.equations, strict=True):
            a, b, c = points[triangle]
            b, c = (b, c) if np.cross(b - a, c - a) @ plane[:3] > 0.0 else (c, b)
            file.write(struct.pack("<12fH", *plane[:3], *a, *b, *c, 0))


def inline(points: np.ndarray) -> str:
    return " ".join(map(repr, np.ravel(points).tolist()))


FILE = """<mujoco><option timestep="0.001"/>
<asset><mesh name="rock" file="rock.stl"/><mesh name="box" vertex="{box}" scale="1 1.2 -1"/></asset>
<default><geom condim="1"/></default><worldbody><geom name="floor" type="plane" size="2 2 .1" solref=".01 1"/>
<body name="rock" pos="0 0 .4" euler="5 0 3"><freejoint/>
<geom type="mesh" mesh="rock" euler="10 20 30" pos=".1 0 0"/></body>
<body name="box" pos="1 0 .4"><freejoint/>
<geom name="box" type="mesh" mesh="box" euler="20 30 0" solref=".03 .5"/></body>
</worldbody></mujoco>"""
BOX = np.array(np.meshgrid(*[np.linspace(-0.1, 0.1, 4)] * 3)).reshape(3, -1).T * [1.0, 0.7, 0.5]
"""Points of a box's sides, too, which are no corners of it."""


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """A file of two bodies that weigh what their meshes do."""
    stl(tmp_path / "rock.stl", 0.1 * np.random.default_rng(3).normal(size=(40, 3)))
    path = tmp_path / "two.xml"
    path.write_text(FILE.format(box=inline(BOX)), encoding="utf-8")
    return path


def filled(corners: np.ndarray, density: float = 1000.0) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre and inertia about it of a filled hull: of the tetrahedra from a point inside to its triangles."""
    hull, middle = ConvexHull(corners), corners.mean(axis=0)
    mass, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for triangle in hull.simplices:
        A = corners[triangle] - middle
        m = density * abs(np.linalg.det(A)) / 6.0
        mass, first = mass + m, first + m * A.sum(axis=0) / 4.0
        second += m / 20.0 * (A.T @ A + np.outer(A.sum(axis=0), A.sum(axis=0)))
    centre = first / mass
    second -= mass * np.outer(centre, centre)
    return mass, middle + centre, np.trace(second) * np.eye(3) - second


def test_bodies_of_meshes_are_read_as_the_compiler_has_them(robot: Path) -> None:
    """Corners, where they are, and what the filled hull weighs, which is computed here by itself."""
    scene, model = cases.load(str(robot)).scene, mujoco.MjModel.from_xml_path(str(robot))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert scene is not None
    assert [len(shape.corners) for shape in scene.shapes] == [0, len(scene.shapes[1].corners), 8]
    for i, (body, shape) in enumerate(zip(scene.bodies, scene.shapes[1:], strict=True), 1):
        local = np.array(shape.position) + np.array(shape.corners) @ matrices(np.array(shape.orientation)).T
        xx, yy, zz, xy, xz, yz = body.inertia
        J, R = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), matrices(model.body_iquat[i])
        assert body.mass == pytest.approx(model.body_mass[i], rel=1e-10)
        assert np.abs(np.array(body.com) - model.body_ipos[i]).max() < 1e-10
        assert np.abs(R.T @ J @ R - np.diag(model.body_inertia[i])).max() < 1e-10 * model.body_inertia[i].max()
        mass, com, own = filled(local)  # whose corners are in single precision
        assert body.mass == pytest.approx(mass, rel=1e-6)
        assert np.abs(np.array(body.com) - com).max() < 1e-7
        assert np.abs(J - own).max() < 1e-6 * own.max()
        vertices = model.mesh_vert[model.mesh_vertadr[i - 1] :][: model.mesh_vertnum[i - 1]]
        turn = data.geom_xmat[i].reshape(3, 3)
        lowest = (data.geom_xpos[i] + vertices @ turn.T)[:, 2].min()
        assert (data.xpos[i] + local @ data.xmat[i].reshape(3, 3).T)[:, 2].min() == pytest.approx(lowest, abs=1e-15)


@pytest.mark.parametrize("seed", range(10))
def test_the_least_gap_of_a_hull_is_the_distance_that_mujoco_has(seed: int) -> None:
    scene, q, _ = dropped(seed)
    model = compiled(spec_of(scene), scene)
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    theirs = mujoco.mj_geomDistance(model, data, model.geom("floor").id, model.geom("hull").id, 10.0, None)
    pose = data.body("body").xmat.reshape(3, 3), data.body("body").xpos
    found = Contacts(scene).touches(lambda body: pose if body else (np.eye(3), np.zeros(3))).gap
    assert found.min() + scene.pairs[0].margin == pytest.approx(theirs, abs=1e-12)
    assert np.abs(found - heights(scene, q, np.full(6, 1e-9), 0.0)).max() < 1e-14


def test_mujoco_has_the_same_contacts_of_a_mesh_from_the_file_and_from_the_scene(robot: Path) -> None:
    """Which of its corners touch there is a choice of its own: a model error of the profile, none of a reader."""
    case, engine = cases.load(str(robot), t_end=0.5), engines.load("mujoco")
    own, built = (engine.prepare(case, "as_is", reader=reader).run() for reader in ("file", "scene"))
    assert len(own.events) == len(built.events) > 4
    assert np.abs(own.q - built.q).max() < 1e-12


def test_what_stays_watched_is_told(tmp_path: Path) -> None:
    """Hulls against each other, and one of more corners than rows are made for over a plane."""
    rng = np.random.default_rng(0)
    points = rng.normal(size=(PLACES["plane", "hull"] + 1, 3))
    points *= 0.1 / np.linalg.norm(points, axis=1, keepdims=True)
    stl(tmp_path / "ball.stl", points)
    path = tmp_path / "ball.xml"
    text = """<mujoco><asset><mesh name="ball" file="ball.stl"{most}/></asset><default><geom condim="1"/></default>
    <worldbody><geom name="floor" type="plane" size="1 1 1"/><body pos="0 0 .2"><freejoint/>
    <geom name="ball" type="mesh" mesh="ball"/></body></worldbody></mujoco>"""
    path.write_text(text.format(most=""), encoding="utf-8")
    case = cases.load(str(path), t_end=0.2)
    assert [pair.name for pair in watched(case.scene)] == ["floor:ball"]  # type: ignore[arg-type]
    run = engines.load("reference").prepare(case).run()
    assert run.outcome is Outcome.INCONSISTENT
    assert "the hull has more than 256 corners" in run.message
    path.write_text(text.format(most=' maxhullvert="20"'), encoding="utf-8")
    fewer = contacts(cases.load(str(path)).scene)  # type: ignore[arg-type]
    assert [contact.places for contact in fewer] == [20]


BROKEN = {
    "flat": ("coplanar|volume is too small", lambda path: path.write_bytes(flat())),
    "three points": (
        "at least 4 vertices",
        lambda path: path.write_bytes(triangles([[(0, 0, 0), (1, 0, 0), (0, 1, 0)]])),
    ),
    "not a number": ("not finite", lambda path: path.write_bytes(flat(np.nan))),
    "enormous numbers": ("exceeds maximum bounds", lambda path: path.write_bytes(flat(1e38))),
    "cut": ("wrong size", lambda path: path.write_bytes(flat()[:150])),
    "empty": ("is empty", lambda path: path.write_bytes(b"")),
    "an enormous count": ("number of faces", lambda path: path.write_bytes(b"\0" * 80 + struct.pack("<I", 2**31))),
    "too large": ("more than 50000000 bytes", lambda path: (path.touch(), os.truncate(path, 50_000_001))),
    "missing": ("Error opening file", lambda path: None),
    "a pipe": ("it is a folder, a pipe or a device", os.mkfifo),
    "a folder": ("it is a folder, a pipe or a device|Is a directory", lambda path: path.mkdir()),
}


def triangles(corners: Any) -> bytes:
    faces = [struct.pack("<12fH", 0, 0, 0, *np.ravel(face), 0) for face in corners]
    return b"\0" * 80 + struct.pack("<I", len(faces)) + b"".join(faces)


def flat(last: float = 0.0) -> bytes:
    return triangles([[(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(1, 0, 0), (1, 1, 0), (0, 1, last)]])


@pytest.mark.parametrize("kind", BROKEN)
@pytest.mark.parametrize("format_", ["xml", "urdf"])
def test_a_mesh_that_cannot_be_used_is_one_sentence(
    kind: str, format_: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told, make = BROKEN[kind]
    make(tmp_path / "a.stl")
    path = tmp_path / f"robot.{format_}"
    path.write_text({"xml": MJCF, "urdf": URDF}[format_].format(mesh="a.stl"), encoding="utf-8")
    with pytest.raises(SystemExit) as ended:
        main(["run", str(path), "-e", "reference:compiled", "--out", str(tmp_path / "out")])
    said = capsys.readouterr().err
    assert ended.value.code == 2, said
    assert re.search("is not there" if (kind, format_) == ("missing", "urdf") else told, said), said
    assert "Traceback" not in said
    assert not (tmp_path / "out").exists()
    without = cases.load(str(path), without="meshes", t_end=0.1)
    assert engines.load("reference").prepare(without).run().outcome is Outcome.FINISHED


MJCF = """<mujoco><asset><mesh name="a" file="{mesh}"/></asset><worldbody><geom name="floor" type="plane" size="1 1 1"/>
<body pos="0 0 1"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<geom name="mesh" type="mesh" mesh="a" condim="1"/></body></worldbody></mujoco>"""
URDF = """<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz=".1 0 0" rpy=".1 .2 .3"/><geometry>
<mesh filename="{mesh}" scale="1 2 -1"/></geometry></collision>
</link><joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="1" velocity="1"/></joint></robot>"""


@pytest.mark.parametrize(
    ("attributes", "inertial", "left_out"),
    [('contype="0" conaffinity="0"', True, True), ('contype="0" conaffinity="0"', False, False), ("", True, False),
     ('contype="0" conaffinity="0" mass="0"', False, True), ('contype="0" conaffinity="0" density="0"', False, True)],
)  # fmt: skip
def test_a_missing_mesh_is_left_out_where_it_is_only_drawn(
    attributes: str, inertial: bool, left_out: bool, tmp_path: Path
) -> None:
    own = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>' if inertial else ""
    path = tmp_path / "arm.xml"
    path.write_text(f"""<mujoco><compiler meshdir="parts"/><asset><mesh file="shell.stl"/></asset><worldbody><body>
    <joint type="hinge" axis="0 1 0"/>{own}<geom size=".1" pos="0 0 -.5" contype="0" conaffinity="0"/>
    <geom type="mesh" mesh="shell" {attributes}/></body></worldbody></mujoco>""", encoding="utf-8")  # fmt: skip
    if not left_out:
        with pytest.raises(SceneError, match=r"parts.shell\.stl"):
            cases.load(str(path))
        return
    case = cases.load(str(path), t_end=0.1)
    (told,) = case.findings
    assert re.fullmatch(r"Mesh 'shell' is purely visual, and left out: there is no file .*parts.shell\.stl\.", told)
    for engine, profile in (("reference", "compiled"), ("mujoco", "as_is")):
        assert engines.load(engine).prepare(case, profile).run().outcome is Outcome.FINISHED


@pytest.mark.parametrize("name", ["package://robots/arm/meshes/a.stl", "package:///robots/arm/meshes/a.stl", "file://{}",
                                  "../meshes/a.stl", "{}"])  # fmt: skip
def test_a_urdf_finds_its_meshes(name: str, tmp_path: Path) -> None:
    """In the package that it is in, beside it, or by their whole path; scaled, and where the link has them."""
    (tmp_path / "robots/arm/urdf").mkdir(parents=True)
    (tmp_path / "robots/arm/meshes").mkdir()
    corners = np.array([(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.1)])
    stl(tmp_path / "robots/arm/meshes/a.stl", corners)
    path = tmp_path / "robots/arm/urdf/arm.urdf"
    path.write_text(URDF.format(mesh=name.format(tmp_path / "robots/arm/meshes/a.stl")), encoding="utf-8")
    (shape,) = cases.load(str(path)).scene.shapes  # type: ignore[union-attr]
    found = np.array(shape.position) + np.array(shape.corners) @ matrices(np.array(shape.orientation)).T
    turn = Rotation.from_euler("xyz", [0.1, 0.2, 0.3]).as_matrix()
    wanted = [0.1, 0.0, 0.0] + corners * [1.0, 2.0, -1.0] @ turn.T
    off = np.linalg.norm(found[:, None] - wanted[None], axis=2)
    assert off.min(axis=0).max() < 1e-7
    assert off.min(axis=1).max() < 1e-7


@pytest.mark.parametrize("kind", ["text", "collada"])
def test_meshes_that_mujoco_does_not_read_are_read_by_coal(kind: str, tmp_path: Path) -> None:
    corners = np.array([(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.1)])
    faces = ConvexHull(corners).simplices
    if kind == "text":
        lines = ["facet normal 0 0 0\nouter loop\n" + "".join("vertex {} {} {}\n".format(*corners[k]) for k in face) +
                 "endloop\nendfacet\n" for face in faces]  # fmt: skip
        (tmp_path / "a.stl").write_text(f"solid a\n{''.join(lines)}endsolid a\n", encoding="utf-8")
    else:
        (tmp_path / "a.dae").write_text(
            COLLADA.format(corners=inline(corners), faces=" ".join(map(str, faces.ravel())))
        )
    path = tmp_path / "arm.urdf"
    path.write_text(URDF.format(mesh="a.stl" if kind == "text" else "a.dae"), encoding="utf-8")
    (shape,) = cases.load(str(path)).scene.shapes  # type: ignore[union-attr]
    spans = np.sort(np.linalg.norm(np.diff(np.array(shape.corners)[[0, 1, 2, 3, 0, 2, 1, 3]], axis=0), axis=1))
    assert len(shape.corners) == 4
    assert np.ptp(np.array(shape.corners), axis=0).max() > 0.25
    assert spans.min() > 0.09


COLLADA = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">{corners}</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles></mesh></geometry>
</library_geometries><library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


@pytest.mark.parametrize(
    ("corners", "told"),
    [(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), "3 corners that lie in one plane"),
     (((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 1e-9)), "4 corners that lie in one plane"),
     (((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, np.inf)), "must be finite"),
     (((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, np.nan)), "point 3 is .* must be 3 numbers"),
     (((0.0, 0.0), (1.0, 0.0)), "point 0 is .* must be 3 numbers"), ((), "only a hull has any")],
)  # fmt: skip
def test_a_hull_that_is_none_is_refused(corners: Any, told: str) -> None:
    with pytest.raises(SceneError, match=told):
        Shape(name="hull", type="hull", corners=corners)


def test_corners_of_another_shape_are_refused() -> None:
    with pytest.raises(SceneError, match="only a hull has any"):
        Shape(name="box", type="box", size=(1.0, 1.0, 1.0), corners=((0.0, 0.0, 0.0),) * 4)


ARM = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1" pos="0 0 -1"/><body name="base" pos="0 0 .1">
<geom type="box" size=".1 .1 .1" mass="1"/><body name="link" pos="0 0 .25"><joint name="a" axis="0 1 0"/>
<geom type="box" size=".02 .02 .1" mass="1"/><body pos="0 0 -.3"><joint name="b" axis="0 1 0"/>
<geom name="hand" type="box" size=".05 .05 .05" mass="1"/></body></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize("without", ["overlaps", "pair:base:body3"])
def test_bodies_that_overlap_are_kept_apart_in_every_engine(without: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM if without == "overlaps" else ARM.replace('pos="0 0 -.3"', 'name="body3" pos="0 0 -.3"'))
    given = cases.load(str(path), t_end=0.1, without="friction")
    told = engines.load("reference").prepare(given).run()
    assert told.outcome is Outcome.INCONSISTENT
    assert re.search(r"'shape1' of 'base' and 'hand'|'hand' and 'shape1' of 'base'", told.message)
    case = cases.load(str(path), t_end=0.1, without=f"friction,{without}")
    assert case.scene is not None
    kept = [{pair.first, pair.second} for pair in case.scene.pairs]
    assert kept == [{"floor", "shape2"}, {"floor", "hand"}, {"shape1", "shape2"}]
    for engine, profile in (("reference", "compiled"), ("pinocchio", "law")):
        assert engines.load(engine).prepare(case, profile).run().outcome is Outcome.FINISHED
    soft: Any = engines.load("mujoco").prepare(case, "as_is")
    assert soft.scene.model.nexclude == 1


def test_a_pair_that_is_none_names_the_bodies(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM, encoding="utf-8")
    for words in ("pair:base:arm", "pair:base", "pair:base:link:hand"):
        with pytest.raises(InvalidValue, match=r"is not a pair of bodies .* the file has: .*base, link"):
            cases.load(str(path), without=words)
