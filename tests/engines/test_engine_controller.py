"""The sampled controller of the engines against the reference's compiled one: two texts of the same equations."""

from dataclasses import replace

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases.mechanisms.delta import controller, pose
from crossbody.cases.mechanisms.delta.controller import Controller
from crossbody.cases.parameters import of_numbers
from crossbody.reference.delta import control, scene
from crossbody.reference.delta.kernels import kinematics as kinematics
from crossbody.reference.delta.kernels import robot as kernels
from crossbody.reference.delta.kinematics import inverse

VARIANTS = [("circle", "exact"), ("circle", "approximate"), ("pd", "exact")]


class Compiled:
    """The reference's controller behind the interface of the engines'."""

    def __init__(self, case, sampling):
        p = case.parameters
        law = scene.controller_of(p)
        self.program = control.program(scene.robot_of(p), law, scene.path_of(p), case.t_end, sampling)
        self.u, self.memory = np.zeros(6), np.zeros(self.program.memory)

    def tick(self, t, q):
        self.program.control(t, np.array(q), np.zeros(9), self.u, self.memory, self.program.parameters)
        return self.u[:3].copy()


class Own:
    """The controller of runs on a scene, which sees the angles of the tree."""

    def __init__(self, case, sampling):
        self.controller = Controller({
            **case.parameters, "delay": sampling.delay, "bits": sampling.bits or 1000, "limit": sampling.limit or 0.0,
        })  # fmt: skip

    def tick(self, t, q):
        return self.controller(t, *pose.to_tree(np.array(q), np.zeros(9)))


MAKERS = {"compiled": Compiled, "own": Own}


def load(variant, mass="exact"):
    return cases.load("delta_tracking", variant=variant, mass_matrix=mass)


def poses(case, count, seed, size=1e-4):
    """Closed poses along a random walk of the flange: not what the controller would do, so that every term counts."""
    rng = np.random.default_rng(seed)
    start = np.array([float(case.parameters[name]) for name in "xyz"])
    walk = start + np.cumsum(size * rng.standard_normal((count, 3)), axis=0)
    return [inverse(scene.robot_of(case.parameters), z) for z in walk]


def torques(maker, case, sampling, angles):
    computer = MAKERS[maker](case, sampling)
    return np.array([computer.tick(k * sampling.period, q) for k, q in enumerate(angles)])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("variant", "mass"), VARIANTS)
def test_both_command_the_same_torques(variant, mass, seed):
    case = load(variant, mass)
    rng = np.random.default_rng(seed)
    sampling = replace(
        scene.sampling_of(case.parameters), delay=int(rng.integers(0, 4)), bits=int(rng.integers(10, 20))
    )
    angles = poses(case, 60, seed)
    both = [torques(maker, case, sampling, angles) for maker in MAKERS]
    assert np.isfinite(both[0]).all()
    np.testing.assert_allclose(both[0], both[1], rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize("variant", ["circle", "pd"])
def test_a_torque_comes_so_many_samples_late(maker, variant):
    case = load(variant)
    prompt, late = (replace(scene.sampling_of(case.parameters), delay=delay) for delay in (0, 3))
    angles = poses(case, 20, 1)
    at_once, then = (torques(maker, case, sampling, angles) for sampling in (prompt, late))
    np.testing.assert_array_equal(then[3:], at_once[:-3])
    assert np.ptp(then[:3], axis=0).max() == 0.0, "before the first command the pose is held"


@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize("share", [0.4, 0.6])
def test_an_encoder_rounds_to_the_nearest_count(maker, share):
    case = load("pd")
    coarse = replace(scene.sampling_of(case.parameters), bits=12, delay=0, limit=None)
    exact = replace(coarse, bits=None)
    q = inverse(scene.robot_of(case.parameters), [float(case.parameters[name]) for name in "xyz"])
    counts = np.floor(q[::3] / coarse.quantum)
    read, seen = q.copy(), q.copy()
    read[::3] = (counts + share) * coarse.quantum
    seen[::3] = (counts + np.round(share)) * coarse.quantum
    rounded, plain = torques(maker, case, coarse, [read])[0], torques(maker, case, exact, [seen])[0]
    np.testing.assert_allclose(rounded, plain, rtol=1e-9)
    assert np.abs(rounded - torques(maker, case, exact, [read])[0]).max() > 1e-5


@pytest.mark.parametrize("maker", MAKERS)
def test_a_torque_is_bounded(maker):
    case = load("circle")
    free = replace(scene.sampling_of(case.parameters), delay=0, limit=None)
    angles = poses(case, 20, 2)
    unbounded = torques(maker, case, free, angles)
    limit = float(np.median(np.abs(unbounded)))
    bounded = torques(maker, case, replace(free, limit=limit), angles)
    np.testing.assert_array_equal(bounded, np.clip(unbounded, -limit, limit))
    assert (np.abs(unbounded) > limit).any()


@pytest.mark.parametrize("maker", MAKERS)
def test_the_integral_of_the_error_is_bounded(maker):
    case = load("circle")
    free = replace(scene.sampling_of(case.parameters), delay=0, limit=None, bits=None)
    x, y, z = (float(case.parameters[name]) for name in "xyz")
    aside = inverse(scene.robot_of(case.parameters), [x, y, z + 0.02])
    wide, tight = (
        torques(maker, cases.load("delta_tracking", variant="circle", clamp=clamp), free, [aside] * 40)
        for clamp in (1e3, 4.0 * 0.02 * free.period)
    )
    grown = np.abs(wide - tight).max(axis=1)
    assert grown[:3].max() < 1e-12 * np.abs(wide).max(), "the bound is not reached in the first samples"
    assert grown[-1] > 1e-3


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("seed", range(3))
def test_torques_and_gaps_of_the_scene_are_those_of_the_reference(seed, sign):
    """In any pose, closed or not: the kernels that the reference runs, and what the engines work out for themselves."""
    rng = np.random.default_rng(seed)
    case = cases.load("soft_contact", "delta", sign=sign)
    robot = scene.robot_of(case.parameters)
    p, own = robot.array(), controller.numbers(of_numbers(case.parameters))
    for q, v in zip(case.q0[:9] + 0.3 * rng.standard_normal((20, 9)), rng.standard_normal((20, 9)), strict=True):
        y, x, asked = np.ascontiguousarray(q[::3]), q.reshape(3, 3)[:, 1:].ravel(), rng.standard_normal(3)
        z, hold, found = np.empty((3, 3))
        Jy, My, X = np.empty((3, 3)), np.empty((3, 3)), np.empty((6, 3))
        kinematics.jacobians(p, y, x, z, Jy, X, hold)
        kinematics.task_mass(p, y, x, True, My)
        controller.motor_torque(y, x, asked, own, found)
        np.testing.assert_allclose(found, My @ np.linalg.solve(Jy, asked) + hold, rtol=1e-11)
        gap, rate = np.empty(6), np.empty(6)
        kernels.gaps(0.0, q, v, p, gap, rate)
        ends = pose.tips(case.parameters, q)
        np.testing.assert_allclose(np.concatenate([ends[0] - ends[1], ends[0] - ends[2]]), gap, atol=1e-14)


def test_a_pose_without_a_direction_has_no_torque():
    parameters = of_numbers(cases.load("soft_contact", "delta").parameters)
    found = np.zeros(3)
    controller.motor_torque(np.zeros(3), np.zeros(6), np.ones(3), controller.numbers(parameters), found)
    assert np.isnan(found).all()
