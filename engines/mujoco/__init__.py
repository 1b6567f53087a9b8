"""MuJoCo: soft contacts with default constants, or matched to the case's law."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import mujoco
import numpy as np

from crossbody.cases import Case, CaseUnsupported, CrossbodyError, Parameter, Trajectory
from crossbody.cases.files.warned import captured
from crossbody.engines import settings as _settings
from crossbody.engines._formed import FormedRun, form_of, linearised, on_scene, why_no_form
from crossbody.engines.contract import Engine, Run
from crossbody.engines.linear import Spot, Tangent
from crossbody.engines.mujoco import _model
from crossbody.engines.mujoco._march import March, Tape
from crossbody.engines.mujoco._scene import Prepared, hooked


@dataclass(slots=True, kw_only=True)
class MujocoRun(Run):
    """One prepared run; see `crossbody.engines.Run`."""

    case: Case
    scene: Prepared
    profile: str
    settings: Mapping[str, Any]
    said: tuple[str, ...]
    follows: Case | None = None
    rounded: str = ""
    engine: str = "mujoco"

    def run(self) -> Trajectory:
        """Integrate from the start.

        Forces are memoryless, lam = max(0, law) wherever a gap is closed, unless the scene says otherwise.
        """
        case, scene = self.case, self.scene
        dt, limit = float(self.settings["dt"]), int(self.settings["max_steps"])
        tape = Tape(scene.model, scene.data, min(limit, int(1.1 * case.t_end / dt) + 64, 1_000_000))
        tape.follows = scene.follows
        march = March(scene, tape, dt, limit)
        with captured() as warned, hooked(scene.hook):
            start = perf_counter()
            march.run(case.t_end)
            wall = perf_counter() - start
        heard = (f"MuJoCo warned: {w.strip()}" for w in dict.fromkeys((*self.said, *warned)))
        message = " ".join(w for w in (march.message, self.rounded, *heard) if w)
        counts = {"located": march.trials}
        tape.switches += scene.switches
        with captured():  # gaps are looked at with the same model, and have no more to say
            found = tape.trajectory(scene.observe, march.outcome, message, march.steps, wall, counts)
        return found if scene.acting is None else scene.acting.told(found)

    def native(self) -> float:
        """Time in which MuJoCo's own loop makes the same steps, s.

        Without a record, events, and what of the law is Python.
        """
        scene, dt = self.scene, float(self.settings["dt"])
        with captured(), hooked(None):
            scene.start()
            scene.model.opt.timestep = dt
            start = perf_counter()
            mujoco.mj_step(scene.model, scene.data, nstep=round(self.case.t_end / dt))
            return perf_counter() - start

    def audit(self) -> Mapping[str, Any]:
        """The physics read back from the compiled model."""
        return self.scene.audit


class Mujoco(Engine):
    """MuJoCo 4; see `crossbody.engines.Engine`."""

    name = "mujoco"
    profiles: Mapping[str, str] = {
        "matched": "the case's own law, regularisation removed, Runge-Kutta 4 with located events",
        "default": "the obvious model: MuJoCo's default contact constants, integrator (Euler) and step (2 ms)",
        "as_is": "an unchanged robot file: its own step, integrator, solref, solimp and cone",
    }
    of_scenes: Mapping[str, str] = {"default": "as_is"}
    versions: Mapping[str, str] = {"mujoco": mujoco.__version__}
    orders: Mapping[str, float] = {"matched": 4.0, "default": 1.0, "as_is": 1.0}
    steps: Mapping[str, float] = {"default": 1.0, "as_is": math.inf}
    interpreted: Mapping[str, str] = {
        "matched": (
            "the loop over steps, the record, the search for events, the part of the law that solref cannot express"
        ),
        "default": "the loop over steps, the record",
        "as_is": "the loop over steps, the record",
    }
    hidden: Mapping[str, Mapping[str, str]] = {
        "*": {"ledger": "MuJoCo's steps keep no account of the work of its forces."},
        "default": {"H": "The contacts of the obvious model are pairs of shapes with their own frames."},
        "as_is": {"H": "The contacts of the file are pairs of shapes with their own frames."},
    }

    def why_not(self, case: Case, profile: str) -> str | None:
        """Only scenes can be run; which of them, each profile says."""
        _settings.check_case(case)
        _settings.profile_of(self.name, self.profiles, profile)
        if (refused := why_no_form(case)) is not None:
            return refused
        case = on_scene(case)
        if profile == "as_is" and case.scene is None:
            return f"The profile as_is runs unchanged robot files, and {case.name} is not one; use the profile default."
        if case.scene is None:
            return f"MuJoCo has no model of the mechanism {case.mechanism!r}; it has: scene."
        return _model.why_not(case, profile)

    def prepare(self, case: Case, profile: str = "matched", **settings: Any) -> Run:
        """Compile the model of a case; see `Engine.prepare`.

        Settings: dt, time step, s; max_steps, bound on their number; reader, of a file as it stands: "file",
        or "scene" for the model that is built from the scene, with the file's options and softness.
        """
        if (reason := self.why_not(case, profile)) is not None:
            raise CaseUnsupported(reason)
        if (form := form_of(case)) is not None:
            return FormedRun(form=form, inner=self.prepare(form.case, profile, **settings))
        with captured(), _refused(case):
            known = _known(case, _model.default_step(case, profile))
        known |= _model.settings(case, profile)
        used = _settings.chosen(self.name, profile, known, settings)
        dt, rounded = _dividing(case, float(used["dt"])) if "dt" in used else (0.0, "")
        used = used | ({"dt": dt} if rounded else {})
        own = profile == "matched" and "dt" not in settings  # nobody's step was changed
        with captured() as said, _refused(case):
            more: dict[str, Any] = {name: value for name, value in used.items() if name not in ("dt", "max_steps")}
            scene = _model.build(case, profile, float(used["dt"]), **more)
        return MujocoRun(
            case=case, scene=scene, profile=profile, settings=used | _options(scene, profile), said=tuple(said),
            follows=_model.followed(case, profile), rounded="" if own else rounded,
        )  # fmt: skip

    def linearise(self, case: Case, spot: Spot) -> tuple[Tangent, ...]:
        """The matched profile's derivatives of v' at an equilibrium, by each way that there is."""
        from crossbody.engines.mujoco._linear import linearise

        if (reason := self.why_not(case, "matched")) is not None:
            raise CaseUnsupported(reason)
        if case.form is not None:
            return linearised(case, spot, self.linearise)
        return linearise(case, spot)


@contextmanager
def _refused(case: Case) -> Iterator[None]:
    """Say in MuJoCo's words what it does not like of a model."""
    try:
        yield
    except CrossbodyError:
        raise  # ours, and it is a ValueError too
    except ValueError as error:
        raise CaseUnsupported(f"MuJoCo refuses the model of {case.label}: {error}.") from None


