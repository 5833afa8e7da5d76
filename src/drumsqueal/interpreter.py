"""Programs that NumPy evaluates, operation by operation, as JAX traces them: for what is asked a handful of times.

To compile the forces about steady sliding and their slopes takes seconds, to trace them a tenth of that, and to
evaluate them in this way milliseconds. So the formulas stand in one place, as functions of JAX, whether they are
compiled for a transient of a million steps or evaluated once for its eigenvalues.

What is traced is a list of operations on arrays (a jaxpr, see JAX's documentation of it). Each becomes a function of
NumPy here; one that is not known here is left to JAX, which compiles it by itself.
"""

import functools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import jax
import numpy as np
import scipy.linalg
from jax.core import Tracer
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal

MOST_KNOWN = 64  # of one function's traces, megabytes each; friction laws in Python have one each
LARGE = 10_000  # numbers of a product that is better not held; of smaller ones that takes no time
Operation = Callable[..., Any]
"""A function of NumPy arrays that returns one, or a sequence of several."""

MAPS: dict[str, Operation] = {
    "abs": np.abs, "acos": np.arccos, "add": np.add, "add_any": np.add, "and": np.bitwise_and, "asin": np.arcsin,
    "asinh": np.arcsinh, "acosh": np.arccosh, "atanh": np.arctanh, "atan": np.arctan, "atan2": np.arctan2, "cbrt": np.cbrt, "ceil": np.ceil, "conj": np.conj, "cos": np.cos,
    "cosh": np.cosh, "copy": np.asarray, "copy_p": np.asarray, "div": lambda a, b: _divided(a, b), "eq": np.equal,
    "exp": np.exp, "expm1": np.expm1, "floor": np.floor, "ge": np.greater_equal, "gt": np.greater, "imag": np.imag,
    "is_finite": np.isfinite, "le": np.less_equal, "log": np.log, "log1p": np.log1p, "lt": np.less,
    "max": np.maximum, "min": np.minimum, "mul": np.multiply, "ne": np.not_equal, "neg": np.negative,
    "nextafter": np.nextafter, "not": np.invert, "or": np.bitwise_or, "pow": np.power, "real": np.real,
    "rem": np.fmod, "rsqrt": lambda a: 1 / np.sqrt(a), "select_n": lambda which, *cases: _selected(which, cases),
    "sign": np.sign, "sin": np.sin, "sinh": np.sinh, "sqrt": np.sqrt, "square": np.square, "stop_gradient": np.asarray,
    "sub": np.subtract, "tan": np.tan, "tanh": np.tanh, "xor": np.bitwise_xor, "complex": lambda a, b: a + 1j * b,
    "clamp": lambda low, a, high: np.minimum(np.maximum(a, low), high),
}  # fmt: skip
"""Operations without settings, element by element."""


