"""Numbers of an earlier run, kept beside the test that made them."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from crossbody.cases import InvalidValue
from crossbody.cases.regular import open_regular
from crossbody.reports.runs.files import decoded
from crossbody.reports.runs.output import replace_text

if TYPE_CHECKING:
    from crossbody.reports.judging.verdict import Verdict

FOLDER = "baselines"
_WORDS = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


class Baseline:
    """Compares numbers with those of a file, or writes the file.

    One small JSON file a test, `baselines/MODULE/TEST.json` beside the test's module, made to be committed.

    Args:
        path: the file.
        update: write instead of comparing.
    """

    def __init__(self, path: Path, *, update: bool = False) -> None:
        self.path, self.update = path, update

    def check(self, values: Mapping[str, float | Verdict], *, rtol: float = 1e-6, atol: float = 0.0) -> None:
        """Compare every number with the stored one.

        Args:
            values: metric -> number, or the verdicts of the fixture `crossbody_verdicts`.
            rtol: of the stored number.
            atol: in each number's own unit.

        Raises:
            AssertionError: naming every number that moved, appeared or went, or saying that
                nothing is stored.
            InvalidValue: for a value that is no number, or a file that cannot be read.
        """
        found = {name: _number(name, value) for name, value in values.items()}
        if self.update:
            self._write(found)
            return
        if not self.path.is_file():
            raise AssertionError(f"There is no baseline {self.path}: run once with --crossbody-update and commit it.")
        if told := list(_differences(found, self._read(), rtol, atol)):
            last = f"If that is meant, run again with --crossbody-update ({self.path})."
            raise AssertionError("\n".join([*told, last]))

    def _read(self) -> dict[str, float]:
        try:
            with open_regular(self.path) as file:
                stored = decoded(file.read())
            return {str(name): float(_WORDS.get(value, value)) for name, value in stored.items()}
        except (OSError, ValueError, TypeError, AttributeError) as error:
            raise InvalidValue(f"Baseline {self.path} is not a JSON object of numbers: {error}.") from None

    def _write(self, values: Mapping[str, float]) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        plain = {name: value if math.isfinite(value) else f"{value:g}" for name, value in sorted(values.items())}
        replace_text(self.path, json.dumps(plain, indent=1, allow_nan=False) + "\n")


def place(module: Path, test: str) -> Path:
    """The file of one test: a name out of a test's parameters cannot leave the folder."""
    safe = re.sub(r"[^\w\-\[\]]+", "-", test)[:100]
    if safe != test:  # two names may not become one
        safe += "-" + hashlib.sha256(test.encode()).hexdigest()[:8]
    return module.parent / FOLDER / module.stem / f"{safe}.json"


def _number(name: str, value: Any) -> float:
    number = getattr(value, "value", value)
    try:
        return float(number)
    except (TypeError, ValueError):
        raise InvalidValue(f"{name} is {number!r}; a baseline keeps numbers.") from None


def _differences(found: Mapping[str, float], stored: Mapping[str, float], rtol: float, atol: float) -> list[str]:
    told = [f"{name} is new: {found[name]:.9g}." for name in found if name not in stored]
    told += [f"{name} is missing: it was {stored[name]:.9g}." for name in stored if name not in found]
    for name in found.keys() & stored.keys():
        a, b = found[name], stored[name]
        same = a == b or (math.isnan(a) and math.isnan(b)) or abs(a - b) <= atol + rtol * abs(b)
        if not same or math.isinf(a) != math.isinf(b):
            told.append(f"{name} was {b:.9g} and is {a:.9g}, a difference of {abs(a - b):.3g}.")
    return sorted(told)
