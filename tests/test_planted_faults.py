"""A sample of the faults of faults.toml, each planted in a copy of the sources and seen (`make faults` plants all)."""

from __future__ import annotations

from pathlib import Path

import plant_faults
import pytest
from plant_faults import Fault, Kept, Tree

FAULTS = plant_faults.faults()
SAMPLE = [fault for fault in FAULTS if fault.quick]


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Tree:
    return Tree(tmp_path_factory.mktemp("faults"))


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Kept:
    return Kept(tmp_path_factory.mktemp("kept") / "kept.jsonl")


@pytest.mark.parametrize("fault", SAMPLE, ids=lambda fault: fault.name)
def test_a_planted_fault_is_seen(fault: Fault, tree: Tree, kept: Kept) -> None:
    assert all(plant_faults.seen(tree, fault, kept).values())


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_every_fault_can_be_planted_and_says_what_sees_it(fault: Fault) -> None:
    assert (plant_faults.ROOT / fault.file).read_text(encoding="utf-8").count(fault.old) == 1
    assert fault.checks
    for kind, arguments in fault.checks:
        assert kind in ("run", "command") or Path(plant_faults.ROOT / arguments.split()[0].partition("::")[0]).is_file()


def test_ten_are_a_sample_of_at_least_eighty() -> None:
    assert len(SAMPLE) >= 10
    assert len(FAULTS) >= 80
    assert len({fault.name for fault in FAULTS}) == len(FAULTS)


def test_too_few_seen_is_a_failure() -> None:
    few = {fault: {"run": i % 7 != 0} for i, fault in enumerate(FAULTS[:70])}
    enough = {fault: {"run": i % 10 != 0, "test": True} for i, fault in enumerate(FAULTS[:70])}
    assert [plant_faults.summary(found)[1] for found in (few, enough)] == [False, True]
