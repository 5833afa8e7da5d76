"""What NumPy computes in the place of JAX's primitive operations, see `interpreter.py`.

Which ones there are and what their settings mean is told by JAX's documentation of `jax.lax`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import scipy.linalg

Operation = Callable[..., Any]
"""A function of NumPy arrays that returns one, or a list of several."""

GETRF, TRTRS = scipy.linalg.get_lapack_funcs(("getrf", "trtrs"), dtype=np.float64)


def divided(a: Any, b: Any) -> Any:
    """Quotient; of whole numbers the whole part, towards zero."""
    if not np.issubdtype(np.asarray(a).dtype, np.integer):
        return np.true_divide(a, b)
    below = np.floor_divide(a, b)
    return below + ((below < 0) & (below * b != a)).astype(below.dtype)


def power(*, y: int) -> Operation:
    """A whole power."""
    return (lambda a: np.power(a, y)) if y >= 0 else (lambda a: 1 / np.power(a, -y))


def converted(*, new_dtype: Any, **_: Any) -> Operation:
    """As numbers of another kind; whole ones end at their largest, and what is no number is 0."""
    whole = np.issubdtype(new_dtype, np.integer)

    def convert(a: Any) -> Any:
        a = np.asarray(a)
        if whole and np.issubdtype(a.dtype, np.inexact) and not np.all(np.abs(a) < np.iinfo(new_dtype).max):
            limits = np.iinfo(new_dtype)
            inside = np.where(np.isnan(a) | (np.abs(a) >= limits.max), 0, a).astype(new_dtype)
            return np.select([a >= limits.max, a <= -limits.max], [limits.max, limits.min], inside).astype(new_dtype)
        return a.astype(new_dtype)

    return convert


def selected(which: Any, *cases: Any) -> Any:
    """From the case that `which` says, element by element."""
    return np.where(which, cases[1], cases[0]) if len(cases) == 2 else np.choose(which, cases)


SAME_NAME = "abs add cos exp expm1 floor log log1p sign sin sqrt square tan tanh"
ELEMENTWISE: dict[str, Operation] = {name: getattr(np, name) for name in SAME_NAME.split()} | {
    "add_any": np.add,
    "and": np.bitwise_and,
    "asinh": np.arcsinh,
    "atan2": np.arctan2,
    "clamp": lambda low, a, high: np.minimum(np.maximum(a, low), high),
    "copy": np.asarray,
    "div": divided,
    "eq": np.equal,
    "ge": np.greater_equal,
    "gt": np.greater,
    "is_finite": np.isfinite,
    "le": np.less_equal,
    "lt": np.less,
    "lt_to": np.less,
    "max": np.maximum,
    "min": np.minimum,
    "mul": np.multiply,
    "ne": np.not_equal,
    "neg": np.negative,
    "not": np.invert,
    "or": np.bitwise_or,
    "pow": np.power,
    "rem": np.fmod,
    "select_n": selected,
    "stop_gradient": np.asarray,
    "sub": np.subtract,
}
"""Those without settings, element by element."""


def one_or_all(found: list[Any]) -> Any:
    """The result of an operation that has one, or the list of several."""
    return found[0] if len(found) == 1 else found


def stretched(values: Any, rank: int, axes: Sequence[int]) -> Any:
    """An array whose own axes are those given of so many; the others have one entry."""
    shape = [1] * rank
    for axis, size in zip(axes, np.shape(values), strict=True):
        shape[axis] = size
    return np.reshape(values, shape)


def broadcast_in_dim(*, shape: Sequence[int], broadcast_dimensions: Sequence[int], **_: Any) -> Operation:
    """Repeated along new axes."""
    index = tuple(slice(None) if axis in broadcast_dimensions else None for axis in range(len(shape)))
    small = math.prod(shape) < 10_000  # which takes less time to fill than to look at in another way

    def broadcast(a: Any) -> Any:
        a = a[index]
        if not small:
            return np.broadcast_to(a, shape)
        found = np.empty(shape, a.dtype)
        found[...] = a
        return found

    return broadcast


def iota(*, dtype: Any, shape: Sequence[int], dimension: int, **_: Any) -> Operation:
    """Counting along one axis."""
    counted = stretched(np.arange(shape[dimension], dtype=dtype), len(shape), [dimension])
    return lambda: np.broadcast_to(counted, shape)


def dot_general(*, dimension_numbers: Any, preferred_element_type: Any, **_: Any) -> Operation:
    """Product of matrices along any axes."""
    (first_sum, second_sum), (first_batch, second_batch) = dimension_numbers

    def product(*both: Any) -> Any:
        a, b = (np.asarray(each, preferred_element_type) for each in both)
        first, second = (
            [axis for axis in range(each.ndim) if axis not in (*summed, *batch)]
            for each, summed, batch in ((a, first_sum, first_batch), (b, second_sum, second_batch))
        )
        batch, count = [a.shape[axis] for axis in first_batch], math.prod(a.shape[axis] for axis in first_sum)
        rows, columns = [a.shape[axis] for axis in first], [b.shape[axis] for axis in second]
        left = np.transpose(a, [*first_batch, *first, *first_sum]).reshape(*batch, math.prod(rows), count)
        right = np.transpose(b, [*second_batch, *second_sum, *second]).reshape(*batch, count, math.prod(columns))
        return np.matmul(left, right).reshape([*batch, *rows, *columns])

    return product


def sum_of_products(axes: Sequence[int]) -> Operation:
    """The sum over some axes of the product of two arrays, which is not held itself where it is large."""

    def summed(a: Any, b: Any) -> Any:
        # A product of fewer than 10,000 numbers takes less time than asking; a larger one is better not held.
        if np.ndim(a) != np.ndim(b) or math.prod(shape := np.broadcast_shapes(a.shape, b.shape)) < 10_000:
            return np.sum(np.multiply(a, b), axis=tuple(axes))
        own = [[axis for axis in range(a.ndim) if each.shape[axis] > 1] for each in (a, b)]
        kept = [axis for axis in range(a.ndim) if axis not in axes]
        wide = [axis for axis in kept if shape[axis] > 1]
        once = math.prod(shape[axis] for axis in axes if axis not in (*own[0], *own[1]))
        found = np.einsum(np.squeeze(a), own[0], np.squeeze(b), own[1], wide, optimize=True)
        return once * np.reshape(found, [shape[axis] for axis in kept])

    return summed


def reduced(function: Callable[..., Any]) -> Callable[..., Operation]:
    """Along some axes."""
    return lambda *, axes, **_: lambda a: function(a, axis=tuple(axes))


def summed_together(*, jaxpr: Any, dimensions: Sequence[int], **_: Any) -> Operation:
    """Several sums at once, see `known`."""
    del jaxpr

    def summed(*arrays: Any) -> Any:
        half = len(arrays) // 2
        pairs = zip(arrays[:half], arrays[half:], strict=True)
        return one_or_all([start + np.sum(each, axis=tuple(dimensions)) for each, start in pairs])

    return summed


def pad(*, padding_config: Any, **_: Any) -> Operation:
    """With entries before, after and between."""

    def padded(a: Any, value: Any) -> Any:
        whole, kept, taken = [], [], []
        for size, (low, high, inner) in zip(a.shape, padding_config, strict=True):
            whole.append(low + max(0, size + inner * (size - 1)) + high)
            taken.append([k for k in range(size) if 0 <= low + k * (inner + 1) < whole[-1]])
            kept.append([low + k * (inner + 1) for k in taken[-1]])
        found = np.full(whole, value, a.dtype)
        found[np.ix_(*kept)] = a[np.ix_(*taken)]
        return found

    return padded


def part(*, start_indices: Any, limit_indices: Any, strides: Any, **_: Any) -> Operation:
    """At places that are known beforehand."""
    steps = strides or [None] * len(start_indices)
    parts = tuple(slice(*each) for each in zip(start_indices, limit_indices, steps, strict=True))
    return lambda a: a[parts]


def _window(shape: Sequence[int], starts: Sequence[Any], sizes: Sequence[int]) -> tuple[slice, ...]:
    """Where a part of given sizes lies, moved inside where it would stick out."""
    firsts = [min(max(int(start), 0), size - part) for start, size, part in zip(starts, shape, sizes, strict=True)]
    return tuple(slice(first, first + part) for first, part in zip(firsts, sizes, strict=True))


def dynamic_slice(*, slice_sizes: Sequence[int], **_: Any) -> Operation:
    """At a computed place."""
    return lambda a, *starts: a[_window(a.shape, starts, slice_sizes)]


def dynamic_update_slice(**_: Any) -> Operation:
    """With a part replaced at a computed place."""

    def updated(a: Any, new: Any, *starts: Any) -> Any:
        found = np.array(a)
        found[_window(a.shape, starts, new.shape)] = new
        return found

    return updated


def _entries(
    shape: Sequence[int],
    starts: Any,
    sizes: Sequence[int],
    window: Sequence[int],
    rank: int,
    axes: tuple[Sequence[int], Sequence[int], Sequence[int], Sequence[int]],
    mode: Any,
) -> tuple[list[Any], Any]:
    """Which entries of an array windows cover, by axis of it, and which windows lie inside where others are dropped.

    Windows of given sizes begin at `starts` (..., k). Of the result's `rank` axes those of `window` run along windows,
    the others from one to the next. `axes` are those of the array that starts are of, that the result has not, that go
    along with an axis of the starts, and which axes of these.
    """
    started, lacking, along, along_starts = (list(each) for each in axes)
    others = [axis for axis in range(rank) if axis not in window]
    running, found, inside = iter(window), [], np.ones([1] * rank, bool)
    for axis, (size, length) in enumerate(zip(shape, sizes, strict=True)):
        entry: Any = np.zeros([1] * rank, int)
        if axis in started:
            start = stretched(starts[..., started.index(axis)].astype(int), rank, others)
            entry = np.clip(start, 0, size - length)
            inside = inside & (start == entry)
        elif axis in along:
            entry = stretched(np.arange(size), rank, [others[along_starts[along.index(axis)]]])
        if axis not in lacking and axis not in along:
            entry = entry + stretched(np.arange(length), rank, [next(running)])
        found.append(entry)
    return found, inside if "FILL" in str(mode) else np.ones_like(inside)


def gather(*, dimension_numbers: Any, slice_sizes: Sequence[int], mode: Any, fill_value: Any, **_: Any) -> Operation:
    """Windows of an array at computed places; what lies outside is filled where the mode says so."""
    of = dimension_numbers
    axes = of.start_index_map, of.collapsed_slice_dims, of.operand_batching_dims, of.start_indices_batching_dims

    def gathered(a: Any, starts: Any) -> Any:
        rank = np.ndim(starts) - 1 + len(of.offset_dims)
        entries, inside = _entries(a.shape, starts, slice_sizes, of.offset_dims, rank, axes, mode)
        found = a[tuple(entries)].reshape(np.broadcast_shapes(*(each.shape for each in entries)))
        return found if np.all(inside) else np.where(inside, found, _filling(a.dtype, fill_value))

    return gathered


def _filling(dtype: Any, value: Any) -> Any:
    if value is not None:
        return value
    if np.issubdtype(dtype, np.inexact):
        return np.nan
    if np.issubdtype(dtype, np.bool_):
        return True
    return np.iinfo(dtype).min if np.issubdtype(dtype, np.signedinteger) else np.iinfo(dtype).max


def scatter(write: Callable[[Any, Any, Any], object]) -> Callable[..., Operation]:
    """Windows of an array changed at computed places; those that lie outside are dropped where the mode says so."""

    def made(*, dimension_numbers: Any, mode: Any, **_: Any) -> Operation:
        of, without = dimension_numbers, dimension_numbers.inserted_window_dims
        along = of.operand_batching_dims, of.scatter_indices_batching_dims
        axes = of.scatter_dims_to_operand_dims, without, *along

        def scattered(a: Any, starts: Any, updates: Any) -> Any:
            window = iter(of.update_window_dims)
            sizes = [1 if axis in (*without, *along[0]) else updates.shape[next(window)] for axis in range(a.ndim)]
            entries, inside = _entries(a.shape, starts, sizes, of.update_window_dims, updates.ndim, axes, mode)
            written = np.broadcast_to(inside, updates.shape)
            found, index = np.array(a), tuple(np.broadcast_to(each, updates.shape)[written] for each in entries)
            write(found, index, updates[written])
            return found

        return scattered

    return made


def put(a: Any, index: Any, values: Any) -> None:
    """Set entries of an array."""
    a[index] = values


def of_matrices(function: Callable[..., Any]) -> Operation:
    """A function of matrices, of stacks of them."""

    def stacked(*arrays: Any) -> Any:
        batch = arrays[0].shape[:-2]
        found = [function(*(each[index] for each in arrays)) for index in np.ndindex(*batch)]
        if isinstance(found[0], tuple):
            return [np.reshape(each, (*batch, *np.shape(each)[1:])) for each in zip(*found, strict=True)]
        return np.reshape(found, (*batch, *found[0].shape))

    return stacked


def lu(**_: Any) -> Operation:
    """Both triangular factors in one matrix, the pivots, and the order of rows by them."""

    def factors(matrix: Any) -> tuple[Any, Any, Any]:
        factor, pivots, _ = GETRF(matrix)
        order = np.arange(matrix.shape[0], dtype=np.int32)
        for k, pivot in enumerate(pivots):
            order[[k, pivot]] = order[[pivot, k]]
        return factor, pivots.astype(np.int32), order

    return of_matrices(factors)


def triangular_solve(*, left_side: bool, lower: bool, transpose_a: bool, unit_diagonal: bool, **_: Any) -> Operation:
    """The solution of A x = b, or x A = b; not finite where A is singular."""

    def solved(a: Any, b: Any) -> Any:
        right, transposed = (b, transpose_a) if left_side else (b.T, not transpose_a)
        found, info = TRTRS(a, right, lower=lower, trans=int(transposed), unitdiag=unit_diagonal)
        found = found if info == 0 else np.full_like(right, np.nan)
        return found if left_side else found.T

    return of_matrices(solved)


def unstack(*, axis: int) -> Operation:
    """The parts of one entry each along an axis, which they lose."""
    return lambda a: one_or_all(list(np.moveaxis(a, axis, 0)))


def eigh(**_: Any) -> Operation:
    """Eigenvectors and eigenvalues of symmetric matrices, in ascending order."""
    return of_matrices(lambda matrix: tuple(np.linalg.eigh(matrix))[::-1])


WITH_SETTINGS: dict[str, Callable[..., Operation]] = {
    "broadcast_in_dim": broadcast_in_dim,
    "concatenate": lambda *, dimension: lambda *a: np.concatenate(a, dimension),
    "convert_element_type": converted,
    "dot_general": dot_general,
    "dynamic_slice": dynamic_slice,
    "dynamic_update_slice": dynamic_update_slice,
    "eigh": eigh,
    "gather": gather,
    "integer_pow": power,
    "iota": iota,
    "lu": lu,
    "pad": pad,
    "platform_index": lambda *, platforms, **_: (
        lambda: next(k for k, names in enumerate(platforms) if names is None or "cpu" in names)
    ),
    "reduce": summed_together,
    "reduce_and": reduced(np.all),
    "reduce_max": reduced(np.max),
    "reduce_min": reduced(np.min),
    "reduce_or": reduced(np.any),
    "reduce_sum": reduced(np.sum),
    "reshape": lambda *, new_sizes, **_: lambda a: np.reshape(a, new_sizes),
    "scatter": scatter(put),
    "scatter-add": scatter(np.add.at),
    "scatter-mul": scatter(np.multiply.at),
    "slice": part,
    "split": lambda *, sizes, axis: lambda a: one_or_all(np.split(a, np.cumsum(sizes)[:-1], axis)),
    "squeeze": lambda *, dimensions: lambda a: np.squeeze(a, tuple(dimensions)),
    "stack": lambda *, axis: lambda *a: np.stack(a, axis),
    "transpose": lambda *, permutation: lambda a: np.transpose(a, permutation),
    "triangular_solve": triangular_solve,
    "unstack": unstack,
}
"""Those with settings: what makes the function of them."""


def known(name: str, types: Sequence[Any], settings: Mapping[str, Any]) -> Operation | None:
    """The function for an operation on arrays of these types, None for one that has none here."""
    if name in ELEMENTWISE:
        return ELEMENTWISE[name]
    # These go by routines of LAPACK for float64.
    if name in ("lu", "triangular_solve", "eigh") and any(
        each != np.float64 for each in types if np.issubdtype(each, np.inexact)
    ):
        return None
    if name == "scatter" and settings["update_jaxpr"] is not None:  # of a function of what is there
        return None
    if name == "reduce" and any(each.primitive.name != "add" for each in settings["jaxpr"].jaxpr.eqns):
        return None
    if name in ("reduce_and", "reduce_or") and types[0] != np.bool_:
        return None
    return WITH_SETTINGS[name](**settings) if name in WITH_SETTINGS else None
