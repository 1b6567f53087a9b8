"""Linear models of contacts that stick and slide: closed forms, and complex steps through all equations at once."""

from __future__ import annotations

import numpy as np
import pytest
from friction_scenes import G, box_on_floor, linear, point, random_problem, rubbed_tree, sphere_on_floor, tossed

from crossbody import cases
from crossbody.cases import Mode, SceneError
from crossbody.cases.files.case import case_of
from crossbody.engines.equations import system_of
from crossbody.reference import simulate
from crossbody.reference.linear import linearise, trim
from crossbody.reference.linear.differences import differences
from crossbody.reference.tree.system import system

STEP, AGREE = 1e-30, 1e-8


def motion(made, modes, q, v):
    """v' (n,) from all equations with all forces as unknowns, in the type of the state."""
    n, kind = made.n, np.result_type(q, v)
    on = np.array([i for i, mode in enumerate(modes) if mode in (Mode.STICK, Mode.SLIP, Mode.CONTACT)], dtype=np.int64)
    p, u, w = made.p.astype(kind), np.zeros(made.inputs, kind), np.zeros(made.scratch, kind)
    M, f, H = np.zeros((n, n), kind), np.zeros(n, kind), np.zeros((len(on), n), kind)
    h, Hdv, q, v = np.zeros(len(on), kind), np.zeros(len(on), kind), q.astype(kind), v.astype(kind)
    blocks = np.zeros((n, made.mass_block), kind)
    made.dynamics(0.0, q, v, u, p, blocks, f, w)
    made.rows(0.0, q, v, p, w, on, len(on), H, h, Hdv)
    for b in range(0, n, made.mass_block):
        M[b : b + made.mass_block, b : b + made.mass_block] = blocks[b : b + made.mass_block]
    A, right = np.zeros((n + len(on),) * 2, kind), np.zeros(n + len(on), kind)
    A[:n, :n], A[:n, n:], right[:n] = M, -H.T, f
    place = {row: k for k, row in enumerate(on.tolist())}
    for row, k in place.items():
        normal = made.follows[row]
        if normal >= 0 and modes[normal] == Mode.SLIP:
            first = made.tangent[normal]
            ways = [place[t] for t in range(first, first + made.tangents[normal])]
            slip = H[ways] @ v - made.drift[on[ways]]
            part = (H[k] @ v - made.drift[row]) / np.sqrt(slip @ slip)
            A[n + k, n + k] = 1.0
            if made.dry[row]:
                right[n + k] = -made.friction_loss[row] * part
            else:
                A[n + k, n + place[normal]] = made.mu[row] * part
            continue
        a0, a1, a2 = made.alpha[row]
        A[n + k, :n] = H[k]
        right[n + k] = -Hdv[k] - a1 * (H[k] @ v - made.drift[row]) - a0 * h[k] - a2 * h[k] ** 3
    if kind.kind == "f" and np.linalg.matrix_rank(A) < len(A):
        return np.linalg.lstsq(A, right, rcond=1e-11)[0][:n]  # rows that share: what moves is unique
    return np.linalg.solve(A, right)[:n]


def moved(made, q, d):
    """Positions that displacements d (n,) of the tangent space lead to from q, to first order."""
    N = np.stack([made.displacement(q, e) for e in np.eye(made.n)], axis=-1)
    return q + N @ d


def slope(made, modes, q, v):
    """Derivative of v' by (dq, v), to rounding; where rows share a load by differences, and its relative error."""
    try:
        return stepped(made, modes, q, v), AGREE
    except np.linalg.LinAlgError:
        n = made.n
        there = lambda x: motion(made, modes, moved(made, q, x[:n]), v + x[n:])  # noqa: E731
        return differences(there, np.zeros(2 * n), 1e-4), 1e-6


def stepped(made, modes, q, v):
    columns = []
    for step in 1j * STEP * np.eye(2 * made.n):
        columns.append(motion(made, modes, moved(made, q, step[: made.n]), v + step[made.n :]).imag / STEP)
    return np.stack(columns, axis=-1)


def agrees(made, modes, q, v):
    contacts = [i for i, mode in enumerate(modes) if mode in (Mode.STICK, Mode.SLIP) and made.tangents[i] > 0]
    sliding = [i for i in contacts if modes[i] == Mode.SLIP]
    found = linearise(made, q, v, active=contacts, sliding=sliding).A[made.n :]
    expected, close = slope(made, modes, q, v)
    size = np.abs(expected).max(axis=1, keepdims=True)
    assert np.abs((found - expected) / np.maximum(size, 1e-3 * size.max() or 1.0)).max() < close


