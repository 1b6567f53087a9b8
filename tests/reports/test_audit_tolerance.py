"""An importer that is off by a part in a million is told, and one that is right is not."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco")
from crossbody.reports.importers.audit import opened
from crossbody.reports.importers.compare import WRONG, rows

DRIVEN = Path(__file__).parents[1] / "support" / "driven_ball.xml"
LITTLE = 1e-6


@pytest.mark.parametrize("key", ["M", "gravity", "bias", ""])
def test_a_part_in_a_million_is_no_rounding(key: str) -> None:
    audit = opened(DRIVEN)
    found: dict[str, Any] = deepcopy(dict(audit.wanted)) | {"version": "1"}
    for state in found["states"] if key else ():
        state[key] = ((1.0 + LITTLE) * np.array(state[key], dtype=float)).tolist()
    told = rows("made up", found, audit.wanted, audit.job["joints"])
    assert [row.quantity for row in told if row.verdict == WRONG] == ([key] if key else [])
