"""Programs that are compiled once: kept as executables in the user's cache folder, and loaded without being traced.

Tracing takes longer than all else of a warm start. A program is found again by everything that it depends on: its
function, the structure of its arguments, the sources of this package, the versions of what it is written with, settings
and processor. What does not tell by itself what it is, such as a friction law that is a Python function, is traced and
compiled in each process, or found in JAX's own cache. On other devices than one processor `equinox.filter_jit` does all
that, and so it does within another program.

An executable is machine code and its description a pickle: who can write into the folder can run code as the user. So
it must be the user's own folder, and nobody else may write there; else nothing is kept or loaded.
"""

import ctypes
import functools
import hashlib
import io
import os
import pickle
import platform
import re
import secrets
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import fields
from enum import Enum
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.experimental import serialize_executable
from jax.experimental.xla_metadata import set_xla_metadata
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal, jaxpr_as_fun
from jax.flatten_util import ravel_pytree
from jax.interpreters.partial_eval import dce_jaxpr
from jaxlib import lapack
from jaxlib import utils as log  # pyright: ignore[reportAttributeAccessIssue]

from drumsqueal.compilation import cores, forget, is_private, keep, load_kept, programs_folder
from drumsqueal.interpreter import is_array, kind_of

PACKAGE = Path(__file__).parent
MOST_UNTOLD = 6  # programs of one function that depend on what is not told: a friction law in Python has 30 MB of them
MOST_BYTES = 256 * 2**20  # kept: the programs of a scene have some 3 MB; those that were not used for longest go first

folder: Path | None = programs_folder()
"""Where executables are kept; None for nowhere."""


def _give_back() -> None:
    """Have the C library hand back what was freed, which glibc keeps in between: after a hundred laws 400 MB."""
    with suppress(OSError, AttributeError):  # of another library there is no such function
        ctypes.CDLL(None).malloc_trim(0)


class _Kept(NamedTuple):
    """An executable as JAX serialises it, how many arrays it takes, its result with places for the arrays in it.

    `lapack` says whether it calls LAPACK.
    """

    executable: bytes
    taken: int
    result: Any
    lapack: bool


class _Place(Enum):
    """Stands where an array goes."""

    ARRAY = 0


class _Pickler(pickle.Pickler):
    """One that keeps what equinox has in the place of missing fields the one thing that it is."""

    def reducer_override(self, obj: Any) -> Any:
        """The name of that thing, in its module; of others nothing special."""
        return "MISSING" if type(obj).__name__ == "_Missing" else NotImplemented


