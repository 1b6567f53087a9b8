"""The output folder: studies side by side, each whole or not there; what crossbody did not write is never touched.

A study is written into a hidden folder inside the output folder. When all is there, one renaming makes
it the one that counts: its files are then moved to their places, and whoever comes next finishes that
if the process is killed on the way. Every instant has the old study or the new one, whole.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from crossbody.cases import OutputError
from crossbody.reports import voice
from crossbody.reports.runs import files, manifest
from crossbody.reports.runs.manifest import JUDGED, MARKER, Manifest, replace_text

__all__ = [
    "MARKER",
    "check",
    "folder",
    "gather",
    "is_ours",
    "is_staged",
    "recover",
    "replace_text",
    "require_ours",
    "tables",
]

NEW, READY = ".crossbody-new.", ".crossbody-ready."
PLAN = ".plan.json"
HALF = f".{MARKER}."  # how half-written manifests begin
OURS = (MARKER, HALF)  # how all that begins that crossbody makes in an output folder besides results


@dataclass(slots=True)
class _Staged:
    """A study that is being written: into which folder, others' files beside it for the pages, and those taken in."""

    home: Path
    study: str
    adds: bool
    linked: dict[str, tuple[int, int]] = field(default_factory=dict)
    taken: set[str] = field(default_factory=set)

    def is_linked(self, made: Path, name: str) -> bool:
        """Whether a file is still that of another study, and not written anew."""
        return self.linked.get(name) == _identity(made / name)


_STAGED: dict[Path, _Staged] = {}


def _identity(path: Path) -> tuple[int, int]:
    status = os.lstat(path)
    return status.st_dev, status.st_ino


def is_staged(path: Path) -> bool:
    """Whether a folder is that of a study which this process is writing."""
    return path in _STAGED


def home(path: Path) -> Path:
    """Return the output folder of a study that is being written; another folder is its own."""
    return _STAGED[path].home if path in _STAGED else path


def others(made: Path) -> set[str]:
    """Return the files of a study that is being written which it has not written itself."""
    staged = _STAGED[made]
    return staged.taken | {name for name in staged.linked if staged.is_linked(made, name)}


def took(made: Path, name: str) -> None:
    """Note that a file of a study that is being written was taken from another folder."""
    _STAGED[made].taken.add(name)


def is_ours(path: Path) -> bool:
    """Whether crossbody has written into a folder."""
    return (path / MARKER).is_file()


def require_ours(path: Path, what: str) -> None:
    """Require a folder into which crossbody has written.

    Args:
        path: the folder.
        what: that it holds, as the user is asked for it.

    Raises:
        OutputError: if there is none, or crossbody has not written into it.
    """
    if not is_ours(path):
        found = "was not written by crossbody" if path.is_dir() else "is not a folder"
        raise OutputError(
            f"{path} {found if path.exists() else 'does not exist'}; name the folder of an earlier {what}."
        )


def tables(path: Path) -> list[str]:
    """Names of the tables in a folder."""
    return [name for name in files.listed(path) if name.endswith(".json")]


def check(path: Path, study: str = "study") -> None:
    """Say before anything is computed whether a study can be written into a folder.

    Raises:
        OutputError: if it is a file, holds something that is not ours, has the verdicts of
            another study, or its parent cannot be written.
    """
    if path.is_symlink() or (path.exists() and not path.is_dir()):
        raise OutputError(f"Output {path} is not a folder; name a new folder or one that crossbody wrote.")
    if path.is_dir():
        _check_content(path, study)
    parent = next(p for p in (path.absolute(), *path.absolute().parents) if p.exists())
    try:  # permissions alone do not tell: the file system has its own say
        tempfile.TemporaryFile(dir=parent).close()
    except OSError:
        raise OutputError(f"Output folder {path} cannot be made: {parent} cannot be written.") from None


