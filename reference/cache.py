"""Compiled functions whose machine code is kept between processes.

Each overload is kept under a digest of all that it reads (`_fingerprint`), of its signature, of
numba's version and settings and of the processor, so that code which is found is code that would
be compiled again. What has no digest is compiled in every process.
"""

from __future__ import annotations

import os
import pickle
import platform
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache, cached_property
from typing import Any

import llvmlite
import llvmlite.binding as llvm
import numba
import numba.core.config as numba_config
import numpy as np
from numba import _dynfunc
from numba.core import sigutils, types, typing
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.environment import Environment, lookup_environment
from numba.core.funcdesc import _dynamic_module
from numba.core.registry import CPUDispatcher
from numba.core.runtime import _nrt_python as _nrt
from numba.core.runtime import rtsys
from numba.core.serialize import dumps
from numba.np import numpy_support

from crossbody.reference import ahead, code_store
from crossbody.reference._fingerprint import Unreadable, changed, fingerprint, frozen_values, name_of, names_within
from crossbody.reference._hastened import hastened
from crossbody.reference._parts import PartPasses, WholePasses, read_back
from crossbody.reference.compiling import count

_SETTINGS = (
    "BOUNDSCHECK", "OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "DISABLE_INTEL_SVML", "ENABLE_AVX",
    "DEBUGINFO_DEFAULT", "CPU_NAME", "CPU_FEATURES", "FULL_TRACEBACKS", "LLVM_PASS_TIMINGS",
)  # fmt: skip

OURS = "crossbody.reference."
ALLOCATES_NOTHING = tuple(
    OURS + name for name in ("core.", "delta.", "pairs.", "sundials.compiled.", "systems.", "tree.")
)
"""The packages whose compiled functions make no arrays: numba refuses one that would."""
ALLOCATES = tuple(OURS + name for name in ("systems.red_body", "tree.kinks", "tree.quantities", "tree.switches"))
"""The modules in them that do. Only these hand arrays out: whoever counts references would take one too many."""

FORMAT = "3"  # what `save_overload` writes; another number for every change of it


def debugging() -> bool:
    """Whether kernels are compiled with checks of every index, as `CROSSBODY_DEBUG=1` asks for."""
    return os.environ.get("CROSSBODY_DEBUG", "") not in ("", "0")


class Lean(CPUDispatcher):  # type: ignore[misc]
    """A compiled function that goes when nothing refers to it, and keeps no more than its machine code.

    numba keeps every variable's type and value for `inspect_types`, in a list that outlives the
    function as long as anything in it lives. A function that names kernels, and hangs on one of
    them, would hold itself.
    """

    frozen_values: list[Any] | None = None

    def add_overload(self, cres: CompileResult) -> None:
        """Take what was compiled."""
        self.keep_count(cres)
        count.done(name_of(self.py_func))
        super().add_overload(cres._replace(type_annotation=""))

    def keep_count(self, cres: CompileResult) -> None:
        """Refuse what hands out an array that it does not count: who counts would take a reference that nobody gave.

        Raises:
            TypeError: where memory would be freed while it is in use.
        """
        model = cres.target_context.data_model_manager[cres.signature.return_type]
        if "_nrt" in self.targetoptions and model.contains_nrt_meminfo():
            name = f"{self.py_func.__module__}.{self.py_func.__name__}"
            raise TypeError(f"{name} returns {cres.signature.return_type}; its module counts no references to arrays.")


