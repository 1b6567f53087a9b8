"""The reference: the hybrid penalty DAE of the case, by the compiled integrator or by SUNDIALS."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from crossbody.cases import Case, CaseUnsupported, Outcome, Parameter, SceneError, Trajectory, installed
from crossbody.cases.arrays import Floats, is_number
from crossbody.cases.scene import Scene
from crossbody.cases.scene_contacts import frictional
from crossbody.engines import settings as _settings
from crossbody.engines._rolling import determined
from crossbody.engines._scene import masses
from crossbody.engines.contract import Engine, Run
from crossbody.engines.equations import equations_of, has_equations, module
from crossbody.reference import Options, System, prepare
from crossbody.reference.options import COLLISIONS, FSMS, LARGEST_ATOL, MOST_SETS, TOLERANCES
from crossbody.reference.start import NOT_FOUND, OffRowsError

DEPENDENT = 1e6
"""Condition of H M^-1 H^T beyond which rounding parts two engines' multipliers by over 1e-9."""
OF_THE_CASE = "case"
_ROBOT = (
    "IDA works, but factorises 24 unknowns in every step and restarts at every tick of a "
    "controller; CVODE is the independent check on the robot, and simulate(..., solver='ida') runs it."
)
UNSUITED = {("delta", "ida"): _ROBOT, ("soft_delta", "ida"): _ROBOT}
"""(mechanism, solver) -> why it is not run."""
KEPT = "kept"
TRACED = {KEPT: None, "yes": True, "no": False}
"""Which code of a scene's sweeps is taken: compiled for this model before, now if need be; none."""
_ROWS, _STATE = re.compile(r"\b[Rr]ows? \[(\d+(?:, \d+)*)\]"), re.compile(r", q = \[[^]]*\], v = \[[^]]*\]")
LONG = 16  # most numbers of a state that a message shows
ROUNDING = 1e-12  # change of a coordinate that is none
SWITCHES = ("ledger", "shortcuts", "implicit")


def audit(system: System, q0: Floats, v0: Floats) -> dict[str, Any]:
    """Constants, start, and functions at zero input: M (n, n), bias (n,) = -f, H (nc, n), lam (nc,) N, gap (nc,) m.

    Constants and lam are those of rows just entered, with the fast constants where a row has two
    sets. lam has every row active; NaN where the rows are dependent.
    """
    law = np.where(system.beta[:, :1] > 0.0, system.beta, system.alpha)

    def M(q: Floats) -> Floats:
        return system.mass_matrix(q)

    def bias(q: Floats, v: Floats) -> Floats:
        return -system.terms(q, v)[1]

    def H(q: Floats) -> Floats:
        return system.constraint(q)[0]

    def gap(q: Floats) -> Floats:
        return system.gap(q)[0]

    def lam(q: Floats, v: Floats) -> Floats:
        if system.nc > len(v):
            return np.full(system.nc, np.nan)
        mass, f, rows, h, Hdv = (part[0] for part in system.equations_along([0.0], q[None], v[None]))
        a0, a1, a2 = law.T
        inverse = np.linalg.solve(mass, np.column_stack([rows.T, f]))
        push = rows @ inverse[:, -1] + Hdv + a1 * (rows @ v) + a0 * h + a2 * h**3
        G = rows @ inverse[:, :-1]
        # Both bounds of one joint are dependent up to rounding, never exactly; a system without rows has no condition.
        if system.nc and np.linalg.cond(G) > DEPENDENT:
            return np.full(system.nc, np.nan)
        return np.asarray(np.linalg.solve(G, -push))

    constants = dict(zip(("a0", "a1", "a2"), law.T, strict=True))
    return {"constants": constants, "q0": q0, "v0": v0, "M": M, "bias": bias, "H": H, "lam": lam, "gap": gap}


def listed(scene: Scene) -> dict[str, Any]:
    """Return masses, kg, and gravity, m/s^2, of a scene."""
    return {"masses": masses(scene), "gravity": float(np.linalg.norm(scene.gravity))}


@dataclass(slots=True, kw_only=True)
class ReferenceRun(Run):
    """One prepared run; see `crossbody.engines.Run`.

    Attributes:
        system: the mechanism with the law of its rows.
        inner: the prepared run of the solver.
    """

    case: Case
    system: System
    inner: Any
    profile: str
    settings: Mapping[str, Any]
    engine: str = "reference"

    def run(self) -> Trajectory:
        """Integrate from the start, and see whether the motion stays within what the model covers."""
        return within_the_model(self.case, self.motion()) if self.case.file else self.motion()

    def motion(self) -> Trajectory:
        """Integrate from the start, whatever shapes meet that have no rows."""
        trajectory: Trajectory = self.inner.trajectory(*self.inner.go())
        if not trajectory.outcome.ok:
            trajectory = replace(trajectory, message=by_name(trajectory.message, self.case.contacts))
        scene = self.case.scene if self.case.general else None
        return trajectory if scene is None else determined(scene, trajectory)

    def audit(self) -> Mapping[str, Any]:
        """The physics as the kernels return it."""
        own = audit(self.system, self.case.q0, self.case.v0)
        if self.case.general and self.case.scene is not None:
            return own | listed(self.case.scene)
        told = getattr(module(self.case.mechanism), "listed", None)
        return own | (told(self.system.p) if told else {})


