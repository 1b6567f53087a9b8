"""What a compiled function reads, as one digest.

numba freezes the values of globals and closures, and all that a function calls, into its machine code,
but looks for changes in the function's own file alone. The digest here covers what numba freezes:
bytecode, constants and defaults, the globals and closure that the bytecode names, and the functions among
these in the same way. Comments, docstrings, line numbers and globals that are not read are no part of it.

Libraries (numba, numpy, the standard library) count by their versions.
"""

from __future__ import annotations

import dis
import enum
import hashlib
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import cache, lru_cache
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

import numpy as np
from numba.core import types
from numba.core.dispatcher import Dispatcher
from numba.core.extending import _Intrinsic
from numba.core.typing.templates import builtin_registry

LIBRARIES = frozenset({"numba", "numpy", "llvmlite", "scipy"})
_PYTHON = os.path.join(os.path.realpath(os.path.dirname(os.__file__)), "")
_NAMED = (ModuleType, type, FunctionType, BuiltinFunctionType, type(np.sum))
_SAME = {int, float, complex, bool, str, bytes, tuple, np.float64, np.int64}
_PLAIN = (type(None), type(Ellipsis), bool, int, float, complex, str, bytes)


class Unreadable(Exception):  # noqa: N818 - says what it is
    """A value that has no digest: what reads it cannot be kept from one process to the next."""


def fingerprint(function: Callable[..., Any]) -> str:
    """Return the digest of all that a function reads, 64 hexadecimal digits.

    Raises:
        Unreadable: if it reads a value whose content cannot be told, such as an instance of a class.
    """
    walk = _Walk()
    walk.function(function)
    return walk.digest.hexdigest()


def names_within(function: Callable[..., Any]) -> set[str]:
    """Return the names, each behind its module's, of a function and of all compiled ones that it calls."""
    walk = _Walk()
    with suppress(Unreadable):  # what was met until then is known all the same
        walk.function(function)
    return {name_of(one.py_func) for one in walk.kept if isinstance(one, Dispatcher)} | {name_of(function)}


def name_of(function: Callable[..., Any]) -> str:
    """Return the name of a function behind that of its module."""
    return f"{function.__module__}.{function.__name__}"


class _Reads(NamedTuple):
    """What the bytecode of a function and of those inside it names."""

    parts: tuple[Any, ...]
    globals: tuple[str, ...]
    names: frozenset[str]


def _any_of(*opcodes: int) -> re.Pattern[bytes]:
    return re.compile(b"[" + re.escape(bytes(opcodes)) + b"]")


_CONSTANTS = _any_of(*(opcode for opcode in dis.hasconst if opcode < 256))
_GLOBALS = {_any_of(dis.opmap["LOAD_GLOBAL"]): 1, _any_of(dis.opmap["LOAD_NAME"]): 0}
"""What loads a global by its name, and by how many bits the number of the name is shifted."""


def _bytes_of(opcodes: bytes, at: int) -> Iterator[int]:
    """Yield where the bytes of an instruction's argument stand, the lowest first."""
    yield at
    while at and opcodes[at - 1] == dis.EXTENDED_ARG:
        at -= 1
        yield at


@lru_cache(maxsize=8192)
def _reads(code: CodeType) -> _Reads:
    """Take code apart: its steps and constants in the order of use, the globals that it loads, and all its names."""
    opcodes, arguments = code.co_code[::2], bytearray(code.co_code[1::2])

    def loaded(what: re.Pattern[bytes]) -> Iterator[int]:
        for at in (found.start() for found in what.finditer(opcodes)):
            if at and opcodes[at - 1] == dis.EXTENDED_ARG:
                yield sum(arguments[byte] << 8 * k for k, byte in enumerate(_bytes_of(opcodes, at)))
            else:
                yield arguments[at]

    constants = [code.co_consts[number] for number in loaded(_CONSTANTS)]
    found = {code.co_names[number >> shift] for what, shift in _GLOBALS.items() for number in loaded(what)}
    inner = [_reads(constant) for constant in constants if isinstance(constant, CodeType)]
    # A docstring stands first among the constants: what is loaded counts, not its number.
    for constant in _CONSTANTS.finditer(opcodes):
        for at in _bytes_of(opcodes, constant.start()):
            arguments[at] = 0
    shape = (
        opcodes, bytes(arguments), code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars,
        code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags, code.co_exceptiontable,
    )  # fmt: skip
    told = [(k, value) for k, value in enumerate(constants) if type(value) in _PLAIN]
    others = (value for value in constants if type(value) not in _PLAIN)
    parts = (
        repr((shape, told)),
        *(_reads(value).parts if isinstance(value, CodeType) else value for value in others),
    )
    return _Reads(
        parts,
        tuple(sorted(found.union(*(reads.globals for reads in inner)))),
        frozenset(code.co_names).union(*(reads.names for reads in inner)),
    )