class Compiled(Lean):
    """A function that is compiled when a signature is first asked for, or read back from the store.

    Args:
        function: in Python.
        locals: types of its variables, for numba.
        targetoptions: of numba.
        declared: the only signatures that it may be compiled for; those of a call if none are given.
    """

    def __init__(
        self, function: Callable[..., Any], locals: Any = None, targetoptions: Any = None,
        *, declared: Sequence[Any] = (),
    ) -> None:  # fmt: skip
        super().__init__(function, locals, {"nopython": True, **(targetoptions or {})}, pipeline_class=WholePasses)
        self._cache = _Overloads(self)
        self.kept_as = ""  # the key of what was compiled last
        self.declared = {tuple(signature.args): signature for signature in declared}

    def compile(self, sig: Any) -> Any:
        """Compile for a signature, or read the code back."""
        args, _ = sigutils.normalize_signature(sig)
        existing = self.overloads.get(tuple(args))
        if existing is not None:
            return existing.entry_point
        if self.declared and tuple(args) not in self.declared:
            raise TypeError(f"{self.py_func.__qualname__} is not declared for ({', '.join(map(str, args))})")
        with global_compiler_lock, self._marked() as name:  # the order of the locks is the same in all threads
            store = code_store.current() if name else None
            sig = self.declared.get(tuple(args), sig)
            if store is None:
                with self._counted(), hastened():
                    return super().compile(sig)
            key = self.kept_as = self._cache.key(name, sig)
            if store.has(key):
                return super().compile(sig)
            if _home(self.py_func).startswith(OURS):
                ahead.begin()
            with self._counted(), store.alone(key), hastened():
                return super().compile(sig)

    @contextmanager
    def _counted(self) -> Iterator[None]:
        count.need(names_within(self.py_func))
        with count.clocked():
            yield

    def lacks(self, sig: Any) -> bool:
        """Whether code for a signature would be kept, and is not yet."""
        with global_compiler_lock, self._marked() as name:
            store = code_store.current() if name else None
            return store is not None and not store.has(self._cache.key(name, sig))

    @contextmanager
    def _marked(self) -> Iterator[str]:
        """Put the digest of what is read into the function's name while it is compiled; empty if there is none.

        The names of machine code come from it: two versions of one function, compiled in two processes
        and read back by a third, would have the same one, and the linker would take either for both.
        """
        plain = self.py_func.__qualname__
        try:
            found = "" if changed(self) or not _has_home(self.py_func) else fingerprint(self.py_func)
            if not self.overloads:
                self.frozen_values = frozen_values(self.py_func)
        except Unreadable:
            found = ""
        self.py_func.__qualname__ = f"{plain}_{found[:16]}" if found else plain
        self._cache.content = found
        try:
            yield found
        finally:
            self.py_func.__qualname__ = plain

    def typeof_pyval(self, val: Any) -> Any:
        """Return the type of an argument: of an array without looking for a mask, which numpy would import first."""
        if type(val) is not np.ndarray or val.dtype.kind not in "iufcbV":
            return super().typeof_pyval(val)
        layout, readonly = numpy_support.map_layout(val), not val.flags.writeable
        kind = types.Array(numpy_support.from_dtype(val.dtype), val.ndim, layout, readonly=readonly)
        self._types_active_call.add(kind)
        return kind

    def get_compile_result(self, sig: Any) -> CompileResult:
        """Return what was compiled for a signature, compiling it if need be."""
        self.compile(tuple(sig.args))
        return self.overloads[tuple(sig.args)]

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Tell the type inference of a caller which signatures there are."""
        if not self.declared:
            return super().get_call_template(args, kws)
        pysig, args = self._compiler.fold_argument_types(args, kws)
        if tuple(args) in self.declared:
            self.compile(tuple(args))
        name = self.py_func.__name__
        signatures = self.nopython_signatures
        template = typing.make_concrete_template(f"CallTemplate({name})", key=name, signatures=signatures)
        return template, pysig, args, {}

    def _compile_for_args(self, *args: Any, **kws: Any) -> Any:
        """Answer a call for which nothing is compiled: a declared signature, or one with numbers of another type."""
        if not self.declared:
            return super()._compile_for_args(*args, **kws)
        kinds = [self.typeof_pyval(arg) for arg in args]
        if tuple(kinds) in self.declared:
            return self.compile(tuple(kinds))
        for wanted in self.overloads:
            if len(wanted) == len(kinds) and all(map(_converts, kinds, wanted)):
                return self.overloads[wanted].entry_point
        self._types_active_call.clear()
        return self._explain_matching_error(*args, **kws)


def _home(function: Any) -> str:
    """Return the module of a function; what `exec` makes may have none."""
    return function.__module__ or ""


def _has_home(function: Any) -> bool:
    """Whether another process finds the module that code names; what `exec` makes may have none."""
    return function.__globals__.get("__name__") == function.__module__ and function.__module__ in sys.modules


def _converts(given: Any, wanted: Any) -> bool:
    """Whether a value is unboxed as it is wanted: the same type, or a real number for a floating-point one."""
    return bool(given == wanted or (wanted == types.float64 and isinstance(given, (types.Integer, types.Float))))


class _Overloads:
    """The store, as numba's dispatcher asks for it."""

    def __init__(self, dispatcher: Compiled) -> None:
        self._dispatcher = dispatcher
        self.content = ""
        self.cache_path = ""

    def key(self, content: str, sig: Any) -> str:
        """Return the name of the file of code for a signature."""
        function, options = self._dispatcher.py_func, sorted(self._dispatcher.targetoptions.items())
        args, _ = sigutils.normalize_signature(sig)
        homes = " ".join(type(kind).__module__ for kind in args)  # by which what is kept finds its types again
        what = (str(function.__module__), function.__qualname__, content, str(sig), homes, repr(options), *machine())
        return code_store.named(re.sub(r"[^A-Za-z0-9_.-]", "", function.__name__)[:40], *what)

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        """Return what was kept for a signature; None if nothing was, or if it cannot be used."""
        store = code_store.current() if self.content else None
        if store is None:
            return None
        return restored(store, self.key(self.content, sig), target_context)

    def save_overload(self, sig: Any, result: CompileResult) -> None:
        """Keep what was compiled, unless it holds addresses of this process."""
        store = code_store.current() if self.content else None
        if store is None or result.library.has_dynamic_globals or any(not part.can_cache for part in result.lifted):
            return
        library, description, environment, *rest, others = result._reduce()
        kept = library, description, _told(environment), *rest, [_told(one) for one in others]
        store.write(self.key(self.content, sig), dumps((_asks_for_more(result.library), *kept)))

    def flush(self) -> None:
        """Forget nothing: what is stale has another key."""


