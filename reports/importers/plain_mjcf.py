"""An MJCF in plain words: everything said where it counts, in the plainest of its forms.

Classes and includes are written out for joints, geoms and sites, orientations as unit
quaternions, angles in radians, inertias given, <frame>s and poses of bodies that are fixed to the
world put into what stands on them.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from crossbody.cases import SceneError
from crossbody.cases.arrays import Floats
from crossbody.cases.files.inertias import six
from crossbody.cases.files.reading import read
from crossbody.cases.rotations import matrices

Node = ElementTree.Element
PLACED = ("body", "geom", "site", "camera", "inertial", "frame", "light")
TURNS = ("quat", "euler", "axisangle", "xyaxes", "zaxis")
WRITTEN = ("joint", "geom", "site")  # what takes its class's attributes as its own
APPLIED = ("eulerseq", "boundmass", "boundinertia", "balanceinertia", "settotalmass", "inertiagrouprange")
"""Of the compiler: what is done with, once inertias and orientations are written."""
FOLDERS = {"meshdir": ("mesh", "hfield", "skin"), "texturedir": ("texture",)}
"""Of the compiler: folders, and what stands in them."""
REFUSED = ("replicate", "composite", "flexcomp", "attach", "plugin")


def numbers_of(text: str) -> Floats:
    """Return the numbers of an attribute."""
    return np.array([float(word) for word in text.split()])


def said(values: Any) -> str:
    """Return numbers as an attribute has them, with all their digits."""
    return " ".join(f"{float(value):.17g}" for value in np.atleast_1d(values))


def quaternion(R: Floats) -> Floats:
    """Return the quaternion (w first, w >= 0) of a rotation, by its largest part."""
    K = np.array([
        [np.trace(R), R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]],
        [0.0, 2 * R[0, 0] - np.trace(R), R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]],
        [0.0, 0.0, 2 * R[1, 1] - np.trace(R), R[1, 2] + R[2, 1]],
        [0.0, 0.0, 0.0, 2 * R[2, 2] - np.trace(R)],
    ])  # fmt: skip
    found: Floats = np.linalg.eigh(K + np.triu(K, 1).T)[1][:, -1]
    return found if found[0] >= 0.0 else -found


def beside(out: Path, path: Path, name: str) -> str:
    """Return how a file calls what another calls so from where that stands."""
    return os.path.relpath(path.resolve().parent / name, out.resolve().parent)


def _about(axis: Floats, angle: float) -> Floats:
    unit = axis / np.linalg.norm(axis)
    return matrices(np.array([np.cos(angle / 2), *(np.sin(angle / 2) * unit)]))


class _Rewriting:
    """One MJCF: what its compiler is given about angles, and what its classes say."""

    def __init__(self, root: Node) -> None:
        settings = {key: value for one in root.iter("compiler") for key, value in one.attrib.items()}
        self.degrees = settings.get("angle", "degree") == "degree"
        self.sequence = settings.get("eulerseq", "xyz")
        self.classes: dict[str, dict[str, dict[str, str]]] = {"main": {}}
        for top in root.findall("default"):
            self._learn(top, "main", self.classes["main"])
            self.classes[top.get("class", "main")] = self.classes["main"]

    def _learn(self, node: Node, name: str, above: dict[str, dict[str, str]]) -> None:
        own = {tag: dict(values) for tag, values in above.items()}
        for child in node:
            if child.tag in WRITTEN:
                own[child.tag] = merged(own.get(child.tag, {}), child.attrib)
        self.classes[name] = own
        for child in list(node):
            if child.tag == "default":
                self._learn(child, child.get("class", ""), own)
            elif child.tag in WRITTEN:
                node.remove(child)

    def rotation(self, node: Node) -> Floats:
        """Return the orientation of an element (3, 3)."""
        unit = np.pi / 180 if self.degrees else 1.0
        given = {key: numbers_of(node.get(key, "")) for key in TURNS if node.get(key)}
        if "quat" in given:
            return matrices(given["quat"] / np.linalg.norm(given["quat"]))
        if "axisangle" in given:
            return _about(given["axisangle"][:3], unit * given["axisangle"][3])
        if "xyaxes" in given:
            x = given["xyaxes"][:3] / np.linalg.norm(given["xyaxes"][:3])
            y = given["xyaxes"][3:] - x * (x @ given["xyaxes"][3:])
            y = y / np.linalg.norm(y)
            return np.column_stack([x, y, np.cross(x, y)])
        if "zaxis" in given:
            z = given["zaxis"] / np.linalg.norm(given["zaxis"])
            axis = np.cross([0.0, 0.0, 1.0], z)
            length = float(np.linalg.norm(axis))
            return _about(axis if length > 1e-10 else np.array([1.0, 0.0, 0.0]), float(np.arctan2(length, z[2])))
        R = np.eye(3)
        for letter, angle in zip(self.sequence, given.get("euler", np.zeros(3)), strict=True):
            turn = _about(np.eye(3)["xyz".index(letter.lower())], unit * angle)
            R = R @ turn if letter.islower() else turn @ R
        return R

    def write_out(self, node: Node, childclass: str) -> None:
        """Give what is below an element the attributes of its class, and its orientation as a quaternion."""
        for child in node:
            own = child.get("childclass") or childclass
            if child.tag in WRITTEN:
                told = self.classes.get(child.attrib.pop("class", "") or childclass, {}).get(child.tag, {})
                child.attrib.update(merged(told, child.attrib))
            if child.tag in PLACED and any(child.get(key) for key in TURNS):
                R = self.rotation(child)
                for key in TURNS:
                    child.attrib.pop(key, None)
                child.set("quat", said(quaternion(R)))
            self.write_out(child, own)


def merged(above: dict[str, str], own: Any) -> dict[str, str]:
    """Return attributes with those of a class beneath; orientation and place are each said once."""
    left = dict(above)
    if any(key in own for key in TURNS):
        left = {key: value for key, value in left.items() if key not in TURNS}
    return left | {key: _completed(value, left.get(key, "")) for key, value in dict(own).items()}


def _completed(own: str, above: str) -> str:
    """Return numbers with those of a class behind them, where they are fewer, as the compiler has them."""
    mine, theirs = own.split(), above.split()
    try:
        numbers = [float(word) for word in (*mine, *theirs)]
    except ValueError:
        return own
    return " ".join([*mine, *theirs[len(mine) :]]) if mine and len(numbers) > 2 else own


def moved(node: Node, p: Floats, R: Floats) -> None:
    """Put what stands in a frame to where it stands in the frame of that."""
    if node.tag not in PLACED:
        return
    if node.tag == "light":
        node.set("dir", said(R @ numbers_of(node.get("dir", "0 0 -1"))))
    else:
        own = matrices(numbers_of(node.get("quat", "1 0 0 0")))
        if "fromto" in node.attrib:
            ends = numbers_of(node.get("fromto", "")).reshape(2, 3)
            node.set("fromto", said((p + ends @ R.T).ravel()))
            return
        if node.tag == "inertial":
            xx, yy, zz, xy, xz, yz = numbers_of(node.get("fullinertia", ""))
            node.set("fullinertia", said(six(R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T)))
        else:
            node.set("quat", said(quaternion(R @ own)))
    node.set("pos", said(p + R @ numbers_of(node.get("pos", "0 0 0"))))


def _pose(node: Node) -> tuple[Floats, Floats]:
    return numbers_of(node.get("pos", "0 0 0")), matrices(numbers_of(node.get("quat", "1 0 0 0")))


def _unframe(node: Node) -> None:
    """Replace every <frame> by what stands in it."""
    for child in list(node):
        _unframe(child)
        if child.tag == "frame":
            p, R = _pose(child)
            at = list(node).index(child)
            node.remove(child)
            for k, part in enumerate(child):
                moved(part, p, R)
                node.insert(at + k, part)


def _unfix(node: Node, spoken_of: set[str]) -> None:
    """Put the pose of bodies that are fixed to the world into what stands on them."""
    for body in node.findall("body"):
        jointed = any(body.find(tag) is not None for tag in ("joint", "freejoint"))
        if jointed or body.get("mocap") == "true" or body.get("name") in spoken_of:
            continue
        p, R = _pose(body)
        for key in ("pos", "quat"):
            body.attrib.pop(key, None)
        for part in body:
            moved(part, p, R)
        _unfix(body, spoken_of)


def _included(root: Node, path: Path) -> Node:
    """Return the root with what it includes, which was looked at before."""
    for node in list(root.iter()):
        for child in list(node):
            if child.tag == "include":
                part = _included(ElementTree.parse(path.parent / child.get("file", "")).getroot(), path)
                at = list(node).index(child)
                node.remove(child)
                for k, one in enumerate(part):
                    node.insert(at + k, one)
    return root


def mjcf(path: Path, out: Path) -> Node:
    """Return an MJCF in plain words, with folders as they are called from where it will stand."""
    root = _included(ElementTree.parse(path).getroot(), path)
    for tag in REFUSED:
        if root.find(f".//{tag}") is not None:
            raise SceneError(f"{path} has <{tag}>, which is not rewritten; valid: what is said body by body.")
    model = read(path)[0]
    rewriting = _Rewriting(root)
    for world in root.findall("worldbody"):
        rewriting.write_out(world, "main")
        _unframe(world)
    _say_bodies(root, model)
    spoken_of = {value for part in root.findall("equality/*") for key, value in part.attrib.items() if "body" in key}
    for world in root.findall("worldbody"):
        _unfix(world, spoken_of)
    _say_options(root, path, out)
    return root


def _say_bodies(root: Node, model: Any) -> None:
    """Write inertias and joints as they were compiled: both count their bodies in the order of the file."""
    bodies = [body for world in root.findall("worldbody") for body in world.iter("body")]
    joints = [joint for body in bodies for joint in body if joint.tag in ("joint", "freejoint")]
    if len(bodies) != model.nbody - 1 or len(joints) != model.njnt:
        raise SceneError("The file cannot be rewritten: its compiled model has other bodies (fusestatic?).")
    for i, body in enumerate(bodies, start=1):
        for old in body.findall("inertial"):
            body.remove(old)
        if model.body_mass[i] > 0.0:
            R = matrices(np.array(model.body_iquat[i]))
            full = six(R @ np.diag(model.body_inertia[i]) @ R.T)
            words = {"pos": model.body_ipos[i], "mass": model.body_mass[i], "fullinertia": full}
            body.insert(0, Node("inertial", {key: said(value) for key, value in words.items()}))
    for i, joint in enumerate(joints):
        if "align" not in joint.attrib:
            _say_joint(joint, model, i)


def _say_joint(joint: Node, model: Any, i: int) -> None:
    """Write type, axis, and angles in radians; a free joint in the form that more readers know."""
    kind = int(model.jnt_type[i])
    joint.tag = "joint"
    joint.set("type", ("free", "ball", "slide", "hinge")[kind])
    if kind == 0:
        return
    words: dict[str, Callable[[], Any]] = {
        "axis": lambda: model.jnt_axis[i], "range": lambda: model.jnt_range[i],
        "ref": lambda: model.qpos0[model.jnt_qposadr[i]],
        "springref": lambda: model.qpos_spring[model.jnt_qposadr[i]],
    }  # fmt: skip
    for key, value in words.items():
        if key == "axis" or (key in joint.attrib and (kind > 1 or key == "range")):
            joint.set(key, said(value()))
    if model.jnt_limited[i]:
        joint.set("limited", "true")
    else:
        joint.attrib.pop("range", None)
        joint.set("limited", "false")


def _say_options(root: Node, path: Path, out: Path) -> None:
    """Say angles in radians, and the rest of the compiler; name the model; write gravity that is off."""
    root.set("model", root.get("model") or path.stem)
    settings: dict[str, str] = {}
    for one in root.findall("compiler"):
        settings |= dict.fromkeys(FOLDERS, one.attrib["assetdir"]) if "assetdir" in one.attrib else {}
        settings |= {key: value for key, value in one.attrib.items() if key not in (*APPLIED, "assetdir")}
        root.remove(one)
    if settings.get("inertiafromgeom") == "true":
        settings["inertiafromgeom"] = "auto"
    if out.resolve().parent != path.resolve().parent:
        settings |= {key: beside(out, path, settings.get(key, "")) for key, tags in FOLDERS.items() if any(
            root.find(f".//{tag}[@file]") is not None for tag in tags)}  # fmt: skip
    root.insert(0, Node("compiler", settings | {"angle": "radian", "autolimits": "true"}))
    for option in root.findall("option"):
        flag = option.find("flag")
        if flag is not None and flag.get("gravity") == "disable":
            option.set("gravity", "0 0 0")
