"""The pooled log density as a PyTensor Op: mean response in, one log density per event out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pytensor.gradient import DisconnectedType
from pytensor.graph.basic import Variable
from pytensor.link.numba.dispatch.basic import numba_njit, register_funcify_default_op_cache_key

from skred.inference.array_op import ArrayOp
from skred.inference.pooled.density import (
    PooledArrays,
    pooled_log_density,
    pooled_log_density_pullback,
)
from skred.parallel.compile_cache import cache_key

_DATA = (
    ("release_of_event", 1, "int64"),
    ("readings", 2, "float64"),
    ("whiten", 3, "float64"),
    ("constant", 1, "float64"),
    ("n_stopped", 1, "int64"),
    ("stopped", 2, "int64"),
    ("regression", 3, "float64"),
    ("conditional", 3, "float64"),
    ("sign", 2, "float64"),
    ("cut", 2, "float64"),
    ("width", 2, "float64"),
)


class PooledLogDensity(ArrayOp):
    """Log density of each event: (n_releases, n_sensors) response to (n_events,)."""

    array_inputs = (("response", 2, "float64"), *_DATA)
    differentiable = frozenset({"response"})

    def output_shape(self, shapes: Sequence[tuple[Any, ...]]) -> tuple[Any, ...]:
        """(n_events,)."""
        return (shapes[2][0],)

    def evaluate(self, inputs: Sequence[Any]) -> Any:
        """Log densities from numpy arrays."""
        return pooled_log_density(inputs[0], PooledArrays(*inputs[1:]))

    def pullback(
        self, inputs: Sequence[Variable], outputs: Sequence[Variable], cotangents: Sequence[Variable]
    ) -> list[Variable]:
        """Cotangent of the response."""
        pulled: Variable = PooledLogDensityPullback()(cotangents[0], *inputs)
        return [pulled] + [DisconnectedType()() for _ in inputs[1:]]


class PooledLogDensityPullback(ArrayOp):
    """Cotangent of the response, (n_releases, n_sensors), from that of the densities, (n_events,)."""

    array_inputs = (("cotangent", 1, "float64"), ("response", 2, "float64"), *_DATA)

    def output_shape(self, shapes: Sequence[tuple[Any, ...]]) -> tuple[Any, ...]:
        """(n_releases, n_sensors)."""
        return tuple(shapes[1])

    def evaluate(self, inputs: Sequence[Any]) -> Any:
        """Cotangents from numpy arrays."""
        return pooled_log_density_pullback(inputs[0], inputs[1], PooledArrays(*inputs[2:]))


@register_funcify_default_op_cache_key(PooledLogDensity)
def _funcify_density(op: PooledLogDensity, node: Any = None, **kwargs: Any) -> Any:
    @numba_njit
    def pooled_density(response, *data):  # type: ignore[no-untyped-def]
        # PyTensor passes the inputs of an Op one by one.
        return pooled_log_density(response, PooledArrays(*data))

    return pooled_density, cache_key(pooled_log_density)


@register_funcify_default_op_cache_key(PooledLogDensityPullback)
def _funcify_pullback(op: PooledLogDensityPullback, node: Any = None, **kwargs: Any) -> Any:
    @numba_njit
    def pooled_density_pullback(cotangent, response, *data):  # type: ignore[no-untyped-def]
        return pooled_log_density_pullback(cotangent, response, PooledArrays(*data))

    return pooled_density_pullback, cache_key(pooled_log_density_pullback)