def restored(store: code_store.Store, key: str, context: Any) -> CompileResult | None:
    """Return what was kept under a key, callable; None if nothing was, or if it cannot be used."""
    data = store.read(key)
    if data is None:
        return None
    try:
        whole, *kept = pickle.loads(data)
        _make_ready(context, whole)  # all that code needs of what a compiler sets up
        return _rebuilt(context, *kept)
    except Exception as error:
        # Whatever a file that is whole lacks here, say a module by which it was imported, compiling brings it.
        store.drop(key, f"cannot be used here ({type(error).__name__}: {error})")
        return None


_MEMORY = {name if name.startswith("_") else f"NRT_{name}": place for name, place in _nrt.c_helpers.items()}
"""Functions in C that code with arrays calls, with their addresses."""


def _asks_for_more(library: Any) -> bool:
    """Whether code calls functions for memory that numba compiles: they are in what it calls, as a rule."""
    called = (one.name for one in library._final_module.functions if one.is_declaration)
    return any(name.lower().startswith(("nrt_", "_nrt_")) and name not in _MEMORY for name in called)


def _make_ready(context: Any, whole: bool) -> None:
    """Let code find what it calls for memory: numba's compiled functions, if need be, take longer than all else."""
    if whole:
        rtsys.initialize(context)
    else:
        _name_memory()


@cache
def _name_memory() -> None:
    for name, place in _MEMORY.items():
        llvm.add_symbol(name, place)


def _told(environment: Environment) -> tuple[str, list[Any], str]:
    """What is kept of the constants of a function: the module that it stands in, themselves, and their name."""
    return environment.globals["__name__"], list(environment.consts), environment.env_name


def _environment(module: str, constants: list[Any], name: str) -> Environment:
    """Give a function its constants back.

    numba imports its module for that, which compiled code does not ask for: of numba's own linear
    algebra it takes longer than all else.
    """
    found = lookup_environment(name)
    if found is None:
        found = Environment({"__name__": module})
        found.consts[:], found.env_name = constants, name
        Environment._memo[name] = found
    return found


