"""A feature of robot files: the smallest file that has it, and the scene that it means."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Scene

MOTION = ("coordinates", "inertia", "M", "gravity", "bias", "energy", "frames")


@dataclass(frozen=True, slots=True)
class Feature:
    """One way of writing something.

    Attributes:
        name: of the file too.
        text: the smallest file that has it.
        scene: what it means.
        finds: paths of ElementTree by which a file is seen to use it, between bars; behind a !
            children and @attributes that are not there, each with what would say the same behind
            an =; empty for what no path tells.
        rule: what the format says, in a sentence.
        rewrite: how to write it so that every reader reads the same; empty where there is no such way.
        about: quantities by which a reader is judged.
        format: mjcf or urdf.
        files: what else stands beside it, name -> text.
        keys: name of every keyframe -> positions (nq,).
        heavier: added to M (nv, nv) by what a scene does not have, of which our own reading says so.
    """

    name: str
    text: str
    scene: Scene
    finds: str = ""
    rule: str = ""
    rewrite: str = ""
    about: tuple[str, ...] = MOTION
    format: str = "mjcf"
    files: Mapping[str, str] = field(default_factory=dict)
    keys: Mapping[str, Floats] = field(default_factory=dict)
    heavier: tuple[tuple[float, ...], ...] = ()

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths by which a file is seen to use it."""
        return tuple(filter(None, self.finds.split(" | ")))
