"""The core writes and reads within its arrays alone: with indices checked, what is beyond one raises."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from crossbody import cases

RUN = """
import sys
from crossbody import cases, engines
name = sys.argv[1]
for variant in cases.variants(name):
    case = cases.load(name, variant)
    short = min(case.t_end, 0.3)
    case = cases.load(name, variant, t_end=short) if "t_end" in case.parameters else case
    for rtol in (1e-9, case.tight):
        run = engines.load("reference").prepare(case, "compiled", ledger=True, samples=200, rtol=rtol).run()
        print(variant, rtol, run.outcome)
"""


@pytest.mark.slow  # compiles the core with its checks: two minutes once
@pytest.mark.parametrize("name", cases.names())
def test_no_run_of_a_case_leaves_the_arrays(name: str) -> None:
    """Memory beyond them belongs to others, and fails elsewhere or never."""
    done = subprocess.run(
        [sys.executable, "-c", RUN, name], env={**os.environ, "CROSSBODY_DEBUG": "1"}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 2 * len(cases.variants(name))
