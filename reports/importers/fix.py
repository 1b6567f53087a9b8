"""A robot file written so that more readers agree: everything said where it counts, in the plainest of its forms.

In MJCF: classes and includes written out for joints, geoms and sites, orientations as unit quaternions, angles in
radians, inertias given, <frame>s and poses of bodies that are fixed to the world put into what stands on them. In URDF:
axes given, inertias in the link's axes. What the file means stays: that is checked before anything is written.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from uuid import uuid4
from xml.etree import ElementTree

import numpy as np

from crossbody.cases import OutputError, SceneError
from crossbody.cases.arrays import Floats
from crossbody.cases.files.inertias import six
from crossbody.cases.files.reading import is_urdf, read
from crossbody.cases.files.urdf import inertial, parsed
from crossbody.cases.rotations import matrices
from crossbody.reports.importers.audit import Audit, opened
from crossbody.reports.importers.compare import WRONG, rows

Node = ElementTree.Element
PLACED = ("body", "geom", "site", "camera", "inertial", "frame", "light")
TURNS = ("quat", "euler", "axisangle", "xyaxes", "zaxis")
WRITTEN = ("joint", "geom", "site")
"""What takes its class's attributes as its own."""
APPLIED = ("eulerseq", "boundmass", "boundinertia", "balanceinertia", "settotalmass", "inertiagrouprange")
"""Of the compiler: what is done with, once inertias and orientations are written."""
REFUSED = ("replicate", "composite", "flexcomp", "attach", "plugin")
SAME = ("coordinates", "inertia", "M", "gravity", "bias", "energy", "armature", "damping", "springs", "limits",
        "friction", "loops", "actuators")  # fmt: skip
"""What the new file means as the old one does; bodies that are fixed to the world may have other frames."""


MARK = "Written by the option fix of crossbody audit"
"""What a file begins with that may be written over; no comment of XML may have two dashes."""
KEPT = (
    "geom_type", "geom_contype", "geom_conaffinity", "geom_condim", "geom_priority", "geom_friction", "geom_solref",
    "geom_solimp", "geom_solmix", "geom_margin", "geom_gap", "geom_fluid", "geom_group", "site_type", "site_size",
    "pair_friction", "pair_solref", "pair_solimp", "pair_margin", "pair_gap", "pair_dim", "exclude_signature",
    "jnt_solref", "jnt_solimp", "jnt_margin", "dof_solref", "dof_solimp", "dof_frictionloss", "eq_type", "eq_solref",
    "eq_solimp", "tendon_range", "tendon_stiffness", "tendon_damping", "tendon_frictionloss", "tendon_armature",
    "actuator_gear", "actuator_gainprm", "actuator_biasprm", "actuator_dynprm", "actuator_ctrlrange",
    "actuator_forcerange", "actuator_gaintype", "actuator_biastype", "actuator_dyntype", "key_qpos", "key_qvel",
    "key_ctrl",
)  # fmt: skip
"""Of the compiled model: what the rewriting must not touch."""
STATES, LIKE = 3, 1e-7
"""States at which places are compared, and how far they may be apart, m; sizes of meshes have single precision."""
SPHERE, BOX, ROUND = 2, 6, (0, 3, 5)
"""Types of shapes: those in ROUND (plane, capsule, cylinder) are the same however turned about their axis."""


def fixed(path: Path, out: Path, without: str = "") -> None:
    """Write a file that means the same in plainer words.

    Raises:
        SceneError: for what is not rewritten, or would not mean the same; nothing is written then.
    """
    before = opened(path, without)
    root = _urdf(path) if is_urdf(path) else _mjcf(path, out)
    root.insert(0, ElementTree.Comment(f" {MARK} "))
    ElementTree.indent(root)
    if out.suffix not in (".xml", ".urdf"):
        raise OutputError(f"{out} cannot be written: the name of a robot file ends in .xml or .urdf.")
    half = out.with_name(f".{uuid4().hex}{out.suffix}")
    try:
        half.write_text(ElementTree.tostring(root, encoding="unicode") + "\n", encoding="utf-8")
        _check(before, opened(half, without), path)
        if not is_urdf(path):
            _check_model(path, half)
        half.replace(out)
    except SceneError as error:
        raise SceneError(str(error).replace(str(half), f"The new form of {path}")) from None
    except OSError as error:
        raise OutputError(f"{out} cannot be written: {error.strerror}.") from None
    finally:
        half.unlink(missing_ok=True)


