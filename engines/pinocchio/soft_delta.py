"""The soft contact on the delta robot in Pinocchio: the tree with its loops, and prismatic joints (spec 2.6, 3.8, 4.3).

One model holds the tree and what slides beside it; loops, pads and table are rows of one law, so that one solve gives
v' and all multipliers.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Case, Mode
from crossbody.cases.arrays import Floats
from crossbody.engines._log import charted
from crossbody.engines._soft_delta import (
    CLOCK,
    HINGES,
    LOOPS,
    NV,
    SLIDERS,
    SoftDelta,
    joined,
    linear,
    of_case,
    rows_of_case,
    small_motions,
    soft_delta,
)
from crossbody.engines.linear import Spot
from crossbody.engines.pinocchio._delta_model import Closed, by_hand
from crossbody.engines.pinocchio._linear import Stand, of_rows
from crossbody.engines.pinocchio._rows import PinRows, mass_matrix
from crossbody.engines.pinocchio._scene import Scene
from crossbody.engines.pinocchio.soft_contact import why_not as why_not

ON = (int(Mode.BILATERAL),) * LOOPS + (int(Mode.CONTACT),) * 3


def build(case: Case, algebra: str) -> Scene:
    """The model: the tree of the robot, and a body on a prismatic joint for every other coordinate and the time.

    Raises:
        SceneError: for a start that does not close the loops.
    """
    own = soft_delta(case)
    closed, still = by_hand(own.robot, case.law), np.zeros(HINGES)

    def jacobian(q: Floats) -> Floats:
        H = np.zeros((LOOPS + 3, NV))
        H[:LOOPS, :HINGES] = closed.jacobian(q[:HINGES])
        H[LOOPS:] = own.H
        return H

    def heights(q: Floats) -> Floats:
        return np.append(closed.loops(q[:HINGES], still)[0], own.heights(q))

    def drift(q: Floats, v: Floats) -> Floats:
        return np.append(closed.loops(q[:HINGES], v[:HINGES])[2], np.zeros(3))

    rows = PinRows(_beside(closed, own), jacobian, heights, drift, case.law, algebra, forces=own.forces)
    return Scene(
        rows=rows, observe=charted(of_case, own.observe), sizes=own.sizes, start=own.start(case), chart=of_case,
        audit=_listed(rows, closed, own),
    )  # fmt: skip


def stand(case: Case, spot: Spot) -> Stand:
    """The model at an equilibrium, the clock at its time."""
    q, v = joined(spot.q, spot.v, spot.t)
    return replace(of_rows(build(case, "forwardDynamics").rows, spot), q=q, v=v, chart=small_motions(q))


def _beside(closed: Closed, own: SoftDelta) -> Any:
    """The robot's model with the sliders beside it; the block has a joint an axis, of which the last has a body."""
    model, kinds = closed.model.copy(), (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ)
    for (name, count), mass in zip(SLIDERS.items(), own.bodies, strict=True):
        joint = 0
        for k in range(count):
            joint = model.addJoint(joint, kinds[k](), pin.SE3.Identity(), f"{name} {k}")
        model.appendBodyToJoint(joint, pin.Inertia(mass, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    return model


def _listed(rows: PinRows, closed: Closed, own: SoftDelta) -> dict[str, Any]:
    """The audit in the case's coordinates, at the time 0: the bodies' masses without those of the controller."""
    model, still = rows.model, np.zeros(CLOCK)

    def terms(q: Floats, v: Floats) -> tuple[Floats, Floats]:
        x, xd = joined(q, v, 0.0)
        own.forces(x, xd, rows.tau)
        bias = np.array(pin.nonLinearEffects(model, rows.data, x, xd)) - rows.tau
        return linear(x, xd, mass_matrix(model, rows.data, x), bias)

    def H(q: Floats) -> Floats:
        x, _ = joined(q, still, 0.0)
        return rows_of_case(x, rows.jacobian(x))

    beside = [model.inertias[model.getJointId(name)].mass for name in ("left pad 0", "right pad 0", "block 2")]
    return {
        "masses": np.append(closed.masses(), beside),
        "M": lambda q: terms(q, still)[0],
        "bias": lambda q, v: terms(q, v)[1],
        "H": H,
        "lam": lambda q, v: rows.accelerate(*joined(q, v, 0.0), ON)[1],
    }
