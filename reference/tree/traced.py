"""Straight-line code of the two sweeps, traced for one model and compiled once for it.

The sweeps of `sweeps` are run in Python on symbols in place of positions and velocities. What depends on the model
alone, every index and every branch, is gone from the record; what is zero, or one, drops out. LLVM compiles it: .1 to
.6 s for 6 to 18 degrees of freedom, kept on disk. The operations that are left stand in the order of the general code,
so that both give the same numbers to the last bit (`tests/reference/test_traced.py`).

A kernel calls it by its address in the parameters, so that nothing else is compiled for a model.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from types import FunctionType
from typing import Any

import llvmlite.binding as llvm
import numba.core.config as numba_config
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from crossbody.reference import code_store
from crossbody.reference._fingerprint import Unreadable, fingerprint
from crossbody.reference.cache import machine
from crossbody.reference.kinds import Floats
from crossbody.reference.tree import layout, sweeps

ARGUMENTS = ("q", "v", "M", "f", "w")
KEPT = (*range(layout.F_AT), *range(layout.ORIGIN_AT, layout.NODE_SCRATCH))
"""Of a node's scratch what others read: pose, velocity, acceleration and origin."""


@intrinsic
def call(typingctx: Any, address: Any, q: Any, v: Any, M: Any, f: Any, w: Any) -> Any:
    """Call the code at an address with the addresses of its arrays: fill M and w, take the bias from f."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        word = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [word] * len(ARGUMENTS))
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])
        return context.get_dummy_value()

    return types.void(types.int64, *[types.uintp] * len(ARGUMENTS)), generate


class Recorder:
    """What was computed so far, as instructions of LLVM; a product that stands already is not written again."""

    def __init__(self, builder: ir.IRBuilder) -> None:
        self.builder = builder
        self.known: dict[tuple[Any, ...], Symbol] = {}

    def loaded(self, array: Any, size: int) -> Floats:
        """Return the entries of an array (size,) as symbols."""
        return np.array([Symbol(self, self.builder.load(self.place(array, i))) for i in range(size)], dtype=object)

    def place(self, array: Any, i: int) -> Any:
        """Return where entry i of an array stands."""
        return self.builder.gep(array, [ir.Constant(ir.IntType(64), i)], source_etype=ir.DoubleType())

    def written(self, array: Any, values: Floats) -> None:
        """Write numbers and symbols to an array; None leaves an entry as it is."""
        for i, value in enumerate(values):
            if value is not None:
                self.builder.store(operand(value), self.place(array, i))

    def operation(self, name: str, *args: Any) -> Symbol:
        """Return the result of one instruction, or of one function of libm."""
        key = (name, *args)
        if key not in self.known:
            if name in ("sin", "cos"):
                function = self.builder.module.declare_intrinsic(f"llvm.{name}", [ir.DoubleType()])
                value = self.builder.call(function, [operand(args[0])])
            else:
                value = getattr(self.builder, name)(*map(operand, args))
            self.known[key] = Symbol(self, value)
        return self.known[key]


class Symbol:
    """A number that is known when the code runs."""

    __slots__ = ("recorder", "value")

    def __init__(self, recorder: Recorder, value: Any) -> None:
        self.recorder, self.value = recorder, value

    def __add__(self, other: Any) -> Any:
        return self if is_number(other, 0.0) else self.recorder.operation("fadd", self, other)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self if is_number(other, 0.0) else self.recorder.operation("fsub", self, other)

    def __rsub__(self, other: Any) -> Any:
        return -self if is_number(other, 0.0) else self.recorder.operation("fsub", other, self)

    def __mul__(self, other: Any) -> Any:
        if is_number(other, 0.0):
            return 0.0
        if is_number(other, -1.0):
            return -self
        return self if is_number(other, 1.0) else self.recorder.operation("fmul", self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Symbol:
        return self.recorder.operation("fdiv", self, other)

    def __rtruediv__(self, other: Any) -> Symbol:
        return self.recorder.operation("fdiv", other, self)

    def __neg__(self) -> Symbol:
        return self.recorder.operation("fneg", self)

    def cos(self) -> Symbol:
        """Return the cosine, as NumPy asks an object for it."""
        return self.recorder.operation("cos", self)

    def sin(self) -> Symbol:
        """Return the sine."""
        return self.recorder.operation("sin", self)


def is_number(value: Any, number: float) -> bool:
    """Return whether a value is known now, and is that number."""
    return not isinstance(value, Symbol) and bool(value == number)


def operand(value: Any) -> Any:
    """Return a number or a symbol as LLVM takes it."""
    return value.value if isinstance(value, Symbol) else ir.Constant(ir.DoubleType(), float(value))


def in_python(function: Any) -> Callable[..., Any]:
    """Return a kernel's function in Python, all of whose helpers are in Python too."""
    plain = function.py_func
    names = dict(plain.__globals__)
    names |= {name: in_python(names[name]) for name in plain.__code__.co_names if hasattr(names.get(name), "py_func")}
    return FunctionType(plain.__code__, names, plain.__name__, plain.__defaults__, plain.__closure__)


