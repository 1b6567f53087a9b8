"""What a short run takes of the processors until its verdicts are shown, and with its pages, in a warm cache.

Printed by `pytest tests/reports/test_start_speed.py -m bench -s`.
"""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import pytest

RUNS, ASKED = 9, 0.7  # s
SCRIPT = """
import os
import sys
import time
from pathlib import Path
from crossbody.reports import cli, entry

do, told = cli._do, Path(sys.argv.pop(1))

def noted(where, *given, **asked):
    from crossbody.reports.commands import run

    tell = run._tell
    run._tell = lambda *rows, **how: (tell(*rows, **how), note())[0]
    return do(where, *given, **asked)

def note():
    parent = int(Path(f"/proc/{os.getppid()}/schedstat").read_text().split()[0]) / 1e9  # it has one thread
    told.write_text(str(time.process_time() + parent))

cli._do = noted
entry.main()
"""


def once(out: Path) -> tuple[float, float]:
    """Processor time of a command with its children until the table is shown, and in all, s."""
    told = out.with_suffix(".txt")
    words = ["run", "bouncing_ball:listing", "-e", "reference:compiled", "--out", str(out)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", SCRIPT, str(told), *words], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return float(told.read_text()), after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


@pytest.mark.bench
@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="needs the scheduler's account")
def test_a_run_is_judged_within_what_is_asked(tmp_path: Path) -> None:
    once(tmp_path / "warm")
    until, whole = map(min, zip(*(once(tmp_path / str(k)) for k in range(RUNS)), strict=True))  # others only add to it
    print(f"\nprocessor time of a run until its verdicts are shown {until:.2f} s, with its pages {whole:.2f} s")
    assert until < whole
    assert until < ASKED
