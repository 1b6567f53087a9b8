"""A case as a scene with coordinates of its own: what engines build where the case counts in others, and the way back.

Equations may be written in coordinates that no tree of joints has: links that each have a
position and an angle, angles against the horizon, and states of a controller or a sensor beside
those of bodies. `Case.form` gives the scene in which engines run the same motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.case import Case
from crossbody.cases.files.case import RATES, coordinates, quaternions
from crossbody.cases.scene import Scene
from crossbody.cases.scene_contacts import law_of, rows_of

Map = Callable[[Floats, Floats], tuple[Floats, Floats]]
"""(q (m, nq), v (m, nv)) -> the same states in other coordinates; linear in v."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """A case on a scene.

    Attributes:
        case: the scene with start, law, inputs, control and force in the coordinates of its joints.
        to_case: states (m, ..) of the scene -> those of the case.
        to_scene: the way back.
        bend: (q, v) of the scene, one state -> J' v, where the case's velocities are J v; None
            where J is constant.
        rows: of every row of the case the scene's; -1 where joints hold what the row does.
    """

    case: Case
    to_case: Map
    to_scene: Map
    bend: Callable[[Floats, Floats], Floats] | None = None
    rows: tuple[int, ...]

    def rate_matrix(self, q: Floats) -> Floats:
        """Return J (n, nv) at one state (nq,) of the scene: the case's velocities are J times the scene's."""
        unit = np.eye(len(self.case.v0))
        return self.to_case(np.tile(q, (len(unit), 1)), unit)[1].T


def formed(case: Case, scene: Scene, q0: Floats, v0: Floats, **changes: Any) -> Case:
    """Return the case that a form runs: a scene under its own names and laws, from a start of its own.

    The start is in the coordinates of the joints. Of other fields inputs and control are none if
    not given, law and contacts are the scene's own.
    """
    contacts = tuple(rows_of(scene)[0])
    own: dict[str, Any] = {"inputs": None, "control": None, "law": law_of(scene), "contacts": contacts, **changes}
    return replace(
        case, form=None, scene=scene, q0=q0, v0=v0, coordinates=coordinates(scene),
        velocities=coordinates(scene, RATES), quaternions=quaternions(scene),
        closed_form=None, claims=(), metrics={}, limits=(), **own,
    )  # fmt: skip
