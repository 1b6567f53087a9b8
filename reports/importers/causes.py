"""Why a reader makes something else of a file: features that the file uses and that reader fails in the table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from crossbody.cases.files.conformance import FEATURES, Feature
from crossbody.cases.regular import open_regular
from crossbody.engines.importers import SECONDS
from crossbody.reports.importers.compare import FAILED, UNSUPPORTED, WRONG, Row
from crossbody.reports.importers.conformance import judged

Node = ElementTree.Element
PLAIN = ("arm", "URDF: arm")
"""What every other feature is a change of."""


@dataclass(frozen=True, slots=True)
class Use:
    """Where a file uses a feature.

    Attributes:
        feature: which.
        lines: on which lines of the file, in its order.
        names: of the parts there and of the bodies around them.
    """

    feature: Feature
    lines: tuple[int, ...]
    names: tuple[frozenset[str], ...]


def with_lines(path: Path) -> tuple[Node, dict[Node, int]]:
    """Return the root of a file and the line of every element."""
    builder, parser, lines = ElementTree.TreeBuilder(), expat.ParserCreate(), dict[Node, int]()

    def start(tag: str, attributes: dict[str, str]) -> None:
        lines[builder.start(tag, attributes)] = parser.CurrentLineNumber

    parser.StartElementHandler, parser.EndElementHandler = start, builder.end
    with open_regular(path) as file:
        parser.ParseFile(file)
    return builder.close(), lines


def uses(path: Path, urdf: bool) -> list[Use]:
    """Return the features of the table that a file uses."""
    try:
        root, lines = with_lines(path)
    except expat.ExpatError:  # what is no XML was refused before
        return []
    above = {child: node for node in root.iter() for child in node}
    found = []
    for feature in FEATURES:
        if (feature.format == "urdf") == urdf:
            nodes = sorted({node for way in feature.finds for node in _at(root, way)}, key=lines.__getitem__)
            if nodes:
                names = tuple(frozenset(_names(node, above)) for node in nodes)
                found.append(Use(feature, tuple(lines[node] for node in nodes), names))
    return found


def _at(root: Node, way: str) -> list[Node]:
    """Return the elements at a path of ElementTree; behind a ! stand the children that they must not have."""
    path, _, without = way.partition("!")
    absent = without.split(",") if without else []
    return [node for node in root.findall(path) if all(node.find(tag) is None for tag in absent)]


def _names(node: Node, above: Mapping[Node, Node]) -> set[str]:
    """Return the names of a part, of its children and of the body that it belongs to."""
    own = {node, *node}
    if node.tag not in ("body", "link") and node in above and above[node].tag in ("body", "joint"):
        own |= {above[node], *above[node]}
    return {name for one in own for name in [one.get("name") or one.get("class", "")] if name}


def explained(path: Path, urdf: bool, rows: Sequence[Row], seconds: float = SECONDS, jobs: int = 2) -> list[Row]:
    """Return the rows, those that are wrong with the feature that is to blame and its line, where there is one.

    Only features that the file uses are tried, and only for what is wrong: of one that the importer fails in its
    smallest file, the row of that quantity is explained.
    """
    off = [row for row in rows if row.verdict in (WRONG, FAILED)]
    asked = {
        (row.engine, use.feature.name): use
        for use in uses(path, urdf)
        for row in off
        if row.quantity == "reading" or row.quantity in use.feature.about
    }
    with ThreadPoolExecutor(jobs) as pool:
        answers = pool.map(lambda key: judged(asked[key].feature, key[0], seconds), asked)
        failed: dict[str, list[tuple[Use, Row]]] = {}
        for (key, use), answer in zip(asked.items(), answers, strict=True):
            if isinstance(answer, Row) and answer.verdict in (WRONG, FAILED, UNSUPPORTED):
                failed.setdefault(key[0], []).append((use, answer))
    return [_blamed(path, row, failed.get(row.engine, [])) if row in off else row for row in rows]


def _explains(row: Row, use: Use, told: Row, plain: Row | None) -> bool:
    """Return whether what an importer makes of a feature is of this row, and more than it makes of the plain arm."""
    if row.quantity == "reading":
        return told.quantity == "reading"
    same = plain is not None and plain.quantity == told.quantity and use.feature.name not in PLAIN
    return row.quantity in use.feature.about and not same


def _blamed(path: Path, row: Row, failed: Sequence[tuple[Use, Row]]) -> Row:
    """Return a row with its cause: first what is used at the joint or body, then what gives the same quantity."""
    plain = next((told for use, told in failed if use.feature.name in PLAIN), None)
    fitting = [(use, told) for use, told in failed if _explains(row, use, told, plain)]
    if not fitting:
        return row
    places = [part.partition(":")[0].strip() for part in row.where.split(",")]

    def order(found: tuple[Use, Row]) -> tuple[bool, bool]:
        use, told = found
        return not any(place in names for place in places for names in use.names), told.quantity != row.quantity

    use, told = min(fitting, key=order)
    near = (line for line, names in zip(use.lines, use.names, strict=True) if not names.isdisjoint(places))
    why = row.why or (told.why if told.verdict == UNSUPPORTED else "")
    return replace(row, cause=use.feature.name, file=str(path), line=next(near, use.lines[0]), why=why)


def advice(cause: str) -> str:
    """Return the rule of the format and the rewrite that stand behind a cause; empty where it is none of the table."""
    feature = next((one for one in FEATURES if one.name == cause), None)
    return " ".join(filter(None, (feature.rule, feature.rewrite))) if feature else ""
