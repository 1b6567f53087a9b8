"""Wrong numbers of tables of controls, and wrong constants of rows: each is told with its place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crossbody import cases
from crossbody.cases import InvalidValue

ARM = """<mujoco><worldbody><body><joint name="h" axis="0 1 0"/><geom type="sphere" size=".1" pos="0 0 -1"/></body>
</worldbody><actuator><motor name="m" joint="h"/><motor name="n" joint="h"/></actuator></mujoco>"""
VALID = "t must be finite, at least 0 and increasing"


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    (tmp_path / "arm.xml").write_text(ARM)
    return tmp_path / "arm.xml"


@pytest.mark.parametrize("seed", range(12))
def test_the_row_and_column_of_a_wrong_number_are_told(arm: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    table = [[f"{0.1 * k:g}", "1", "2"] for k in range(rng.integers(2, 9))]
    row, column = int(rng.integers(0, len(table))), int(rng.integers(0, 3))
    name, text = ("t", "m", "n")[column], str(rng.choice(["x", "", "inf", "1,5", "1e"][: 3 if column else 1]))
    table[row][column] = text
    path = arm.parent / "u.csv"
    path.write_text("\n".join(["t,m,n", *map(",".join, table)]))
    with pytest.raises(InvalidValue, match=rf"u\.csv.*row {row + 1} has .* for '{name}'"):
        cases.load(str(arm), ctrl=str(path))


@pytest.mark.parametrize(("times", "row"), [("0 .1 .1", 3), ("-1 0 1", 1), ("0 .2 .1", 3), ("nan 1 2", 1)])
def test_the_row_of_a_wrong_time_is_told(arm: Path, times: str, row: int) -> None:
    path = arm.parent / "u.csv"
    path.write_text("\n".join(["t,m,n", *(f"{t},1,2" for t in times.split())]))
    with pytest.raises(InvalidValue, match=f"{VALID}; row {row} has"):
        cases.load(str(arm), ctrl=str(path))
    path.write_text("t,m,n\n")
    with pytest.raises(InvalidValue, match="have no rows"):
        cases.load(str(arm), ctrl=str(path))


@pytest.mark.parametrize("name", ["a0", "a1"])
@pytest.mark.parametrize("value", [-0.5, -0.999, -1e-9])
def test_no_constant_of_rows_is_negative(arm: Path, name: str, value: float) -> None:
    with pytest.raises(InvalidValue, match=f"{name} is .*valid: at least 0, or -1 for the file's own"):
        cases.load(str(arm), **{name: value})