class Program:
    """A function as `equinox.filter_jit` compiles it, its executables kept. Arguments and results are trees."""

    def __init__(self, function: Callable[..., Any], options: dict[str, str | bool] | None = None) -> None:
        """Take a function, and options for XLA."""
        functools.update_wrapper(self, function)
        self._function, self._options = function, options or {}
        self._traced = eqx.filter_jit(function, compiler_options=self._options)  # pyright: ignore[reportCallIssue]
        self._ready: dict[Any, Callable[..., Any] | None] = {}
        self._untold: list[Any] = []  # keys of those that are given back when others have come
        self._finding = threading.RLock()  # so that of several threads one compiles, and the others wait for it

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        """Call the function, compiled."""
        leaves, tree = jax.tree.flatten((arguments, keywords))
        arrays = [leaf for leaf in leaves if is_array(leaf)]
        call = self._found((arguments, keywords), leaves, tree)
        return self._traced(*arguments, **keywords) if call is None else call(*arrays)

    def ahead(self, given: Callable[[], tuple[Any, ...]]) -> None:
        """Load or compile what calls with such arguments need, in another thread; one that comes early waits for it."""

        def find() -> None:
            with suppress(Exception):  # which the call raises again
                arguments = given(), {}
                self._found(arguments, *jax.tree.flatten(arguments))

        threading.Thread(target=find).start()

    def lower(self, *arguments: Any, **keywords: Any) -> Any:
        """What the function is traced to, as `equinox.filter_jit` has it."""
        return self._traced.lower(*arguments, **keywords)

    def _found(self, given: Any, leaves: list[Any], tree: Any) -> Callable[..., Any] | None:
        """The executable as a function of the arrays; None where `equinox.filter_jit` is to be called."""
        if _set("jax_disable_jit") or any(_is_traced(type(leaf)) for leaf in leaves):
            return None
        key = tree, tuple(map(kind_of, leaves))
        with suppress(KeyError):
            return self._ready[key]
        with self._finding:
            if key not in self._ready:
                self._ready[key] = self._find(key, given, leaves, tree)
            return self._ready[key]

    def _find(self, key: Any, given: Any, leaves: list[Any], tree: Any) -> Callable[..., Any] | None:
        """Load the program, or compile it and keep it where it can be told from others."""
        try:
            circumstances = list(_circumstances())
        except _UntoldError:
            return None
        path = None
        with suppress(_UntoldError):
            told = [_name(self._function), self._options, *_told(given), *circumstances]
            name = hashlib.sha256("\n".join(map(str, told)).encode()).hexdigest()
            if folder is not None and is_private(folder):
                path = folder / f"{self._function.__name__}-{name}"
        if path is not None:
            return _load(path) or self._compile(path, leaves, tree)
        found = self._compile(None, leaves, tree)
        self._untold.append(key)  # not before: one that cannot be traced is none of them
        if len(self._untold) > MOST_UNTOLD:
            self._ready.pop(self._untold.pop(0))
            _give_back()
        return found

    def _compile(self, path: Path | None, leaves: list[Any], tree: Any) -> Callable[..., Any]:
        result: Any = None

        def flat(*arrays: Any) -> list[Any]:
            nonlocal result
            filled = iter(arrays)
            arguments, keywords = jax.tree.unflatten(
                tree, [next(filled) if eqx.is_array(leaf) else leaf for leaf in leaves]
            )
            given = self._function(*arguments, **keywords)
            result = jax.tree.map(lambda part: _Place.ARRAY if eqx.is_array(part) else part, given)
            return [part for part in jax.tree.leaves(given) if eqx.is_array(part)]

        # What JAX takes from a cache of its own cannot be serialised again: no program of that name is there.
        flat.__name__ = self._function.__name__ + (f"_{secrets.token_hex(4)}" if path else "")
        lowered = jax.jit(flat, compiler_options=self._options).lower(*(each for each in leaves if eqx.is_array(each)))
        if path is None:
            return _whole(lowered.compile(), result)
        with _not_cached_by_jax:
            executable = lowered.compile()
        called = set(re.findall(r"custom_call @(\w+)", lowered.as_text()))
        if all(name.startswith("lapack_") for name in called):  # and nothing of this process
            with suppress(NotImplementedError, ValueError):
                content = serialize_executable.serialize(executable)[0]
                kept = _Kept(content, len(jax.tree.leaves(executable.in_avals)), result, lapack=bool(called))
                keep(path, _pickled(kept), MOST_BYTES)
        return _whole(executable, result)


def _whole(executable: Callable[..., Any], result: Any) -> Callable[..., Any]:
    """What gives the whole result, not only its arrays."""
    parts, tree = jax.tree.flatten(result)

    def call(*arrays: Any) -> Any:
        found = iter(executable(*arrays))
        return jax.tree.unflatten(tree, [next(found) if part is _Place.ARRAY else part for part in parts])

    return call


def _load(path: Path) -> Callable[..., Any] | None:
    """The program of a file; None where there is none or where it is damaged or another one's, and then removed."""
    content = load_kept(path)
    if content is None:
        return None
    try:
        kept = _Kept(*pickle.loads(content))
        if kept.lapack:  # which tracing would see to; without it the process dies
            lapack.prepare_lapack_call("syevd", np.dtype(np.float64))
        with _silent:
            given = [part for part in jax.tree.leaves(kept.result) if part is _Place.ARRAY]
            trees = jax.tree.structure(((0,) * kept.taken, {})), jax.tree.structure(given)
            executable = serialize_executable.deserialize_and_load(kept.executable, *trees)
    except Exception:  # whatever a pickle or XLA raises
        forget(path)
        return None
    return _whole(executable, kept.result)


def _pickled(kept: _Kept) -> bytes:
    stream = io.BytesIO()
    _Pickler(stream).dump(tuple(kept))
    return stream.getvalue()


class _UntoldError(Exception):
    """A program depends on something that does not tell what it is."""


@functools.cache
def _is_traced(kind: type) -> bool:
    return issubclass(kind, Tracer)


def _set(name: str) -> bool:
    """A setting of JAX, as it is in this thread."""
    return getattr(jax.config, name)


