"""SUNDIALS prints: warnings to the process's stderr, failures to stdout. Both belong in the Outcome."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout

WARNINGS = "SUNLOGGER_WARNING_FILENAME"  # read by SUNDIALS whenever a solver is set up


@contextmanager
def quiet() -> Iterator[io.StringIO]:
    """Keep the process's own output clean; yields what scikit-sundae prints."""
    before = os.environ.get(WARNINGS)
    os.environ[WARNINGS] = os.devnull
    try:
        with redirect_stdout(io.StringIO()) as said:
            yield said
    finally:
        if before is None:
            del os.environ[WARNINGS]
        else:
            os.environ[WARNINGS] = before