def _check_content(path: Path, study: str) -> None:
    try:
        found = [p.name for p in path.iterdir() if not p.name.startswith(OURS)]
    except OSError as error:
        raise OutputError(f"Output folder {path} cannot be read: {error.strerror}.") from None
    if found and not (path / MARKER).is_file() and not _unfinished(path):
        raise OutputError(f"Output folder {path} holds files that crossbody did not write; name a new folder.")
    recover(path)
    known = manifest.read(path)
    other = known.judged()
    if study in JUDGED and other not in ("", study):
        raise OutputError(
            f"Output folder {path} holds the verdicts of `crossbody {other}`, which `crossbody "
            f"{study}` would replace; name another folder, for example --out {path / study}."
        )
    fixed = ("index.html", "verdicts.json", "verdicts.csv", "verdicts.parquet", "provenance.json")
    for name in fixed if (path / MARKER).is_file() else ():
        if os.path.lexists(path / name) and name not in known.files:
            raise OutputError(f"{path / name} exists and was not written by crossbody; move it, or name a new folder.")


@contextmanager
def folder(path: Path, study: str = "study", adds: bool = False) -> Iterator[Path]:
    """Write a study: into a hidden folder, whose files take their places when all is written; nothing stays if not.

    Args:
        path: the output folder.
        study: name of the study. What it wrote here before is replaced; other studies and other files stay.
        adds: whether it keeps the files that it had here.

    Yields:
        The hidden folder.

    Raises:
        OutputError: as `check`, or if the disk refuses.
    """
    check(path, study)
    home = path.absolute()
    first = first_missing(home)
    try:
        home.mkdir(parents=True, exist_ok=True)
        made = Path(tempfile.mkdtemp(prefix=f"{NEW}{study}.", dir=home))
        made.chmod(0o755)
    except OSError as error:
        raise OutputError(f"Output folder {path} cannot be made: {error.strerror}.") from None
    _STAGED[made] = _Staged(home, study, adds)
    try:
        with _locked(made):
            yield made
            _commit(made)
    except OSError as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(f"Output folder {path} cannot be written: {error.strerror or error}.") from error
    finally:
        del _STAGED[made]
        shutil.rmtree(made, ignore_errors=True)
        take_away(home, first)


def first_missing(home: Path) -> Path | None:
    """The outermost folder that has to be made for a folder; None if it is there."""
    return next((p for p in (*reversed(home.parents), home) if not p.exists()), None)


def take_away(home: Path, first: Path | None) -> None:
    """Remove the folders, from `first` on inwards, made for a study that failed, if empty."""
    while first is not None and first in (home, *home.parents):
        try:
            home.rmdir()
        except OSError:
            return
        home = home.parent


def _own(made: Path) -> set[str]:
    """Files of the study itself; empty tables are dropped where another study has them."""
    staged, known = _STAGED[made], manifest.read(_STAGED[made].home)
    own = {name for name in files.walked(made) if not staged.is_linked(made, name)}
    if staged.study in JUDGED:
        return own
    spare = {name for name in own if manifest.is_base(name) and known.owner(name) not in ("", staged.study)}
    files.remove(made, spare)
    return own - spare


def gather(made: Path) -> Path:
    """Put the tables of the other studies of an output folder beside those of one that is being written.

    Returns:
        The output folder.
    """
    staged = _STAGED[made]
    own, known = _own(made), manifest.read(staged.home)
    given = set(filter(manifest.is_table, files.listed(staged.home))) - known.files  # put there by hand
    for name in (known.updated(staged.study, own, staged.adds).files | given) - own:
        if manifest.is_page(name) or name in staged.linked:
            continue
        (made / name).parent.mkdir(exist_ok=True)
        with suppress(FileNotFoundError):  # somebody has removed it
            _link(staged.home, name, made / name)
            staged.linked[name] = _identity(made / name)
    return staged.home


def put(made: Path, name: str, data: bytes) -> None:
    """Put a file into a study that is being written."""
    replace_text(made / name, data)