def by_name(message: str, contacts: Sequence[str]) -> str:
    """Return a message with the names of contacts for the numbers of rows, and without a long state.

    Args:
        message: of a run of the reference, which knows rows by number, with the state at its end.
        contacts: names of the rows.
    """

    def named(found: re.Match[str]) -> str:
        rows = [int(text) for text in found[1].split(",")]
        return found[0] if max(rows) >= len(contacts) else f"{found[0]} ({', '.join(contacts[i] for i in rows)})"

    state = _STATE.search(message)
    if state is not None and state[0].count(",") > LONG:
        message = message.replace(state[0], "; its state is the last of the motion")
    return _ROWS.sub(named, message)


def within_the_model(case: Case, run: Trajectory) -> Trajectory:
    """Return the run, or one that is inconsistent where shapes of the file meet whose contacts no row stands for.

    However it ends: what came behind such a meeting is no motion of the file's.
    """
    from crossbody.cases.files.contacts import meeting

    finite = np.isfinite(run.q).all(axis=1) & np.isfinite(run.v).all(axis=1)
    found = meeting(case, run.t[finite], run.q[finite], run.v[finite])
    return replace(run, outcome=Outcome.INCONSISTENT, message=found.told) if found else run


class Reference(Engine):
    """The project's own integrators; see `crossbody.engines.Engine`.

    A mechanism is a module in reference/systems with `build(parameters, law) -> System`, or a
    file of the user's own by its path (ends in .py) with `system(parameters, law) -> System`,
    which may be the case's own file. It may have `listed(p)`, what the parity audit lists, and
    `check_start(parameters, q0, v0)`, which raises SceneError.
    """

    name = "reference"
    profiles: Mapping[str, str] = {
        "compiled": "compiled Runge-Kutta of order 8 with events on its dense output, implicit where the law is stiff",
        "ida": "the DAE in (q, v, lam) by SUNDIALS IDA",
        "cvode": "the reduced equations in (q, v) by SUNDIALS CVODE",
    }
    versions: Mapping[str, str] = {name: installed.version(name) for name in ("numba", "numpy", "scikit-sundae")}
    orders: Mapping[str, float] = dict.fromkeys(profiles, 1.0)

    def why_not(self, case: Case, profile: str) -> str | None:
        """Mechanisms without equations here, and collision rules that the reference does not know."""
        _settings.check_case(case)
        solver = _settings.profile_of(self.name, self.profiles, profile)
        if (case.mechanism, solver) in UNSUITED:
            return UNSUITED[case.mechanism, solver]
        if not has_equations(case):
            return f"The reference has no equations of the mechanism {case.mechanism!r}."
        if case.collisions not in COLLISIONS:
            return (
                f"The reference has no rule {case.collisions!r} for several contacts; it has: {', '.join(COLLISIONS)}."
            )
        return frictional(case.scene) if solver == "ida" and case.general and case.scene is not None else None

    def prepare(self, case: Case, profile: str = _settings.MATCHED, **settings: Any) -> ReferenceRun:
        """Build the mechanism of a case and everything that does not depend on time.

        Args:
            case: the scene.
            profile: one of `profiles`.
            settings: rtol, atol, ledger, samples, fsm, max_steps, time_limit; shortcuts and
                implicit of `compiled`, and of a scene in it most_sets and traced, "kept", "yes" or "no"; index
                of `ida`. `samples` is a number of equidistant rows, or their times.

        Raises:
            UnknownName: for a profile or setting that does not exist.
            CaseUnsupported: for a mechanism or a collision rule that is not there.
            InvalidValue: for a setting outside its range.
            SceneError: for a kernel that is wrong, or a start off the rows that are always on
                (`Case.consistent`).
        """
        solver, used, options = self._chosen(case, profile, settings)
        system = equations_of(case, TRACED[str(used.get("traced", KEPT))])
        if (check := getattr(module(case.mechanism), "check_start", None)) is not None:
            check(case.parameters, case.q0, case.v0)
        try:
            inner = prepare(system, case.q0, case.v0, options)
        except OffRowsError as error:
            raise SceneError(_off(case, error)) if case.file else error from None
        inner.warm()
        return ReferenceRun(case=case, system=system, inner=inner, profile=solver, settings=_provenance(used, options))

    def planned(self, case: Case, profile: str = _settings.MATCHED, **settings: Any) -> Mapping[str, Any]:
        """Return the settings that a run would have: nothing is built or compiled for that."""
        _, used, options = self._chosen(case, profile, settings)
        return _provenance(used, options)

    def _chosen(self, case: Case, profile: str, settings: Mapping[str, Any]) -> tuple[str, dict[str, Any], Options]:
        """Return profile, settings by name, and the solver's options."""
        if (reason := self.why_not(case, profile)) is not None:
            raise CaseUnsupported(reason)
        solver = _settings.profile_of(self.name, self.profiles, profile)
        times = {k: v for k, v in settings.items() if k == "samples" and not (v is None or is_number(v))}
        numbers = {k: v for k, v in settings.items() if k not in times}
        used = dict(_settings.chosen(self.name, solver, _known(case, solver), numbers))
        return solver, used, _options(case, solver, {k: v for k, v in {**used, **times}.items() if k != "traced"})


