"""What playback, loops of force over depth and friction's figures must draw of made-up motions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from crossbody.cases import Event, Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Body, Joint, Loop, Pair, Scene, Shape
from crossbody.cases.scene_plain import plain
from crossbody.reports import scenes
from crossbody.reports.figures.styles import look
from crossbody.reports.pages import friction, playback
from crossbody.reports.pages.known_figures import drawn
from crossbody.reports.pages.made_up_traces import (
    CONTACTS,
    OFF,
    ON,
    TURNING,
    WHO,
    Said,
    axis,
    lines,
    numbers,
)
from crossbody.reports.scenes import Stage

MU, WEIGHTS = 0.37, (1.0, 2.0)
"""Of friction; and the two components of an arrow for a multiplier of 1."""


def _arrows(q: Floats, lam: Floats, _: Any = None) -> Floats:
    """Return where the arrows of all contacts stand, and their forces (n, nc, 4)."""
    at = np.repeat(q[:, None, :2], lam.shape[1], axis=1) + np.arange(lam.shape[1])[:, None]
    found: Floats = np.concatenate([at, lam[:, :, None] * WEIGHTS], axis=2)
    return found


def _playback() -> Iterator[Said]:
    made = drawn()
    scene: Any = SimpleNamespace(stage=lambda _: Stage(), poses=lambda q, _: q[:, None, :], arrows=_arrows)
    packed = playback.packed(made.traces, scene, 0.0)
    largest = [float(np.abs(one.run.lam).max()) for one in made.traces]
    blows = [max(abs(e.impulse) for e in one.run.events) for one in made.traces]
    yield "the longest arrow", packed["force"], sorted(largest)[1]
    yield "the longest arrow of a blow", packed["impulse"], sorted(blows)[1]
    yield "the end", packed["end"], max(float(one.run.t[-1]) for one in made.traces)
    yield "engines", tuple(track["name"] for track in packed["tracks"]), WHO
    for i, track in enumerate(packed["tracks"]):
        yield from _track(i, track)


def _track(i: int, track: Any) -> Iterator[Said]:
    made, who = drawn(), WHO[i]
    run, t = made.traces[i].run, numbers(track["t"]).ravel()
    yield f"first and last picture of {who}", t[[0, -1]], run.t[[0, -1]]
    yield f"poses of {who}", numbers(track["poses"]), made.at(i, t)
    arrows = numbers(track["arrows"]).reshape(len(t), OFF, 4)
    pushes = np.array(list(_since(run.t.astype(np.float32), run.lam[:, :OFF], t)))
    yield f"arrows of {who}", arrows, _arrows(made.at(i, t), pushes)
    yield f"largest arrow of {who}", np.abs(arrows[:, :, 2]).max(axis=0), np.abs(run.lam[:, :OFF]).max(axis=0)
    struck = [e for e in run.events if e.impulse]
    yield f"instants of blows of {who}", numbers(track["struck"]), [e.t for e in struck]
    impulses = [[e.impulse if e.contact == k else 0.0 for k in range(OFF)] for e in struck]
    at = made.at(i, np.array([e.t for e in struck]))
    yield f"blows of {who}", numbers(track["blows"]), _arrows(at, np.array(impulses)).reshape(len(struck), -1)
    instants, told = track["happens"]
    apart = 0.0 if i == 0 else max(float(one.run.t[-1]) for one in made.traces) / 600.0
    events = sorted(run.events, key=lambda event: event.t)
    alone = [e for e in events if not any(0.0 <= e.t - other.t <= apart for other in events if other is not e)]
    firsts = [e.t for e in alone]
    yield f"first events of {who}", [t for t in instants if t in firsts], firsts
    yield f"how late an event of {who} may be told", float(_latest(instants, events) <= apart), 1.0
    single = [e for e in alone if not any(0.0 <= other.t - e.t <= apart for other in events if other is not e)]
    words = tuple(f"{CONTACTS[e.contact]} {'bounces' if e.impulse else 'touches'}" for e in single)
    yield f"what happens in {who}", tuple(told[instants.index(e.t)] for e in single), words
    yield f"whether {who} is the truth", float(track["truth"]), float(i == 0)
    if i:
        yield f"colour of {who}", track["color"], look(who)["color"]


WORDS = {
    "FREE": "opens", "CONTACT": "presses", "BALLISTIC": "lets go below the surface", "COLLISION": "collides",
    "COLLISION_SEPARATION": "separates", "BILATERAL": "holds", "STICK": "sticks", "SLIP": "slips",
}  # fmt: skip
"""What a contact does by the mode that it comes into; from FREE into either of those that press it touches."""


def _words() -> Iterator[Said]:
    """Yield what is said of every change of mode, one a second."""
    made, pairs = drawn().traces[0], [(one, two) for one in Mode for two in Mode if one != two]
    events = tuple(Event(t=float(k), contact=0, before=one, after=two) for k, (one, two) in enumerate(pairs))
    instants, told = playback.happens(replace(made, run=replace(made.run, events=events)))
    yield "instants of all changes", instants, [e.t for e in events]
    touches = {"CONTACT": "touches", "COLLISION": "touches", "STICK": "touches and sticks", "SLIP": "touches and slips"}
    words = [(touches if a.name == "FREE" else WORDS).get(b.name, WORDS[b.name]) for a, b in pairs]
    yield "words of all changes", tuple(told), tuple(f"{CONTACTS[0]} {word}" for word in words)


def _latest(instants: list[float], events: list[Event]) -> float:
    """Return how long after the last instant that is told before it an event comes at most, s."""
    return max(e.t - max((t for t in instants if t <= e.t), default=-np.inf) for e in events)


def _since(samples: Floats, lam: Floats, pictures: Floats) -> Iterator[Floats]:
    """Yield the multipliers of largest size since the picture before; where no sample is, the last."""
    before = -np.inf
    for t in pictures:
        new = lam[(samples > before) & (samples <= t)]
        known = new if len(new) else lam[samples <= t][-1:]
        yield np.array([max(column, key=abs) for column in known.T.tolist()])
        before = t


def _loops() -> Iterator[Said]:
    """Yield forces over depths of contacts that open, those first whose force is largest in the first motion."""
    traces = drawn().traces
    (section,) = friction.hysteresis(traces)
    most = np.abs(traces[0].run.lam[:, :ON]).max(axis=0)
    order = sorted(range(ON), key=lambda k: -most[k])
    yield "order of contacts", tuple(plot.choice for plot in section.plots), tuple(CONTACTS[k] for k in order)
    for plot, k in zip(section.plots, order, strict=True):
        figure: Any = plot.figure
        length, force = ("[rad]", "torque [N m]") if CONTACTS[k] in TURNING else ("[m]", "force [N]")
        found, _ = lines(figure, axis(figure, force)), axis(figure, "depth", length, kind="x")
        yield "engines", tuple(found), WHO
        for who, one in zip(WHO, traces, strict=True):
            yield f"depth of {CONTACTS[k]} of {who}", found[who][0], -one.run.gap[:, k]
            yield f"force of {CONTACTS[k]} of {who}", found[who][1], one.run.lam[:, k]


def _far() -> Iterator[Said]:
    """Yield that a force far beyond the truth's is off the plot of its loop, whose title says how far and whose."""
    one = drawn().traces
    far = replace(one[2], run=replace(one[2].run, lam=37.7 * one[2].run.lam))
    (section,) = friction.hysteresis([*one[:2], far])
    for plot in section.plots:
        k, layout = CONTACTS.index(plot.choice), plot.figure["layout"]  # type: ignore[index]
        unit, own = "N m" if plot.choice in TURNING else "N", one[0].run.lam[:, k]
        said = f"Off scale: {WHO[2]} up to {float(np.abs(far.run.lam[:, k]).max()):.3g} {unit} ({plot.choice})"
        yield f"what is off the loop of {plot.choice}", float(said in layout["title"]["text"]), 1.0
        low, high = layout["yaxis"]["range"]
        yield f"the axis of the loop of {plot.choice}", [low, high], [1.5 * own.min(), 1.5 * own.max()]


