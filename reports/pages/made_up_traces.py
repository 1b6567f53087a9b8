"""Stored motions that nobody computed, of a truth and two engines, and what figures draw of them, decoded.

Coordinates are cubics in time with their rates, so that they are known between samples; all else is drawn at random
for every sample. The multipliers of largest size are negative: a largest value is none of largest size.
"""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from crossbody.cases import Event, Ledger, Mode, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.reports.runs.store import Trace

Said = tuple[str, Any, Any]
"""Which number, as it is drawn, and as it must be: numbers, arrays of numbers, or words."""
SEED, SAMPLES, MANY = 11, 40, 5000
NAMES, UNITS, CONTACTS = ("x", "y", "z"), ("m", "cm", "rad"), ("a", "b", "on", "off")
"""Coordinates, each of a unit of its own; contacts: two that open, one that never does, one that carries nothing."""
TURNING, ON, OFF = ("b",), 2, 3
WHO = ("truth", "one:p", "two:q")


class Drawn:
    """Motions of a truth and two engines; `cubics` (4, 3) of the coordinates of each, the highest power first."""

    def __init__(self, seed: int = SEED, samples: int = SAMPLES) -> None:
        self.draw, self.samples = np.random.default_rng(seed), samples
        self.cubics = [self.draw.normal(size=(4, 3)) for _ in WHO]
        scales, gaps = self.draw.uniform(1.0, 2.0, (2, len(CONTACTS)))
        self.about = {
            "case": "made_up", "variant": "", "mechanism": "made_up", "parameters": {}, "contacts": CONTACTS,
            "coordinates": [{"name": n, "unit": u} for n, u in zip(NAMES, UNITS, strict=True)],
            "turning": TURNING, "scales": scales[: len(NAMES)].tolist(), "gap_scales": gaps.tolist(),
        }  # fmt: skip
        self.traces = [self._trace(i) for i in range(len(WHO))]

    def at(self, i: int, t: Floats) -> Floats:
        """Return the coordinates of a motion at instants (n, 3)."""
        return np.stack([np.polyval(one, t) for one in self.cubics[i].T], axis=1)

    def _trace(self, i: int) -> Trace:
        engine, _, profile = WHO[i].partition(":")
        starts = np.sort(self.draw.uniform(0.0, 1.0, 9))
        about = self.about | {
            "engine": engine, "profile": profile,
            "steps": (starts.tolist(), self.draw.uniform(0.02, 0.05, 9).tolist()),
        }  # fmt: skip
        run = self._run(i)
        return Trace(about=about, run=run, truth=self._run(i) if i else None)

    def _run(self, i: int) -> Trajectory:
        draw, n = self.draw, self.samples
        t = np.concatenate([[0.0], np.cumsum(draw.uniform(0.5, 1.5, n - 1)) / n])
        rates = np.stack([np.polyval(np.polyder(one), t) for one in self.cubics[i].T], axis=1)
        gap, lam, energy = draw.normal(size=(n, 4)), 300.0 * draw.uniform(-1.0, 0.8, (n, 4)), draw.normal(size=(n, 2))
        gap[:, OFF], lam[:, OFF] = np.abs(gap[:, OFF]), 0.0
        back = np.where(np.arange(n) < 0.75 * n, -0.9, 0.9)  # its impulse is largest there, and at the end less
        lam[:, ON] = back * np.abs(lam[:, ON])
        lam[:, 1] *= np.where(lam[:, 1] < 0.0, 1.3, 0.5)
        lam[n // 3] *= np.where(lam[n // 3] < 0.0, 1.2, -1.2)
        mode = draw.choice([Mode.FREE, Mode.CONTACT], (n, 4)).astype(np.int8)
        mode[:, ON], mode[:, OFF] = Mode.BILATERAL, Mode.FREE
        book = Ledger(contact=draw.normal(size=(n, 4)), input=draw.normal(size=n), dissipated=draw.normal(size=n))
        q = self.at(i, t) if len(t) == SAMPLES else draw.normal(size=(n, 3))
        lam *= 1.0 + 0.1 * i  # of the truth the least
        return Trajectory(
            t=t, q=q, v=rates, gap=gap, lam=lam, energy=energy + np.array([3.0, 0.0]), mode=mode, ledger=book, steps=n,
            events=tuple(self._events(t)),
        )  # fmt: skip

    def _events(self, t: Floats) -> list[Event]:
        """Return blows at samples, the largest that pulls, and what happens between samples."""
        at = np.sort(self.draw.choice(np.arange(2, len(t) - 2), 6, replace=False)).tolist()
        sizes = self.draw.uniform(1.0, 9.0, 6) * (1, -1, 1, 1, -1, 1)
        sizes[1] = -9.0 - self.draw.uniform()
        return [
            Event(t=float(t[k]), contact=j % 2, before=Mode.FREE, after=Mode.FREE, impulse=float(sizes[j]))
            if j < 4 else Event(t=0.3 * float(t[k]) + 0.7 * float(t[k + 1]), contact=j % 2, before=Mode.FREE,
                                after=Mode.CONTACT)
            for j, k in enumerate(at)
        ]  # fmt: skip


def numbers(coded: Any) -> Floats:
    """Return the numbers of an array that a page reads from base64, or of a list."""
    if not isinstance(coded, dict):
        return np.asarray(coded, dtype=np.float64)
    found = np.frombuffer(base64.b64decode(coded["bdata"]), dtype=coded["dtype"]).astype(np.float64)
    return found.reshape([int(n) for n in coded["shape"].split(",")]) if "shape" in coded else found


def axis(figure: Any, *words: str, kind: str = "y") -> str:
    """Return the one axis with these words in its title, as lines name it.

    Raises:
        LookupError: if there is none, or several.
    """
    titles = {
        key: str(value["title"]["text"]).replace("<br>", " ") for key, value in figure["layout"].items()
        if key.startswith(f"{kind}axis") and "title" in value
    }  # fmt: skip
    found = [key for key, title in titles.items() if all(word in title for word in words)]
    if len(found) != 1:
        raise LookupError(f"{len(found)} {kind} axes are called {' '.join(words)}")
    named: str = found[0].replace("axis", "")
    return named


def lines(figure: Any, at: str) -> dict[str, tuple[Floats, Floats]]:
    """Return the finite points x, y of the line of each engine on a y axis."""
    found = {}
    for line in figure["data"]:
        if line.get("yaxis", "y") == at and line.get("mode") != "markers":
            x, y = numbers(line["x"]), numbers(line["y"])
            known = np.isfinite(x) & np.isfinite(y)
            found[line["meta"]] = x[known], y[known]
    return found


def levels(figure: Any, at: str) -> list[tuple[float, str]]:
    """Return the values and names of the lines across the plot of a y axis."""
    return [(s["y0"], s["name"]) for s in figure["layout"].get("shapes", ()) if s["yref"] == at and s["y0"] == s["y1"]]


def bands(figure: Any, at: str) -> list[float]:
    """Return the half widths around the truth in the plot of a y axis."""
    return [half for line in figure["data"] if line.get("yaxis", "y") == at for half in line.get("band", ())]