def visited(made, run, most=4):
    """In every set of modes that touches something, the sample at which what slides does so fastest."""
    best: dict[bytes, tuple[float, int]] = {}
    for k, modes in enumerate(run.mode):
        slip = made.gap(run.q[k], run.v[k])[1] - made.drift
        sliding = [i for i in np.flatnonzero(modes == Mode.SLIP) if made.tangents[i] > 0]
        ways = [slip[made.tangent[i] : made.tangent[i] + made.tangents[i]] for i in sliding]
        slowest = min((float(np.linalg.norm(way)) for way in ways), default=np.inf)
        if np.any(modes >= Mode.STICK) and slowest > 1e-4:
            best[modes.tobytes()] = max(best.get(modes.tobytes(), (0.0, k)), (slowest, k))
    return [k for _, k in list(best.values())[:most]]


def all_agree(made, run):
    """Compare in every set of modes; a sample may stand just where a contact begins to slide."""
    count = 0
    for k in visited(made, run):
        try:
            agrees(made, run.mode[k], run.q[k].copy(), run.v[k].copy())
            count += 1
        except SceneError as refused:
            if "sticks with a force" not in str(refused):
                raise
    assert count or not np.any(run.mode >= Mode.STICK)


@pytest.mark.parametrize("seed", range(12))
def test_tossed_bodies_at_every_set_of_modes(seed):
    """Spheres and ellipsoids in space: slips turn, and their frames do."""
    scene, q, v, _ = tossed(seed)
    made = system(scene, case_of(scene).law)
    all_agree(made, simulate(made, q, v, 0.6, rtol=1e-8))


@pytest.mark.parametrize("seed", range(12))
def test_dry_joints_at_every_set_of_modes(seed):
    scene, q, v = rubbed_tree(seed)
    made = system(scene, case_of(scene).law)
    all_agree(made, simulate(made, q, v, 1.0, rtol=1e-8))


RUBBING = [
    (name, variant) for name in cases.names() for variant in cases.variants(name)
    if cases.load(name, variant).rubs and name != "block_on_belt"  # an activation is a state beside q and v
]  # fmt: skip


@pytest.mark.parametrize(("name", "variant"), RUBBING)
def test_cases_at_every_set_of_modes(name, variant):
    case = cases.load(name, variant)
    made = system_of(case)
    run = simulate(made, case.q0, case.v0, case.t_end, rtol=1e-8)
    for k in visited(made, run, most=8):
        try:
            agrees(made, run.mode[k], run.q[k].copy(), run.v[k].copy())
        except SceneError as refused:  # a cube on a face or a block on its corners slides as the law leaves it open
            if "indeterminate" not in str(refused):
                raise


@pytest.mark.parametrize("seed", range(40))
def test_planar_contacts_in_drawn_modes(seed):
    rng = np.random.default_rng(seed)
    H, force, mu, count = random_problem(rng, 3, 0.6)
    modes = rng.choice([Mode.STICK, Mode.SLIP], count)
    sliding = np.flatnonzero(modes == Mode.SLIP)
    made = linear(H, force, mu, count, spring=rng.uniform(0.0, 50.0, len(force)), drift=rng.normal(size=count))
    q, v = 0.1 * rng.normal(size=len(force)), rng.normal(size=len(force))
    try:
        found = linearise(made, q, v, active=range(count), sliding=sliding).A[made.n :]
    except SceneError as refused:
        if "sticks with a force" not in str(refused) and "jam" not in str(refused):
            raise
        return
    expected, close = slope(made, [*modes, *modes], q, v)
    assert np.abs(found - expected).max() < close * np.abs(expected).max()


def test_block_on_a_spring_and_a_belt():
    """It sticks anywhere on the belt below its bound; at mu m g/k it slides, and swings with the spring's frequency."""
    made = point(0.3, 0.0, spring=[100.0, 0.0], drift=0.1)
    stuck = linearise(made, [0.01, 0.0], [0.1, 0.0], active=[0])
    np.testing.assert_allclose(sorted(stuck.poles().real), [-200.0, -100.0, -100.0, 0.0], atol=1e-5)
    rests = linearise(made, [0.01, 0.0], [0.1, 0.0], active=[0], reduce=True)
    assert rests.states == ("q[0]",)
    assert rests.poles().tolist() == [0.0]
    steady = trim(made, [0.02, 0.0], active=[0], sliding=[0])
    assert steady.outcome.ok
    np.testing.assert_allclose(steady.q[0], 0.3 * G / 100.0, rtol=1e-12)
    slides = linearise(made, steady.q, active=[0], sliding=[0], reduce=True)
    np.testing.assert_allclose(slides.poles(), [10.0j, -10.0j], atol=1e-12)