def _told(value: Any) -> Iterator[Any]:
    """All that a program depends on of its arguments, the same in every process."""
    if eqx.is_array(value):
        yield kind_of(value)
    elif value is None or (isinstance(value, bool | int | float | complex | str) and not isinstance(value, Enum)):
        yield type(value).__name__, repr(value)
    elif isinstance(value, Enum):
        yield _name(type(value)), value.name
    elif isinstance(value, type):
        yield _name(value)
    elif isinstance(value, tuple | list):
        yield _name(type(value)), len(value)
        for each in value:
            yield from _told(each)
    elif isinstance(value, dict):
        yield len(value)
        for key in sorted(value):
            yield repr(key)
            yield from _told(value[key])
    elif isinstance(value, eqx.Module):
        yield _name(type(value))
        for field in fields(value):
            yield field.name
            yield from _told(getattr(value, field.name))
    else:
        raise _UntoldError


def _name(thing: Any) -> str:
    """Where a class or function is defined, if its source is known."""
    if thing.__module__.split(".")[0] not in (PACKAGE.name, "builtins") or "<" in thing.__qualname__:
        raise _UntoldError
    return f"{thing.__module__}.{thing.__qualname__}"


def _circumstances() -> Iterator[Any]:
    """What all programs depend on. Raises _UntoldError where not all of it is known here."""
    if jax.default_backend() != "cpu" or jax.device_count() != 1 or not _set("jax_enable_compilation_cache"):
        raise _UntoldError
    yield from _sources_and_versions()
    yield cores()
    yield sorted((name, value) for name, value in os.environ.items() if name.startswith("XLA_"))
    of_no_effect = "cache|log|traceback|explain|dump|profil"  # settings of JAX that change no program
    yield sorted((name, repr(value)) for name, value in jax.config.values.items() if not re.search(of_no_effect, name))


@functools.cache
def _sources_and_versions() -> tuple[str, ...]:
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        digest.update(str(path.relative_to(PACKAGE)).encode() + path.read_bytes())
    return (
        digest.hexdigest(),
        platform.python_version(),
        *(version(name) for name in ("jax", "jaxlib", "equinox", "diffrax", "numpy", "scipy")),
    )


class _WhileAny:
    """A setting of the whole process: the first thread that comes in makes it, the last one to leave takes it back."""

    def __init__(self, make: Callable[[], Callable[[], None]]) -> None:
        """Take what makes it, and returns what takes it back."""
        self._make, self._inside, self._lock = make, 0, threading.Lock()

    def __enter__(self) -> None:
        with self._lock:
            if self._inside == 0:
                self._take_back = self._make()
            self._inside += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                self._take_back()


def _cache_less() -> Callable[[], None]:
    """What is compiled is not kept by JAX as well."""
    name = "jax_persistent_cache_min_compile_time_secs"
    before = jax.config.values[name]
    jax.config.update(name, float("inf"))
    return functools.partial(jax.config.update, name, before)


def _hush() -> Callable[[], None]:
    """Without XLA's complaint at every program, see `compilation.QUIET`, also where JAX was imported before."""
    silent, as_jax = 3, "1"  # levels of the C++ side's log: only what is fatal, and what JAX sets unless told otherwise
    log.absl_set_min_log_level(silent)
    level = int(os.environ.get("TF_CPP_MIN_LOG_LEVEL", as_jax))
    return functools.partial(log.absl_set_min_log_level, level)


_not_cached_by_jax, _silent = _WhileAny(_cache_less), _WhileAny(_hush)


# Compile a small program as one kernel, as a processor runs it best.


# LLVM prefers vectors of four numbers also where the processor has eight lanes; elsewhere this changes nothing. What
# XLA emits in its newer way takes 1.2 (a drum that bends) to 1.7 times (a rigid shoe) as long to compile, and at best
# 5 % less to run; JAX before 0.11 has the older one.
_COMPILER_OPTIONS: dict[str, str | bool] = {"xla_cpu_prefer_vector_width": "512", "xla_cpu_use_fusion_emitters": False}


