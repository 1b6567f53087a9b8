"""Figures of a replay and an identification show the numbers of the tables, each in its own plot."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from unpacked import numbers

from crossbody.reports.replay import figure
from crossbody.reports.sections.replay import explained

NAMES = ["I1", "k1", "<b>"]


@pytest.fixture(scope="module")
def random() -> np.random.Generator:
    return np.random.default_rng(7)


def spans(shapes: list[dict], axis: str) -> dict[str, tuple[float, float]]:
    """Grey stretches along x or y, by the axis that they lie on."""
    return {
        one[f"{axis}ref"]: (one[f"{axis}0"], one[f"{axis}1"]) for one in shapes if "domain" not in one[f"{axis}ref"]
    }


def test_a_profile_is_the_rise_of_the_cost_and_shades_its_interval(random: np.random.Generator) -> None:
    estimates = pd.DataFrame({"name": NAMES, "unit": "kg", "low": [0.9, 1.8, 2.7], "high": [1.1, 2.2, 3.3]})
    rows = pd.DataFrame(
        [(name, k + 0.1 * j, 1.0 + j * j + random.uniform()) for k, name in enumerate(NAMES) for j in range(-4, 5)],
        columns=["name", "value", "cost"],
    )
    drawn = figure.profile(rows, estimates)
    for k, (name, line) in enumerate(zip(NAMES, drawn["data"], strict=True)):
        mine, n = rows[rows["name"] == name], "" if k == 0 else str(k + 1)
        assert (line["xaxis"], line["yaxis"]) == (f"x{n}", f"y{n}")
        np.testing.assert_allclose(numbers(line["x"]), mine["value"])
        np.testing.assert_allclose(numbers(line["y"]), 100.0 * (mine["cost"] - 1.0), rtol=1e-6)
        assert spans(drawn["layout"]["shapes"], "x")[f"x{n}"] == (estimates["low"][k], estimates["high"][k])
        assert drawn["layout"][f"xaxis{n}"]["title"]["text"] == f"{name.replace('<', '&lt;')} [kg]"
        assert "matches" not in drawn["layout"][f"xaxis{n}"]


def test_the_map_of_correlations_has_every_pair_and_nothing_where_none_is_known(random: np.random.Generator) -> None:
    known = np.corrcoef(random.standard_normal((3, 9)))
    known[2, :2] = known[:2, 2] = np.nan
    pairs = [(a, b, known[i, j]) for i, a in enumerate(NAMES) for j, b in enumerate(NAMES)]
    drawn = figure.together(pd.DataFrame(pairs, columns=["name", "other", "value"]).sample(frac=1.0, random_state=1))
    (heat,) = drawn["data"]
    order = [NAMES.index(text.replace("&lt;", "<")) for text in heat["x"]]
    assert heat["x"] == heat["y"]
    assert (heat["zmin"], heat["zmax"]) == (-1.0, 1.0)
    np.testing.assert_array_equal(np.array(heat["z"], float), known[np.ix_(order, order)])
    assert heat["text"] == [["" if np.isnan(x) else f"{x:+.2f}" for x in row] for row in known[np.ix_(order, order)]]


def windows(random: np.random.Generator) -> pd.DataFrame:
    """Two engines on two channels in three windows."""
    parts = [
        pd.DataFrame({
            "who": who, "channel": channel, "unit": "rad", "window": w, "t": 1.0 * w + np.linspace(0.0, 0.9, 10),
            "measured": random.standard_normal(10), "value": random.standard_normal(10),
        })
        for who in ("reference:compiled", "mujoco:matched") for channel in ("th1", "th2") for w in range(3)
    ]  # fmt: skip
    return pd.concat(parts, ignore_index=True)


def test_measured_and_predicted_stand_in_one_plot_with_the_band_of_noise_and_held_windows(
    random: np.random.Generator,
) -> None:
    rows = windows(random)
    drawn = figure.motion(rows, {"th1": 0.25}, held=[1])
    for place, channel in (("", "th1"), ("2", "th2")):
        lines = {one["name"]: one for one in drawn["data"] if one["yaxis"] == f"y{place}"}
        assert (len(lines) == 4) == (channel == "th1")  # the band only where the noise is known
        for who in ("reference:compiled", "mujoco:matched"):
            mine = rows[(rows["who"] == who) & (rows["channel"] == channel)]
            y = numbers(lines[who]["y"])
            np.testing.assert_allclose(y[~np.isnan(y)], mine["measured"] - mine["value"], rtol=1e-5, atol=1e-6)
            assert np.isnan(y).sum() == 2  # a gap between windows
    band = next(one for one in drawn["data"] if one.get("fill") == "toself")
    y = numbers(band["y"])
    assert np.nanmax(np.abs(np.diff(y))) > 0.0
    first = rows[(rows["who"] == "reference:compiled") & (rows["channel"] == "th1") & (rows["window"] == 0)]
    predicted = (first["measured"] - first["value"]).to_numpy()
    np.testing.assert_allclose(y[:10] - predicted, figure.SIGMAS * 0.25, rtol=1e-4)
    assert set(spans(drawn["layout"]["shapes"], "x").values()) == {(1.0, 1.9)}


def test_residuals_stand_in_the_band_of_their_own_channel(random: np.random.Generator) -> None:
    drawn = figure.residual(windows(random), {"th1": 0.25, "th2": 0.5})
    assert spans(drawn["layout"]["shapes"], "y") == {"y": (-0.5, 0.5), "y2": (-1.0, 1.0)}


def test_correlations_of_residuals_stand_in_their_band(random: np.random.Generator) -> None:
    rows = pd.DataFrame({
        "who": "reference:compiled", "channel": "th1", "input": np.repeat(["", "tau"], 5),
        "lag": np.tile(np.arange(5), 2),
        "value": random.uniform(-1.0, 1.0, 10), "band": np.repeat([0.1, 0.2], 5),
    })  # fmt: skip
    drawn = figure.correlation(rows)
    assert "averages" in drawn["layout"]["xaxis2"]["title"]["text"], "an earlier run does not say how long they are"
    timed = figure.correlation(rows.assign(lag_s=0.02 * rows["lag"]))
    assert timed["layout"]["xaxis2"]["title"]["text"] == "lag [s]"
    np.testing.assert_allclose(numbers(timed["data"][1]["x"]), 0.02 * np.arange(5))
    assert spans(drawn["layout"]["shapes"], "y") == {"y": (-0.1, 0.1), "y2": (-0.2, 0.2)}
    np.testing.assert_allclose(numbers(drawn["data"][1]["y"]), rows["value"][5:], rtol=1e-6)


def test_the_largest_residual_that_is_within_is_drawn_on_both_sides(random: np.random.Generator) -> None:
    channels = ("th1", "th2", "th3")
    rows = pd.concat([
        pd.DataFrame({"who": "e:p", "channel": name, "unit": "rad", "window": 0, "t": np.arange(9.0),
                      "measured": 0.0, "value": random.uniform(-1, 1, 9)}) for name in channels
    ])  # fmt: skip
    drawn = figure.residual(rows, {}, limits={"th1": 0.5, "th3": 0.25})
    lines = [(one["yref"], one["y0"]) for one in drawn["layout"]["shapes"] if one.get("name") == "limit"]
    assert sorted(lines) == [("y", -0.5), ("y", 0.5), ("y3", -0.25), ("y3", 0.25)]


@pytest.mark.parametrize("seed", range(10))
def test_a_profile_that_is_a_parabola_meets_the_dashed_line_at_the_ends_of_its_interval(seed: int) -> None:
    rng = np.random.default_rng(seed)
    at, half, bend = rng.normal(), rng.uniform(0.1, 2.0), 10.0 ** rng.uniform(-3.0, 3.0)
    estimates = pd.DataFrame({"name": ["k"], "unit": "N", "low": [at - half], "high": [at + half]})
    values = at + half * np.linspace(-1.5, 1.5, 9)
    rows = pd.DataFrame({"name": "k", "value": values, "cost": 1.0 + bend * (values - at) ** 2})
    (dashed,) = (one["y0"] for one in figure.profile(rows, estimates)["layout"]["shapes"] if one["type"] == "line")
    assert dashed == pytest.approx(100.0 * bend * half**2)


@pytest.mark.parametrize("sigma", [1e-9, 0.25])
def test_the_noise_is_seen_or_said_however_small_it_is(sigma: float, random: np.random.Generator) -> None:
    for draw in (figure.motion, figure.residual):
        title = draw(windows(random), {"th1": sigma})["layout"]["title"]["text"]
        assert f"th1 ±{2.0 * sigma:.2g} rad" in title
    (band,) = (one for one in figure.residual(windows(random), {"th1": sigma})["layout"]["shapes"] if "yref" in one)
    assert band["line"]["width"] >= 1.0, "a band without a height is a line"


@pytest.mark.parametrize("fit", [-np.inf, -92.8, -1.0, 0.0, 73.0])
def test_what_explains_less_than_nothing_is_said_in_words(fit: float) -> None:
    rows = [("e:p", "fit", "rz", fit, "%"), ("e:p", "fit", "x", 99.0, "%"), ("e:p", "largest", "rz", 0.5, "rad")]
    said = explained(pd.DataFrame(rows, columns=["who", "metric", "channel", "value", "unit"]))
    assert said.endswith("rz, off by up to 0.5 rad (e:p).")
    if fit >= 0.0:
        assert f"{fit:.3g} % of rz" in said
    elif np.isinf(fit):
        assert "nothing was measured to move, of rz" in said
    else:
        assert "-" not in said
        assert f"{1.0 - fit / 100.0:.2g} times as much as the measured mean" in said
