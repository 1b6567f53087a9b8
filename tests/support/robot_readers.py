"""Audits in tests, and importers that do what importers of robot files have been seen to do, as files of plug-ins."""

from __future__ import annotations

from pathlib import Path

import pytest

from crossbody.reports.cli import main
from crossbody.reports.importers.audit import audited, opened

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


ARM = """<mujoco model="arm"><worldbody><body name="arm"><joint name="arm" axis="0 1 0"/>
<inertial pos="0 0 .5" mass="1" diaginertia=".1 .1 .01"/></body></worldbody></mujoco>"""


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    """Return exit code, output and messages of a command."""
    with pytest.raises(SystemExit) as end:
        main(arguments)
    out, err = capsys.readouterr()
    return int(str(end.value.code)), out, err


def rows_of(path: Path, engine: str, text: str, changed: str) -> dict[str, str]:
    """Verdicts of a reader that reads one file while the yardstick holds it to another."""
    path.write_text(text)
    wanted = opened(path)
    path.write_text(changed)
    [(_, _, rows)] = audited(path, [engine], seconds=60.0, audit=wanted)
    return {row.quantity: row.verdict for row in rows}