def _check(before: Audit, after: Audit, path: Path) -> None:
    if after.job["joints"] != before.job["joints"]:
        raise SceneError(f"{path} cannot be rewritten: it would have other joints.")
    after = Audit(path=path, scene=after.scene, job=before.job, wanted=_at(after, before))
    told = rows("rewritten", after.wanted, before.wanted, before.job["joints"])
    off = [row for row in told if row.quantity in SAME and row.verdict == WRONG and (row.difference or 1.0) > 1e-8]
    if off:
        raise SceneError(f"{path} cannot be rewritten: {off[0].quantity} of {off[0].where} would differ.")


def _check_model(path: Path, half: Path) -> None:
    """Check what the audit does not look at: shapes, contacts, actuators, tendons, keyframes."""
    before, after = read(path)[0], read(half)[0]
    for name in KEPT:
        old, new = np.asarray(getattr(before, name)), np.asarray(getattr(after, name))
        if old.shape != new.shape or not np.allclose(old, new, rtol=1e-9, atol=1e-12, equal_nan=True):
            raise SceneError(f"{path} cannot be rewritten: {name} of its compiled model would differ.")
    for (what, old), (_, new) in zip(_placed(before), _placed(after), strict=True):
        if not _same(old, new):
            raise SceneError(f"{path} cannot be rewritten: {what} would differ.")


def _placed(model: Any) -> Iterator[tuple[str, Floats]]:
    """Yield where shapes, sites, cameras and lights are, and what sensors say, at states that are always the same."""
    import mujoco

    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    for _ in range(STATES):
        mujoco.mj_resetData(model, data)
        mujoco.mj_integratePos(model, data.qpos, rng.uniform(-1.0, 1.0, model.nv), 1.0)
        data.qvel[:] = rng.uniform(-1.0, 1.0, model.nv)
        mujoco.mj_forward(model, data)
        for what, kinds, p, R in (
            ("where shapes are", model.geom_type, data.geom_xpos, data.geom_xmat),
            ("where sites are", model.site_type, data.site_xpos, data.site_xmat),
            ("where cameras are", np.full(model.ncam, BOX), data.cam_xpos, data.cam_xmat),
        ):
            turns = R.reshape(-1, 3, 3).copy()
            turns[kinds == SPHERE] = 0.0
            turns[np.isin(kinds, ROUND), :, :2] = 0.0  # however they are turned about their axis
            yield what, np.column_stack([kinds, p, turns.reshape(-1, 9)])
        yield "where lights are", np.column_stack([data.light_xpos, data.light_xdir])
        yield "what sensors say", np.column_stack([np.arange(model.nsensordata), data.sensordata])
        yield "how many contacts there are", np.array([[data.ncon]], dtype=float)


def _same(old: Floats, new: Floats) -> bool:
    """Return whether every row has its like: the order may be another."""
    if old.shape != new.shape:
        return False
    if not old.size:
        return True
    off = np.abs(old[:, None] - new[None]).max(axis=2) / (1.0 + np.abs(old).max())
    return bool((off.min(axis=0) < LIKE).all() and (off.min(axis=1) < LIKE).all())


def _at(after: Audit, before: Audit) -> dict[str, Any]:
    from crossbody.reports.importers.expected import expected

    return expected(after.scene, before.job) | {"numbers": after.wanted["numbers"]}


def _numbers(text: str) -> Floats:
    return np.array([float(word) for word in text.split()])


def _said(values: Any) -> str:
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


def _about(axis: Floats, angle: float) -> Floats:
    unit = axis / np.linalg.norm(axis)
    return matrices(np.array([np.cos(angle / 2), *(np.sin(angle / 2) * unit)]))


class _Rewriting:
    """One MJCF: what its compiler is told of angles, and what its classes say."""

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
        given = {key: _numbers(node.get(key, "")) for key in TURNS if node.get(key)}
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
                child.set("quat", _said(quaternion(R)))
            self.write_out(child, own)


def merged(above: dict[str, str], own: Any) -> dict[str, str]:
    """Return attributes with those of a class beneath; an orientation, and where something is, are each said once."""
    left = dict(above)
    if any(key in own for key in TURNS):
        left = {key: value for key, value in left.items() if key not in TURNS}
    return left | {key: _completed(value, left.get(key, "")) for key, value in dict(own).items()}