@pytest.mark.parametrize("spin", [(0.0, 0.0, 0.0), (3.0, -5.0, 4.0)])
def test_a_sphere_turns_its_slip_as_fast_as_friction_does(spin):
    """Friction of mu m g turns what is across a slip u at 7 mu g/(2 |u|) and leaves what is along it as it is."""
    radius, mu = 0.1, 0.2
    scene = sphere_on_floor(mu, radius)
    made = system(scene, case_of(scene).law)
    v = np.array([2.0, 0.5, 0.0, *spin])
    u = v[:2] + radius * np.array([-spin[1], spin[0]])
    A = linearise(made, [0, 0, radius, 1, 0, 0, 0], v, active=[0], sliding=[0]).A
    slip = np.zeros((2, 6))
    slip[0, 0], slip[0, 4], slip[1, 1], slip[1, 3] = 1.0, -radius, 1.0, radius
    change = slip @ A[6:, 6:] @ np.linalg.pinv(slip)  # level: the normal force does not depend on the slip
    s = u / np.linalg.norm(u)
    across = np.outer([-s[1], s[0]], [-s[1], s[0]])
    np.testing.assert_allclose(change, -3.5 * mu * G / np.linalg.norm(u) * across, atol=1e-10)


def test_a_rolling_sphere_keeps_its_speeds():
    """Seven of its twelve poles are neutral: place, pose, and the speeds of rolling and of spinning."""
    scene = sphere_on_floor(0.5, 0.1)
    made = system(scene, case_of(scene).law)
    rolls = linearise(made, [0, 0, 0.1, 1, 0, 0, 0], active=[0], reduce=True)
    assert len(rolls.states) == 8
    np.testing.assert_allclose(rolls.poles(), 0.0, atol=1e-7)


def test_corners_that_share_a_load_hold_a_box():
    """Three slips that die out at a1, three gaps with the poles of their law, and three motions that nothing holds."""
    scene = box_on_floor(0.5, tilt=0.3)
    made = system(scene, case_of(scene).law)
    q, on = [0, 0, 0.1, 1, 0, 0, 0], [0, 1, 2, 3]
    model = linearise(made, q, active=on)
    np.testing.assert_allclose(sorted(model.poles().real), [-200.0] * 3 + [-100.0] * 6 + [0.0] * 3, atol=1e-5)
    assert not [name for name in model.outputs if name.startswith("lam")]
    with pytest.raises(SceneError, match="share their load"):
        linearise(made, q, active=on, outputs=["lam"])
    with pytest.raises(SceneError, match="indeterminate"):
        linearise(made, q, [1.0, 0, 0, 0, 0, 0], active=on, sliding=on)


@pytest.mark.parametrize("seed", range(6))
def test_what_the_equations_leave_open_is_shared_by_least_norm_and_told(seed):
    """Under a box that stands on a slope: weight and moments say no more of four corners with friction."""
    rng = np.random.default_rng(seed)
    half, tilt = rng.uniform(0.05, 0.3, 3), rng.uniform(0.0, 0.4)
    scene = box_on_floor(0.5, half=tuple(half), tilt=tilt)
    found = trim(system(scene, case_of(scene).law), [0, 0, half[2], 1, 0, 0, 0], active=[0, 1, 2, 3])
    arms = [(x, y, -half[2]) for x in (-half[0], half[0]) for y in (-half[1], half[1])]
    ways = [np.concatenate([way, np.cross(arm, way)]) for arm in arms for way in np.eye(3)]
    load = scene.bodies[0].mass * G * np.array([np.sin(tilt), 0.0, -np.cos(tilt), 0.0, 0.0, 0.0])
    least = np.linalg.lstsq(np.stack(ways, axis=1), -load, rcond=None)[0]
    assert np.linalg.norm(found.lam) == pytest.approx(np.linalg.norm(least), rel=1e-9)
    assert sorted(found.lam[:4]) == pytest.approx(sorted(least[2::3]), rel=1e-9)
    assert set(found.shared) == set(found.active.tolist())
    assert not trim(system(scene, case_of(scene).law), [0, 0, half[2], 1, 0, 0, 0], active=[0]).shared


MADE = point(0.3, 0.0, spring=[100.0, 0.0], drift=0.1)


@pytest.mark.parametrize(
    ("q", "v", "sliding", "told"),
    [
        ([0.0, 0.0], [0.1, 0.0], [0], "slides at no speed"),
        ([0.3 * G / 100.0, 0.0], [0.1, 0.0], [], "sticks with a force"),
        ([1.0, 0.0], [0.1, 0.0], [], "sticks with a force"),
        ([0.0, 0.0], [0.0, 0.0], [1], "normal rows with friction"),
    ],
)
def test_what_has_no_linear_model_is_refused(q, v, sliding, told):
    with pytest.raises(SceneError, match=told):
        linearise(MADE, q, v, active=[0], sliding=sliding)


def test_contacts_that_jam_are_refused():
    """Painleve: 1 + mu g < 0 along the slip."""
    made = linear([[1.0, 0.0], [-2.0, 1.0]], [-1.0, 0.0], 0.6, 1)
    linearise(made, [0.0, 0.0], [0.0, 1.0], active=[0], sliding=[0])
    with pytest.raises(SceneError, match="jam"):
        linearise(made, [0.0, 0.0], [0.0, -1.0], active=[0], sliding=[0])
