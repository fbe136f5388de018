"""Quantities of a scene as functions of JAX: values, forward and reverse derivatives, ``vmap``, ``jit``.

In: a `ballpass.runtime.QuantityFunction`.  Out: a function of JAX.  Needs ``pip install "ballpass[jax]"`` and 64 bits.

The models run on the processor, called back by JAX (``jax.pure_callback``); a batch of ``vmap`` is one call, in lanes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ballpass.runtime.certify.quantity_function import QuantityFunction
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import missing

try:
    import jax
    import jax.numpy as jnp
    from jax.typing import ArrayLike
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(missing("jax"), name="jax") from error

__all__ = ["wrap"]


def wrap(function: QuantityFunction) -> Callable[[ArrayLike | Mapping[str, ArrayLike]], jax.Array]:
    """A function of JAX that gives the quantities of a `QuantityFunction`.

    It takes an array of shape (..., parameters), in the order of ``function.wrt``, or a mapping with some of these
    names, of which those left out keep the scene's values; all SI.  It gives an array of 64 bits of shape
    (..., quantities), or (...) where the function is of one name.

    Derivatives are first ones, forward and reverse; ``function.certify`` checks them at a point.  An error of a run is
    a `BallpassError`; from within ``jit`` and ``vmap`` JAX wraps it in a ``jax.errors.JaxRuntimeError``, with its
    message, and an interrupt (Ctrl-C) as well.

    Raises
    ------
    RequestError
        When called: JAX computes in 32 bits, an unknown name; when differentiated: a law whose force jumps, or a second
        derivative.

    Examples
    --------
    >>> import jax, ballpass.jax
    >>> jax.config.update("jax_enable_x64", True)
    >>> function = QuantityFunction(model, "rms:inner.y", ["bearing.clearance"], cycles=3)
    >>> f = ballpass.jax.wrap(function)
    >>> slope = jax.grad(f)({"bearing.clearance": 8e-6})  # [m/m]
    >>> list(slope), slope["bearing.clearance"].dtype
    (['bearing.clearance'], dtype('float64'))
    """
    count = len(function.wrt)

    def call(compute: Callable[[np.ndarray], np.ndarray], x: jax.Array, *shape: int) -> jax.Array:
        if not isinstance(x, jax.core.Tracer):
            return jnp.asarray(compute(np.asarray(x)))  # its errors reach the caller as they are
        result = jax.ShapeDtypeStruct((*x.shape[:-1], *shape), np.float64)
        return jax.pure_callback(lambda given: compute(np.asarray(given)), result, x, vmap_method="expand_dims")

    values = jax.custom_jvp(lambda x: call(function, x, *function.shape))
    jacobian = jax.custom_jvp(lambda x: call(function.jacobian, x, *function.shape, count))

    @values.defjvp
    def forward(primals: Sequence[jax.Array], tangents: Sequence[jax.Array]) -> tuple[jax.Array, jax.Array]:
        function.check_differentiable()
        (x,), (moved,) = primals, tangents
        if function.shape:
            moved = moved[..., None, :]
        return values(x), jnp.sum(jacobian(x) * moved, axis=-1)

    @jacobian.defjvp
    def refuse(primals: Sequence[jax.Array], tangents: Sequence[jax.Array]) -> None:
        function.refuse_second()

    def wrapped(parameters: ArrayLike | Mapping[str, ArrayLike]) -> jax.Array:
        if not jax.config.jax_enable_x64:
            raise RequestError(
                "ballpass.jax: JAX computes in 32 bits, too few for derivatives of a motion. Say at the start of the "
                'program: jax.config.update("jax_enable_x64", True)'
            )
        if isinstance(parameters, Mapping):
            given = function.arguments(parameters)
            x = jnp.stack(jnp.broadcast_arrays(*(jnp.asarray(value, float) for value in given)), axis=-1)
        else:
            x = jnp.asarray(parameters, float)
            function.check_shape(x.shape)
        return values(x)

    return wrapped
