"""What spares numba work while it compiles: a third of the time that the integrator takes."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import event, ir, transforms, types
from numba.core.postproc import PostProcessor
from numba.core.types.functions import BaseFunction

_NUMBERS = (types.Integer, types.Float, types.Boolean)
_resolve = BaseFunction.get_call_type
_completed = PostProcessor.run
_told, _listed = types.Record.__repr__, ir.Inst._rec_list_vars
_WITHOUT_VARIABLES = frozenset({str, int, float, bool, type(None), ir.Loc})


@contextmanager
def hastened() -> Iterator[None]:
    """Compile without collecting garbage, and do once what is done thousands of times; within another, do nothing.

    A compiler makes objects by the million that all live as long as it works. For a sum of two
    numbers numba tries forty signatures, before every pass it writes out all types of the
    arguments, after half of them it finds anew how long each variable lives, and each of its locks
    tells timers that nobody asks.
    """
    if BaseFunction.get_call_type is not _resolve:
        yield
        return
    collects, tell = gc.isenabled(), event.broadcast
    gc.disable()
    BaseFunction.get_call_type, types.Record.__repr__ = _remembering(), _remembered_text()
    ir.Inst._rec_list_vars, event.broadcast, PostProcessor.run = _variables, _tell, _complete
    try:
        yield
    finally:
        BaseFunction.get_call_type, types.Record.__repr__ = _resolve, _told
        ir.Inst._rec_list_vars, event.broadcast, PostProcessor.run = _listed, tell, _completed
        if collects:
            gc.enable()


def _variables(statement: ir.Inst, value: Any) -> list[ir.Var]:
    """Return the variables in a part of a statement, as numba does, but for asking constants what they are."""
    kind = type(value)
    if kind is ir.Var:
        return [value]
    if kind is not dict and kind is not list and kind is not tuple:
        listed: list[ir.Var] = [] if kind in _WITHOUT_VARIABLES else _listed(statement, value)
        return listed
    found: list[ir.Var] = []
    for part in value.values() if kind is dict else value:
        if type(part) is ir.Var:
            found.append(part)
        elif type(part) not in _WITHOUT_VARIABLES:
            found += _variables(statement, part)
    return found


def _complete(after: PostProcessor, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
    """Put blocks in order after a pass, and find how long variables live only at first and where it is written down."""
    code = after.func_ir
    if emit_dels or code.is_generator or code.variable_lifetime is None:
        _completed(after, emit_dels, extend_lifetimes)
    else:
        code.blocks = transforms.canonicalize_cfg(code.blocks)


def _tell(told: event.Event) -> None:
    """Tell an event to those who listen to it, but for timers."""
    for listener in event._registered[told.kind]:
        if type(listener) is not event.TimingListener:
            listener.notify(told)


def _remembered_text() -> Any:
    """Return what writes out a record's type, which is done once for each."""
    known: dict[int, tuple[types.Record, str]] = {}

    def text(record: types.Record) -> str:
        if id(record) not in known:
            known[id(record)] = record, _told(record)
        return known[id(record)][1]

    return text


def _remembering() -> Any:
    """Return numba's choice of a signature, which is made once for numbers of the same types."""
    known: dict[tuple[Any, ...], tuple[Any, Any]] = {}

    def get_call_type(function: BaseFunction, context: Any, args: Any, kws: Any) -> Any:
        if kws or not all(isinstance(arg, _NUMBERS) for arg in args):
            return _resolve(function, context, args, kws)
        asked = (function.typing_key, *args)
        if asked not in known:
            found = _resolve(function, context, args, kws)
            if found is None:
                return None
            known[asked] = found, function._impl_keys[found.args]
        signature, function._impl_keys[signature.args] = known[asked]
        return signature

    return get_call_type
