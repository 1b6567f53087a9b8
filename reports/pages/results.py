"""What a folder of results holds, as far as pages need it: tables at once, motions when asked for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pyarrow import ArrowException

from crossbody.cases import InvalidValue, OutputError
from crossbody.reports.judging.verdict import COLUMNS, Row, Word, by
from crossbody.reports.measuring.truth import TRUTH
from crossbody.reports.runs import beside
from crossbody.reports.runs.files import file_name, listed
from crossbody.reports.runs.output import is_staged, recover
from crossbody.reports.runs.store import Trace, load, peek
from crossbody.reports.runs.study import check_fields, read_json

NAMED = 3
"""Cases in which nothing moves that are named."""
NUMBER = (int, float, type(None))
JUDGED = {name: NUMBER if kind is float else (str,) for name, kind in COLUMNS.items()}
AUDITED = dict.fromkeys(("case", "engine", "profile", "quantity"), (str,))
Times = dict[tuple[str, str], tuple[float, float | None]]
"""(case:variant, engine:profile) -> run time, and what it took in all where that is known, s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseFiles:
    """One case with its motions on disk.

    Attributes:
        label: case:variant.
        page: name of its page.
        about: what is known of it; of the truth, where there is one.
        paths: files of its motions, truth first.
        missing: sentences on motions that should be there and cannot be read.
    """

    label: str
    page: str
    about: Mapping[str, Any]
    paths: tuple[Path, ...]
    missing: tuple[str, ...]

    def traces(self) -> list[Trace]:
        """The motions themselves."""
        return [load(path) for path in self.paths]


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """A folder of results.

    Attributes:
        out: the folder.
        verdicts: their rows; `base` those compared with, and `base_name` where they stand.
        rows, audits: verdicts and parity audit of each case (by its label), as plain rows.
        told: provenance.
        cases: in the order of their verdicts.
        walls: (case:variant, engine:profile) -> run time, s.
        engines: those that ran on some case, profiles of one side by side.
    """

    out: Path
    verdicts: Sequence[Row]
    rows: Mapping[str, list[dict[str, Any]]]
    audits: Mapping[str, list[dict[str, Any]]]
    told: Mapping[str, Any]
    cases: tuple[CaseFiles, ...]
    walls: Mapping[tuple[str, str], float]
    engines: Sequence[str]
    base: Sequence[Row] | None = None
    base_name: str = ""

    @property
    def footer(self) -> str:
        """What made these results, in one line."""
        version = self.told.get("versions", {}).get("crossbody", "of an unknown version")
        return f"crossbody {version} · {self.told.get('command', '')} · {self.told.get('time', '')}"


def read(out: Path, against: Path | None = None) -> Results:
    """Read the tables of a folder and find its motions."""
    told = read_json(out / "provenance.json")
    if not isinstance(told.get("versions", {}), dict):
        raise OutputError(f"{out / 'provenance.json'}: versions is not an object.")
    verdicts = verdicts_of(out)
    audited = read_json(out / "audit.json")["rows"]
    check_fields(out / "audit.json", audited, AUDITED)
    audits = by(audited, "case")
    cases, times = _cases(out, verdicts)
    base = None if against is None else verdicts_of(against)
    return Results(
        out=out, verdicts=verdicts, rows=by(verdicts, "label"), audits=audits, told=told,
        cases=cases, walls={one: wall for one, (wall, _) in times.items()}, engines=engines_of(verdicts), base=base,
        base_name="" if against is None else str(against),
    )  # fmt: skip


def verdicts_of(out: Path) -> list[Row]:
    """Verdicts of a folder, with the case's label and the engine's as columns of their own."""
    if out.is_dir() and not is_staged(out):
        recover(out)
    table = read_json(out / "verdicts.json")
    rows: list[Row] = table["rows"]
    if lacking := [name for name in COLUMNS if any(name not in row for row in rows)]:
        versions = table.get("provenance", {}).get("versions", {})
        version = versions.get("crossbody", "another version") if isinstance(versions, dict) else "another version"
        raise OutputError(
            f"{out / 'verdicts.json'} was written by crossbody {version}: its verdicts have no {', '.join(lacking)}; "
            "run the cases again."
        )
    check_fields(out / "verdicts.json", rows, JUDGED)
    return [
        row | {"label": f"{row['case']}:{row['variant']}", "who": f"{row['engine']}:{row['profile']}"} for row in rows
    ]


