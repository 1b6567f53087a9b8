"""Are the message types of a bag such that a message costs what its bytes suggest?"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

MOST = 100_000  # values that a message of a type holds whatever its bytes say
DEEPEST = 32  # types inside one another
FILLER = "structure_needs_at_least_one_member"  # what stands for nothing in ROS 2, and is not there in ROS 1


def fault_of(types: Mapping[str, Any], name: str) -> str:
    """What is wrong with a message type; empty if nothing is, or if it is not known.

    Types inside types multiply: ten levels of ten make 1e10 values out of a kilobyte of definitions, and a list of
    empty messages takes no bytes however long it is.

    Args:
        types: fields of every known type, as rosbags lists them.
        name: the type.
    """
    try:
        _least(types, name, 0, {})
    except ValueError as error:
        return str(error)
    return ""


def _least(types: Mapping[str, Any], name: str, depth: int, known: dict[str, int]) -> int:
    """Number of values that a message of a type holds at least; those of lists without a fixed length are none."""
    if name in known or name not in types:
        return known.get(name, 1)
    if depth > DEEPEST:
        raise ValueError(f"has messages of a type that is nested deeper than {DEEPEST} levels")
    count = sum(_values(types, field, depth, known) for _, field in types[name][1])
    if count > MOST:
        raise ValueError(f"has messages of a type of more than {MOST} values")
    known[name] = count
    return count


def _values(types: Mapping[str, Any], field: Any, depth: int, known: dict[str, int]) -> int:
    from rosbags.interfaces import Nodetype

    kind, about = field
    if kind == Nodetype.BASE:
        return 1
    if kind == Nodetype.NAME:
        return _least(types, about, depth + 1, known)
    one = _values(types, about[0], depth, known)
    if about[0][0] == Nodetype.NAME and _empty(types, about[0][1]):
        raise ValueError("has messages with lists of empty messages")
    return one * about[1] if kind == Nodetype.ARRAY else 0


def _empty(types: Mapping[str, Any], name: Any) -> bool:
    """Whether a message of a type takes no bytes."""
    from rosbags.interfaces import Nodetype

    fields = types[name][1] if name in types else [("", (Nodetype.BASE, None))]
    return all(field == FILLER or (kind == Nodetype.NAME and _empty(types, about)) for field, (kind, about) in fields)
