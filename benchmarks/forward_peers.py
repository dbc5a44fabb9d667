"""Two plain peers of the fast kernel: a straightforward numba loop and pure Python.

Both send fronts with Coulomb friction, curvature included, and turbulent drag down a track, run by run
and cell by cell, and read speeds at points and the runout. They solve what the kernel solves, switch of
the normal force and stops inside cells included, as one would write it without thinking about speed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

GRAVITY = 9.81


def numba_peer(
    edge_s_m: FloatArray,
    sin_slope: FloatArray,
    cos_slope: FloatArray,
    curvature: FloatArray,
    friction: FloatArray,
    drag: FloatArray,
    release_s_m: FloatArray,
    sensor_s_m: FloatArray,
) -> FloatArray:
    """Run all fronts in compiled code.

    Parameters
    ----------
    edge_s_m : (n_cells + 1,) array, m
    sin_slope, cos_slope, curvature : (n_cells,) array, curvature in 1/m
    friction, drag, release_s_m : (n_runs,) array; -, 1/m, m
    sensor_s_m : (n_sensors,) array, m, increasing

    Returns
    -------
    (n_runs, n_sensors + 1) array
        Speeds [m/s], 0 where the front did not come, and in the last column the runout [m].
    """
    readings: FloatArray = _compiled_runs(
        edge_s_m, sin_slope, cos_slope, curvature, friction, drag, release_s_m, sensor_s_m
    )
    return readings


def python_peer(
    edge_s_m: FloatArray,
    sin_slope: FloatArray,
    cos_slope: FloatArray,
    curvature: FloatArray,
    friction: FloatArray,
    drag: FloatArray,
    release_s_m: FloatArray,
    sensor_s_m: FloatArray,
) -> FloatArray:
    """Do what `numba_peer` does in pure Python; parameters and returns are the same."""
    track = (edge_s_m.tolist(), sin_slope.tolist(), cos_slope.tolist(), curvature.tolist())
    readings = np.zeros((len(friction), len(sensor_s_m) + 1))
    runs = zip(friction.tolist(), drag.tolist(), release_s_m.tolist(), strict=True)
    for run, (mu, d, release) in enumerate(runs):
        _plain_run(*track, mu, d, release, sensor_s_m.tolist(), readings[run])
    return readings


def _advance(v, rate, decay, length):  # type: ignore[no-untyped-def]
    """Speed squared after ``length``."""
    exponent = decay * length
    if abs(exponent) < 1e-12:
        return v + rate * length
    return v - rate * math.expm1(-exponent) / decay


def _distance(change, rate, decay):  # type: ignore[no-untyped-def]
    """Length over which v changes by ``change``."""
    straight = change / rate
    if abs(decay * straight) < 1e-12:
        return straight
    return -math.log1p(-decay * straight) / decay


def _run_with(compiled: Callable[..., Any]) -> Any:
    """One run that fills ``reading``, compiled by numba or left as it stands."""
    advance, distance = compiled(_advance), compiled(_distance)

    def run(  # type: ignore[no-untyped-def]
        edge_s, sin_slope, cos_slope, curvature, mu, drag, release, sensor_s, reading
    ):
        n_cells = len(sin_slope)
        n_sensors = len(sensor_s)
        cell = 0
        while cell < n_cells - 1 and edge_s[cell + 1] <= release:
            cell += 1
        sensor = 0
        while sensor < n_sensors and sensor_s[sensor] < release:
            sensor += 1
        reading[n_sensors] = release
        if sin_slope[cell] <= mu * cos_slope[cell]:
            return
        s = release
        v = 0.0
        while cell < n_cells:
            driving = 2.0 * GRAVITY * sin_slope[cell]
            weight = GRAVITY * cos_slope[cell]
            end = edge_s[cell + 1]
            contact = weight + curvature[cell] * v >= 0.0
            switched = False
            while True:
                # dv/ds = forcing - decay * v
                forcing = driving
                decay = 2.0 * drag
                if contact:
                    forcing -= 2.0 * mu * weight
                    decay += 2.0 * mu * curvature[cell]
                rate = forcing - decay * v
                end_v = advance(v, rate, decay, end - s)
                piece_end = end
                switches = False
                if curvature[cell] < 0.0 and not switched:
                    switch_v = -weight / curvature[cell]
                    if (end_v > switch_v) == contact:
                        switches = True
                        end_v = switch_v
                        piece_end = s + distance(switch_v - v, rate, decay)
                stops = end_v <= 0.0
                if stops:
                    end_v = 0.0
                    piece_end = s + distance(-v, rate, decay)
                while sensor < n_sensors and sensor_s[sensor] <= piece_end:
                    at = advance(v, rate, decay, sensor_s[sensor] - s)
                    reading[sensor] = math.sqrt(max(at, 0.0))
                    sensor += 1
                s = piece_end
                v = end_v
                if stops:
                    reading[n_sensors] = s
                    return
                if not switches:
                    break
                contact = not contact
                switched = True
            cell += 1
        reading[n_sensors] = s

    return compiled(run)


_plain_run = _run_with(lambda function: function)
_compiled_run = _run_with(numba.njit)


@numba.njit
def _compiled_runs(edge_s, sin_slope, cos_slope, curvature, mu, drag, release, sensor_s):  # type: ignore[no-untyped-def]
    readings = np.zeros((len(mu), len(sensor_s) + 1))
    for i in range(len(mu)):
        _compiled_run(
            edge_s, sin_slope, cos_slope, curvature, mu[i], drag[i], release[i], sensor_s, readings[i]
        )
    return readings
