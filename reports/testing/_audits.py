"""One test for every quantity that an engine's own reader makes of a robot file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest

from crossbody.cases import CrossbodyError
from crossbody.cases.files.reading import existing
from crossbody.engines import importers
from crossbody.reports.importers.audit import audited
from crossbody.reports.importers.compare import NONE, OK, QUANTITIES, UNSUPPORTED, Row
from crossbody.reports.importers.told import sentence
from crossbody.reports.testing._items import Judged, Outside


@dataclass(frozen=True)
class Audited:
    """A file and what every importer makes of it, asked once a session."""

    path: Path
    engines: tuple[str, ...]

    @cached_property
    def rows(self) -> dict[tuple[str, str], Row]:
        """Importer and quantity -> row."""
        found = audited(self.path, self.engines)
        return {(row.engine, row.quantity): row for _, _, rows in found for row in rows}


class Audits(pytest.Collector):
    """All files asked for."""

    def collect(self) -> Iterator[pytest.Item]:
        """One test a file, engine and quantity; nothing is read yet."""
        typed = self.config.getoption("--crossbody-audit")
        base = self.config.invocation_params.dir if typed else self.config.rootpath
        given = self.config.getoption("--crossbody-engine") or self.config.getini("crossbody_engines")
        try:
            engines = importers.known(tuple(name.partition(":")[0] for name in given))
        except CrossbodyError as error:
            raise self.CollectError(str(error)) from None
        for text in typed or self.config.getini("crossbody_audits"):
            path = base / Path(text).expanduser()
            try:
                existing(path)
            except CrossbodyError as error:
                raise self.CollectError(str(error)) from None
            file = Audited(path, engines)
            for engine in engines:
                for quantity in QUANTITIES:
                    name = f"{path.name}::{engine}::{quantity}"
                    yield OneQuantity.from_parent(self, name=name, file=file, engine=engine, quantity=quantity)


class OneQuantity(Judged):
    """One quantity that one importer makes of a file."""

    def __init__(self, *, file: Audited, engine: str, quantity: str, **more: Any) -> None:
        super().__init__(**more)
        self.file, self.engine, self.quantity = file, engine, quantity

    def runtest(self) -> None:
        """Pass where it is what the file says; what the engine says that it leaves out is an xfail."""
        rows = self.file.rows
        row = rows.get((self.engine, self.quantity))
        if row is None or row.verdict == NONE:
            why = "is not installed" if (self.engine, "reading") not in rows else "has nothing to compare"
            pytest.skip(f"{self.engine} {why}: {self.quantity} of {self.file.path.name}.")
        self.user_properties += [(name, str(getattr(row, name))) for name in ("engine", "version", "quantity", "where",
                                 "value", "expected", "difference", "verdict")]  # fmt: skip
        if row.verdict == UNSUPPORTED:
            pytest.xfail(sentence(row))
        if row.verdict != OK:
            raise Outside(f"{sentence(row)}\ncrossbody audit {self.file.path} -e {self.engine} --explain")
