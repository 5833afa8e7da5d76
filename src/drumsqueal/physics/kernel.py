"""Compile a small program as one kernel, as a processor runs it best."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.experimental.xla_metadata import set_xla_metadata
from jax.flatten_util import ravel_pytree

from drumsqueal.programs import Program

# XLA runs a program on a processor as a chain of kernels, some 50 ns from one to the next, and gives that up by itself
# only for loops of less than a kilobyte. The forces on a shoe take some ten kernels of 10 ns each: as one kernel a
# step takes a fifth of the time. The attributes mean nothing to other back ends.
ONE_KERNEL = {"inlineable": "false", "xla_cpu_small_call": "true"}
# LLVM prefers vectors of four numbers also where the processor has eight lanes; elsewhere this changes nothing. What
# XLA emits in its newer way takes 1.2 (a drum that bends) to 1.7 times (a rigid shoe) as long to compile, and at best
# 5 % less to run; JAX before 0.11 has the older one.
COMPILER_OPTIONS: dict[str, str | bool] = {"xla_cpu_prefer_vector_width": "512", "xla_cpu_use_fusion_emitters": False}


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
    return jax.tree.map(lambda output: set_xla_metadata(output, **ONE_KERNEL), outputs)


def kernel_of(function: Callable[..., Any], model: Any, *arguments: Any) -> Any:
    """Call it as one kernel; over cells plainly, where it is called seldom or has derivatives.

    There a kernel takes twice as long to compile, and with derivatives five times.
    """
    return function(model, *arguments) if model.contact.in_cells else one_kernel(function, model, *arguments)


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function as a program, see `programs.py`, with the options that kernels of small loops want."""
    return Program(function, COMPILER_OPTIONS)