def _scene() -> Scene:
    """Return a ball on three slides over a floor: its slip is its velocity."""
    slides = zip("xyz", map(tuple, np.eye(3).tolist()), strict=True)
    return Scene(
        bodies=(Body(name="ball", mass=1.0, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)),),
        joints=tuple(Joint(name=name, body="ball", type="slide", axis=way) for name, way in slides),
        shapes=(Shape(name="floor", type="plane", size=(1.0, 1.0, 1.0)),
                Shape(name="ball", body="ball", size=(0.1, 0.0, 0.0))),
        pairs=(Pair(name="a", first="floor", second="ball", dimension=3, friction=(MU, MU, 0.0, 0.0, 0.0)),),
    )  # fmt: skip


def _friction() -> Iterator[Said]:
    told = {"scene": plain(_scene()), "contacts": ("a", "a t1", "a t2", "off")}
    traces = [replace(one, about={**one.about, **told}) for one in drawn().traces]
    (section,) = friction.friction(traces)
    cone, plane, slip = (plot.figure for plot in section.plots)
    top = max(float(one.run.lam[:, 0].max()) for one in traces)
    (edge,) = cone["layout"]["shapes"]  # type: ignore[index]
    yield "the edge of the cone", [edge["x0"], edge["y0"], edge["x1"], edge["y1"]], [0.0, 0.0, top, MU * top]
    axis(cone, "normal force", "[N]", kind="x")
    forces, shares = lines(cone, axis(cone, "|friction|", "[N]")), lines(plane, axis(plane, "t2", "bound"))
    slips = lines(slip, axis(slip, "slip t2", "[m/s]"))
    for who, one in zip(WHO, traces, strict=True):
        on = one.run.lam[:, 0] > 0.0
        normal, first, second = one.run.lam[on, :3].T
        yield f"normal force and friction of {who}", forces[who], [normal, np.sqrt(first**2 + second**2)]
        yield f"friction over its bound of {who}", shares[who], np.array([first, second]) / (MU * normal)
        yield f"slip of {who}", slips[who], one.run.v[on, :2].T


