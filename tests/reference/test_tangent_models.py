"""Linear models, trims and sensitivities where q' is not v: on the tangent space, with as many coordinates as rates."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from random_scenes import random_scene, random_state
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from crossbody import cases, engines
from crossbody.cases import Law, Outcome, SceneError
from crossbody.cases.scene import Body, Joint, Loop, Pair, RowLaw, Scene, Shape
from crossbody.cases.scene_contacts import rows_of
from crossbody.engines.linear import Spot
from crossbody.reference import System, kernels, simulate
from crossbody.reference.linear import linearise, sensitivity, tangents, trim
from crossbody.reference.linear._point import turning
from crossbody.reference.linear.differences import differences
from crossbody.reference.tree.system import system

SEEDS = (0, 2, 5, 7)


def built(scene: Scene) -> System:
    _, laws, unilateral = rows_of(scene)
    law = Law(a0=np.array([one.a0 for one in laws]), a1=np.array([one.a1 for one in laws]), a2=np.zeros(len(laws)),
              unilateral=np.array(unilateral, dtype=bool))  # fmt: skip
    return system(scene, law)


def shifted(of: System, q: np.ndarray, d: np.ndarray) -> np.ndarray:
    """The retraction q (+) d by rotations, which knows nothing of the kernels."""
    found, starts = np.empty(of.nq), np.asarray(of.quaternions).tolist()
    i = j = 0
    while i < of.nq:
        if i in starts:
            turn = Rotation.from_quat(np.roll(q[i : i + 4], -1)) * Rotation.from_rotvec(d[j : j + 3])
            found[i : i + 4] = np.roll(turn.as_quat(), 1)
            i, j = i + 4, j + 3
        else:
            found[i] = q[i] + d[j]
            i, j = i + 1, j + 1
    return found


def apart(of: System, q: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The d with other = q (+) d."""
    found, starts = [], np.asarray(of.quaternions).tolist()
    i = 0
    while i < of.nq:
        if i in starts:
            one, two = (Rotation.from_quat(np.roll(x[i : i + 4], -1)) for x in (q, other))
            found += (one.inv() * two).as_rotvec().tolist()
            i += 4
        else:
            found.append(other[i] - q[i])
            i += 1
    return np.array(found)


def accelerations(of: System, q: np.ndarray, v: np.ndarray, u: np.ndarray, active: list[int]) -> np.ndarray:
    """(v', lam, gaps) by one dense solve of the real kernels."""
    M, f = of.terms(q, v, u)
    H, h, Hdv = (part[active] for part in of.constraint(q, v))
    a0, a1, _ = of.alpha[active].T
    K = np.block([[M, -H.T], [H, np.zeros((len(active),) * 2)]])
    return np.concatenate([np.linalg.solve(K, np.concatenate([f, -(Hdv + a1 * (H @ v) + a0 * h)])), of.gap(q, v)[0]])


@pytest.mark.parametrize("seed", SEEDS)
def test_random_scenes_have_the_slopes_of_their_dynamics(seed: int) -> None:
    scene = random_scene(seed, bodies=4).replace(loops=())
    of = built(scene)
    assert of.nq > of.n
    q, v, u = random_state(scene, np.random.default_rng(seed))
    active = [0] if of.nc else []
    model = linearise(of, q, v, u, active)

    def moved(x: np.ndarray) -> np.ndarray:
        return accelerations(of, shifted(of, q, x[: of.n]), x[of.n : 2 * of.n], x[2 * of.n :], active)

    slope = differences(moved, np.concatenate([np.zeros(of.n), v, u]), 1e-3)
    x = 2 * of.n
    scale = np.abs(slope).max()
    np.testing.assert_allclose(model.A[of.n :], slope[: of.n, :x], rtol=0.0, atol=1e-7 * scale)
    np.testing.assert_allclose(model.B[of.n :], slope[: of.n, x:], rtol=0.0, atol=1e-7 * scale)
    gap = model.pick([f"gap[{i}]" for i in range(of.nc)]).C
    np.testing.assert_allclose(gap, slope[-of.nc :, :x] if of.nc else gap, rtol=0.0, atol=1e-7 * scale)
    for i in active:
        lam = model.pick([f"lam[{i}]"]).C[0]
        np.testing.assert_allclose(lam, slope[of.n + i, :x], rtol=0.0, atol=1e-7 * scale)
    assert model.states[0] == "dq[0]"


INERTIA = np.array([0.3, 0.3, 0.5])


