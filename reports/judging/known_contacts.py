"""What an engine must make of contacts in closed form: of a damped blow away from every origin, and of a slide to rest.

Two bodies on a line meet where neither is at zero. Their gap obeys h'' + a1 h' + a0 h = 0 from its touch until nothing
presses, a wave that decays, and they part with the restitution that follows. A ball slides on a floor and stops,

    v = v0 - mu g t,    F = mu m g

An engine whose friction is regularised says so by the name of its approximation: pushed with a part r of its bound, it
creeps with a slip s in units of its stiction, s/sqrt(1 + s^2) = r, or s (2 - s) = r, or with none; and where it is
convex, a slide of a speed v leaves the floor with mu v (Castro et al. 2022, Masterjohn et al. 2021: "gliding").
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from crossbody import cases, engines
from crossbody.cases import Case, CaseUnsupported, Mode, Trajectory, Value
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Body, Joint, Pair, RowLaw, Scene, Shape
from crossbody.reports.judging.asked import Found
from crossbody.reports.judging.known_engines import asked_of

GAP, ZETA, A0, MASSES, SPEED = 0.02, 0.3, 4e4, (0.4, 0.3), 1.3
"""Of two bodies that meet: m, damping ratio, 1/s^2, kg, and of the first, m/s."""
EXACT, ROUGH, FINE = 1e-6, 0.03, 300
"""Part of the speed, and of its way, by which an engine may be off: of a law, and at steps of order one; and how many
steps a blow takes."""
MU, MASS, G, RADIUS, FAST, STEP = 0.4, 1.3, 9.81, 0.2, 2.0, 1e-3
"""Of a ball that slides: kg, m/s^2, m, m/s; and of its engine, s."""
STEPS_OFF = 10.0
"""Steps by which a slide may be late."""
SLOW, PART, FEW, LONG = 0.02, 0.6, 5, 100
"""Stiction of an approximation, m/s; part of the bound that pushes; steps of a slide, and of a creep."""
CREEPS = {"sap": 0.0, "lagged": PART / math.sqrt(1.0 - PART**2), "similar": PART / math.sqrt(1.0 - PART**2),
          "tamsi": 1.0 - math.sqrt(1.0 - PART)}  # fmt: skip
GLIDES = ("sap", "similar")
DEAR = ("cvode",)
"""Profiles that import more for friction than a short run does; the truth is held against them where there is some."""
CREPT, GLIDED = 1e-2, 0.1
"""By what creeps, in stictions, and what is below a glide, in mu v, may be off."""


@cache
def wrong(name: str) -> tuple[Found, ...]:
    """Return what, number, least and most, and of what, where an engine's answer is another one.

    Args:
        name: of one of crossbody's own engines, which is installed.
    """
    return asked_of(name, _parts, _slides, _approximates)


def ran(engine: engines.Engine, profile: str, case: Case, **asked: Value) -> tuple[Trajectory, engines.Run] | None:
    """Return a motion with those of the settings that a profile has, and its run; None of what it cannot do."""
    try:
        offered = engine.offered(case, profile)
        run = engine.prepare(case, profile, **{key: value for key, value in asked.items() if key in offered})
        return run.run(), run
    except CaseUnsupported:
        return None


def _beside(name: str, what: str, wanted: dict[str, tuple[float, float, float]]) -> Iterator[Found]:
    for said, (found, must, off) in wanted.items():
        if not abs(found - must) <= off:
            yield f"{name} ({said})", found, (must - off, must + off), what


def _parts(engine: engines.Engine, profile: str) -> Iterator[Found]:
    """Ask for two bodies that meet; of profiles that say that they have the law's constants, or a restitution.

    The law lets go where nothing presses, a spring and a damper at the surface, and a restitution at once.
    """
    fast, slow, touch = math.sqrt(A0), math.sqrt(A0 * (1.0 - ZETA**2)), GAP / SPEED
    lasts = math.acos(2.0 * ZETA**2 - 1.0) / slow
    end = touch + 3.0 * lasts
    case = cases.load(
        "newtons_cradle", "sliders", n=2, masses=",".join(map(str, MASSES)), gap=GAP, zeta=ZETA, a0=A0, speed=SPEED,
        collisions="resolved",
    )  # fmt: skip
    case = replace(case, t_end=end, closed_form=None, claims=(), limits=())
    if (found := ran(engine, profile, case, dt=lasts / FINE)) is None:
        return
    run, prepared = found
    told = prepared.audit().get("constants") or {}
    laws = {"a0": A0, "a1": 2.0 * ZETA * fast, "a2": 0.0}
    law = all(name in told and np.allclose(told[name], value) for name, value in laws.items())
    if "a0" in told and not law:
        yield f"{engine.name}:{profile} (a1)", float(np.max(told["a1"])), (laws["a1"],) * 2, "the constants of a blow"
    if not (law or "restitution" in told):
        return
    until = math.pi / slow if "springs" in prepared.settings else lasts
    keeps = math.exp(-ZETA * fast * until)
    gap = -SPEED * keeps * math.sin(slow * until) / slow if law else 0.0
    rate = SPEED * (keeps if law else math.exp(-ZETA * fast * lasts))
    gap += rate * (end - touch - (until if law else 0.0))
    exact = law and (engine.orders.get(profile, 1.0) > 1.0 or "rtol" in engine.offered(case, profile))
    off, share = (EXACT if exact else ROUGH) * SPEED, MASSES[1] / sum(MASSES)
    middle, along = (1.0 - share) * SPEED, SPEED * touch + (1.0 - share) * SPEED * (end - touch)
    wanted = {
        "v of the first": (float(run.v[-1, 0]), middle - share * rate, off),
        "v of the second": (float(run.v[-1, 1]), middle + (1.0 - share) * rate, off),
        "q of the first": (float(run.q[-1, 0]), along - share * gap, off * end),
        "q of the second": (float(run.q[-1, 1]), along - GAP + (1.0 - share) * gap, off * end),
    }
    touched = next((e.t for e in run.events if e.before == Mode.FREE), math.nan)
    pushed = float(run.lam[:, 0] @ np.gradient(run.t)) + sum(e.impulse for e in run.events)
    blow = share * MASSES[0] * (SPEED + rate)
    kinetic = 0.5 * sum(m * v**2 for m, v in zip(MASSES, run.v[-1].tolist(), strict=True))
    off_gap = float(np.max(np.abs(run.gap[:, 0] - (GAP + run.q[:, 1] - run.q[:, 0]))))
    wanted |= {
        "touch": (touched, touch, (EXACT if exact else ROUGH) * end),
        "impulse": (pushed, blow, ROUGH * blow if until == lasts else math.inf),  # of springs pulls are not recorded
        "energy": (float(run.energy[-1].sum()), kinetic, EXACT * kinetic),
        "gap": (off_gap, 0.0, EXACT * GAP),
    }
    yield from _beside(f"{engine.name}:{profile}", "two bodies that meet and part", wanted)


def _on_a_floor(push: float, fast: float, t_end: float) -> Case:
    """Return a ball that does not turn on a floor, pushed along it by a field, m/s^2, from a speed, m/s."""
    slides = zip("xyz", map(tuple, np.eye(3).tolist()), strict=True)
    floor = Shape(name="floor", type="plane", size=(1.0, 1.0, 1.0))
    rubs = Pair(name="a", first="floor", second="ball", dimension=3, friction=(MU, MU, 0.0, 0.0, 0.0),
                law=RowLaw(a0=1e5, a1=600.0))  # fmt: skip
    scene = Scene(
        bodies=(Body(name="ball", mass=MASS, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)),),
        joints=tuple(Joint(name=name, body="ball", type="slide", axis=way) for name, way in slides),
        shapes=(floor, Shape(name="ball", body="ball", size=(RADIUS, 0.0, 0.0))), pairs=(rubs,),
        gravity=(push, 0.0, -G),
    )  # fmt: skip
    return case_of(scene, name="slides", q0=[0.0, 0.0, RADIUS], v0=[fast, 0.0, 0.0], t_end=t_end)


def _slides(engine: engines.Engine, profile: str) -> Iterator[Found]:
    """Ask for a slide and its stop: speeds, the way, and friction over what presses."""
    stops = FAST / (MU * G)
    if profile in DEAR or (found := ran(engine, profile, _on_a_floor(0.0, FAST, 1.4 * stops), dt=STEP)) is None:
        return
    run, _ = found
    off = STEPS_OFF * STEP / stops if "dt" in engine.offered(_on_a_floor(0.0, FAST, stops), profile) else EXACT
    i = int(np.searchsorted(run.t, 0.5 * stops))
    wanted = {
        "v": (float(run.v[i, 0]) / FAST, 1.0 - float(run.t[i]) / stops, off),
        "v at rest": (float(run.v[-1, 0]), 0.0, off),
        "way": (float(run.q[-1, 0]) / (0.5 * FAST * stops), 1.0, off),
    }  # fmt: skip
    if run.lam[i, 0] != 0.0:  # what is soft may leave the floor there
        share = -float(run.lam[i, 1]) / (MU * float(run.lam[i, 0]))
        wanted |= {"friction": (share, 1.0, off), "mode of a slide": (float(run.mode[i, 0]), float(Mode.SLIP), 0.0)}
    wanted["mode at rest"] = (float(run.mode[-1, 0]), float(Mode.STICK), 0.0)
    wanted["what presses at rest"] = (float(run.lam[-1, 0]) / (MASS * G), 1.0, ROUGH)
    yield from _beside(f"{engine.name}:{profile}", "a ball that slides until it stops", wanted)


def _approximates(engine: engines.Engine, profile: str) -> Iterator[Found]:
    """Ask each approximation of friction for how it creeps, and whether it glides."""
    slide, creep = _on_a_floor(0.0, FAST, FEW * STEP), _on_a_floor(PART * MU * G, 0.0, LONG * STEP)
    try:
        choices = engine.offered(slide, profile)["approximation"].choices
    except (CaseUnsupported, KeyError):
        return
    for choice in map(str, choices):
        runs = [ran(engine, profile, case, approximation=choice, stiction=SLOW, dt=STEP) for case in (slide, creep)]
        glided, crept = (found[0] for found in runs if found is not None)
        size = MU * FAST
        wanted = {
            "creep": (float(crept.v[-1, 0]) / SLOW, CREEPS[choice], CREPT),
            "glides": (float(glided.v[1, 2] > GLIDED * size), float(choice in GLIDES), 0.0),
            "friction of a creep": (-float(crept.lam[-1, 1] / crept.lam[-1, 0]) / MU, PART, CREPT),
        }  # fmt: skip
        yield from _beside(f"{engine.name}:{profile}", f"a ball whose friction is {choice!r}", wanted)