def _known(case: Case, solver: str) -> dict[str, Parameter]:
    low, high = TOLERANCES
    known = {
        "rtol": Parameter(default=1e-9, doc="relative tolerance", low=low, high=high),
        "atol": Parameter(default=0.0, doc="absolute tolerance; 0 for rtol/1000", low=0.0, high=LARGEST_ATOL),
        "ledger": Parameter(default=True, doc="keep the energy account", low=0, high=1),
        "samples": Parameter(default=0, doc="number of equidistant rows; 0 for every step", low=0, high=1e8),
        "fsm": Parameter(default=OF_THE_CASE, doc="state machine", choices=(OF_THE_CASE, *FSMS)),
        "max_steps": Parameter(default=1_000_000, doc="bound on the number of steps", low=1, high=1e12),
        "time_limit": Parameter(default=3600.0, unit="s", doc="bound on processor time", low=0.0, open_low=True),
    }
    if solver == "compiled":
        known["shortcuts"] = Parameter(default=True, doc="closed-form arcs if the scene is affine", low=0, high=1)
        known["implicit"] = Parameter(default=True, doc="the implicit method if the law is stiff", low=0, high=1)
    if solver == "compiled" and case.general:
        sets = "sets of modes of which all are tried to see whether a second motion keeps the law"
        known["most_sets"] = Parameter(default=64, doc=sets, low=MOST_SETS[0], high=MOST_SETS[1])
        known["traced"] = Parameter(default=KEPT, doc="code compiled only for this model", choices=tuple(TRACED))
    if solver == "ida":
        known["index"] = Parameter(default=1, doc="1, or 3 for bilateral rows", low=1, high=3)
    return known


def _off(case: Case, error: OffRowsError) -> str:
    """Return what is wrong with the start of a file and what its user can do, in the file's names."""
    advice = NOT_FOUND
    if error.near is not None:
        kind, moved, named = "", np.abs(error.near[0] - case.q0), case.coordinates
        if moved.max() < ROUNDING:
            kind, moved, named = "the velocity ", np.abs(error.near[1] - case.v0), case.velocities
        most = int(np.argmax(moved))
        advice = (
            "--set assemble=1 starts in every engine at the nearest that is on them, which changes "
            f"{kind}{named[most].name!r} by {moved[most]:.3g} and no other further."
        )
    return (
        f"{case.label}: the start is off {case.contacts[error.row]!r}, which is always on: {error.off}. "
        f"{advice} --without loops leaves such rows out of every engine."
    )


def _options(case: Case, solver: str, used: Mapping[str, Any]) -> Options:
    """The settings in the words of `simulate`."""
    given: dict[str, Any] = {name: bool(value) if name in SWITCHES else value for name, value in used.items()}
    given["atol"] = given["atol"] or None
    if is_number(given["samples"]):
        count = given["samples"]
        given["samples"] = np.linspace(0.0, case.t_end, count) if count else None
    if given["fsm"] == OF_THE_CASE:
        given["fsm"] = case.fsm
    given["inputs"] = None if case.inputs is None else (case.inputs.times, case.inputs.values)
    return Options(
        t_end=case.t_end, solver=solver, collisions=case.collisions, consistent=case.consistent, **given
    )  # fmt: skip


def _provenance(used: Mapping[str, Any], options: Options) -> dict[str, Any]:
    """What was really used."""
    switches = {name: getattr(options, name) for name in SWITCHES if name in used}
    settled = {"atol": options.tolerance, "fsm": options.fsm, "collisions": options.collisions}
    return {**used, **switches, **settled, "samples": 0 if options.samples is None else np.size(options.samples)}


ENGINE = Reference()