def _dividing(case: Case, dt: float) -> tuple[float, str]:
    """Return the largest step, s, up to dt with which equal steps meet every tick, and a sentence if it is not dt.

    As in a user's own loop, which calls its controller between two steps.
    """
    if case.control is None:
        return dt, ""
    tick = case.control.tick
    step = tick / math.ceil(tick / dt * (1.0 - 1e-9))
    if abs(step - dt) <= 1e-9 * dt:
        return dt, ""
    return step, f"The step is {step:g} s and not {dt:g} s, which does not divide the controller's tick of {tick:g} s."


def _known(case: Case, step: float) -> dict[str, Parameter]:
    return {
        "dt": Parameter(default=min(step, case.t_end), unit="s", doc="time step", low=0.0, open_low=True),
        "max_steps": Parameter(default=2_000_000, doc="bound on the number of steps", low=1, high=1e9),
    }


SOFT = ("geom_sol{}", "pair_sol{}", "jnt_sol{}", "eq_sol{}", "tendon_sol{}_lim", "dof_sol{}", "tendon_sol{}_fri")
"""Where a model says how soft rows are: what touches, is bounded or held, and what rubs."""


def _softness(model: Any) -> dict[str, str]:
    """Return what rows of the obvious model follow, each law once: where it changes, stored runs are of another."""
    kinds = {"solref": "ref", "solimp": "imp"}
    found = {
        name: sorted(set(map(tuple, np.concatenate([getattr(model, of.format(kind)) for of in SOFT]).round(9) + 0.0)))
        for name, kind in kinds.items()
    }
    return {name: ",".join("/".join(f"{x:.6g}" for x in row) for row in rows) for name, rows in found.items()}


def _options(scene: Prepared, profile: str) -> dict[str, Any]:
    """What the model says about how it is solved, for provenance."""
    opt = scene.model.opt
    soft = _softness(scene.model) if profile == "default" else {}
    return soft | {
        "integrator": mujoco.mjtIntegrator(opt.integrator).name.removeprefix("mjINT_"),
        "solver": mujoco.mjtSolver(opt.solver).name.removeprefix("mjSOL_"),
        "located_events": scene.arm is not None,
        "law": scene.machine,
    }


ENGINE = Mujoco()
