"""A command in a process of its own: Ctrl-C stops it within a second, and what hangs or crashes in there is reported.

Compiled code does not come back to the interpreter until it is done, and a kernel may never be:
no signal handler and no thread of the same process reaches it. The command therefore runs in a
child, and its parent does nothing but watch: it forwards an interrupt and ends the child if that
does not help, and it ends the child when a run takes longer than it may. The command is then
begun again without that run; what was complete is on disk and is not done twice.
"""

from __future__ import annotations

import io
import json
import mmap
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, TextIO

from crossbody.cases.parent import die_with_parent

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer as Buffer

GRACE = 0.6  # time that an interrupted command has to put its things in order, s
LIMIT = 3660.0
"""Time that one engine may take for one scene, s: what the reference allows itself, and a minute."""
SLOW = 5.0  # time after which it is told what is being done, s
TICK = 0.2
SOON = 0.01  # time after which an interrupt that was swallowed is raised again, s
_ROOM = 1 << 16
ENDED = (0, 1, 2)  # exit codes of a command that had come to its end before the interrupt reached it


class Stopped(BaseException):
    """The user interrupts the command. Not a KeyboardInterrupt, which a run takes as its own end."""


class _Diary:
    """What the child is doing, where the parent can read it even when the child is gone."""

    def __init__(self) -> None:
        self.pages = mmap.mmap(-1, _ROOM)

    def write(self, **told: object) -> None:
        text = json.dumps(self.read() | told).encode()[: _ROOM - 8]
        self.pages[8 : 8 + len(text)] = text
        self.pages[:8] = len(text).to_bytes(8, "little")

    def read(self) -> dict[str, object]:
        size = int.from_bytes(self.pages[:8], "little")
        try:
            return dict(json.loads(bytes(self.pages[8 : 8 + size]))) if size else {}
        except ValueError:  # it was killed while it wrote
            return {}


_diary: _Diary | None = None
_stopping = False
_begun_for_it = False
_lost: dict[str, str] = {}


def limited(label: str, seconds: float | None = None) -> None:
    """Say what is run from now on; it alone is lost if it hangs or crashes.

    Args:
        label: what.
        seconds: how long it may take, s; as long as what was run before it if not given.
    """
    if _diary is not None:
        seconds = float(str(_diary.read().get("seconds", LIMIT))) if seconds is None else seconds
        _diary.write(label=label, until=time.monotonic() + seconds, seconds=seconds)


def doing(text: str) -> None:
    """Say what begins now, or nothing: what takes long is told on stderr, even while it leaves no thread a turn."""
    if _diary is not None:
        _diary.write(doing=text, since=time.monotonic())


def stopping() -> bool:
    """Whether the user has interrupted this process, also where a library took that for its fault."""
    return _stopping


def alone() -> bool:
    """Whether this process was begun for the command, which none but crossbody's own code has touched."""
    return _begun_for_it


def unlimited() -> None:
    """Say that what is done from now on may take as long as it likes."""
    if _diary is not None:
        _diary.write(label="", until=0.0)


def resumable(how: str) -> None:
    """Say in one sentence what an interrupt leaves, and how to go on."""
    if _diary is not None:
        _diary.write(how=how)


def lost(label: str) -> str:
    """Why something was ended that is not to be tried again; empty if it was not."""
    return _lost.get(label, "")


def all_lost() -> tuple[str, ...]:
    """Everything that was ended."""
    return tuple(_lost)


def watched(command: Callable[[], int]) -> int:
    """Run a command in a child and watch it; its exit code.

    Returns:
        What the command returns; 130 if it was interrupted, 143 if it was told to end, 3 if it
        crashed outside the runs that it had named, at least 1 if one of these had to be ended.
    """
    global _diary
    _diary = _Diary()
    _lost.clear()
    while True:
        status, signalled = _Watch(command, _diary).wait()
        if signalled and not (os.WIFEXITED(status) and os.WEXITSTATUS(status) in ENDED):
            return _say_stopped(signalled, _diary.read())
        if os.WIFEXITED(status):
            return max(os.WEXITSTATUS(status), 1 if _lost else 0)
        label = str(_diary.read().get("label", ""))
        if not label or label in _lost:
            number = os.WTERMSIG(status)
            return _say(f"the command was ended by {_name(number)}; please report it.{_advice(number)}", 3)
        _lost[label] = _why(os.WTERMSIG(status), _diary.read())
        _say(f"{label}: {_lost[label]} The others continue without it.", 1)


