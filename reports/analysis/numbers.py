"""What an analysis shows of equilibria: trim, poles, ranks, responses, and a map of the workspace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from crossbody.cases import Case, CaseUnsupported
from crossbody.cases.arrays import Floats
from crossbody.reference import delta
from crossbody.reference.delta import scene
from crossbody.reference.delta.loop import characteristic
from crossbody.reference.linear import controllable, modes, observable, poses
from crossbody.reports.analysis.places import Place

EQUILIBRIA = ("place", "outcome", "variable", "value", "shared")
POLES = ("place", "real", "imag", "frequency", "damping", "led_by")
RANKS = ("place", "states", "controllable", "observable", "growth")
REFUSALS = ("place", "why")
COEFFICIENTS = ("place", "axis", "s^2", "s", "1", "coupling")
ALIKE = 1e-6
"""Part of the largest participation by which others are as large: places and speeds take part alike."""
NOTHING = 1e-12
"""Part of the largest number of a kind below which another one is what rounding leaves of zero."""
RESPONSES = ("place", "input", "output", "omega", "magnitude", "phase")


def equilibria(found: Sequence[Place], case: Case) -> pd.DataFrame:
    """One row a variable: positions and rates that are not 0, inputs, multipliers of the active rows.

    What rounding leaves of a 0 is one. Of `shared` multipliers the equations leave open how much each of them bears.
    """
    rows = []
    for place in found:
        t = place.trim
        rates = zip([f"{c.name}'" for c in case.velocities], _plain(t.v), strict=True)
        values = list(zip([c.name for c in case.coordinates], _plain(t.q), strict=True))
        values += [(name, rate) for name, rate in rates if rate]
        values += [(f"u[{i}]", x) for i, x in enumerate(t.u.tolist())]
        about = {"place": place.name, "outcome": t.outcome.value}
        rows += [about | {"variable": name, "value": x, "shared": False} for name, x in values]
        for i, x in zip(t.active.tolist(), _plain(t.lam), strict=True):
            rows.append(about | {"variable": f"lam {case.contacts[i]}", "value": x, "shared": i in t.shared})
    return pd.DataFrame(rows, columns=list(EQUILIBRIA))


def _plain(values: Floats) -> list[float]:
    """Values as they are, but for what rounding leaves of zeros among them."""
    nothing = np.abs(values) <= NOTHING * np.abs(values).max(initial=0.0)
    return [float(x) for x in np.where(nothing, 0.0, values)]


def poles(found: Sequence[Place]) -> pd.DataFrame:
    """One row a pole; `led_by` is the state that takes part in it most, of equals the first."""
    rows = []
    for place in found:
        if place.model is None:
            continue
        m = modes(place.model)
        real, imag = _parts(m.poles)
        m = replace(m, poles=real + 1j * imag)
        for k, (frequency, damping) in enumerate(zip(m.frequency.tolist(), m.damping.tolist(), strict=True)):
            rows.append(
                {"place": place.name, "real": real[k], "imag": imag[k], "frequency": frequency, "damping": damping,
                 "led_by": m.states[_leader(m.participation[:, k])]}
            )  # fmt: skip
    return pd.DataFrame(rows, columns=list(POLES))


def _parts(poles: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Real and imaginary parts, without what rounding leaves of zeros."""
    both = np.stack([poles.real, poles.imag])
    return np.where(np.abs(both) <= NOTHING * np.abs(poles).max(initial=0.0), 0.0, both)


def _leader(participation: Floats) -> int:
    return int(np.argmax(participation >= (1.0 - ALIKE) * participation.max()))


def ranks(found: Sequence[Place]) -> pd.DataFrame:
    """States, those that inputs reach and outputs show, and the largest real part, 1/s: one row a place."""
    rows = []
    for place in found:
        if place.model is None:
            continue
        real, _ = _parts(place.model.poles())
        rows.append(
            {"place": place.name, "states": len(place.model.states), "controllable": controllable(place.model),
             "observable": observable(place.model), "growth": float(real.max(initial=-np.inf))}
        )  # fmt: skip
    return pd.DataFrame(rows, columns=list(RANKS))


def refusals(found: Sequence[Place]) -> pd.DataFrame:
    """Why there is no model: one row a place whose law has none."""
    return pd.DataFrame([(p.name, p.why) for p in found if p.why], columns=list(REFUSALS))


def coefficients(found: Sequence[Place]) -> pd.DataFrame:
    """The characteristic polynomial s^3 + ... of each axis of a controlled delta robot: one row an axis.

    `coupling` is the largest coefficient by which another axis enters, as a part of the axis's own.
    """
    rows = []
    for place in found:
        if not (place.controlled and place.model is not None and len(place.model.states) == 9):
            continue
        c = characteristic(place.model)
        own = np.diagonal(c, axis1=1, axis2=2)
        across = np.abs(c - own[:, None, :] * np.eye(3)).max(axis=2) / np.abs(own)
        for i, axis in enumerate("xyz"):
            row = dict(zip(COEFFICIENTS[2:5], own[:, i].tolist(), strict=True))
            rows.append({"place": place.name, "axis": axis, **row, "coupling": float(across[:, i].max())})
    return pd.DataFrame(rows, columns=list(COEFFICIENTS))


def responses(found: Sequence[Place], omega: ArrayLike) -> pd.DataFrame:
    """Magnitude and phase, degrees, from every input to every output at omega (m,), rad/s."""
    w, parts = np.asarray(omega, dtype=np.float64), []
    for place in found:
        if place.model is None:
            continue
        values = place.model.response(w)
        for j, source in enumerate(place.model.inputs):
            for i, sink in enumerate(place.model.outputs):
                one = values[:, i, j]
                phase = np.degrees(np.unwrap(np.angle(one)))
                row = {"place": place.name, "input": source, "output": sink, "omega": w}
                parts.append(pd.DataFrame({**row, "magnitude": np.abs(one), "phase": phase}))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(RESPONSES))


def workspace(
    case: Case, points: int = 61, depths: tuple[float, float] = (0.30, 0.75), reach: float = 0.30
) -> pd.DataFrame:
    """Open-loop stability of the delta robot over the plane y = 0 of its workspace, held by constant torques.

    Args:
        case: of the delta robot.
        points: of each of the two axes.
        depths: of the flange, m.
        reach: largest |x| of the flange, m.

    Returns:
        Columns x, z, growth (largest real part, 1/s; NaN where the robot does not reach or is
        singular), unstable (number of poles to the right of 0).
    """
    if case.mechanism != "delta":
        raise CaseUnsupported(f"There is a map of the workspace for the delta robot, not for {case.mechanism!r}.")
    robot = scene.robot_of(case.parameters)
    x, z = (
        grid.ravel()
        for grid in np.meshgrid(np.linspace(-reach, reach, points), np.linspace(depths[0], depths[1], points))
    )
    q, there = delta.inverses(robot, np.column_stack([x, 0.0 * x, z]))
    growth, count = np.full(len(x), np.nan), np.zeros(len(x), dtype=int)
    found = poses(delta.system(robot, p=case.number("p")), q[there], [0, 1, 2])
    growth[there] = found.growth
    count[there] = (found.poles.real > 0.0).sum(axis=1)
    return pd.DataFrame({"x": x, "z": z, "growth": growth, "unstable": count})
