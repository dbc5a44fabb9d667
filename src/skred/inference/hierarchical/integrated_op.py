"""The integrated log density as a PyTensor Op: population in, one log density per event out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pytensor.gradient import DisconnectedType
from pytensor.graph.basic import Variable
from pytensor.link.numba.dispatch.basic import numba_njit, register_funcify_default_op_cache_key

from skred.inference.array_op import ArrayOp
from skred.inference.hierarchical.event_density import (
    integrated_log_density,
    integrated_log_density_pullback,
)
from skred.parallel.compile_cache import cache_key

_NODES = (
    ("first", 1, "int64"),
    ("points", 2, "float64"),
    ("log_weights", 1, "float64"),
    ("log_widths", 1, "float64"),
)


class IntegratedLogDensity(ArrayOp):
    """Log density of each event: (n_events, n_strengths) means and their factor to (n_events,).

    See `skred.inference.hierarchical.event_density.integrated_log_density`.
    """

    array_inputs = (("means", 2, "float64"), ("factor", 2, "float64"), *_NODES)
    differentiable = frozenset({"means", "factor"})

    def output_shape(self, shapes: Sequence[tuple[Any, ...]]) -> tuple[Any, ...]:
        """(n_events,)."""
        return (shapes[0][0],)

    def evaluate(self, inputs: Sequence[Any]) -> Any:
        """Log densities from numpy arrays."""
        return integrated_log_density(*inputs)

    def pullback(
        self, inputs: Sequence[Variable], outputs: Sequence[Variable], cotangents: Sequence[Variable]
    ) -> list[Variable]:
        """Cotangents of means and factor."""
        pulled = IntegratedLogDensityPullback()(cotangents[0], *inputs)
        n_events = inputs[0].shape[0]
        return [pulled[:n_events], pulled[n_events:]] + [DisconnectedType()() for _ in _NODES]


class IntegratedLogDensityPullback(ArrayOp):
    """Cotangents of means and factor, one below the other, (n_events + n_strengths, n_strengths)."""

    array_inputs = (("cotangent", 1, "float64"), *IntegratedLogDensity.array_inputs)

    def output_shape(self, shapes: Sequence[tuple[Any, ...]]) -> tuple[Any, ...]:
        """(n_events + n_strengths, n_strengths)."""
        n_events, n_strengths = shapes[1]
        rows = None if n_events is None or n_strengths is None else n_events + n_strengths
        return (rows, n_strengths)

    def evaluate(self, inputs: Sequence[Any]) -> Any:
        """Cotangents from numpy arrays."""
        return integrated_log_density_pullback(*inputs)


@register_funcify_default_op_cache_key(IntegratedLogDensity)
def _funcify_density(op: IntegratedLogDensity, node: Any = None, **kwargs: Any) -> Any:
    @numba_njit
    def integrated_density(*inputs):  # type: ignore[no-untyped-def]
        return integrated_log_density(*inputs)

    return integrated_density, cache_key(integrated_log_density)


@register_funcify_default_op_cache_key(IntegratedLogDensityPullback)
def _funcify_pullback(op: IntegratedLogDensityPullback, node: Any = None, **kwargs: Any) -> Any:
    @numba_njit
    def integrated_density_pullback(*inputs):  # type: ignore[no-untyped-def]
        return integrated_log_density_pullback(*inputs)

    return integrated_density_pullback, cache_key(integrated_log_density_pullback)
