"""Why a reader makes something else of a file: features that it fails in the table, tried by leaving them out."""

from __future__ import annotations

import re
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from typing import Any
from uuid import uuid4
from xml.etree import ElementTree
from xml.parsers import expat

from crossbody.cases import CrossbodyError
from crossbody.cases.files.conformance import FEATURES, Feature
from crossbody.engines.importers import SECONDS, answers
from crossbody.reports.importers.audit import opened
from crossbody.reports.importers.compare import FAILED, NONE, OK, UNSUPPORTED, WRONG, Row
from crossbody.reports.importers.compare import rows as compared
from crossbody.reports.importers.conformance import judged_all
from crossbody.reports.importers.fix import fixed
from crossbody.reports.importers.lines import Node, Place, names, with_lines

TELLS = "The engine reads it as something else; say it in the engine."
PLAIN = ("arm", "URDF: arm", "URDF: link without mass", "URDF: inertia of the root")
"""What every robot has: without it nothing would be left to differ."""


@dataclass(frozen=True, slots=True)
class Use:
    """Where a file uses a feature.

    Attributes:
        feature: which.
        places: file and line of each, in their order.
        names: of the parts there and of the bodies around them.
    """

    feature: Feature
    places: tuple[Place, ...]
    names: tuple[frozenset[str], ...]


def uses(path: Path, urdf: bool) -> list[Use]:
    """Return the features of the table that a file uses."""
    try:
        root, places = with_lines(path)
    except expat.ExpatError:  # what is no XML was refused before
        return []
    around = {child: node for node in root.iter() for child in node}
    order = {node: k for k, node in enumerate(places)}
    found = []
    for feature in FEATURES:
        if (feature.format == "urdf") == urdf:
            nodes = sorted({node for way in feature.finds for node in _at(root, places, way)}, key=order.__getitem__)
            if nodes:
                named = tuple(frozenset(names(node, around)) for node in nodes)
                found.append(Use(feature, tuple(places[node] for node in nodes), named))
    return found


def _at(root: Node, places: dict[Node, Place], way: str) -> list[Node]:
    """Return the elements at a path of ElementTree; behind a ! stands what they must not have."""
    if way == ".//include":
        return [node for node in places if node.tag == "include"]
    path, _, without = way.partition("!")
    absent = without.split(",") if without else []
    return [node for node in root.findall(path) if not any(_has(node, one) for one in absent)]


def _has(node: Node, part: str) -> bool:
    return part[1:] in node.attrib if part.startswith("@") else node.find(part) is not None


def left_out(path: Path, features: Sequence[Feature], out: Path) -> None:
    """Write a file without what makes it use some features: the attributes that their paths name, or the elements."""
    root, places = with_lines(path)
    for feature in features:
        for way in feature.finds:
            for node in _at(root, places, way):
                told = re.findall(r"@(\w+)", way.partition("!")[0].rpartition("/")[2])
                for key in told:
                    node.attrib.pop(key, None)
                for parent in [] if told or "!" in way else [one for one in root.iter() if node in list(one)]:
                    parent.remove(node)
    ElementTree.ElementTree(root).write(out, encoding="utf-8")


def explained(
    path: Path, urdf: bool, rows: Sequence[Row], seconds: float = SECONDS, jobs: int = 2, without: str = ""
) -> list[Row]:
    """Return the rows, those that are wrong with the feature that is to blame and where that stands.

    To blame is a feature that the file uses, which the importer fails in its smallest file, and without which it reads
    the file's quantity as the file then says. Named as a guess is the nearest where only all of them together do it, or
    the file in plainer words; what does it though its smallest file is read; and what cannot be left out.

    Args:
        path: of the file.
        urdf: whether it is one.
        rows: of its audit.
        seconds: what an importer may take for a file.
        jobs: importers that are asked at once.
        without: as of the audit.
    """
    off = [row for row in rows if row.verdict in (WRONG, FAILED)]
    if not off:
        return list(rows)
    used = [use for use in uses(path, urdf) if use.feature.name not in PLAIN]
    with TemporaryDirectory(prefix="crossbody-causes-") as folder, ThreadPoolExecutor(jobs) as pool:
        for one in path.resolve().parent.iterdir():
            (Path(folder) / one.name).symlink_to(one)
        trials = _Trials(path, urdf, Path(folder), seconds, without)
        engines = list(dict.fromkeys(row.engine for row in off))
        told = dict(zip(engines, pool.map(lambda name: _of_engine(name, trials, used, off), engines), strict=True))
    return [told[row.engine].get(row.quantity, row) if row in off else row for row in rows]


