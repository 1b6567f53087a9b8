"""The maze as it is usually built: walls of capsules on chords, a sphere, and MuJoCo's own contacts with friction."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.cases.mechanisms.maze.geometry import THICKNESS, Ring
from crossbody.engines._maze.scene import BallMaze

ANGLE = math.radians(5.0)
"""Longest chord, as an angle at the axis."""

_XML = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 {gravity!r} 0" tolerance="{tolerance!r}"/>
  <worldbody>
    <body name="maze">
      <inertial pos="0 0 0" mass="1" diaginertia="{Jm!r} {Jm!r} {Jm!r}"/>
      <joint name="theta" type="hinge" axis="0 0 1"/>
      {walls}
    </body>
    <body name="ball">
      <joint name="x" type="slide" axis="1 0 0"/>
      <joint name="y" type="slide" axis="0 1 0"/>
      <joint name="phi" type="hinge" axis="0 0 1"/>
      <geom name="ball" type="sphere" size="{r!r}" mass="{mb!r}" friction="{friction} 0.005 0.0001"/>
    </body>
  </worldbody>
</mujoco>
"""


def compiled(maze: BallMaze) -> tuple[Any, list[int]]:
    """The model, and for every geom the index of its ring (-1: the ball).

    Raises:
        ValueError: MuJoCo's own, for a model that it refuses.
    """
    p, lines, rings = maze.plant, [], []
    for i, ring in enumerate(maze.rings):
        for line in _walls(ring):
            lines.append(line)
            rings.append(i)
    friction = 1.0 if maze.rows.rolling else 0.0
    if not maze.rows.rolling:  # friction of a pair is the larger of its two
        lines = [line.replace("<geom ", '<geom friction="0 0 0" ') for line in lines]
    # MuJoCo's tolerance is relative to the mean inertia: beside a locked maze (1e6) its solver would never start.
    tolerance = 1e-8 * min(1.0, p.mb / p.Jm)
    text = _XML.format(
        gravity=-p.g, tolerance=tolerance, Jm=p.Jm, mb=p.mb, r=p.r, walls="\n      ".join(lines), friction=friction
    )
    return mujoco.MjModel.from_xml_string(text), [*rings, -1]


def _walls(ring: Ring) -> Iterator[str]:
    """Capsules through points on the circle amid the wall, as thick as the wall; their ends are the round tips."""
    cap = 0.5 * THICKNESS if math.isinf(ring.outer) else ring.cap
    middle = ring.inner + cap
    for start, end in arcs(ring):
        points = _on_circle(middle, start, end)
        for a, b in pairwise(points.tolist()):
            yield f'<geom type="capsule" size="{cap!r}" fromto="{a[0]!r} {a[1]!r} 0 {b[0]!r} {b[1]!r} 0"/>'


def arcs(ring: Ring) -> list[tuple[float, float]]:
    """Where the wall stands, from tip to tip, rad."""
    if ring.gaps == 0:
        return [(0.0, math.tau)]
    ends = [ring.tips(k) for k in range(ring.gaps)]
    nexts = [*(first for first, _ in ends[1:]), ends[0][0] + math.tau]
    return [(last, first) for (_, last), first in zip(ends, nexts, strict=True)]


def _on_circle(radius: float, start: float, end: float) -> Floats:
    angles = np.linspace(start, end, 1 + math.ceil((end - start) / ANGLE))
    return radius * np.column_stack((np.cos(angles), np.sin(angles)))
