"""Wrong kernels are found before a run, and named; right ones pass."""

from __future__ import annotations

import subprocess
import sys
import textwrap
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from bead import GOOD, _gaps, _rows
from mechanisms import ball, flyby, oscillator, sliders
from places import helped

from crossbody import cases
from crossbody.cases import SceneError
from crossbody.cases.errors import OwnFault
from crossbody.cases.scene import Body, Joint, Pair, Scene, Shape, Tendon
from crossbody.engines.equations import answering, system_of
from crossbody.reference import Options, System, _check, kernels, prepare, simulate
from crossbody.reference._check import check_kernels
from crossbody.reference._differences import differs

VARIANTS = [
    (name, variant) for name in cases.names() for variant in import_module(f"crossbody.cases.library.{name}").VARIANTS
]


@pytest.mark.parametrize(("name", "variant"), VARIANTS)
def test_every_shipped_system_passes(name, variant):
    case = cases.load(name, variant=variant)
    system = system_of(case)
    for seed in range(3):
        check_kernels(system, np.array(case.q0), np.array(case.v0), t_end=case.t_end, seed=seed)


# A bead of mass p[0] on a line and a wall that curves: h = p[1] - x + p[2] y^2 + |z|, with three coordinates.


def _bead(**changes):
    fields = {"n": 3, "parameters": [1.3, 2.0, 0.7], "a0": [1e4], "a1": 20.0, **GOOD, **changes}
    return System(**fields)


def _faulty(kind, body, base):
    """A kernel that calls the right one and then spoils what it gave."""
    scope = {"base": base, "np": np}
    arguments = {
        "dynamics": "t, q, v, u, p, M, f, w", "gaps": "t, q, v, p, h, hd", "energy": "q, v, p, e",
        "rows": "t, q, v, p, w, idx, na, H, h, Hdv",
    }[kind]  # fmt: skip
    exec(f"def {kind}({arguments}):\n    base({arguments})\n    {body}\n", scope)
    return getattr(kernels, kind)(scope[kind])


FAULTS = [
    ("rows", "Hdv[0] = 0.0", ["rows", "Hdv[0]", "differences"]),
    ("rows", "H[0, 1] = -H[0, 1]", ["H[0, 1]"]),
    ("rows", "h[0] += 0.01", ["rows", "h[0]", "gaps"]),
    ("gaps", "hd[0] = -hd[0]", ["gaps", "hd[0]"]),
    ("gaps", "h[0] += 0.3 * t", ["gaps", "must not depend on time", "h[0]"]),
    ("gaps", "h[0] = np.nan", ["gaps", "h[0]", "nan"]),
    ("gaps", "hd[0] += p[3]", ["gaps", "reads beyond p", "System.parameters"]),
    ("dynamics", "f[0] += p[5]", ["dynamics", "reads beyond p", "(3,)"]),
    ("dynamics", "w[0] = 1.0", ["dynamics", "writes beyond w", "(0,)", "CROSSBODY_DEBUG"]),
    ("dynamics", "M[0, 1] += 0.1", ["dynamics", "M[0, 1]", "mirror"]),
    ("dynamics", "M[:, :] = -M", ["dynamics", "positive definite", "eigenvalue"]),
    ("dynamics", "M[0, 2] = np.nan", ["dynamics", "M[0, 2]", "nan"]),
    ("dynamics", "M[1, 1] += 0.1 * v[0] * v[0]", ["dynamics", "M[1, 1]", "must not depend on v"]),
    ("gaps", "h[0] += 1e-3 * v[1]", ["gaps", "h[0]"]),
    ("gaps", "h[0] += 0.1 * max(t - 0.9, 0.0)", ["gaps", "must not depend on time", "h[0]"]),
    ("rows", "H[0, 0] -= 1e-3 * v[0]", ["rows", "H[0, 0]"]),
    ("dynamics", "q[0] = 0.5", ["dynamics", "writes q"]),
    ("dynamics", "f[2] = np.inf", ["dynamics", "f[2]", "inf"]),
    ("energy", "e[1] = np.nan", ["energy", "e[1]"]),
    ("energy", "e[2] = 1.0", ["energy", "writes beyond e"]),
]


@pytest.mark.parametrize(("kind", "body", "words"), FAULTS, ids=[f"{kind}:{body}" for kind, body, _ in FAULTS])
def test_every_planted_fault_is_named(kind, body, words):
    system = _bead(**{kind: _faulty(kind, body, GOOD[kind])})
    for seed in range(3):
        with pytest.raises(SceneError) as caught:
            check_kernels(system, np.array([0.2, 0.3, 0.4]), np.zeros(3), seed=seed)
        assert all(word in str(caught.value) for word in words), caught.value


