"""The forward map as a PyTensor Op: strengths and release places in, readings out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytensor.tensor as pt
from numpy.typing import NDArray
from pytensor.gradient import DisconnectedType
from pytensor.graph.basic import Variable
from pytensor.link.numba.dispatch.basic import numba_njit, register_funcify_default_op_cache_key

from skred.inference.array_op import ArrayOp
from skred.parallel.compile_cache import cache_key
from skred.physics.kernel.fronts import fill_readings, simulate, simulate_with_jacobian
from skred.physics.kernel.inputs import Contributions, Path


class _ForwardMap(ArrayOp):
    """What the forward map and its jacobian share: their inputs."""

    array_inputs = (
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
        ("release_speeds", 1, "float64"),
    )

    @staticmethod
    def _arguments(inputs: Sequence[Any]) -> tuple[Any, ...]:
        strengths, releases, edge, ground, barriers, limits, columns, profiles, u_c, terms, *rest = inputs
        path = Path(edge, ground, barriers, limits)
        law = Contributions(columns, profiles, float(u_c), bool(terms))
        return strengths, releases, path, law, *rest


class FrontReadings(_ForwardMap):
    """Readings of fronts: (n_runs, n_strengths) and (n_runs,) to (n_runs, n_sensors).

    See `skred.physics.kernel.fronts.simulate`; `front_readings` is the convenient way to apply it.
    """

    differentiable = frozenset({"strengths", "releases"})

    def output_shape(self, shapes: Sequence[tuple[Any, ...]]) -> tuple[Any, ...]:
        """(n_runs, n_sensors)."""
        return (shapes[0][0], shapes[-2][0])

    def evaluate(self, inputs: Sequence[Any]) -> Any:
        """Readings from numpy arrays."""
        return simulate(*self._arguments(inputs))

    def pullback(
        self, inputs: Sequence[Variable], outputs: Sequence[Variable], cotangents: Sequence[Variable]
    ) -> list[Variable]:
        """Cotangent of strengths and releases through the tangent-linear jacobian."""
        jacobian = FrontReadingsJacobian()(*inputs)
        pulled = (cotangents[0][:, :, None] * jacobian).sum(axis=1)
        return [pulled[:, :-1], pulled[:, -1]] + [DisconnectedType()() for _ in inputs[2:]]


class FrontReadingsJacobian(_ForwardMap):
    """Derivatives of the readings: (n_runs, n_sensors, n_strengths + 1), the release last."""

    def output_shape(self, shapes: Sequence[tuple[Any, ...]]) -> tuple[Any, ...]:
        """(n_runs, n_sensors, n_strengths + 1)."""
        n_strengths = shapes[0][1]
        return (shapes[0][0], shapes[-2][0], None if n_strengths is None else n_strengths + 1)

    def evaluate(self, inputs: Sequence[Any]) -> Any:
        """Jacobian from numpy arrays."""
        return simulate_with_jacobian(*self._arguments(inputs))[1]


@register_funcify_default_op_cache_key(FrontReadings)
def _funcify_readings(op: FrontReadings, node: Any = None, **kwargs: Any) -> Any:
    @numba_njit
    def front_readings(  # type: ignore[no-untyped-def]
        strengths, releases, edge, ground, barriers, limits, columns, profiles, u_c, terms, sensors, begin
    ):
        # PyTensor passes the inputs of an Op one by one.
        path = Path(edge, ground, barriers, limits)
        law = Contributions(columns, profiles, u_c.item(), terms.item())
        readings, none = np.empty((releases.size, sensors.shape[0])), np.empty((releases.size, 0))
        jacobian = np.empty((releases.size, sensors.shape[0], 0))
        where = sensors, np.empty((0, 0))  # none is moved
        fill_readings(strengths, releases, begin * begin, path, law, *where, readings, jacobian, none)
        return readings

    return front_readings, cache_key(fill_readings)


@register_funcify_default_op_cache_key(FrontReadingsJacobian)
def _funcify_jacobian(op: FrontReadingsJacobian, node: Any = None, **kwargs: Any) -> Any:
    @numba_njit
    def front_readings_jacobian(  # type: ignore[no-untyped-def]
        strengths, releases, edge, ground, barriers, limits, columns, profiles, u_c, terms, sensors, begin
    ):
        # PyTensor passes the inputs of an Op one by one.
        path = Path(edge, ground, barriers, limits)
        law = Contributions(columns, profiles, u_c.item(), terms.item())
        readings, none = np.empty((releases.size, sensors.shape[0])), np.empty((releases.size, 0))
        jacobian = np.empty((releases.size, sensors.shape[0], strengths.shape[1] + 1))
        where = sensors, np.empty((0, 0))  # none is moved
        fill_readings(strengths, releases, begin * begin, path, law, *where, readings, jacobian, none)
        return jacobian

    return front_readings_jacobian, cache_key(fill_readings)


def front_readings(
    strengths: Any,
    releases: Any,
    path: Path,
    law: Contributions,
    sensors: NDArray[np.float64],
    release_speeds: Any = None,
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
    release_speeds : (n_runs,) tensor, m/s, optional
        How fast fronts are at their releases; by default they start from rest. No derivative goes by it.

    Returns
    -------
    (n_runs, n_sensors) tensor, m/s or m
    """
    releases = pt.as_tensor_variable(releases)
    begin = pt.zeros_like(releases, dtype="float64") if release_speeds is None else release_speeds
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
        begin,
    )
    return result
