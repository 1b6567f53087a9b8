"""Ratios of run times, all in one run: `make bench` prints and judges them."""

from __future__ import annotations

import pytest

from crossbody.reports.bench import skip as skip
from crossbody.reports.bench import throughput as throughput
from crossbody.reports.bench.headline import headline
from crossbody.reports.bench.ladder import Effort
from crossbody.reports.bench.measure import bench
from crossbody.reports.bench.scenes import DROP, PAIR, picks

pytestmark = pytest.mark.bench
FASTER = 30.0
PRECISE = 1e-9


def test_the_drop_is_thirty_times_faster_than_the_fastest_engine_at_its_best_error() -> None:
    found = headline(bench(DROP.case(), picks([]), Effort(repeats=5, slow=0.1, longest=0.3)))
    print("\n" + found.to_string(index=False, float_format=lambda x: f"{x:.3g}"))
    assert (found["reference_error"].dropna() <= PRECISE).all()
    others = found[found["engine"] != "reference"]
    assert len(others) > 0
    assert others["ratio"].min() >= FASTER


def test_one_collision_is_ahead_of_every_engine_at_every_error() -> None:
    wanted = [pick for pick in picks([]) if pick.engine != "reference" or pick.profile == "compiled"]
    found = headline(bench(PAIR.case(), wanted, Effort(repeats=9, slow=0.1, longest=0.3)))
    print("\n" + found.to_string(index=False, float_format=lambda x: f"{x:.3g}"))
    assert found["ratio"].min() > 1.0


def test_what_a_scene_does_not_need_costs_nothing() -> None:
    found = skip.measure(7)
    print("\n" + found.to_string(index=False, float_format=lambda x: f"{x:.3g}"))
    assert found["held"].all(), found[~found["held"]]["what"].to_list()


@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
def test_ensemble_against_mujocos_own_batch(integrator: str) -> None:
    pytest.importorskip("mujoco")
    found = throughput.against_mujoco(3, integrator)
    print(f"\n{found['what']}: {found['value']:.0f} ({found['beside']})")
    assert found["value"] >= throughput.LEAST_RATIO


def test_two_cores_run_nearly_twice_as_many() -> None:
    found = throughput.two_cores(5)
    if found["how"].startswith("not judged"):
        pytest.skip(f"{found['how']}; the ensemble reached {found['value']:.2f}")
    print(f"\n{found['value']:.2f} ({found['beside']})")
    assert found["value"] >= throughput.LEAST_TWO
