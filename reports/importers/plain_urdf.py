"""A URDF in plain words: axes of length 1, inertias in the axes of links, meshes by where they are."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from crossbody.cases import SceneError
from crossbody.cases.files.inertias import six
from crossbody.cases.files.meshes import located
from crossbody.cases.files.urdf import inertial, parsed
from crossbody.reports.importers.plain_mjcf import Node
from crossbody.reports.importers.saying import beside, numbers_of, said


def urdf(path: Path, out: Path) -> Node:
    """Return a URDF with axes of length 1, inertias in the axes of their links, and meshes by where they are."""
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
