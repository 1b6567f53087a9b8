"""Analysis of a mechanism in a given set of modes: what simulation alone does not tell.

    from crossbody.reference.linear import linearise
    model = linearise(system, q, v, active=[0, 1])       # dx' = A dx + B du, dy = C dx + D du
    model.poles(), model.response(omega)
    scipy.signal.StateSpace(*model.matrices), model.control()

trim            equilibria with unknown positions, inputs and multipliers
linearise       the linear model at one state; `tangents` its derivatives at many, compiled
poses           trim, minimal model and poles of many held poses
modes, locus, controllable, observable         what a linear model says
sensitivity     derivatives of a motion by its start and parameters, through its contacts
filtered, balanced    forces that were not measured, from motion and torque, with their covariance
"""

from __future__ import annotations

from crossbody.reference.linear._balanced import balanced
from crossbody.reference.linear._filtered import filtered
from crossbody.reference.linear._many import Tangents, tangents
from crossbody.reference.linear._modes import Locus, Modes, controllable, locus, modes, observable
from crossbody.reference.linear._poses import Poses, poses
from crossbody.reference.linear._sensitivity import Sensitivity, sensitivity
from crossbody.reference.linear._trim import Trim, trim
from crossbody.reference.linear._unmeasured import Estimate, Unknown
from crossbody.reference.linear._walk import Jump
from crossbody.reference.linear.linearisation import linearise
from crossbody.reference.linear.model import LinearModel

__all__ = [
    "Estimate",
    "Jump",
    "LinearModel",
    "Locus",
    "Modes",
    "Poses",
    "Sensitivity",
    "Tangents",
    "Trim",
    "Unknown",
    "balanced",
    "controllable",
    "filtered",
    "linearise",
    "locus",
    "modes",
    "observable",
    "poses",
    "sensitivity",
    "tangents",
    "trim",
]