def _rebuilt(
    context: Any, kept: Any, description: Any, told: Any, signature: Any, objectmode: bool, lifted: Any,
    annotation: str, reload_init: Any, others: Any,
) -> CompileResult:  # fmt: skip
    """Make callable what `save_overload` took apart."""
    for begin in reload_init:
        begin()
    library, environment = read_back(context.codegen(), kept, description), _environment(*told)
    entry = _callable(context, library, description, environment)
    environments = tuple(_environment(*one) for one in others)
    for one in environments:
        library.codegen.set_env(one.env_name, one)
    return CompileResult(
        context.typing_context, context, entry, None, annotation, signature, objectmode, lifted,
        description, library, None, environment, None, reload_init, environments,
    )  # fmt: skip


def _callable(context: Any, library: Any, description: Any, environment: Environment) -> Any:
    """Let Python call a function, as numba does but for its module, which that would import for its name."""
    place, name = library.get_pointer_to_function(description.llvm_cpython_wrapper_name), description.qualname
    module = sys.modules.get(description.modname, _dynamic_module)
    doc = f"compiled wrapper for {name!r}"
    made = _dynfunc.make_function(module, name.split(".")[-1], doc, place, environment, (library,))
    library.codegen.set_env(context.get_env_name(description), environment)
    return made


@cache
def machine() -> tuple[str, ...]:
    """Return what compiled code depends on beside its source: versions, processor, settings of numba."""
    target = numba.core.registry.cpu_target.target_context.codegen().magic_tuple()
    settings = [f"{name}={getattr(numba_config, name, None)}" for name in _SETTINGS]
    return (FORMAT, numba.__version__, llvmlite.__version__, platform.python_version(), str(target), *settings)


class Part(Lean):
    """A function that is part of the compiled ones that call it; a call from Python makes one of it alone."""

    def __init__(self, function: Callable[..., Any], targetoptions: Any) -> None:
        super().__init__(function, None, {"nopython": True, **targetoptions}, pipeline_class=PartPasses)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Tell the type inference of a caller about one version for all numbers, not one for each constant."""
        if _home(self.py_func).startswith(OURS):
            _, folded = self._compiler.fold_argument_types(args, kws)
            args, kws = tuple(map(types.unliteral, folded)), {}
        return super().get_call_template(args, kws)

    def compile(self, sig: Any) -> Any:
        """Lower for a signature, with the values that are read now."""
        if not self.overloads:
            self.frozen_values = frozen_values(self.py_func)
        return super().compile(sig)

    def add_overload(self, cres: CompileResult) -> None:
        """Take what was lowered: nothing that Python could call."""
        self.keep_count(cres)
        count.done(name_of(self.py_func))
        entry = object()  # callers know the code by it
        cres.library.environment = (cres.fndesc.env_name, cres.environment)
        cres.library.finalize()
        self.targetctx.insert_user_function(entry, cres.fndesc, [cres.library])
        self.overloads[tuple(cres.signature.args)] = cres._replace(entry_point=entry, type_annotation="")

    @cached_property
    def alone(self) -> Compiled:
        """The same function for callers in Python."""
        return Compiled(self.py_func, targetoptions=self.targetoptions)

    def __call__(self, *args: Any, **kws: Any) -> Any:
        """Call it from Python."""
        return self.alone(*args, **kws)


def compiled(
    function: Callable[..., Any],
    signatures: Any = (),
    *,
    lazy: Any = (),
    nogil: bool = False,
) -> Any:
    """Compile a function and keep the code on disk.

    Args:
        function: in Python.
        signatures: compiled for at once; without them the function is a part of those that call it.
        lazy: signatures that it is compiled for when they are first asked for.
        nogil: threads may run it side by side.
    """
    if numba_config.DISABLE_JIT:
        return function
    options = {"error_model": "numpy", "nogil": nogil} | ({"boundscheck": True} if debugging() else {})
    if (home := _home(function)).startswith(ALLOCATES_NOTHING) and home not in ALLOCATES:
        options["_nrt"] = False  # no references are counted: a sixth of the code to compile, up to 40 % of a run
    if not signatures and not lazy:
        return Part(function, options)
    found = Compiled(function, targetoptions=options, declared=(*signatures, *lazy))
    for signature in signatures:
        found.compile(signature)
    if signatures and not lazy:
        found.disable_compile()  # numba converts arguments, such as functions, only where nothing is left to compile
    return found