def _sides() -> Iterator[Said]:
    """Yield that rows that are always on, and those without a force, have no loop."""
    traces = [replace(one, run=replace(one.run, mode=np.full_like(one.run.mode, Mode.BILATERAL)))
              for one in drawn().traces]  # fmt: skip
    yield "loops of rows that are always on", float(len(friction.hysteresis(traces))), 0.0


R, SLANT = 0.3, (0.8, 0.36, 0.48, 0.0)
"""Radius of a ball, m, and a quaternion."""
CORNERS = ((0.1, 0.2, -0.3), (-0.2, 0.1, -0.1), (0.1, -0.3, -0.2), (0.0, 0.1, 0.4))


def _met() -> Scene:
    """Return balls and a hull over a floor, a link with bounds on both sides, and a loop: rows of every kind."""
    even, at = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    rubs: Any = {"dimension": 3, "friction": (MU, MU, 0.0, 0.0, 0.0)}
    return Scene(
        bodies=tuple(Body(name=name, mass=1.0, inertia=even) for name in ("one", "two", "hull", "link")),
        joints=(*(Joint(name=name, body=name, type="free") for name in ("one", "two", "hull")),
                Joint(name="turn", body="link", type="hinge", range=(-2.0, 2.0))),
        shapes=(Shape(name="floor", type="plane", size=(1.0, 1.0, 1.0)),
                *(Shape(name=name, body=name, size=(R, 0.0, 0.0)) for name in ("one", "two")),
                Shape(name="hull", body="hull", type="hull", size=at, corners=CORNERS)),
        pairs=(Pair(name="a", first="floor", second="one", **rubs), Pair(name="b", first="one", second="two"),
               Pair(name="c", first="floor", second="hull")),
        loops=(Loop(name="loop", type="connect", first="link", second="one", first_position=(0.5, 0.1, 0.0)),),
    )  # fmt: skip


