"""What the commands `gapmap` and `stability` do."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from crossbody import engines
from crossbody.reports import layout, voice
from crossbody.reports.commands.shared import check_answers, print_rows, publish, where
from crossbody.reports.maps import gapmap, stability
from crossbody.reports.runs import choice, output
from crossbody.reports.runs.provenance import provenance

GAP_MAP = ("reference:compiled", "mujoco", "pinocchio")


def gap_map(counts: Sequence[int], wanted: Sequence[str], points: int, out: Path, command: str) -> int:
    """Run the sliders over all gaps; writes the table and the page."""
    check_answers("gapmap")
    picks = choice.picks(wanted or [name for name in GAP_MAP if name.partition(":")[0] in engines.names()])
    output.check(out, "gapmap")
    with voice.progress(len(counts) * len(gapmap.lines(picks))) as tell:
        rows = gapmap.gap_map(counts, picks, points, tell)
    publish(out, "gapmap", {"gapmap": rows}, provenance(command, points=points))
    lines = gapmap.summary(rows)
    if not voice.told_as_json({"gapmap": rows, "summary": lines}):
        for sentence in gapmap.in_words(lines) if not voice.quiet() else ():
            click.echo(layout.told(sentence))
        print_rows(lines.drop(columns="why"), heads={"at_s": "at s", "n": "balls"})
        for line in lines[lines["why"] != ""].to_dict(orient="records"):
            run = f"{line['n']} balls, {line['engine']}:{line['profile']}, {line['machine']}"
            click.echo(layout.told(f"{run}: {line['why']}"))
        where(out)
    return 0


def stability_map(wanted: Sequence[str], out: Path, command: str) -> int:
    """Run the closed-loop maze with one thing changed at a time; writes the table and the page."""
    picks = choice.picks(wanted) if wanted else (stability.DEFAULT,)
    output.check(out, "stability")
    with voice.progress(len(picks) * len(stability.POINTS)) as tell:
        rows = stability.stability_map(picks, stability.POINTS, tell)
    publish(out, "stability", {"stability": rows}, provenance(command, rtol=stability.RTOL))
    surprises = stability.surprises(rows)
    if not voice.told_as_json({"stability": rows, "surprises": surprises}):
        print_rows(rows.drop(columns=["change", "why"]))
        for row in surprises.to_dict(orient="records"):
            run = f"{row['engine']}:{row['profile']} {row['scene']}"
            click.echo(layout.told(f"outside: {run}: {row['expected']} expected. {row['why']}"))
        where(out)
    return int(len(surprises) > 0)
