"""The page of an identification says of which residuals its intervals and its metrics are."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from study_pages import MAP

from crossbody.reports.cli import main
from crossbody.reports.pages import site

NOISE = 1e-3  # of the angle, rad


def test_white_residuals_of_a_fit_stand_beside_predictions_that_are_off_by_their_starts(tmp_path: Path) -> None:
    """The noise of a measured start shifts a whole window: what is left of that is no white noise."""
    t = np.arange(3000) * 2e-3
    swing = solve_ivp(
        lambda _, y: [y[1], 58.0 * np.sin(y[0]) - 0.2 * y[1]], (0.0, t[-1]), [2.5, 0.0], t_eval=t, rtol=1e-9, atol=1e-9
    )
    angle = swing.y[0] + NOISE * np.random.default_rng(1).standard_normal(len(t))
    log = np.stack([t, np.rad2deg(angle)], axis=1)
    np.savetxt(tmp_path / "rig.csv", log, delimiter=",", header="t [s],angle [deg]", comments="")
    (tmp_path / "rig.toml").write_text(MAP, encoding="utf-8")
    out = tmp_path / "out"
    asked = ["identify", str(tmp_path / "rig.csv"), "-m", "single_pendulum", "--columns", str(tmp_path / "rig.toml")]
    with pytest.raises(SystemExit) as end:
        main([*asked, "--restart", "1", "-f", "k1", "-f", "I1", "--out", str(out), "-q"])
    assert not end.value.code
    fit = json.loads((out / "identify.json").read_text(encoding="utf-8"))["provenance"]["fit"]
    rows = {row["metric"]: row["value"] for row in json.loads((out / "replay.json").read_text())["rows"]}
    assert fit["covariance"] == "white residuals"
    assert rows["noise"] == pytest.approx(NOISE, rel=0.1)
    assert rows["unexplained"] > 0.5 * NOISE
    text = site.write(out).read_text(encoding="utf-8")
    assert "Intervals: white residuals. These residuals are what the fit leaves in its windows" in text
    assert "of predictions of all windows from their measured starts" in text
