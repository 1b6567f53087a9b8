"""Pictures of a stored motion without a browser: one instant as SVG or PNG, all of it as an animated GIF."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from crossbody.cases import InvalidValue
from crossbody.cases.arrays import Floats, distinct
from crossbody.reports import scenes
from crossbody.reports.figures.styles import called, style
from crossbody.reports.measuring.scale import idle
from crossbody.reports.pages.figures import carrying
from crossbody.reports.pages.filled import filled
from crossbody.reports.runs.store import Trace

WIDTH, HEIGHT = 800, 500
INK, PAPER, SOFT, PUSH = "#1a1d21", "#ffffff", "#4f5660", "#b3261e"
TURN, TILT = 0.6, 0.35  # of the camera, rad: those with which a page begins
ROUND = np.column_stack([f(np.linspace(0.0, 2.0 * np.pi, 129)[:-1]) for f in (np.cos, np.sin)])
"""Directions of a circle: so many that the outline of one that fills the picture is off by a tenth of a pixel."""
EDGE, LINE, LETTERS, BAR = 14.0, 20.0, 14, 60.0
"""Of what is written: distance from the border, between lines, height of letters, and least length of a bar, pixels."""
FAR = 4.0  # times its own size that a mechanism goes before it is followed
FORCE = 0.28  # part of the height that the largest force of a motion is as long as
SUFFIXES = (".svg", ".png", ".gif")


@dataclass(frozen=True, slots=True, eq=False)
class Stroke:
    """A line of points (n, 2), pixels; closed and filled with a colour, or open; with a radius a circle."""

    points: Floats
    color: str
    fill: str = ""
    width: float = 1.5
    radius: float = 0.0

    @property
    def centre(self) -> tuple[float, float]:
        """Where the middle of a circle is, pixels."""
        x, y = self.points.mean(axis=0).tolist()
        return x, y


@dataclass(frozen=True, slots=True, kw_only=True)
class Text:
    """Words at the end of a bar, or at the border: where they begin, or end, pixels."""

    text: str
    x: float
    y: float
    ends: bool = False


class Film:
    """A motion that can be drawn at any instant, in the colour of its engine."""

    def __init__(self, trace: Trace) -> None:
        name = str(trace.about.get("mechanism", ""))
        if name not in scenes.names() or not len(trace.run.t):
            raise InvalidValue(f"There is no picture of the mechanism {name or '(none is stored)'}.")
        self.scene, self.run = scenes.load(name), trace.run
        self.parameters = {**trace.about["parameters"], "scene": trace.about.get("scene")}
        self.stage = self.scene.stage(self.parameters)
        self.t, self.q = filled(trace.run, trace.quaternions)
        self.color, self.who = style(trace)["color"], called(trace)
        self.label = ":".join(filter(None, (trace.about.get("case", ""), trace.about.get("variant", ""))))
        self.lam = np.zeros_like(trace.run.lam)
        bearing = carrying([trace], idle(trace.run))
        self.lam[:, bearing] = np.nan_to_num(trace.run.lam[:, bearing])
        self.force = float(np.max(np.abs(self.lam), initial=0.0))
        some = distinct(np.linspace(0, len(self.q) - 1, 40).astype(int))
        poses = self.scene.poses(self.q[some], self.parameters)
        spans = [np.concatenate([*_points(self.stage, pose)]) for pose in poses]
        self.to = _camera(self.stage, spans)
        own, whole = (np.linalg.norm(np.ptp(points, axis=0)) for points in (spans[0], np.concatenate(spans)))
        self.far = bool(self.stage.frames and whole > FAR * own)

    def at(self, t: float) -> list[Stroke]:
        """Everything that is drawn at an instant, s, from back to front."""
        k = min(int(np.searchsorted(self.t, t, side="right")), len(self.t) - 1)
        a, b = self.t[max(k - 1, 0)], self.t[k]
        share = min(max((t - a) / (b - a), 0.0), 1.0) if b > a else 1.0
        q = (1.0 - share) * self.q[max(k - 1, 0)] + share * self.q[k]
        pose = self.scene.poses(q[None], self.parameters)[0]
        if self.far:
            self.to = _camera(self.stage, [*_points(self.stage, pose)])
        row = max(int(np.searchsorted(self.run.t, t, side="right")) - 1, 0)  # what has been, as in the playback
        pushes = self.scene.arrows(q[None], self.lam[row : row + 1], self.parameters)[0]
        return [*self._still(), *self._bodies(pose), *self._arrows(pushes)]

    def legend(self, t: float) -> tuple[list[Stroke], list[Text]]:
        """What tells whose motion it is and when, and the bars to measure lengths and forces by."""
        whose = f"{self.label}, {self.who}"
        key = Stroke(np.array([(EDGE, EDGE + 5.0), (EDGE + 22.0, EDGE + 5.0)]), self.color, width=4.0)
        digits = max(0, 4 - int(np.floor(np.log10(self.t[-1] or 1.0))))
        texts = [
            Text(text=whose, x=EDGE + 30.0, y=EDGE + 10.0),
            Text(text=f"t = {t:.{digits}f} s", x=WIDTH - EDGE, y=EDGE + 10.0, ends=True),
        ]
        bars, y = [key], HEIGHT - EDGE
        for pixels, unit in self._measures():
            value = _nice(BAR / pixels)
            end = EDGE + value * pixels
            bars.append(Stroke(np.array([(EDGE, y), (end, y)]), SOFT, width=2.0))
            texts.append(Text(text=f"{value:g} {unit}", x=end + 8.0, y=y + 5.0))
            y -= LINE
        return bars, texts

    def _measures(self) -> Iterator[tuple[float, str]]:
        """Yield how many pixels a metre, and a newton of an arrow, has, if there are any."""
        yield self.to.scale, "m"
        if self.force:
            yield FORCE * HEIGHT / self.force, "N"

    def _still(self) -> Iterator[Stroke]:
        for shape in self.stage.still:
            yield Stroke(self.to(_outline(shape)), SOFT, width=1.2, radius=self._radius(shape))
        for solid in self.stage.solids:
            if "plane" in solid:
                origin, x, y = np.reshape(solid["plane"], (3, 3))
                away, half = self.to.middle - origin, 0.45 * HEIGHT / self.to.scale
                origin, x, y = origin + (away @ x) * x + (away @ y) * y, half * x, half * y
                corners = [origin + a * x + b * y for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))]
                yield Stroke(self.to(np.array(corners)), SOFT, width=0.8)

    def _bodies(self, pose: Floats) -> Iterator[Stroke]:
        if self.stage.frames:
            yield from self._solids(pose)
        elif self.stage.lines:
            yield from (Stroke(self.to(pose[list(line)]), self.color, width=2.0) for line in self.stage.lines)
        else:
            for x, y, body in self.stage.threads:
                yield Stroke(self.to(np.array([(x, y), pose[body, :2]])), self.color)
            for shapes, stand in zip(self.stage.bodies, pose, strict=True):
                for shape in shapes:
                    closed = "circle" in shape or shape["closed"]
                    points = self.to(_moved(_outline(shape), stand))
                    yield Stroke(points, self.color, _pale(self.color) if closed else "", radius=self._radius(shape))

    def _radius(self, shape: scenes.Shape) -> float:
        """Of a circle, pixels; 0 of what is none."""
        return float(shape["circle"][2]) * self.to.scale if "circle" in shape else 0.0

    def _solids(self, pose: Floats) -> Iterator[Stroke]:
        """Outlines of the points that a sphere is swept over, those behind first."""
        drawn = []
        for solid in self.stage.solids:
            if "plane" not in solid:
                points = _placed(solid, pose)
                flat = self.to(points)
                ball = solid["radius"] * self.to.scale * ROUND
                around = _hull((flat[:, None] + ball).reshape(-1, 2))
                radius = solid["radius"] * self.to.scale if len(points) == 1 else 0.0
                strokes = [Stroke(around, self.color, _pale(self.color), radius=radius)]
                strokes += [Stroke(self.to(line), self.color, width=0.8) for line in self._marks(solid, pose)]
                drawn.append((self.to.depth(points).mean(), strokes))
        for _, strokes in sorted(drawn, key=lambda one: -one[0]):
            yield from strokes

    def _marks(self, solid: scenes.Shape, pose: Floats) -> Iterator[Floats]:
        """Yield the parts of lines on a round solid that are not behind it."""
        for line in solid.get("marks", ()):
            at, out = np.split(np.asarray(line), 2, axis=1)
            points = _placed({**solid, "points": at}, pose)
            ahead = self.to.depth(_placed({**solid, "points": at + out}, pose)) <= self.to.depth(points)
            for part in np.split(np.arange(len(points)), np.flatnonzero(np.diff(ahead)) + 1):
                if ahead[part[0]] and len(part) > 1:
                    yield points[part]

    def _arrows(self, pushes: Floats) -> Iterator[Stroke]:
        n = self.stage.dimensions
        for arrow in pushes if self.force else ():
            length = FORCE * HEIGHT / self.force / self.to.scale
            a, b = self.to(np.array([arrow[:n], arrow[:n] + length * arrow[n:]]))
            along = b - a
            size = float(np.hypot(*along))
            if size >= 2.0:
                yield Stroke(np.array([a, b]), PUSH, width=2.0)
                u, head = along / size, min(8.0, 0.6 * size)
                side = 0.45 * head * np.array([-u[1], u[0]])
                yield Stroke(np.array([b, b - head * u + side, b - head * u - side]), PUSH, PUSH)


class _Camera:
    """From metres to pixels."""

    def __init__(self, middle: Floats, scale: float, rows: Floats) -> None:
        self.middle, self.scale, self.rows = middle, scale, rows

    def __call__(self, points: Floats) -> Floats:
        return (points - self.middle) @ self.rows[:2].T * (self.scale, -self.scale) + (WIDTH / 2, HEIGHT / 2)

    def depth(self, points: Floats) -> Floats:
        """How far behind the middle points are, m."""
        found: Floats = (points - self.middle) @ self.rows[2]
        return found


def _camera(stage: scenes.Stage, points: Sequence[Floats]) -> _Camera:
    """One that sees all of these points, and in the plane what stands still."""
    still = [_outline(shape) for shape in stage.still]
    every = np.concatenate([*points, *still])
    low, high = every.min(axis=0), every.max(axis=0)
    span = np.maximum(high - low, 1e-9)
    if stage.dimensions == 2:
        scale = 0.86 * float(min(WIDTH / span[0], HEIGHT / span[1]))
        return _Camera((low + high) / 2.0, scale, np.eye(3, 2))
    (ca, sa), (cb, sb), up = (np.cos(TURN), np.sin(TURN)), (np.cos(TILT), np.sin(TILT)), -1.0 if stage.down else 1.0
    deep = np.array([sa, up * ca, 0.0])
    rows = np.array([[ca, -up * sa, 0.0], sb * deep + (0.0, 0.0, cb * up), cb * deep - (0.0, 0.0, sb * up)])
    return _Camera((low + high) / 2.0, 0.95 * HEIGHT / float(np.linalg.norm(span)), rows)


def _points(stage: scenes.Stage, pose: Floats) -> Iterator[Floats]:
    """What one instant spans."""
    if stage.frames:
        for solid in stage.solids:
            if "plane" not in solid:
                points = _placed(solid, pose)
                yield from (points - solid["radius"], points + solid["radius"])
    elif stage.lines:
        yield pose
    else:
        for shapes, stand in zip(stage.bodies, pose, strict=True):
            yield from (_moved(_outline(shape), stand) for shape in shapes)


def _placed(solid: scenes.Shape, pose: Floats) -> Floats:
    """Points of a solid in the world."""
    points: Floats = np.asarray(solid["points"], dtype=np.float64)
    if solid["body"] < 0:
        return points
    origin, x, y = pose[solid["body"]].reshape(3, 3)
    found: Floats = origin + points @ np.array([x, y, np.cross(x, y)])
    return found


def _outline(shape: scenes.Shape) -> Floats:
    if "circle" in shape:
        x, y, r = shape["circle"]
        around: Floats = np.array([x, y]) + r * ROUND
        return around
    return np.asarray(shape["points"], dtype=np.float64)


def _moved(points: Floats, stand: Floats) -> Floats:
    """Points of a planar body where it stands: x, y, angle."""
    c, s = np.cos(stand[2]), np.sin(stand[2])
    found: Floats = stand[:2] + points @ np.array([[c, s], [-s, c]])
    return found


def _hull(points: Floats) -> Floats:
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:  # all on one line
        return points


def _pale(color: str) -> str:
    """The colour as a glass over paper."""
    return "#" + "".join(f"{round(255 - 0.25 * (255 - int(color[i : i + 2], 16))):02x}" for i in (1, 3, 5))


def _nice(value: float) -> float:
    """Return the next of 1, 2, 5 times a power of ten."""
    ten = 10.0 ** np.floor(np.log10(value) + 1e-9)
    return float(next(ten * k for k in (1.0, 2.0, 5.0, 10.0) if ten * k >= 0.999 * value))


def svg(strokes: Sequence[Stroke], texts: Sequence[Text] = ()) -> str:
    """An SVG of one instant."""
    lines = [_tag(one) for one in strokes]
    lines += [
        f'<text x="{one.x:.2f}" y="{one.y:.2f}" text-anchor="{"end" if one.ends else "start"}" fill="{INK}" '
        f'stroke="{PAPER}" stroke-width="4" paint-order="stroke" font-family="sans-serif" font-size="{LETTERS}">'
        f"{escape(one.text)}</text>"
        for one in texts
    ]
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}">'
    return "\n".join([head, f'<rect width="100%" height="100%" fill="{PAPER}"/>', *lines, "</svg>", ""])


def _tag(one: Stroke) -> str:
    """A line, an area or a circle as SVG writes it."""
    if one.radius:
        x, y = one.centre
        shape = f'circle cx="{x:.2f}" cy="{y:.2f}" r="{one.radius:.2f}"'
    else:
        points = " ".join(f"{x:.2f},{y:.2f}" for x, y in one.points)
        shape = f'{"polygon" if one.fill else "polyline"} points="{points}"'
    return (
        f'<{shape} fill="{one.fill or "none"}" stroke="{one.color}" stroke-width="{one.width:g}" '
        'stroke-linejoin="round" stroke-linecap="round"/>'
    )


def raster(strokes: Sequence[Stroke], texts: Sequence[Text] = ()) -> Any:
    """An image of Pillow of one instant, drawn twice as large and made smaller, so that edges are smooth."""
    try:
        from PIL import Image, ImageDraw, ImageFont
    except ImportError:
        raise InvalidValue("PNG and GIF need Pillow (pip install pillow); SVG needs nothing.") from None
    image = Image.new("RGB", (2 * WIDTH, 2 * HEIGHT), PAPER)
    draw = ImageDraw.Draw(image)
    for one in strokes:
        if one.radius:
            (x, y), r = one.centre, one.radius
            ends = [2.0 * end for end in (x - r, y - r, x + r, y + r)]
            draw.ellipse(ends, fill=one.fill or None, outline=one.color, width=round(2 * one.width))
            continue
        points = [(2.0 * float(x), 2.0 * float(y)) for x, y in one.points]
        if one.fill:
            draw.polygon(points, fill=one.fill)
        draw.line([*points, *points[:1]] if one.fill else points, one.color, round(2 * one.width), joint="curve")
    font = ImageFont.load_default(2 * LETTERS)
    for text in texts:
        at, anchor = (2.0 * text.x, 2.0 * text.y), "rs" if text.ends else "ls"
        draw.text(at, text.text, fill=INK, font=font, anchor=anchor, stroke_width=4, stroke_fill=PAPER)
    return image.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)


def write(film: Film, path: Path, instant: float | None, fps: float, speed: float) -> None:
    """Write an SVG or PNG of one instant, s, else of the start, or the motion as a GIF of fps at times real time."""
    t, end = instant or 0.0, float(film.t[-1])
    if path.suffix not in SUFFIXES:
        raise InvalidValue(f"{path.name} is not a known kind of picture; valid: {', '.join(SUFFIXES)}.")
    if path.suffix == ".gif" and instant is not None:
        raise InvalidValue(f"{path.name} would show the whole motion; --at is for an SVG or PNG of one instant.")
    if not 0.0 <= t <= end:
        raise InvalidValue(f"{t:g} s is outside the motion, which lasts from 0 to {end:g} s.")
    if path.suffix == ".gif":
        count = max(int(end / speed * fps), 1) + 1
        first, *rest = (raster(*_whole(film, float(one))) for one in np.linspace(0.0, end, count))
        first.save(path, save_all=True, append_images=rest, duration=round(1000.0 / fps), loop=0)
    elif path.suffix == ".png":
        raster(*_whole(film, t)).save(path)
    else:
        path.write_text(svg(*_whole(film, t)), encoding="utf-8")


def _whole(film: Film, t: float) -> tuple[list[Stroke], list[Text]]:
    """What is drawn at an instant, s, and what tells how to read it."""
    drawn = film.at(t)  # first: a camera that follows decides what a metre is
    strokes, texts = film.legend(t)
    return [*drawn, *strokes], texts