def body(joint: Joint, inertia: np.ndarray = INERTIA, height: float = 0.0, weight: float = 0.0) -> Scene:
    return Scene(
        bodies=(Body(name="body", mass=2.0, com=(0.0, 0.0, height), inertia=(*inertia.tolist(), 0.0, 0.0, 0.0)),),
        joints=(joint,), gravity=(0.0, 0.0, -weight),
    )  # fmt: skip


def same_poles(found: Any, wanted: Any, atol: float) -> None:
    left = list(np.asarray(found, dtype=complex))
    for pole in wanted:
        nearest = int(np.argmin(np.abs(np.array(left) - pole)))
        assert abs(left.pop(nearest) - pole) < atol, (pole, found)


@pytest.mark.parametrize("spin", [0.0, 3.0, 30.0])
@pytest.mark.parametrize("kind", ["ball", "free"])
def test_a_sleeping_top_has_its_closed_form_s_poles(spin: float, kind: str) -> None:
    """I1 z'' - i I3 w z' - m g l z = 0 of z = x + i y in the world; in body axes less i w."""
    top = kind == "ball"
    height, weight = (0.4, 9.81) if top else (0.0, 0.0)
    of = built(body(Joint(name="joint", body="body", type=kind), height=height, weight=weight))
    pole = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])[0 if kind == "free" else 3 :]
    v = np.array([0.0, 0.0, 0.0, 0.0, 0.0, spin])[-of.n :]
    across = INERTIA[0] + (2.0 * height**2 if top else 0.0)
    roots = np.roots([across, -1j * INERTIA[2] * spin, -2.0 * weight * height]) - 1j * spin
    wanted = [*roots, *roots.conj(), *np.zeros(2 * of.n - 4)]
    same_poles(linearise(of, pole, v).poles(), wanted, 1e-6 * (1.0 + spin))


def test_a_body_on_a_spring_has_its_frequencies() -> None:
    inertia, k = np.array([0.2, 0.3, 0.4]), 5.0
    turned = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_quat()
    rest = tuple(np.roll(turned, 1).tolist())
    joint = Joint(name="joint", body="body", type="ball", stiffness=(k, 0.0, 0.0), rest=rest)
    of = built(body(joint, inertia))
    away = shifted(of, np.array(rest), np.array([0.1, 0.2, -0.1]))
    found = trim(of, away)
    assert found.outcome is Outcome.FINISHED
    assert np.linalg.norm(apart(of, np.array(rest), found.q)) < 1e-9
    poles = linearise(of, found.q).poles()
    same_poles(poles, np.concatenate([1j * np.sqrt(k / inertia), -1j * np.sqrt(k / inertia)]), 1e-6)


def test_a_hanging_chain_of_balls_is_found_from_a_far_guess() -> None:
    scene = Scene(
        bodies=tuple(
            Body(name=f"{i}", parent=f"{i - 1}" if i else "", position=(0.0, 0.0, -0.5 if i else 0.0), mass=1.0 + i,
                 com=(0.0, 0.0, -0.25), inertia=(0.05, 0.05, 0.01, 0.0, 0.0, 0.0)) for i in range(3)
        ),
        joints=tuple(Joint(name=f"{i}", body=f"{i}", type="ball", damping=(0.1, 0.0, 0.0)) for i in range(3)),
    )  # fmt: skip
    of = built(scene)
    guess = shifted(of, np.tile([1.0, 0.0, 0.0, 0.0], 3), np.array([0.5, -0.4, 0.3, 0.2, 0.6, 0.0, -0.3, 0.4, 0.1]))
    found = trim(of, guess)
    assert found.outcome is Outcome.FINISHED
    np.testing.assert_allclose(np.linalg.norm(found.q.reshape(3, 4), axis=1), 1.0, atol=1e-14)
    down = Rotation.from_quat(np.roll(found.q.reshape(3, 4), -1, axis=1)).apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(down, np.tile([0.0, 0.0, 1.0], (3, 1)), atol=1e-9)
    assert linearise(of, found.q).poles().real.max() < 1e-9


