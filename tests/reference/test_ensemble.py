"""Many runs in threads: the same as one by one, whatever the number of threads; and runs whose memory stays flat."""

import zlib

import numpy as np
import pytest
from mechanisms import ball, sliders

from crossbody.cases import InvalidValue, Outcome, SceneError, UnknownName
from crossbody.reference import Options, System, ensemble, prepare, simulate
from crossbody.reference.systems import ball as ball_kernels

N = 40
HEIGHTS = np.linspace(0.1, 1.0, N)


def test_every_run_is_the_single_run_bit_by_bit() -> None:
    a1 = np.linspace(5.0, 25.0, N)
    many = ensemble(ball(), HEIGHTS[:, None], np.zeros((N, 1)), 2.0, law={"a1": a1}, threads=2, rtol=1e-9)
    for i in (0, 7, N - 1):
        one = simulate(ball(a1=a1[i]), [HEIGHTS[i]], [0.0], 2.0, rtol=1e-9, samples=[])
        end = prepare(ball(a1=a1[i]), [HEIGHTS[i]], [0.0], Options(t_end=2.0, rtol=1e-9))
        last = end.trajectory(*end.go())
        assert many.q[i, 0] == last.q[-1, 0]
        assert many.v[i, 0] == last.v[-1, 0]
        assert many.steps[i] == one.steps
        assert many.events[i] == len(last.events)


NUMBERS = {
    "a0": (50.0, 200.0), "a1": (2.0, 20.0), "a2": (1e5, 1e6), "b0": (1e4, 1e5), "b1": (5.0, 50.0),
    "mass": (0.5, 2.0), "gravity": (5.0, 15.0),
}  # fmt: skip


@pytest.mark.parametrize("name", NUMBERS)
def test_every_number_of_a_run_is_its_own(name: str) -> None:
    """Each constant and parameter alone differs from run to run, in contacts of one set of constants and of two."""

    def of(**given: float) -> System:
        known = {key: low if name[0] != "a" or key[0] != "b" else 0.0 for key, (low, _) in NUMBERS.items()} | given
        named = {key: known.pop(key) for key in ("mass", "gravity")}
        return System(n=1, parameters=named, constant_mass=True, affine=True, **known, **ball_kernels.KERNELS)

    values = np.random.default_rng(zlib.crc32(name.encode())).uniform(*NUMBERS[name], 4)
    own = {"parameters" if name in ("mass", "gravity") else "law": {name: values}}
    how = {"rtol": 1e-9, "collisions": "resolved"}
    many = ensemble(of(), np.full((4, 1), 0.3), np.zeros((4, 1)), 1.0, threads=1, **own, **how)
    alone = [simulate(of(**{name: value}), [0.3], [0.0], 1.0, samples=[1.0], **how) for value in values.tolist()]
    assert [run.outcome for run in alone] == list(many.outcome)
    np.testing.assert_array_equal(many.q, [run.q[-1] for run in alone])
    np.testing.assert_array_equal(many.v, [run.v[-1] for run in alone])
    assert name == "mass" or len(set(many.v[:, 0].tolist())) == 4


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_threads_do_not_change_the_result(threads: int) -> None:
    runs = ensemble(ball(), HEIGHTS[:, None], np.zeros((N, 1)), 2.0, threads=threads)
    alone = ensemble(ball(), HEIGHTS[:, None], np.zeros((N, 1)), 2.0, threads=1)
    np.testing.assert_array_equal(runs.q, alone.q)
    assert set(runs.outcome) == {Outcome.FINISHED}


def test_failures_are_outcomes_of_their_own_runs() -> None:
    # A step bound that the deepest drops do not meet.
    runs = ensemble(ball(), HEIGHTS[:, None], np.zeros((N, 1)), 5.0, max_steps=20, shortcuts=False)
    assert Outcome.STEP_LIMIT in set(runs.outcome)
    assert np.all(runs.t[runs.outcome == Outcome.STEP_LIMIT] < 5.0)


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"q0": np.zeros((0, 1)), "v0": np.zeros((0, 1))}, SceneError, "no line"),
        ({"v0": np.zeros((2, 1))}, SceneError, "v0"),
        ({"law": {"a7": np.ones(N)}}, UnknownName, "a0"),
        ({"law": {"a0": -np.ones(N)}}, SceneError, "at least 0"),
        ({"parameters": {"colour": np.ones(N)}}, UnknownName, "colour"),
        ({"threads": -1}, InvalidValue, "threads"),
        ({"samples": [0.5]}, InvalidValue, "samples"),
        ({"events": True}, InvalidValue, "events"),
    ],
)
def test_bad_input_is_named(given: dict, error: type[Exception], words: str) -> None:
    call = {"q0": HEIGHTS[:, None], "v0": np.zeros((N, 1)), **given}
    with pytest.raises(error, match=words):
        ensemble(ball(), call.pop("q0"), call.pop("v0"), 1.0, **call)


def _bounces(t_end: float, **options: object) -> tuple[int, int]:
    """Bounces counted, and bytes held, of an undamped ball."""
    run = prepare(
        ball(a0=1e6, a1=0.0, a2=0.0), [0.01], [0.0],
        Options(t_end=t_end, samples=[t_end], max_steps=10**9, rtol=1e-6, **options),
    )  # fmt: skip
    outcome, wall = run.go()
    assert outcome is Outcome.FINISHED
    counts = run.trajectory(outcome, wall).counts
    return counts["events"], sum(array.nbytes for array in run.buffers.values())


def test_memory_is_flat_when_events_are_not_kept() -> None:
    few, many = _bounces(1.0, events=False), _bounces(200.0, events=False)
    assert many[0] > 100 * few[0]
    assert many[1] == few[1]
    assert _bounces(200.0)[1] > many[1]


def test_a_scene_without_contacts_evaluates_no_guard() -> None:
    free = sliders(1)
    run = simulate(free, [0.0], [1.0], 1.0)
    assert free.nc == 0
    assert run.counts["guards"] == 0