def put_shared(made: Path, name: str, data: bytes) -> None:
    """Put a file that all studies of a folder share into one that is being written.

    Where it stands there already, byte by byte, it is linked: the disk need not take megabytes of script once more.
    """
    with suppress(OSError, OutputError):
        if files.read_inside(_STAGED[made].home, name) == data:
            return _link(_STAGED[made].home, name, made / name)
    put(made, name, data)


def _link(home: Path, name: str, to: Path) -> None:
    """The same file under a second name; a copy on disks without links. Whoever writes it replaces it."""
    with files.open_inside(home, name) as file:
        try:
            os.link(home / name, to, follow_symlinks=False)
        except FileNotFoundError:
            raise
        except OSError:
            to.write_bytes(file.read())


def _commit(made: Path) -> None:
    """Make a finished study the one that counts, and put its files in their places."""
    staged = _STAGED[made]
    with _locked(staged.home):
        own, known = _own(made), manifest.read(staged.home)
        if theirs := sorted(name for name in own - known.files if os.path.lexists(staged.home / name)):
            raise OutputError(
                f"{staged.home / theirs[0]} exists and was not written by crossbody; "
                f"the results are in {_kept(made, staged.study)} instead."
            )
        replace_text(made / PLAN, json.dumps({"study": staged.study, "files": sorted(own), "adds": staged.adds}))
        ready = made.with_name(READY + made.name.removeprefix(NEW))
        os.rename(made, ready)
        _place(staged.home, ready)


def _kept(made: Path, study: str) -> Path:
    """A folder of its own for results that cannot go where they should."""
    home = made.parent
    place = next(p for i in range(1, 10_000) if not os.path.lexists(p := home / f"{study}-{i}"))
    manifest.write(made, Manifest().updated(study, files.walked(made)))
    os.rename(made, place)
    return place


def _place(home: Path, ready: Path) -> None:
    """Move the files of a finished study to their places; may be begun again after any of its steps."""
    try:
        plan = files.decoded(files.read_inside(ready, PLAN))
        own, study, adds = [str(name) for name in plan["files"]], str(plan["study"]), bool(plan["adds"])
    except (FileNotFoundError, ValueError, KeyError, TypeError):
        own, study, adds = [], "", True
    if study and all(files.is_plain(name) for name in own):
        for name in own:
            with suppress(FileNotFoundError):  # it is in its place already
                files.move(ready, home, name)
        before = manifest.read(home)
        after = before.updated(study, own, adds)
        files.remove(home, before.files - after.files)
        manifest.write(home, after)
        with suppress(FileNotFoundError):
            os.unlink(ready / PLAN)  # from here on it is rubbish
    shutil.rmtree(ready, ignore_errors=True)


@contextmanager
def _locked(path: Path, wait: bool = True) -> Iterator[bool]:
    """Hold a folder against other processes; whether it could be had. The end of this process lets go."""
    handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        yield True
    except BlockingIOError:
        yield False
    finally:
        os.close(handle)


def _unfinished(path: Path) -> list[Path]:
    """Studies that were killed while they were being written, or moved to their places."""
    return [p for p in sorted(path.iterdir()) if p.name.startswith((NEW, READY)) and p.is_dir() and not p.is_symlink()]


def recover(path: Path) -> None:
    """Finish what a killed process had begun: a study that was whole is put in its place, another is taken away.

    Raises:
        OutputError: if the disk refuses.
    """
    if path.is_symlink() or not path.is_dir() or not _unfinished(path):
        return
    try:
        with _locked(path):
            for left in _unfinished(path):
                with _locked(left, wait=False) as free:
                    if free:
                        _recover(path, left)
            for half in path.glob(f"{HALF}*"):
                half.unlink()
    except OSError as error:
        raise OutputError(f"Output folder {path} cannot be completed: {error.strerror or error}.") from None


def _recover(home: Path, left: Path) -> None:
    if left.name.startswith(READY):
        _place(home, left)
        voice.note(f"{home}: the results of an interrupted command have been moved to their place.")
        return
    shutil.rmtree(left, ignore_errors=True)
    voice.note(f"{home}: incomplete tables of an interrupted command have been removed.")
