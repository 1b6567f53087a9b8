"""A URDF as a compiled model and a scene: MuJoCo's compiler reads the tree, its inertias are read here.

The compiler refuses links without mass and inertias that no body can have, and repairs others in silence.
It is given a placeholder for every link, and the file's own numbers go into the scene unchanged.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.errors import SceneError
from crossbody.cases.files.meshes import supplied
from crossbody.cases.files.warned import compiled, sentences
from crossbody.cases.files.without import apart, without_meshes
from crossbody.cases.scene import Body, Scene

if TYPE_CHECKING:
    import mujoco

PLACEHOLDER = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def parsed(path: Path) -> ElementTree.Element:
    """Return the root of a URDF."""
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise SceneError(f"{path} is not XML: {error}.") from None
    if root.tag != "robot":
        raise SceneError(f"{path} has the root <{root.tag}>; a URDF has <robot>.")
    return root


def read(path: Path, without: str = "") -> tuple[mujoco.MjModel, list[str]]:
    """Return MuJoCo's model of the tree, with a placeholder for every inertia and without what is only drawn.

    With it what MuJoCo warns of, which else goes to the terminal at every reading.
    """
    import mujoco

    root = parsed(path)
    _check_mimics(root)
    for link in root.findall("link"):
        for part in [*link.findall("inertial"), *link.findall("visual")]:
            link.remove(part)
        link.append(ElementTree.fromstring(PLACEHOLDER))
        for collision in link.findall("collision"):
            if without_meshes(without) and collision.find("geometry/mesh") is not None:
                link.remove(collision)
    for limit in root.findall("joint/limit"):
        if {"lower", "upper"}.intersection(limit.attrib):  # the other is 0 by the format; the compiler takes none
            limit.attrib = {"lower": "0", "upper": "0"} | limit.attrib
    for own in root.findall("mujoco"):
        root.remove(own)
    _float(root)
    setting = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(setting, "compiler", {"fusestatic": "false", "inertiafromgeom": "false"})
    files = supplied(root, path)
    text = ElementTree.tostring(root, encoding="unicode")

    def compiler() -> Any:
        spec = mujoco.MjSpec.from_string(text, assets=files)
        for mesh in spec.meshes:  # whose inertia is not asked for: of one that is open there is none
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        for loop in spec.equalities:
            loop.name = f"{loop.name1} mimics"
        return apart(spec, without)

    model, warned = compiled(path, compiler)
    return model, sentences(warned)


def unfused(path: Path) -> Any:
    """Return MuJoCo's own specification of a URDF, with a body for every link.

    By itself its compiler merges links with what they are fixed to (fusestatic): what the world bears would lose its
    mass, the energy its share, and bodies their numbers. Floating joints hang on the world, where else it refuses them.
    """
    import mujoco

    root = parsed(path)
    if _float(root):
        text = ElementTree.tostring(root, encoding="unicode")
        spec = mujoco.MjSpec.from_string(text, assets=supplied(root, path))
    else:
        spec = mujoco.MjSpec.from_file(str(path))
    spec.compiler.fusestatic = False
    return spec


def _float(root: ElementTree.Element) -> bool:
    """Let floating joints hang on the world itself, which the root is called then: the compiler knows none elsewhere.

    Return whether there are any. The root stands on the world anyway, and is no body of the scene then.
    """
    floating = [joint for joint in root.findall("joint") if joint.get("type") == "floating"]
    above = {_link(joint, "child"): joint for joint in root.findall("joint")}
    ground = next((link for link in root.findall("link") if link.get("name") not in above), None)
    if not floating or ground is None:
        return False
    for joint in floating:
        p, R, on, passed = *_origin(joint), _link(joint, "parent"), {joint}
        while on in above and above[on] not in passed:
            below = above[on]
            if below.get("type") != "fixed":
                raise SceneError(
                    f"Joint {joint.get('name')!r} floats on {_link(joint, 'parent')!r}, which "
                    f"joint {below.get('name')!r} moves; valid: a floating joint on the root, "
                    "or on what is fixed to it."
                )
            passed.add(below)
            p_on, R_on = _origin(below)
            p, R, on = p_on + R_on @ p, R_on @ R, _link(below, "parent")
        if len(passed) > 1 and on == ground.get("name"):
            _hang(joint, on, p, R)
    name = ground.get("name")
    ground.set("name", "world")
    for parent in root.findall("joint/parent"):
        if parent.get("link") == name:
            parent.set("link", "world")
    return True


def _link(joint: ElementTree.Element, side: str) -> str:
    found = joint.find(side)
    return "" if found is None else found.get("link", "")


def _origin(joint: ElementTree.Element) -> tuple[Floats, Floats]:
    name, origin = joint.get("name"), joint.find("origin")
    return _numbers(name, origin, "xyz"), _rotation(_numbers(name, origin, "rpy"))


def _hang(joint: ElementTree.Element, link: str, p: Floats, R: Floats) -> None:
    """Put a joint at a pose of another link."""
    for tag in ("parent", "origin"):
        for old in joint.findall(tag):
            joint.remove(old)
    pitch = math.atan2(-R[2, 0], math.hypot(R[0, 0], R[1, 0]))
    level = math.hypot(R[0, 0], R[1, 0]) < 1e-9  # then roll and yaw are about one axis: all of it is yaw
    roll = 0.0 if level else math.atan2(R[2, 1], R[2, 2])
    yaw = math.atan2(-R[0, 1], R[1, 1]) if level else math.atan2(R[1, 0], R[0, 0])
    words = {"xyz": p.tolist(), "rpy": [roll, pitch, yaw]}
    ElementTree.SubElement(joint, "parent", {"link": link})
    ElementTree.SubElement(joint, "origin", {key: " ".join(map(repr, three)) for key, three in words.items()})


def _check_mimics(root: ElementTree.Element) -> None:
    """Raise SceneError for a joint that follows one that there is not, which the compiler takes for free."""
    joints = {joint.get("name", ""): joint.find("mimic") for joint in root.findall("joint")}
    for name, mimic in joints.items():
        if mimic is not None and mimic.get("joint") not in joints:
            raise SceneError(
                f"Joint {name!r} mimics {mimic.get('joint', '')!r}, which does not exist; the file has: "
                f"{', '.join(sorted(set(joints) - {name}))}."
            )


def with_inertias(path: Path, scene: Scene) -> Scene:
    """Return the scene with the inertias of the file."""
    root = parsed(path)
    links = {link.get("name", ""): link for link in root.findall("link")}
    bodies = tuple(_body(body, links[body.name]) if body.name in links else body for body in scene.bodies)
    return scene.replace(bodies=bodies)


def findings(path: Path) -> list[str]:
    """Return a sentence for every link whose inertia no rigid body can have."""
    told = []
    for link in parsed(path).findall("link"):
        if link.find("inertial") is None:
            continue
        mass, _, J = inertial(link)
        least, middle, most = np.linalg.eigvalsh(J)
        if mass < 0.0 or least < 0.0 or least + middle < most * (1.0 - 1e-9):
            told.append(f"Link {link.get('name')!r}: mass {mass:g} and moments {least:g}, {middle:g}, {most:g} are "
                        "impossible for a rigid body; used unchanged.")  # fmt: skip
    return told


PLANAR = ("_TX", "_TY", "_RZ")
"""What MuJoCo's compiler puts behind the name of a planar joint for the three that it makes of it."""


