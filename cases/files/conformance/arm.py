"""A feature of robot files, and the arm of two links that most features change, as a scene and as MJCF."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.files.inertias import Inertia, placed, six, solid, together
from crossbody.cases.rotations import matrices
from crossbody.cases.scene import Body, Joint, Scene

MOTION = ("coordinates", "inertia", "M", "gravity", "bias", "energy", "frames")


@dataclass(frozen=True, slots=True)
class Feature:
    """One way of writing something.

    Attributes:
        name: of the file too.
        text: the smallest file that has it.
        scene: what it means.
        finds: paths of ElementTree by which a file is seen to use it, between bars; behind a !
            children and @attributes that are not there, each with what would say the same behind
            an =; empty for what no path tells.
        rule: what the format says, in a sentence.
        rewrite: how to write it so that every reader reads the same; empty where there is no such way.
        about: quantities by which a reader is judged.
        format: mjcf or urdf.
        files: what else stands beside it, name -> text.
        keys: name of every keyframe -> positions (nq,).
        heavier: added to M (nv, nv) by what a scene does not have, of which our own reading says so.
    """

    name: str
    text: str
    scene: Scene
    finds: str = ""
    rule: str = ""
    rewrite: str = ""
    about: tuple[str, ...] = MOTION
    format: str = "mjcf"
    files: Mapping[str, str] = field(default_factory=dict)
    keys: Mapping[str, Floats] = field(default_factory=dict)
    heavier: tuple[tuple[float, ...], ...] = ()

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths by which a file is seen to use it."""
        return tuple(filter(None, self.finds.split(" | ")))


UPPER = Body(
    name="upper", position=(0.1, 0.2, 1.0), mass=2.0, com=(0.05, 0.02, -0.2), inertia=(0.04, 0.05, 0.02, 0.0, 0.0, 0.0)
)
LOWER = Body(
    name="lower", parent="upper", position=(0.0, 0.05, -0.4), mass=1.0, com=(0.01, 0.03, -0.15),
    inertia=(0.02, 0.03, 0.015, 0.0, 0.0, 0.0),
)  # fmt: skip
HAND = Body(
    name="hand", parent="lower", position=(0.0, 0.1, -0.3), mass=0.5, com=(0.02, 0.0, 0.01),
    inertia=(0.003, 0.004, 0.005, 0.0, 0.0, 0.0),
)  # fmt: skip
"""What is put on the lower link by a joint that moves nothing."""
SHOULDER = Joint(name="shoulder", body="upper", type="hinge", axis=(0.0, 1.0, 0.0))
ELBOW = Joint(name="elbow", body="lower", type="hinge", axis=(1.0, 0.0, 0.0))
UPPER_INERTIAL = '<inertial pos=".05 .02 -.2" mass="2" diaginertia=".04 .05 .02"/>'
LOWER_INERTIAL = '<inertial pos=".01 .03 -.15" mass="1" diaginertia=".02 .03 .015"/>'
ELBOW_TEXT = '<joint name="elbow" axis="1 0 0"/>'


def arm(upper: Any = (), lower: Any = (), shoulder: Any = (), elbow: Any = (), **more: Any) -> Scene:
    """Return the arm with changes of its parts."""
    bodies = (replace(UPPER, **dict(upper)), replace(LOWER, **dict(lower)))
    joints = (replace(SHOULDER, **dict(shoulder)), replace(ELBOW, **dict(elbow)))
    return Scene(**({"bodies": bodies, "joints": joints} | more))


SECOND = f'<body name="other" pos="2 0 1"><joint name="other" axis="0 1 0"/>{LOWER_INERTIAL}</body>'


def two_trees(**more: Any) -> Scene:
    """Return the arm, and a lower link like its own that stands beside it (`SECOND`)."""
    other = replace(LOWER, name="other", parent="", position=(2.0, 0.0, 1.0))
    joint = Joint(name="other", body="other", type="hinge", axis=(0.0, 1.0, 0.0))
    return arm(bodies=(UPPER, LOWER, other), joints=(SHOULDER, ELBOW, joint), **more)


def mjcf(
    *, head: str = "", upper: str = 'pos=".1 .2 1"', shoulder: str = '<joint name="shoulder" axis="0 1 0"/>',
    upper_inertial: str = UPPER_INERTIAL, lower: str = 'pos="0 .05 -.4"', elbow: str = ELBOW_TEXT,
    lower_inertial: str = LOWER_INERTIAL, before: str = "", behind: str = "", tail: str = "", inside: str = "",
    model: str = ' model="conformance"',
) -> str:  # fmt: skip
    """Return the arm as MJCF, with parts of it written in another way."""
    return (
        f'<mujoco{model}>\n  {head}\n  <worldbody>\n    {before}<body name="upper" {upper}>\n      {shoulder}\n'
        f'      {upper_inertial}\n      {inside}<body name="lower" {lower}>\n        {elbow}\n        '
        f"{lower_inertial}\n"
        f"      </body>\n    </body>{behind}\n  </worldbody>\n  {tail}\n</mujoco>\n"
    )


def rotation(axis: str, degrees: float) -> Floats:
    """Return a turn about one of the axes x, y and z."""
    i = "xyz".index(axis)
    half = np.radians(degrees) / 2
    return matrices(np.array([np.cos(half), *(np.sin(half) * np.eye(3)[i])]))


def quaternion(R: Floats) -> tuple[float, ...]:
    """Return the quaternion (w first) of a rotation of less than half a turn."""
    w = np.sqrt(1.0 + np.trace(R)) / 2
    return (float(w), *(float(x) for x in (R[[2, 0, 1], [1, 2, 0]] - R[[1, 2, 0], [2, 0, 1]]) / (4 * w)))


def turned(*turns: tuple[str, float]) -> dict[str, Any]:
    """Return the orientation of a body behind turns about its own axes, one behind the other."""
    R = np.eye(3)
    for axis, degrees in turns:
        R = R @ rotation(axis, degrees)
    return {"orientation": quaternion(R)}


def weighing(*parts: Inertia) -> dict[str, Any]:
    """Return mass, centre and inertia of a body that is made of solids."""
    mass, com, about = together(parts)
    return {"mass": mass, "com": tuple(com.tolist()), "inertia": six(about)}


def of_shape(kind: str, size: tuple[float, ...], density: float = 1000.0, **at: Any) -> Inertia:
    """Return a solid of a density."""
    volume, unit = solid(kind, size)
    return placed(density * volume, unit, **at)