def test_a_free_body_held_at_a_point_is_a_pendulum() -> None:
    """Reduced to what the rows leave: m g l / (I + m l^2) about both level axes, and a spin; no pole of the law's."""
    scene = body(Joint(name="joint", body="body", type="free"), height=-0.4, weight=9.81)
    scene = scene.replace(loops=(Loop(name="held", type="connect", first="body"),))
    of = built(scene)
    turned = np.concatenate([np.zeros(3), np.roll(Rotation.from_rotvec([0.1, -0.2, 0.3]).as_quat(), 1)])
    found = trim(of, turned)
    assert found.outcome is Outcome.FINISHED
    np.testing.assert_allclose(found.lam, [0.0, 0.0, 2.0 * 9.81], atol=1e-9)
    poles = linearise(of, found.q, reduce=True).poles()
    w = np.sqrt(2.0 * 9.81 * 0.4 / (INERTIA[0] + 2.0 * 0.4**2))
    assert len(poles) == 6
    same_poles(poles, [1j * w, -1j * w, 1j * w, -1j * w, 0.0, 0.0], 1e-6)


def test_the_model_of_a_hanging_ball_joint_is_mujoco_s() -> None:
    joint = Joint(name="joint", body="body", type="ball", damping=(0.2, 0.0, 0.0), stiffness=(3.0, 0.0, 0.0))
    scene = body(joint, np.array([0.2, 0.3, 0.4]), height=-0.3, weight=9.81)
    case, rest = cases.from_scene(scene), np.array([1.0, 0.0, 0.0, 0.0])
    spot = Spot(q=rest, v=np.zeros(3), u=np.zeros(0), rows=(), lam=np.zeros(0))
    theirs = engines.load("mujoco").linearise(case, spot)[0].slope
    np.testing.assert_allclose(linearise(built(scene), rest).A[3:], theirs, rtol=0.0, atol=1e-7)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_small_motions_about_a_turning_body_follow_the_flow_of_its_model(axis: int) -> None:
    """Spinning about each principal axis, of which the middle one is unstable; A does not depend on time."""
    of = built(body(Joint(name="joint", body="body", type="free"), np.array([0.2, 0.35, 0.5])))
    q, v, t = np.array([0.1, 0.2, 0.3, 0.5, -0.5, 0.5, 0.5]), np.zeros(6), 0.7
    v[:3], v[3 + axis] = [0.4, -0.2, 0.1], 4.0
    A = linearise(of, q, v).A
    start = np.random.default_rng(axis).normal(size=12) * 1e-5

    def end(x: np.ndarray) -> Any:
        run = simulate(of, shifted(of, q, x[:6]), v + x[6:], t, rtol=1e-13)
        return run.q[-1], run.v[-1]

    (base, rates), (ahead, faster), (back, slower) = (end(x) for x in (np.zeros(12), start, -start))
    moved = np.concatenate([apart(of, base, ahead) - apart(of, base, back), faster - slower]) / 2.0
    np.testing.assert_allclose(moved, expm(A * t) @ start, rtol=0.0, atol=1e-9)
    assert np.allclose(rates, v)


DROP = Scene(
    bodies=(Body(name="ball", mass=0.7, com=(0.02, 0.01, -0.03), inertia=(3e-3, 4e-3, 5e-3, 0.0, 0.0, 0.0)),),
    joints=(Joint(name="free", body="ball", type="free"),),
    shapes=(Shape(name="floor", type="plane"), Shape(name="ball", body="ball", size=(0.1, 0.0, 0.0))),
    pairs=(Pair(name="touch", first="floor", second="ball", law=RowLaw(a0=4e4, a1=60.0)),),
)


@pytest.mark.parametrize("scene", ["drop", *SEEDS[:2]])
def test_derivatives_of_a_motion_are_those_of_differences(scene: Any) -> None:
    """Through a contact that turns the body, since its centre of mass is off; and of random scenes."""
    if scene == "drop":
        of, t_end, start = built(DROP), 0.25, np.array([0.0, 0.0, 0.2, 0.8, 0.4, -0.2, 0.4])
        q, v = of.normalised("start", start), np.array([0.3, 0.1, -0.5, 1.0, -2.0, 1.5])
    else:
        made = random_scene(scene, bodies=3).replace(loops=(), pairs=(), tendons=(), actuators=(), pushes=())
        made = made.replace(joints=tuple(replace(joint, range=(-np.inf, np.inf)) for joint in made.joints))
        of, t_end = built(made), 0.2
        q, v, _ = random_state(made, np.random.default_rng(scene))
    found = sensitivity(of, q, v, t_end, rtol=1e-10)
    assert found.outcome is Outcome.FINISHED
    assert len(found.jumps) == (2 if scene == "drop" else 0)
    base = found.state[: of.nq]

    def end(x: np.ndarray) -> np.ndarray:
        run = simulate(of, shifted(of, q, x[: of.n]), x[of.n :], t_end, rtol=1e-13)
        return np.concatenate([apart(of, base, run.q[-1]), run.v[-1]])

    by = differences(end, np.concatenate([np.zeros(of.n), v]), 1e-4)
    np.testing.assert_allclose(found.by_start, by, rtol=0.0, atol=2e-6 * np.abs(by).max())


