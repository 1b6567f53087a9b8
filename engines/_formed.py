"""Runs of a case on a scene with coordinates of its own: what the engine found there, told in the case's."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from crossbody.cases import Case, CaseUnsupported, Inputs, Mode, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.form import Form
from crossbody.engines._scene import places
from crossbody.engines.contract import Run
from crossbody.engines.equations import module
from crossbody.engines.linear import Chart, Spot, Tangent

WIDER = "Joints of the engine replace rows of the case, so it has fewer coordinates."


def form_of(case: Case, powered: bool = True, steady: bool = False) -> Form | None:
    """Return the form of a case, if it has one; without servos that are not powered, or a sampled controller."""
    if case.form is None:
        return None
    if (check := getattr(module(case.mechanism), "check_start", None)) is not None:
        check(case.parameters, case.q0, case.v0)
    return case.form(case, powered, steady)


def why_no_form(case: Case) -> str | None:
    """Return why engines cannot build a case; None if they may."""
    try:
        form_of(case)
    except CaseUnsupported as error:
        return str(error)
    return None


def on_scene(case: Case) -> Case:
    """Return the case that engines build: that of its form, or itself."""
    form = form_of(case)
    return case if form is None else form.case


@dataclass(kw_only=True)
class FormedRun(Run):
    """A prepared run of a form, by the run of its scene; see `crossbody.engines.Run`."""

    form: Form
    inner: Run

    def __post_init__(self) -> None:
        """Take over what names the run."""
        self.engine, self.profile, self.settings = self.inner.engine, self.inner.profile, self.inner.settings
        force, scene = self.form.case.force, self.form.case.scene
        assert scene is not None
        self.scene, self.states = scene, force.states if force is not None else ()

    def run(self) -> Trajectory:
        """Integrate from the start."""
        found, form, rows = self.inner.run(), self.form, list(self.form.rows)
        with np.errstate(all="ignore"):  # a run that failed may end where squares overflow
            q, v = form.to_case(found.q, found.v)
        found = replace(found, q=q, v=v, energy=self._of_bodies(found), inputs=None, control_s=0.0)
        if rows == list(range(found.gap.shape[1])):
            return found
        n = len(found.t)
        parts: tuple[tuple[Any, Any], ...] = (
            (found.gap, np.zeros(n)), (found.lam, np.full(n, np.nan)),
            (found.mode, np.full(n, int(Mode.BILATERAL), np.int8)),
        )  # fmt: skip
        gap, lam, mode = (
            np.column_stack([given[:, k] if k >= 0 else none for k in rows]) for given, none in parts
        )  # fmt: skip
        numbers = {k: i for i, k in enumerate(rows)}
        events = tuple(replace(event, contact=numbers[event.contact]) for event in found.events)
        return replace(found, gap=gap, lam=lam, mode=mode, events=events)

    def _of_bodies(self, found: Trajectory) -> Floats:
        """Return the energies (n, 2) without those of what carries states."""
        place = places(self.scene)[1]
        states = [place[joint.name] for joint in self.scene.joints if joint.body in self.states]
        energy, rates = found.energy.copy(), found.v[:, states]
        energy[:, 0] -= 0.5 * np.sum(rates * rates, axis=1)
        return energy

    def native(self) -> float:
        """Return the time of the engine's own loop, s."""
        return self.inner.native()

    def audit(self) -> Mapping[str, Any]:
        """The physics of the engine's model in the case's coordinates."""
        found, form = dict(self.inner.audit()), self.form
        start = form.to_case(np.atleast_2d(found["q0"]), np.atleast_2d(found["v0"]))
        found |= {"q0": start[0][0], "v0": start[1][0]}
        moved = dict.fromkeys(joint.body for joint in self.scene.joints)
        found["masses"] = np.delete(found["masses"], [i for i, name in enumerate(moved) if name in self.states])
        if len(start[1][0]) == len(form.case.v0):
            return found | _in_case(form, found)
        terms = ("M", "bias", "H", "lam", "constants")
        kept = {name: value for name, value in found.items() if name not in terms}
        return kept | {"constants": {}, "hidden": {**found.get("hidden", {}), **dict.fromkeys(terms, WIDER)}}


def _in_case(form: Form, found: Mapping[str, Any]) -> dict[str, Any]:
    """Return M, bias, H and lam as functions of the case's states: M v' + bias = H^T lam, v = J r'."""

    def at(q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        r, rd = (part[0] for part in form.to_scene(q[None], v[None]))
        S: Floats = np.linalg.inv(form.rate_matrix(r)).astype(np.float64)
        return r, rd, S

    def M(q: Floats) -> Floats:
        r, _, S = at(q, np.zeros(len(q)))
        mass: Floats = S.T @ found["M"](r) @ S
        return mass

    def bias(q: Floats, v: Floats) -> Floats:
        r, rd, S = at(q, v)
        total: Floats = S.T @ found["bias"](r, rd)
        return total if form.bend is None else total - M(q) @ form.bend(r, rd)

    def H(q: Floats) -> Floats:
        r, _, S = at(q, np.zeros(len(q)))
        rows: Floats = found["H"](r)[list(form.rows)] @ S
        return rows

    def lam(q: Floats, v: Floats) -> Floats:
        r, rd, _ = at(q, v)
        multipliers: Floats = found["lam"](r, rd)[list(form.rows)]
        return multipliers

    own: dict[str, Callable[..., Floats]] = {"M": M, "bias": bias, "H": H, "lam": lam}
    return {name: function for name, function in own.items() if name in found}


def linearised(
    case: Case, spot: Spot, linearise: Callable[[Case, Spot], tuple[Tangent, ...]]
) -> tuple[Tangent, ...]:  # fmt: skip
    """Return what an engine makes of an equilibrium of a form, in the case's coordinates."""
    if len(spot.u):
        names = tuple(f"u[{i}]" for i in range(len(spot.u))) if case.inputs is None else case.inputs.names
        case = replace(case, inputs=Inputs(names=names, times=np.zeros(1), values=spot.u[None]))
    form = form_of(case, spot.powered, steady=True)
    assert form is not None
    q, v = (part[0] for part in form.to_scene(spot.q[None], spot.v[None]))
    T = form.rate_matrix(q)
    chart = Chart(T=T, S=np.linalg.pinv(T).astype(np.float64))
    rows = tuple(form.rows[i] for i in spot.rows)
    return tuple(chart.tangent(way) for way in linearise(form.case, replace(spot, q=q, v=v, rows=rows)))
