"""The command `crossbody` with engines that take their time, never come back, or take their process with them."""

from __future__ import annotations

import sys
from typing import Any

from crossbody.reports import cli


def patched(arguments: list[str] | None) -> int:
    """Obey with the engine `fake` beside the others; what is heavy is imported here, as by the command itself."""
    import ctypes
    import os
    import signal
    import time
    from dataclasses import replace
    from pathlib import Path
    from types import MappingProxyType

    from crossbody import engines
    from crossbody.hw import models
    from crossbody.reports.judging.truth import truth_of

    def act(case: Any, profile: str) -> Any:
        if profile == "stuck":
            Path("stuck").touch()
            ctypes.PyDLL(None).sleep(1000)  # as compiled code does: the interpreter is not let go
        if profile == "slow":
            time.sleep(1.0)
        if profile == "crash":
            os.kill(os.getpid(), signal.SIGSEGV)
        if profile == "fault":
            raise LookupError("a fault of its own")
        return replace(truth_of(case).trajectory, steps=0)  # it tells no steps of its own

    class FakeRun(engines.Run):
        engine, settings = "fake", MappingProxyType({"dt": 1e-3})

        def __init__(self, case: Any, profile: str) -> None:
            self.case, self.profile = case, profile

        def run(self) -> Any:
            return act(self.case, self.profile)

        def audit(self) -> Any:
            return {}

    class Fake(engines.Engine):
        name, versions = "fake", MappingProxyType({})
        profiles = MappingProxyType(dict.fromkeys(("exact", "slow", "stuck", "crash", "fault"), ""))

        def prepare(self, case: Any, profile: str = "exact", **_: Any) -> FakeRun:
            return FakeRun(case, profile)

    fake, real = Fake(), engines.load
    engines.names = lambda: ("fake",)

    def load(name: str) -> Any:
        if name == "broken":
            raise LookupError("a fault of its own")
        return fake if name == "fake" else real(name)

    engines.load = load
    ball = replace(models.load("ball"), engine="fake:stuck")
    real_model = models.load
    models.load = lambda name: ball if name == "ball" and "identify" in sys.argv else real_model(name)
    return obey(arguments)


if __name__ == "__main__":
    obey, cli._obey = cli._obey, patched
    cli.main()
