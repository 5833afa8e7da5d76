"""Programs that NumPy evaluates, operation by operation, as JAX traces them: for what is asked a handful of times.

To compile the forces about steady sliding and their slopes takes seconds, to trace them a tenth of that, and to
evaluate them in this way milliseconds. So the formulas stand in one place, as functions of JAX, whether they are
compiled for a transient of a million steps or evaluated once for its eigenvalues.

What is traced is a list of operations on arrays (a jaxpr, see JAX's documentation of it). Each becomes a function of
NumPy; one that has none is left to JAX, which compiles it by itself.
"""

import functools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from typing import Any

import jax
import numpy as np
from jax.core import Tracer
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal
from threadpoolctl import ThreadpoolController

from drumsqueal.numpy_operations import Operation, known, one_or_all, sum_of_products

MOST_KNOWN = 16  # of one function's traces, megabytes each; friction laws in Python have one each


class Interpreted:
    """A function of trees of arrays that NumPy evaluates, traced once for each structure of its arguments.

    Within another program it is part of that one. What arrays there are in its result are of NumPy. A plain number is
    part of the structure: give what changes as an array. It takes no keywords.
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


def one_thread() -> AbstractContextManager[Any]:
    """One thread for the algebra of some hundred or thousand rows, which more hardly speed up.

    Beside other work these wait for one another: eigenvalues of two bending shoes took 36 s on one, and 134 s on two.
    """
    return _libraries().limit(limits=1, user_api="blas")


@functools.cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()


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
    fixed = [None if is_array(part) or isinstance(part, Tracer) else part for part in parts]

    def call(arrays: list[np.ndarray]) -> Any:
        # As JAX does: what is not finite is looked at where it matters.
        with np.errstate(all="ignore"), one_thread():
            found = iter(evaluate(*arrays))
        return jax.tree.unflatten(form, [next(found) if part is None else part for part in fixed])

    return call


def evaluation(traced: ClosedJaxpr) -> Callable[..., list[np.ndarray]]:
    """What a traced function computes, by NumPy: arrays in, arrays out."""
    jaxpr, constants = traced.jaxpr, [np.asarray(each) for each in traced.consts]
    run, types = _program(jaxpr), [each.dtype for each in traced.out_avals]

    def evaluate(*arrays: np.ndarray) -> list[np.ndarray]:
        # Copies, as what is given may be one of the constants or what was taken.
        return [np.array(each, dtype) for each, dtype in zip(run(*constants, *arrays), types, strict=True)]

    return evaluate


class _Steps:
    """The operations of a program in their order, each with the places of what it takes and gives in one list.

    Programs within it are part of it, and what depends on nothing that is given is computed here, once.
    """

    def __init__(self) -> None:
        self.values: list[Any] = []
        self.steps: list[tuple[Operation, list[int], list[int]]] = []

    def place(self, value: Any = None) -> int:
        """A new place, of a value or of what a step gives."""
        self.values.append(value)
        return len(self.values) - 1

    def add(self, jaxpr: Jaxpr, inputs: Sequence[int]) -> list[int]:
        """Add a program of inputs at these places, and return those of its outputs."""
        known: dict[Any, int] = dict(zip((*jaxpr.constvars, *jaxpr.invars), inputs, strict=True))

        def find(variable: Any) -> int:
            if isinstance(variable, Literal):
                aval: Any = variable.aval
                return self.place(np.asarray(variable.val, aval.dtype)[()])
            return known[variable]

        for equation, taken, operation in _operations(jaxpr):
            places = [find(each) for each in taken]
            inner = WITHIN.get(equation.primitive.name)
            if operation is None and inner is not None:
                program = next(equation.params[name] for name in inner if name in equation.params)
                found = self.add_closed(program, places)
            else:
                found = self._add_step(operation or _operation(equation), places, equation)
            known |= zip(equation.outvars, found, strict=True)
        return [find(each) for each in jaxpr.outvars]

    def add_closed(self, program: Any, inputs: Sequence[int]) -> list[int]:
        """As `add`, of one that may have constants of its own."""
        if not isinstance(program, ClosedJaxpr):
            return self.add(program, inputs)
        return self.add(program.jaxpr, [*(self.place(np.asarray(each)) for each in program.consts), *inputs])

    def _add_step(self, operation: Operation, taken: list[int], equation: JaxprEqn) -> list[int]:
        size = sum(math.prod(getattr(each.aval, "shape", ())) for each in equation.outvars)
        # 1e5 numbers of what is computed once: more are not worth their memory
        if not equation.effects and size < 1e5 and all(self.values[each] is not None for each in taken):
            with np.errstate(all="ignore"):
                found = operation(*(self.values[each] for each in taken))
            return [self.place(each) for each in ([found] if len(equation.outvars) == 1 else found)]
        given = [self.place() for _ in equation.outvars]
        self.steps.append((operation, taken, given))
        return given

    def program(self, inputs: list[int], outputs: list[int]) -> Callable[..., list[Any]]:
        """The function of arrays for inputs, without what no output needs.

        A value that no later operation takes is dropped: the derivatives of a bending shoe would fill gigabytes.
        """
        needed, steps = set(outputs), []
        for step in reversed(self.steps):
            if not needed.isdisjoint(step[2]):
                steps.append((*step, [each for each in {*step[1], *step[2]} - needed if self.values[each] is None]))
                needed.update(step[1])
        steps.reverse()
        values = self.values

        def run(*arrays: Any) -> list[Any]:
            at = values.copy()
            for where, array in zip(inputs, arrays, strict=True):
                at[where] = array
            for operation, taking, giving, done in steps:
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


def _program(jaxpr: Jaxpr) -> Callable[..., list[Any]]:
    steps = _Steps()
    inputs = [steps.place() for _ in (*jaxpr.constvars, *jaxpr.invars)]
    return steps.program(inputs, steps.add(jaxpr, inputs))


def _operations(jaxpr: Jaxpr) -> Iterator[tuple[JaxprEqn, Sequence[Any], Operation | None]]:
    """Each operation with what it takes, and its function if that is not the usual one.

    A product of which only a sum is taken is one with that sum.
    """
    taken = [*(each for equation in jaxpr.eqns for each in equation.invars), *jaxpr.outvars]
    uses: Counter[Any] = Counter(each for each in taken if not isinstance(each, Literal))
    products: dict[Any, JaxprEqn] = {each.outvars[0]: each for each in jaxpr.eqns if each.primitive.name == "mul"}
    sums = {each.invars[0]: each for each in jaxpr.eqns if each.primitive.name == "reduce_sum"}
    alone = {each for each in sums if uses.get(each) == 1 and each in products}
    for equation in jaxpr.eqns:
        if equation.primitive.name == "reduce_sum" and equation.invars[0] in alone:
            product = products[equation.invars[0]]
            yield equation, product.invars, sum_of_products(equation.params["axes"])
        elif not (equation.primitive.name == "mul" and equation.outvars[0] in alone):
            yield equation, equation.invars, None


def _operation(equation: JaxprEqn) -> Operation:
    """The function of NumPy for an operation, of one result or of a list of them."""
    name, types = equation.primitive.name, [getattr(each.aval, "dtype", None) for each in equation.invars]
    if name in CONTROL:
        return CONTROL[name](**equation.params)
    return known(name, types, equation.params) or _left_to_jax(equation)


def _left_to_jax(equation: JaxprEqn) -> Operation:
    several = equation.primitive.multiple_results

    def bound(*arrays: Any) -> Any:
        with jax.ensure_compile_time_eval():  # not as a part of a program in which this may be asked for
            found = equation.primitive.bind(*(jax.numpy.asarray(each) for each in arrays), **equation.params)
        return one_or_all([np.asarray(each) for each in found]) if several else np.asarray(found)

    return bound


def _inlined(traced: Any) -> Callable[..., list[Any]]:
    """A program within a program."""
    if not isinstance(traced, ClosedJaxpr):
        return _program(traced)
    run, constants = _program(traced.jaxpr), [np.asarray(each) for each in traced.consts]
    return lambda *arrays: run(*constants, *arrays)


def _cond(*, branches: Sequence[ClosedJaxpr], **_: Any) -> Operation:
    ways = [_inlined(each) for each in branches]
    return lambda which, *arrays: one_or_all(ways[min(max(int(which), 0), len(ways) - 1)](*arrays))


def _while(*, cond_jaxpr: Any, body_jaxpr: Any, cond_nconsts: int, body_nconsts: int, **_: Any) -> Operation:
    goes_on, body = _inlined(cond_jaxpr), _inlined(body_jaxpr)

    def looped(*arrays: Any) -> Any:
        of_cond, of_body = arrays[:cond_nconsts], arrays[cond_nconsts : cond_nconsts + body_nconsts]
        state = list(arrays[cond_nconsts + body_nconsts :])
        while np.any(going := goes_on(*of_cond, *state)[0]):
            after = body(*of_body, *state)
            if np.ndim(going):  # of several at once, each stays where it has ended
                masks = [np.reshape(going, [*going.shape, *[1] * (np.ndim(new) - going.ndim)]) for new in after]
                after = [np.where(*each) for each in zip(masks, after, state, strict=True)]
            state = after
        return one_or_all(state)

    return looped


def _scan(*, jaxpr: ClosedJaxpr, length: int, reverse: bool, num_consts: int, num_carry: int, **_: Any) -> Operation:
    body, given = _inlined(jaxpr), jaxpr.out_avals[num_carry:]

    def scanned(*arrays: Any) -> Any:
        constants, state = arrays[:num_consts], list(arrays[num_consts : num_consts + num_carry])
        taken = arrays[num_consts + num_carry :]
        stacks = [np.empty((length, *each.shape), each.dtype) for each in given]
        for k in reversed(range(length)) if reverse else range(length):
            found = body(*constants, *state, *(each[k] for each in taken))
            state = found[:num_carry]
            for stack, each in zip(stacks, found[num_carry:], strict=True):
                stack[k] = each
        return one_or_all([*state, *stacks])

    return scanned


def _custom_linear_solve(*, const_lengths: Any, jaxprs: Any, **_: Any) -> Operation:
    solve, lengths = _inlined(jaxprs.solve), list(const_lengths)
    before, own = sum(lengths[:2]), lengths[2]  # constants of the product and of its transpose come first
    return lambda *arrays: one_or_all(solve(*arrays[before : before + own], *arrays[sum(lengths) :]))


CONTROL: dict[str, Callable[..., Operation]] = {
    "cond": _cond,
    "custom_linear_solve": _custom_linear_solve,
    "scan": _scan,
    "while": _while,
}
"""Operations that hold programs of their own, which run as often as it turns out."""
WITHIN: dict[str, tuple[str, ...]] = dict.fromkeys(
    ("custom_jvp_call", "custom_vjp_call", "jit"), ("jaxpr", "call_jaxpr")
)
"""Those that are part of the program that holds them, and what holds theirs."""
