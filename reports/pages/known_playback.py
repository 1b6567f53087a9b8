"""What playback, loops of force over depth and friction's figures must draw of made-up motions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from crossbody.cases import Mode
from crossbody.cases.arrays import Floats
from crossbody.cases.scene import Body, Joint, Pair, Scene, Shape
from crossbody.cases.scene_plain import plain
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
    yield "events", packed["events"], sorted(e.t for e in made.traces[0].run.events)
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
    yield f"whether {who} is the truth", float(track["truth"]), float(i == 0)
    if i:
        yield f"colour of {who}", track["color"], look(who)["color"]


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


KINDS = {
    "loops off scale": _far,
    "playback": _playback, "loops of force": _loops, "friction figures": _friction, "loops": _sides,
}  # fmt: skip
