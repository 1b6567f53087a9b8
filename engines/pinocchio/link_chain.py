"""A chain of links in Pinocchio: revolute joints about y, accelerations by the articulated-body algorithm."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.engines._link_chain import LinkChain, link_chain
from crossbody.engines._log import charted
from crossbody.engines.pinocchio._smooth import Smooth

MODELS = {"by_hand": "joint by joint"}


def smooth(case: Case, model: str) -> Smooth:
    """The scene; hinges have no multipliers.

    Args:
        case: of the mechanism `link_chain`.
        model: one of `MODELS`.
    """
    own = link_chain(case)
    tree = _tree(own)
    data, unknown = tree.createData(), np.full(len(case.contacts), np.nan)

    def accelerate(_t: float, r: Floats, rd: Floats) -> tuple[Floats, Floats]:
        return pin.aba(tree, data, r, rd, own.torque(rd)), unknown

    def change(t: float, _r: Floats, _rd: Floats) -> None:
        own.change(t)

    q0, v0 = own.absolute(own.r0[None], own.rd0[None])
    return Smooth(
        q0=own.r0, v0=own.rd0, accelerate=accelerate, nc=len(case.contacts), instants=own.times.tolist(),
        change=change, reset=own.reset, chart=own.absolute, observe=charted(own.absolute, own.observe),
        audit={
            "masses": np.array([inertia.mass for inertia in tree.inertias[1:]]), "constants": {},
            "gravity": float(np.linalg.norm(tree.gravity.linear)), "q0": q0[0], "v0": v0[0],
        },
    )  # fmt: skip


def _tree(own: LinkChain) -> Any:
    """Every link hangs along -z from its joint."""
    model, joint, reach = pin.Model(), 0, 0.0
    model.gravity.linear = np.array([0.0, 0.0, -own.gravity])
    for i, link in enumerate(own.links):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -reach]))
        joint = model.addJoint(joint, pin.JointModelRY(), place, f"joint {i}")
        inertia = pin.Inertia(link.m, np.array([0.0, 0.0, -link.a]), link.inertia * np.eye(3))
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        reach = link.length
    return model
