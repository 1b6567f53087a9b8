"""The tables of a benchmark without its minutes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from crossbody.reports.runs import study
from crossbody.reports.runs.output import folder


def ladder(path: Path, case: str, profile: str = "p", rows: int = 3) -> Path:
    """A folder with the tables of `crossbody bench` for a case, of one engine."""
    found = pd.DataFrame(
        {
            "case": case, "engine": "fake", "profile": "p", "against": "the case", "tier": "A",
            "knob": "dt", "setting": 10.0 ** -np.arange(rows), "error": 10.0 ** -np.arange(rows), "error_q": 1.0,
            "error_v": 1.0, "error_impulse": 1.0, "error_energy": 1.0, "error_times": 1.0, "honesty": np.nan,
            "median_ms": 1.0 + np.arange(rows), "iqr_ms": 0.1, "call_ms": 2.0, "cores": 1.0, "repeats": 3,
            "outcome": "finished",
        }
    )  # fmt: skip
    lead = pd.DataFrame({"case": [case], "engine": ["fake"], "profile": [profile], "ratio": [42.0], "ahead": ["yes"]})
    order = pd.DataFrame(columns=["case", "engine", "profile", "knob", "order", "promised", "says"])
    told = {"command": "crossbody bench"}
    with folder(path) as made_:
        study.write(made_, [], study.judge([], {}), told)
        for name, rows_ in (("bench", found), ("headline", lead), ("orders", order)):
            study.write_table(made_ / name, rows_, told)
    return path
