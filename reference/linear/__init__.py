"""Linear models of a mechanism in a given set of modes (spec 2.7).

from crossbody.reference.linear import linearise
model = linearise(system, q, v, active=[0, 1])       # dx' = A dx + B du, dy = C dx + D du
model.poles(), model.response(omega)
scipy.signal.StateSpace(*model.matrices), control.ss(*model.matrices)
"""

from __future__ import annotations

from crossbody.reference.linear._linearise import linearise
from crossbody.reference.linear._model import LinearModel

__all__ = ["LinearModel", "linearise"]
