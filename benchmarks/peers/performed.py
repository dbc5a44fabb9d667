"""Ops as they would be without a numba dispatch: the same `perform`, the same graph."""

from __future__ import annotations

import warnings
from typing import Any

from pytensor.graph.basic import Variable
from pytensor.graph.fg import FunctionGraph

from skred.inference.array_op import ArrayOp


def _without_dispatch(op: ArrayOp) -> ArrayOp:
    """Op that evaluates as `op` does and that no backend knows.

    Not a subclass of the Op's class: it would inherit the dispatch.
    """

    class Performed(ArrayOp):
        array_inputs = op.array_inputs
        differentiable = op.differentiable

        def output_shape(self, shapes: Any) -> Any:
            return op.output_shape(shapes)

        def evaluate(self, inputs: Any) -> Any:
            return op.evaluate(inputs)

    return Performed()


def performed(inputs: list[Variable], outputs: list[Variable]) -> tuple[list[Variable], list[Variable]]:
    """Copy of a graph in which every `ArrayOp` is one without a dispatch.

    Returns
    -------
    inputs, outputs : list of Variable
        Of the copy.
    """
    graph = FunctionGraph(inputs, outputs, clone=True)
    for node in list(graph.toposort()):
        if isinstance(node.op, ArrayOp):
            graph.replace(node.outputs[0], _without_dispatch(node.op)(*node.inputs), import_missing=True)
    return list(graph.inputs), list(graph.outputs)


def expect_warnings() -> None:
    """PyTensor warns of what is measured on purpose: object mode, and the C machine without BLAS."""
    for message in ("Numba will use object mode", "PyTensor could not link to a BLAS"):
        warnings.filterwarnings("ignore", message=message, category=UserWarning)