@kernels.dynamics
def _unfilled(t, q, v, u, p, M, f, w):
    for i in range(3):
        M[i, i] = 1.0
        f[i] = 0.0


@kernels.dynamics
def _accumulated(t, q, v, u, p, M, f, w):
    for i in range(3):
        M[i, 0] = 1.0
        f[i] += 1.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"dynamics": _unfilled}, ["M[0, 1]", "unfilled"]),
        ({"dynamics": _accumulated, "mass_block": 1}, ["f[0]", "previous content"]),
        ({"mass_block": 1}, ["writes beyond M", "(3, 1)"]),
        ({"constant_mass": True}, ["System.constant_mass", "M["]),
        ({"affine": True}, ["System.affine", "M["]),
        ({"parameters": [1.3, 2.0]}, ["reads beyond p", "System.parameters"]),
    ],
)
def test_every_untrue_declaration_is_named(changes, words):
    with pytest.raises(SceneError) as caught:
        check_kernels(_bead(**changes), np.array([0.2, 0.3, 0.4]), np.zeros(3))
    assert all(word in str(caught.value) for word in words), caught.value


@kernels.gaps
def _both_gaps(t, q, v, p, h, hd):  # the second is too far to be touched
    _gaps(t, q, v, p, h, hd)
    h[1], hd[1] = 50.0 + q[2], v[2]


@kernels.rows
def _disordered(t, q, v, p, w, idx, na, H, h, Hdv):  # in the order of the rows, not in that of idx
    at = 0
    for i in range(2):
        for j in range(na):
            if idx[j] == i:
                if i == 0:
                    _rows(t, q, v, p, w, idx[j : j + 1], 1, H[at : at + 1], h[at : at + 1], Hdv[at : at + 1])
                else:
                    H[at, 2], h[at], Hdv[at] = 1.0, 50.0 + q[2], 0.0
                at += 1


def test_rows_in_another_order_than_asked_for_are_named():
    system = _bead(gaps=_both_gaps, rows=_disordered, a0=[1e4, 1e4])
    for seed in range(3):
        with pytest.raises(SceneError, match=r"Kernel rows gives H\[\d, \d\] = .* but row \d of all, which idx = \["):
            check_kernels(system, np.array([0.2, 0.3, 0.4]), np.zeros(3), seed=seed)


@kernels.gaps
def _late_gaps(t, q, v, p, h, hd):  # a wall that is away from where it began between 0.4 s and 0.5 s alone
    _gaps(t, q, v, p, h, hd)
    if 0.4 < t < 0.5:
        h[0] += 0.1


def test_a_wall_that_moves_for_a_while_is_found_by_many_states():
    with pytest.raises(SceneError, match=r"must not depend on time"):
        _bead(gaps=_late_gaps).check([0.2, 0.3, 0.4], t_end=1.0)


def test_a_row_that_reaches_beyond_its_span_is_named():
    right = flyby(1.0)
    wrong = System(
        n=2, mass_block=1, parameters=right.p, a0=[1e4], a1=[20.0], span=[[0, 1]], dynamics=right.dynamics,
        gaps=right.gaps, rows=right.rows,
    )  # fmt: skip
    with pytest.raises(SceneError, match=r"H\[0, 1\] outside System.span"):
        check_kernels(wrong, np.array([0.6, 0.8]), np.zeros(2))


@pytest.mark.parametrize("seed", range(20))
def test_right_systems_of_all_scales_pass(seed):
    draw = np.random.default_rng(seed)
    scale = 10.0 ** draw.uniform(-3.0, 3.0)
    systems = [
        (_bead(parameters=[scale, *draw.standard_normal(2)]), 3), (ball(gravity=scale), 1),
        (oscillator(draw.standard_normal(), scale), 1), (flyby(scale), 2),
        (sliders(40, masses=scale * np.ones(40)), 40),
    ]  # fmt: skip
    for system, n in systems:
        q = scale ** draw.choice([0.0, 1.0]) * draw.standard_normal(n)
        check_kernels(system, q, draw.standard_normal(n), seed=seed, states=5)


@kernels.gaps
def _kinked_gaps(t, q, v, p, h, hd):
    side = 1.0 if q[0] >= 0.0 else -1.0
    h[0], hd[0] = 1.0 - side * q[0], -side * v[0]


