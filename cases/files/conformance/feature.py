"""A feature of robot files: the smallest file that has it, and the scene that it means."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene

MOTION = ("coordinates", "inertia", "M", "gravity", "bias", "energy", "frames")


@dataclass(frozen=True, slots=True, kw_only=True)
class Feature:
    """One way of writing something.

    Attributes:
        name: of the file too.
        format: mjcf or urdf.
        text: the smallest file that has it.
        scene: what it means.
        about: quantities by which a reader is judged.
        finds: paths of ElementTree by which a file is seen to use it; behind a ! children and @attributes that are
            not there, each with what would say the same behind an =; empty for what no path tells.
        rule: what the format says, in a sentence.
        rewrite: how to write it so that every reader reads the same; empty where there is no such way.
        files: what else stands beside it, name -> text.
        keys: name of every keyframe -> positions (nq,).
        heavier: added to M (nv, nv) by what a scene does not have, of which our own reading says so.
    """

    name: str
    format: str = "mjcf"
    text: str
    scene: Scene
    about: tuple[str, ...] = MOTION
    finds: tuple[str, ...] = ()
    rule: str = ""
    rewrite: str = ""
    files: Mapping[str, str] = field(default_factory=dict)
    keys: Mapping[str, Floats] = field(default_factory=dict)
    heavier: tuple[tuple[float, ...], ...] = ()


def written(
    name: str,
    text: str,
    scene: Scene,
    finds: str = "",
    rule: str = "",
    rewrite: str = "",
    about: tuple[str, ...] = MOTION,
    **more: Any,
) -> Feature:
    """Return a feature of MJCF or another format; paths in `finds` stand between bars."""
    return Feature(
        name=name,
        text=text,
        scene=scene,
        about=about,
        finds=tuple(filter(None, finds.split(" | "))),
        rule=rule,
        rewrite=rewrite,
        **more,
    )
