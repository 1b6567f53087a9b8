"""Streams that the caller has closed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

COMMAND = Path(sys.executable).parent / "crossbody"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="closes a stream between fork and exec")
@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_command_ends_as_well_without_a_stream(number: int) -> None:
    """A shell closes them with <&-, >&- or 2>&-; a file that is opened next would be written in their stead."""
    done = subprocess.run(
        [COMMAND, "list"], preexec_fn=lambda: os.close(number), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "bouncing_ball" in done.stdout or number == 1
    assert "Traceback" not in done.stderr