def planar(path: Path) -> list[str]:
    """Return the names of the planar joints."""
    return [joint.get("name", "") for joint in parsed(path).findall("joint") if joint.get("type") == "planar"]


def bounds(path: Path) -> dict[str, dict[str, float]]:
    """Return lowest and highest coordinate and force of every joint that has them: 0 where a <limit> does not say them.

    The compiler takes bounds that are alike, and a largest force of 0, for none.
    """
    found: dict[str, dict[str, float]] = {}
    for joint in parsed(path).findall("joint"):
        name, limit = joint.get("name", ""), joint.find("limit")
        if joint.get("type") in ("revolute", "prismatic", "continuous") and limit is not None:
            most = abs(_number(name, limit, "effort"))
            found[name] = {"least force": 0.0 - most, "most force": most} if "effort" in limit.attrib else {}
            if joint.get("type") != "continuous":
                found[name] |= {key: _number(name, limit, key) for key in ("lower", "upper")}
    return found


def inertial(link: ElementTree.Element) -> tuple[float, Floats, Floats]:
    """Return mass, centre (3,) and inertia about it (3, 3), in the link's axes."""
    if (own := link.find("inertial")) is None:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    name = link.get("name")
    mass = _number(name, own.find("mass"), "value")
    x = own.find("inertia")
    xx, yy, zz, xy, xz, yz = (_number(name, x, key) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
    origin = own.find("origin")
    place = _numbers(name, origin, "xyz")
    R = _rotation(_numbers(name, origin, "rpy"))
    return mass, place, R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T


def _body(body: Body, link: ElementTree.Element) -> Body:
    mass, com, J = inertial(link)
    six = (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
    return replace(body, mass=mass, com=tuple(com), inertia=six)


def _number(where: str | None, element: Any, key: str, default: float = 0.0) -> float:
    text = default if element is None else element.get(key, default)
    try:
        found = float(text)
    except ValueError:
        found = math.nan
    if not math.isfinite(found):
        raise SceneError(f"{where!r}: {key} is {text!r}; it must be a number.")
    return found


def _numbers(where: str | None, element: Any, key: str) -> Floats:
    text = "0 0 0" if element is None else element.get(key, "0 0 0")
    try:
        found = np.array([float(word) for word in text.split()])
    except ValueError:
        found = np.zeros(0)
    if found.shape != (3,) or not np.isfinite(found).all():
        raise SceneError(f"{where!r}: {key} is {text!r}; it must be three numbers.")
    return found


def _rotation(rpy: Floats) -> Floats:
    """Return the rotation of roll, pitch and yaw: fixed axes x, y, z in this order."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])  # fmt: skip
