"""Why a reader makes something else of a file: features that it fails, tried by leaving them out."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

from crossbody.cases.files.conformance import FEATURES, Feature
from crossbody.engines.importers import LATE, SECONDS, answers
from crossbody.reports.importers.audit import opened
from crossbody.reports.importers.compare import FAILED, NONE, OK, UNSUPPORTED, WRONG, Row
from crossbody.reports.importers.compare import rows as compared
from crossbody.reports.importers.conformance import judged_all
from crossbody.reports.importers.fix import fixed
from crossbody.reports.importers.forms import Forms, Node, Place, names, removed, with_lines

TELLS = "The engine reads it differently; set it in the engine."
PLAIN = ("arm", "shapes that may touch", "URDF: arm", "URDF: link without mass", "URDF: inertia of the root")
"""What every robot has: without it nothing would be left to differ."""
AND, PAIRED = " together with ", 5
"""Between the names of two causes that act together; of how many features pairs are tried."""


@dataclass(frozen=True, slots=True, eq=False)
class Use:
    """Where a file uses a feature: file and line of each place, and names of the parts and bodies there."""

    feature: Feature
    places: tuple[Place, ...]
    names: tuple[frozenset[str], ...]

    def at(self, wanted: Sequence[str]) -> list[Place]:
        """Return where it is used at parts of these names."""
        return [place for place, own in zip(self.places, self.names, strict=True) if not own.isdisjoint(wanted)]


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
            nodes = sorted({node for way in feature.paths for node in _at(root, places, way)}, key=order.__getitem__)
            if nodes:
                named = tuple(frozenset(names(node, around)) for node in nodes)
                found.append(Use(feature, tuple(places[node] for node in nodes), named))
    return found


def _at(root: Node, places: Mapping[Node, Place], way: str) -> list[Node]:
    """Return the elements at a path; behind a ! stands what they must not have, = what stands for it."""
    if way == ".//include":
        return [node for node in places if node.tag == "include"]
    path, _, without = way.partition("!")
    absent = [one.partition("=")[0] for one in without.split(",")] if without else []
    return [node for node in root.findall(path) if not any(_has(node, one) for one in absent)]


def _has(node: Node, part: str) -> bool:
    return part[1:] in node.attrib if part.startswith("@") else node.find(part) is not None


def left_out(features: Sequence[Feature], root: Node, places: Mapping[Node, Place]) -> None:
    """Take out of a file what makes it use some features: the attributes that their paths name, or the elements.

    Where something is not said, that is said which the format takes for it.
    """
    for way in [way for feature in features for way in feature.paths]:
        path, _, without = way.partition("!")
        last = path.rpartition("/")[2]
        told = re.findall(r"@(\w+)\]", last) or re.findall(r"@(\w+)", last)  # a value selects, where another is named
        for node in _at(root, places, way):
            for key in told:
                node.attrib.pop(key, None)
            for one in [one for one in without.split(",") if "=" in one]:
                part, _, value = one.partition("=")
                if part.startswith("@"):
                    node.set(part[1:], value)
                else:
                    ElementTree.SubElement(node, part, dict(filter(None, [value.split("=")])) if value else {})
            if not told and not without:
                removed(root, node)


def explained(
    path: Path, urdf: bool, rows: Sequence[Row], seconds: float = SECONDS, jobs: int = 2, without: str = ""
) -> list[Row]:
    """Return the rows, those that are wrong with the feature that is to blame and where that stands.

    To blame is a feature that the file uses, which the importer fails in its smallest file, and without
    which it reads the file's quantity as the file then says; or two of them together, where neither does it
    alone. Named as a guess is what it fails in every file, or the nearest where only all of them do it, or
    the file in plainer words; what does it though its smallest file is read; and what cannot be left out.

    Args:
        path: of the file.
        urdf: whether it is one.
        rows: of its audit.
        seconds: what an importer may take for a file.
        jobs: importers that are asked at once.
        without: as of the audit.
    """
    off = [row for row in rows if row.verdict in (WRONG, FAILED) and not row.why.startswith(LATE)]
    if not off:
        return list(rows)
    used = uses(path, urdf)
    with Forms(path, lambda form: opened(form, without)) as forms, ThreadPoolExecutor(jobs) as pool:
        trials = _Trials(urdf, forms, seconds, without)
        engines = list(dict.fromkeys(row.engine for row in off))
        told = dict(zip(engines, pool.map(lambda name: _of_engine(name, trials, used, off), engines), strict=True))
    return [told[row.engine].get(row.quantity, row) if row in off else row for row in rows]


@dataclass(frozen=True, slots=True)
class _Trials:
    """Forms of a file without some features, and what importers make of them."""

    urdf: bool
    forms: Forms
    seconds: float
    without: str

    def asked(self, engine: str, groups: Sequence[Sequence[Feature] | str]) -> list[list[Row]]:
        """Return the rows of an importer for every form that is a robot, none for one that is not."""
        forms = [self._form(group) for group in groups]
        there = [form for form in forms if form is not None]
        given = iter(answers(engine, [form.path for form in there], self.urdf, [form.job for form in there],
                             self.seconds))  # fmt: skip
        return [[] if form is None else compared(engine, next(given), form.wanted, form.job["joints"], form.named)
                for form in forms]  # fmt: skip

    def _form(self, group: Sequence[Feature] | str) -> Any:
        if isinstance(group, str):
            return self.forms.made(group, lambda out: fixed(self.forms.path, out, self.without))
        key = tuple(feature.name for feature in group)
        return self.forms.opened(key, lambda root, places: left_out(group, root, places))


def _of_engine(engine: str, trials: _Trials, used: Sequence[Use], off: Sequence[Row]) -> dict[str, Row]:
    """Return quantity -> its row with what is to blame, for one importer."""
    own = [row for row in off if row.engine == engine]
    if own[0].quantity == "reading" and any(_agrees(own[0], told) for told in trials.asked(engine, [[]])):
        return {}  # asked again it reads the file: it had not enough time, say
    asked = [use for use in used if any(row.quantity in ("reading", *use.feature.about) for row in own)]
    table = judged_all([use.feature for use in asked], engine, trials.seconds)
    bad = [(use, told) for use, told in zip(asked, table, strict=True) if isinstance(told, Row) and told.verdict in (
        WRONG, FAILED, UNSUPPORTED)]  # fmt: skip
    failed = [(use, told) for use, told in bad if use.feature.name not in PLAIN]
    alone = dict(
        zip([use for use, _ in failed], trials.asked(engine, [[use.feature] for use, _ in failed]), strict=True)
    )
    found = {}
    for row in own:
        if proven := [use for use, told in alone.items() if _agrees(row, told)]:
            found[row.quantity] = _blamed(row, [(use,) for use in proven], "")
    for row in (row for row in own if row.quantity not in found):
        if both := _pairs(
            row, engine, trials, [use for use in alone if row.quantity in ("reading", *use.feature.about)]
        ):
            found[row.quantity] = _blamed(row, both, "")
        elif plain := [use for use, told in bad if use.feature.name in PLAIN and row.quantity in use.feature.about]:
            found[row.quantity] = _blamed(row, [(use,) for use in plain], "perhaps")
    return found | _guessed([row for row in own if row.quantity not in found], engine, trials, failed, alone, asked)


def _pairs(row: Row, engine: str, trials: _Trials, near: Sequence[Use]) -> list[tuple[Use, ...]]:
    """Return pairs of features without which an importer agrees, nearest to where it does not."""
    places = _places(row)
    tried = sorted(near, key=lambda use: not use.at(places))[:PAIRED]
    pairs = list(combinations(tried, 2))
    told = trials.asked(engine, [[one.feature, two.feature] for one, two in pairs])
    return [pair for pair, rows in zip(pairs, told, strict=True) if _agrees(row, rows)]


def _guessed(
    rows: Sequence[Row], engine: str, trials: _Trials, failed: Sequence[tuple[Use, Row]],
    alone: Mapping[Use, Sequence[Row]], asked: Sequence[Use],
) -> dict[str, Row]:  # fmt: skip
    """Return quantity -> its row with the nearest cause that is not proved, of rows that have no other."""
    found: dict[str, Row] = {}
    together = trials.asked(engine, [[use.feature for use, _ in failed], "plain"]) if rows and failed else []
    for row in rows:
        likely = [use for use, told in failed if row.quantity in ("reading", *use.feature.about) and (
            row.quantity != "reading" or told.quantity == "reading")]  # fmt: skip
        if likely and any(_agrees(row, told) for told in together):
            found[row.quantity] = _blamed(row, [(use,) for use in likely], "perhaps")
    rows = [row for row in rows if row.quantity not in found]
    left = [use for use in asked if use not in alone and use.feature.name not in PLAIN] if rows else []
    others = trials.asked(engine, [[use.feature] for use in left])
    for row in rows:
        same = [use for use, told in zip(left, others, strict=True) if _agrees(row, told)]
        same = same or [use for use, small in failed if not alone[use] and small.quantity == row.quantity]
        if same:
            found[row.quantity] = _blamed(row, [(use,) for use in same], "perhaps")
    return found


def _agrees(row: Row, told: Sequence[Row]) -> bool:
    """Return whether a row is no longer wrong; of a reader that fails, whether it reads, or fails by something else.

    Shapes agree where there are none: what leaves them out explains nothing of them.
    """
    of_shapes = row.quantity in ("bodies", "shapes", "contacts", "surfaces")
    for one in told if row.verdict == FAILED or not of_shapes else ():
        if one.quantity == row.quantity:
            return one.why != row.why if row.quantity == "reading" else one.verdict in (OK, NONE)[: 2 - of_shapes]
    return False


def _places(row: Row) -> list[str]:
    """Return the names of joints and bodies where a row differs."""
    return [part.partition(":")[0].strip() for part in re.split(", | is | behind ", row.where)]


def _blamed(row: Row, causes: Sequence[tuple[Use, ...]], doubt: str) -> Row:
    """Return a row with its cause: of several the one at the joint or body, in the fewest places."""
    places = _places(row)
    cause = min(causes, key=lambda group: (not any(use.at(places) for use in group), sum(len(u.places) for u in group)))
    file, line = next((place for use in cause for place in use.at(places)), cause[0].places[0])
    names = AND.join(use.feature.name for use in cause)
    return replace(row, cause=names, file=str(file), line=line, doubt=doubt)


def parts(cause: str) -> list[str]:
    """Return the names of the features that a cause is."""
    names = {feature.name for feature in FEATURES}
    return [one for one in cause.split(AND) if one in names]


def advice(cause: str) -> str:
    """Return the format's rules and rewrites behind a cause; empty where it is none of the table."""
    named = [feature for feature in FEATURES if feature.name in parts(cause)]
    told = [" ".join(filter(None, (one.rule, one.rewrite))) for one in named]
    return " ".join(dict.fromkeys(filter(None, told))) or TELLS if named else ""
