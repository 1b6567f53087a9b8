"""The soft contact on an axis in Pinocchio: sliders side by side, one of them a clock (spec 2.6, 4.3)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from crossbody.cases import Case, Mode
from crossbody.cases.arrays import Floats
from crossbody.engines import _soft_contact as soft
from crossbody.engines._log import charted
from crossbody.engines.linear import Spot
from crossbody.engines.pinocchio._linear import Stand, of_rows
from crossbody.engines.pinocchio._rows import PinRows, mass_matrix
from crossbody.engines.pinocchio._scene import Scene

LAW = "law"
ON = (int(Mode.CONTACT),) * 2


def why_not(case: Case, profile: str) -> str | None:
    """The law alone: the pads carry the compliance, and sensors and loop read finite forces."""
    if profile != LAW:
        return "Touch sensors read forces: impacts in no time and time stepping have impulses instead."
    if case.fsm != "level":
        return f"The profile law switches by the machine 'level' and not by {case.fsm!r}."
    return None


def build(case: Case, algebra: str) -> Scene:
    """The model: a body on a prismatic joint along x for every coordinate and the time."""
    own = soft.soft_contact(case)
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    for name, mass in zip(soft.NAMES, own.masses.tolist(), strict=True):
        joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia(mass, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    rows = PinRows(
        model, jacobian=lambda _q: own.H, heights=own.heights, drift=lambda _q, _v: np.zeros(2), law=case.law,
        algebra=algebra, forces=own.forces,
    )  # fmt: skip
    return Scene(
        rows=rows, observe=charted(soft.chart, own.observe), sizes=own.sizes, start=own.start(case), chart=soft.chart,
        audit=_listed(rows, own),
    )  # fmt: skip


def stand(case: Case, spot: Spot) -> Stand:
    """The model at an equilibrium, the clock at its time."""
    return of_rows(build(case, "forwardDynamics").rows, spot, more=(spot.t,), rates=(1.0,))


def _listed(rows: PinRows, own: soft.SoftContact) -> dict[str, Any]:
    """The audit in the case's coordinates, at the time 0: the bodies' masses without those of the controller."""
    n, model = soft.CLOCK, rows.model

    def whole(q: Floats, v: Floats) -> tuple[Floats, Floats]:
        return np.append(q, 0.0), np.append(v, 1.0)

    def bias(q: Floats, v: Floats) -> Floats:
        x, xd = whole(q, v)
        own.forces(x, xd, rows.tau)
        found: Floats = (np.array(pin.nonLinearEffects(model, rows.data, x, xd)) - rows.tau)[:n]
        return found

    return {
        "masses": np.array([inertia.mass for inertia in model.inertias[1:5]]),
        "M": lambda q: mass_matrix(model, rows.data, np.append(q, 0.0))[:n, :n],
        "bias": bias,
        "H": lambda _q: own.H[:, :n],
        "lam": lambda q, v: rows.accelerate(*whole(q, v), ON)[1],
    }
