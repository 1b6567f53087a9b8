"""What all tests ask of the process that runs them."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator, Sequence

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


DRAWS = 6  # of a law over seeds, in the gate; make slow looks at the others


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: Sequence[pytest.Item]) -> None:
    """Leave all but the first seeds of a law over 0, 1, 2, ... to `make slow`; lists of chosen seeds stay whole."""
    seeds: dict[str, dict[pytest.Item, int]] = {}
    for item in items:
        seed = getattr(item, "callspec", None) and item.callspec.params.get("seed")
        if type(seed) is int and not item.get_closest_marker("slow"):
            seeds.setdefault(item.nodeid.partition("[")[0], {})[item] = seed
    for drawn in seeds.values():
        if set(drawn.values()) == set(range(len(set(drawn.values())))):
            for item in (item for item, seed in drawn.items() if seed >= DRAWS):
                item.add_marker(pytest.mark.slow)


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
