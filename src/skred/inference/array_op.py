"""Ops whose inputs are plain arrays of fixed rank and type, and that carry no state themselves.

All arrays that describe a campaign are inputs of the node, not properties of the Op: so two Ops of
a class are always equal, they pickle as their class, and one compiled function serves every
campaign.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

import pytensor.tensor as pt
from pytensor.graph.basic import Apply, Variable
from pytensor.graph.op import Op

ArrayInput = tuple[str, int, str]
"""Name, number of dimensions and dtype of an input."""


class ArrayOp(Op):
    """Base of the Ops around compiled functions."""

    __props__ = ()
    array_inputs: ClassVar[tuple[ArrayInput, ...]]
    differentiable: ClassVar[frozenset[str]] = frozenset()

    @abstractmethod
    def output_shape(self, shapes: Sequence[tuple[Any, ...]]) -> tuple[Any, ...]:
        """Shape of the one output from those of the inputs."""

    @abstractmethod
    def evaluate(self, inputs: Sequence[Any]) -> Any:
        """Value of the one output from numpy arrays."""

    def make_node(self, *inputs: Any) -> Apply:
        """Node with its inputs checked."""
        if len(inputs) != len(self.array_inputs):
            raise TypeError(f"expected {len(self.array_inputs)} inputs, found {len(inputs)}")
        variables = [
            self._checked(value, *expected) for value, expected in zip(inputs, self.array_inputs, strict=True)
        ]
        shape = self.output_shape([variable.type.shape for variable in variables])
        return Apply(self, variables, [pt.tensor(dtype="float64", shape=shape)])

    @staticmethod
    def _checked(value: Any, name: str, ndim: int, dtype: str) -> Variable:
        variable = pt.as_tensor_variable(value)
        if variable.type.ndim != ndim:
            raise TypeError(f"{name}: expected {ndim} dimensions, found {variable.type.ndim}")
        if variable.type.dtype == dtype:
            return variable
        if dtype != "float64":
            raise TypeError(f"{name}: expected {dtype}, found {variable.type.dtype}")
        return pt.cast(variable, dtype)

    def perform(self, node: Apply, inputs: Sequence[Any], output_storage: Any) -> None:
        """Evaluate without PyTensor's numba backend."""
        output_storage[0][0] = self.evaluate(inputs)

    def infer_shape(self, node: Apply, input_shapes: Any) -> list[tuple[Any, ...]]:
        """Shape without evaluating."""
        return [self.output_shape(input_shapes)]

    def connection_pattern(self, node: Apply) -> list[list[bool]]:
        """Which inputs the output is differentiated by."""
        return [[name in self.differentiable] for name, _, _ in self.array_inputs]