class Interpreted:
    """A function of trees of arrays that NumPy evaluates, traced once for each structure of its arguments.

    Within another program it is part of that one. What arrays there are in its result are of NumPy.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        """Take a function, as `programs.Program` does."""
        functools.update_wrapper(self, function)
        self._function = function
        self._known: dict[Any, Callable[..., Any]] = {}

    def __call__(self, *arguments: Any) -> Any:
        """Call the function, evaluated by NumPy."""
        leaves, tree = jax.tree.flatten(arguments)
        if any(isinstance(leaf, Tracer) for leaf in leaves):
            return self._function(*arguments)
        key = tree, tuple(map(kind_of, leaves))
        call = self._known.get(key)
        if call is None:
            if len(self._known) >= MOST_KNOWN:
                self._known.pop(next(iter(self._known)), None)
            call = _traced(self._function, leaves, tree)
            if call is None:
                return self._function(*arguments)
            self._known[key] = call
        return call([np.asarray(leaf) for leaf in leaves if is_array(leaf)])


def is_array(leaf: Any) -> bool:
    """Whether it is one of JAX or of NumPy, a number of NumPy among them."""
    return _of_arrays(type(leaf))


@functools.cache
def _of_arrays(kind: type) -> bool:
    return issubclass(kind, jax.Array | np.ndarray | np.generic)


def kind_of(leaf: Any) -> tuple[Any, ...]:
    """What a program depends on of a leaf of its arguments."""
    if is_array(leaf):
        return leaf.shape, leaf.dtype, getattr(leaf, "weak_type", False)
    return type(leaf), repr(leaf) if isinstance(leaf, float) else leaf  # 0.0 is not −0.0


def _traced(function: Callable[..., Any], leaves: list[Any], tree: Any) -> Callable[[list[np.ndarray]], Any] | None:
    """The function of the arrays among the leaves; None where a function among them holds traced numbers."""
    result: Any = None

    def flat(*arrays: Any) -> list[Any]:
        nonlocal result
        filled = iter(arrays)
        arguments = jax.tree.unflatten(tree, [next(filled) if is_array(leaf) else leaf for leaf in leaves])
        result = function(*arguments)
        return [part for part in jax.tree.leaves(result) if is_array(part) or isinstance(part, Tracer)]

    traced = jax.make_jaxpr(flat)(*(leaf for leaf in leaves if is_array(leaf)))
    if any(isinstance(each, Tracer) for each in traced.consts):
        return None
    evaluate = evaluation(traced)
    parts, form = jax.tree.flatten(result)
    known = [None if is_array(part) or isinstance(part, Tracer) else part for part in parts]

    def call(arrays: list[np.ndarray]) -> Any:
        with np.errstate(all="ignore"):  # as JAX does: what is not finite is looked at where it matters
            found = iter(evaluate(*arrays))
        return jax.tree.unflatten(form, [next(found) if part is None else part for part in known])

    return call


def evaluation(traced: ClosedJaxpr) -> Callable[..., list[np.ndarray]]:
    """What a traced function computes, by NumPy: arrays in, arrays out."""
    jaxpr, constants = traced.jaxpr, [np.asarray(each) for each in traced.consts]
    run, types = _program(jaxpr), [each.aval.dtype for each in jaxpr.outvars]

    def evaluate(*arrays: np.ndarray) -> list[np.ndarray]:
        return [np.asarray(each, dtype) for each, dtype in zip(run(*constants, *arrays), types, strict=True)]

    return evaluate


def _program(jaxpr: Jaxpr) -> Callable[..., list[Any]]:
    """The operations in their order, each with the places of what it takes and gives in one list of values.

    A value that no later operation takes is dropped: the derivatives of a bending shoe would fill gigabytes.
    """
    places: dict[Any, int] = {}
    values: list[Any] = []

    def place(variable: Any) -> int:
        if isinstance(variable, Literal):
            values.append(np.asarray(variable.val, variable.aval.dtype)[()])
            return len(values) - 1
        if variable not in places:
            places[variable] = len(values)
            values.append(None)
        return places[variable]

    inputs = [place(each) for each in (*jaxpr.constvars, *jaxpr.invars)]
    steps = [
        (operation, tuple(map(place, taking)), tuple(map(place, giving)))
        for operation, taking, giving in _operations(jaxpr)
    ]
    outputs = [place(each) for each in jaxpr.outvars]
    last = {taken: k for k, (_, taking, _) in enumerate(steps) for taken in taking}
    kept = {k for k, value in enumerate(values) if value is not None} | set(outputs)
    dropped: list[list[int]] = [[] for _ in steps]
    for taken, k in last.items():
        if taken not in kept:
            dropped[k].append(taken)
    for k, (_, _, giving) in enumerate(steps):
        dropped[k] += [given for given in giving if given not in last and given not in kept]

    def run(*arrays: Any) -> list[Any]:
        at = values.copy()
        for where, array in zip(inputs, arrays, strict=True):
            at[where] = array
        for (operation, taking, giving), done in zip(steps, dropped, strict=True):
            found = operation(*[at[k] for k in taking])
            if len(giving) == 1:
                at[giving[0]] = found
            else:
                for where, each in zip(giving, found, strict=True):
                    at[where] = each
            for k in done:
                at[k] = None
        return [at[k] for k in outputs]

    return run


def _operations(jaxpr: Jaxpr) -> Iterator[tuple[Operation, Sequence[Any], Sequence[Any]]]:
    """Each operation with what it takes and gives; a product of which only a sum is taken is one with that sum."""
    uses = Counter(each for equation in jaxpr.eqns for each in equation.invars if not isinstance(each, Literal))
    uses.update(each for each in jaxpr.outvars if not isinstance(each, Literal))
    products = {each.outvars[0]: each for each in jaxpr.eqns if each.primitive.name == "mul"}
    sums = {each.outvars[0]: each.invars[0] for each in jaxpr.eqns if each.primitive.name == "reduce_sum"}
    summed = {each for each in sums.values() if each in products and uses[each] == 1}
    for equation in jaxpr.eqns:
        given = equation.outvars[0] if equation.outvars else None
        if given in sums and sums[given] in summed:
            yield _sum_of_products(equation.params["axes"]), products[sums[given]].invars, equation.outvars
        elif given not in summed:
            yield _operation(equation), equation.invars, equation.outvars


def _operation(equation: JaxprEqn) -> Operation:
    """The function of NumPy for an operation, of one result or of a sequence of them."""
    name = equation.primitive.name
    if name in MAPS:
        return MAPS[name]
    if name in WITH_SETTINGS:
        return WITH_SETTINGS[name](**equation.params)
    return _left_to_jax(equation)


def _left_to_jax(equation: JaxprEqn) -> Operation:
    several = equation.primitive.multiple_results

    def bound(*arrays: Any) -> Any:
        found = equation.primitive.bind(*(jax.numpy.asarray(each) for each in arrays), **equation.params)
        return [np.asarray(each) for each in found] if several else np.asarray(found)

    return bound


def _one_or_all(found: list[Any]) -> Any:
    return found[0] if len(found) == 1 else found


def _divided(a: Any, b: Any) -> Any:
    return np.trunc(np.true_divide(a, b)).astype(np.result_type(a, b)) if _is_whole(a) else np.true_divide(a, b)


def _is_whole(a: Any) -> bool:
    return np.issubdtype(np.asarray(a).dtype, np.integer)


def _selected(which: Any, cases: Sequence[Any]) -> Any:
    return np.where(which, cases[1], cases[0]) if len(cases) == 2 else np.choose(which, cases)


def _broadcast_in_dim(*, shape: Any, broadcast_dimensions: Any, **_: Any) -> Operation:
    def broadcast(array: Any) -> Any:
        wide = [1] * len(shape)
        for axis, size in zip(broadcast_dimensions, np.shape(array), strict=True):
            wide[axis] = size
        return np.broadcast_to(np.reshape(array, wide), shape)

    return broadcast


def _dot_general(*, dimension_numbers: Any, preferred_element_type: Any = None, **_: Any) -> Operation:
    (first_sum, second_sum), (first_batch, second_batch) = dimension_numbers

    def product(a: Any, b: Any) -> Any:
        free_a = [k for k in range(a.ndim) if k not in first_sum and k not in first_batch]
        free_b = [k for k in range(b.ndim) if k not in second_sum and k not in second_batch]
        batch, over = [a.shape[k] for k in first_batch], math.prod(a.shape[k] for k in first_sum)
        rows, columns = [a.shape[k] for k in free_a], [b.shape[k] for k in free_b]
        left = np.transpose(a, [*first_batch, *free_a, *first_sum]).reshape(*batch, math.prod(rows), over)
        right = np.transpose(b, [*second_batch, *second_sum, *free_b]).reshape(*batch, over, math.prod(columns))
        found = np.matmul(left, right).reshape(*batch, *rows, *columns)
        return found if preferred_element_type is None else found.astype(preferred_element_type, copy=False)

    return product


def _sum_of_products(axes: Sequence[int]) -> Operation:
    """The sum over some axes of the product of two arrays, which is not held itself where it is large."""

    def summed(a: Any, b: Any) -> Any:
        if np.ndim(a) != np.ndim(b) or math.prod(shape := np.broadcast_shapes(a.shape, b.shape)) < LARGE:
            return np.sum(np.multiply(a, b), axis=tuple(axes))
        (first, second), kept = (
            [axis for axis in range(a.ndim) if each.shape[axis] > 1] for each in (a, b)
        ), [axis for axis in range(a.ndim) if axis not in axes]
        given = [axis for axis in kept if shape[axis] > 1]
        found = np.einsum(np.squeeze(a), first, np.squeeze(b), second, given, optimize=True)
        return np.reshape(found, [shape[axis] for axis in kept])

    return summed


def _reduce(function: Callable[..., Any]) -> Callable[..., Operation]:
    def made(*, axes: Any, **_: Any) -> Operation:
        return lambda array: function(array, axis=tuple(axes))

    return made


def _sums(*, jaxpr: Any, dimensions: Any, **_: Any) -> Operation:
    """Several sums at once, which is all that this package has of such an operation."""
    if any(each.primitive.name != "add" for each in jaxpr.jaxpr.eqns):
        raise NotImplementedError("an operation over an axis that is no sum")

    def summed(*arrays: Any) -> Any:
        half = len(arrays) // 2
        return _one_or_all(
            [start + np.sum(each, axis=dimensions) for each, start in zip(arrays[:half], arrays[half:], strict=True)]
        )

    return summed


def _arg_reduce(function: Callable[..., Any]) -> Callable[..., Operation]:
    def made(*, axes: Any, index_dtype: Any, **_: Any) -> Operation:
        return lambda array: function(array, axis=axes[0]).astype(index_dtype)

    return made


def _cumulative(function: Any) -> Callable[..., Operation]:
    def made(*, axis: int, reverse: bool, **_: Any) -> Operation:
        if reverse:
            return lambda array: np.flip(function.accumulate(np.flip(array, axis), axis=axis), axis)
        return lambda array: function.accumulate(array, axis=axis)

    return made


def _sort(*, dimension: int, num_keys: int, **_: Any) -> Operation:
    def ordered(*arrays: Any) -> Any:
        order = np.lexsort([np.moveaxis(each, dimension, -1) for each in reversed(arrays[:num_keys])], axis=-1)
        found = [np.take_along_axis(each, np.moveaxis(order, -1, dimension), dimension) for each in arrays]
        return _one_or_all(found)

    return ordered


def _pad(*, padding_config: Any, **_: Any) -> Operation:
    def padded(array: Any, value: Any) -> Any:
        whole, kept, taken = [], [], []
        for size, (low, high, inner) in zip(array.shape, padding_config, strict=True):
            spread = max(0, size + inner * (size - 1))
            whole.append(low + spread + high)
            inside = [k for k in range(size) if 0 <= low + k * (inner + 1) < whole[-1]]
            kept.append([low + k * (inner + 1) for k in inside])
            taken.append(inside)
        found = np.full(whole, value, array.dtype)
        found[np.ix_(*kept)] = array[np.ix_(*taken)]
        return found

    return padded


def _slice(*, start_indices: Any, limit_indices: Any, strides: Any, **_: Any) -> Operation:
    steps = strides or [None] * len(start_indices)
    parts = tuple(slice(*each) for each in zip(start_indices, limit_indices, steps, strict=True))
    return lambda array: array[parts]


def _window(shape: Sequence[int], starts: Sequence[Any], sizes: Sequence[int]) -> tuple[slice, ...]:
    """Where a part of given sizes lies, moved inside where it would stick out."""
    firsts = [min(max(int(start), 0), size - part) for start, size, part in zip(starts, shape, sizes, strict=True)]
    return tuple(slice(first, first + part) for first, part in zip(firsts, sizes, strict=True))


def _dynamic_slice(*, slice_sizes: Any, **_: Any) -> Operation:
    return lambda array, *starts: array[_window(array.shape, starts, slice_sizes)]


def _dynamic_update_slice(**_: Any) -> Operation:
    def updated(array: Any, part: Any, *starts: Any) -> Any:
        found = np.array(array)
        found[_window(array.shape, starts, part.shape)] = part
        return found

    return updated


def _indices(
    shape: Sequence[int],
    starts: Any,
    sizes: Sequence[int],
    rank: int,
    window: Sequence[int],
    axes: tuple[Sequence[int], Sequence[int], Sequence[int], Sequence[int]],
    mode: Any,
) -> tuple[tuple[Any, ...], Any]:
    """Which entries of an array a gather reads or a scatter writes, and whether they are inside.

    `starts` (..., k) are where windows of given sizes begin, `window` the axes of the result that run along a window,
    the others those of the starts. `axes`: those of the array that starts are of, that the result lacks, and that go
    along with an axis of the starts, and that one.
    """
    started, lacking, along, along_starts = axes
    others = [axis for axis in range(rank) if axis not in window]
    running = iter(window)

    def spread(values: Any, places: Sequence[int]) -> Any:
        wide = [1] * rank
        for place, size in zip(places, np.shape(values), strict=True):
            wide[place] = size
        return np.reshape(values, wide)

    found, inside = [], np.ones([1] * rank, bool)
    for axis, (size, part) in enumerate(zip(shape, sizes, strict=True)):
        index: Any = np.zeros([1] * rank, int)
        if axis in started:
            start = spread(starts[..., list(started).index(axis)].astype(int), others)
            kept = np.clip(start, 0, size - part)
            inside = inside & (start == kept)
            index = kept
        elif axis in along:
            batch = list(along_starts)[list(along).index(axis)]
            index = spread(np.arange(size), [others[batch]])
        if axis not in lacking and axis not in along:
            index = index + spread(np.arange(part), [next(running)])
        found.append(index)
    dropping = "FILL" in str(mode)
    return tuple(found), inside if dropping else np.ones([1] * rank, bool)


def _gather(*, dimension_numbers: Any, slice_sizes: Any, mode: Any, fill_value: Any, **_: Any) -> Operation:
    of = dimension_numbers
    axes = of.start_index_map, of.collapsed_slice_dims, of.operand_batching_dims, of.start_indices_batching_dims

    def gathered(array: Any, starts: Any) -> Any:
        rank = np.ndim(starts) - 1 + len(of.offset_dims)
        index, inside = _indices(array.shape, starts, slice_sizes, rank, of.offset_dims, axes, mode)
        shape = np.broadcast_shapes(*(each.shape for each in index))
        found = array[index].reshape(shape)
        return found if np.all(inside) else np.where(inside, found, _filling(array.dtype, fill_value))

    return gathered


def _filling(dtype: Any, value: Any) -> Any:
    if value is not None:
        return value
    if np.issubdtype(dtype, np.inexact):
        return np.nan
    return True if dtype == bool else np.iinfo(dtype).min if np.issubdtype(dtype, np.signedinteger) else np.iinfo(dtype).max


def _scatter(write: Callable[[Any, Any, Any], None]) -> Callable[..., Operation]:
    def made(*, dimension_numbers: Any, mode: Any, **_: Any) -> Operation:
        of = dimension_numbers
        axes = (
            of.scatter_dims_to_operand_dims,
            of.inserted_window_dims,
            of.operand_batching_dims,
            of.scatter_indices_batching_dims,
        )

        def scattered(array: Any, starts: Any, updates: Any) -> Any:
            running = iter(of.update_window_dims)
            without = {*of.inserted_window_dims, *of.operand_batching_dims}
            sizes = [1 if axis in without else updates.shape[next(running)] for axis in range(array.ndim)]
            index, inside = _indices(
                array.shape, starts, sizes, updates.ndim, of.update_window_dims, axes, mode
            )
            full = [np.broadcast_to(each, updates.shape) for each in (*index, inside)]
            written, found = full.pop(), np.array(array)
            write(found, tuple(each[written] for each in full), updates[written])
            return found

        return scattered

    return made


def _set(array: Any, index: Any, values: Any) -> None:
    array[index] = values


def _inlined(traced: Any) -> Operation:
    """A program within a program."""
    closed = traced if hasattr(traced, "consts") else None
    run = _program(traced.jaxpr if closed is not None else traced)
    constants = [] if closed is None else [np.asarray(each) for each in closed.consts]
    return lambda *arrays: _one_or_all(run(*constants, *arrays))


def _called(**settings: Any) -> Operation:
    return _inlined(settings.get("jaxpr") or settings.get("call_jaxpr") or settings["fun_jaxpr"])


def _as_list(found: Any, count: int) -> list[Any]:
    return [found] if count == 1 else list(found)


def _cond(*, branches: Any, **_: Any) -> Operation:
    ways = [_inlined(each) for each in branches]
    return lambda which, *arrays: ways[min(max(int(which), 0), len(ways) - 1)](*arrays)


def _while(*, cond_jaxpr: Any, body_jaxpr: Any, cond_nconsts: int, body_nconsts: int, **_: Any) -> Operation:
    goes_on, body, count = _inlined(cond_jaxpr), _inlined(body_jaxpr), len(body_jaxpr.out_avals)

    def looped(*arrays: Any) -> Any:
        of_cond, of_body = arrays[:cond_nconsts], arrays[cond_nconsts : cond_nconsts + body_nconsts]
        state = list(arrays[cond_nconsts + body_nconsts :])
        while np.any(going := goes_on(*of_cond, *state)):
            after = _as_list(body(*of_body, *state), count)
            if np.ndim(going):  # of several at once, each stays where it ended
                after = [
                    np.where(np.reshape(going, [*going.shape, *[1] * (np.ndim(new) - going.ndim)]), new, old)
                    for new, old in zip(after, state, strict=True)
                ]
            state = after
        return _one_or_all(state)

    return looped


def _scan(*, jaxpr: Any, length: int, reverse: bool, num_consts: int, num_carry: int, **_: Any) -> Operation:
    body, count = _inlined(jaxpr), len(jaxpr.out_avals)
    rows = [each.dtype for each in jaxpr.out_avals[num_carry:]]

    def scanned(*arrays: Any) -> Any:
        constants, state = arrays[:num_consts], list(arrays[num_consts : num_consts + num_carry])
        taken = arrays[num_consts + num_carry :]
        given: list[list[Any]] = [[] for _ in rows]
        for k in reversed(range(length)) if reverse else range(length):
            found = _as_list(body(*constants, *state, *(each[k] for each in taken)), count)
            state = found[:num_carry]
            for kept, each in zip(given, found[num_carry:], strict=True):
                kept.append(each)
        if reverse:
            given = [kept[::-1] for kept in given]
        shapes = [each.shape for each in jaxpr.out_avals[num_carry:]]
        stacks = [
            np.stack(kept) if kept else np.zeros((0, *shape), dtype)
            for kept, shape, dtype in zip(given, shapes, rows, strict=True)
        ]
        return _one_or_all([*state, *stacks])

    return scanned


def _custom_linear_solve(*, const_lengths: Any, jaxprs: Any, **_: Any) -> Operation:
    solve, lengths = _inlined(jaxprs.solve), list(const_lengths)
    before, own = sum(lengths[:2]), lengths[2]  # constants of the product and of its transpose come first

    def solved(*arrays: Any) -> Any:
        return solve(*arrays[before : before + own], *arrays[sum(lengths) :])

    return solved


def _each_matrix(function: Callable[..., Any], rank: int = 2) -> Operation:
    """A function of matrices for stacks of them."""

    def stacked(*arrays: Any) -> Any:
        batch = arrays[0].shape[:-2]
        found = [
            function(*(each[index] for each in arrays)) for index in np.ndindex(*batch)
        ]
        if isinstance(found[0], tuple):
            return [np.stack(each).reshape(*batch, *each[0].shape) for each in zip(*found, strict=True)]
        return np.stack(found).reshape(*batch, *found[0].shape)

    return stacked


def _lu(**_: Any) -> Operation:
    def factors(matrix: Any) -> tuple[Any, Any, Any]:
        factor, pivots, _ = scipy.linalg.lapack.dgetrf(matrix)
        order = np.arange(matrix.shape[0])
        for k, pivot in enumerate(pivots):
            order[[k, pivot]] = order[[pivot, k]]
        return factor, pivots.astype(np.int32), order.astype(np.int32)

    return _each_matrix(factors)


def _eigh(**_: Any) -> Operation:
    def system(matrix: Any) -> tuple[Any, Any]:
        values, vectors = np.linalg.eigh(matrix)
        return vectors, values

    return _each_matrix(system)


def _triangular_solve(
    *, left_side: bool, lower: bool, transpose_a: bool, unit_diagonal: bool, **_: Any
) -> Operation:
    def solved(a: Any, b: Any) -> Any:
        how = {"lower": lower, "unit_diagonal": unit_diagonal, "check_finite": False}
        if left_side:
            return _trtrs(a, b, transposed=transpose_a, **how)
        return _trtrs(a, b.T, transposed=not transpose_a, **how).T

    return _each_matrix(solved)


def _trtrs(a: Any, b: Any, *, transposed: bool, lower: bool, unit_diagonal: bool, **_: Any) -> Any:
    found, _info = scipy.linalg.lapack.dtrtrs(a, b, lower=lower, trans=int(transposed), unitdiag=unit_diagonal)
    return found if _info == 0 else np.full_like(b, np.nan)


def _settings() -> Iterator[tuple[str, Callable[..., Operation]]]:
    """Operations that have settings: what makes the function of them."""
    yield "broadcast_in_dim", _broadcast_in_dim
    yield "convert_element_type", lambda *, new_dtype, **_: lambda a: np.asarray(a).astype(new_dtype)[()]
    yield "integer_pow", lambda *, y: (lambda a: a * a) if y == 2 else (lambda a: np.power(a, float(y)))
    yield "reshape", lambda *, new_sizes, **_: lambda a: np.reshape(a, new_sizes)
    yield "transpose", lambda *, permutation: lambda a: np.transpose(a, permutation)
    yield "squeeze", lambda *, dimensions: lambda a: np.squeeze(a, tuple(dimensions))
    yield "concatenate", lambda *, dimension: lambda *a: np.concatenate(a, dimension)
    yield "platform_index", lambda *, platforms, **_: lambda: _of_processor(platforms)
    yield "stack", lambda *, axis: lambda *a: np.stack(a, axis)
    yield "rev", lambda *, dimensions: lambda a: np.flip(a, dimensions)
    yield "split", lambda *, sizes, axis: lambda a: _one_or_all(np.split(a, np.cumsum(sizes)[:-1], axis))
    yield "iota", lambda *, dtype, shape, dimension, **_: lambda: _counted(dtype, shape, dimension)
    yield "argmax", _arg_reduce(np.argmax)
    yield "argmin", _arg_reduce(np.argmin)
    yield "dot_general", _dot_general
    yield from {
        "reduce_sum": _reduce(np.sum), "reduce_max": _reduce(np.max), "reduce_min": _reduce(np.min),
        "reduce_prod": _reduce(np.prod), "reduce_and": _reduce(np.all), "reduce_or": _reduce(np.any),
        "cumsum": _cumulative(np.add), "cumprod": _cumulative(np.multiply), "cummax": _cumulative(np.maximum),
        "cummin": _cumulative(np.minimum), "sort": _sort, "pad": _pad, "slice": _slice,
        "dynamic_slice": _dynamic_slice, "dynamic_update_slice": _dynamic_update_slice, "gather": _gather,
        "scatter": _scatter(_set), "scatter-add": _scatter(np.add.at), "scatter_add": _scatter(np.add.at),
        "scatter-mul": _scatter(np.multiply.at), "scatter-max": _scatter(np.maximum.at),
        "scatter-min": _scatter(np.minimum.at), "cond": _cond, "while": _while, "scan": _scan,
        "custom_linear_solve": _custom_linear_solve, "lu": _lu, "triangular_solve": _triangular_solve,
        "eigh": _eigh, "reduce": _sums,
    }.items()  # fmt: skip
    for name in ("pjit", "jit", "closed_call", "core_call", "custom_jvp_call", "custom_vjp_call", "checkpoint", "remat2"):
        yield name, _called


def _of_processor(platforms: Sequence[Any]) -> int:
    """Which of several ways to compute something is that for a processor, or for any platform."""
    return next(k for k, names in enumerate(platforms) if names is None or "cpu" in names)


def _counted(dtype: Any, shape: Sequence[int], dimension: int) -> Any:
    wide = [1] * len(shape)
    wide[dimension] = shape[dimension]
    return np.broadcast_to(np.arange(shape[dimension], dtype=dtype).reshape(wide), shape)


WITH_SETTINGS: dict[str, Callable[..., Operation]] = dict(_settings())
