"""The delta robot in Pinocchio: constrained forward dynamics of a tree with two loops (spec 3.8, 4.3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from crossbody.cases import Case
from crossbody.cases.arrays import Floats
from crossbody.engines._delta import chart
from crossbody.engines._delta.forces import forces
from crossbody.engines._delta.scene import Delta, delta, in_absolute, steady
from crossbody.engines.linear import Spot, Tangent
from crossbody.engines.pinocchio._delta_model import Closed, by_hand, imported
from crossbody.engines.pinocchio._linear import Stand
from crossbody.engines.pinocchio._smooth import Smooth

TURNED = (
    "Pinocchio 4.1.0 turns the force on the second body of a constraint nv times about the first joint's axis in "
    "ddq_dq; ddq_dv and ddq_dtau are right."
)
MODELS = {"by_hand": by_hand, "imported": imported}


def smooth(case: Case, model: str) -> Smooth:
    """The scene.

    Args:
        case: of the delta robot.
        model: one of `MODELS`: joint by joint, or from the MJCF that MuJoCo reads.

    Raises:
        SceneError: for a start that does not close the loops.
    """
    own = delta(case)
    closed, tau, drive = MODELS[model](own.robot, case.law), np.zeros(9), own.drive
    u, numbers = drive.u, own.table

    def accelerate(t: float, r: Floats, rd: Floats) -> tuple[Floats, Floats]:
        forces(t, r, rd, u, numbers, tau)
        return closed.accelerate(r, rd, tau)

    def change(t: float, r: Floats, rd: Floats) -> None:
        drive.change(t, chart.from_tree(r, rd)[0])

    return Smooth(
        q0=own.r0,
        v0=own.rd0,
        accelerate=accelerate,
        nc=6,
        instants=drive.times,
        change=change,
        reset=drive.reset,
        chart=own.absolute,
        observe=closed.observe,
        audit=_audit(case, own, closed),
    )


def stand(case: Case, spot: Spot) -> Stand:
    """The tree with its loops at an equilibrium under constant inputs, without its controller."""
    own, (r, rd) = steady(case, spot), chart.to_tree(spot.q, spot.v)
    closed = by_hand(own.robot, case.law)

    def force(r: Floats, rd: Floats) -> Floats:
        tau = np.zeros(9)
        forces(spot.t, r, rd, own.drive.u, own.table, tau)
        return tau

    return Stand(
        model=closed.model, data=closed.data, q=r, v=rd, chart=chart.linear(r), force=force,
        jacobian=lambda r: closed.terms(r, np.zeros(9))[2], law=closed.law, more=_constrained(closed),
    )  # fmt: skip


def _constrained(closed: Closed) -> Callable[[Stand, Floats], tuple[Tangent, ...]]:
    """Pinocchio's own derivatives of the constrained dynamics, and what is wrong with them."""

    def ways(stand: Stand, right: Floats) -> tuple[Tangent, ...]:
        by_q, by_v, by_tau = closed.derivatives(stand.q, stand.v, stand.force(stand.q, stand.v))
        found = np.hstack([by_q, by_v]) + by_tau @ stand.outside()
        explained = right + closed.turned(stand.q)
        way = "computeConstraintDynamicsDerivatives"
        return (Tangent(way=way, slope=found, known=TURNED, explained=explained),)

    return ways


def _audit(case: Case, own: Delta, closed: Closed) -> dict[str, Any]:
    """Read back from the model; lam and bias without inputs, with friction and servos as they are at t = 0."""
    rest, tau = np.zeros(6), np.zeros(9)

    def terms(r: Floats, rd: Floats) -> tuple[Floats, Floats, Floats]:
        M, bias, H = closed.terms(r, rd)
        forces(0.0, r, rd, rest, own.table, tau)
        return M, bias - tau, H

    def lam(q: Floats, v: Floats) -> Floats:
        r, rd = chart.to_tree(q, v)
        forces(0.0, r, rd, rest, own.table, tau)
        return closed.accelerate(r, rd, tau)[1]

    start = chart.from_tree(own.r0, own.rd0)
    return {
        "masses": closed.masses(),
        "gravity": float(np.linalg.norm(closed.model.gravity.linear)),
        "constants": closed.constants(),
        "q0": start[0],
        "v0": start[1],
        "lam": lam,
        **in_absolute(terms),
    }