@kernels.dynamics
def pushed(t, q, v, u, p, M, f, w):  # type: ignore[no-untyped-def]
    M[0, 0], f[0] = 1.0, -q[1]


@kernels.velocity
def scaled(t, q, v, p, qd):  # type: ignore[no-untyped-def]
    qd[0], qd[1] = p[0] * v[0] * q[1], -p[0] * v[0] * q[0]


def test_parameters_that_rates_of_positions_read_count_too() -> None:
    """A point on a circle, q = (sin, cos) of p x, where x' = v: x'' = -cos(p x)."""
    of = System(n=1, nq=2, dynamics=pushed, velocity=scaled, parameters={"p": 1.3})
    found = sensitivity(of, [0.0, 1.0], [0.4], 0.8, parameters=["p"], rtol=1e-11)

    def end(p: np.ndarray) -> np.ndarray:
        other = System(n=1, nq=2, dynamics=pushed, velocity=scaled, parameters={"p": float(p[0])})
        run = simulate(other, [0.0, 1.0], [0.4], 0.8, rtol=1e-13)
        return np.concatenate([run.q[-1], run.v[-1]])

    by = differences(end, np.array([1.3]), 1e-3)[:, 0]
    along = np.array([found.state[1], -found.state[0]]) * 1.3
    ours = np.concatenate([along * found.by_parameters[0, 0], found.by_parameters[1]])
    np.testing.assert_allclose(ours, by, atol=1e-8)


def test_what_is_not_there_on_a_tangent_space_says_so() -> None:
    of = built(body(Joint(name="joint", body="body", type="free")))
    with pytest.raises(SceneError, match=r"q' is not v.*valid: linearise, sensitivity"):
        tangents(of, np.zeros((1, 7)))
    with pytest.raises(SceneError, match="has 7 entries"):
        linearise(of, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], names=[str(i) for i in range(7)])


class Carried:
    """What `turning` asks of a system, of which positions move at rest too: q' = N(q) v + r(q), all drawn."""

    n = nq = 3
    p = np.zeros(0)

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.ways, self.bent = np.eye(3) + 0.2 * rng.normal(size=(3, 3)), 0.3 * rng.normal(size=(3, 3, 3))
        self.rest = rng.normal(size=(3, 3))

    def velocity(self, t: float, q: np.ndarray, v: np.ndarray, p: np.ndarray, out: np.ndarray) -> None:
        out[:] = (self.ways + self.bent @ np.sin(q)) @ v + self.rest @ np.cos(q)

    def rates(self, q: np.ndarray, v: np.ndarray, t: float = 0.0) -> np.ndarray:
        found = np.zeros(3)
        self.velocity(t, q, v, self.p, found)
        return found

    def displacement(self, q: np.ndarray, d: np.ndarray) -> np.ndarray:
        return (self.ways + self.bent @ np.sin(q)) @ d


@pytest.mark.parametrize("seed", range(8))
def test_a_tangent_space_that_is_carried_at_rest_turns_as_its_motion_says(seed: int) -> None:
    """Two neighbouring motions, integrated: what T says of the coordinates of their difference, at any velocity."""
    carried: Any = Carried(seed)
    rng = np.random.default_rng(100 + seed)
    q, v, off, dt = rng.normal(size=3), rng.normal(size=3), 1e-6, 1e-4

    def moved(start: np.ndarray, by: float) -> np.ndarray:
        middle = start + 0.5 * by * carried.rates(start, v)
        return start + by * carried.rates(middle, v)

    def coordinates(d: np.ndarray, by: float) -> np.ndarray:
        near, far = (moved(q + sign * off * carried.displacement(q, d), by) for sign in (-1.0, 1.0))
        N = np.stack([carried.displacement(moved(q, by), e) for e in np.eye(3)], axis=1)
        return np.linalg.solve(N, (far - near) / (2.0 * off))

    T = np.stack([(coordinates(e, dt) - coordinates(e, -dt)) / (2.0 * dt) for e in np.eye(3)], axis=1)
    np.testing.assert_allclose(turning(carried, 0.0, q, v), T, atol=1e-5)
