"""What the reference says of a run, in the words of the case."""

from __future__ import annotations

import pytest

from crossbody.engines.reference import LONG, by_name

NAMES = ("floor/heel", "floor/toe", "floor/hand")


@pytest.mark.parametrize(
    ("rows", "said"),
    [("Rows [0, 2] ", "Rows [0, 2] (floor/heel, floor/hand) "), ("the law of rows [1],", "rows [1] (floor/toe),"),
     ("Rows [7] ", "Rows [7] ")],
)  # fmt: skip
def test_contacts_are_named_where_rows_are_numbered(rows: str, said: str) -> None:
    assert said in by_name(f"They contradict. {rows}t = 1 s, q = [1.0], v = [2.0].", NAMES)


@pytest.mark.parametrize("width", [1, LONG // 2, LONG // 2 + 1, 40])
def test_a_long_state_is_left_to_the_motion(width: int) -> None:
    state = f", q = {[1.0] * width}, v = {[2.0] * width}."
    said = by_name(f"Advice. Rows [1], t = 0.5 s{state}", NAMES)
    assert said.startswith("Advice. Rows [1] (floor/toe), t = 0.5 s")
    assert (state in said) is (2 * width <= LONG)
    assert "2.0, 2.0" not in said or 2 * width <= LONG
