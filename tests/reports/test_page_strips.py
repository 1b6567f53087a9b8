"""The strip of modes: every bar is where its contact is in its mode in its engine, and bars fill the horizon."""

from __future__ import annotations

import numpy as np
import pytest

from crossbody.cases import Mode, Trajectory
from crossbody.reports.pages.figures import note
from crossbody.reports.pages.sheet import MODE_COLOURS, changing, modes
from crossbody.reports.runs.store import Trace

CONTACTS = ("left", "right", "below", "still")


def drawn(random: np.random.Generator, engine: str) -> Trace:
    t = np.append(0.0, np.cumsum(random.uniform(0.01, 1.0, 60)))
    mode = np.repeat(random.choice(list(Mode), (21, len(CONTACTS))), 3, axis=0)[: len(t)].astype(np.int8)
    mode[:, 3] = Mode.BILATERAL
    wide = np.zeros((len(t), len(CONTACTS)))
    run = Trajectory(t=t, q=wide, v=wide, gap=wide, lam=wide, energy=wide[:, :2], mode=mode)
    return Trace(about={"engine": engine, "profile": "own", "contacts": CONTACTS}, run=run)


@pytest.mark.parametrize("seed", range(4))
def test_every_interval_of_every_mode_is_a_bar(seed: int) -> None:
    random = np.random.default_rng(seed)
    traces = [drawn(random, engine) for engine in ("one", "two")]
    assert changing(traces) == ([(0, "left"), (1, "right"), (2, "below")], [("still", "BILATERAL")])
    figure = modes(traces)
    assert "BILATERAL throughout, in every engine: still." in note("modes", traces)
    filled = dict.fromkeys([(c, t.about["engine"]) for c in CONTACTS[:3] for t in traces], 0.0)
    for bar in figure["data"]:
        (contact, who), mode = bar["y"][0].split(", "), Mode[bar["name"]]
        trace = next(trace for trace in traces if f"{trace.about['engine']}:own" == who == bar["meta"])
        assert bar["marker"]["color"] == MODE_COLOURS[mode]
        row, t = CONTACTS.index(contact), trace.run.t
        for start, width in zip(bar["base"], bar["x"], strict=True):
            inside = (t[:-1] >= start - 1e-12) & (t[:-1] < start + width - 1e-12)
            assert (trace.run.mode[:-1][inside, row] == mode).all()
            filled[contact, who.removesuffix(":own")] += width
    for trace in traces:
        assert [filled[c, trace.about["engine"]] for c in CONTACTS[:3]] == pytest.approx([trace.run.t[-1]] * 3)
