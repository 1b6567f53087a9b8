"""Masses on springs beside one to three walls: a catch or a release in a window of any width, somewhere in a step."""

from __future__ import annotations

from pathlib import Path

from crossbody.reports.suites._axis import Linear, Log, Whole
from crossbody.reports.suites._contract import TIGHT, Family, Suite

# Its truth is exact between events and looks for them in a way of its own. Contacts of stiff walls multiply an error:
# where the scene beside it parts from it by as much, a run is judged up to there.
SUITE = Suite(
    families=(
        Family(
            case=str(Path(__file__).with_name("_springs_and_walls.py")), variant="outside", ladder=TIGHT,
            axes={
                "n": Whole(1, 3), "walls": Whole(1, 3), "draw": Whole(0, 2**32 - 1), "a0": Log(1e2, 1e5),
                "zeta": Linear(0.0, 1.0), "stiffness": Log(1.0, 30.0),
            },
        ),
    ),
    engines=("reference:compiled",),
    runs=200,
)  # fmt: skip
