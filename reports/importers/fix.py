"""A robot file written so that more readers agree; what it means stays, which is checked first."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from uuid import uuid4
from xml.etree import ElementTree

import numpy as np

from crossbody.cases import OutputError, SceneError
from crossbody.cases.files.inertias import six
from crossbody.cases.files.meshes import located
from crossbody.cases.files.reading import is_urdf
from crossbody.cases.files.urdf import inertial, parsed
from crossbody.reports.importers.audit import Audit, opened
from crossbody.reports.importers.compare import WRONG, rows
from crossbody.reports.importers.plain_mjcf import Node, mjcf
from crossbody.reports.importers.same_model import check_model
from crossbody.reports.importers.saying import beside, numbers_of, said

SAME = ("coordinates", "inertia", "M", "gravity", "bias", "energy", "armature", "damping", "springs", "limits",
        "friction", "effort", "loops", "actuators", "contacts", "surfaces", "softness", "keyframes")  # fmt: skip
"""What the new file means as the old one does; bodies that are fixed to the world may have other frames."""
MARK = "Written by the option fix of crossbody audit"
"""What a file begins with that may be written over; no comment of XML may have two dashes."""


def fixed(path: Path, out: Path, without: str = "") -> None:
    """Write a file that means the same in plainer words.

    Raises:
        SceneError: for what is not rewritten, or would not mean the same; nothing is written then.
    """
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
