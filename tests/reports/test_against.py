"""What `run --against` prints of what has changed since another run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crossbody.reports.cli import main
from crossbody.reports.pages.index_page import changes

RUN = ["run", "bouncing_ball", "--variant", "linear", "-e", "reference:compiled", "--out"]


def told(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    with pytest.raises(SystemExit) as end:
        main([*RUN, *words])
    assert not end.value.code
    return " ".join(capsys.readouterr().out.split())


def test_what_has_changed_is_counted_and_verdicts_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert "Against" not in told(capsys, "one")
    assert "Against one: 0 of " in told(capsys, "two", "--against", "one")
    said = told(capsys, "two", "--against", "one", "--rtol", "1e-7")
    assert "Against one: 1 of " in said
    assert "changed: reference:compiled on bouncing_ball:linear: rate_residual was within, is not judged" in said
    assert "Against" not in told(capsys, "two", "--against", "one", "--quiet")


@pytest.mark.parametrize("seed", range(20))
def test_a_value_that_moved_is_listed_whatever_becomes_of_its_limit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    before, limits = 10.0 ** rng.uniform(-9, -6), 10.0 ** rng.uniform(-6, -3, 2)
    by = float(10.0 ** rng.uniform(-9, -3))

    def row(value: float, limit: float, settings: str) -> dict[str, Any]:
        about = {"case": "ball", "variant": "v", "engine": "e", "profile": "p", "label": "ball:v", "who": "e:p"}
        numbers = {"value": value, "expected": None, "limit": float(limit), "verdict": "within", "unit": "1"}
        return about | numbers | {"metric": "position", "settings": settings, "why": "", "known": None, "where": ""}

    other = row(1.0, 1.0, "") | {"case": "other", "label": "other:v"}
    found = changes(
        [row(before + by, limits[1], "rtol=1e-07 n=2")], [row(before, limits[0], "rtol=1e-09 n=2"), other], "one"
    )
    listed = [one for table in found.tables for one in table.rows]
    assert bool(listed) == (by > 0.1 * limits.min())
    if listed:
        assert (listed[0]["limit_before"], listed[0]["limit"], listed[0]["unit"]) == (limits[0], limits[1], "")
    assert "limits changed: 1" in found.text
    assert "0 are gone. 1 cases of it were not run now." in found.text
    assert found.text.endswith("e:p ran with rtol=1e-07 instead of 1e-09.")