def _completed(own: str, above: str) -> str:
    """Return numbers with those of a class behind them, where they are fewer: what the compiler makes of them."""
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
        node.set("dir", _said(R @ _numbers(node.get("dir", "0 0 -1"))))
    else:
        own = matrices(_numbers(node.get("quat", "1 0 0 0")))
        if "fromto" in node.attrib:
            ends = _numbers(node.get("fromto", "")).reshape(2, 3)
            node.set("fromto", _said((p + ends @ R.T).ravel()))
            return
        if node.tag == "inertial":
            xx, yy, zz, xy, xz, yz = _numbers(node.get("fullinertia", ""))
            node.set("fullinertia", _said(six(R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T)))
        else:
            node.set("quat", _said(quaternion(R @ own)))
    node.set("pos", _said(p + R @ _numbers(node.get("pos", "0 0 0"))))


def _pose(node: Node) -> tuple[Floats, Floats]:
    return _numbers(node.get("pos", "0 0 0")), matrices(_numbers(node.get("quat", "1 0 0 0")))


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


def _mjcf(path: Path, out: Path) -> Node:
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


def _bodies(root: Node) -> Iterator[Node]:
    for world in root.findall("worldbody"):
        yield from world.iter("body")


def _say_bodies(root: Node, model: Any) -> None:
    """Write the inertias and joints as they were compiled: both count their bodies in the order of the file."""
    bodies = list(_bodies(root))
    joints = [joint for body in bodies for joint in body if joint.tag in ("joint", "freejoint")]
    if len(bodies) != model.nbody - 1 or len(joints) != model.njnt:
        raise SceneError("The file cannot be rewritten: its compiled model has other bodies (fusestatic?).")
    for i, body in enumerate(bodies, start=1):
        for old in body.findall("inertial"):
            body.remove(old)
        if model.body_mass[i] > 0.0:
            R = matrices(np.array(model.body_iquat[i]))
            full = six(R @ np.diag(model.body_inertia[i]) @ R.T)
            said = {"pos": model.body_ipos[i], "mass": model.body_mass[i], "fullinertia": full}
            body.insert(0, Node("inertial", {key: _said(value) for key, value in said.items()}))
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
    said: dict[str, Callable[[], Any]] = {
        "axis": lambda: model.jnt_axis[i], "range": lambda: model.jnt_range[i],
        "ref": lambda: model.qpos0[model.jnt_qposadr[i]], "springref": lambda: model.qpos_spring[model.jnt_qposadr[i]],
    }  # fmt: skip
    for key, value in said.items():
        if key == "axis" or (key in joint.attrib and (kind > 1 or key == "range")):
            joint.set(key, _said(value()))
    if model.jnt_limited[i]:
        joint.set("limited", "true")
    else:
        joint.attrib.pop("range", None)
        joint.set("limited", "false")


def _say_options(root: Node, path: Path, out: Path) -> None:
    """Say angles in radians, and what is left to say of the compiler; name the model; write gravity that is off."""
    root.set("model", root.get("model") or path.stem)
    compilers = root.findall("compiler")
    settings = {key: value for one in compilers for key, value in one.attrib.items() if key not in APPLIED}
    for one in compilers:
        root.remove(one)
    if settings.get("inertiafromgeom") == "true":
        settings["inertiafromgeom"] = "auto"
    for key in ("meshdir", "texturedir", "assetdir"):
        folder = path.resolve().parent / settings.get(key, "")
        if out.resolve().parent != path.resolve().parent and (key in settings or key == "meshdir"):
            settings[key] = os.path.relpath(folder, out.resolve().parent)
    root.insert(0, Node("compiler", settings | {"angle": "radian", "autolimits": "true"}))
    for option in root.findall("option"):
        flag = option.find("flag")
        if flag is not None and flag.get("gravity") == "disable":
            option.set("gravity", "0 0 0")


def _urdf(path: Path) -> Node:
    """Return a URDF with axes of length 1 and inertias in the axes of their links."""
    root = parsed(path)
    for joint in root.findall("joint"):
        if joint.get("type") in ("revolute", "continuous", "prismatic"):
            axis = joint.find("axis")
            axis = ElementTree.SubElement(joint, "axis") if axis is None else axis
            values = _numbers(axis.get("xyz", "1 0 0"))
            axis.set("xyz", _said(values / np.linalg.norm(values)))
    for link in root.findall("link"):
        own = link.find("inertial")
        if own is not None:
            _, place, J = inertial(link)
            origin, moments = own.find("origin"), own.find("inertia")
            origin = ElementTree.SubElement(own, "origin") if origin is None else origin
            origin.attrib = {"xyz": _said(place), "rpy": "0 0 0"}
            if moments is not None:
                moments.attrib = dict(zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), map(_said, six(J)), strict=True))
    return root
