"""What was asked last is not computed again."""

import numpy as np

from crossbody.cases.remembered import remembered


def test_the_same_objects_are_asked_about_once_and_equal_ones_anew() -> None:
    asked = []

    @remembered(2)
    def total(values: np.ndarray, twice: bool = False) -> float:
        asked.append(values)
        return float(values.sum()) * (1 + twice)

    one, two, three = np.ones(3), np.ones(3), np.zeros(1)
    assert [total(one), total(one), total(two), total(two), total(one)] == [3.0] * 5
    assert len(asked) == 2
    assert (total(one, twice=True), total(one, twice=True), len(asked)) == (6.0, 6.0, 3)
    assert (total(three), total(one), len(asked)) == (0.0, 3.0, 5)  # only the last two are kept