def _why(number: int, told: dict[str, object]) -> str:
    if number == signal.SIGKILL and time.monotonic() >= float(str(told.get("until", "inf"))):
        return f"It did not return within {float(str(told['seconds'])):g} s and was terminated; see --time-limit."
    return f"Its process was ended by {_name(number)}.{_advice(number)}"


def _advice(number: int) -> str:
    """What to do about a signal by which code of ours or of a user's kernels has crashed."""
    if number not in (signal.SIGSEGV, signal.SIGBUS, signal.SIGABRT, signal.SIGILL, signal.SIGFPE):
        return ""
    return " If it runs your own kernels, CROSSBODY_DEBUG=1 in the environment makes them check every index."


def _name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def _say(text: str, code: int) -> int:
    with suppress(OSError):  # the code tells where stderr cannot
        sys.stderr.write(f"crossbody: {text}\n")
        sys.stderr.flush()
    return code


def _say_stopped(number: int, told: dict[str, object]) -> int:
    how = str(told.get("how") or "Nothing was replaced.")
    if sys.stderr.isatty():  # a bar may have hidden the cursor
        sys.stderr.write("\r\x1b[K\x1b[?25h")
    return _say(f"interrupted. {how}", 128 + number)


def beside(tasks: Sequence[Callable[[], int]], jobs: int, told: Callable[[int], None]) -> int:
    """Run tasks in processes beside this one, each watched like a command; the largest of their exit codes.

    A task that fails says nothing: whoever wants its result finds it missing, and does it here,
    where faults are told.

    Args:
        tasks: each leaves its result on disk.
        jobs: how many at once.
        told: is given the index of each task that has ended.
    """
    left, running, worst = list(enumerate(tasks)), dict[int, int](), 0
    try:
        while left or running:
            while left and len(running) < jobs:
                index, task = left.pop(0)
                running[_begun(task)] = index
            process, status = os.wait()
            if process in running:
                worst = max(worst, os.waitstatus_to_exitcode(status))
                told(running.pop(process))
    finally:
        for process in running:
            _end(process)
            os.waitpid(process, 0)
    return worst


def _begun(task: Callable[[], int]) -> int:
    """Begin a task in a process that an interrupt of the terminal reaches through its parent alone."""
    sys.stdout.flush()
    sys.stderr.flush()
    if process := os.fork():
        return process
    code = 0
    try:
        os.setpgid(0, 0)
        die_with_parent()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
            signal.signal(number, signal.SIG_DFL)
        code = watched(lambda: _quietly(task))
    finally:
        os._exit(code)


def _quietly(task: Callable[[], int]) -> int:
    with suppress(Exception):
        return task()
    return 0


