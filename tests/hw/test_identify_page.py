"""The page of an identification says of which residuals its intervals and its metrics are."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
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
    assert "Intervals: white residuals." in text
    assert "These residuals are what the fit leaves in its windows" in text
    assert "of predictions of all windows from their measured starts" in text
    _check_left(out, angle, fit["fitted"])
    assert "On held-out windows the rmse changed" in text
    assert re.search(r"to [\d.]+ rad \(within the limit of its growth\)\.", text)
    case = next(out.glob("case-*.html")).read_text(encoding="utf-8")
    assert "On held-out windows the rmse changed" in case, "its page begins as the index does"
    assert "Nothing is judged" not in case


def _check_left(out: Path, angle: np.ndarray, fitted: list[int]) -> None:
    """Hold the residuals of the fit against the noise that was added, and their correlation against its formula."""
    left = pd.DataFrame(json.loads((out / "identify-residuals.json").read_text(encoding="utf-8"))["rows"])
    assert sorted(set(left["window"])) == sorted(fitted)
    assert left["value"].std() == pytest.approx(NOISE, rel=0.1)
    own = left[left["window"] == fitted[0]].sort_values("t")
    true = solve_ivp(
        lambda _, y: [y[1], 58.0 * np.sin(y[0]) - 0.2 * y[1]], (0.0, 6.0), [2.5, 0.0], t_eval=own["t"], rtol=1e-10,
        atol=1e-10,
    )  # fmt: skip
    noise = np.interp(own["t"], np.arange(len(angle)) * 2e-3, angle) - true.y[0]
    assert np.abs(own["value"] - noise).max() < 0.3 * NOISE, "measured minus predicted is the noise itself"
    lags = pd.DataFrame(json.loads((out / "identify-autocorrelation.json").read_text(encoding="utf-8"))["rows"])
    parts = [one.sort_values("t")["value"].to_numpy() for _, one in left.groupby("window")]
    products = [sum(float(r[k:] @ r[: len(r) - k]) for r in parts) for k in range(3)]
    assert lags["lag_s"][:3].tolist() == pytest.approx([0.0, 2e-3, 4e-3])
    assert lags["value"][1:3].tolist() == pytest.approx([x / products[0] for x in products[1:]], abs=2e-3)
    assert (lags["value"][1:].abs() <= lags["band"][1:]).mean() > 0.9
