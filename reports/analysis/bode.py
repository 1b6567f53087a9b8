"""Frequency responses of a case about an equilibrium, in the modes of that equilibrium.

Today the soft contact: from the velocity of the fingers to the difference of the contact forces
and to the velocity of the block, held by both fingers, with and without tactile feedback.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from crossbody import cases
from crossbody.cases import Value
from crossbody.cases.mechanisms.soft import claims as closed
from crossbody.cases.mechanisms.soft.scene import numbers
from crossbody.reference.linear import LinearModel, linearise

CASE = "soft_contact"
GAINS = (0.0, 20.0)  # k* of the curves, cm/(s N)
POINTS = 601
FREQUENCIES = np.geomspace(1e-2, 1e4, POINTS)  # of the figure, rad/s: 100 a decade
OUTPUTS = ("force", "block velocity")
UNITS = {"force": "N/(m/s)", "block velocity": "1"}
"""Contact force, lam_L - lam_R, and velocity of the block, each over the velocity of the fingers."""
MODES = {"grasp": (0, 1), "left finger": (0,), "right finger": (1,), "free": ()}
COLUMNS = ("mode", "kstar", "output", "unit", "omega", "magnitude", "phase")


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """One linear model with the numbers that made it.

    Attributes:
        mode: key of `MODES`.
        kstar: gain of the tactile loop, cm/(s N).
        model: from the velocity of the fingers to `OUTPUTS`; idle states are left out.
    """

    mode: str
    kstar: float
    model: LinearModel


def soft_contact(kstar: float, mode: str = "grasp", **parameters: Value) -> Curve:
    """The fingers and the block linearised about an equilibrium in one of `MODES`; the gain is in cm/(s N)."""
    from crossbody.reference.systems import soft_contact as mechanism

    case = cases.load(CASE, variant="axis", kstar=kstar, **parameters)
    p = numbers(case.parameters)
    q, v = closed.grasp(p) if mode == "grasp" else closed.touching(p)
    model = linearise(
        mechanism.build(case.parameters, case.law), q, v, active=MODES[mode], outputs=("v", "lam"),
        names=mechanism.COORDINATES, t=p["close_end"],
    )  # fmt: skip
    weights = np.zeros((2, len(model.outputs)))
    weights[0, model.outputs.index("lam[0]")], weights[0, model.outputs.index("lam[1]")] = 1.0, -1.0
    weights[1, model.outputs.index("b'")] = 1.0
    return Curve(mode=mode, kstar=kstar, model=model.combined(weights, OUTPUTS).without_idle())


def table(curves: Sequence[Curve], omega: ArrayLike) -> pd.DataFrame:
    """Magnitude and phase, degrees, of every curve at the frequencies (m,), rad/s: one row a value."""
    w, parts = np.asarray(omega, dtype=np.float64), []
    for curve in curves:
        response = curve.model.response(w)[:, :, 0]
        for k, name in enumerate(OUTPUTS):
            phase = np.degrees(np.unwrap(np.angle(response[:, k])))
            parts.append(
                pd.DataFrame(
                    {"mode": curve.mode, "kstar": curve.kstar, "output": name, "unit": UNITS[name], "omega": w,
                     "magnitude": np.abs(response[:, k]), "phase": phase}
                )
            )  # fmt: skip
    return pd.concat(parts, ignore_index=True)[list(COLUMNS)]


def poles(curves: Sequence[Curve]) -> pd.DataFrame:
    """Every eigenvalue of every curve, 1/s: one row a value.

    Two stand at 0 and say nothing about stability: the shift of the fingers, which is what the
    input drives, and the quantity that the tactile loop keeps.
    """
    rows = [
        {"mode": curve.mode, "kstar": curve.kstar, "real": pole.real, "imag": pole.imag}
        for curve in curves
        for pole in curve.model.poles().tolist()
    ]
    return pd.DataFrame(rows, columns=["mode", "kstar", "real", "imag"])


def growths(poles_: pd.DataFrame) -> pd.DataFrame:
    """Largest real part of the poles without the two nearest to 0, 1/s, of every mode set and gain."""
    rows = []
    for (mode, kstar), group in poles_.groupby(["mode", "kstar"], sort=False):
        real, imag = group["real"].to_numpy(), group["imag"].to_numpy()
        rest = np.argsort(np.hypot(real, imag))[2:]
        rows.append({"mode": mode, "kstar": kstar, "growth": real[rest].max()})
    return pd.DataFrame(rows, columns=["mode", "kstar", "growth"])
