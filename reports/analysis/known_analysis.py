"""What an analysis must say of linear models in closed form, and of a weight on a spring.

A mass m on a spring k with a damper c, pushed by a motor, has the poles of s^2 + (c/m) s + k/m and the response

    1 / (k - m w^2 + i c w)

from its force to its place, and hangs by m g / k below where the spring rests. So matrices, poles, ranks, responses,
loci, and what is said of an engine's own linear model, have answers that are written out here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd

from crossbody import cases, engines
from crossbody.cases.arrays import Floats
from crossbody.cases.files.case import case_of
from crossbody.cases.scene import Actuator, Body, Joint, Pair, RowLaw, Scene, Shape
from crossbody.engines.linear import Tangent
from crossbody.reference.linear import LinearModel
from crossbody.reports.analysis import bode, numbers
from crossbody.reports.analysis.counterparts import compared, counterparts
from crossbody.reports.analysis.loci import limits, root_locus
from crossbody.reports.analysis.places import MOVING, Place, places
from crossbody.reports.analysis.steps import largest_step
from crossbody.reports.analysis.summary import MOVES, NEUTRAL, STABLE, UNSTABLE, summary
from crossbody.reports.judging.asked import Asked, Found, unlike_by
from crossbody.reports.judging.verdict import Word

MASS, SPRING, DRAG, GRAVITY, GEAR, LAG = 1.5, 60.0, 3.0, 9.81, 0.7, 0.2
"""Of a weight on a spring, SI."""
EXACT, SOLVED, SEARCHED = 1e-9, 1e-7, 1e-5
"""Part of a number by which sums in another order differ, to which equations are solved and differentiated, and to
which steps are searched for."""
LAW, MU, SPEED = RowLaw(a0=100.0, a1=30.0), 0.5, 2.0
"""Of a ball on a floor; its speed where it slides, m/s."""
OMEGA = np.array([0.1, 3.0, 6.2, 6.5, 40.0, 900.0])


@cache
def wrong() -> tuple[Found, ...]:
    """Return which number, as it is, least and most, and of what, where it is another one."""
    models = (_weight, _responses, _ranks, _poles, _words, _loci, _curves)
    scenes = (_engines, _ball, _chain, _filtered, _stuck, _slid)
    return unlike_by((*models, *scenes), "analysis", "a model that ends in", SOLVED, 1e-3)


def _rows(table: pd.DataFrame) -> list[dict[Any, Any]]:
    return table.to_dict(orient="records")


@cache
def _hanging() -> Place:
    """Return the equilibrium of the weight."""
    made = Scene(
        bodies=(Body(name="weight", mass=MASS, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)),),
        joints=(Joint(name="z", body="weight", type="slide", stiffness=(SPRING, 0.0, 0.0), damping=(DRAG, 0.0, 0.0)),),
        actuators=(Actuator(name="motor", joint="z", gear=(GEAR,)),), gravity=(0.0, 0.0, -GRAVITY),
    )  # fmt: skip
    (place,) = places(case_of(made, name="made_up", q0=[-MASS * GRAVITY / SPRING], t_end=0.01))
    return place


def _weight() -> Iterator[Asked]:
    """Yield where the weight hangs, the matrices there, and its poles."""
    place = _hanging()
    rows = {row["variable"]: row["value"] for row in _rows(numbers.equilibria([place], place.case))}
    yield "equilibrium", "a weight on a spring", rows["z"], -MASS * GRAVITY / SPRING
    full = place.linearised(reduce=False)
    wanted = {"A": [[0.0, 1.0], [-SPRING / MASS, -DRAG / MASS]], "B": [[0.0], [GEAR / MASS]]}
    for name, matrix in wanted.items():
        for one, must in zip(np.ravel(getattr(full, name)).tolist(), np.ravel(matrix).tolist(), strict=True):
            yield name, "a weight on a spring", one, must
    drag, stiffness = DRAG / MASS, SPRING / MASS  # v+ = v - h (k x + c v)/(1 + h c), x+ = x + h v+
    yield from _step(place, (drag + math.sqrt(drag**2 + 4.0 * stiffness)) / stiffness, "a weight on a spring")
    decay, size = DRAG / (2.0 * MASS), math.sqrt(SPRING / MASS)
    for row, sign in zip(_rows(numbers.poles([place])), (1.0, -1.0), strict=True):
        told = {
            "real": -decay,
            "imag": sign * math.sqrt(size**2 - decay**2),
            "frequency": size,
            "damping": decay / size,
        }
        for name, must in told.items():
            yield name, "a weight on a spring", row[name], must


def _step(place: Place, wanted: float, what: str) -> Iterator[Asked]:
    """Yield 1 if the largest stable step is found as far as it is searched for, else 0."""
    yield "step", what, float(abs(largest_step(place)[0] / wanted - 1.0) <= SEARCHED), 1.0


def _model(damping: float = DRAG / MASS, stiffness: float = SPRING / MASS) -> LinearModel:
    return LinearModel(
        A=np.array([[0.0, 1.0], [-stiffness, -damping]]), B=np.array([[0.0], [1.0]]), C=np.eye(2),
        D=np.array([[0.0], [0.25]]), states=("x", "x'"), inputs=("f",), outputs=("x", "x'"),
    )  # fmt: skip


def _place(model: LinearModel, name: str = "made up") -> Any:
    return SimpleNamespace(name=name, model=model, why="", controlled=False)


def _closed(w: Floats) -> tuple[Any, Any]:
    """Return the responses of place and speed, the latter with what passes by."""
    x = 1.0 / (SPRING / MASS - w**2 + 1j * DRAG / MASS * w)
    return x, 1j * w * x + 0.25


def _responses() -> Iterator[Asked]:
    rows = numbers.responses([_place(_model())], OMEGA)
    for output, wanted in zip(("x", "x'"), _closed(OMEGA), strict=True):
        own = rows[rows["output"] == output]
        phase = np.degrees(np.unwrap(np.angle(wanted)))
        for k, w in enumerate(OMEGA):
            yield "magnitude", f"{output} at {w:g} rad/s", float(own["magnitude"].iloc[k]), float(abs(wanted[k]))
            yield "phase", f"{output} at {w:g} rad/s", float(own["phase"].iloc[k]), float(phase[k])
            yield "omega", f"{output} at {w:g} rad/s", float(own["omega"].iloc[k]), float(w)


def _ranks() -> Iterator[Asked]:
    """Yield ranks of a model of which one state is not reached, and two are not shown."""
    model = LinearModel(
        A=np.diag([-1.0, -2.0, -0.5]), B=np.array([[1.0], [1.0], [0.0]]), C=np.array([[1.0, 0.0, 0.0]]),
        D=np.zeros((1, 1)), states=("a", "b", "c"), inputs=("u",), outputs=("y",),
    )  # fmt: skip
    (row,) = _rows(numbers.ranks([_place(model)]))
    told = {"states": 3.0, "controllable": 2.0, "observable": 1.0, "growth": -0.5}
    for name, must in told.items():
        yield name, "a diagonal model", float(row[name]), must
    led = numbers.poles([_place(model)])["led_by"].tolist()
    yield "led_by", "a diagonal model", float(led == ["c", "a", "b"]), 1.0


def _poles() -> Iterator[Asked]:
    """Yield poles of a mode set, and the largest real part without the two nearest to 0."""
    model = LinearModel(
        A=np.diag([1e-9, -1e-8, -3.0, -0.2]), B=np.zeros((4, 1)), C=np.zeros((1, 4)), D=np.zeros((1, 1)),
        states=tuple("abcd"), inputs=("u",), outputs=("y",),
    )  # fmt: skip
    found = bode.poles([bode.Curve(mode="grasp", kstar=5.0, model=model)])
    yield "poles", "a diagonal model", float(len(found)), 4.0
    yield "growth", "a diagonal model with two poles at rest", float(bode.growths(found)["growth"].iloc[0]), -0.2
    for damping in (0.6, -0.6):
        for row in _rows(numbers.poles([_place(_model(damping=damping, stiffness=9.0))])):
            yield "real", f"a damping of {damping:g} 1/s", row["real"], -0.5 * damping
            yield "damping", f"a damping of {damping:g} 1/s", row["damping"], damping / 6.0


@dataclass
class _Family:
    """Models whose damping is 0.8 less the parameter: they lose their stability there."""

    parameter: str = "gain"

    def places(self, value: float) -> tuple[Any, ...]:
        """Return one place."""
        return (_place(_model(damping=0.8 - value, stiffness=9.0)),)

    def model(self, _k: int, value: float) -> LinearModel:
        """Return its model."""
        found: LinearModel = self.places(value)[0].model
        return found


def _loci() -> Iterator[Asked]:
    values = np.linspace(0.0, 2.0, 6).tolist()
    family: Any = _Family()
    (row,) = _rows(limits(family, values))
    yield "limit", "a damping that a gain takes away", row["value"], 0.8
    yield "frequency", "a damping that a gain takes away", row["frequency"], 3.0
    yield "unstable", "a damping that a gain takes away", float(row["unstable"] == "above"), 1.0
    for one in _rows(root_locus(family, values)):
        half = 0.5 * (0.8 - one["value"])
        yield "real", f"a branch at {one['value']:g}", one["real"], -half
        yield "imag", f"a branch at {one['value']:g}", abs(one["imag"]), math.sqrt(9.0 - half**2)


def _curves() -> Iterator[Asked]:
    """Yield magnitudes and phases of the curves of a figure, of both outputs in their order."""
    rows = bode.table([bode.Curve(mode="grasp", kstar=5.0, model=_model())], OMEGA)
    for output, wanted in zip(bode.OUTPUTS, _closed(OMEGA), strict=True):
        own, phase = rows[rows["output"] == output], np.degrees(np.unwrap(np.angle(wanted)))
        for k, w in enumerate(OMEGA):
            yield "magnitude", f"{output} at {w:g} rad/s", float(own["magnitude"].iloc[k]), float(abs(wanted[k]))
            yield "phase", f"{output} at {w:g} rad/s", float(own["phase"].iloc[k]), float(phase[k])


def _engines() -> Iterator[Asked]:
    """Yield what is said of an engine whose slope is right, and of one whose stiffness is off by parts."""
    place = _hanging()
    right = np.array([[-SPRING / MASS, -DRAG / MASS]])
    for off, known, word in ((0.0, False, Word.WITHIN), (1e-3, False, Word.OUTSIDE), (1e-3, True, Word.EXPECTED)):
        slope = right * np.array([[1.0 + off, 1.0]])
        way = Tangent(way="made up", slope=slope, known="a cause" if known else "", explained=slope if known else None)
        row, pairs = compared(place, way)
        told = f"a stiffness {off:g} off"
        yield "slope", told, row["slope"], off
        yield "verdict", told, float(row["verdict"] == word.value), 1.0
        size = math.sqrt(SPRING / MASS)
        decay = DRAG / (2.0 * MASS)
        for pair, sign in zip(sorted(pairs, key=lambda one: -one["imag"]), (1.0, -1.0), strict=True):
            yield "reference_imag", told, pair["reference_imag"], sign * math.sqrt(size**2 - decay**2)
            yield "imag", told, pair["imag"], sign * math.sqrt(size**2 * (1.0 + off) - decay**2)


def _words() -> Iterator[Asked]:
    """Yield how a model grows and whether that is said of it: by its sign, by nothing but rounding, or as it moves."""
    for damping, name, word in (
        (0.6, "rests", STABLE), (-0.6, "rests", UNSTABLE), (0.0, "rests", NEUTRAL), (-0.6, "moves", MOVES),
    ):  # fmt: skip
        place = _place(_model(damping=damping, stiffness=9.0), "at rest" if name == "rests" else f"at once{MOVING}")
        place.trim, place.system = SimpleNamespace(residual=math.nan, active=[]), SimpleNamespace(unilateral=[])
        (row,) = _rows(summary([place], cases.load("bouncing_ball")))
        told = f"a damping of {damping:g} 1/s that {name}"
        yield "verdict", told, float(row["verdict"] == word), 1.0
        yield "growth", told, row["growth"], -0.5 * damping
        yield "slowest", told, row["slowest"], 3.0
        yield "fastest", told, row["fastest"], 3.0


def _of_engines(found: tuple[Place, ...], what: str) -> Iterator[Asked]:
    """Yield 1 for each way of an installed engine whose linear model is another one, or is not told, else 0."""
    for row in _rows(counterparts(found)[0]):
        try:
            engines.load(str(row["engine"]).partition(":")[0])
        except cases.EngineUnavailable:
            continue
        wrong_ = row["verdict"] not in (Word.WITHIN.value, Word.EXPECTED.value)
        yield "engine", f"{row['engine']}, {row['way']}, of {what}", float(wrong_), 0.0


def _ball() -> Iterator[Asked]:
    """Yield the law of a contact where a ball lies on it: at its surface."""
    case = cases.load("bouncing_ball")
    found = tuple(place for place in places(case) if place.model is not None)
    yield "equilibria", "a ball that lies", float(len(found)), 1.0
    for place in found:
        for k, name in enumerate(("a0", "a1")):
            yield "A", "a ball that lies", float(place.linearised(reduce=False).A[1, k]), -case.number(name)
        a0, a1 = case.number("a0"), case.number("a1")  # h+' = h' - dt (a0 h + a1 h')
        yield from _step(place, (math.sqrt(a1**2 + 4.0 * a0) - a1) / a0, "a ball that lies")
    yield from _of_engines(found, "a ball that lies")


def _chain() -> Iterator[Asked]:
    """Yield which engine has another linear model of a chain in space that hangs askew, on springs and by a motor."""
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.6, 0.0, 0.8))
    names = [f"link {i}" for i in range(len(axes))]
    made = Scene(
        bodies=tuple(
            Body(name=name, parent=above, position=(0.0, 0.1, -0.5), mass=1.0 + i, com=(0.02, 0.1 * i, -0.2),
                 inertia=(0.1, 0.2, 0.15, 0.01, 0.0, 0.02))
            for i, (name, above) in enumerate(zip(names, ["", *names], strict=False))
        ),
        joints=tuple(
            Joint(name=name, body=name, type="hinge", axis=axis, stiffness=(90.0, 0.0, 0.0), damping=(0.3, 0.0, 0.0))
            for name, axis in zip(names, axes, strict=True)
        ),
        actuators=(Actuator(name="motor", joint=names[1], gear=(GEAR,)),), gravity=(0.0, 0.0, -GRAVITY),
    )  # fmt: skip
    found = places(case_of(made, name="made_up", t_end=0.01))
    yield "equilibria", "a chain", float(len(found)), 1.0
    yield from _of_engines(found, "a chain")


def _filtered() -> Iterator[Asked]:
    """Yield the response of the weight to a motor behind a filter: that of both, one after the other."""
    motor = Actuator(name="motor", joint="z", gear=(GEAR,), activation="filter", time_constant=LAG)
    case = _hanging().case
    assert case.scene is not None
    lagged = case_of(case.scene.replace(actuators=(motor,)), name="made_up", q0=case.q0, t_end=0.01)
    found = places(lagged)
    yield "filter", "a weight behind a filter", float(np.abs(numbers.poles(found)["real"] + 1.0 / LAG).min()), 0.0
    rows = numbers.responses(found, OMEGA)
    own = rows[rows["output"] == "z"]
    wanted = GEAR / (1.0 + 1j * LAG * OMEGA) / (SPRING - MASS * OMEGA**2 + 1j * DRAG * OMEGA)
    for k, w in enumerate(OMEGA):
        yield "magnitude", f"a filter at {w:g} rad/s", float(own["magnitude"].iloc[k]), float(abs(wanted[k]))


def _upon_floor(ways: str, speed: float) -> list[float]:
    """Return the poles, 1/s, rising, of a ball on slides that stands on a floor, or moves along x on it, m/s."""
    axes = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    scene = Scene(
        bodies=(Body(name="ball", mass=MASS, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)),),
        joints=tuple(Joint(name=k, body="ball", type="slide", axis=axes[k]) for k in ways),
        shapes=(Shape(name="floor", type="plane"), Shape(name="ball", body="ball", size=(0.1, 0.0, 0.0))),
        pairs=(Pair(name="stands", first="floor", second="ball", dimension=3, friction=(MU, MU, 0.0, 0.0, 0.0),
                    law=LAW),),
        gravity=(0.0, 0.0, -GRAVITY),
    )  # fmt: skip
    q0, v0 = np.zeros((2, len(ways)))
    q0[-1], v0[0] = 0.1, speed
    found = numbers.poles(places(case_of(scene, name="made_up", q0=q0, v0=v0, t_end=0.01)))
    return sorted(found["real"].tolist())


def _stuck() -> Iterator[Asked]:
    """Yield the poles of a ball on slides that friction holds: its gap by its law, its slip by a1."""
    yield from _of_gap("a ball that sticks", _upon_floor("xz", 0.0), -LAW.a1, 0.0)


def _slid() -> Iterator[Asked]:
    """Yield those of one that slides along x: its speed across falls by mu g / v, and along by no part of itself."""
    yield from _of_gap("a ball that slides", _upon_floor("xyz", SPEED), -MU * GRAVITY / SPEED, 0.0, 0.0, 0.0)


def _of_gap(what: str, poles: list[float], *others: float) -> Iterator[Asked]:
    """Yield poles, 1/s, that are those of a gap by its law and others."""
    root = math.sqrt(0.25 * LAW.a1**2 - LAW.a0)
    wanted = sorted((*others, -0.5 * LAW.a1 - root, -0.5 * LAW.a1 + root))
    yield "poles", what, float(len(poles)), float(len(wanted))
    for one, must in zip(poles, wanted, strict=False):
        yield "real", what, one, must
