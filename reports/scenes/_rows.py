"""What sliders and pendulums share: neighbours that push each other apart along the line of their centres."""

from __future__ import annotations

import numpy as np

from crossbody.cases.arrays import Floats


def pushes(centres: Floats, lam: Floats, radius: float) -> Floats:
    """Both arrows of every pair of neighbours: on the left ball and on the right one (centres in m, lam in N).

    Returns:
        Point and force (n, 2 (balls - 1), 4), m and N.
    """
    apart = np.diff(centres, axis=1)
    along = apart / np.maximum(np.linalg.norm(apart, axis=2, keepdims=True), 1e-300)
    force = along * lam[:, :, None]
    left = np.concatenate([centres[:, :-1] + radius * along, -force], axis=2)
    right = np.concatenate([centres[:, 1:] - radius * along, force], axis=2)
    return np.concatenate([left, right], axis=1)