def _rows() -> Iterator[Said]:
    """Yield where arrows of a scene stand and the force of which row each carries, one row after another."""
    draw, n = np.random.default_rng(5), 3
    one, two, hull = draw.normal(size=(3, n, 3)) + np.array([0.0, 0.0, 3.0])
    turn, upright = draw.normal(size=(n, 1)), np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    slant = np.tile(SLANT, (n, 1))
    q = np.concatenate([one, upright, two, slant, hull, slant, turn], axis=1)
    lam, up = draw.uniform(1.0, 9.0, (n, 3 + 2 + 2 + len(CORNERS) + 2)), np.array([0.0, 0.0, 1.0])
    first = np.concatenate([lam[:, 11:13], lam[:, 5:6]], axis=1)  # friction along the plane's axes, behind all normals
    w, x, y, z = SLANT
    turned = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                       [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                       [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])  # fmt: skip
    c, s = np.cos(turn), np.sin(turn)
    apart = (two - one) / np.sqrt(((two - one) ** 2).sum(axis=1, keepdims=True))
    corners, bears = hull[:, None, :] + np.array(CORNERS) @ turned.T, lam[:, 7:11, None]
    wanted = {
        "a loop": (np.concatenate([0.5 * c - 0.1 * s, 0.5 * s + 0.1 * c, 0.0 * c], axis=1), lam[:, :3]),
        "a ball on the floor": (one - R * up, first), "two balls": (two - R * apart, lam[:, 6:7] * apart),
        "a hull": ((bears * corners).sum(axis=1) / bears.sum(axis=1), bears.sum(axis=1) * up),
    }  # fmt: skip
    own: Any = {"scene": plain(_met())}
    drawn, posed = scenes.load("scene").arrows(q, lam, own), scenes.load("scene").poses(q, own)
    axes = {"one": np.eye(3), "two": turned, "hull": turned}
    for k, (name, origin) in enumerate(zip(axes, (one, two, hull), strict=True)):
        pose = np.concatenate([origin, np.tile(axes[name].T[:2].ravel(), (n, 1))], axis=1)
        yield f"pose of the body {name}", posed[:, k], pose
    yield "pose of a link", posed[:, 3], np.concatenate([0 * q[:, :3], c, s, 0 * c, -s, c, 0 * c], axis=1)
    yield "number of arrows", drawn.shape[1], len(wanted)
    for k, (what, (at, force)) in enumerate(wanted.items()):
        yield f"place of {what}", drawn[:, k, :3], at
        yield f"force on {what}", drawn[:, k, 3:], force


def _pairs_of_balls() -> Iterator[Said]:
    """Yield both arrows of each pair of balls in a row."""
    x, lam, r = np.array([[0.0, 1.0, 3.0]]), np.array([[2.0, 5.0]]), 0.25
    centres = np.stack([x, np.zeros_like(x)], axis=2)
    left, right = ([[x + side * r, 0.0, -side * f, 0.0] for x, f in zip(at, (2.0, 5.0), strict=True)]
                   for at, side in (((0.0, 1.0), 1.0), ((1.0, 3.0), -1.0)))  # fmt: skip
    yield "both arrows of balls in a row", scenes.pushes(centres, lam, r), [*left, *right]


KINDS = {
    "arrows of rows": _rows, "arrows of balls": _pairs_of_balls, "playback": _playback, "words of playback": _words,
    "loops of force": _loops,
    "friction figures": _friction, "loops": _sides, "loops off scale": _far,
}  # fmt: skip
