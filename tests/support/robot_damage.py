"""Robot files with one thing changed: a number, an attribute or a tag."""

from __future__ import annotations

import random
from xml.etree import ElementTree

VALUES = ("0", "-1", "1e9", "nan", "abc", "", "1 2", "1e-300", "true")
TAGS = ("body", "joint", "geom", "inertial", "site", "unknown")


def damaged(text: str, seed: int) -> str:
    """Return a file with one change."""
    draw = random.Random(seed)
    root = ElementTree.fromstring(text)
    above = {child: node for node in root.iter() for child in node}
    nodes = [node for node in above if node.attrib]
    node = draw.choice(nodes)
    key = draw.choice(sorted(node.attrib))
    kind = draw.choice(("number", "number", "attribute", "tag"))
    words = node.attrib[key].split()
    if kind == "number":
        at = draw.randrange(max(len(words), 1))
        changed = [*words[:at], draw.choice((*VALUES, scaled(words[at : at + 1], draw))), *words[at + 1 :]]
        node.set(key, " ".join(changed))
    elif kind == "attribute":
        value = node.attrib.pop(key)
        if draw.random() < 0.5:
            node.set(draw.choice(("pos", "quat", "axis", "mass", "type", "class", "range", "unknown")), value)
    elif draw.random() < 0.5:
        above[node].remove(node)
    else:
        node.tag = draw.choice(TAGS)
    return ElementTree.tostring(root, encoding="unicode")


def scaled(words: list[str], draw: random.Random) -> str:
    """Return a number that is another, or the word."""
    try:
        return repr(float(words[0]) * draw.choice((0.5, 1.5, -1.0)))
    except (ValueError, IndexError):
        return "2"
