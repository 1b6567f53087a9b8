"""Playback of every engine of a case over one clock, from stored motions; the browser draws it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import CrossbodyError, Event, Mode, Trajectory
from crossbody.cases.arrays import Floats, distinct, quantiles
from crossbody.reports import scenes
from crossbody.reports.figures.section import Section
from crossbody.reports.figures.styles import coded, label, style
from crossbody.reports.measuring.cubics import coordinates
from crossbody.reports.measuring.scale import idle
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.pages.errors import told
from crossbody.reports.pages.figures import carrying, few, led, normals
from crossbody.reports.runs.store import Trace

ROOM = 280_000  # room of the motions on a page, bytes
FEWEST, MOST = 60, 900
BLOWS = 200
"""Impulses of one engine that are drawn, evenly chosen of more, and its instants that one steps through, of more
those that are near put together."""
FEW = 2  # contacts, and what they do, that are named of one instant
FRAMES = 600
"""Frames of a motion at its usual speed: what engines do within one of them, beside the truth, is one event."""
HAPPENS = {
    Mode.FREE: "opens", Mode.CONTACT: "presses", Mode.BALLISTIC: "lets go below the surface",
    Mode.COLLISION: "collides", Mode.COLLISION_SEPARATION: "separates", Mode.BILATERAL: "holds", Mode.STICK: "sticks",
    Mode.SLIP: "slips",
}  # fmt: skip
"""What a contact does when it comes into a mode."""
_SINGULAR = re.compile(r"(?<=ch)es\b|(?<=ss)es\b|(?<!s)s\b")
"""Ends of what one contact does, which several do without."""
TOUCHING = (Mode.CONTACT, Mode.COLLISION, Mode.STICK, Mode.SLIP)
TEXT = (
    "All engines at the same time, which the plots below share. Arrows are the whole forces of contacts, friction "
    "included, and of loops, with lengths proportional to the force; each shows the largest force "
    "since the previous frame, so that no impact is missed. An instantaneous collision has an impulse instead of a "
    "force: a hollow arrow that fades. An arrow that is cut off has a bar across. Differences from the truth can be "
    "exaggerated 10 and 100 times, of all engines or of one, at the scale of the picture, which they may leave. "
    "Keys, with the picture focused: space plays, comma and full stop go to the previous and next event, + and - zoom."
)


def playback(traces: Sequence[Trace], share: float = 1.0) -> list[Section]:
    """The section, in a share of its usual room, or one that says why there is none.

    Nothing where no motion, or no mechanism, is stored.
    """
    about = traces[0].about if traces else {}
    name = about.get("mechanism", "")
    if not name:  # a log that was replayed has none
        return []
    if name not in scenes.names():
        why = f"There is no picture of the mechanism {name}."
        return [Section(name="playback", title="Playback", text=why)]
    try:
        scene = packed(traces, scenes.load(name), share)
    except CrossbodyError as error:  # as of too many bodies
        return [Section(name="playback", title="Playback", text=f"This motion cannot be drawn: {error}.")]
    caption = f"Motion of {about['case']}, {about['variant']}, as {', '.join(map(label, traces))} computed it."
    return [
        Section(
            name="playback", title="Playback", text=f"{TEXT} {told(traces)}".strip(), template="playback.html",
            context={"scene": scene, "caption": caption,
                     "frames": scene["stage"]["frames"],
                     "compared": len(scene["tracks"]) > 1 and any(track["truth"] for track in scene["tracks"])},
        )
    ]  # fmt: skip


def packed(traces: Sequence[Trace], scene: scenes.Scene, share: float = 1.0) -> dict[str, Any]:
    """Stage, and of every trace its times, poses and arrows in single precision."""
    about = traces[0].about
    parameters = {**about["parameters"], "scene": about.get("scene")}
    stage = scene.stage(parameters)
    bearing = carrying(traces, idle(traces[0].run))
    pushing = _pushing(traces, scene, parameters, bearing)
    width = 1 + scene.poses(traces[0].run.q[:1], parameters)[0].size + 2 * stage.dimensions * int(pushing.sum())
    frames = int(np.clip(share * ROOM / (16 / 3 * width * len(traces)), FEWEST, MOST))
    moved = [trace for trace in traces if len(trace.run.t)]
    instants = pictures([trace.run for trace in moved], frames)
    drawn = [_track(trace, scene, parameters, instants, pushing) for trace in moved]
    end = max((float(trace.run.t[-1]) for trace in moved), default=0.0)
    for trace, track in zip(moved, drawn, strict=True):
        track["happens"] = happens(trace)
    return {
        "stage": asdict(stage) | {"dimensions": stage.dimensions}, "tracks": drawn,
        "end": end, "frame": end / FRAMES,
        "force": typical(_largest(trace.run.lam[:, bearing]) for trace in traces),
        "impulse": typical(_largest(np.array([e.impulse for e in trace.run.events])) for trace in traces),
    }  # fmt: skip


def _pushing(
    traces: Sequence[Trace], scene: scenes.Scene, parameters: Mapping[str, Any], bearing: Sequence[int]
) -> NDArray[np.bool_]:
    """Which arrows have a length with the rows that ever carry more than rounding, in some motion's poses."""
    runs = [trace.run for trace in traces if len(trace.run.t)]
    pressed = np.zeros(runs[0].lam.shape[1], dtype=bool)
    pressed[bearing] = True
    pressed[[event.contact for run in runs for event in run.events if event.impulse]] = True
    q = np.concatenate([run.q[np.linspace(0, len(run.t) - 1, FEWEST).astype(np.intp)] for run in runs])
    drawn = scene.arrows(q, np.broadcast_to(pressed.astype(np.float64), (len(q), len(pressed))), parameters)
    found: NDArray[np.bool_] = (drawn[:, :, drawn.shape[2] // 2 :] != 0.0).any(axis=(0, 2))
    return found


def happens(trace: Trace) -> tuple[list[float], list[str]]:
    """Instants of one motion that the buttons lead to, s, and what happens there in a few words.

    Events of one instant are put together; of very many those that are near.
    """
    events = sorted(trace.run.events, key=lambda event: event.t)
    found = _together(events, 0.0)
    if len(found) > BLOWS:
        found = _together(events, (events[-1].t - events[0].t) / (BLOWS - 1))
    return [each[0].t for each in found], [_said(each, trace.about["contacts"]) for each in found]


def _together(events: Sequence[Event], within: float) -> list[list[Event]]:
    """Events in order, those together that come within so long after the first of them, s."""
    found: list[list[Event]] = []
    for event in events:
        if found and event.t - found[-1][0].t <= within:
            found[-1].append(event)
        else:
            found.append([event])
    return found


def _said(events: Sequence[Event], contacts: Sequence[str]) -> str:
    """Which contacts do what, or how many events of them there are."""
    names = normals(list(dict.fromkeys(contacts[event.contact] for event in events)))
    does = list(dict.fromkeys(map(_does, events)))
    said = " and ".join(does) if len(does) <= FEW and len(events) <= 2 * FEW * len(names) else f"{len(events)} events"
    if len(names) > 1 or len(does) > FEW:
        return f"{few(names, FEW)}: {said}"
    return f"{names[0]} {_SINGULAR.sub('', said) if ' and ' in names[0] else said}"


def _does(event: Event) -> str:
    """What a contact does."""
    if event.impulse:
        return "bounces"
    if event.before != Mode.FREE or event.after not in TOUCHING:
        return HAPPENS[event.after]
    return f"touches and {HAPPENS[event.after]}" if event.after in (Mode.STICK, Mode.SLIP) else "touches"


def _track(
    trace: Trace, scene: scenes.Scene, parameters: Mapping[str, Any], instants: Floats, pushing: NDArray[np.bool_]
) -> dict[str, Any]:  # fmt: skip
    run = trace.run
    t = distinct(np.clip(instants, run.t[0], run.t[-1]))
    q = coordinates(run, t, trace.quaternions)
    lam = peaks(run.lam, np.maximum(np.searchsorted(run.t, t, side="right"), 1), led(trace.about["contacts"]))
    poses, arrows = scene.poses(q, parameters), scene.arrows(q, lam, parameters)[:, pushing]
    look = style(trace)
    return {
        "name": label(trace), "color": look["color"], "strokes": look["strokes"],
        "truth": label(trace) == TRUTH, "t": _single(t), "poses": _single(poses),
        "arrows": _single(arrows),
    } | _blows(run, scene, parameters, pushing)  # fmt: skip


def _blows(
    run: Trajectory, scene: scenes.Scene, parameters: Mapping[str, Any], pushing: NDArray[np.bool_]
) -> dict[str, Any]:
    """Collisions that took no time: their instants, and arrows of N s instead of N."""
    struck = [event for event in run.events if event.impulse]
    chosen_ = [struck[i] for i in distinct(np.linspace(0, len(struck) - 1, min(len(struck), BLOWS)).astype(int))]
    if not chosen_:
        return {"struck": [], "blows": []}
    at = np.minimum(np.searchsorted(run.t, [event.t for event in chosen_]), len(run.t) - 1)
    impulses = np.zeros((len(chosen_), run.lam.shape[1]))
    impulses[np.arange(len(chosen_)), [event.contact for event in chosen_]] = [event.impulse for event in chosen_]
    arrows = scene.arrows(run.q[at], impulses, parameters)[:, pushing]
    return {"struck": _single(run.t[at]), "blows": _single(arrows)}


def pictures(runs: Sequence[Trajectory], frames: int) -> Floats:
    """Return instants of pictures, s, the same for all motions: what lies between differs by no motion's own chords.

    Half of them evenly in time, the others around the events of each motion.
    """
    ends = [float(run.t[at]) for run in runs for at in (0, -1)]
    even = np.linspace(min(ends), max(ends), max(2, frames // 2))
    return distinct(np.concatenate([even, ends, *(_near(run, frames // (2 * len(runs))) for run in runs)]))


def _near(run: Trajectory, count: int) -> Floats:
    """Samples beside events of one motion, evenly chosen."""
    events = np.sort([event.t for event in run.events])
    some = events[np.linspace(0, len(events) - 1, min(len(events), count // 4)).astype(np.intp)]
    near = np.searchsorted(run.t, some)[:, None] + np.array([-2, 0, 1, 3])
    found: Floats = run.t[np.clip(near.ravel(), 0, len(run.t) - 1)]
    return found


def peaks(lam: Floats, ends: NDArray[np.intp], leads: Sequence[int] | None = None) -> Floats:
    """Of every multiplier the value of largest size since the picture before (frames, nc), N.

    `ends` are how many samples are past at each picture (frames,), nondecreasing, at least 1; 0
    where nobody can tell. `leads` are rows at whose largest values those of others are taken (nc,):
    friction where its contact presses most, so that both are forces of one instant.
    """
    known = np.nan_to_num(lam)
    found = np.empty((len(ends), lam.shape[1]))
    for i, (a, b) in enumerate(zip([0, *ends[:-1]], ends, strict=True)):
        part = known[min(a, b - 1) : b]
        largest = np.argmax(np.abs(part), axis=0)
        found[i] = part[largest if leads is None else largest[leads], np.arange(lam.shape[1])]
    return found


def typical(largest: Iterable[float]) -> float:
    """What is drawn as the longest arrow: the median of the largest of each engine, or 0."""
    found = [x for x in largest if x > 0.0]
    return float(quantiles(found, 0.5)[0]) if found else 0.0


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(np.nan_to_num(values)), initial=0.0))


def _single(array: Floats) -> dict[str, str]:
    return coded(np.nan_to_num(array).reshape(len(array), int(np.prod(array.shape[1:]))).astype("<f4"))
