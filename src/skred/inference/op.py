"""The forward map as a PyTensor Op: strengths and release places in, readings out.

All arrays that describe path, law and sensors are inputs of the node, not properties of the Op:
so the Op is stateless, two of them are always equal, they pickle as their class, and one compiled
function serves every campaign.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytensor.tensor as pt
from pytensor.gradient import DisconnectedType
from pytensor.graph.basic import Apply, Variable
from pytensor.graph.op import Op
from pytensor.link.numba.dispatch.basic import numba_njit, register_funcify_default_op_cache_key

from skred.physics.compiled import KERNEL_FINGERPRINT
from skred.physics.inputs import Contributions, Path
from skred.physics.kernel import simulate, simulate_with_jacobian

_CACHE_KEY = int(KERNEL_FINGERPRINT[:12], 16)
_INPUTS = (
    ("strengths", 2, "float64"),
    ("releases", 1, "float64"),
    ("edge", 1, "float64"),
    ("ground", 2, "float64"),
    ("barriers", 2, "float64"),
    ("limits", 1, "float64"),
    ("columns", 1, "int64"),
    ("profiles", 2, "float64"),
    ("weakening_speed", 0, "float64"),
    ("speed_terms", 0, "bool"),
    ("sensors", 2, "float64"),
)


class _ForwardMap(Op):
    """What both Ops share: their inputs."""

    __props__ = ()

    def _check(self, inputs: Sequence[Any]) -> list[Variable]:
        if len(inputs) != len(_INPUTS):
            raise TypeError(f"expected {len(_INPUTS)} inputs, found {len(inputs)}")
        variables = []
        for value, (name, ndim, dtype) in zip(inputs, _INPUTS, strict=True):
            variable = pt.as_tensor_variable(value)
            if variable.type.ndim != ndim:
                raise TypeError(f"{name}: expected {ndim} dimensions, found {variable.type.ndim}")
            if variable.type.dtype != dtype:
                if dtype != "float64":
                    raise TypeError(f"{name}: expected {dtype}, found {variable.type.dtype}")
                variable = pt.cast(variable, dtype)
            variables.append(variable)
        return variables

    def connection_pattern(self, node: Apply) -> list[list[bool]]:
        """Only strengths and releases are differentiated."""
        return [[name in ("strengths", "releases")] for name, _, _ in _INPUTS]

    @staticmethod
    def _arguments(inputs: Sequence[Any]) -> tuple[Any, ...]:
        strengths, releases, edge, ground, barriers, limits, columns, profiles, u_c, terms, sensors = inputs
        path = Path(edge, ground, barriers, limits)
        law = Contributions(columns, profiles, float(u_c), bool(terms))
        return strengths, releases, path, law, sensors


class FrontReadings(_ForwardMap):
    """Readings of fronts: (n_runs, n_strengths) and (n_runs,) to (n_runs, n_sensors).

    See `skred.physics.kernel.simulate`; `front_readings` is the convenient way to apply it.
    """

    def make_node(self, *inputs: Any) -> Apply:
        """Node with its inputs checked."""
        variables = self._check(inputs)
        shape = (variables[0].type.shape[0], variables[-1].type.shape[0])
        return Apply(self, variables, [pt.tensor(dtype="float64", shape=shape)])

    def perform(self, node: Apply, inputs: Sequence[Any], output_storage: Any) -> None:
        """Evaluate without PyTensor's numba backend."""
        output_storage[0][0] = simulate(*self._arguments(inputs))

    def infer_shape(self, fgraph: Any, node: Apply, input_shapes: Any) -> list[tuple[Any, ...]]:
        """(n_runs, n_sensors)."""
        return [(input_shapes[0][0], input_shapes[-1][0])]

    def pullback(
        self, inputs: Sequence[Variable], outputs: Sequence[Variable], cotangents: Sequence[Variable]
    ) -> list[Variable]:
        """Cotangent of strengths and releases through the tangent-linear jacobian."""
        jacobian = FrontReadingsJacobian()(*inputs)
        pulled = (cotangents[0][:, :, None] * jacobian).sum(axis=1)
        gradients: list[Variable] = [pulled[:, :-1], pulled[:, -1]]
        return gradients + [DisconnectedType()() for _ in inputs[2:]]


class FrontReadingsJacobian(_ForwardMap):
    """Derivatives of the readings: (n_runs, n_sensors, n_strengths + 1), the release last."""

    def make_node(self, *inputs: Any) -> Apply:
        """Node with its inputs checked."""
        variables = self._check(inputs)
        n_strengths = variables[0].type.shape[1]
        last = None if n_strengths is None else n_strengths + 1
        shape = (variables[0].type.shape[0], variables[-1].type.shape[0], last)
        return Apply(self, variables, [pt.tensor(dtype="float64", shape=shape)])

    def perform(self, node: Apply, inputs: Sequence[Any], output_storage: Any) -> None:
        """Evaluate without PyTensor's numba backend."""
        output_storage[0][0] = simulate_with_jacobian(*self._arguments(inputs))[1]

    def infer_shape(self, fgraph: Any, node: Apply, input_shapes: Any) -> list[tuple[Any, ...]]:
        """(n_runs, n_sensors, n_strengths + 1)."""
        return [(input_shapes[0][0], input_shapes[-1][0], input_shapes[0][1] + 1)]


@register_funcify_default_op_cache_key(FrontReadings)
def _funcify_readings(op: FrontReadings, node: Any = None, **kwargs: Any) -> Any:
    @numba_njit
    def front_readings(  # type: ignore[no-untyped-def]
        strengths, releases, edge, ground, barriers, limits, columns, profiles, u_c, terms, sensors
    ):
        path = Path(edge, ground, barriers, limits)
        law = Contributions(columns, profiles, u_c.item(), terms.item())
        return simulate(strengths, releases, path, law, sensors)

    return front_readings, _CACHE_KEY


@register_funcify_default_op_cache_key(FrontReadingsJacobian)
def _funcify_jacobian(op: FrontReadingsJacobian, node: Any = None, **kwargs: Any) -> Any:
    @numba_njit
    def front_readings_jacobian(  # type: ignore[no-untyped-def]
        strengths, releases, edge, ground, barriers, limits, columns, profiles, u_c, terms, sensors
    ):
        path = Path(edge, ground, barriers, limits)
        law = Contributions(columns, profiles, u_c.item(), terms.item())
        return simulate_with_jacobian(strengths, releases, path, law, sensors)[1]

    return front_readings_jacobian, _CACHE_KEY


def front_readings(
    strengths: Any, releases: Any, path: Path, law: Contributions, sensors: np.ndarray
) -> Variable:
    """Symbolic readings of fronts.

    Parameters
    ----------
    strengths : (n_runs, n_strengths) tensor
        In the order of the law's contributions, each in its own unit.
    releases : (n_runs,) tensor, m
    path : Path
    law : Contributions
    sensors : (n_sensors, 3) array
        See `skred.physics.geometry.sensor_table`.

    Returns
    -------
    (n_runs, n_sensors) tensor, m/s or m
    """
    result: Variable = FrontReadings()(
        strengths,
        releases,
        path.edge,
        path.ground,
        path.barriers,
        path.limits,
        law.columns,
        law.profiles,
        np.float64(law.weakening_speed),
        np.bool_(law.speed_terms),
        sensors,
    )
    return result
