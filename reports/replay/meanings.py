"""What the metrics of a replay say, in a few words."""

from __future__ import annotations

MEANS = {
    "fit": "share of the measured motion that is explained: 100 at best, 0 as far off as its mean, below 0 farther",
    "rmse": "root mean square of measured minus predicted",
    "largest": "largest of measured minus predicted",
    "bias": "mean of predicted minus measured",
    "delay": "how much later the measurement is than the prediction",
    "noise": "of the measurement, one standard deviation",
    "unexplained": "rmse without the noise",
    "autocorrelation": "lags of the residuals' autocorrelation inside the band of noise, 99 at best",
    "crosscorrelation": "lags of the residuals' correlation with an input inside the band, 99 at best",
    "error": "size of the error at this time after the start of a window: median, or 90 % quantile",
    "impacts": "impacts predicted minus impacts measured",
    "impact": "instants of impacts against the measured ones",
    "impulse": "sum over all impacts: its error, or the measured sum",
    "windows": "windows whose prediction failed",
    "speed": "seconds of the motion a second of computing time",
}
"""What metrics say, by the first words of their names."""


def meaning(metric: str) -> str:
    """Say what a metric of a replay, by itself or with its channel, measures; nothing of others."""
    return MEANS.get(metric.partition("_")[0], "")
