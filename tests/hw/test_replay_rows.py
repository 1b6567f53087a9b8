"""Every row of a replay beside what plain arithmetic makes of windows and predictions whose errors are drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rig_data import channels, log_of

from crossbody import hw
from crossbody.cases import Coordinate, Outcome
from crossbody.cases.arrays import Floats
from crossbody.hw.models.contract import Segment
from crossbody.hw.replaying.comparison import Comparison, Prediction
from crossbody.hw.windows import window as cutting
from crossbody.hw.windows.window import REFERENCE, Window, run_window

STEP, MASS = 0.01, 2.5
LENGTHS = (100, 140, 60, 110)
"""Samples of the windows: their lengths are neither alike nor in order."""


def corners(t: Floats, when: Floats, jumps: Floats) -> Floats:
    """Straight lines whose rate jumps at some instants."""
    return -2.0 * t + sum(jump * np.maximum(t - at, 0.0) for at, jump in zip(when, jumps, strict=True))


def window(t: Floats, y: Floats) -> Window:
    log = log_of(t, channels("coordinates", "rad", {"angle": y[:, 0], "height": y[:, 1]}))
    segment = Segment(y=y[0], yd=np.zeros(2), t_end=float(t[-1] - t[0]))
    return Window(t=t, age=np.tile(t - t[0], (2, 1)).T, y=y, u=np.zeros((len(t), 0)), segment=segment, log=log)


def compared(windows: list[Window], said: list[Floats], **changed: object) -> dict[tuple[str, str], float]:
    """Rows by metric and channel."""
    prediction = Prediction(
        engine="one", profile="only", settings={}, y=tuple(said), yd=tuple(0.0 * y for y in said),
        outcomes=(Outcome.FINISHED,) * len(said), wall_s=0.25,
    )  # fmt: skip
    named = (Coordinate(name="angle", unit="rad"), Coordinate(name="height", unit="m"))
    whole = np.concatenate([w.y for w in windows])
    log = log_of(
        np.arange(len(whole)) * STEP, channels("coordinates", "rad", {"angle": whole[:, 0], "height": whole[:, 1]})
    )
    found = Comparison(
        log=log, model="made", title="", kind="forward", parameters={}, units={}, coordinates=named, mass=MASS,
        windows=tuple(windows), predictions=(prediction,), **({"falls": 1} | changed),
    )  # type: ignore[arg-type] # fmt: skip
    assert {(row.engine, row.profile) for row in found.rows()} == {("one", "only")}
    return {(row.metric, row.channel): row.value for row in found.rows()}


@pytest.mark.parametrize("seed", range(6))
def test_rows_are_sums_over_all_windows(seed: int) -> None:
    rng = np.random.default_rng(seed)
    windows = [window(3.0 + k + STEP * np.arange(n), rng.normal(size=(n, 2))) for k, n in enumerate(LENGTHS)]
    off = [rng.normal(scale=(0.3, 2.0), size=w.y.shape) + rng.normal(size=2) for w in windows]
    found = compared(windows, [w.y + e for w, e in zip(windows, off, strict=True)], falls=-1)
    y, e = np.concatenate([w.y for w in windows]), np.concatenate(off)
    for i, name in enumerate(("angle", "height")):
        wanted = {
            "fit": 100.0 * (1.0 - np.sqrt(np.sum(e[:, i] ** 2) / np.sum((y[:, i] - np.mean(y[:, i])) ** 2))),
            "rmse": np.sqrt(np.mean(e[:, i] ** 2)), "largest": np.max(np.abs(e[:, i])), "bias": np.mean(e[:, i]),
            "unexplained": np.sqrt(max(np.mean(e[:, i] ** 2) - found["noise", name] ** 2, 0.0)),
        }  # fmt: skip
        assert {metric: found[metric, name] for metric in wanted} == pytest.approx(wanted, rel=1e-9)
        assert found["noise", name] == pytest.approx(1.0, rel=0.15)  # all of it is
    for samples in (52, 104):  # half and whole of the median length, 1.04 s
        errors = [np.abs(one[samples]).max() for one in off if len(one) > samples]
        assert found[f"error_{samples * STEP:g}s_median", ""] == pytest.approx(np.percentile(errors, 50.0))
        assert found[f"error_{samples * STEP:g}s_90", ""] == pytest.approx(np.percentile(errors, 90.0))
    assert found["windows_failed", ""] == 0.0
    assert found["speed", ""] == pytest.approx(STEP * (sum(LENGTHS) - len(LENGTHS)) / 0.25)


@pytest.mark.parametrize("seed", range(6))
def test_impacts_of_a_replay_are_counted_timed_and_weighed(seed: int) -> None:
    """Corners at samples, some samples late and harder by drawn jumps; in each window the model has one more."""
    rng, windows, said, late, harder, own = np.random.default_rng(seed), [], [], [], [], 0.0
    for k, n in enumerate(LENGTHS):
        t = 3.0 + k + STEP * np.arange(n)
        at, jumps = np.array([12, 30, 45]), rng.uniform(1.0, 3.0, 3)
        moved, more = rng.choice([-3, -2, -1, 1, 2, 3], 3), rng.uniform(-0.3, 0.3, 3)
        heights = corners(t, t[at], jumps), corners(t, t[np.append(at + moved, 56)], np.append(jumps + more, 1.5))
        seen, predicted = (np.stack([np.sin(t), height], axis=1) for height in heights)
        windows.append(window(t, seen))
        said.append(predicted)
        late, harder, own = [*late, *moved * STEP], [*harder, *more], own + jumps.sum()
    found = compared(windows, said)
    assert found["impacts_too_many", "height"] == len(LENGTHS)
    assert found["impact_offset_median", "height"] == pytest.approx(np.median(late), abs=1e-9)
    assert found["impact_offset_largest", "height"] == pytest.approx(np.abs(late).max(), abs=1e-9)
    assert found["impulse_error", "height"] == pytest.approx(MASS * sum(harder), abs=1e-9)
    assert found["impulse_measured", "height"] == pytest.approx(MASS * own, rel=1e-9)


@pytest.mark.parametrize("samples", [-4.0, -1.5, 0.25, 3.0])
def test_each_coordinate_has_a_delay_of_its_own(samples: float) -> None:
    def motion(t: Floats, early: float) -> Floats:
        return np.stack(
            [np.sin(5.0 * (t + early)) + np.sin(7.3 * (t + early)), np.cos(6.0 * t) + np.sin(8.7 * t)], axis=1
        )

    times = [3.0 + 2.0 * k + STEP * np.arange(n) for k, n in enumerate(LENGTHS)]
    found = compared([window(t, motion(t, 0.0)) for t in times], [motion(t, samples * STEP) for t in times])
    assert found["delay", "angle"] == pytest.approx(samples * STEP, abs=1e-4)
    assert found["delay", "height"] == pytest.approx(0.0, abs=1e-4)


def test_settings_that_are_asked_for_stand_before_those_of_the_model_and_these_before_the_usual() -> None:
    usual = hw.models.load("single_pendulum")
    loose = replace(usual, settings={"reference": {"rtol": 1e-4, "max_steps": 9999}})
    t = STEP * np.arange(20)
    log = log_of(t, channels("coordinates", "rad", {"th1": np.cos(t)}))
    cut = cutting.windows(log, usual, restart=0.0)[0]
    for model, asked, wanted in (
        (usual, {}, {"rtol": REFERENCE["rtol"]}),
        (loose, {}, {"rtol": 1e-4, "max_steps": 9999}),
        (loose, {"rtol": 1e-6}, {"rtol": 1e-6, "max_steps": 9999}),
    ):
        _, used = run_window(model, model.numbers(None), cut, "reference", "matched", asked)
        assert {name: used[name] for name in wanted} == wanted