def engines_of(verdicts: Sequence[Row]) -> list[str]:
    """Engines that ran on some case, in the order of their rows, profiles of one engine side by side."""
    from crossbody.reports.pages.grid import names

    ran = {row["who"] for row in verdicts if row["verdict"] != Word.SKIPPED}
    return [who for who in names(row for row in verdicts if row["engine"] != TRUTH) if who in ran]


def _cases(out: Path, verdicts: Sequence[Row]) -> tuple[tuple[CaseFiles, ...], Times]:
    """Every case that has a verdict or a motion, and the run times with what each engine took in all."""
    paths: dict[str, list[Path]] = {}
    abouts: dict[str, Mapping[str, Any]] = {}
    times: Times = {}
    broken: list[str] = []
    for path in (out / "traces" / name for name in listed(out, "traces") if name.endswith(".parquet")):
        try:
            told = peek(path)
        except OutputError:
            raise
        except (OSError, ValueError, KeyError, ArrowException):
            broken.append(path.name)
            continue
        about = told["about"]
        label, who = f"{about['case']}:{about['variant']}", f"{about['engine']}:{about['profile']}"
        paths.setdefault(label, []).append(path)
        abouts.setdefault(label, about)
        times[label, who] = told["wall_s"], about.get("took_s")
    labels = dict.fromkeys([*(row["label"] for row in verdicts), *paths])
    ran = by((row for row in verdicts if row["verdict"] != Word.SKIPPED), "label")
    wanted = {label: list(dict.fromkeys(row["who"] for row in rows)) for label, rows in ran.items()}
    found = tuple(
        CaseFiles(
            label=label, page=f"case-{file_name(label)}", about=abouts.get(label, {}),
            paths=tuple(paths.get(label, ())),
            missing=_missing(label, wanted.get(label, []), times, broken),
        ) for label in labels
    )  # fmt: skip
    return found, times


def times_of(out: Path) -> tuple[Times, str]:
    """Run times of a folder, and what each engine took in all, s, by case:variant and engine:profile; what rests."""
    cases, times = _cases(out, verdicts_of(out))
    return times, at_rest(cases)


def at_rest(cases: Sequence[CaseFiles]) -> str:
    """Say in which cases nothing moves, so that verdicts on them say little of motions; nothing if there are none."""
    still = [case.label for case in cases if case.about.get("still")]
    named = ", ".join(still[:NAMED]) + (f" and {len(still) - NAMED} more" if len(still) > NAMED else "")
    starts = any(case.about.get("still") and "start" in case.about.get("parameters", {}) for case in cases)
    hint = " --start NAME VALUE gives a robot file another start." if starts else ""
    return f"Nothing moves in {named}: the truth stays where it starts.{hint}" if still else ""


def _missing(label: str, engines: list[str], times: Times, broken: list[str]) -> tuple[str, ...]:
    if not (lost := [who for who in ["truth:", *engines] if (label, who) not in times]):
        return ()
    names = ", ".join(who.removesuffix(":") for who in lost)
    unreadable = f" (not readable: {', '.join(broken)})" if broken else ""
    return (f"No motion is stored for {names}{unreadable}, which is missing in the figures below.",)


def check(against: Path | None, others: Sequence[Path]) -> None:
    """Say before anything is computed whether the folders to be shown beside can be read."""
    if against is not None:
        verdicts_of(against)
    for other in others:
        beside.tables(other)


def motion(out: Path, case: str, engine: str) -> Trace:
    """One motion of a folder, "truth" or of an engine:profile."""
    from crossbody.reports.figures.styles import label

    verdicts = verdicts_of(out)
    found = _cases(out, verdicts)[0]
    drawable = [one for one in found if one.paths and case in ("", one.label)]
    listed = _listed(one.label for one in found)
    if not drawable:
        raise InvalidValue(f"{out} has no motion of {case or 'a case'}; it has {listed}.")
    if len(drawable) > 1:
        raise InvalidValue(f"{out} has motions of several cases; choose one with --case: {listed}.")
    mine = drawable[0]
    traces = mine.traces()
    names = [label(trace) for trace in traces]
    place = next((i for i, name in enumerate(names) if engine in (name, name.partition(":")[0])), None)
    if place is None:
        raise InvalidValue(f"{out} has no motion of {engine} on {mine.label}; it has {_listed(names)}.")
    return traces[place]


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"