@kernels.rows
def _kinked_rows(t, q, v, p, w, idx, na, H, h, Hdv):
    for j in range(na):
        side = 1.0 if q[0] >= 0.0 else -1.0
        H[j, 0], h[j], Hdv[j] = -side, 1.0 - side * q[0], 0.0


@pytest.mark.parametrize("at", [0.0, 1e-9, -1e-9, 1e-6, 1e-3, 1.0])
def test_a_kink_is_no_fault(at):
    system = System(
        n=1, parameters=[1.0, 9.81], a0=[1e4], a1=[20.0], dynamics=ball().dynamics,
        gaps=kernels.gaps(_kinked_gaps.py_func), rows=kernels.rows(_kinked_rows.py_func),
    )  # fmt: skip
    for seed in range(5):
        check_kernels(system, np.array([at]), np.zeros(1), seed=seed)


def test_only_kernels_that_somebody_else_wrote_are_his_fault():
    """One of crossbody's own that is not what it says is a fault of crossbody."""
    case = cases.load("bouncing_ball")
    system = replace(system_of(case), gaps=kernels.gaps(_gaps.py_func))
    with pytest.raises(OwnFault, match="Kernel"), answering(case):
        simulate(system, np.array(case.q0), np.array(case.v0), 1.0)
    with pytest.raises(SceneError, match="Kernel"), answering(replace(case, mechanism="mine.py")):
        simulate(system, np.array(case.q0), np.array(case.v0), 1.0)


@pytest.mark.parametrize("mass", [-1.0, 1e308])
def test_a_number_that_no_mechanism_has_is_no_fault_of_a_kernel(mass):
    system = system_of(cases.load("bouncing_ball"))
    changed = replace(system, parameters={**system.parameters, "mass": mass})
    with pytest.raises(SceneError, match="Kernel dynamics gives"), answering(cases.load("bouncing_ball")):
        simulate(changed, np.ones(1), np.zeros(1), 1.0)


def test_a_run_checks_its_system_once(monkeypatch):
    system = _bead(rows=_faulty("rows", "Hdv[0] = 0.0", _rows))
    with pytest.raises(SceneError, match=r"Kernel rows gives Hdv\[0\]"):
        simulate(system, [0.2, 0.3, 0.4], [0.0, 0.0, 0.0], 1.0)
    with pytest.raises(SceneError, match=r"Kernel rows gives Hdv\[0\]"):
        system.check([0.2, 0.3, 0.4], states=5)
    good, calls = _bead(), []
    monkeypatch.setattr(_check, "check_kernels", lambda *_, **__: calls.append(1))
    for _ in range(3):
        prepare(good, [0.2, 0.3, 0.4], [0.0, 0.0, 0.0], Options(t_end=1.0))
    assert calls == [1]


DEBUG = """
    import numpy as np
    from mechanisms import ball, flyby, oscillator, sliders
    from crossbody.reference import System, kernels

    for system, n in ((ball(), 1), (oscillator(-0.5), 1), (flyby(0.2), 2), (sliders(3), 3)):
        system.check(0.3 + 0.1 * np.arange(n), np.ones(n))

    @kernels.energy
    def energy(q, v, p, e):
        e[0], e[1] = p[2], 0.0

    good = ball()
    wrong = System(n=1, dynamics=good.dynamics, energy=energy, parameters=[1.0, 9.81])
    try:
        wrong.check([1.0])
    except Exception as error:
        print(type(error).__name__, error)
"""


SHIPPED = """
    import numpy as np
    from mechanisms import sliders
    from crossbody import cases
    from crossbody.engines.equations import answering, system_of
    from crossbody.reference import System, kernels

    count = 0
    for name in cases.names():
        for variant in cases.variants(name):
            case = cases.load(name, variant)
            system = system_of(case)
            system.check(case.q0, case.v0, states=5, t_end=case.t_end)
            q, v, p = (np.array(x) for x in (case.q0, case.v0, system.p))
            u, s, mode = np.zeros(system.inputs), np.zeros(system.memory), np.zeros(system.nc, np.int8)
            if system.control is not None:
                for tick in range(3):
                    system.control(tick * system.tick, q, v, u, s, p)
            if system.switch is not None:
                for fired in (kernels.START, kernels.TOUCHED):
                    system.switch(0.0, q, v, p, mode, fired)
            count += 1
    print(count)

    @kernels.energy
    def energy(q, v, p, e):
        e[0], e[1] = p[2], 0.0

    try:
        System(n=1, dynamics=sliders(1).dynamics, energy=energy, mass_block=1, parameters=[1.0, 9.81]).check([1.0])
    except Exception as error:
        print(type(error).__name__, error)
"""


