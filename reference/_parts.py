"""Functions that are parts of compiled ones: typed and lowered once, optimised only where the whole is put together.

numba optimises every function on its own, with all that it calls, and once more in each function
that calls it: for a program of three hundred short functions that is most of the time. A part is
kept as it was lowered. The function that is called from outside takes all its parts at once,
makes them private, and is optimised once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from weakref import WeakValueDictionary

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary, RuntimeLinker
from numba.core.compiler import Compiler

NEEDLESS = frozenset({
    "with_lifting", "inline_closure_likes", "make_function_op_code_to_jit_function", "inline_inlinables",
    "find_literally", "literal_unroll", "LiteralPropagation", "inline_overloads",
    "nopython_rewrites", "ir_legalization",
})  # fmt: skip
"""Passes of numba for what no code has that makes no arrays: closures, comprehensions, `with`, `literal_unroll`,
expressions of whole arrays, and references that are given back where a variable is no longer needed."""


class _Library(JITCodeLibrary):  # type: ignore[misc]
    """Code of one function, and what it calls by name."""

    environment: tuple[str, Any] | None = None  # of a part: where its constants are, and under which name
    _linking_libraries: list[Any]
    _shared_module: Any

    def finalize(self) -> None:
        """Put the whole together, optimise it and make it callable."""
        parts = list(_parts_of(self, {self}))
        for part in parts:
            self._final_module.link_in(part._final_module, preserve=True)
            self._reload_init.update(part._reload_init)
        self._close_circles()
        for part in parts:
            part.make_private(self._final_module)
        own = [self, *parts]
        others: list[Any] = [library for one in own for library in one._linking_libraries]
        self._linking_libraries = [library for library in others if not isinstance(library, _Part)]
        super().finalize()
        for part in parts:
            if part.environment is not None:
                self._codegen.set_env(*part.environment)

    def _optimize_final_module(self) -> None:
        """Optimise the whole once: numba does it twice where references are counted, to find pairs that cancel."""
        if any(one.name.startswith("NRT_") for one in self._final_module.functions):
            super()._optimize_final_module()
            return
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)

    def _close_circles(self) -> None:
        """Let functions that call themselves, or each other in turn, find what they call inside the whole.

        numba calls it through a variable that is filled once the name can be seen from outside,
        which of a part it never can, and in code that is read back it is not filled at all.
        """
        whole = self._final_module
        for called in {function.name for function in _defined(whole)}.intersection(_circles(whole)):
            name = RuntimeLinker.PREFIX + called
            text = f'declare void @"{called}"()\n@"{name}" = constant ptr @"{called}"\n'
            whole.link_in(llvm.parse_assembly(text))
            whole.get_global_variable(name).linkage = "internal"


class _Part(_Library):
    """Code of a part, which is never made callable on its own."""

    def finalize(self) -> None:
        """Leave everything to the whole."""
        self._raise_if_finalized()
        _LOWERED.update({function.name: self for function in _defined(self._final_module)})
        self._finalized = True

    def make_private(self, whole: Any) -> None:
        """Let nothing outside the whole call this, so that it goes where it is written out."""
        for function in _defined(self._final_module):
            if function.linkage.name == "external":
                whole.get_function(function.name).linkage = "internal"


_LOWERED: WeakValueDictionary[str, _Part] = WeakValueDictionary()  # by what they define


def _defined(module: Any) -> list[Any]:
    """Return the functions whose code a module has."""
    return [function for function in module.functions if not function.is_declaration]


def _circles(module: Any) -> list[str]:
    """Return the functions that a module calls while they, or one that calls them, were not lowered yet."""
    mark = RuntimeLinker.PREFIX
    return [one.name.removeprefix(mark) for one in module.global_variables if one.name.startswith(mark)]


def _parts_of(library: _Library, met: set[Any]) -> Iterator[_Part]:
    """Yield all that a function calls, directly or not, once."""
    for part in (*library._linking_libraries, *map(_LOWERED.get, _circles(library._final_module))):
        if isinstance(part, _Part) and part not in met:
            met.add(part)
            yield part
            yield from _parts_of(part, met)


class WholePasses(Compiler):  # type: ignore[misc]
    """numba's passes for a function that is called from outside."""

    library = _Library

    def define_pipelines(self) -> Any:
        """Leave out what nothing is done by where no references are counted: a sixth of all that Python does."""
        found = super().define_pipelines()
        for one in found if not self.state.flags.nrt else ():
            one.passes = [(kind, told) for kind, told in one.passes if kind.name() not in NEEDLESS]
            one.finalize()
        return found

    def _compile_core(self) -> Any:
        state = self.state
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super()._compile_core()


class PartPasses(WholePasses):
    """The same for a part."""

    library = _Part

    def _compile_core(self) -> Any:
        flags = self.state.flags
        flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        return super()._compile_core()


class _ReadBack(_Library):
    """Code of a function that was read back; its text for other code to take in is parsed where that is asked for."""

    bitcode = b""

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            self._shared_module = llvm.parse_bitcode(self.bitcode)
        return self._shared_module


def read_back(codegen: Any, kept: tuple[str, str, tuple[bytes, bytes]], description: Any) -> Any:
    """Make code callable that was kept, as numba does but for the text that it parses at once.

    Args:
        codegen: of the target.
        kept: what numba serialises a library to.
        description: of the function.
    """
    name, _, (code, bitcode) = kept
    library = _ReadBack(codegen, name)
    library.bitcode = bitcode
    library.enable_object_caching()
    library._set_compiled_object(code)
    library._finalize_final_module()
    codegen._engine._defined_symbols |= {
        description.llvm_func_name, description.llvm_cpython_wrapper_name,
        description.llvm_cfunc_wrapper_name,
    }  # fmt: skip
    return library