def source(p: Floats, nq: int, nv: int) -> str:
    """Return the sweeps of one model as a module of LLVM.

    Args:
        p: its table, with everything that the sweeps read.
        nq: number of positions.
        nv: number of velocities.
    """
    module = ir.Module("sweeps")
    kind = ir.FunctionType(ir.VoidType(), [ir.DoubleType().as_pointer()] * len(ARGUMENTS))
    function = ir.Function(module, kind, "sweeps")
    for argument in function.args:
        argument.add_attribute("noalias")
    at = dict(zip(ARGUMENTS, function.args, strict=True))
    builder = ir.IRBuilder(function.append_basic_block())
    recorder = Recorder(builder)
    nodes = int(p[layout.NODES])
    M, f = np.zeros((nv, nv), dtype=object), recorder.loaded(at["f"], nv)
    w = np.full(layout.NODE_SCRATCH * nodes + layout.DOF_SCRATCH * nv, None, dtype=object)
    table = p.astype(object)
    in_python(sweeps.outwards)(recorder.loaded(at["q"], nq), recorder.loaded(at["v"], nv), table, w)
    in_python(sweeps.inwards)(table, w, M, f)
    recorder.written(at["M"], M.ravel())
    recorder.written(at["f"], f)
    if read_later(p):
        recorder.written(at["w"], kept(w, nodes))
    builder.ret_void()
    return str(module)


def read_later(p: Floats) -> bool:
    """Return whether rows, pushes or tendons read the poses that the sweeps leave."""
    return bool(p[layout.POSED] > 0.0 or p[layout.PUSHES] > 0.0 or p[layout.SPANNED] > 0.0)


def kept(w: Floats, nodes: int) -> Floats:
    """Return the scratch of the sweeps with None where nobody reads it."""
    found = np.full(len(w), None, dtype=object)
    first = layout.NODE_SCRATCH * nodes
    places = [layout.NODE_SCRATCH * i + k for i in range(nodes) for k in KEPT]
    found[places], found[first:] = w[places], w[first:]
    return found


def _target() -> Any:
    """Return a description of this processor; an engine that it is given to takes it with it when it goes."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=features, opt=3, codemodel="jitdefault"
    )


def compiled(text: str) -> bytes:
    """Return the machine code of a module."""
    module = llvm.parse_assembly(text)
    module.verify()
    target, options = _target(), llvm.create_pipeline_tuning_options(speed_level=2)
    builder = llvm.create_pass_builder(target, options)
    builder.getModulePassManager().run(module, builder)
    found: bytes = target.emit_object(module)
    return found


def _dependencies() -> tuple[str, ...]:
    """Return what the code depends on beside the model: the functions that make it, as they are now, and the machine.

    Raises:
        Unreadable: where the sweeps were compiled before what they read changed.
    """
    return (fingerprint(source), fingerprint(compiled), *machine())


def _read(p: Floats) -> Iterator[bytes]:
    """Yield the parts of a table that the sweeps read."""
    yield bytes([read_later(p)])
    yield p[layout.GRAVITY : layout.GRAVITY + 3].tobytes()
    for first, count, size in (
        (layout.AT_NODE, layout.NODES, layout.NODE), (layout.AT_DOF, layout.DOFS, layout.DOF),
    ):  # fmt: skip
        yield p[int(p[first]) :][: int(p[count]) * size].tobytes()


_LOADED: dict[str, Any] = {}
"""Engines of LLVM by their keys. They live as long as the process: parameters that name an address may be copied."""


def compiled_sweeps(p: Floats, nq: int, nv: int, *, anew: bool) -> float:
    """Return the address of a model's code: in this process, from the store of compiled code, or compiled now.

    Args:
        p: as of `source`.
        nq: number of positions.
        nv: number of velocities.
        anew: compile it if it is not there; else 0 is returned.
    """
    if numba_config.DISABLE_JIT:
        return 0.0
    store = code_store.current()
    try:
        key = f"sweeps-{hashlib.sha256(repr(_dependencies()).encode() + b''.join(_read(p))).hexdigest()[:32]}"
    except Unreadable:  # nobody knows what to keep it as
        key, store = f"sweeps-{len(_LOADED)} of this process", None
    if key not in _LOADED:
        data = store.read(key) if store is not None else None
        if data is None:
            if not anew:
                return 0.0
            data = compiled(source(p, nq, nv))
            if store is not None:
                store.write(key, data)
        _LOADED[key] = _loaded(data)
    return float(_LOADED[key].get_function_address("sweeps"))


def _loaded(machine_code: bytes) -> Any:
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())
    engine.add_object_file(llvm.ObjectFileRef.from_data(machine_code))
    engine.finalize_object()
    return engine
