"""What a gap map must say of sliders whose collisions are known, and of rows that are written out.

Two equal balls swap their velocities, whatever lies between them. Three that touch go on as one block where all their
contacts are integrated together: the velocities v (-1, 2, 2)/3 have the energy and the momentum of v (1, 0, 0), and are
2/3 v from what the balls do one after the other. Between touching and apart energy is made, 1/6 of it at most.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd

from crossbody import cases
from crossbody.cases import Mode
from crossbody.reports.judging.asked import Found, Within, unlike
from crossbody.reports.maps.gapmap import COLUMNS, LARGEST_S, gap_map, in_words, over, summary
from crossbody.reports.runs.choice import Pick

POINTS = 21
CLOSE, MADE = 1e-6, 0.02
"""What integrators leave; and by how much the most energy that is made is off its peak at so few gaps."""


@cache
def wrong() -> tuple[Found, ...]:
    """Return what, number, least and most, and of what, where it is another one."""
    return unlike((_runs, _ends, _summaries), "gap map", "sliders, which end in")


def _runs() -> Iterator[Within]:
    rows = gap_map((2, 3), [Pick(engine="reference", profile="compiled")], POINTS)
    rows = rows[rows["machine"] == "level"]
    plain = cases.load("newtons_cradle", "sliders", n=2)
    farthest = LARGEST_S * plain.number("speed") / math.sqrt(plain.number("a0"))
    for n in (2, 3):
        own, told = rows[rows["n"] == n], f"{n} balls"
        yield "runs", told, float(len(own)), POINTS, 0.0
        yield "gap", told, float(own["gap"].max()), farthest, CLOSE * farthest
        yield "momentum", told, float(own["momentum"].abs().max()), 0.0, CLOSE
        yield "to_sequential", f"{told} far apart", float(own["to_sequential"].iloc[-1]), 0.0, CLOSE
    two, three = (rows[rows["n"] == n] for n in (2, 3))
    yield "energy_created", "2 balls", float(two["energy_created"].abs().max()), 0.0, CLOSE
    first = three.iloc[0]
    for name, wanted in (("energy_created", 0.0), ("to_sequential", 2.0 / 3.0), ("to_simultaneous", 0.0)):
        yield name, "3 balls that touch", float(first[name]), wanted, CLOSE
    yield "energy_created", "3 balls", float(three["energy_created"].max()), 1.0 / 6.0, MADE


def _ends() -> Iterator[Within]:
    """Yield 1 where a row of balls that goes on to collide, or still does, is said to have ended, or another is not."""
    free, press = int(Mode.FREE), int(Mode.CONTACT)
    for what, last, mode, wanted in (
        ("that part", (-1.0, 0.5, 2.0), (free, free), True),
        ("of which two close", (-1.0, 2.0, 0.5), (free, free), False),
        ("that go on as one", (1.0, 1.0, 1.0), (free, free), True),
        ("that still push", (-1.0, 0.5, 2.0), (free, press), False),
    ):  # fmt: skip
        run: Any = SimpleNamespace(
            q=np.array([[0.0, 1.0, 2.0], [3.0, 2.0, 1.0]]),
            v=np.array([[3.0, 0.0, 0.0], last]),
            mode=np.array([mode] * 2),
        )
        yield "end", f"balls {what}", float(over(run) != wanted), 0.0, 0.0


def _summaries() -> Iterator[Within]:
    """Yield what is said of a line that makes the most energy amid, is ideal from some gap on, and failed once."""
    told: list[dict[str, Any]] = [
        dict.fromkeys(COLUMNS, math.nan)
        | {
            "n": 3,
            "engine": "a",
            "profile": "b",
            "machine": "level",
            "nearest": "block",
            "outcome": "finished",
            "why": "",
        }
        | {"s": s, "energy_created": made, "to_sequential": off}
        for s, made, off in ((0.0, 0.01, 0.5), (1.0, 0.2, 2e-3), (2.0, 0.05, 1e-4), (3.0, 0.0, 0.0))
    ]
    told.append(told[1] | {"outcome": "diverged", "s": 1.5, "energy_created": math.nan})
    lines = summary(pd.DataFrame(told, columns=list(COLUMNS)))
    (line,) = lines.to_dict(orient="records")
    for name, wanted in (("most", 0.2), ("at_s", 1.0), ("ideal_from", 2.0), ("failed", 1.0)):
        yield name, "a line of a map", float(line[name]), wanted, 1e-12
    words = " ".join(in_words(lines))
    for name, pattern, wanted in (
        ("per cent", r"(\S+) % of the energy", 20.0), ("at s", r"at s = ([\d.]+)", 1.0),
        ("from s", r"from s = (\S+) on", 2.0),
        ("balls", r"(\d+) balls", 3.0), ("lines", r"(\d+) of 1 follow", 1.0), ("runs", r"(\d+) runs failed", 1.0),
    ):  # fmt: skip
        found = re.search(pattern, words)
        yield name, "a line of a map in words", float(found[1]) if found else math.nan, wanted, 1e-12
