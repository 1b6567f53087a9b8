"""What all tests ask of the process that runs them."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator

import pytest
from hypothesis import settings

from crossbody.cases import installed
from crossbody.reference import code_store

# Interrupts are tested by sending them. A shell without job control starts what it puts in the background with SIGINT
# ignored, and children inherit that; a handler is not inherited.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Other work may share the machine: no example fails by how long it takes.
settings.register_profile("unhurried", settings(), deadline=None)
settings.load_profile("unhurried")


@pytest.fixture(autouse=True, scope="session")
def compiles_in_silence() -> None:
    """Let a cold cache say nothing in whichever test compiles first."""
    code_store.SLOW_S = 3600.0


@pytest.fixture
def own_plugins() -> Iterator[None]:
    """Let a test have plug-ins that the others do not see."""
    yield
    for module in installed._FILES.values():
        sys.modules.pop(module.__name__, None)
    installed._FILES.clear()
    if "joblib" in sys.modules:  # processes that tests have left know the plug-ins
        from joblib.externals.loky import get_reusable_executor

        get_reusable_executor().shutdown(wait=True)
