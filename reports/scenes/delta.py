"""A delta robot in space: base, three arms of two links, flange; z points down."""

from __future__ import annotations

import numpy as np

from crossbody.cases.arrays import Floats
from crossbody.reports.scenes import Parameters, Stage, path

# Points: hinge, elbow, wrist of each arm, one arm after another; then the flange.
FLANGE = 9


def turns(p: Parameters) -> Floats:
    """Angle of each arm about z: 0, -sign 120, +sign 120 degrees."""
    third = 2.0 * np.pi / 3.0 * float(p["sign"])
    return np.array([0.0, -third, third])


def stage(p: Parameters) -> Stage:
    """Links as lines, the wrists joined to a triangle."""
    arms = tuple((3 * i, 3 * i + 1, 3 * i + 2) for i in range(3))
    at, r = np.linspace(0.0, 2.0 * np.pi, 37), float(p["r_base"])
    rim = path(np.stack([r * np.cos(at), r * np.sin(at), 0.0 * at], axis=1))  # of the base, through the hinges
    return Stage(still=(rim,), lines=(*arms, (2, 5, 8, 2), (2, FLANGE), (5, FLANGE), (8, FLANGE)), down=True)


def poses(q: Floats, p: Parameters) -> Floats:
    """Points of the arms, by n = (0, -s1, c1), d = (s2 s3, c2, s2 c3); the flange between the wrists."""
    arms = [_arm(q[:, 3 * i : 3 * i + 3], turn, p) for i, turn in enumerate(turns(p))]
    wrists = [arm[:, 2] for arm in arms]
    return np.concatenate([*arms, np.mean(wrists, axis=0)[:, None, :]], axis=1)


def arrows(q: Floats, lam: Floats, p: Parameters) -> Floats:
    """Forces of the closed loops on the first arm's tip, drawn at the wrists of arms 2 and 3 (n, 2, 6)."""
    points = poses(q, p)
    return np.stack([np.concatenate([points[:, 3 * i + 2], lam[:, 3 * i - 3 : 3 * i]], axis=1) for i in (1, 2)], axis=1)


def _arm(q: Floats, turn: float, p: Parameters) -> Floats:
    """Hinge, elbow and wrist of one arm (n, 3, 3)."""
    a, b, c = q.T
    zero = np.zeros(len(q))
    r = float(p["r_base"])
    hinge = np.stack([zero, zero + r, zero], axis=1)
    elbow = hinge + float(p["l1"]) * np.stack([zero, np.cos(a), np.sin(a)], axis=1)
    wrist = elbow + float(p["l2"]) * np.stack([np.sin(b) * np.sin(c), np.cos(b), np.sin(b) * np.cos(c)], axis=1)
    cos, sin = np.cos(turn), np.sin(turn)
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    points: Floats = np.stack([hinge, elbow, wrist], axis=1) @ rotation.T
    return points
