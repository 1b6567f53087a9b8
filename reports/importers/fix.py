"""A robot file written so that more readers agree; what it means stays, which is checked first."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any
from uuid import uuid4
from xml.etree import ElementTree

import numpy as np

from crossbody.cases import OutputError, SceneError
from crossbody.cases.arrays import Floats
from crossbody.cases.files.inertias import six
from crossbody.cases.files.meshes import located
from crossbody.cases.files.reading import is_urdf, read
from crossbody.cases.files.urdf import inertial, parsed
from crossbody.reports.importers.audit import Audit, opened
from crossbody.reports.importers.compare import WRONG, rows
from crossbody.reports.importers.plain_mjcf import Node, beside, mjcf, numbers_of, said

KEPT = (
    "geom_type", "geom_contype", "geom_conaffinity", "geom_condim", "geom_priority", "geom_friction",
    "geom_solref", "geom_solimp", "geom_solmix", "geom_margin", "geom_gap", "geom_fluid",
    "geom_group", "site_type", "site_size", "pair_friction", "pair_solref", "pair_solimp",
    "pair_margin", "pair_gap", "pair_dim", "exclude_signature", "jnt_solref", "jnt_solimp",
    "jnt_actfrcrange", "jnt_actgravcomp", "body_gravcomp", "jnt_margin", "dof_solref", "dof_solimp",
    "dof_frictionloss", "eq_type", "eq_solref", "eq_solimp", "tendon_range", "tendon_stiffness",
    "tendon_damping", "tendon_frictionloss", "tendon_armature", "actuator_gear", "actuator_gainprm",
    "actuator_biasprm", "actuator_dynprm", "actuator_ctrlrange", "actuator_forcerange",
    "actuator_gaintype", "actuator_biastype", "actuator_dyntype", "key_qpos", "key_qvel", "key_ctrl",
)  # fmt: skip
"""Of the compiled model: what the rewriting must not touch."""
STATES, LIKE = 3, 1e-7
"""States at which places are compared, and how far they may be apart, m; meshes have single precision."""
SPHERE, BOX, ROUND = 2, 6, (0, 3, 5)
"""Types of shapes: those in ROUND (plane, capsule, cylinder) are the same however turned about their axis."""
SAME = ("coordinates", "inertia", "M", "gravity", "bias", "energy", "armature", "damping", "springs", "limits",
        "friction", "effort", "loops", "actuators", "contacts", "surfaces", "softness", "keyframes")  # fmt: skip
"""What the new file means as the old one does; bodies that are fixed to the world may have other frames."""
MARK = "Written by the option fix of crossbody audit"
"""What a file begins with that may be written over; no comment of XML may have two dashes."""


def check_model(path: Path, half: Path) -> None:
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
    """Yield where shapes, sites, cameras and lights are, and what sensors say, at fixed states."""
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


def fixed(path: Path, out: Path, without: str = "") -> None:
    """Write a file that means the same in plainer words."""
    before = opened(path, without)
    root = urdf(path, out) if is_urdf(path) else mjcf(path, out)
    root.insert(0, ElementTree.Comment(f" {MARK} "))
    ElementTree.indent(root)
    if out.suffix not in (".xml", ".urdf"):
        raise OutputError(f"{out} cannot be written: the name of a robot file ends in .xml or .urdf.")
    half = out.with_name(f".{uuid4().hex}{out.suffix}")
    try:
        half.write_text(ElementTree.tostring(root, encoding="unicode") + "\n", encoding="utf-8")
        _check(before, opened(half, without, before.job), path)
        if not is_urdf(path):
            check_model(path, half)
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
    told = rows("rewritten", after.wanted | {"told": []}, before.wanted, before.job["joints"])
    off = [row for row in told if row.quantity in SAME and row.verdict == WRONG and (row.difference or 1.0) > 1e-8]
    if off:
        raise SceneError(f"{path} cannot be rewritten: {off[0].quantity} of {off[0].where} would differ.")


def urdf(path: Path, out: Path) -> Node:
    """Return a URDF with axes of length 1, inertias in the axes of their links, meshes by where they are."""
    root = parsed(path)
    meshes = root.findall(".//mesh[@filename]")
    for mesh in meshes:
        with suppress(SceneError):  # what is only drawn may be missing
            mesh.set("filename", beside(out, path, str(located(mesh.get("filename", ""), path))))
    if meshes and root.find("mujoco") is None:  # whose compiler takes names without their folders, of meshes in a URDF
        ElementTree.SubElement(ElementTree.SubElement(root, "mujoco"), "compiler", {"strippath": "false"})
    for joint in root.findall("joint"):
        if joint.get("type") in ("revolute", "continuous", "prismatic"):
            axis = joint.find("axis")
            axis = ElementTree.SubElement(joint, "axis") if axis is None else axis
            values = numbers_of(axis.get("xyz", "1 0 0"))
            axis.set("xyz", said(values / np.linalg.norm(values)))
    for link in root.findall("link"):
        own = link.find("inertial")
        if own is None and link.get("name") != "world":  # some readers take 1 kg for none, or the mass of its shapes
            own = ElementTree.SubElement(link, "inertial")
            ElementTree.SubElement(own, "mass", {"value": "0"})
        if own is not None:
            _, place, J = inertial(link)
            for tag in ("origin", "inertia"):
                for old in own.findall(tag):
                    own.remove(old)
            six_ = zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), map(said, six(J)), strict=True)
            own.insert(0, Node("origin", {"xyz": said(place), "rpy": "0 0 0"}))
            own.append(Node("inertia", dict(six_)))
    return root