class _Trials:
    """Forms of a file without some features, each opened once."""

    def __init__(self, path: Path, urdf: bool, folder: Path, seconds: float, without: str) -> None:
        self.path, self.urdf, self.folder, self.seconds, self.without = path, urdf, folder, seconds, without
        self._opened: dict[tuple[str, ...], Any] = {}
        self._lock = Lock()

    def opened(self, features: Sequence[Feature]) -> Any:
        """Return the audit of such a form, of that in plain words without any; None where it is no robot."""
        key = tuple(feature.name for feature in features)
        with self._lock:
            return self._form(key, features)

    def _form(self, key: tuple[str, ...], features: Sequence[Feature]) -> Any:
        if key not in self._opened:
            out = self.folder / f"{uuid4().hex}{self.path.suffix}"  # links to the user's files stand there too
            self._opened[key] = None
            try:
                left_out(self.path, features, out) if features else fixed(self.path, out, self.without)
                self._opened[key] = opened(out, self.without)
            except CrossbodyError:
                pass
        return self._opened[key]

    def asked(self, engine: str, groups: Sequence[Sequence[Feature]]) -> list[list[Row]]:
        """Return the rows of an importer for every form that is a robot, none for one that is not."""
        forms = [self.opened(group) for group in groups]
        there = [form for form in forms if form is not None]
        given = iter(answers(engine, [form.path for form in there], self.urdf, [form.job for form in there],
                             self.seconds))  # fmt: skip
        return [[] if form is None else compared(engine, next(given), form.wanted, form.job["joints"], form.named)
                for form in forms]  # fmt: skip


def _of_engine(engine: str, trials: _Trials, used: Sequence[Use], off: Sequence[Row]) -> dict[str, Row]:
    """Return quantity -> its row with what is to blame, for one importer."""
    own = [row for row in off if row.engine == engine]
    asked = [use for use in used if any(row.quantity in ("reading", *use.feature.about) for row in own)]
    table = judged_all([use.feature for use in asked], engine, trials.seconds)
    failed = [(use, told) for use, told in zip(asked, table, strict=True) if isinstance(told, Row) and told.verdict in (
        WRONG, FAILED, UNSUPPORTED)]  # fmt: skip
    alone = trials.asked(engine, [[use.feature] for use, _ in failed])
    every = [[use.feature for use, _ in failed], []] if failed else []
    together = trials.asked(engine, every)
    found = {}
    for row in own:
        proven = [use for (use, _), told in zip(failed, alone, strict=True) if _agrees(row, told)]
        guessed = [use for use, told in failed if row.quantity in ("reading", *use.feature.about) and (
            row.quantity != "reading" or told.quantity == "reading")]  # fmt: skip
        if proven:
            found[row.quantity] = _blamed(row, proven, "")
        elif guessed and any(_agrees(row, told) for told in together):
            found[row.quantity] = _blamed(row, guessed, "perhaps")
    left = [use for use in asked if use not in [use for use, _ in failed]] if len(found) < len(own) else []
    others = trials.asked(engine, [[use.feature] for use in left])
    for row in (row for row in own if row.quantity not in found):
        same = [use for use, told in zip(left, others, strict=True) if _agrees(row, told)]
        same = same or [use for (use, small), told in zip(failed, alone, strict=True) if not told and (
            small.quantity == row.quantity)]  # fmt: skip
        if same:
            found[row.quantity] = _blamed(row, same, "perhaps")
    return found


def _agrees(row: Row, told: Sequence[Row]) -> bool:
    """Return whether a row is no longer wrong; of a reader that fails, whether it reads, or fails by something else.

    Shapes agree where there are none: what leaves them out explains nothing of them.
    """
    for one in told if row.quantity not in ("bodies", "shapes", "contacts") else ():
        if one.quantity == row.quantity:
            same = one.why == row.why if row.quantity == "reading" else one.verdict not in (OK, NONE)
            return not same
    return False


def _blamed(row: Row, causes: Sequence[Use], doubt: str) -> Row:
    """Return a row with its cause: of several that which is used at the joint or body."""
    places = [part.partition(":")[0].strip() for part in re.split(", | is | behind ", row.where)]

    def near(use: Use) -> list[Place]:
        both = zip(use.places, use.names, strict=True)
        return [place for place, own in both if not own.isdisjoint(places)]

    use = min(causes, key=lambda one: not near(one))
    file, line = (near(use) or use.places)[0]
    return replace(row, cause=use.feature.name, file=str(file), line=line, doubt=doubt)


def advice(cause: str) -> str:
    """Return the rule of the format and the rewrite that stand behind a cause; empty where it is none of the table."""
    feature = next((one for one in FEATURES if one.name == cause), None)
    return " ".join(filter(None, (feature.rule, feature.rewrite))) or TELLS if feature else ""
