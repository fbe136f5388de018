"""Quantities of a scene as functions of PyTorch: values, forward and reverse derivatives, ``torch.func.vmap``.

In: a `ballpass.runtime.QuantityFunction`.  Out: a function of PyTorch.  Needs ``pip install "ballpass[torch]"``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from numpy.typing import ArrayLike

from ballpass.runtime.certify.quantity_function import QuantityFunction
from ballpass.runtime.contract.extras import missing

try:
    import torch
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(missing("torch"), name="torch") from error


__all__ = ["wrap"]


def wrap(function: QuantityFunction) -> Callable[[ArrayLike | torch.Tensor | Mapping[str, torch.Tensor]], torch.Tensor]:
    """A function of PyTorch that gives the quantities of a `QuantityFunction`.

    It takes a tensor or array of shape (..., parameters), in the order of ``function.wrt``, or a mapping with some
    of these names, of which those left out keep the scene's values; all SI.  It gives a tensor of 64 bits of shape
    (..., quantities), or (...) where the function is of one name.  The models run on the processor, wherever the tensor
    is.  Derivatives are first ones, forward and reverse; ``function.certify`` checks them at a point.

    Raises
    ------
    RequestError
        When called: an unknown name, another shape; when differentiated: a law whose force jumps, or a second
        derivative.
    SimulationError
        A run failed.

    Examples
    --------
    >>> import torch, ballpass.torch
    >>> function = QuantityFunction(model, "rms:inner.y", ["bearing.clearance"], cycles=3)
    >>> f = ballpass.torch.wrap(function)
    >>> x = torch.tensor([8e-6], dtype=torch.float64, requires_grad=True)
    >>> f(x).backward()
    >>> x.grad.shape  # [m/m]
    torch.Size([1])
    """

    class Values(torch.autograd.Function):
        @staticmethod
        def forward(x: torch.Tensor) -> torch.Tensor:
            return torch.from_numpy(function(x.numpy()))

        @staticmethod
        def setup_context(ctx: Any, inputs: tuple[torch.Tensor], output: torch.Tensor) -> None:
            ctx.save_for_backward(*inputs)
            ctx.save_for_forward(*inputs)

        @staticmethod
        def backward(ctx: Any, grad: torch.Tensor) -> torch.Tensor:
            (x,) = ctx.saved_tensors
            product = grad[..., None] * Jacobian.apply(x)
            return product.sum(dim=-2) if function.shape else product

        @staticmethod
        def jvp(ctx: Any, moved: torch.Tensor) -> torch.Tensor:
            (x,) = ctx.saved_tensors
            return (Jacobian.apply(x) * (moved[..., None, :] if function.shape else moved)).sum(dim=-1)

        @staticmethod
        def vmap(info: Any, in_dims: tuple[int], x: torch.Tensor) -> tuple[torch.Tensor, int]:
            return Values.apply(x.movedim(in_dims[0], 0)), 0

    class Jacobian(torch.autograd.Function):
        @staticmethod
        def forward(x: torch.Tensor) -> torch.Tensor:
            return torch.from_numpy(function.jacobian(x.numpy()))

        @staticmethod
        def setup_context(ctx: Any, inputs: tuple[torch.Tensor], output: torch.Tensor) -> None:
            pass

        @staticmethod
        def backward(ctx: Any, grad: torch.Tensor) -> None:
            function.refuse_second()

        @staticmethod
        def jvp(ctx: Any, moved: torch.Tensor) -> None:
            function.refuse_second()

        @staticmethod
        def vmap(info: Any, in_dims: tuple[int], x: torch.Tensor) -> tuple[torch.Tensor, int]:
            return Jacobian.apply(x.movedim(in_dims[0], 0)), 0

    def wrapped(parameters: ArrayLike | torch.Tensor | Mapping[str, torch.Tensor]) -> torch.Tensor:
        if isinstance(parameters, Mapping):
            given = [torch.as_tensor(value, dtype=torch.float64) for value in function.arguments(parameters)]
            x = torch.stack(torch.broadcast_tensors(*given), dim=-1)
        elif isinstance(parameters, torch.Tensor):
            x = parameters
        else:  # numbers, which a tensor of its own would round to 32 bits
            x = torch.as_tensor(parameters, dtype=torch.float64)
        function.check_shape(tuple(x.shape))
        values: torch.Tensor = Values.apply(x.to("cpu", torch.float64))
        return values.to(x.device)

    return wrapped
