"""What an analysis comes to: where a case is stable, its fastest and slowest modes, and how long steps may be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from crossbody import engines
from crossbody.cases import Case, CrossbodyError
from crossbody.reports.analysis import numbers
from crossbody.reports.analysis.loci import AT_REST
from crossbody.reports.analysis.places import MOVING, Place
from crossbody.reports.analysis.steps import largest_step

Told = Mapping[Any, Any]
COLUMNS = (
    "place", "verdict", "growth", "grows", "slowest", "slow", "fastest", "fast", "step", "limited_by", "own_step",
)  # fmt: skip
STABLE, UNSTABLE, NEUTRAL, MOVES = "stable", "unstable", "neither", "no equilibrium"
NAMED = 3  # places that a sentence names
SAME = 1e-6  # part of a rate by which two count as one


def summary(found: Sequence[Place], case: Case) -> pd.DataFrame:
    """One row a place with a model.

    Returns:
        Columns place; verdict; growth, 1/s, the largest real part, and the state that leads it; moduli, 1/s, of the
        slowest and the fastest mode that move, and what leads them; the largest stable step of semi-implicit Euler,
        s, NaN of what moves, and what limits it; the file's own step, s, where MuJoCo would take such steps of it.
    """
    own, poles = _own_step(case), numbers.poles(found)
    rows = [_row(place, poles[poles["place"] == place.name], own) for place in found if place.model is not None]
    return pd.DataFrame([row for row in rows if row], columns=list(COLUMNS))


def _row(place: Place, poles: pd.DataFrame, own: float) -> dict[str, Any]:
    if not len(poles):
        return {}
    size = poles["frequency"].to_numpy()
    rest = AT_REST * size.max()
    first, fast = int(np.argmax(poles["real"])), int(np.argmax(size))
    slow = int(np.argmin(np.where(size > rest, size, np.inf)))
    growth = float(poles["real"].iloc[first])
    stands = np.isfinite(place.trim.residual) and not place.controlled and place.system.activations is None
    step, limited = largest_step(place) if stands else (np.nan, "")
    one_way = np.asarray(place.system.unilateral)[place.trim.active].any()
    return {
        "place": place.name,
        "verdict": MOVES if place.name.endswith(MOVING) else UNSTABLE if growth > rest
        else NEUTRAL if growth >= -rest else STABLE,
        "growth": growth, "grows": poles["led_by"].iloc[first], "slowest": float(size[slow]),
        "slow": poles["led_by"].iloc[slow], "fastest": float(size[fast]), "fast": poles["led_by"].iloc[fast],
        "step": step, "limited_by": limited,
        "own_step": np.nan if one_way else own,  # contacts of MuJoCo are as soft as its step asks for
    }  # fmt: skip


def _own_step(case: Case) -> float:
    """Return the step of a file that MuJoCo integrates by Euler's method, s; NaN of others."""
    try:
        planned = engines.load("mujoco").planned(case, "as_is") if case.file else {}
    except CrossbodyError:
        return np.nan
    return float(planned["dt"]) if planned.get("integrator") == "EULER" else np.nan


def sentence(label: str, rows: pd.DataFrame, places: int) -> str:
    """Say which operating point is stable or not, how fast its modes are, and how long steps may be."""
    told: Sequence[Told] = rows.to_dict(orient="records")
    if not told:
        return f"{label}: none of {places} operating points has a linear model."
    more = f" {places - len(told)} more without a model." if places > len(told) else ""
    rests = [row for row in told if not row["place"].endswith(MOVING)] or told
    if (moving := len(told) - len(rests)) > 0:
        more = f" {moving} more {'is an instant' if moving == 1 else 'are instants'} of the motion.{more}"
    return f"{_verdict(label, rests)} {_modes(rests)}{_steps(rests)}{more}"


def over(parameter: str, ends: tuple[float, float], limits: pd.DataFrame) -> str:
    """Say where stability is gained or lost over a parameter, in the order of its values.

    Args:
        parameter: its name.
        ends: between which values it was varied.
        limits: as of `loci.limits`.
    """
    if not len(limits):
        return f"Nothing gains or loses its stability over {parameter} = {ends[0]:g} .. {ends[1]:g}."
    sides: dict[tuple[str, str], list[str]] = {}
    for row in limits.to_dict(orient="records"):
        sides.setdefault((f"{row['value']:.6g}", row["unstable"]), []).append(row["place"])
    return " ".join(f"Unstable {side} {parameter} = {value}: {', '.join(who)}." for (value, side), who in sides.items())


def _verdict(label: str, rows: Sequence[Told]) -> str:
    if all(row["verdict"] == MOVES for row in rows):
        return f"{label}: no equilibrium; poles are those of the motion at {len(rows)} of its instants."
    worst = max(rows, key=lambda row: row["growth"])
    ends = {
        UNSTABLE: f"{UNSTABLE}, {worst['grows']} grows at {worst['growth']:.3g} 1/s",
        NEUTRAL: f"neither stable nor unstable, {worst['grows']} stays where it is put or swings on",
        STABLE: f"{STABLE}, what dies out last is {worst['grows']}, at {-worst['growth']:.3g} 1/s",
    }
    if len(rows) == 1:
        return f"{label}, {worst['place']}: {ends[worst['verdict']]}."
    off = [row["place"] for row in rows if row["verdict"] == UNSTABLE]
    names = "; ".join(off[:NAMED]) + ("; ..." if len(off) > NAMED else "")
    many = f"{len(off)} of {len(rows)} operating points are unstable ({names})"
    many = many if off else f"none of {len(rows)} operating points is unstable"
    return f"{label}: {many}; the least stable is {worst['place']}: {ends[worst['verdict']]}."


def _modes(rows: Sequence[Told]) -> str:
    """Say how fast modes move, beside those that stay where they are put."""
    slow, fast = min(rows, key=lambda row: row["slowest"]), max(rows, key=lambda row: row["fastest"])
    if fast["fastest"] == 0.0:
        return "No mode moves"
    last = f"{fast['fastest']:.3g} 1/s ({fast['fast']})"
    if fast["fastest"] <= (1.0 + SAME) * slow["slowest"]:
        return f"All modes that move have {last}"
    return f"The slowest mode that moves has {slow['slowest']:.3g} 1/s ({slow['slow']}), the fastest {last}"


def _steps(rows: Sequence[Told]) -> str:
    """Say up to which step semi-implicit Euler is stable, and whether the file's own is longer."""
    known = [row for row in rows if not np.isnan(row["step"])]
    if not known:
        return "."
    least = min(known, key=lambda row: row["step"])
    where = f" at {least['place']}" if len(rows) > 1 else ""
    if np.isinf(least["step"]):
        return "; semi-implicit Euler (MuJoCo's) adds no instability at any step."
    if least["step"] == 0.0:
        return f"; semi-implicit Euler (MuJoCo's) adds an instability at any step{where}, in {least['limited_by']}."
    text = f"; semi-implicit Euler (MuJoCo's) is stable up to {least['step']:.3g} s, which {least['limited_by']} limits"
    own = [row["own_step"] for row in known if not np.isnan(row["own_step"])]
    longer = [row["own_step"] for row in known if row["own_step"] > row["step"]]
    if longer:
        return f"{text}{where}. Warning: the file's own step of {longer[0]:g} s is longer, and MuJoCo diverges there."
    return f"{text}{where}" + (f"; the file's own step is {own[0]:g} s." if own else ".")