class _Walk:
    """One pass over what is read; what was met before is told by its number, so that circles end."""

    def __init__(self) -> None:
        self.digest = hashlib.sha256()
        self.met: dict[Any, int] = {}
        self.kept: list[Any] = []  # an address is a name only as long as what has it lives

    def put(self, *parts: str | bytes) -> None:
        for part in parts:
            data = part.encode("utf-8", "surrogatepass") if isinstance(part, str) else part
            self.digest.update(b"%d:" % len(data) + data)

    def first(self, key: Any, thing: Any) -> bool:
        """Whether this is met for the first time."""
        known = key in self.met
        self.put(f"#{self.met.setdefault(key, len(self.met))}")
        self.kept.append(thing)
        return not known

    def function(self, function: Callable[..., Any]) -> None:
        """Add a function: its code, defaults, closure and globals."""
        if not isinstance(function, FunctionType):
            raise Unreadable(f"{function!r} is not a function of Python")
        if not self.first(id(function), function):
            return
        code = function.__code__
        reads = _reads(code)
        self.value(reads.parts, reads.names)
        self.value(function.__defaults__, reads.names)
        self.value(function.__kwdefaults__, reads.names)
        for name, value in _bindings(function, reads):
            self.put(name)
            self.value(value, reads.names)

    def value(self, value: Any, names: frozenset[str]) -> None:
        """Add a value that code with these names reads.

        Raises:
            Unreadable: if nothing is known of its kind.
        """
        kind = type(value)
        if kind in _PLAIN:
            self.put(kind.__name__, repr(value))
        elif isinstance(value, Dispatcher):
            self.compiled(value)
        elif isinstance(value, (np.ndarray, np.generic)):
            self.array(value)
        elif isinstance(value, (tuple, list, set, frozenset, Mapping)):
            self.collection(value, names)
        elif isinstance(value, _Intrinsic):
            self.put("intrinsic")
            self.function(value._defn)
        elif isinstance(value, ModuleType):
            self.module(value, names)
        elif isinstance(value, types.Type):
            self.numba_type(value)
        elif isinstance(value, enum.Enum):
            self.put(kind.__module__, kind.__qualname__, value.name)
            self.value(value.value, names)
        elif isinstance(value, np.dtype):
            self.put("dtype", repr(value), str(value.itemsize), str(value.alignment), str(value.isalignedstruct))
        elif (library := _library(value)) is not None:
            self.put("library", library, str(getattr(value, "__qualname__", "") or getattr(value, "__name__", "")))
            for overload in _overloads(value):
                self.function(overload)
        elif isinstance(value, FunctionType):
            self.put("function")
            self.function(value)
            for overload in _overloads(value):
                self.function(overload)
        elif isinstance(value, type):
            self.cls(value, names)
        else:
            raise Unreadable(f"{value!r} of {kind.__module__}.{kind.__qualname__}")

    def compiled(self, dispatcher: Dispatcher) -> None:
        """Add a compiled function: how it is compiled, and what it is in Python."""
        if not self.first(id(dispatcher), dispatcher):
            return
        self.put("compiled", repr(sorted(dispatcher.targetoptions.items(), key=lambda item: item[0])))
        if changed(dispatcher):
            raise Unreadable(f"{dispatcher.__qualname__} was compiled before what it reads changed")
        self.function(dispatcher.py_func)

    def array(self, value: Any) -> None:
        """Add an array or scalar of numpy: type, layout and content."""
        if value.dtype.hasobject:
            raise Unreadable("an array of Python objects")
        layout = (value.shape, value.strides, value.flags.writeable, value.flags.aligned)
        self.put(type(value).__name__, repr(value.dtype), repr(layout), value.tobytes())

    def collection(self, value: Any, names: frozenset[str]) -> None:
        """Add what a collection holds; that of a set in the order of the digests."""
        kind = type(value)
        self.put(kind.__module__, kind.__qualname__, str(len(value)), repr(getattr(value, "_fields", "")))
        if isinstance(value, (set, frozenset)):
            self.put(*sorted(_alone(part, names) for part in value))
            return
        for part in (part for pair in value.items() for part in pair) if isinstance(value, Mapping) else value:
            self.value(part, names)

    def module(self, module: ModuleType, names: frozenset[str]) -> None:
        """Add a module: a library by its version, any other by the attributes that the code may read of it."""
        self.put("module", module.__name__)
        if (library := _library(module)) is not None:
            self.put(library)
            for name in sorted(names & vars(module).keys()):
                for overload in _overloads(vars(module)[name]):
                    self.function(overload)
        elif self.first((id(module), names), module):
            for name in sorted(names & vars(module).keys()):
                self.put(name)
                self.value(vars(module)[name], names)

    def numba_type(self, kind: types.Type) -> None:
        """Add a type of numba by its name; one that a module of ours or of a user defines with that module's code."""
        home = type(kind).__module__
        self.put("type", home, str(kind))
        if home.partition(".")[0] in LIBRARIES:
            return
        for name, value in sorted(vars(kind).items()):
            if name != "_code":  # a number that is another in each process
                self.put(name)
                self.value(value, frozenset())
        if self.first(("lowering", home), kind):
            for function in _functions(sys.modules[home]):
                self.function(function)

    def cls(self, kind: type, names: frozenset[str]) -> None:
        """Add a class: an enumeration with its members, a named tuple with its fields, any other with its methods."""
        self.put("class", kind.__module__, kind.__qualname__)
        if issubclass(kind, enum.Enum):
            self.value({member.name: member.value for member in kind}, names)
        elif issubclass(kind, tuple) and hasattr(kind, "_fields"):
            self.put(repr(kind._fields))
        elif self.first(id(kind), kind):
            for name, part in sorted(vars(kind).items()):
                if isinstance(part, (FunctionType, *_PLAIN)) and name not in ("__doc__", "__firstlineno__"):
                    self.put(name)
                    self.value(part, names)