def one_kernel(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call the function within a traced program so that XLA compiles it as one kernel.

    The function takes trees of arrays and static values and returns a tree of arrays. All that is traced must come to
    it as an argument, and it may not use what XLA calls a library for: factorisations, eigenvalues, sorts, callbacks.
    Call it within `compiled`.
    """
    arrays, static = eqx.partition(arguments, eqx.is_array)
    # One argument, which something uses: XLA fails, and takes the process with it, over one that nothing uses.
    flat, unravel = ravel_pytree(jax.tree.map(jnp.asarray, arrays))
    outputs = jax.jit(lambda flat: function(*eqx.combine(unravel(flat), static)))(flat)
    return _as_kernel(outputs)


def _as_kernel(outputs: Any) -> Any:
    """What a program within a program gives, with what makes that one kernel.

    XLA runs a program on a processor as a chain of kernels, some 50 ns from one to the next, and gives that up by
    itself only for loops of less than a kilobyte. The forces on a shoe take some ten kernels of 10 ns each: as one
    kernel a step takes a fifth of the time. The attributes mean nothing to other back ends.
    """
    wanted = {"inlineable": "false", "xla_cpu_small_call": "true"}
    return jax.tree.map(lambda output: set_xla_metadata(output, **wanted), outputs)


def kernel_in_loop(function: Callable[..., Any], *like: Any) -> Callable[..., Any]:
    """The function as a kernel of its own within a loop that is none, for arguments like some trees of arrays.

    All else that it uses stays the same in that loop, and what follows from this alone is computed before it: XLA does
    so for loops within a kernel, and does not look into one for it. A kernel with the loop in it takes up to twice as
    long to compile, since LLVM sees it as one function. This one takes some 6 µs to begin, as it is handed all that it
    holds between its operations: a loop within a kernel is better where a round takes no longer than that.
    """
    traced, form = jax.make_jaxpr(function, return_shape=True)(*like)
    before, after, moving = _split(traced.jaxpr)
    found = jaxpr_as_fun(ClosedJaxpr(before, ()))(*traced.consts)
    # One array of all that are short: each takes its time to hand over. What is long would be copied.
    short = [each.size < 500 for each in found]
    packed, unpack = ravel_pytree([each for each, packs in zip(found, short, strict=True) if packs])
    long = [each for each, packs in zip(found, short, strict=True) if not packs]

    def kernel(packed: Array, long: list[Array], varying: list[Array]) -> list[Array]:
        parts = {True: iter(unpack(packed)), False: iter(long)}
        return jaxpr_as_fun(ClosedJaxpr(after, ()))(*varying, *(next(parts[packs]) for packs in short))

    def call(*varying: Any) -> Any:
        leaves = [each for each, moves in zip(jax.tree.leaves(varying), moving, strict=True) if moves]
        return jax.tree.unflatten(jax.tree.structure(form), _as_kernel(jax.jit(kernel)(packed, long, leaves)))

    return call


def _split(jaxpr: Jaxpr) -> tuple[Jaxpr, Jaxpr, list[bool]]:
    """Of a program what follows from its constants alone, and the rest, from its inputs and what that gives.

    And which of the inputs the rest uses: over one that nothing uses XLA fails.
    """
    given, names = len(jaxpr.constvars), jaxpr.debug_info.with_unknown_names()  # as inputs will be others
    jaxpr = jaxpr.replace(constvars=[], invars=[*jaxpr.constvars, *jaxpr.invars], debug_info=names)
    jaxpr, _ = dce_jaxpr(jaxpr, [True] * len(jaxpr.outvars), instantiate=True)
    inputs, inner = jaxpr.invars[given:], set(jaxpr.invars[given:])
    parts: tuple[list[JaxprEqn], list[JaxprEqn]] = [], []
    for equation in jaxpr.eqns:
        moves = any(not isinstance(each, Literal) and each in inner for each in equation.invars)
        inner.update(equation.outvars if moves else ())
        parts[moves].append(equation)
    taken = [*(each for equation in parts[True] for each in equation.invars), *jaxpr.outvars]
    wanted = dict.fromkeys(each for each in taken if not isinstance(each, Literal))
    between, moving = [each for each in wanted if each not in inner], [each in wanted for each in inputs]
    before = jaxpr.replace(invars=jaxpr.invars[:given], outvars=between, eqns=parts[False])
    own = [each for each, moves in zip(inputs, moving, strict=True) if moves]
    return before, jaxpr.replace(invars=[*own, *between], eqns=parts[True]), moving


def kernel_of(function: Callable[..., Any], model: Any, *arguments: Any) -> Any:
    """Call it as one kernel; over cells plainly, where it is called seldom, or has derivatives or kernels of its own.

    There a kernel takes twice as long to compile, and with derivatives five times.
    """
    return function(model, *arguments) if model.contact.cell_axes else one_kernel(function, model, *arguments)


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function as a program, see `programs.py`, with the options that kernels of small loops want."""
    return Program(function, _COMPILER_OPTIONS)
