"""Where nothing moves, that is said: verdicts of such a scene say little of motions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crossbody.cases import Trajectory
from crossbody.reports.cli import main
from crossbody.reports.measuring.scale import still
from crossbody.reports.pages import case_page, index_page
from crossbody.reports.pages.results import read


def motion(q: np.ndarray, v: np.ndarray) -> Trajectory:
    n = len(q)
    return Trajectory(t=np.linspace(0.0, 2.0, n), q=q, v=v, gap=np.zeros((n, 0)), lam=np.zeros((n, 0)),
                      energy=np.zeros((n, 2)), mode=np.zeros((n, 0), np.int8))  # fmt: skip


@pytest.mark.parametrize("seed", range(10))
def test_what_moves_by_more_than_rounding_moves(seed: int) -> None:
    draw = np.random.default_rng(seed)
    q = np.tile(draw.normal(size=3) * 10.0 ** draw.uniform(-3.0, 3.0, 3), (50, 1))
    noise = 1e-13 * np.maximum(np.abs(q), 1.0) * draw.uniform(-1.0, 1.0, q.shape)
    assert still(motion(q + noise, np.zeros((50, 3))))
    k = int(draw.integers(3))
    moves = q.copy()
    moves[30:, k] += 1e-6 * max(1.0, abs(q[0, k]))
    assert not still(motion(moves, np.zeros((50, 3))))
    assert not still(motion(q, np.full((50, 3), 1e-3 * max(1.0, np.abs(q).max()))))
    assert not still(motion(q[:0], q[:0]))


def test_a_scene_at_rest_is_said_in_the_terminal_and_on_its_pages(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    with pytest.raises(SystemExit):
        main(["run", "sliding_block:rests", "sliding_block:stops", "-e", "reference:compiled", "--out", str(out)])
    text = "Nothing moves in sliding_block:rests: the truth stays where it starts."
    assert text in " ".join(capsys.readouterr().out.split())
    found = read(out)
    leads = {case.label: case_page.case_page(found, case).lead for case in found.cases}
    assert [label for label, lead in leads.items() if text in lead] == ["sliding_block:rests"]
    assert text in index_page.index_pages(found)[0].lead