def frozen_values(function: Callable[..., Any]) -> list[Any]:
    """Return the values that a function itself reads, as they are now, which numba puts into the code it compiles."""
    if not isinstance(function, FunctionType):
        return []
    reads, found = _reads(function.__code__), []
    for _, value in _bindings(function, reads):
        if isinstance(value, ModuleType) and _library(value) is None:
            found += [_copied(part) for name, part in sorted(vars(value).items()) if name in reads.names]
        else:
            found.append(_copied(value))
    return found


def _copied(value: Any) -> Any:
    """An array may change in its place."""
    return (value.dtype, value.shape, value.tobytes()) if isinstance(value, np.ndarray) else value


def changed(dispatcher: Dispatcher) -> bool:
    """Whether a function reads other values than when it was compiled: its machine code has the old ones for good."""
    then = getattr(dispatcher, "frozen_values", None)
    if then is None or not dispatcher.overloads:
        return False
    now = frozen_values(dispatcher.py_func)
    return len(now) != len(then) or not all(map(_same, then, now))


def _same(a: Any, b: Any) -> bool:
    return a is b or bool(type(a) is type(b) in _SAME and a == b)


def _alone(value: Any, names: frozenset[str]) -> bytes:
    walk = _Walk()
    walk.value(value, names)
    return walk.digest.digest()


def _bindings(function: FunctionType, reads: _Reads) -> Iterator[tuple[str, Any]]:
    """Names of the closure and of the globals with their values, as they are now."""
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            yield name, cell.cell_contents
        except ValueError:
            raise Unreadable(f"{name} has no value yet") from None
    for name in reads.globals:
        if name in function.__globals__:
            yield name, function.__globals__[name]


def _is_pythons(package: str) -> bool:
    """Whether a module is one of Python's own, and no file of a user's with the name of one."""
    if package not in sys.stdlib_module_names:
        return False
    file = getattr(sys.modules.get(package), "__file__", None)
    home, _, rest = os.path.realpath(file or _PYTHON).partition(_PYTHON)
    return home == "" and not rest.startswith("site-packages")


@cache
def _version(package: str) -> str | None:
    """Name and version of a library; None for a module that is none."""
    if _is_pythons(package):
        return f"{package} of Python {sys.version}"
    return f"{package} {sys.modules[package].__version__}" if package in LIBRARIES else None


def _library(value: Any) -> str | None:
    """The library that a module, function or class belongs to, with its version; None if to no library."""
    if isinstance(value, np.ufunc):
        return _version("numpy")
    if not isinstance(value, _NAMED) or (isinstance(value, FunctionType) and value.__module__ is None):
        return None  # what `exec` makes may have no module
    home = value.__name__ if isinstance(value, ModuleType) else value.__module__ or "builtins"
    return _version(home.partition(".")[0])


def _overloads(function: Any) -> list[FunctionType]:
    """What numba compiles in place of a function that is not compiled itself (`numba.extending.overload`)."""
    # What the compiler itself would be asked for has to be set up first, which takes longer than all that is read here.
    known = len(builtin_registry.globals)
    return [overload for value, overload in _all_overloads(known) if value is function]


@lru_cache(maxsize=1)
def _all_overloads(known: int) -> list[tuple[Any, FunctionType]]:
    """Functions and what others than libraries overload them by; `known` is how many entries numba's registry has."""
    return [
        (value, overload)
        for value, kind in builtin_registry.globals[:known]
        for template in getattr(kind, "templates", ())
        if isinstance(overload := getattr(template, "_overload_func", None), FunctionType)
        and _version((overload.__module__ or "").partition(".")[0]) is None
    ]


def _functions(module: ModuleType) -> Iterator[FunctionType]:
    """The functions that a module defines, and those of its classes, by name."""
    for _, value in sorted(vars(module).items()):
        if getattr(value, "__module__", None) != module.__name__:
            continue
        if isinstance(value, FunctionType):
            yield value
        elif isinstance(value, type):
            yield from (part for _, part in sorted(vars(value).items()) if isinstance(part, FunctionType))
