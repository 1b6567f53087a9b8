"""Published measurements are read by the maps that come along; skipped where the data are not at hand."""

from __future__ import annotations

import numpy as np
import pytest
from rig_data import CUBE, PENDULUM, needs_cube, needs_pendulum

from crossbody import hw
from crossbody.cases import InvalidValue, LogFormatError


@needs_pendulum
@pytest.mark.parametrize(("name", "links", "rows"), [("single", 1, 36668), ("double", 2, 69342)])
def test_a_pendulum_is_read(name: str, links: int, rows: int) -> None:
    log = hw.read(PENDULUM / f"{name}_train.parquet", f"multiarm_{name}")
    q, v = log.matrix("coordinates"), log.matrix("velocities")
    assert q.shape == v.shape == (rows, links)
    assert log.sample_time == 1e-3
    assert not log.findings
    assert not log.provenance.synthetic
    path = np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(log.time)[:, None], axis=0)
    np.testing.assert_allclose(q[1:] - q[0], path, atol=5e-2)


@needs_pendulum
@pytest.mark.parametrize(
    ("before", "after"), [("w1", "w2"), ("th1", "th2"), ('unit = "rad"', 'unit = "deg"'), ('"rad/s"', '"deg/s"')]
)
def test_a_wrong_map_of_a_real_log_is_noticed(before: str, after: str) -> None:
    text = hw.dump_columns(hw.load_columns("multiarm_double"))
    swapped = text.replace(f'"{before}"', '"#"').replace(f'"{after}"', f'"{before}"').replace('"#"', f'"{after}"')
    wrong = swapped if before[0] in "wt" else text.replace(before, after)
    assert wrong != text
    with pytest.raises(LogFormatError, match=r"velocity integrates|one of them|it must be"):
        hw.read(PENDULUM / "double_train.parquet", hw.parse_columns(wrong))


@needs_cube
def test_a_toss_is_read_by_its_number() -> None:
    numbers = hw.parts(CUBE, "contactnets_cube")
    assert len(numbers) == 190
    log = hw.read(CUBE, "contactnets_cube", part=numbers[7])
    assert 80 <= len(log) <= 442
    np.testing.assert_allclose(log.time, np.arange(len(log)) / 148.0, rtol=1e-15)
    quaternion = log.matrix("coordinates", ("qw", "qx", "qy", "qz"))
    np.testing.assert_allclose(np.linalg.norm(quaternion, axis=1), 1.0, atol=1e-5)
    assert log.matrix("velocities").shape == (len(log), 6)
    assert log.provenance.part == numbers[7]


@needs_cube
def test_a_toss_must_be_named() -> None:
    with pytest.raises(InvalidValue, match="part"):
        hw.read(CUBE, "contactnets_cube")
    with pytest.raises(LogFormatError, match="no samples"):
        hw.read(CUBE, "contactnets_cube", part=10_000)
