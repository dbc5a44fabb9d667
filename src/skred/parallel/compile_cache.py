"""Compilation with numba, cached on disk under the code that is compiled.

Numba stamps a cached function with the content of its own file. A change in a function that it calls from
another file would go unnoticed then, and a changed sentence would compile the whole file anew. Here the stamp
is made of the function's own byte code, of the constants that it reads and of the stamps of the compiled
functions that it calls. Docstrings, comments and places in the file are not part of it.
"""

from __future__ import annotations

import builtins
import dis
import hashlib
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import Enum
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba import config, njit
from numba.core.caching import InTreeCacheLocator, UserProvidedCacheLocator, UserWideCacheLocator

from skred.parallel.folders import private_temporary_folder

_stamps: dict[Callable[..., Any], str] = {}
"""Of what has been compiled here, by its Python function."""
_NUMBAS_OWN = (UserProvidedCacheLocator, InTreeCacheLocator, UserWideCacheLocator)
"""In numba's own order: the folder NUMBA_CACHE_DIR, the one beside the source, the one of the user."""


def compiled(*signature: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """`numba.njit` for what Python calls: cached, IEEE division, without the GIL.

    What it calls must stand above it, and be compiled here as well. Matrix products, and arrays assigned to
    slices of others, take seconds to compile, the latter for the words of an error: loops do not.
    """
    # A wrapper for C is a tenth of the time of compilation, and nobody calls it.
    options = {"error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True, **options}

    def decorate(function: Callable[..., Any]) -> Any:
        _stamps[function] = _stamp(function, options)
        with _under_stamps():
            return njit(*signature, cache=True, **options)(function)

    return decorate


def inner(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """As `compiled`, for what only compiled code calls: a call from Python ends the process.

    The wrapper that such a call needs takes as long to compile as a small function itself. To try one out
    from Python, set NUMBA_DISABLE_JIT=1.
    """
    return compiled(no_cpython_wrapper=True, **options)


def cache_key(*functions: Any) -> int:
    """Under which PyTensor caches what calls compiled functions."""
    stamps = "".join(_stamps[_python_function(one)] for one in functions)
    return int(hashlib.sha256(stamps.encode()).hexdigest()[:12], 16)


class CodeLocator(InTreeCacheLocator):
    """Where numba keeps a function that is compiled here, and under which stamp."""

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        super().__init__(function, file)
        self._folder, self._stamp = _folder(function, file), _stamps[function]

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> CodeLocator | None:
        """None for what is not compiled here."""
        return cls(function, file) if function in _stamps else None

    def get_cache_path(self) -> str:
        """Folder of the function's files."""
        return self._folder

    def get_source_stamp(self) -> str:
        """What must be the same for cached code to be used."""
        return self._stamp

    def get_disambiguator(self) -> str:
        """Part of the files' names; names of functions do not repeat in a module here."""
        return "code"


@contextmanager
def _under_stamps() -> Iterator[None]:
    """Let numba ask `CodeLocator` where to keep functions: of these alone, other packages have their own."""
    config.reload_config()  # else numba may do so in between, and forget what is set here
    before = config.CACHE_LOCATOR_CLASSES
    own = f"{CodeLocator.__module__}.{CodeLocator.__qualname__}"
    config.CACHE_LOCATOR_CLASSES = ",".join([own, *(one.__name__ for one in _NUMBAS_OWN)])
    try:
        yield
    finally:
        config.CACHE_LOCATOR_CLASSES = before


def _folder(function: Callable[..., Any], file: str) -> str:
    """Where numba would keep a function; a temporary folder where it finds none that can be written."""
    for locator in _NUMBAS_OWN:
        found = locator.from_function(function, file)
        if found is not None:
            return str(found.get_cache_path())
    folder = private_temporary_folder() / "numba" / UserWideCacheLocator.get_suitable_cache_subpath(file)
    os.makedirs(folder, exist_ok=True)
    return str(folder)


def _stamp(function: Callable[..., Any], options: dict[str, Any]) -> str:
    """SHA-256 of all that a function's machine code is made of."""
    assert isinstance(function, FunctionType)
    digest = hashlib.sha256()
    for part in (function.__qualname__, function.__defaults__, _by_name(options), *_content(function)):
        digest.update(repr(part).encode() + b"\n")
    return digest.hexdigest()


def _content(function: FunctionType) -> Iterator[Any]:
    """Arguments and instructions of a function, names replaced by what they stand for."""
    closure = function.__closure__ or ()
    known = {**function.__globals__, **dict(zip(function.__code__.co_freevars, closure, strict=True))}
    codes = [function.__code__]
    while codes:
        code = codes.pop()
        yield code.co_varnames[: code.co_argcount]
        for instruction in dis.get_instructions(code):
            value = instruction.argval
            if isinstance(value, CodeType):
                codes.append(value)
            elif instruction.opname in ("LOAD_GLOBAL", "LOAD_DEREF"):
                yield instruction.opname, value, _meaning(function, value, known)
            else:
                yield instruction.opname, _by_name(value)


def _meaning(function: FunctionType, name: str, known: dict[str, Any]) -> Any:
    """What a name in compiled code stands for, as something that is printed the same wherever it is the same.

    Raises
    ------
    TypeError
        For what cannot be stamped: a function that is not compiled here, or that stands below its caller; a
        module of this package, whose functions are to be imported themselves.
    """
    value = known[name] if name in known else getattr(builtins, name, None)
    value = getattr(value, "cell_contents", value)
    stamp = _stamps.get(_python_function(value)) if callable(value) else None
    if stamp is not None:
        return stamp
    if isinstance(value, ModuleType) and value.__name__.partition(".")[0] != "skred":
        return value.__name__
    if isinstance(value, type):
        return value.__module__, value.__qualname__, getattr(value, "_fields", ())
    if isinstance(value, BuiltinFunctionType):
        return value.__module__, value.__qualname__
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, int | float | str | tuple | np.generic | Enum):
        return repr(value)
    raise TypeError(f"{function.__qualname__} cannot be stamped: {name!r} in it is {value!r}")


def _python_function(function: Any) -> Any:
    """Of what numba compiles; the same where NUMBA_DISABLE_JIT is set."""
    return getattr(function, "py_func", function)


def _by_name(value: Any) -> Any:
    """Sets and dictionaries in an order that does not change from one process to the next."""
    if isinstance(value, dict):
        return sorted((key, _by_name(one)) for key, one in value.items())
    return sorted(value) if isinstance(value, set | frozenset) else value
