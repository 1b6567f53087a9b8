"""Importers that do what importers of robot files have been seen to do, as files of plug-ins."""

from __future__ import annotations

from pathlib import Path

HEAD = 'FORMATS, PACKAGE, MODULE = ("mjcf", "urdf"), "numpy", "numpy"\n\ndef open_robot(path, urdf):\n'
BAD = {
    "aborts": "    import os\n    os.abort()",
    "hangs": "    import time\n    time.sleep(600)",
    "spins": "    while True:\n        pass",
    "swells": "    import numpy\n    return numpy.empty(1 << 29).fill(1.0)",
    "raises": '    raise RuntimeError("no such luck")',
    "refuses": '    raise ValueError("tendons are not supported")',
    "leaves": "    raise SystemExit(0)",
    "chatters": "    print('word ' * 10_000_000)\n    raise RuntimeError('enough')",
    "nothing": "    return None",
    "lacks": "    import there_is_no_such_module",
}
"""Name -> what its `open_robot` does."""


def importer(folder: Path, name: str, body: str) -> Path:
    """Return the file of an importer."""
    path = folder / f"{name}.py"
    path.write_text(HEAD + body + "\n", encoding="utf-8")
    return path