class _Watch:
    """One child and its parent."""

    def __init__(self, command: Callable[[], int], diary: _Diary) -> None:
        self.command, self.diary = command, diary
        self.child, self.signalled, self.deadline, self.told = 0, 0, 0.0, ""

    def wait(self) -> tuple[int, int]:
        """The child's status when it is gone, and the signal by which the user stopped it (0: none)."""
        stopping = (signal.SIGINT, signal.SIGTERM)
        signal.pthread_sigmask(signal.SIG_BLOCK, stopping)  # none is lost between fork and handler
        self.diary.write(label="", until=0.0)
        sys.stdout.flush()
        sys.stderr.flush()
        self.child = os.fork()
        if not self.child:
            _obey(self.command)
        before = [signal.signal(number, self._stop) for number in stopping]
        alarm = signal.signal(signal.SIGALRM, self._look)
        signal.setitimer(signal.ITIMER_REAL, TICK, TICK)
        try:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, stopping)
            return os.waitpid(self.child, 0)[1], self.signalled
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            for number, handler in zip((*stopping, signal.SIGALRM), (*before, alarm), strict=True):
                signal.signal(number, handler)

    def _stop(self, number: int, _frame: FrameType | None) -> None:
        """Forward the first interrupt; end the child at the second."""
        if self.signalled:
            _end(self.child)
            return
        self.signalled, self.deadline = number, time.monotonic() + GRACE
        with suppress(ProcessLookupError):  # it has ended meanwhile, of itself or by the same Ctrl-C
            os.kill(self.child, signal.SIGINT)

    def _look(self, _number: int, _frame: FrameType | None) -> None:
        now = time.monotonic()
        said = self.diary.read()
        until, doing_ = float(str(said.get("until", 0.0))), str(said.get("doing", ""))
        if doing_ and doing_ != self.told and now - float(str(said.get("since", now))) >= SLOW:
            self.told = doing_
            _say(f"{doing_} has taken {SLOW:g} s and goes on.", 0)
        if (self.signalled and now >= self.deadline) or (until and now >= until):
            _end(self.child)


def _end(process: int) -> None:
    """Kill a process and all that it has begun."""
    for child in _children(process):
        _end(child)
    try:
        os.kill(process, signal.SIGKILL)
    except ProcessLookupError:
        return


def _children(process: int) -> list[int]:
    try:
        tasks = list(Path(f"/proc/{process}/task").iterdir())
        return [int(child) for task in tasks for child in (task / "children").read_text().split()]
    except OSError:
        return []


def _obey(command: Callable[[], int]) -> None:
    """Be the child: run the command, and leave without the parent's last words."""
    global _begun_for_it
    code, _begun_for_it = 3, True
    try:
        die_with_parent()
        sys.stdout, sys.stderr = _unread(sys.stdout), _unread(sys.stderr)
        signal.signal(signal.SIGINT, _stop_once)
        signal.signal(signal.SIGALRM, _stop_again)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        sys.unraisablehook = _insist
        signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT, signal.SIGTERM))
        code = command()
    except Stopped:
        code = 130
    except BaseException:  # none is expected; it must not go unseen
        traceback.print_exc()
    finally:
        _leave(code)


class _Pipe(io.FileIO):
    """An output whose reader may leave: then words go nowhere, and the command goes on."""

    def write(self, data: Buffer, /) -> int:
        try:
            return super().write(data)
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            return super().write(data)


def _unread(stream: TextIO) -> TextIO:
    """Return a stream that nobody has to read to its end; the same one if it is no file of the system's."""
    try:
        raw = _Pipe(stream.fileno(), "wb", closefd=False)
    except (AttributeError, OSError, ValueError):  # closed, or made by Python
        return stream
    stream.flush()
    return io.TextIOWrapper(
        io.BufferedWriter(raw), stream.encoding, stream.errors, line_buffering=stream is sys.stderr or raw.isatty()
    )


def _leave(code: int) -> None:
    """End as an interpreter does: threads joined, exit functions called, streams flushed."""
    import atexit
    import threading

    try:
        getattr(threading, "_shutdown", lambda: None)()
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)


def _stop_once(_number: int, _frame: FrameType | None) -> None:
    global _stopping
    _stopping = True
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal tells parent and child, and users are impatient
    raise Stopped


def _stop_again(_number: int, _frame: FrameType | None) -> None:
    raise Stopped


def _insist(swallowed: sys.UnraisableHookArgs) -> None:
    """Raise an interrupt again soon that came where nothing can be raised: in a callback or a finaliser."""
    if isinstance(swallowed.exc_value, Stopped):
        signal.setitimer(signal.ITIMER_REAL, SOON)
    else:
        sys.__unraisablehook__(swallowed)
