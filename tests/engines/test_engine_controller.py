"""The sampled controller of the engines against the reference's compiled one: two texts of the same equations."""

from dataclasses import replace

import numpy as np
import pytest

from crossbody import cases
from crossbody.engines._delta import torque
from crossbody.engines._delta.controller import controller
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


def own(case, sampling):
    p = case.parameters
    return controller(p, scene.robot_of(p), scene.path_of(p), sampling)


MAKERS = {"compiled": Compiled, "own": own}


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
def test_torques_gaps_and_energies_of_the_engines_are_those_of_the_reference(seed, sign):
    """In any pose, closed or not: the kernels that the reference runs, and what the engines work out for themselves."""
    rng = np.random.default_rng(seed)
    case = cases.load("soft_contact", "delta", sign=sign)
    robot = scene.robot_of(case.parameters)
    p, own = robot.array(), torque.numbers(robot)
    for q, v in zip(case.q0[:9] + 0.3 * rng.standard_normal((20, 9)), rng.standard_normal((20, 9)), strict=True):
        y, x, asked = np.ascontiguousarray(q[::3]), q.reshape(3, 3)[:, 1:].ravel(), rng.standard_normal(3)
        z, hold, found = np.empty((3, 3))
        Jy, My, X = np.empty((3, 3)), np.empty((3, 3)), np.empty((6, 3))
        kinematics.jacobians(p, y, x, z, Jy, X, hold)
        kinematics.task_mass(p, y, x, True, My)
        torque.motor_torque(y, x, asked, own, found)
        np.testing.assert_allclose(found, My @ np.linalg.solve(Jy, asked) + hold, rtol=1e-11)
        gap, rate, energy = np.empty(6), np.empty(6), np.empty(2)
        kernels.gaps(0.0, q, v, p, gap, rate)
        kernels.energy(q, v, p, energy)
        gaps, energies = torque.gaps_and_energy(robot, q[None], v[None])
        np.testing.assert_allclose(gaps[0], gap, atol=1e-14)
        np.testing.assert_allclose(energies[0], energy, rtol=1e-13, atol=1e-14)


def test_a_pose_without_a_direction_has_no_torque():
    robot = scene.robot_of(cases.load("soft_contact", "delta").parameters)
    found = np.zeros(3)
    torque.motor_torque(np.zeros(3), np.zeros(6), np.ones(3), torque.numbers(robot), found)
    assert np.isnan(found).all()
