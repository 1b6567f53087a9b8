"""numba, imported without two libraries that it only looks at: they take a tenth of its time."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

LOOKED_AT = ("scipy", "yaml")
"""One for its version, which the package asks for too; the other to read a file of settings that may stand here."""
SETTINGS = ".numba_config.yaml"


def load() -> None:
    """Import numba; whoever imports it before, or has such a file, gets it whole."""
    if "numba" in sys.modules or Path(SETTINGS).exists():
        return
    hidden = [name for name in LOOKED_AT if name not in sys.modules]
    sys.modules.update(dict.fromkeys(hidden))  # type: ignore[arg-type]  # an import of None fails
    try:
        import_module("numba")
    finally:
        for name in hidden:
            del sys.modules[name]