def test_every_shipped_kernel_stays_inside_its_arrays(tmp_path):
    # As Python the kernels need not be compiled, and NumPy looks at every index.
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(SHIPPED)], cwd=Path(__file__).parent,
        env=helped(NUMBA_DISABLE_JIT="1"), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    count, found = done.stdout.splitlines()
    assert int(count) == len(VARIANTS)
    assert found.startswith("KernelError Kernel energy reads or writes beyond an array: index")


def test_with_debugging_on_kernels_check_their_indices(tmp_path):
    environment = helped(CROSSBODY_DEBUG="1")
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(DEBUG)], cwd=Path(__file__).parent, env=environment,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("KernelError Kernel energy reads or writes beyond an array: index")


@pytest.mark.parametrize("bend", 10.0 ** np.arange(-5, 1))
def test_a_slope_that_bends_is_either_of_both_and_no_other(bend: float) -> None:
    """A sphere over the edge of a box's face: its gap bends twice there, by as little as the edge is far."""
    one = np.ones(1)
    for part, wrong in ((0.0, False), (1.0, False), (-0.5, True), (1.5, True), (3.0, True)):
        claimed = np.array([1.3 + part * bend])
        found = differs(lambda x: 0.7 + 1.3 * x + bend * np.maximum(x, 0.0), np.zeros(1), one, claimed, one, one)
        assert found[0] == wrong, (bend, part)


def test_a_sphere_over_the_edge_of_a_face_passes() -> None:
    box = Shape(name="box", type="box", size=(0.2, 0.03, 0.04))
    ball = Shape(name="ball", type="sphere", body="ball", size=(0.04, 0.0, 0.0))
    body = Body(name="ball", position=(0.7, 0.03, 0.1), mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))
    scene = Scene(
        bodies=(body,), joints=(Joint(name="free", body="ball", type="free"),), shapes=(box, ball),
        pairs=(Pair(name="both", first="box", second="ball"),),
    )  # fmt: skip
    case = cases.from_scene(scene, q0=[0.7, 0.03, 0.1, 1.0, 0.0, 0.0, 0.0])
    system_of(case).check(case.q0, case.v0)


@pytest.mark.parametrize("height", [0.5, -0.5])
def test_a_row_that_nothing_moves_is_no_fault_of_a_kernel_but_cannot_be_closed(height: float) -> None:
    """A rope from the centre of a ball joint to the wall: its length is known to rounding, and so are H and rate."""
    ball = Body(
        name="ball", mass=1.0, inertia=(0.1, 0.2, 0.3, 0.0, 0.0, 0.0), com=(0.1, 0.0, 0.0), position=(0.3, 0.4, 0.5)
    )
    rope = Tendon(
        name="rope", bodies=("", "ball"), positions=((0.1, 0.2, -0.7), (0.0, 0.0, 0.0)), range=(0.0, 1.2 + height)
    )
    scene = Scene(bodies=(ball,), joints=(Joint(name="socket", body="ball", type="ball"),), tendons=(rope,))
    case = cases.from_scene(scene)
    run = partial(simulate, system_of(case), case.q0, [1.0, 2.0, 3.0], 0.1)
    if height < 0.0:
        with pytest.raises(SceneError, match="no coordinate changes it"):
            run()
    else:
        assert run().outcome.ok


FEET = """
<mujoco><worldbody><body pos="0 0 .6"><freejoint/><geom type="sphere" size=".05" mass="3"/>{legs}</body></worldbody>
<keyframe><key name="squat" qpos="0 0 .59 1 0 0 0 {q}"/></keyframe></mujoco>
"""
LEG = """
<body pos="0 {y} -.1"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -.2" size=".03" mass="1"/>
<body pos="0 0 -.22"><joint axis="0 1 0"/><geom type="capsule" fromto="-.05 0 -.25 .1 0 -.25" size=".03" mass=".3"/>
</body></body>
"""


def test_feet_that_lie_side_by_side_pass(tmp_path):
    """No joint changes the gap between them: what is left of its derivatives is rounding, which speeds change."""
    legs, draw, path = "".join(LEG.format(y=y) for y in (0.1, -0.1)), np.random.default_rng(0), tmp_path / "feet.xml"
    for angle in draw.uniform(-0.7, 0.7, (20, 2)):
        path.write_text(FEET.format(legs=legs, q=" ".join(map(str, [*angle, *angle]))), encoding="utf-8")
        case = cases.from_file(path, "squat", friction=1, without="rolling")
        check_kernels(system_of(case), np.array(case.q0), np.array(case.v0), t_end=case.t_end)
